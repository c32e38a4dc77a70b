"""What goes to stderr, and how errors become exit codes."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO, cast

import typer

from aqualog.core.errors import AqualogError, ConfigError, ExitCode
from aqualog.core.units import displayed_units
from aqualog.face.listener import Listener
from aqualog.guard.command import supervised

if TYPE_CHECKING:
    from aqualog.face.result import Result

__all__ = ["Console", "Heard", "clean", "clean_line", "guarded", "leave_without_stdout", "told_if_interrupted"]

_SHOWN_AT_ONCE = 20  # reasons why inputs failed
_NAMED = 5  # inputs with one of them
SLOW_S = 5.0  # a first step that takes longer than this is compiling
_LINE = 2000  # characters that anybody reads of a line
PROGRESS_MODES = ("auto", "bar", "plain", "off")


def clean(text: str) -> str:
    """Text without control characters, so that a name in a log cannot drive the terminal; endless lines are cut.

    Units stand as on pages.
    """
    shown = "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in displayed_units(text))
    lines = shown.split("\n")
    return "\n".join(x if len(x) <= _LINE else f"{x[: _LINE - 40]}… ({len(x)} characters)" for x in lines)


def clean_line(text: str) -> str:
    """The same of a message: what a line break in a name puts on a line of its own is no message of aqualog's."""
    return clean(text).replace("\n", "\n  ")


@dataclass(frozen=True, slots=True)
class Console:
    """Messages to stderr. Data goes to stdout and never through here."""

    quiet: bool = False
    verbose: bool = False
    progress: str = "auto"

    @classmethod
    def make(cls, *, quiet: bool, verbose: bool, progress: str) -> Console:
        """Check the progress mode."""
        if progress not in PROGRESS_MODES:
            raise ConfigError(f'--progress "{progress}"', expected=" ".join(PROGRESS_MODES))
        return cls(quiet, verbose, progress)

    def note(self, text: str) -> None:
        """Something the user should know."""
        if not self.quiet:
            sys.stderr.write(f"note: {clean_line(text)}\n")

    def detail(self, text: str) -> None:
        """Something the user may want to know."""
        if self.verbose and not self.quiet:
            sys.stderr.write(f"{clean_line(text)}\n")

    @contextmanager
    def hearing(self) -> Iterator[Heard]:
        """Show what a call of the face is doing: its steps as progress, its notes as notes."""
        mode = self.progress
        if mode == "auto":
            mode = "bar" if sys.stderr.isatty() and os.environ.get("TERM") != "dumb" else "off"
        heard = Heard(self, "off" if self.quiet else mode)
        try:
            yield heard
        finally:
            heard.clear()
            heard.tell_rest()

    def can_ask(self) -> bool:
        """Whether somebody is there to answer."""
        return not self.quiet and sys.stdin is not None and sys.stdin.isatty()

    def ask(self, text: str) -> str:
        """Ask something on the terminal; the answer may be empty."""
        sys.stderr.write(f"{clean_line(text)} ")
        sys.stderr.flush()
        return sys.stdin.readline().strip()

    def error(self, text: str) -> None:
        """Something that failed, while the rest goes on."""
        sys.stderr.write(f"error: {clean(text)}\n")

    def data(self, result: Result, *, as_json: bool, text: str | None = None) -> None:
        """Print a result on stdout: the document, or what a reader sees (`text` in place of the result's own)."""
        sys.stdout.write(result.to_json() + "\n" if as_json else clean(result.text() if text is None else text))


