"""Work on many items on the workers of a dask scheduler: many items a task, and no item lost with its worker."""

from __future__ import annotations

import asyncio
import logging
import os
import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from aqualog import __version__
from aqualog.campaign.jobs import code_stamp
from aqualog.campaign.place import is_url, place_of
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.guard.reading import limits_from
from aqualog.guard.worker import NO_LIMITS, Bounds, Crashed, Limits, WorkOn, kept_worker
from aqualog.io.atomic_write import write_text

__all__ = ["Asked", "Stamp", "asked_of", "bounds_here", "on_cluster", "own_stamp", "unlike"]

Stamp = tuple[str, str]
"""Version and hash of the source code behind a result."""
Tasks = Mapping[Any, tuple[Any, ...]]
_Items = Sequence[tuple[Any, tuple[Any, ...]]]


class Asked(NamedTuple):
    """Requirements on a worker: this code, files with their sizes [byte], places behind URLs with a mark in each."""

    stamp: Stamp
    files: tuple[tuple[Path, int], ...]
    places: tuple[tuple[str, str], ...] = ()


def own_stamp() -> Stamp:
    """Stamp of this process."""
    return __version__, code_stamp()


@contextmanager
def asked_of(tasks: Tasks) -> Iterator[Asked]:
    """Requirements for these tasks: a few of their files, and marks in their folders while the work lasts.

    Every machine may have a folder of the same name; only a shared folder has the mark.
    """
    some = list(tasks.values())
    some = [some[i] for i in sorted({0, len(some) // 2, len(some) - 1})] if some else []
    values = [v for task in some for x in task for v in (x if isinstance(x, tuple) else (x,))]
    paths = list(dict.fromkeys(v for v in values if isinstance(v, Path)))
    marks = [p / _mark() for p in paths if p.is_dir()]
    urls = dict.fromkeys(v for task in some for v in task if isinstance(v, str) and is_url(v))
    places: list[tuple[str, str]] = []
    try:
        for url in urls:
            name = _mark()
            with suppress(OSError, AqualogError):  # the batch's own results show it
                place_of(url).write(name, b"seen\n")
                places.append((url, name))
        for mark in marks:
            with suppress(OSError):  # a read-only source folder; a folder that must be written raises its own error
                write_text(mark, "seen\n")
        files = [p for p in (*paths, *marks) if p.is_file()]
        yield Asked(own_stamp(), tuple((p, p.stat().st_size) for p in files), tuple(places))
    finally:
        for url, name in places:
            with suppress(OSError, AqualogError):
                place_of(url).remove(name)
        for mark in marks:
            with suppress(OSError):
                mark.unlink(missing_ok=True)


def _mark() -> str:
    return f".seen-{secrets.token_hex(4)}.json.tmp"


_fit: set[Asked] = set()  # requirements that this process was found to meet


def unlike(asked: Asked) -> ConfigError | None:
    """On a worker: the missing requirement, if any; checked once per process, since workers may join at any time."""
    if asked in _fit:
        return None
    own = own_stamp()
    if own != asked.stamp:
        return ConfigError(
            f"runs another aqualog ({own[0]}, there {asked.stamp[0]})",
            expected="the same code everywhere, or results would differ",
        )
    missing = _missing(asked.files)
    if missing:
        return ConfigError(
            f"does not see {missing}", expected="logs and store under the same paths on every machine",
            hint="a disk that all share; for results also --store with a URL",
        )  # fmt: skip
    for url, name in asked.places:
        lack = _out_of_reach(url, name)
        if lack:
            return ConfigError(
                f"cannot use the store {place_of(url).name} ({lack})", expected="what this machine can",
                hint="keys and packages of the store's protocol in the environment of every worker",
            )  # fmt: skip
    _fit.add(asked)
    return None


def _out_of_reach(url: str, name: str) -> str:
    """Reason why results cannot be written there, also if it is not the place with the mark."""
    try:
        place = place_of(url)
        if not place.has(name):
            return "it is another one here"
        own = _mark()
        place.write(own, b"seen\n")
        place.remove(own)
    except (OSError, AqualogError) as error:
        return (error.what if isinstance(error, AqualogError) else error.strerror) or type(error).__name__
    return ""


def _missing(files: Sequence[tuple[Path, int]]) -> str:
    for path, size in files:
        try:
            there = path.stat().st_size
        except OSError:
            # a mark stands for its folder
            return str(path.parent if path.name.startswith(".seen-") else path)
        if there != size:
            return f"{path} as it is here ({there} byte, not {size})"
    return ""


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

    `address` as dask writes it: `tcp://host:8786`; `limits` of one item, and those for a reading step in this
    process's environment hold on the workers too; `tell` is called with the number of workers.

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
            scheduler = _Scheduler(client, address, bounds)
            threads = scheduler.ready()
            tell(f"{len(client.scheduler_info(n_workers=-1)['workers'])} workers, {threads} threads")
            yield lambda tasks, work, record: scheduler.work_on(threads, tasks, work, record)
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
    """See that a scheduler answers there, or raise; the type depends on dask and on what answers."""
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


@dataclass(slots=True)
class _Scheduler:
    """A scheduler with its workers, through dask's client."""

    client: Any
    address: str
    bounds: Bounds

    def ready(self) -> int:
        """Threads of all workers, which run this very code."""
        try:
            self.client.wait_for_workers(1, timeout=_WORKERS_S)
        except TimeoutError as error:
            raise ConfigError(
                f"has no workers after {_WORKERS_S:.0f} s", where=self.address,
                hint=f"`dask worker {self.address}` on each machine",
            ) from error  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise self.lost(error) from error
        own = own_stamp()
        for worker, stamp in self.everywhere(own_stamp).items():
            if stamp != own:
                raise ConfigError(
                    f"worker {worker} runs another aqualog ({stamp[0]}, here {own[0]})", where=self.address,
                    expected="the same code everywhere, or results would differ",
                )  # fmt: skip
        return max(1, sum(int(n) for n in self.client.nthreads().values()))

    def everywhere(self, ask: Callable[..., Any], *args: Any) -> dict[str, Any]:
        """The answer of each worker."""
        from distributed.comm import CommClosedError

        try:
            return dict(self.client.run(ask, *args))
        except (OSError, CommClosedError) as error:
            raise self.lost(error) from error
        except Exception as error:
            raise ConfigError(
                f"a worker cannot run aqualog ({type(error).__name__}: {error})", where=self.address,
                hint="the same aqualog in every worker's environment",
            ) from error  # fmt: skip

    def work_on(
        self, threads: int, tasks: Tasks, work: Callable[..., Any], record: Callable[[Any, Any], None]
    ) -> None:  # fmt: skip
        """As `WorkOn`, with so many threads of all workers."""
        with asked_of(tasks) as asked:
            for worker, lack in self.everywhere(unlike, asked).items():
                if lack is not None:
                    raise self.unfit(worker, lack)
            items = list(tasks.items())
            size = max(1, min(_MOST_IN_TASK, len(items) // (_TASKS_PER_THREAD * threads)))
            todo = [items[i : i + size] for i in range(0, len(items), size)]
            self._parts(todo, _IN_HAND * threads, lambda part: (_part, asked, self.bounds, work, part), record)

    def _parts(
        self, todo: Sequence[_Items], most: int, call: Callable[[Sequence[tuple[Any, ...]]], tuple[Any, ...]],
        record: Callable[[Any, Any], None],
    ) -> None:  # fmt: skip
        """Work on the parts, at most so many known to the scheduler; a part that ends its workers is split."""
        from distributed import as_completed
        from distributed.client import FutureCancelledError
        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker

        waiting = iter(todo)
        held: dict[Any, _Items] = {}

        def submit(part: _Items) -> Any:
            future = self.client.submit(*call([t for _, t in part]), pure=False)
            held[future] = part
            return future

        began = seen = looked = time.monotonic()
        try:
            done: Any = as_completed([submit(p) for p in islice(waiting, most)], loop=self.client.loop)
            while held:
                if not done.has_ready():
                    if time.monotonic() - looked >= _WATCH_S:
                        looked = time.monotonic()
                        seen = self._last_seen(seen, looked)
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
                    raise self.lost(error) from error
                else:
                    results = future.result()
                    if isinstance(results, Unfit):
                        raise self.unfit(*results)
                    for (name, _), result in zip(part, results, strict=True):
                        record(name, result)
                future.release()
                done.update([submit(p) for p in islice(waiting, 1)])
        except (OSError, CommClosedError, FutureCancelledError) as error:
            raise self.lost(error) from error
        except BaseException:
            # items in work are finished and kept; items not begun must not be started
            with suppress(OSError, CommClosedError, FutureCancelledError, RuntimeError):
                self.client.cancel(list(held), force=True)
            raise

    def _last_seen(self, seen: float, now: float) -> float:
        """When there were workers; AqualogError if not for a while, as a scheduler without workers waits for ever."""
        if self.client.nthreads():
            return now
        if now - seen > _ALONE_S:
            raise AqualogError(
                f"has had no workers for {now - seen:.0f} s", where=self.address,
                hint=f"`dask worker {self.address}` on each machine; finished results are kept, the same command "
                "goes on with the rest",
            )  # fmt: skip
        return seen

    def unfit(self, worker: str, lack: ConfigError) -> ConfigError:
        return ConfigError(f"worker {worker} {lack.what}", where=self.address, expected=lack.expected, hint=lack.hint)

    def lost(self, error: BaseException) -> AqualogError:
        return AqualogError(
            f"the scheduler or its work is lost ({type(error).__name__}: {str(error)[:200]})", where=self.address,
            hint="the logs that are done are kept, the same command goes on with the rest",
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

    `asked` are those of the command; None is not set. `memory` [byte] is dask's limit of the worker, which dask keeps
    for the worker's own process only. ConfigError if a variable of the environment is not a number.
    """
    given = {name: value for name, value in asked.reading._asdict().items() if value is not None}
    reading = limits_from(os.environ)._replace(**given)
    most = [m for m in (reading.memory_here(), memory) if m]
    return Bounds(asked.item, reading._replace(memory=min(most, default=0)))
