"""The command line. Nothing heavy is imported until a command runs."""

from __future__ import annotations

import io
import signal
import sys

import typer

from aqualog import __version__
from aqualog.cli.batch import batch
from aqualog.cli.bin_resistance import bin_resistance
from aqualog.cli.bin_slipslope import bin_slipslope
from aqualog.cli.cache import cache
from aqualog.cli.calibrate import calibrate
from aqualog.cli.campaign import campaign_app
from aqualog.cli.clock import align
from aqualog.cli.convert import convert
from aqualog.cli.detect import detect
from aqualog.cli.diagnose import diagnose
from aqualog.cli.evaluate import evaluate
from aqualog.cli.figures import figures
from aqualog.cli.inspect import inspect
from aqualog.cli.plan import plan
from aqualog.cli.report import report
from aqualog.cli.reproduce import reproduce
from aqualog.cli.simulate import simulate
from aqualog.cli.slip_slope import slip_slope

__all__ = ["app", "run"]

app = typer.Typer(
    name="aqualog",
    help="Find aquaplaning in drive logs: MDF, MCAP, ROS bag, CSV and Parquet in, events and a page out.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Exit codes: 0 done, 1 failed, 2 usage or configuration, 3 done but data was lost, 4 nothing usable, "
    "5 a gate has tripped, 130 interrupted.",
)
app.command(no_args_is_help=True)(detect)
app.command(no_args_is_help=True)(inspect)
app.command(no_args_is_help=True)(convert)
app.command(no_args_is_help=True)(align)
app.command(no_args_is_help=True)(slip_slope)
app.command(no_args_is_help=True)(batch)
app.command(no_args_is_help=True)(plan)
app.command("bin-slipslope", no_args_is_help=True)(bin_slipslope)
app.command("bin-resistance", no_args_is_help=True)(bin_resistance)
app.command(no_args_is_help=True)(report)
app.command(no_args_is_help=True)(calibrate)
app.command(no_args_is_help=True)(diagnose)
app.command(no_args_is_help=True)(evaluate)
app.command(no_args_is_help=True)(simulate)
app.command(no_args_is_help=True)(figures)
app.command(no_args_is_help=True)(reproduce)
app.command()(cache)
app.add_typer(campaign_app, name="campaign")


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
    """Entry point of the installed command.

    A request to end is an interrupt as Ctrl-C is: it leaves by the usual way, so that no half-written file stays.
    """
    for stream in (sys.stdout, sys.stderr):
        # a name that the terminal's code page does not have must not cost the work
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _leave)
    app()


def _leave(number: int, _: object) -> None:
    raise KeyboardInterrupt
