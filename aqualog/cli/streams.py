"""The standard streams of a command: there whatever the shell has closed, and a stderr that no work fails with."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress

__all__ = ["Told", "ready"]


class Told(io.TextIOWrapper):
    """A stderr that nobody needs to read: a reader that has gone or a full disk costs the lines, never the work."""

    def write(self, text: str) -> int:
        """Write what can be written."""
        with suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        """Flush what can be."""
        with suppress(OSError):
            super().flush()

    @classmethod
    def on(cls, number: int, encoding: str = "utf-8") -> Told:
        """On a descriptor, which stays open."""
        raw = io.FileIO(number, "w", closefd=False)
        return cls(io.BufferedWriter(raw), encoding=encoding, errors="replace", line_buffering=True)


def ready() -> None:
    """Let streams that are closed lead nowhere; else the next file that is opened would be what a library writes to."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            else:
                os.set_inheritable(number, True)
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="replace", closefd=False)
    if sys.stderr is None or type(sys.stderr) is io.TextIOWrapper:
        sys.stderr = Told.on(2, sys.stderr.encoding if sys.stderr else "utf-8")
