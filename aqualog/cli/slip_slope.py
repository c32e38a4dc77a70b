"""`aqualog slip-slope`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import (
    Cache,
    CarNeeded,
    Dbc,
    Debug,
    Force,
    Json,
    Logs,
    Progress,
    Quiet,
    Rate,
    Signals,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.detect.slip_slope.direct_records import DirectResult

__all__ = ["slip_slope"]

_RESULTS = ("slip_slope.json", "slip_slope.csv", "slip_slope.html")


def slip_slope(
    logs: Logs,
    vehicle: CarNeeded = None,
    signals: Signals = None,
    dbc: Dbc = None,
    out: Annotated[
        str | None,
        typer.Option("-o", "--out", help="Folder for slip_slope.json, .csv and .html.", metavar="DIR"),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="auto, axle (driven against free wheels), velocity (against v_x) or differential (recursive only).",
            metavar="NAME",
        ),
    ] = "auto",
    traction: Annotated[
        str,
        typer.Option("--traction", help="auto, torque or accelerometer (one driven axle).", metavar="NAME"),
    ] = "auto",
    mu_max: Annotated[
        float, typer.Option("--mu-max", help="Largest traction coefficient used.", min=0.02, max=1.0)
    ] = 0.3,
    delay: Annotated[
        float | None,
        typer.Option(
            "--delay",
            help="By how much v_x is late against the wheels, where known; else it is estimated (velocity only).",
            metavar="SECONDS",
            min=-1.0,
            max=1.0,
        ),
    ] = None,
    rate: Rate = None,
    cache: Cache = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Tell the slip slope C_s/F_z of each driven wheel, how sure it is, and whether it stayed the same.

    Slip is regressed on traction over straight, unbraked driving; the intervals are from blocks of the drive left out
    in turn. The files named are ONE drive. The vehicle file must be given: it says which axle is driven.

    \b
    Examples:
      aqualog slip-slope drive.mf4 --vehicle car.toml
      aqualog slip-slope wheels.csv imu.csv --signals map.toml --vehicle car.toml -o out
      aqualog slip-slope drive.mcap --vehicle awd.toml --method velocity --json
      aqualog slip-slope drive.mcap --vehicle awd.toml --method velocity --delay 0.12
      aqualog slip-slope track.mf4 --vehicle car.toml --traction accelerometer --mu-max 0.5
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _slip_slope(
            logs, vehicle, signals, dbc or [], out, method, traction, mu_max, delay, rate,
            cached=cache, as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _slip_slope(
    logs: list[str],
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    out_name: str | None,
    method: str,
    traction: str,
    mu_max: float,
    delay: float | None,
    rate: float | None,
    *,
    cached: bool | None,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.setup import prepare
    from aqualog.errors import ConfigError, ExitCode

    if vehicle_file is None:
        raise ConfigError("no --vehicle", expected="a vehicle file: which axle is driven, radii, where the mass is")
    out = None if out_name is None else _folder(out_name)
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[out / n for n in _RESULTS] if out else [], force=force,
        quiet=quiet, verbose=verbose, progress=progress, vehicle_file=vehicle_file,
        cached=cached,
    )  # fmt: skip
    console, paths, vehicle = setup.console, setup.paths, setup.vehicle
    name = ", ".join(str(p) for p in paths)
    title = name if len(paths) <= 2 else f"{paths[0].parent.name or paths[0].name} ({len(paths)} files)"
    with console.steps() as steps, setup.reading():
        from aqualog.align.load import load_signals
        from aqualog.detect.slip_slope.direct import slip_slopes

        loaded = load_signals(
            paths, vehicle=vehicle, signal_map=setup.signal_map, dbc=dbc, rate_hz=rate, report=steps, cache=setup.cache
        )
        console.detail(f"{len(loaded.symbols)} signals, {loaded.frame.height} samples at {1e9 / loaded.dt_ns:g} Hz")
        changes = setup.changes()
        notes = (*loaded.quality.notes, *changes)
        steps("estimating")
        result = slip_slopes(loaded, vehicle, method=method, traction=traction, mu_max=mu_max, delay=delay)
        steps("writing")
        if out is not None:
            _write_results(result, out, name, title, notes)
    _print(result, name, notes, as_json=as_json)
    for text in (*notes, *result.notes):
        console.note(text)
    if out is not None:
        console.note(f"results are in {out}: {', '.join(_RESULTS)}")
    lossy = loaded.quality.truncated or loaded.quality.lost_in_files or changes
    return int(ExitCode.PARTIAL) if lossy else int(ExitCode.DONE)


def _folder(name: str) -> Path:
    """The folder for results; it need not exist, but nothing may be in its way."""
    from aqualog.errors import ConfigError

    expected = "a folder for the results"
    if not name.strip():
        raise ConfigError("-o is empty", expected=expected)
    out = Path(name)
    if out.exists() and not out.is_dir():
        raise ConfigError("-o is a file", where=name, expected=expected)
    there = next((p for p in out.parents if p.exists()), Path())
    if not there.is_dir():
        raise ConfigError(f"-o is below a file, {there}", where=name, expected=expected)
    return out


def _write_results(result: DirectResult, out: Path, name: str, title: str, notes: tuple[str, ...]) -> None:
    from aqualog.face.paths import write_text, write_whole
    from aqualog.report.slope_document import slope_csv, slope_document
    from aqualog.report.slope_page import write_slope_page

    out.mkdir(parents=True, exist_ok=True)
    document = slope_document(result, log=name, notes=notes)
    write_text(out / "slip_slope.json", json.dumps(document, indent=1, allow_nan=False) + "\n")
    write_text(out / "slip_slope.csv", slope_csv(result))
    write_whole(out / "slip_slope.html", lambda p: write_slope_page(result, p, title=title, notes=notes))


def _print(result: DirectResult, name: str, notes: tuple[str, ...], *, as_json: bool) -> None:
    from aqualog.cli.console import clean
    from aqualog.report.slope_document import slope_document, slope_text

    if as_json:
        document = slope_document(result, log=name, notes=notes)
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
        return
    sys.stdout.write(clean(slope_text(result)))
