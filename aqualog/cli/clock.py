"""`aqualog align`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.options import Dbc, Debug, Force, Json, Progress, Quiet, Signals, Vehicle, Verbose

if TYPE_CHECKING:
    from aqualog.align.carrier import Carrier
    from aqualog.align.clock import ClockFit

__all__ = ["align"]


def align(
    logs: Annotated[
        list[str],
        typer.Argument(help="Reference first, then the sources to compare with it.", metavar="REFERENCE SOURCE..."),
    ],
    quantity: Annotated[
        str, typer.Option("--quantity", help="speed or yaw_rate: what both carry.", metavar="NAME")
    ] = "speed",
    channel: Annotated[
        list[str] | None,
        typer.Option("--channel", help="Channel of a file, if names do not decide.", metavar="FILE=CHANNEL"),
    ] = None,
    signals: Signals = None,
    dbc: Dbc = None,
    vehicle: Vehicle = None,
    max_offset: Annotated[float, typer.Option("--max-offset", help="Search range in s.", min=0.1, max=3600.0)] = 10.0,
    start_offset: Annotated[
        float | None,
        typer.Option("--start-offset", help="Rough offset in s of clocks that are far apart."),
    ] = None,
    write_map: Annotated[
        Path | None,
        typer.Option("--write-map", help="Write the signal map with the clocks found.", metavar="FILE"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Find the clock offset (and drift) between sources from a quantity that both carry.

    A positive offset means that the source is late against the reference. Nothing is guessed: a weak or ambiguous match
    is refused. Where the clocks have nothing in common, both are first taken to begin at the same moment.

    \b
    Examples:
      aqualog align speed.csv gnss.csv
      aqualog align wheels.csv gps.csv --signals map.toml --write-map map_with_clocks.toml
      aqualog align imu.csv camera.csv --quantity yaw_rate --channel "camera.csv=gyro_z"
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _align(
            logs, quantity, channel or [], signals, dbc or [], vehicle, max_offset, start_offset, write_map,
            as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _align(
    logs: list[str],
    quantity: str,
    named: list[str],
    map_file: Path | None,
    dbc: list[Path],
    vehicle_file: Path | None,
    max_offset: float,
    start_offset: float | None,
    write_map: Path | None,
    *,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.align.carrier import QUANTITIES, find_carrier
    from aqualog.align.clock import ClockFit
    from aqualog.align.load import read_options
    from aqualog.cli.console import clean, clean_line
    from aqualog.cli.setup import prepare
    from aqualog.errors import AqualogError, ConfigError, ExitCode
    from aqualog.io.open_log import DriveLog

    if quantity not in QUANTITIES:
        raise ConfigError(f'--quantity "{quantity}"', expected=" or ".join(QUANTITIES))
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[write_map] if write_map else [], force=force, quiet=quiet,
        verbose=verbose, progress=progress, vehicle_file=vehicle_file,
    )  # fmt: skip
    console, paths, signal_map, vehicle = setup.console, setup.paths, setup.signal_map, setup.vehicle
    if len(paths) < 2:
        raise ConfigError("align compares files", expected="a reference and at least one source")
    names = _named(named, [p.name for p in paths])
    with console.steps() as steps, setup.reading(), DriveLog(paths, read_options(signal_map, dbc)) as log:
        steps("reading")
        channels = log.read(log.channels())
        carriers = [
            find_carrier(
                [c for (file, _), c in channels.items() if file == p.name],
                quantity=quantity, signal_map=signal_map, vehicle=vehicle, named=names.get(p.name),
            )
            for p in paths
        ]  # fmt: skip
        fits: dict[str, ClockFit | AqualogError] = {}
        for source in carriers[1:]:
            steps(f"comparing {source.file} with {carriers[0].file}")
            try:
                fits[source.file] = _compare(carriers[0], source, quantity, max_offset, start_offset)
            except AqualogError as error:
                fits[source.file] = error
    good = {f: fit for f, fit in fits.items() if isinstance(fit, ClockFit)}
    if as_json:
        sys.stdout.write(json.dumps(_document(carriers, fits, quantity), indent=1) + "\n")
    else:
        sys.stdout.write(clean("".join(_text(carriers[0], c, fits[c.file], quantity) for c in carriers[1:])))
    if write_map is not None and good:
        _write_map(write_map, signal_map, good)
        console.note(f"clocks of {', '.join(good)} are in {write_map}")
        if map_file is None:
            console.note("it holds clocks only: give --signals map.toml to keep the signals of your map in it")
    for file, fit in fits.items():
        if isinstance(fit, AqualogError):
            sys.stderr.write(f"error: {clean_line(file)}: {clean_line(fit.line())}\n")
    changes = setup.changes()
    for text in changes:
        console.note(text)
    if not good:
        return int(ExitCode.NOTHING_USABLE)
    return int(ExitCode.PARTIAL) if len(good) < len(fits) or changes else int(ExitCode.DONE)


def _named(pairs: list[str], files: list[str]) -> dict[str, str]:
    from aqualog.errors import ConfigError

    result = {}
    for pair in pairs:
        file, _, channel = pair.partition("=")
        if file not in files or not channel:
            raise ConfigError(f'--channel "{pair}"', expected=f"FILE=CHANNEL with FILE one of {', '.join(files)}")
        result[file] = channel
    return result


def _compare(
    reference: Carrier, source: Carrier, quantity: str, max_offset: float, start_offset: float | None
) -> ClockFit:
    from aqualog.align.clock import estimate_clock

    if start_offset is None:
        apart = reference.absolute != source.absolute or not (
            source.t_ns[0] <= reference.t_ns[-1] and reference.t_ns[0] <= source.t_ns[-1]
        )
        start_offset = float(source.t_ns[0] - reference.t_ns[0]) * 1e-9 if apart else 0.0
    return estimate_clock(
        reference.t_ns, reference.x, source.t_ns, source.x, max_offset_s=max_offset, start_offset_s=start_offset,
        quantity="v_x" if quantity == "speed" else quantity,
    )  # fmt: skip


def _text(reference: Carrier, source: Carrier, fit: Any, quantity: str) -> str:
    from aqualog.align.carrier import QUANTITIES
    from aqualog.errors import AqualogError

    unit = QUANTITIES[quantity]
    head = f"{source.file} ({source.label}) against {reference.file} ({reference.label})\n"
    head += "".join(f"  {c.file}: {c.note}\n" for c in (reference, source) if c.note)
    if isinstance(fit, AqualogError):
        return f"{head}  refused: {fit.what}\n"
    side = "late" if fit.offset_s >= 0 else "early"
    offset_low, offset_high = fit.offset_ci95
    lines = [
        f"offset  {fit.offset_s:+.4f} s  95 % [{offset_low:+.4f}, {offset_high:+.4f}]  the source is {side}",
        f"drift   {fit.drift_ppm:+.0f} ppm  95 % [{fit.drift_ppm_ci95[0]:+.0f}, {fit.drift_ppm_ci95[1]:+.0f}]"
        + ("" if fit.drift_significant else "  not significant, not applied"),
        f"scale   source = {fit.ratio:.5f} * reference  95 % [{fit.ratio_ci95[0]:.5f}, {fit.ratio_ci95[1]:.5f}]",
        f"match   correlation {fit.peak:.3f} (limit {fit.peak_limit:.3f}, next best {fit.runner_up:.3f}) over "
        f"{fit.overlap_s:.0f} s, residual {fit.rms:.3g} {unit}",
    ]
    if quantity == "speed" and fit.slip_offset_s == fit.slip_offset_s:  # not NaN
        low, high = fit.slip_offset_ci95
        lines.append(f"        with tyre slip in the model: {fit.slip_offset_s:+.4f} s  95 % [{low:+.4f}, {high:+.4f}]")
        if low > offset_high or high < offset_low:
            lines.append("        the two do not agree: part of the offset is tyre slip, not time")
    return head + "".join(f"  {line}\n" for line in lines)


def _document(carriers: list[Carrier], fits: dict[str, Any], quantity: str) -> dict[str, Any]:
    import dataclasses
    import math

    from aqualog import __version__
    from aqualog.errors import AqualogError

    def plain(value: Any) -> Any:
        if isinstance(value, tuple):
            return [plain(v) for v in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    sources = []
    for carrier in carriers[1:]:
        fit = fits[carrier.file]
        entry: dict[str, Any] = {"file": carrier.file, "channel": carrier.label}
        if isinstance(fit, AqualogError):
            entry["refused"] = fit.line()
        else:
            entry |= {name: plain(value) for name, value in dataclasses.asdict(fit).items()}
        sources.append(entry)
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "quantity": quantity,
        "reference": {"file": carriers[0].file, "channel": carriers[0].label},
        "sources": sources,
    }


def _write_map(path: Path, signal_map: Any, fits: dict[str, ClockFit]) -> None:
    from dataclasses import replace

    from aqualog.align.mapping import SourceClock
    from aqualog.config.signal_map import map_text
    from aqualog.face.paths import write_text

    clocks = dict(signal_map.clocks)
    for file, fit in fits.items():
        drift = fit.drift_ppm if fit.drift_significant else 0.0
        clocks[file] = SourceClock(round(fit.offset_s, 6), round(drift, 3), round(fit.mid_ns * 1e-9, 3))
    text = map_text(replace(signal_map, clocks=clocks))
    write_text(path, text)
