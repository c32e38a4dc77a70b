"""Who hears what a long call is doing."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

__all__ = ["Counted", "Listener", "Progress", "lasting", "listener"]


class Listener:
    """Hears the steps of a call and the notes that cannot wait for its end; this one ignores them all.

    `mode` is how steps are shown: `bar` (one line that renews itself), `plain` (a line each) or `off`.
    """

    mode = "off"

    def __call__(self, step: str) -> None:
        """Begin a step of the work."""

    def note(self, text: str) -> None:
        """Hear something that the user should know now."""

    def detail(self, text: str) -> None:
        """Hear something that the user may want to know."""

    def failed(self, name: str, reason: str) -> None:
        """Hear that one input among many failed; the call goes on with the others."""

    def settled(self, where: str) -> None:
        """Hear that all inputs have been tried; the file `where` lists all that failed."""

    def slow(self, what: str) -> AbstractContextManager[object]:
        """Enclose work whose first run compiles `what`."""
        return nullcontext()


Progress = Listener | Callable[[str], object] | None
"""What a function of the face takes as `progress`: nothing, a callable such as `print`, or a listener."""


class _Steps(Listener):
    mode = "plain"

    def __init__(self, hear: Callable[[str], object]) -> None:
        self._hear = hear

    def __call__(self, step: str) -> None:
        self._hear(step)

    def note(self, text: str) -> None:
        self._hear(f"note: {text}")

    def failed(self, name: str, reason: str) -> None:
        self._hear(f"error: {name}: {reason}")


def listener(progress: Progress) -> Listener:
    """Return the listener behind an argument `progress`."""
    if progress is None:
        return Listener()
    return progress if isinstance(progress, Listener) else _Steps(progress)


_EVERY_S = {"bar": 0.1, "plain": 30.0}
_PLAIN_SHARE = 0.1  # with lines instead of a bar: one every tenth, or every half minute


class Counted:
    """A line that renews itself: `312 of 1000 logs, 31 a second, 22 s left, 2 failed`.

    Parameters
    ----------
    steps : Listener
    what : str
        The items, in the plural.
    """

    def __init__(self, steps: Listener, what: str) -> None:
        self._steps, self._what = steps, what
        self._began = time.monotonic()
        self._first: int | None = None
        self._last, self._last_done = -1e9, -1

    def __call__(self, done: int, total: int, failed: int = 0) -> None:
        """Report how far the work is."""
        now = time.monotonic()
        if self._first is None:
            self._first, self._began = done, now
        is_due = now - self._last >= _EVERY_S.get(self._steps.mode, 1e9)
        if self._steps.mode == "plain":
            is_due |= done - self._last_done >= max(1.0, _PLAIN_SHARE * total)
        if done < total and not is_due:
            return
        self._last, self._last_done = now, done
        made, seconds = done - self._first, now - self._began
        text = f"{done} of {total} {self._what}"
        if made > 0 and seconds > 0.0:
            rate = made / seconds
            speed = f"{rate:.0f} a second" if rate >= 10.0 else f"{rate:.1f} a second"
            text += f", {speed if rate >= 0.1 else f'{60.0 * rate:.1f} a minute'}"
            if done < total:
                text += f", {lasting((total - done) / rate)} left"
        self._steps(text + (f", {failed} failed" if failed else ""))


def lasting(seconds: float) -> str:
    """A time in words: `42 s`, `7 min`, `3 h 20 min`."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
