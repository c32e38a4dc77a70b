"""`aqualog campaign init`: from a folder of logs to a campaign file."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.options import Dbc, Debug, Force, Json, Progress, Quiet, Verbose

if TYPE_CHECKING:
    from aqualog.campaign.propose_drives import Drive, Found, LogFile
    from aqualog.campaign.propose_names import NameTable
    from aqualog.campaign.propose_signals import MapProposal

__all__ = ["campaign_app", "init"]

campaign_app = typer.Typer(
    help="Campaign files: many drives in known configurations.", no_args_is_help=True, rich_markup_mode=None
)
MOST_ROWS = 20  # drives that are printed; the table of runs has all


@campaign_app.callback()
def _campaign() -> None:
    """Campaign files: many drives in known configurations."""


@campaign_app.command(no_args_is_help=True)
def init(
    folder: Annotated[Path, typer.Argument(help="Folder with logs, in it or below it.", metavar="FOLDER")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Campaign file to write.", metavar="FILE")] = Path(
        "campaign.toml"
    ),
    vehicle: Annotated[
        Path | None,
        typer.Option("--vehicle", help="Vehicle file of all runs; without it one to fill is written.", metavar="FILE"),
    ] = None,
    dbc: Dbc = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Propose a campaign file for a folder of logs.

    Looks at every log in the folder and below it, puts together files of one drive, reads tyre, pressure, water depth,
    speed and so on from the names, and finds out which channel is which signal. Written beside the campaign file:
    runs.csv (a line per drive), map.toml (where channels have names of their own) and vehicle.toml (to be filled in).
    Everything in them is a guess from names, units and data, printed with its rule: read it before you use it.

    \b
    Examples:
      aqualog campaign init measurements
      aqualog campaign init measurements -o wet2024/campaign.toml --vehicle car.toml
      aqualog campaign init can_logs --dbc car.dbc
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _init(
            folder,
            out,
            vehicle,
            dbc or [],
            as_json=as_json,
            force=force,
            quiet=quiet,
            verbose=verbose,
            progress=progress,
        )
    if code:
        raise typer.Exit(code)


def _init(
    folder: Path,
    out: Path,
    vehicle: Path | None,
    dbc: list[Path],
    *,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.console import Console
    from aqualog.config.vehicle import load_vehicle
    from aqualog.errors import ConfigError, ExitCode
    from aqualog.face.paths import refuse_existing, write_text

    console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
    if not folder.is_dir():
        raise ConfigError("is no folder", where=str(folder), expected="a folder with logs")
    if out.suffix.lower() != ".toml":
        raise ConfigError("-o is no .toml", where=str(out), expected="the name of the campaign file to write")
    targets = {n: out.parent / n for n in ("runs.csv", "map.toml", "vehicle.toml")}
    if vehicle is not None:
        load_vehicle(vehicle)
        del targets["vehicle.toml"]
    refuse_existing([out, *targets.values()], force=force, sources=[*dbc, *([vehicle] if vehicle else [])])

    from aqualog.campaign.propose_drives import Drive, drive_name, group_drives, is_run_table, kinds_of, scan
    from aqualog.campaign.propose_files import labels_of, relative
    from aqualog.campaign.propose_left import broken_logs, without_twins
    from aqualog.campaign.propose_names import read_names
    from aqualog.campaign.propose_signals import measures_wheels, propose_signals
    from aqualog.io.base import ReadOptions

    way = relative(folder, out.parent)
    if ";" in way or not way.isprintable():
        raise ConfigError(f"{way!r}: a ; parts the files of a drive", where=str(folder), hint="-o in that folder")
    options = ReadOptions(dbc=tuple(dbc))
    if targets["runs.csv"].exists() and not is_run_table(targets["runs.csv"]):
        raise ConfigError(
            "is no table of runs", where=str(targets["runs.csv"]), hint="another folder for the campaign file (-o)"
        )
    with console.steps() as steps:
        found = scan(folder, options=options, leave_out=[out, *targets.values()], report=steps)
        if not found.logs:
            told = "; ".join(f"{name}: {why}" for name, why in found.bad[:5])
            raise ConfigError(f"no log that can be read{f' ({told})' if told else ''}", where=str(folder))
        steps("looking for copies")
        logs, twins = without_twins(found.logs)
        kinds, count = kinds_of(logs)
        steps("grouping files into drives")
        wheels = [measures_wheels(logs[kinds.index(k)], options) if count > 1 else True for k in range(count)]
        drives, notes = group_drives(logs, kinds, lambda a, b: wheels[a] and wheels[b])
        signals = propose_signals(drives, options, steps)
    broken = broken_logs(folder, found.bad)
    notes = (*twins, *notes, *_broken_notes(found, broken))
    # a broken log is a run that failed: with its row every batch says so
    drives = tuple(sorted((*drives, *(Drive((f,), (0,)) for f in broken)), key=lambda d: d.files[0].name))
    table = read_names([drive_name(d) for d in drives])
    labels = labels_of(drives, found.labels)
    texts = _texts(folder, out, vehicle, drives, table, labels, signals)
    for path, text in texts.items():
        write_text(path, text)
    if force and not signals.needed and targets["map.toml"].exists():
        console.note(f"{targets['map.toml']} is there from before and is not used")
    if as_json:
        document = _document(out, texts, found, drives, table, signals, notes)
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        _print(out, texts, found, drives, table, signals, (*notes, *_labels_notes(found.labels, labels)), dbc)
    return int(ExitCode.PARTIAL) if found.bad else int(ExitCode.DONE)


def _texts(
    folder: Path,
    out: Path,
    vehicle: Path | None,
    drives: tuple[Drive, ...],
    table: NameTable,
    labels: dict[int, str],
    signals: MapProposal,
) -> dict[Path, str]:
    """What is to be written; the campaign file last, so that it never names a file that is not there."""
    from aqualog.campaign.propose_files import campaign_text, relative, runs_text, unmapped_text, vehicle_text
    from aqualog.config.signal_map import map_text

    base = out.parent
    name = folder.resolve().name or "campaign"
    texts = {base / "runs.csv": runs_text(drives, table, labels, base=base, folder=folder)}
    if signals.needed:
        comments = [f"proposed for {len(drives)} drives in {name}: check every line"]
        comments += [f"not in all drives, so left out: {s} = {why}" for s, why in signals.left_out.items()]
        texts[base / "map.toml"] = map_text(signals.signal_map, comments=comments, remarks=signals.remarks)
        texts[base / "map.toml"] += unmapped_text(signals.unmapped)
    if vehicle is None:
        texts[base / "vehicle.toml"] = vehicle_text(name)
        car = "vehicle.toml"
    else:
        car = relative(vehicle, base)
    texts[out] = campaign_text(name, car, "map.toml" if signals.needed else None, "runs.csv")
    return texts


def _broken_notes(found: Found, broken: tuple[LogFile, ...]) -> list[str]:
    kept = {f.name for f in broken}
    return [
        *(f"cannot be read, but is in runs.csv (failed in a batch): {n}: {why}" for n, why in found.bad if n in kept),
        *(f"left out: {n}: {why}" for n, why in found.bad if n not in kept),
    ]


def _labels_notes(names: tuple[str, ...], used: dict[int, str]) -> list[str]:
    left = [n for n in names if n not in used.values()]
    return [f"labels files that no drive's name fits: {', '.join(left[:5])}"] if left else []


def _print(
    out: Path,
    texts: dict[Path, str],
    found: Found,
    drives: tuple[Drive, ...],
    table: NameTable,
    signals: MapProposal,
    notes: tuple[str, ...],
    dbc: list[Path],
) -> None:
    from aqualog.campaign.propose_files import blanks
    from aqualog.cli.console import clean
    from aqualog.report.text import table as text_table

    several = sum(len(d.files) > 1 for d in drives)
    unreadable = f", {len(found.bad)} cannot be read" if found.bad else ""
    heading = f"logs: {len(found.logs) + len(found.bad)}{unreadable}; drives: {len(drives)}"
    lines = [heading + (f", {several} of several files" if several else "")]
    columns = list(table.columns)
    rows = [
        (_short(" + ".join(f.name for f in d.files)), *(table.columns[c][i] or "-" for c in columns))
        for i, d in enumerate(drives[:MOST_ROWS])
    ]
    lines.append(text_table(("drive", *columns), rows))
    lines += [f"and {len(drives) - len(rows)} more, all in runs.csv"] if len(drives) > len(rows) else []
    lines += ["", "read from the names:"] if columns else ["", "the names say nothing about how the car was driven"]
    lines += [f"  {c}: {rule}" for c, rule in table.rules.items()]
    lines += [f"  same in all names, left out: {', '.join(table.dropped)}"] if table.dropped else []
    empty = blanks(table, len(drives))
    lines += ["", "to fill in:", *(f"  {c}: {n} of {len(drives)} blank" for c, n in empty.items())] if empty else []
    if signals.needed:
        lines += ["", "signals (map.toml):"]
        for symbol, entry in signals.signal_map.entries.items():
            unit = f" [{entry.unit}]" if entry.unit else ""
            lines.append(f"  {symbol} = {' or '.join(entry.channel)}{unit}  ({signals.remarks[symbol]})")
    own = [s for s in signals.found if s not in signals.signal_map.entries]
    lines += ["", f"signals with their canonical names: {', '.join(own)}"] if own else []
    lines += [f"  not in all drives, left out: {s} = {why}" for s, why in signals.left_out.items()]
    lines += ["", _unmapped_line(signals)] if signals.unmapped else []
    told = [*signals.notes, *notes, *table.notes]
    if "on_water" not in signals.found:
        told.append(
            "no signal on_water: fill in lane_start_s and lane_end_s, or labels, of wet runs, "
            "or map the channel that tells it: on_water = ..."
        )
    lines += ["", "notes:", *(f"  {n}" for n in told)] if told else []
    lines += ["", f"written: {', '.join(str(p) for p in texts)}", *_next(out, texts, dbc)]
    sys.stdout.write(clean("\n".join(lines) + "\n"))


def _unmapped_line(signals: MapProposal) -> str:
    names = signals.unmapped
    if signals.needed:
        return f"channels that are not mapped: {len(names)}, named at the end of map.toml"
    return f"channels that are no signal: {len(names)} ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''})"


def _short(text: str) -> str:
    return text if len(text) <= 70 else f"{text[:30]}...{text[-37:]}"


def _next(out: Path, texts: dict[Path, str], dbc: list[Path]) -> list[str]:
    names = {p.name: p for p in texts}
    edits = [f"{names['vehicle.toml']} (every line marked SET)"] if "vehicle.toml" in names else []
    edits += [f"{names['map.toml']} (check channels, units, signs)"] if "map.toml" in names else []
    edits.append(f"{names['runs.csv']} (fill in what is blank)")
    return [
        "next:",
        f"  1. edit {', '.join(edits)}",
        f"  2. aqualog inspect {out}",
        f"  3. aqualog report {out}{''.join(f' --dbc {d}' for d in dbc)} -o report",
    ]


def _document(
    out: Path,
    texts: dict[Path, str],
    found: Found,
    drives: tuple[Drive, ...],
    table: NameTable,
    signals: MapProposal,
    notes: tuple[str, ...],
) -> dict[str, Any]:
    from aqualog import __version__
    from aqualog.campaign.propose_files import blanks

    return {
        "schema_version": 1,
        "tool_version": __version__,
        "campaign": str(out),
        "written": [str(p) for p in texts],
        "drives": [
            {"files": [f.name for f in d.files], "values": {c: v[i] for c, v in table.columns.items() if v[i]}}
            for i, d in enumerate(drives)
        ],
        "rules": dict(table.rules),
        "signals": {
            s: {"channel": list(e.channel), "unit": e.unit, "scale": e.scale, "reason": signals.remarks[s]}
            for s, e in signals.signal_map.entries.items()
        },
        "canonical": [s for s in signals.found if s not in signals.signal_map.entries],
        "blank": blanks(table, len(drives)),
        "unmapped": list(signals.unmapped),
        "left_out": {**dict(found.bad), **signals.left_out},
        "notes": [*signals.notes, *notes, *table.notes],
    }
