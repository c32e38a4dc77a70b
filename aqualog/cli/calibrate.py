"""`aqualog calibrate`."""

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
    Progress,
    Quiet,
    Rate,
    Signals,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.calibrate.records import Calibration
    from aqualog.cli.console import Steps
    from aqualog.cli.setup import Setup
    from aqualog.types import Signals as SignalTable
    from aqualog.vehicle import Vehicle as VehicleRecord

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
    from aqualog.cli.console import clean, clean_line
    from aqualog.cli.setup import prepare
    from aqualog.errors import ConfigError, ExitCode

    if vehicle_file is None:
        raise ConfigError("no --vehicle", expected="a vehicle file: which axle is driven, radii, axle distances")
    fixed = _fixed(fix)
    targets = [_target(name, option) for name, option in ((out_name, "-o"), (page_name, "--page")) if name is not None]
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=targets, force=force, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file, cached=cached,
    )  # fmt: skip
    drives = _drives(logs)
    with setup.console.steps() as steps:
        from aqualog.cli.console import told_if_interrupted

        with told_if_interrupted("nothing was written"):
            loaded, failed = _load_all(drives, setup, dbc, rate, steps)
            steps("estimating")
            result = _estimated(loaded, failed, setup.vehicle, fixed)
    for line in failed:
        sys.stderr.write(f"error: {clean_line(line)}\n")
    if result is None:
        return int(ExitCode.NOTHING_USABLE)
    drives = [(name, paths) for name, paths in drives if name in loaded]
    changes = setup.changes()
    notes = (*(_of(name, paths, n) for name, paths in drives for n in loaded[name].quality.notes), *changes)
    if out_name is not None:
        from aqualog.config.vehicle_edit import calibrated_toml
        from aqualog.face.paths import write_text

        write_text(Path(out_name), calibrated_toml(setup.vehicle, result))
    if page_name is not None:
        from aqualog.face.paths import write_whole
        from aqualog.report.calibration_page import write_calibration_page

        title = f"{result.vehicle_name}, {len(drives)} drives"
        write_whole(Path(page_name), lambda p: write_calibration_page(result, p, title=title, notes=notes))
    from aqualog.report.calibration_document import calibration_document, calibration_text

    if as_json:
        document = calibration_document(result, logs=[str(p) for _, paths in drives for p in paths], notes=notes)
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(clean(calibration_text(result)))
    for text in (*notes, *result.notes):
        setup.console.note(text)
    for path in targets:
        setup.console.note(f"written: {path}")
    lossy = any(s.quality.truncated or s.quality.lost_in_files for s in loaded.values())
    is_partial = lossy or failed or changes or len(result.drives) < len(drives)
    return int(ExitCode.PARTIAL) if is_partial else int(ExitCode.DONE)


def _load_all(
    drives: list[tuple[str, list[Path]]], setup: Setup, dbc: list[Path], rate: float | None, steps: Steps
) -> tuple[dict[str, SignalTable], list[str]]:
    """Drives by name, and a line for each that cannot be read."""
    from aqualog.errors import AqualogError, ConfigError

    loaded: dict[str, SignalTable] = {}
    failed: list[str] = []
    for name, paths in drives:
        try:
            loaded[name] = _load(name, paths, setup, dbc, rate, steps)
        except ConfigError:  # of the options, which are those of all drives
            raise
        except (AqualogError, OSError) as error:
            line = error.line() if isinstance(error, AqualogError) else str(error)
            failed.append(_of(name, paths, line))
    return loaded, failed


def _of(name: str, paths: list[Path], text: str) -> str:
    """The text with the drive's name before it, unless the drive is one file that the text names already."""
    is_file = len(paths) == 1 and name in (paths[0].name, str(paths[0]))
    return text if is_file and name in text else f"{name}: {text}"


def _estimated(
    loaded: dict[str, SignalTable], failed: list[str], vehicle: VehicleRecord, fixed: dict[str, float]
) -> Calibration | None:
    """The calibration; drives that lack a signal leave `loaded` for a line in `failed`; None if all do."""
    from aqualog.calibrate.run import calibrate as run
    from aqualog.errors import SignalError

    while loaded:
        try:
            return run(list(loaded.values()), list(loaded), vehicle, fixed)
        except SignalError as error:
            if error.where not in loaded:
                raise
            del loaded[error.where]
            failed.append(error.line())
    return None


def _load(name: str, paths: list[Path], setup: Setup, dbc: list[Path], rate: float | None, steps: Steps) -> SignalTable:
    from aqualog.align.load import load_signals

    return load_signals(
        paths, vehicle=setup.vehicle, signal_map=setup.signal_map, dbc=dbc, rate_hz=rate,
        report=lambda step: steps(f"{name}: {step}"), cache=setup.cache,
    )  # fmt: skip


def _drives(logs: list[str]) -> list[tuple[str, list[Path]]]:
    """Files by drive: a folder's belong together, those of a glob or a list do not; the same file counts once."""
    from aqualog.face.paths import expand

    drives: list[tuple[str, list[Path]]] = []
    seen: set[Path] = set()
    for argument in logs:
        paths = [p for p in expand([argument]) if p.resolve() not in seen]
        seen |= {p.resolve() for p in paths}
        if Path(argument).is_dir():
            drives += [(Path(argument).name or argument, paths)] if paths else []
        else:
            drives += [(p.name, [p]) for p in paths]
    names = [n for n, _ in drives]
    return [(n if names.count(n) == 1 else str(paths[0]), paths) for n, paths in drives]


def _fixed(texts: list[str]) -> dict[str, float]:
    """`mass=1400` to a mapping; names and bounds are checked by the estimator."""
    from aqualog.calibrate.derive import check_fixed
    from aqualog.errors import ConfigError

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


def _target(name: str, option: str) -> Path:
    from aqualog.errors import ConfigError

    if not name.strip():
        raise ConfigError(f"{option} is empty", expected="a file to write")
    return Path(name)
