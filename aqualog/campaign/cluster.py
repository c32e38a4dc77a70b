"""Work on many items on the workers of a dask scheduler: many items a task, and no item lost with its worker."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

from aqualog.errors import AqualogError, ConfigError
from aqualog.workers import Crashed, WorkOn

__all__ = ["on_cluster"]

_MOST_IN_TASK = 32
_TASKS_PER_THREAD = 4  # of the whole work, so that the last ones end together
_IN_HAND = 3  # tasks per thread that the scheduler knows of at a time
_ANSWER_S = 10.0
_WORKERS_S = 30.0


@contextmanager
def on_cluster(address: str, *, tell: Callable[[str], None] = lambda _: None) -> Iterator[WorkOn]:
    """Workers behind a scheduler in place of `aqualog.workers.work_on`.

    Parameters
    ----------
    address : str
        As dask writes it: `tcp://host:8786`.
    tell : callable
        Told how many workers there are.

    A worker that ends is replaced by another one: dask gives its task to the next; a task that has ended several
    is taken apart, and the item that ends one by itself is recorded as `Crashed`. All paths of the tasks must mean the
    same on every worker.

    Raises
    ------
    ConfigError
        If dask is not installed, no scheduler answers, it has no workers, or these run another aqualog.
    AqualogError
        If the scheduler is lost at work.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ConfigError("--cluster needs dask", hint="pip install 'aqualog[cluster]'") from error
    try:
        client: Any = Client(address, timeout=_ANSWER_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ConfigError(
            "no dask scheduler answers", where=address, expected="its address, tcp://host:8786",
            hint="`dask scheduler` there, then `dask worker tcp://host:8786` on each machine",
        ) from error  # fmt: skip
    try:
        threads = _ready(client, address)
        tell(f"{len(client.scheduler_info(n_workers=-1)['workers'])} workers, {threads} threads")
        yield lambda tasks, work, record: _work_on(client, address, threads, tasks, work, record)
    finally:
        client.close(timeout=_ANSWER_S)


def _ready(client: Any, address: str) -> int:
    """Threads of all workers, which run this very code."""
    from distributed.comm import CommClosedError

    try:
        client.wait_for_workers(1, timeout=_WORKERS_S)
        stamps = client.run(_stamp)
    except TimeoutError as error:
        raise ConfigError(
            f"has no workers after {_WORKERS_S:.0f} s", where=address, hint=f"`dask worker {address}` on each machine"
        ) from error
    except (OSError, CommClosedError) as error:
        raise _lost(address, error) from error
    except Exception as error:
        raise ConfigError(
            f"a worker cannot run aqualog ({type(error).__name__}: {error})", where=address,
            hint="the same aqualog in every worker's environment",
        ) from error  # fmt: skip
    own = _stamp()
    other = {worker: stamp for worker, stamp in stamps.items() if stamp != own}
    if other:
        worker, (version, _) = next(iter(other.items()))
        raise ConfigError(
            f"worker {worker} runs another aqualog ({version}, here {own[0]})", where=address,
            expected="the same code everywhere, or results would differ",
        )  # fmt: skip
    return max(1, sum(int(n) for n in client.nthreads().values()))


def _stamp() -> tuple[str, str]:
    from aqualog import __version__
    from aqualog.campaign.key import code_stamp

    return __version__, code_stamp()


def _work_on(
    client: Any,
    address: str,
    threads: int,
    tasks: Mapping[Any, tuple[Any, ...]],
    work: Callable[..., Any],
    record: Callable[[Any, Any], None],
) -> None:
    from distributed import as_completed
    from distributed.comm import CommClosedError
    from distributed.scheduler import KilledWorker

    items = list(tasks.items())
    size = max(1, min(_MOST_IN_TASK, len(items) // (_TASKS_PER_THREAD * threads)))
    todo = [items[i : i + size] for i in range(0, len(items), size)]
    waiting = iter(todo)
    held: dict[Any, Sequence[tuple[Any, tuple[Any, ...]]]] = {}

    def submit(part: Sequence[tuple[Any, tuple[Any, ...]]]) -> Any:
        future = client.submit(_part, work, [t for _, t in part], pure=False)
        held[future] = part
        return future

    began = time.monotonic()
    try:
        first = [submit(p) for p in islice(waiting, _IN_HAND * threads)]
        done: Any = as_completed(first, loop=client.loop)
        for future in done:
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
                for (name, _), result in zip(part, future.result(), strict=True):
                    record(name, result)
            future.release()
            done.update([submit(p) for p in islice(waiting, 1)])
    except (OSError, CommClosedError) as error:
        raise _lost(address, error) from error
    except BaseException:
        # what is in work is finished there and kept; what is not begun must not be
        client.cancel(list(held), force=True)
        raise


def _part(work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> list[Any]:
    return [work(*t) for t in tasks]


def _lost(address: str, error: BaseException) -> AqualogError:
    return AqualogError(
        f"the scheduler or its work is lost ({type(error).__name__}: {str(error)[:200]})", where=address,
        hint="the logs that are done are kept, the same command goes on with the rest",
    )  # fmt: skip
