"""Work on many items on the workers of a dask scheduler: many items a task, and no item lost with its worker."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from typing import Any, NamedTuple

from aqualog.campaign.cluster_worker import Asked, asked_of, own_stamp, unlike
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.guard.reading import limits_from
from aqualog.guard.worker import NO_LIMITS, Bounds, Crashed, Limits, WorkOn, kept_worker

__all__ = ["bounds_here", "on_cluster"]

_MOST_IN_TASK = 32
_TASKS_PER_THREAD = 4  # of the whole work, so that the last ones end together
_IN_HAND = 3  # tasks per thread that the scheduler knows of at a time
_ANSWER_S = 10.0
_WORKERS_S = 30.0
_ALONE_S = 120.0  # without any worker half way; queues need a while to start the next
_WATCH_S = 2.0
_LOOK_S = 0.02


@contextmanager
def on_cluster(
    address: str, *, limits: Limits = NO_LIMITS, tell: Callable[[str], None] = lambda _: None
) -> Iterator[WorkOn]:
    """Workers behind a scheduler in place of `aqualog.guard.worker.work_on`.

    Parameters
    ----------
    address : str
        As dask writes it: `tcp://host:8786`.
    limits : Limits
        Limits of one item; the limits for a reading step in this process's environment hold on the workers too.
    tell : callable
        Called with the number of workers.

    Workers process each item in a separate process; an item that ends its process is recorded as `Crashed`. If a worker
    ends, dask gives its task to another one. A task that has ended several workers is split, and the item that still
    ends them is recorded as `Crashed`, too. All paths of the tasks must mean the same on every worker, also on those
    that join later.

    Raises
    ------
    ConfigError
        If dask is not installed, no scheduler answers, it has no workers, or one of these runs another aqualog or does
        not see the files; if a limit of the environment is no number.
    AqualogError
        If the scheduler, or the last worker, is lost at work.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ConfigError("--cluster needs dask", hint="pip install 'aqualog[cluster]'") from error
    bounds = Bounds(limits, limits_from(os.environ))
    with _quiet():
        try:
            # a client waits for ever where something else answers
            asyncio.run(asyncio.wait_for(_answer(address), 2.0 * _ANSWER_S))
            client: Any = Client(address, timeout=_ANSWER_S, set_as_default=False)
        except Exception as error:  # another kind of server may answer: dask then asks for exabytes, or a web socket
            raise ConfigError(
                "no dask scheduler answers", where=address, expected="its address, tcp://host:8786",
                hint="`dask scheduler` there, then `dask worker tcp://host:8786` on each machine",
            ) from error  # fmt: skip
        try:
            threads = _ready(client, address)
            tell(f"{len(client.scheduler_info(n_workers=-1)['workers'])} workers, {threads} threads")
            yield lambda tasks, work, record: _work_on(client, address, threads, bounds, tasks, work, record)
        finally:
            client.close(timeout=_ANSWER_S)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep dask's own messages off the terminal; one line reports what matters."""
    names = ["asyncio", *(n for n in logging.root.manager.loggerDict if n.split(".")[0] in ("distributed", "tornado"))]
    levels = {n: logging.getLogger(n).level for n in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


async def _answer(address: str) -> None:
    """See that a scheduler answers there.

    Raises
    ------
    Exception
        If none answers; the type depends on dask and on what answers.
    """
    from distributed.comm import connect
    from distributed.security import Security

    comm: Any = await connect(address, timeout=_ANSWER_S, **Security().get_connection_args("client"))
    try:
        await comm.write({"op": "identity", "reply": True})
        found = await comm.read()
    finally:
        comm.abort()
    kind = found.get("type") if isinstance(found, dict) else None
    if kind != "Scheduler":
        raise ValueError(f"a {kind} answers")


def _ready(client: Any, address: str) -> int:
    """Threads of all workers, which run this very code."""
    try:
        client.wait_for_workers(1, timeout=_WORKERS_S)
    except TimeoutError as error:
        raise ConfigError(
            f"has no workers after {_WORKERS_S:.0f} s", where=address, hint=f"`dask worker {address}` on each machine"
        ) from error
    except (OSError, RuntimeError) as error:
        raise _lost(address, error) from error
    own = own_stamp()
    for worker, stamp in _everywhere(client, address, own_stamp).items():
        if stamp != own:
            raise ConfigError(
                f"worker {worker} runs another aqualog ({stamp[0]}, here {own[0]})", where=address,
                expected="the same code everywhere, or results would differ",
            )  # fmt: skip
    return max(1, sum(int(n) for n in client.nthreads().values()))


def _everywhere(client: Any, address: str, ask: Callable[..., Any], *args: Any) -> dict[str, Any]:
    from distributed.comm import CommClosedError

    try:
        return dict(client.run(ask, *args))
    except (OSError, CommClosedError) as error:
        raise _lost(address, error) from error
    except Exception as error:
        raise ConfigError(
            f"a worker cannot run aqualog ({type(error).__name__}: {error})", where=address,
            hint="the same aqualog in every worker's environment",
        ) from error  # fmt: skip


def _work_on(
    client: Any,
    address: str,
    threads: int,
    bounds: Bounds,
    tasks: Mapping[Any, tuple[Any, ...]],
    work: Callable[..., Any],
    record: Callable[[Any, Any], None],
) -> None:
    with asked_of(tasks) as asked:
        for worker, lack in _everywhere(client, address, unlike, asked).items():
            if lack is not None:
                raise _unfit(address, worker, lack)
        _all(client, address, threads, bounds, asked, tasks, work, record)


def _all(
    client: Any,
    address: str,
    threads: int,
    bounds: Bounds,
    asked: Asked,
    tasks: Mapping[Any, tuple[Any, ...]],
    work: Callable[..., Any],
    record: Callable[[Any, Any], None],
) -> None:
    from distributed import as_completed
    from distributed.client import FutureCancelledError
    from distributed.comm import CommClosedError
    from distributed.scheduler import KilledWorker

    items = list(tasks.items())
    size = max(1, min(_MOST_IN_TASK, len(items) // (_TASKS_PER_THREAD * threads)))
    todo = [items[i : i + size] for i in range(0, len(items), size)]
    waiting = iter(todo)
    held: dict[Any, Sequence[tuple[Any, tuple[Any, ...]]]] = {}

    def submit(part: Sequence[tuple[Any, tuple[Any, ...]]]) -> Any:
        future = client.submit(_part, asked, bounds, work, [t for _, t in part], pure=False)
        held[future] = part
        return future

    began = time.monotonic()
    try:
        first = [submit(p) for p in islice(waiting, _IN_HAND * threads)]
        done: Any = as_completed(first, loop=client.loop)
        watch = _Watch(client, address)
        while held:
            if not done.has_ready():
                watch.look()
                time.sleep(_LOOK_S)
                continue
            future = next(done)
            part = held.pop(future)
            error = future.exception()
            if isinstance(error, KilledWorker):
                if len(part) == 1:
                    record(part[0][0], Crashed(time.monotonic() - began))
                else:
                    done.update([submit([item]) for item in part])
            elif error is not None:
                raise _lost(address, error) from error
            else:
                results = future.result()
                if isinstance(results, Unfit):
                    raise _unfit(address, *results)
                for (name, _), result in zip(part, results, strict=True):
                    record(name, result)
            future.release()
            done.update([submit(p) for p in islice(waiting, 1)])
    except (OSError, CommClosedError, FutureCancelledError) as error:
        raise _lost(address, error) from error
    except BaseException:
        # items in work are finished and kept; items not begun must not be started
        with suppress(OSError, CommClosedError, FutureCancelledError, RuntimeError):
            client.cancel(list(held), force=True)
        raise


class _Watch:
    """Checks that there are workers: a scheduler without workers waits for ever."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address
        self._seen = self._looked = time.monotonic()

    def look(self) -> None:
        """Check at intervals.

        Raises
        ------
        AqualogError
            If there have been no workers for a while.
        """
        now = time.monotonic()
        if now - self._looked < _WATCH_S:
            return
        self._looked = now
        if self._client.nthreads():
            self._seen = now
        elif now - self._seen > _ALONE_S:
            raise AqualogError(
                f"has had no workers for {now - self._seen:.0f} s", where=self._address,
                hint=f"`dask worker {self._address}` on each machine; finished results are kept, the same command "
                "goes on with the rest",
            )  # fmt: skip


class Unfit(NamedTuple):
    """A worker that cannot take part, with the reason."""

    worker: str
    lack: ConfigError


def _part(
    asked: Asked, bounds: Bounds, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
) -> list[Any] | Unfit:
    from distributed import get_worker

    worker: Any = get_worker()
    lack = unlike(asked)
    if lack is not None:
        return Unfit(str(worker.address), lack)
    try:
        here = bounds_here(bounds, worker.memory_manager.memory_limit)
    except ConfigError as error:
        lack = ConfigError(f"has {error.where}, which {error.what}", expected=error.expected)
        return Unfit(str(worker.address), lack)
    with kept_worker(here, worker.local_directory) as do:
        return [do(work, *t) for t in tasks]


def bounds_here(asked: Bounds, memory: int | None) -> Bounds:
    """The requested limits, else those of this worker's environment; never more memory than dask gives the worker.

    Parameters
    ----------
    asked : Bounds
        Of the command; None is not set.
    memory : int or None
        dask's limit of the worker, which it keeps for the worker's own process only. [byte]

    Raises
    ------
    ConfigError
        If a variable of the environment is not a number.
    """
    given = {name: value for name, value in asked.reading._asdict().items() if value is not None}
    reading = limits_from(os.environ)._replace(**given)
    most = [m for m in (reading.memory_here(), memory) if m]
    return Bounds(asked.item, reading._replace(memory=min(most, default=0)))


def _unfit(address: str, worker: str, lack: ConfigError) -> ConfigError:
    return ConfigError(f"worker {worker} {lack.what}", where=address, expected=lack.expected, hint=lack.hint)


def _lost(address: str, error: BaseException) -> AqualogError:
    return AqualogError(
        f"the scheduler or its work is lost ({type(error).__name__}: {str(error)[:200]})", where=address,
        hint="the logs that are done are kept, the same command goes on with the rest",
    )  # fmt: skip
