"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "Cache", "CarNeeded", "CarOfLogs", "Dbc", "Debug", "Force", "Inputs", "Jobs", "Json", "Logs", "Progress", "Quiet",
    "Rate", "Signals", "StoreOption", "Thresholds", "Vehicle", "Verbose",
]  # fmt: skip

Logs = Annotated[
    list[str],
    typer.Argument(
        help="Log files of one drive: files, folders, globs, @list.txt.", metavar="LOG...", show_default=False
    ),
]
Vehicle = Annotated[
    Path | None,
    typer.Option("--vehicle", help="Vehicle file (TOML). Without it a default car is taken.", metavar="FILE"),
]
CarNeeded = Annotated[
    Path | None,
    typer.Option("--vehicle", help="Vehicle file (TOML): must be given.", metavar="FILE"),
]
CarOfLogs = Annotated[
    Path | None,
    typer.Option(
        "--vehicle", help="Vehicle file (TOML): must be given for logs, a campaign file names its own.", metavar="FILE"
    ),
]
Signals = Annotated[
    Path | None,
    typer.Option("--signals", help="Signal map (TOML): which channel is which signal.", metavar="FILE"),
]
Dbc = Annotated[
    list[Path] | None,
    typer.Option("--dbc", help="CAN database for raw frames; may be given several times.", metavar="FILE"),
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", help="Grid rate in Hz; default that of the wheel speeds.", min=0.1, max=100000.0),
]
Cache = Annotated[
    bool | None,
    typer.Option(
        "--cache/--no-cache",
        help="Keep the aligned signals for the next look at the same log (`aqualog cache`); default: if AQUALOG_CACHE "
        "is set.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing results.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Errors only on stderr.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="More detail on stderr.")]
Progress = Annotated[str, typer.Option("--progress", help="auto, bar, plain or off.", metavar="MODE")]
Debug = Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")]
Inputs = Annotated[
    list[str],
    typer.Argument(
        help="A campaign file (TOML), or logs: each a drive of its own; files, folders, globs, @list.txt.",
        metavar="CAMPAIGN.toml|LOG...",
        show_default=False,
    ),
]
StoreOption = Annotated[
    str | None,
    typer.Option(
        "--store", help="Folder or URL (s3://...) for the results of each log; default beside the campaign file: "
        "NAME.store.",
        metavar="DIR",
    ),
]  # fmt: skip
Thresholds = Annotated[
    Path | None,
    typer.Option(
        "--thresholds",
        help="Thresholds of the detectors (TOML), as `aqualog evaluate --tune` writes them; default: built in.",
        metavar="FILE",
    ),
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", help="Logs at a time; default one per core.", min=1, max=1024, metavar="N")
]
