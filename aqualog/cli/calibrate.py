"""`aqualog calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import (
    Cache,
    CarNeeded,
    Dbc,
    Debug,
    Force,
    Json,
    Progress,
    Quiet,
    Rate,
    Signals,
    Verbose,
)  # fmt: skip

__all__ = ["calibrate"]


def calibrate(
    logs: Annotated[
        list[str],
        typer.Argument(
            help="Logs of dry drives, each argument a drive of its own; a folder is one drive of several files.",
            metavar="LOG...",
            show_default=False,
        ),
    ],
    vehicle: CarNeeded = None,
    signals: Signals = None,
    dbc: Dbc = None,
    out: Annotated[
        str | None, typer.Option("-o", "--out", help="Vehicle file with the calibrated values.", metavar="FILE")
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            "--fix",
            help="What is known: mass=KG, torque_gain=X, drag_area=M2 or rolling_resistance=X; may be repeated.",
            metavar="KEY=VALUE",
        ),
    ] = None,
    page: Annotated[
        str | None, typer.Option("--page", help="Page with tables and residuals (HTML).", metavar="FILE")
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
    """Estimate what detectors must know of a car from its dry drives, with intervals and what cannot be determined.

    Mass, rolling resistance, drag area, effective radii, torque gain, accelerometer offset, and the polynomials of tie
    rods and steering. The drives must be dry and with the same load; four or more show how drives differ. The vehicle
    file must be given: it says which axle is driven.

    \b
    Examples:
      aqualog calibrate dry1.mf4 dry2.mf4 dry3.mf4 dry4.mf4 --vehicle car.toml -o calibrated.toml
      aqualog calibrate dry*.mcap --vehicle car.toml --fix mass=1482 --json
      aqualog calibrate monday/ tuesday/ --vehicle car.toml --signals map.toml --page calibration.html
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _calibrate(
            logs, vehicle, signals, dbc or [], out, fix or [], page, rate,
            cached=cache, as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _calibrate(
    logs: list[str],
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    out_name: str | None,
    fix: list[str],
    page_name: str | None,
    rate: float | None,
    *,
    cached: bool | None,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.console import told_if_interrupted
    from aqualog.cli.setup import prepare, result_file
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.calibrate import calibrate
    from aqualog.face.drives import NothingUsableError, grouped

    if vehicle_file is None:
        raise ConfigError("no --vehicle", expected="a vehicle file: which axle is driven, radii, axle distances")
    fixed = _fixed(fix)
    out, page = result_file(out_name, "-o"), result_file(page_name, "--page")
    targets = [p for p in (out, page) if p is not None]
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=targets, force=force, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file, cached=cached, rate_hz=rate,
    )  # fmt: skip
    try:
        with setup.console.hearing() as hear, told_if_interrupted("nothing was written"):
            result = calibrate(grouped(logs, setup.drive), setup.vehicle, fix=fixed, progress=hear)
    except NothingUsableError:  # each reason was reported
        return int(ExitCode.NOTHING_USABLE)
    if out is not None:
        result.write_vehicle(out, force=True)
    if page is not None:
        result.write_page(page, force=True)
    setup.console.data(result, as_json=as_json)
    for text in result.notes:
        setup.console.note(text)
    for path in targets:
        setup.console.note(f"written: {path}")
    return int(ExitCode.PARTIAL) if result.has_loss else int(ExitCode.DONE)


def _fixed(texts: list[str]) -> dict[str, float]:
    """Return `mass=1400` as a mapping; the estimator checks names and bounds."""
    from aqualog.calibrate.derive import check_fixed
    from aqualog.core.errors import ConfigError

    fixed: dict[str, float] = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise ConfigError(f'--fix "{text}"', expected="KEY=VALUE, such as mass=1482") from None
        if name.strip() in fixed:
            raise ConfigError(f"--fix {name.strip()} is given twice", expected="one value for each key")
        fixed[name.strip()] = number
    check_fixed(fixed)
    return fixed
