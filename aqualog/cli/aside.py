"""What libraries write to stderr by themselves: passed on, except panics, which the command reports in one line."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress

from aqualog.cli.streams import Told

__all__ = ["Aside", "Lines"]

_PANIC = re.compile(rb"thread '.*'(?: \(\d+\))? panicked at ")
_AT_ONCE = 1 << 20  # [bytes]; who writes without end must not keep the one that watches
_MORE = re.compile(rb"[ \t]+\S|note: run with `RUST_BACKTRACE|stack backtrace:")


class Aside:
    """A pipe in place of a worker's stderr, for all that is not written by Python there.

    A panic of a compiled library prints lines of its own in whatever thread it happens, and then arrives as an error
    of the log, which is reported.
    """

    def __init__(self) -> None:
        self._read = self._write = -1
        self._rest = b""
        self._lines = Lines()
        with suppress(OSError):
            os.fstat(2)  # it may be closed
            self._read, self._write = os.pipe()
            os.set_blocking(self._read, False)

    def begin(self) -> None:
        """In the worker: Python goes on with stderr, libraries and processes started here have the pipe."""
        if self._read < 0:
            return
        os.close(self._read)
        sys.stderr = Told.on(os.dup(2), sys.stderr.encoding)
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
            _tell(b"".join(line + b"\n" for line in self._lines.kept(lines)))
        if len(self._rest) > _AT_ONCE:
            _tell(b"".join(self._lines.kept([self._rest])))
            self._rest = b""
        return bool(came)

    def end(self) -> None:
        """The same for the last time: the worker has ended."""
        self.pass_on()  # a pipe holds less than is read at once
        _tell(b"\n".join(self._lines.kept([self._rest] if self._rest else [])))
        with suppress(OSError):
            os.close(self._read)


class Lines:
    """Which lines are no panic's: `thread 'x' panicked at file:1:2:`, what it says, and the empty line before it."""

    def __init__(self) -> None:
        self._is_next = self._is_in = False
        self._empty = 0

    def kept(self, lines: Iterable[bytes]) -> Iterator[bytes]:
        """Return lines to pass on; empty ones wait for the line after them."""
        for line in lines:
            if _PANIC.match(line):
                self._is_next = self._is_in = True
                self._empty = 0
            elif self._is_next:
                self._is_next = False
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


def _tell(data: bytes) -> None:
    with suppress(OSError):
        while data:
            data = data[os.write(2, data) :]
