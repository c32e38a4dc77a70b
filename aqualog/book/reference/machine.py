"""Pages of what a script and a machine need: exit codes, variables of the environment."""

from __future__ import annotations

from aqualog.book.markdown import code, page, table
from aqualog.core.errors import AqualogError, ConfigError, ExitCode, FitError, LogError, SignalError

__all__ = ["MEANINGS", "VARIABLES", "environment_page", "exit_codes_page"]

_EXIT_CODES = "The exit code says to a script how a command ended."
_EXIT_CODES_HOW = """
One line on stderr says what went wrong, where, what was expected and what to try. A traceback appears only with
`--debug`.
"""
MEANINGS = {
    ExitCode.DONE: ("done", "the result is complete; all six verdicts of `diagnose` are results"),
    ExitCode.FAILED: ("failed", "a log cannot be read, the disk is full, or aqualog has a fault"),
    ExitCode.USAGE: ("usage or configuration", "an option, a name or a settings file is wrong, or a file would be "
                     "overwritten; nothing was done"),
    ExitCode.PARTIAL: ("done, but not with all data", "the result is there; data of a log was lost, or some logs could "
                       "not be read. Lost is what a file that is cut off, damaged or changed no longer has, and "
                       "samples whose time stamps are doubled or stray, from 1 % on. Values that aqualog leaves out "
                       "(dropouts, spikes, frozen, filled or impossible ones) are reported, and are no loss. `doctor` "
                       "reads all channels, other commands those that they need"),
    ExitCode.NOTHING_USABLE: ("nothing usable", "signals are missing, the data do not carry the estimate, or with "
                              "`--fail-on-event` aquaplaning could not be judged; it wins over 3"),
    ExitCode.GATE_TRIPPED: ("a gate has tripped", "`--fail-on-event` found an episode of aquaplaning, or a `--gate` "
                            "was not kept; it wins over 3"),
    ExitCode.INTERRUPTED: ("interrupted", "Ctrl-C or a request to end; files that were finished are whole"),
}  # fmt: skip
_ERRORS = (ConfigError, LogError, SignalError, FitError)


def exit_codes_page() -> str:
    """The page."""
    rows = [(code(str(int(c))), *MEANINGS[c]) for c in ExitCode]
    errors = [(code(e.__name__), code(str(int(e.exit_code))), (e.__doc__ or "").split("\n\n")[0]) for e in _ERRORS]
    return page(
        "Exit codes",
        _EXIT_CODES,
        _EXIT_CODES_HOW,
        table(("code", "meaning", "when"), rows),
        "## Errors in Python",
        "From Python the same faults are exceptions. "
        f"All derive from `{AqualogError.__name__}` in `{AqualogError.__module__}`.",
        table(("exception", "exit code", "meaning"), errors),
    )


_ENVIRONMENT = "The variables of the environment that aqualog reads."
_LIMITS = """
A command reads logs in a process of its own. Limits keep a damaged log from taking time, memory or disk without end.
The command then names the log, starts again without it and goes on. The defaults are far above honest work, and 0 lifts
a limit. In `batch`, `--limit-s` and `--limit-mb` replace the first three. Used from Python, nothing is limited. Windows
and macOS work in the process that was called.
"""
VARIABLES: dict[str, dict[str, tuple[str, str]]] = {
    "Limits of reading": {
        "AQUALOG_LIMIT_S": ("time of one step of reading (opening, decoding, a piece) [s]", "300 s, and 5 s per MB"),
        "AQUALOG_LIMIT_CPU_S": ("processor time of one step [s]", "the same"),
        "AQUALOG_LIMIT_MB": ("private memory of the process [MB], 300 or more", "0.8 of what the machine or its "
                             "control group has, 2000 at least"),
        "AQUALOG_LIMIT_FILE_MB": ("a file that is written while a log is read [MB]", "10,000, and 4 times the log"),
        "AQUALOG_LIMITS": ("`off`: read in the process that was called, without limits", "on"),
    },
    "Cache of aligned signals": {
        "AQUALOG_CACHE": ("folder in which aligned signals are kept; commands then keep them without `--cache`", ""),
        "AQUALOG_CACHE_MB": ("most that is kept [MB]; what was not used for longest goes first", "2000"),
        "XDG_CACHE_HOME": ("the user's cache folder: compiled code, and signals that `--cache` keeps (Linux, macOS)",
                           "~/.cache"),
        "LOCALAPPDATA": ("the same on Windows", ""),
        "TMPDIR": ("folder for temporary files", "/tmp"),
    },
    "Terminal": {
        "NO_COLOR": ("set: no bold or underlined text", ""),
        "TERM": ("`dumb`: no line of progress that renews itself, no bold text", ""),
        "COLUMNS": ("width of tables and of `aqualog help`", "that of the terminal"),
        "PAGER": ("program that shows long pages of `aqualog help`", "less"),
        "LESS": ("its options", "FRX"),
    },
    "Machine": {
        "BROWSER_PATH": ("Chromium or Chrome, which makes pictures of figures", "found on the path"),
        "POLARS_MAX_THREADS": ("threads that read one log", "one per core, 4 at most; 1 in a process of `batch`"),
    },
}  # fmt: skip
_REMOTE = """
A store behind a URL (`s3://bucket/store`) takes endpoint and keys from the environment as fsspec and the protocol's
package read it: `AWS_ENDPOINT_URL`, `AWS_ACCESS_KEY_ID` and their like. On a cluster each worker needs them.
"""


def environment_page() -> str:
    """The page."""
    parts: list[str] = []
    for title, variables in VARIABLES.items():
        rows = [(code(n), meaning, default) for n, (meaning, default) in variables.items()]
        about = _LIMITS if title.startswith("Limits") else ""
        parts += [f"## {title}", about, table(("variable", "meaning", "default"), rows)]
    return page("Environment variables", _ENVIRONMENT, *parts, "## Remote stores", _REMOTE)