class Heard(Listener):
    """A call of the face on the terminal: one line that renews itself (`bar`), or a line a step (`plain`)."""

    def __init__(self, console: Console, mode: str) -> None:
        self.console, self.mode = console, mode
        self._width = 0
        self._failed: dict[str, list[str]] = {}  # of each reason the inputs, in order

    def __call__(self, step: str) -> None:
        """Show a step."""
        if self.mode == "bar":
            line = f"{' '.join(clean(step).split())} ..."
            sys.stderr.write(f"\r{line.ljust(self._width)}")
            sys.stderr.flush()
            self._width = len(line)
        elif self.mode == "plain":
            sys.stderr.write(f"{clean_line(step)}\n")

    def clear(self) -> None:
        """Remove the line."""
        if self.mode == "bar" and self._width:
            sys.stderr.write(f"\r{' ' * self._width}\r")
            sys.stderr.flush()

    def note(self, text: str) -> None:
        """Show a note at once."""
        self.console.note(text)

    def detail(self, text: str) -> None:
        """Show a detail, with -v."""
        self.console.detail(text)

    def failed(self, name: str, reason: str) -> None:
        """Show an input that failed; of many the first ones, and of those with one reason the first."""
        text = reason if name in reason else f"{name}: {reason.removeprefix(f'{Path(name).name}: ')}"
        inputs = self._failed.setdefault(text.replace(name, "", 1), [])
        inputs.append(name)
        if len(inputs) == 1 and len(self._failed) <= _SHOWN_AT_ONCE:
            self.clear()
            sys.stderr.write(f"error: {clean_line(text)}\n")

    def settled(self, where: str) -> None:
        """Show how many more failed, and where all are listed."""
        self.clear()
        self.tell_rest(f"; all are in {where}")

    def tell_rest(self, where: str = "") -> None:
        """Show the inputs that failed for a reason that was shown, and how many failed for others."""
        reasons = list(self._failed.values())
        for first, *same in reasons[:_SHOWN_AT_ONCE]:
            if same:
                names = ", ".join(same[:_NAMED]) + (", ..." if len(same) > _NAMED else "")
                sys.stderr.write(f"error: {clean_line(f'the same as of {first} for {len(same)} more: {names}')}\n")
        rest = sum(map(len, reasons[_SHOWN_AT_ONCE:]))
        if rest:
            sys.stderr.write(f"error: and {rest} more{where}\n")
        self._failed = {}

    @contextmanager
    def slow(self, what: str) -> Iterator[None]:
        """Say that something is being compiled, if it takes long."""
        from threading import Timer

        timer = Timer(SLOW_S, self.note, [f"compiling {what}; this takes a while, once after an installation"])
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()


@contextmanager
def told_if_interrupted(text: str) -> Iterator[None]:
    """What an interrupt within leaves behind, for the line that `guarded` writes."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(text) from None


@contextmanager
def guarded(*, debug: bool) -> Iterator[None]:
    """One line and the contract's exit code for every error and interrupt; a traceback only with `--debug`.

    Of the installed command all that is within is `supervised`.
    """
    data = _StandardOutput(sys.stdout)
    try:
        with supervised(debug=debug), redirect_stdout(cast("TextIO", data)):
            yield
            # what stdout cannot take must come to light here, not when the interpreter ends
            data.flush()
    except BrokenPipeError:
        # the reader of our output has gone; nothing to say, and nobody to say it to
        _silence()
        raise typer.Exit(int(ExitCode.DONE)) from None
    except KeyboardInterrupt as error:
        # without a word of the command: files are renamed into place, so those that are there are whole
        sys.stderr.write(f"interrupted{', ' if str(error) else ''}{error}\n")
        raise typer.Exit(int(ExitCode.INTERRUPTED)) from None
    except (typer.Exit, typer.Abort):
        raise
    except Exception as error:
        if debug:
            traceback.print_exc()
        if not getattr(error, "is_heard", False):
            sys.stderr.write(f"error: {_line_of(error)}\n")
        code = error.exit_code if isinstance(error, AqualogError) else ExitCode.FAILED
        raise typer.Exit(int(code)) from error


def _line_of(error: Exception) -> str:
    """Return the line that a user sees of an error."""
    if isinstance(error, AqualogError):
        return clean(error.line())
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        hint = ""
        if error.filename == _StandardOutput.NAME:
            _silence()
            hint = ". Try: another place for the output"
        return f"{clean_line(f'{where}{error.strerror or error}')}{hint}"
    if isinstance(error, MemoryError):
        return _memory_told()
    kind = type(error).__name__
    return f"aqualog failed ({kind}: {clean_line(str(error))[:300]}). Try: --debug, and report it"


def _memory_told() -> str:
    from aqualog.guard.reading import VARIABLES
    from aqualog.guard.system import memory_bound

    most = memory_bound()
    if not most:
        return "not enough memory"
    return f"more memory is needed than the {most // 1_000_000} MB allowed. Try: a higher {VARIABLES['memory']}"


class _StandardOutput:
    """The stream of data; its faults bear its name, which those of a stream do not of themselves."""

    NAME = "standard output"

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or raise OSError with the stream's name."""
        with self._named():
            return self._stream.write(text)

    def flush(self) -> None:
        """Flush, or raise OSError with the stream's name."""
        with self._named():
            self._stream.flush()

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OSError(error.errno, error.strerror, self.NAME) from error


def leave_without_stdout(error: OSError) -> NoReturn:
    """End where stdout cannot take what no command prints: help, the version."""
    _silence()
    if isinstance(error, BrokenPipeError):
        raise SystemExit(int(ExitCode.DONE))
    sys.stderr.write(f"error: {_line_of(OSError(error.errno, error.strerror, _StandardOutput.NAME))}\n")
    raise SystemExit(int(ExitCode.FAILED))


def _silence() -> None:
    """Nothing more can go to stdout: what is still in its buffer must not fail once more at the end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
