"""Exit codes."""

from __future__ import annotations

from aqualog.book.markdown import code, page, table
from aqualog.core.errors import AqualogError, ConfigError, ExitCode, FitError, LogError, SignalError

__all__ = ["MEANINGS", "text"]

_SUMMARY = "The exit code says to a script how a command ended."
_HOW = """
One line on stderr says what went wrong, where, what was expected and what to try. A traceback appears only with
`--debug`.
"""
MEANINGS = {
    ExitCode.DONE: ("done", "the result is complete; all six verdicts of `diagnose` are results"),
    ExitCode.FAILED: ("failed", "a log cannot be read, the disk is full, or aqualog has a fault"),
    ExitCode.USAGE: ("usage or configuration", "an option, a name or a settings file is wrong, or a file would be "
                     "overwritten; nothing was done"),
    ExitCode.PARTIAL: ("done, but not with all data", "the result is there; data of a log was lost, or some logs could "
                       "not be read"),
    ExitCode.NOTHING_USABLE: ("nothing usable", "signals are missing, or the data do not carry the estimate"),
    ExitCode.GATE_TRIPPED: ("a gate has tripped", "`--fail-on-event` found an event; it wins over 3"),
    ExitCode.INTERRUPTED: ("interrupted", "Ctrl-C or a request to end; files that were finished are whole"),
}  # fmt: skip
_ERRORS = (ConfigError, LogError, SignalError, FitError)


def text() -> str:
    """The page."""
    rows = [(code(str(int(c))), *MEANINGS[c]) for c in ExitCode]
    errors = [(code(e.__name__), code(str(int(e.exit_code))), (e.__doc__ or "").split("\n\n")[0]) for e in _ERRORS]
    return page(
        "Exit codes",
        _SUMMARY,
        _HOW,
        table(("code", "meaning", "when"), rows),
        "## Errors in Python",
        "From Python the same faults are exceptions. "
        f"All derive from `{AqualogError.__name__}` in `{AqualogError.__module__}`.",
        table(("exception", "exit code", "meaning"), errors),
    )
