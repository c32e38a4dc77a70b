"""`aqualog calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["calibrate"]


@command("logs:drives vehicle:needed signals dbc out fix page rate cache json force")
def calibrate(
    run: Run,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Vehicle file with the calibrated values.", metavar="FILE")
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
        Path | None, typer.Option("--page", help="Page with tables and residuals (HTML).", metavar="FILE")
    ] = None,
) -> Output:
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
    from aqualog.core.errors import ExitCode
    from aqualog.face.calibrate import calibrate
    from aqualog.face.drives import NothingUsableError, grouped

    run.need_vehicle("which axle is driven, radii, axle distances")
    fixed = _fixed(fix or [])
    targets = [p for p in (out, page) if p is not None]
    drive = run.drive(targets)
    try:
        with run.hearing("nothing was written") as hear:
            result = calibrate(grouped(run.logs, drive), drive.vehicle, fix=fixed, progress=hear)
    except NothingUsableError:  # each reason was reported
        return Output(code=int(ExitCode.NOTHING_USABLE))
    if out is not None:
        result.write_vehicle(out, force=True)
    if page is not None:
        result.write_page(page, force=True)
    return Output(result, [*result.notes, *(f"written: {path}" for path in targets)])


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
