"""The command line. Nothing heavy is imported until a command runs."""

from __future__ import annotations

import atexit
import gc
import io
import signal
import sys
import time

import typer

from aqualog import __version__
from aqualog.cli.commands import Commands
from aqualog.guard.command import begin_command
from aqualog.guard.streams import open_streams

__all__ = ["app", "run"]

app = typer.Typer(
    name="aqualog",
    cls=Commands,
    help="Find aquaplaning in drive logs: MDF, MCAP, ROS bag, CSV and Parquet in, events and a page out.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Exit codes: 0 done, 1 failed, 2 usage or configuration, 3 done but data was lost, 4 nothing usable, "
    "5 a gate has tripped, 130 interrupted.",
)


def _version(value: bool) -> None:
    if value:
        sys.stdout.write(f"aqualog {__version__}\n")
        raise typer.Exit


@app.callback()
def _main(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Show the version."),
) -> None:
    """Common options of all commands."""


def run() -> None:
    """Run the command that the arguments name.

    A request to end is an interrupt as Ctrl-C is: it leaves by the usual way, so that no half-written file stays.
    """
    open_streams()
    # a process of one command: modules are no garbage to look for again and again, least of all at its end
    gc.set_threshold(200_000, 20)
    atexit.register(gc.freeze)
    for stream in (sys.stdout, sys.stderr):
        # a name that the terminal's code page does not have must not cost the work
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # nohup, or a job in the background
            signal.signal(number, _leave)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _raise)
        sys.unraisablehook = _lost
    begin_command()
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # help and version, which no command guards
    except OSError as error:
        from aqualog.cli.console import leave_without_stdout

        leave_without_stdout(error)


_AGAIN_S = 0.05
_TWICE_S = 0.5  # what a terminal, a shell and a watching process send of one request to end
_left_at = -_TWICE_S


def _leave(number: int, _: object) -> None:
    global _left_at
    now = time.monotonic()
    if now - _left_at < _TWICE_S:
        return
    _left_at = now
    raise KeyboardInterrupt


def _raise(number: int, _: object) -> None:
    raise KeyboardInterrupt


def _lost(unraisable: sys.UnraisableHookArgs) -> None:
    """An interrupt that comes while a compiled library calls back goes no further; it is raised again after that."""
    if unraisable.exc_type is KeyboardInterrupt:
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
    else:
        sys.__unraisablehook__(unraisable)
