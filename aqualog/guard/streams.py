"""Standard streams of a process: there whatever the shell has closed, no work fails with stderr, no panics on it."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress

__all__ = ["CLOSED", "ForeignStderr", "PanicFilter", "SafeStderr", "open_streams"]

_PANIC = re.compile(rb"thread '.*'(?: \(\d+\))? panicked at ")
_MORE = re.compile(rb"[ \t]+\S|note: run with `RUST_BACKTRACE|stack backtrace:")
_AT_ONCE = 1 << 20  # [bytes]; a library that writes without end must not keep the watching process


class SafeStderr(io.TextIOWrapper):
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
    def on(cls, number: int, encoding: str = "utf-8") -> SafeStderr:
        """On a descriptor, which stays open."""
        raw = io.FileIO(number, "w", closefd=False)
        return cls(io.BufferedWriter(raw), encoding=encoding, errors="replace", line_buffering=True)


CLOSED: set[int] = set()
"""Standard streams that the shell has closed."""


def open_streams() -> None:
    """Let closed streams lead nowhere; else a library would write to the next file that is opened."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            CLOSED.add(number)
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            else:
                os.set_inheritable(number, True)  # noqa: FBT003
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="replace", closefd=False)
    if sys.stderr is None or type(sys.stderr) is io.TextIOWrapper:
        sys.stderr = SafeStderr.on(2, sys.stderr.encoding if sys.stderr else "utf-8")


class ForeignStderr:
    """A pipe in place of a worker's stderr, for all that is not written by Python there.

    A panic of a compiled library prints lines of its own in whatever thread it happens. It then arrives as an error of
    the log, which is reported.
    """

    def __init__(self) -> None:
        self._read = self._write = -1
        self._rest = b""
        self._filter = PanicFilter()
        with suppress(OSError):
            os.fstat(2)  # it may be closed
            self._read, self._write = os.pipe()
            os.set_blocking(self._read, False)

    def begin(self) -> None:
        """In the worker: Python goes on with stderr, libraries and processes started here have the pipe."""
        if self._read >= 0:
            os.close(self._read)
            sys.stderr = SafeStderr.on(os.dup(2), sys.stderr.encoding)
            os.dup2(self._write, 2)
            os.close(self._write)

    def watch(self) -> None:
        """In the process that watches: the other end is the worker's."""
        if self._read >= 0:
            os.close(self._write)

    def pass_on(self) -> bool:
        """Pass on what has come so far, in whole lines, but for endless ones. Whether there was any."""
        came = bytearray()
        with suppress(OSError):  # there is nothing, for now
            while self._read >= 0 and len(came) < _AT_ONCE and (data := os.read(self._read, 65536)):
                came += data
        if came:
            *lines, self._rest = (self._rest + came).split(b"\n")
            _write(b"".join(line + b"\n" for line in self._filter.kept(lines)))
        if len(self._rest) > _AT_ONCE:
            _write(b"".join(self._filter.kept([self._rest])))
            self._rest = b""
        return bool(came)

    def end(self) -> None:
        """The same for the last time: the worker has ended."""
        self.pass_on()  # a pipe holds less than is read at once
        _write(b"\n".join(self._filter.kept([self._rest] if self._rest else [])))
        with suppress(OSError):
            os.close(self._read)


class PanicFilter:
    """Leaves out lines of panics: `thread 'x' panicked at file:1:2:`, its message, and the empty line before it."""

    def __init__(self) -> None:
        self._is_message = self._is_in = False
        self._empty = 0

    def kept(self, lines: Iterable[bytes]) -> Iterator[bytes]:
        """Return lines to pass on; empty ones wait for the line after them."""
        for line in lines:
            if _PANIC.match(line):
                self._is_message = self._is_in = True
                self._empty = 0
            elif self._is_message:
                self._is_message = False
            elif self._is_in and _MORE.match(line):
                pass
            elif not line:
                self._is_in = False
                self._empty += 1
            else:
                self._is_in = False
                yield from [b""] * self._empty
                self._empty = 0
                yield line


def _write(data: bytes) -> None:
    with suppress(OSError):
        while data:
            data = data[os.write(2, data) :]
