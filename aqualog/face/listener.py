"""Who hears what a long call is doing."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

__all__ = ["Listener", "Progress", "listener"]


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
