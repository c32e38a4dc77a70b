"""`aqualog inspect`."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.options import Dbc, Debug, Force, Json, Logs, Progress, Quiet, Signals, Verbose

if TYPE_CHECKING:
    from aqualog.align.mapping import SignalMap
    from aqualog.align.overview import ChannelOverview
    from aqualog.align.propose import Proposal
    from aqualog.types import Channel

__all__ = ["inspect"]


def inspect(
    logs: Logs,
    signals: Signals = None,
    dbc: Dbc = None,
    write_map: Annotated[
        Path | None,
        typer.Option("--write-map", help="Write the proposed signal map to this file.", metavar="FILE"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """List what a log holds, and propose which channel is which signal; of a campaign file, show the test matrix.

    Every channel with its rate, unit, range, gaps and faults; how an IMU is mounted; a signal map to start from. The
    proposal is a guess from names, units and data: read it before you use it.

    Of a campaign: faults of all its files at once, logs that are missing, which configurations were driven how often
    and how fast, and which are missing.

    \b
    Examples:
      aqualog inspect drive.mf4
      aqualog inspect campaign.toml
      aqualog inspect can.mf4 --dbc car.dbc --write-map map.toml
      aqualog inspect wheels.csv imu.csv gps.csv --write-map map.toml
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        if any(n.lower().endswith(".toml") for n in logs):
            code = _campaign(logs, has_log_options=bool(signals or dbc or write_map), as_json=as_json)
        else:
            code = _inspect(
                logs, signals, dbc or [], write_map,
                as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
            )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _campaign(names: list[str], *, has_log_options: bool, as_json: bool) -> int:
    from aqualog.cli.inspect_campaign import inspect_campaign
    from aqualog.errors import ConfigError

    if len(names) > 1:
        raise ConfigError("a campaign file beside other inputs", where=", ".join(names)[:200], expected="it alone")
    if has_log_options:
        raise ConfigError(
            "--signals, --dbc and --write-map are for logs", where=names[0], hint="name the signal map in the file"
        )
    return inspect_campaign(Path(names[0]), as_json=as_json)


def _inspect(
    logs: list[str],
    map_file: Path | None,
    dbc: list[Path],
    write_map: Path | None,
    *,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.align.load import read_options
    from aqualog.align.overview import find_mounting, overview, rotated_channels
    from aqualog.align.propose import propose_map
    from aqualog.cli.setup import prepare
    from aqualog.io.open_log import DriveLog

    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[write_map] if write_map else [], force=force, quiet=quiet,
        verbose=verbose, progress=progress,
    )  # fmt: skip
    console, paths = setup.console, setup.paths
    with console.steps() as steps, setup.reading(), DriveLog(paths, read_options(setup.signal_map, dbc)) as log:
        steps("reading")
        channels, lost = log.read_sound()
        formats, faults = log.formats, log.faults
        steps("looking at the channels")
        origin = min((int(c.t_ns.min()) for c in channels if c.t_ns.size), default=0)
        found = [overview(c, origin_ns=origin) for c in channels]
        rotated = rotated_channels(found)
        proposals = propose_map([c for c in channels if (c.info.file, c.info.path) not in rotated])
    told = [*lost, *((p.name, n) for p, f in zip(paths, faults, strict=True) for n in f.notes)]
    notes = [*(n if n.startswith(f"{name}: ") else f"{name}: {n}" for name, n in told), *find_mounting(found)]
    changes = setup.changes()
    notes += changes
    if write_map is not None:
        _write_map(write_map, proposals, paths, setup.signal_map)
    if as_json:
        sys.stdout.write(json.dumps(_document(paths, formats, found, proposals, notes), indent=1) + "\n")
    else:
        _print(paths, formats, channels, found, proposals, notes)
    if write_map is not None:
        console.note(f"proposed map with {len(proposals)} signals is in {write_map}: check it before you use it")
    damaged = changes or lost or any(f.truncated or f.lost_samples for f in faults)
    return 3 if damaged else (0 if found else 4)


def _write_map(path: Path, proposals: dict[str, Proposal], paths: list[Path], given: SignalMap) -> None:
    from aqualog.config.signal_map import map_text
    from aqualog.face.paths import write_text

    text = map_text(
        replace(given, entries={s: p.entry for s, p in proposals.items()}),
        comments=[f"proposed for {', '.join(p.name for p in paths)}: check every line"],
        remarks={s: p.reason for s, p in proposals.items()},
    )
    write_text(path, text)


def _print(
    paths: list[Path],
    formats: tuple[str, ...],
    channels: list[Channel],
    found: list[ChannelOverview],
    proposals: dict[str, Proposal],
    notes: list[str],
) -> None:
    from aqualog.cli.console import clean
    from aqualog.report.names import cut
    from aqualog.report.text import CELL, NOTE, table

    lines = []
    by_channel = {p.entry.channel[0]: s for s, p in proposals.items()}
    for path, kind in zip(paths, formats, strict=True):
        own = [o for o in found if o.file == path.name]
        absolute = any(c.absolute for c in channels if c.info.file == path.name)
        clock = "absolute time" if absolute else "a clock of its own"
        lines.append(f"{cut(path.name, CELL)}: {kind.upper()}, {len(own)} channels, {clock}")
        if own:
            rows = [_row(o, by_channel) for o in own]
            header = ("channel", "unit", "samples", "Hz", "from s", "to s", "min", "max", "gaps", "faults", "signal?")
            lines += [table(header, rows), ""]
    if proposals:
        lines.append("proposed signals:")
        lines += [f"  {s} = {cut(p.entry.channel[0], CELL)}  ({cut(p.reason, CELL)})" for s, p in proposals.items()]
    else:
        lines.append("no channel looks like a signal that aqualog knows")
    if notes:
        lines += ["", "notes:", *(f"  {cut(n, NOTE)}" for n in notes)]
    sys.stdout.write(clean("\n".join(lines) + "\n"))


def _row(o: ChannelOverview, by_channel: dict[str, str]) -> tuple[str, ...]:
    gaps = f"{o.gaps} (to {o.longest_gap_s:.2g} s)" if o.gaps else "-"
    symbol = by_channel.get(o.path) or by_channel.get(f"{o.file}:{o.path}") or ""
    numbers = (f"{o.start_s:.2f}", f"{o.end_s:.2f}", f"{o.low:.6g}", f"{o.high:.6g}")
    return (o.path, o.unit or "-", str(o.samples), f"{o.rate_hz:.4g}", *numbers, gaps, _faults(o), symbol)


def _faults(o: ChannelOverview) -> str:
    counts = {n.replace("_", "-"): getattr(o.faults, n) for n in type(o.faults).KINDS if n != "pauses"}
    counts["not finite"] = o.not_finite
    text = ", ".join(f"{n} {name}" for name, n in counts.items() if n)
    return ", ".join(t for t in (text, o.remark) if t) or "-"


def _document(
    paths: list[Path],
    formats: tuple[str, ...],
    found: list[ChannelOverview],
    proposals: dict[str, Proposal],
    notes: list[str],
) -> dict[str, Any]:
    import dataclasses
    import math

    from aqualog import __version__

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: plain(v) for k, v in value.items()}
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return {
        "schema_version": 1,
        "tool_version": __version__,
        "files": [{"file": str(p), "format": f} for p, f in zip(paths, formats, strict=True)],
        "channels": [plain(dataclasses.asdict(o)) for o in found],
        "proposed": {
            s: {"channel": p.entry.channel[0], "unit": p.entry.unit, "scale": p.entry.scale, "reason": p.reason}
            for s, p in proposals.items()
        },
        "notes": notes,
    }
