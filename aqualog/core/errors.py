"""What can go wrong, as classes.

AqualogError
├── ConfigError     a TOML file, an option or a name is wrong          exit 2
├── LogError        a file cannot be read: unknown, damaged, cut       exit 1
├── SignalError     a signal is missing, ambiguous or has a bad unit   exit 4
└── FitError        the data do not carry the estimate asked for       exit 4

Every message is one line: what, where (file, channel, time or line), what was expected, what to try.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

__all__ = ["AqualogError", "ConfigError", "ExitCode", "FitError", "LogError", "SignalError", "listed"]


class ExitCode(IntEnum):
    """Exit codes of the command line."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    PARTIAL = 3  # done, but data was lost or some inputs failed
    NOTHING_USABLE = 4
    GATE_TRIPPED = 5
    INTERRUPTED = 130


MOST_OF_LOG = 500


def _short(text: str) -> str:
    """Begin and end of a long text."""
    if len(text) <= MOST_OF_LOG:
        return text
    half = MOST_OF_LOG // 2 - 3
    return f"{text[:half]} ... {text[-half:]}"


class AqualogError(Exception):
    """Base of all errors that a user can act on.

    Parameters
    ----------
    what : str
        What went wrong.
    where : str
        File, channel, line or time; empty if it does not apply.
    expected : str
        What would have been right.
    hint : str
        What to try next.
    """

    exit_code = ExitCode.FAILED

    def __init__(self, what: str, *, where: str = "", expected: str = "", hint: str = "") -> None:
        self.what = what
        self.where = where
        self.expected = expected
        self.hint = hint
        super().__init__(self.line())

    def line(self) -> str:
        """One line for the terminal."""
        text = f"{_short(self.where)}: {self.what}" if self.where else self.what
        if self.expected:
            text += f"; expected {self.expected}"
        if self.hint:
            text += f". Try: {self.hint}"
        return " ".join(text.split())


class ConfigError(AqualogError):
    """A configuration file, an option or a name in one is wrong."""

    exit_code = ExitCode.USAGE


class LogError(AqualogError):
    """A log cannot be read.

    What a damaged file says may be of any length (a name, a line that a library cannot understand): no part of the
    message is longer than `MOST_OF_LOG` characters.
    """

    exit_code = ExitCode.FAILED

    def __init__(self, what: str, *, where: str = "", expected: str = "", hint: str = "") -> None:
        super().__init__(_short(what), where=where, expected=_short(expected), hint=_short(hint))


class SignalError(AqualogError):
    """A signal is missing, ambiguous, or cannot be understood."""

    exit_code = ExitCode.NOTHING_USABLE


class FitError(AqualogError):
    """The data do not carry the estimate that was asked for."""

    exit_code = ExitCode.NOTHING_USABLE


def listed(names: Sequence[str], most: int) -> str:
    """At most so many names, and how many there are beyond, for a message."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
