"""One case: what is wrong with its outcome, within limits of time and memory."""

import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from tests.fuzz.corpus import Case
from tests.fuzz.registry import MEGABYTES, SECONDS, Target

MOST = 3_000_000_000  # [byte] that the process may have


class Slow(BaseException):
    """No `Exception`: nobody must take it for a fault of the file."""


def _stop(*_: object) -> None:
    raise Slow


def limited() -> None:
    """From now on this process has a limit of memory, and notices a case that takes too long."""
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (MOST, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    signal.signal(signal.SIGPROF, _stop)


@contextmanager
def limited_meanwhile() -> Iterator[None]:
    """The same in a process that goes on with other work, and whose children must not inherit it."""
    import resource

    had, handler = resource.getrlimit(resource.RLIMIT_DATA), signal.getsignal(signal.SIGPROF)
    limited()
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, had)
        signal.signal(signal.SIGPROF, handler)


def peak() -> float:
    """Peak of this process' memory so far. [MB]"""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def judged(target: Target, case: Case) -> str | None:
    """What is wrong, or None. A case that hangs is told after `SECONDS` of processor time."""
    try:
        data = case.content(target)
        before = peak()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        if case.seed and target.known is not None:
            target.known(case.seed, case.damages, data)
        else:
            target.one(data)
    except Slow as error:
        return f"hangs in {_place(error.__traceback__)}"
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the panic of a compiled library is no Exception
        told = " ".join(str(error).split())[:300]
        return f"{type(error).__name__} in {_place(error.__traceback__)}: {told}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    grown = peak() - before
    return f"takes {grown:.0f} MB" if grown > MEGABYTES else None


def _place(trace: TracebackType | None) -> str:
    """Where an error came from: the innermost line of aqualog, else of the target."""
    frames = traceback.extract_tb(trace)
    own = [f for f in frames if "/aqualog/" in f.filename] or [f for f in frames if "/fuzz/" in f.filename] or frames
    return f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else "?"
