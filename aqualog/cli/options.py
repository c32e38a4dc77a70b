"""Every option and argument of the commands, declared once; a command names those that it takes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

__all__ = ["OPTIONS"]


def _option(kind: Any, default: Any, *names: str, **about: Any) -> tuple[Any, Any]:
    return Annotated[kind, typer.Option(*names, **about)], default


def _argument(
    kind: Any, text: str, metavar: str, *, shows_default: bool = False, default: Any = ...
) -> tuple[Any, Any]:
    return Annotated[kind, typer.Argument(help=text, metavar=metavar, show_default=shows_default)], default


def _file(text: str, *names: str, metavar: str = "FILE", default: Any = None) -> tuple[Any, Any]:
    """Return an option that names a file or folder; with `...` as default it must be given."""
    kind = Path | None if default is None else Path
    return _option(kind, default, *(names or ("-o", "--out")), help=text, metavar=metavar)


def _page(text: str, *names: str) -> tuple[Any, Any]:
    return _option(Path | None, None, *(names or ("-o", "--out")), help=text, metavar="FILE", callback=_as_page)


def _as_page(path: Path | None) -> Path | None:
    """Return the name of a page, with `.html` where it has no ending; of a file that exists more is said later."""
    if path is None or path.suffix.lower() in (".html", ".htm") or path.exists():
        return path
    if path.suffix:
        raise typer.BadParameter(f'{path}: "{path.suffix}" is no page; expected a name that ends in .html')
    return path.with_name(f"{path.name}.html")


def _as_model(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() in (".html", ".htm"):
        raise typer.BadParameter(f"{path}: the model is a TOML file; the page is --page")
    return path


def _flag(text: str, name: str) -> tuple[Any, Any]:
    return _option(bool, False, name, help=text)


OPTIONS: dict[str, tuple[Any, Any]] = {
    "logs": _argument(list[str], "Log files of one drive: files, folders, globs, @list.txt.", "LOG..."),
    "logs:drives": _argument(
        list[str], "Logs of dry drives, each argument a drive of its own; a folder is one drive of several files.",
        "LOG...",
    ),
    "logs:diagnosed": _argument(
        list[str],
        "Logs, each argument a drive of its own; a folder is one drive of several files. Or a campaign file.",
        "LOG...|CAMPAIGN.toml",
    ),
    "logs:campaign": _argument(
        list[str], "A campaign file (TOML), or logs: each a drive of its own; files, folders, globs, @list.txt.",
        "CAMPAIGN.toml|LOG...",
    ),
    "logs:sources": _argument(
        list[str], "Reference first, then the sources to compare with it.", "REFERENCE SOURCE...", shows_default=True
    ),
    "vehicle": _file("Vehicle file (TOML). Without it a default car is taken.", "--vehicle"),
    "vehicle:needed": _file("Vehicle file (TOML): must be given.", "--vehicle"),
    "vehicle:of_logs": _file(
        "Vehicle file (TOML): must be given for logs, a campaign file names its own.", "--vehicle",
    ),
    "vehicle:believed": _file(
        "Vehicle file (TOML): what the simulation believes. Drives need one; a campaign names its own.", "--vehicle",
    ),
    "vehicle:proposed": _file("Vehicle file that is there; without it one to fill in is written.", "--vehicle"),
    "signals": _file("Signal map (TOML): which channel is which signal.", "--signals"),
    "dbc": _option(
        list[Path] | None, None, "--dbc", help="CAN database for raw frames; may be given several times.",
        metavar="FILE",
    ),
    "correct_offsets": _flag("Take off what accelerometers and gyro show at standstill.", "--correct-offsets"),
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
    "thresholds": _file(
        "Thresholds of the detectors (TOML), as `aqualog evaluate --tune` writes them; default: built in.",
        "--thresholds",
    ),
    "jobs": _option(
        int | None, None, "--jobs", help="Logs at a time; default one per core.", min=1, max=1024, metavar="N"
    ),
    "jobs:drives": _option(
        int | None, None, "--jobs", help="Campaign: drives at a time.", min=1, max=1024, metavar="N"
    ),
    "model": _file(
        "Model file (TOML), as `aqualog diagnose` writes it: effects that the car is known to have.", "--model"
    ),
    "model:known": _file("Model file (TOML): what is known already, on top of the base.", "--model"),
    "model:simulated": _file("Model file (TOML): effects on top of the base.", "--model"),
    "by": _option(
        str, "", "--by", metavar="KEYS",
        help="Configuration keys: tyre,pressure,water-depth,load,wear,side,manoeuvre,... Default: those that differ.",
    ),
    "width": _option(
        float, 10.0, "--bin-width", help="Width of the speed bins.", min=1.0, max=100.0, metavar="KMH"
    ),
    "road": _option(str, "wet", "--road", help="wet, dry or both.", metavar="ROAD"),
    "robust": _flag("Weigh outliers down (Huber [huber1981]).", "--robust"),
    "as_measured": _flag("Do not take off each run's own level on dry road.", "--as-measured"),
    "table": _file("Table of the rows: FILE.csv or FILE.parquet."),
    "csv": _file("Each printed table as CSV: the first as FILE.csv, others as FILE_TABLE.csv.", "--csv"),
    "decimal_comma:tables": _flag("With --csv: decimal commas and semicolons.", "--decimal-comma"),
    "json": _flag("Print one JSON document.", "--json"),
    "force": _flag("Overwrite existing results.", "--force"),
    "quiet": _option(bool, False, "-q", "--quiet", help="Errors only on stderr."),
    "verbose": _option(bool, False, "-v", "--verbose", help="More detail on stderr."),
    "progress": _option(str, "auto", "--progress", help="auto, bar, plain or off.", metavar="MODE"),
    "debug": _flag("Show a traceback on errors.", "--debug"),
    # one log
    "write_map:proposed": _file("Write the proposed signal map to this file.", "--write-map"),
    "out:start": _file("Folder for map.toml and vehicle.toml.", metavar="DIR", default=...),
    "write_map:clocks": _file("Write the signal map with the clocks found.", "--write-map"),
    "out:log": _file("File to write: .mf4, .mcap, .csv or .parquet.", default=...),
    "decimal_comma": _flag("CSV with decimal comma and semicolons.", "--decimal-comma"),
    "quantity": _option(str, "speed", "--quantity", help="speed or yaw_rate: what both carry.", metavar="NAME"),
    "channel": _option(
        list[str] | None, None, "--channel", help="Channel of a file, if names do not decide.", metavar="FILE=CHANNEL"
    ),
    "max_offset": _option(float, 10.0, "--max-offset", help="Search range in s.", min=0.1, max=3600.0),
    "start_offset": _option(
        float | None, None, "--start-offset", help="Rough offset in s of clocks that are far apart."
    ),
    "clean": _flag("Remove what is kept.", "--clean"),
    # one drive
    "out:results": _file("Folder for events.json, signals.parquet and report.html.", metavar="DIR"),
    "write": _file(
        "Signals, features, statistics and detection bits as channels of a log: .mf4, .mcap (both with episodes and "
        "events), .csv or .parquet.", "--write",
    ),
    "layouts": _flag("Beside --write: a layout for PlotJuggler, and for .mcap one for Foxglove.", "--layouts"),
    "history": _file(
        "Dry slip slopes of this car from earlier drives (JSON); read, and written back with this drive's.",
        "--history",
    ),
    "configuration": _option(
        str, "", "--configuration", metavar="TEXT",
        help="What the dry slope belongs to: tyre, pressure, load, in any words; default the vehicle's name.",
    ),
    "reference": _option(
        str, "robust", "--reference", metavar="RULE",
        help="Dry slope of the history: robust (upper quartile of the periods' means) or max (as the thesis).",
    ),
    "fail_on_event": _flag(
        "Exit with 5 if there was an episode of aquaplaning, and with 4 if aquaplaning could not be judged.",
        "--fail-on-event",
    ),
    "out:slopes": _file("Folder for slip_slope.json, .csv and .html.", metavar="DIR"),
    "method": _option(
        str, "auto", "--method", metavar="NAME",
        help="auto, axle (driven against free wheels), velocity (against v_x) or differential (recursive only).",
    ),
    "traction": _option(
        str, "auto", "--traction", help="auto, torque or accelerometer (one driven axle).", metavar="NAME"
    ),
    "mu_max": _option(float, 0.3, "--mu-max", help="Largest traction coefficient used.", min=0.02, max=1.0),
    "delay": _option(
        float | None, None, "--delay", metavar="SECONDS", min=-1.0, max=1.0,
        help="By how much v_x is late against the wheels, where known; else it is estimated (velocity only).",
    ),
    # several drives
    "out:vehicle": _file("Vehicle file with the calibrated values."),
    "fix": _option(
        list[str] | None, None, "--fix", metavar="KEY=VALUE",
        help="What is known: mass=KG, torque_gain=X, drag_area=M2 or rolling_resistance=X; with --wet tread=MM, "
        "pressure=BAR (gauge) and depth=MM. May be repeated.",
    ),
    "wet": _flag("Fit how the tyres float, to passes over water.", "--wet"),
    "accept": _flag("Take the drives' values also where the vehicle file says something else.", "--accept"),
    "page:calibration": _page("Page with tables and residuals (HTML).", "--page"),
    "holdout": _option(
        list[str] | None, None, "--holdout", metavar="LOG",
        help="Drive on which the gain is measured and nothing is fitted; may be repeated.",
    ),
    "out:model": _option(
        Path | None, None, "-o", "--out", help="Extended model: a file that --model takes.", metavar="FILE",
        callback=_as_model,
    ),
    "page:diagnosis": _page("Page with the pictures before and after (HTML).", "--page"),
    "level": _option(
        float, 0.01, "--level", help="Share of drives without effect that may be given one.", min=1e-4, max=0.5
    ),
    "seed:drawn": _option(int, 1, "--seed", help="Of all that is drawn at random.", min=0, max=2**63 - 1),
    "surrogates": _option(
        int | None, None, "--surrogates", help="How many draws of noise calibrate the test.", min=2,
        max=100_000, metavar="N",
    ),
    "bootstrap": _option(
        bool, True, "--bootstrap/--no-bootstrap", help="Without: quicker, the test by its formula alone."
    ),
    "logs:validated": _argument(
        list[str], "Logs, each argument a drive of its own; a folder is one drive of several files.", "LOG..."
    ),
    "method:validity": _option(
        str, "boundary", "--method", metavar="NAME",
        help="Which the sentence goes by: boundary (ISO 19364) or 18571 (ISO/TS 18571). The page has both.",
    ),
    "boundaries": _file(
        "Tolerances of the cross plots (TOML); default: those of three repeated drives, else aqualog's own.",
        "--boundaries",
    ),
    "why": _option(
        bool, True, "--why/--no-why", help="Diagnose the drives too; without it the answer takes seconds."
    ),
    "labels": _file(
        "Labels (CSV start_s,end_s,effect,wheel), or a folder with NAME.csv for each log NAME; without lines: no "
        "water.", "--labels",
    ),
    "by:tables": _option(
        str, "", "--by", help="Tables by configuration: tyre,depth,pressure,manoeuvre,... of the campaign."
    ),
    "by:sets": _option(
        str, "", "--by", metavar="KEYS",
        help="Keys of a set: tyre,pressure,depth,load,... of the campaign. Default: those in which the runs differ.",
    ),
    "control": _option(
        str, "", "--control", metavar="TYRE", help="Tyre of the control sets, with which the others are compared."
    ),
    "index": _option(float, 100.0, "--index", help="Index of the control.", min=1.0, max=1000.0),
    "radius": _option(
        float | None, None, "--radius", help="Radius of the circle in m: passes on another one do not count.", min=5.0,
        max=2000.0,
    ),
    "result": _option(str, "mean", "--result", help="min, mean or area: what is compared.", metavar="NAME"),
    "v_from": _option(float, 80.0, "--from", help="Speed at which a stop begins, km/h.", min=1.0, max=300.0),
    "v_to": _option(float, 20.0, "--to", help="Speed at which it ends, km/h.", min=1.0, max=300.0),
    "coefficients": _file("Coefficients of the wet grip index (TOML), from your copy.", "--coefficients"),
    "limits": _file("Thresholds of the tests that differ from the defaults (TOML).", "--limits"),
    "out:test": _file("Folder for the document, sets and runs as CSV, and the page.", metavar="DIR"),
    "page:test": _page("Page (HTML).", "--page"),
    "folder:watched": _argument(
        Path, "Folder in which logs arrive, also of the network, with the folders below it.", "FOLDER"
    ),
    "campaign:watched": _file("Campaign file; its runs name the logs to come.", "--campaign", metavar="CAMPAIGN.toml"),
    "kind": _option(str, "straight", "--test", help="straight, curve or braking.", metavar="NAME"),
    "out:watch": _page("Page that renews itself (HTML); default beside the campaign file: NAME.watch.html."),
    "once": _flag("Measure what is there, and end.", "--once"),
    "every": _option(float, 1.0, "--every", help="Seconds between two looks.", min=0.1, max=3600.0, metavar="S"),
    "rivals": _flag("Also the methods of the prior art.", "--rivals"),
    "rival": _option(
        list[str] | None, None, "--rival", metavar="NAME=CHANNEL",
        help="A detector that is in the log: true or false, or a number with a level, NAME=CHANNEL>=LEVEL; may be "
        "repeated.",
    ),
    "roc": _flag("Also at thresholds from a quarter to four times.", "--roc"),
    "tune": _file(
        "Propose thresholds on some drives, report them on the others, and write them here.", "--tune"
    ),
    "gate": _option(
        list[str] | None, None, "--gate", metavar="DETECTOR.MEASURE>=X",
        help="Exit with 5 if this is not kept, such as 'joint_cusum.recall>=0.9'; may be repeated.",
    ),
    "junit": _file("Gates and drives as JUnit XML, for a build server.", "--junit"),
    "out:page": _page("Page (HTML)."),
    # campaigns
    "folder": _argument(Path, "Folder with logs, in it or below it.", "FOLDER", shows_default=True),
    "out:campaign": _file("Campaign file to write.", default=Path("campaign.toml")),
    "limit_s": _option(
        float | None, None, "--limit-s", help="Longest time for one log, in seconds.", min=1.0, max=1e9, metavar="S"
    ),
    "limit_mb": _option(
        int | None, None, "--limit-mb", help="Most memory for one process, in megabytes.", min=300, metavar="MB"
    ),
    "shard": _option(
        str | None, None, "--shard", help="Only the I-th of N parts, for N machines on one folder.", metavar="I/N"
    ),
    "cluster": _option(
        str | None, None, "--cluster", help="Work on the workers of this dask scheduler.", metavar="tcp://HOST:8786"
    ),
    "sample": _option(
        int | None, None, "--sample", help="Logs to measure; default 8, or 2 per process.", min=2, max=1000,
        metavar="K",
    ),
    "within": _option(
        str | None, None, "--within", metavar="TIME",
        help="Report how many --shard are done in that time: 90s, 30min, 8h, 2d.",
    ),
    "campaign:file": _argument(str, "A campaign file (TOML).", "CAMPAIGN.toml"),
    "out:report": _file("Folder for the report; default beside the campaign file: NAME.report.", metavar="DIR"),
    # simulation and thesis
    "what": _argument(
        list[str], "A scenario file, or the word campaign and the name of a programme.", "SCENARIO | campaign NAME"
    ),
    "out:simulated": _file(
        "Log to write: .mf4, .mcap, .csv or .parquet; of a campaign: folder.", metavar="PATH", default=...
    ),
    "seed": _option(
        int | None, None, "--seed", help="In place of the scenario's.", min=0, max=2**63 - 1, metavar="N"
    ),
    "numbers": _argument(list[str], "Figures of the thesis by number (3.6), by chapter (2, 3), or all.", "NUMBER..."),
    "out:figures": _file("Folder for pages, tables and pictures.", metavar="DIR", default=...),
    "campaign": _file("Make them from the runs of this campaign.", "--campaign", metavar="CAMPAIGN.toml"),
    "formats": _option(
        str, "html,csv", "--format", help="Any of html,csv,png,svg; pictures need the extra images.", metavar="LIST"
    ),
    "out:reproduction": _file("Folder for the page and all that it rests on.", metavar="DIR", default=...),
    "topic": _argument(list[str] | None, "A page, a command, or words to look for.", "TOPIC", default=None),
}  # fmt: skip
"""Type with help, and default (`...`: must be given), by name; behind a colon, a variant with a help of its own."""
