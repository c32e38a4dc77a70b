"""Options that several commands share, each declared once; a command names those that it takes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

__all__ = ["SHARED"]


def _option(kind: Any, default: Any, *names: str, **about: Any) -> tuple[Any, Any]:
    return Annotated[kind, typer.Option(*names, **about)], default


def _vehicle(text: str) -> tuple[Any, Any]:
    return _option(Path | None, None, "--vehicle", help=text, metavar="FILE")


def _logs(text: str, metavar: str) -> tuple[Any, Any]:
    return Annotated[list[str], typer.Argument(help=text, metavar=metavar, show_default=False)], ...


SHARED: dict[str, tuple[Any, Any]] = {
    "logs": _logs("Log files of one drive: files, folders, globs, @list.txt.", "LOG..."),
    "logs:drives": _logs(
        "Logs of dry drives, each argument a drive of its own; a folder is one drive of several files.", "LOG..."
    ),
    "logs:diagnosed": _logs(
        "Logs, each argument a drive of its own; a folder is one drive of several files. Or a campaign file.",
        "LOG...|CAMPAIGN.toml",
    ),
    "logs:campaign": _logs(
        "A campaign file (TOML), or logs: each a drive of its own; files, folders, globs, @list.txt.",
        "CAMPAIGN.toml|LOG...",
    ),
    "logs:sources": (
        Annotated[
            list[str],
            typer.Argument(help="Reference first, then the sources to compare with it.", metavar="REFERENCE SOURCE..."),
        ],
        ...,
    ),
    "vehicle": _vehicle("Vehicle file (TOML). Without it a default car is taken."),
    "vehicle:needed": _vehicle("Vehicle file (TOML): must be given."),
    "vehicle:of_logs": _vehicle("Vehicle file (TOML): must be given for logs, a campaign file names its own."),
    "vehicle:believed": _vehicle(
        "Vehicle file (TOML): what the simulation believes. Drives need one; a campaign names its own."
    ),
    "vehicle:proposed": _vehicle("Vehicle file of all runs; without it one to fill is written."),
    "signals": _option(
        Path | None, None, "--signals", help="Signal map (TOML): which channel is which signal.", metavar="FILE"
    ),
    "dbc": _option(
        list[Path] | None, None, "--dbc", help="CAN database for raw frames; may be given several times.",
        metavar="FILE",
    ),
    "rate": _option(
        float | None, None, "--rate", help="Grid rate in Hz; default that of the wheel speeds.", min=0.1, max=1e5
    ),
    "cache": _option(
        bool | None, None, "--cache/--no-cache",
        help="Keep the aligned signals for the next look at the same log (`aqualog cache`); default: if AQUALOG_CACHE "
        "is set.",
    ),
    "store": _option(
        str | None, None, "--store", metavar="DIR",
        help="Folder or URL (s3://...) for the results of each log; default beside the campaign file: NAME.store.",
    ),
    "store:out": _option(
        str | None, None, "-o", "--out", "--store", metavar="DIR",
        help="Folder or URL (s3://...) for the results; default beside the campaign file: NAME.store.",
    ),
    "thresholds": _option(
        Path | None, None, "--thresholds", metavar="FILE",
        help="Thresholds of the detectors (TOML), as `aqualog evaluate --tune` writes them; default: built in.",
    ),
    "jobs": _option(
        int | None, None, "--jobs", help="Logs at a time; default one per core.", min=1, max=1024, metavar="N"
    ),
    "jobs:drives": _option(
        int | None, None, "--jobs", help="Campaign: drives at a time.", min=1, max=1024, metavar="N"
    ),
    "model": _option(
        Path | None, None, "--model", metavar="FILE",
        help="Model file (TOML), as `aqualog diagnose` writes it: effects that the car is known to have.",
    ),
    "model:known": _option(
        Path | None, None, "--model", help="Model file (TOML): what is known already, on top of the base.",
        metavar="FILE",
    ),
    "model:simulated": _option(
        Path | None, None, "--model", help="Model file (TOML): effects on top of the base.", metavar="FILE"
    ),
    "by": _option(
        str, "", "--by", metavar="KEYS",
        help="Configuration keys: tyre,pressure,water-depth,load,wear,side,manoeuvre,... Default: those that differ.",
    ),
    "width": _option(
        float, 10.0, "--bin-width", help="Width of the speed bins.", min=1.0, max=100.0, metavar="KMH"
    ),
    "road": _option(str, "wet", "--road", help="wet, dry or both.", metavar="ROAD"),
    "robust": _option(bool, False, "--robust", help="Weigh outliers down (Huber [huber1981])."),
    "table": _option(
        Path | None, None, "-o", "--out", help="Table of the rows: FILE.csv or FILE.parquet.", metavar="FILE"
    ),
    "json": _option(bool, False, "--json", help="Print one JSON document."),
    "force": _option(bool, False, "--force", help="Overwrite existing results."),
    "quiet": _option(bool, False, "-q", "--quiet", help="Errors only on stderr."),
    "verbose": _option(bool, False, "-v", "--verbose", help="More detail on stderr."),
    "progress": _option(str, "auto", "--progress", help="auto, bar, plain or off.", metavar="MODE"),
    "debug": _option(bool, False, "--debug", help="Show a traceback on errors."),
}  # fmt: skip
"""Type with help, and default (`...`: must be given), by name; behind a colon, a variant with a help of its own."""
