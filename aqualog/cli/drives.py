"""Commands on several drives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.cli.frame import Output, Run, command, files_at

if TYPE_CHECKING:
    from aqualog.face.diagnose import Diagnosis

__all__ = ["calibrate", "diagnose", "evaluate", "validate"]


@command(
    "logs:drives vehicle:needed signals dbc out:vehicle wet fix accept page:calibration rate correct_offsets cache "
    "data force"
)
def calibrate(run: Run, out: Path | None, wet: bool, fix: list[str] | None, accept: bool, page: Path | None) -> Output:
    """Estimate what detectors must know of a car from its dry drives, with intervals and what cannot be determined.

    Mass, rolling resistance, drag area, effective radii, torque gain, accelerometer offset, and the polynomials of tie
    rods and steering. The drives must be dry and with the same load; four or more show how drives differ. The vehicle
    file must be given: it says which axle is driven. A value in it that the drives contradict stays, unless --accept.

    With --wet, passes over water show how the car's tyres float: the speed of full aquaplaning in the reference
    condition (v_anchor), and how fast the contact is lost below it (contact_exponent). Name four or more passes, from
    partial to full aquaplaning, each with a dry second before the water, and tread and pressure with --fix.

    \b
    Examples:
      aqualog calibrate dry1.mf4 dry2.mf4 dry3.mf4 dry4.mf4 --vehicle car.toml -o calibrated.toml
      aqualog calibrate dry*.mcap --vehicle car.toml --fix mass=1482 --json
      aqualog calibrate --wet pass*.mf4 --vehicle car.toml --fix tread=1.6 --fix pressure=2.2 -o wet.toml
      aqualog calibrate monday/ tuesday/ --vehicle car.toml --signals map.toml --page calibration.html
    """
    from aqualog.face.calibrate import calibrate
    from aqualog.face.drives import grouped

    run.need_vehicle("which axle is driven, radii, axle distances")
    fixed = _fixed(fix or [], wet=wet)
    drive = run.drive([p for p in (out, page) if p is not None])
    with run.hearing("nothing was written") as hear:
        result = calibrate(grouped(run.logs, drive), drive.vehicle, fix=fixed, accept=accept, wet=wet, progress=hear)
    files = files_at(result, {"calibrated.toml": out, "calibration.html": page})
    return Output(result, [*result.notes, *(f"written: {path}" for path in files)], files=files)


def _fixed(texts: list[str], *, wet: bool) -> dict[str, float]:
    """Return `mass=1400` as a mapping; the estimator checks names and bounds."""
    from aqualog.calibrate.derive import check_fixed
    from aqualog.core.errors import ConfigError
    from aqualog.trade.water_law import check_known

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
    if wet:
        check_known(fixed)
    else:
        check_fixed(fixed)
    return fixed


@command(
    "logs:diagnosed vehicle:believed model:known signals dbc holdout out:model page:diagnosis level seed:drawn "
    "surrogates bootstrap rate correct_offsets cache data force"
)
def diagnose(
    run: Run,
    holdout: list[str] | None,
    out: Path | None,
    page: Path | None,
    level: float,
    seed: int,
    surrogates: int | None,
    bootstrap: bool,
) -> Output:
    """Find what the simulation gets wrong on measured drives: the cause, its size and interval, and the gain.

    The vehicle file is what the simulation believes. The verdict is one of: no_effect, named, compound, cannot_tell
    (the log does not separate the causes; a drive that would is named), unexplained, not_testable. The extended model
    is a file that simulate, detect and diagnose take with --model.

    \b
    Examples:
      aqualog diagnose drive.mf4 --vehicle car.toml
      aqualog diagnose monday/ tuesday.mcap --vehicle car.toml --holdout friday.mf4 -o model.toml --page diagnosis.html
      aqualog diagnose drive.csv --vehicle car.toml --signals map.toml --model model.toml --json
      aqualog diagnose drive.mf4 --vehicle car.toml --no-bootstrap
      aqualog diagnose campaign.toml --page campaign.html
    """
    from aqualog.core.errors import ConfigError
    from aqualog.face.campaign_inputs import is_campaign

    if surrogates is not None and not bootstrap:
        raise ConfigError("--surrogates beside --no-bootstrap", expected="one of them")
    if not is_campaign(run.logs):
        drawn = surrogates if bootstrap else 0
        return _drives(run, holdout or [], out, page, {"level": level, "seed": seed, "surrogates": drawn})
    strange = {
        "--holdout": bool(holdout),
        "--rate": run.rate is not None,
        "--correct-offsets": run.correct_offsets,
        "--no-bootstrap": not bootstrap,
        "--cache": run.cache is True,
    }
    given = next((option for option, is_given in strange.items() if is_given), None)
    if given is not None:
        raise ConfigError(f"{given} does not apply to a campaign", expected="what a campaign takes: --help")
    return _campaign(run, out, page, {"level": level, "seed": seed, "surrogates": surrogates})


def _drives(run: Run, holdout: list[str], out: Path | None, page: Path | None, options: dict[str, Any]) -> Output:
    from aqualog.core.errors import ConfigError
    from aqualog.face.arguments import expand, list_files
    from aqualog.face.diagnose import diagnose
    from aqualog.face.drives import grouped

    run.need_vehicle("it is what the simulation believes")
    unseen = expand(holdout)
    others = [*unseen, *list_files(holdout), *([run.model] if run.model is not None else [])]
    drive = run.drive([p for p in (out, page) if p is not None], others=others)
    missing = next((p for p in unseen if not p.exists()), None)
    if missing is not None:
        raise ConfigError(
            "no such file or folder", where=f"--holdout {missing}", expected="a drive to measure the gain on"
        )
    with run.hearing("nothing was written") as hear:
        result = diagnose(
            grouped(run.logs, drive), drive.vehicle, holdout=grouped(holdout, drive), model=run.model,
            views=page is not None, progress=hear, **options,
        )  # fmt: skip
    return _output(result, out, page)


def _campaign(run: Run, out: Path | None, page: Path | None, options: dict[str, Any]) -> Output:
    """Diagnose a campaign's runs together, which show what no single drive does."""
    from aqualog.face.arguments import refuse_existing
    from aqualog.face.detect import model_of
    from aqualog.face.diagnose import diagnose

    campaign = run.campaign()
    targets = [p for p in (out, page) if p is not None]
    campaign.check_targets(targets, force=run.force)
    refuse_existing(targets, force=True, sources=[run.model] if run.model is not None else [])
    known = model_of(run.model)
    runs = run.measured(campaign)
    if not runs.outcome.done:
        return run.of_runs(runs)
    with run.hearing() as hear:
        result = diagnose(runs, model=known, progress=hear, **options)
    return replace(_output(result, out, page), code=run.of_runs(runs).code)


def _output(result: Diagnosis, model: Path | None, page: Path | None) -> Output:
    """Return the output of a diagnosis, which names its model file."""
    if model is not None:
        result = result.naming(model)
    files = files_at(result, {"model.toml": model, "diagnosis.html": page})
    return Output(result, [*result.notes, *(f"written: {path}" for path in files)], files=files)


@command(
    "logs:validated vehicle:needed model:known signals dbc method:validity boundaries why out:page rate "
    "correct_offsets cache data force"
)
def validate(run: Run, method: str, boundaries: Path | None, why: bool, out: Path | None) -> Output:
    """Judge whether the simulation of a car is valid on measured drives: in one sentence, and why not.

    By the methods of ISO 19364 [iso19364_2016] (boundaries in cross plots) and ISO/TS 18571 [iso18571_2024] (a rating),
    on another test than theirs.
    The simulation follows the measured torque and steering. Three drives or more that repeat each other give the
    tolerances. Then the verdict of `aqualog diagnose` follows, which takes about a minute; --no-why leaves it out.

    \b
    Examples:
      aqualog validate drive.mf4 --vehicle car.toml --no-why
      aqualog validate run1.mf4 run2.mf4 run3.mf4 --vehicle car.toml -o validity.html
      aqualog validate drive.mf4 --vehicle car.toml --method 18571 --boundaries own.toml --json
    """
    from aqualog.face.drives import grouped
    from aqualog.face.validate import validate

    run.need_vehicle("it is what the simulation believes")
    others = [p for p in (run.model, boundaries) if p is not None]
    drive = run.drive([out] if out is not None else [], others=others)
    with run.hearing("nothing was written") as hear:
        result = validate(
            grouped(run.logs, drive), drive.vehicle, method=method, boundaries=boundaries, model=run.model,
            why=why, progress=hear,
        )  # fmt: skip
    files = files_at(result, {"validation.html": out})
    return Output(result, [*result.notes, *(f"the page is {path}" for path in files)], files=files)


@command(
    "logs:campaign vehicle:of_logs signals dbc labels by:tables rivals rival roc thresholds tune gate junit out:page "
    "data force"
)
def evaluate(
    run: Run,
    labels: Path | None,
    by: str,
    rivals: bool,
    rival: list[str] | None,
    roc: bool,
    tune: Path | None,
    gate: list[str] | None,
    junit: Path | None,
    out: Path | None,
) -> Output:
    """Compare what the detectors find with what was there: recall, latency, false alarms, confusion.

    What was there comes from a labels file, from the truth in a simulated log, from the signal on_water, or from the
    lane's times in the campaign. A log that cannot be read is named; the others are evaluated.

    \b
    Examples:
      aqualog evaluate campaign.toml -o evaluation.html
      aqualog evaluate campaign.toml --by tyre,depth --rivals --roc -o evaluation.html
      aqualog evaluate campaign.toml --tune thresholds.toml
      aqualog evaluate drive.mf4 --vehicle car.toml --labels labels.csv --json
      aqualog evaluate dry/*.mf4 --vehicle car.toml --labels dry.csv
      aqualog evaluate campaign.toml --rival own=ESP.AquaWarn --rival 'easyrain=DAI.Level>=2'
      aqualog evaluate campaign.toml --gate 'joint_cusum.recall>=0.9' --junit g.xml
    """
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.evaluate.gates import parse_gates
    from aqualog.evaluate.judge import ODD_LABELS
    from aqualog.evaluate.logged import parse_rivals
    from aqualog.face.arguments import refuse_existing
    from aqualog.face.evaluate import evaluate, inputs_of

    logged = [r.name for r in parse_rivals(rival or ())]
    parse_gates(gate or (), with_rivals=rivals, logged=logged)
    if junit is not None and not gate:
        raise ConfigError("--junit without --gate", expected="--gate 'joint_cusum.recall>=0.9'")
    given = inputs_of(run.logs, run.vehicle, map=run.signals, dbc=run.dbc, labels=labels)
    own = [*given.files, *(p for p in (run.thresholds,) if p)]
    refuse_existing([p for p in (tune, out, junit) if p], force=run.force, sources=own)
    with run.hearing("nothing was written") as hear:
        found = evaluate(
            run.logs, run.vehicle, labels=labels, map=run.signals, dbc=run.dbc, by=by, rivals=rivals,
            rival=rival or (), roc=roc, thresholds=run.thresholds, tune=tune is not None, progress=hear,
        )  # fmt: skip
    found = found.gated(gate or ())
    has_records = bool(found.evaluation.records)
    # gates also without a drive: the build server then shows why
    files = {} if junit is None else {junit: found.junit_file()}
    if has_records:
        tuned = tune if found.evaluation.tuning is not None else None
        files |= files_at(found, {"thresholds.toml": tuned, "evaluation.html": out})
    with run.hearing() as hear:
        for name, reason in found.evaluation.failed.items():
            hear.failed(name, reason)
    if not has_records:
        return Output(code=int(ExitCode.NOTHING_USABLE), files=files)
    for name, reason in found.late.items():
        run.console.error(f"{name}: {reason}")
    odd = [n for n in found.notes if ODD_LABELS in n]
    written = [f"the page is {out}"] if out is not None else []
    written += [f"the thresholds are in {tune}"] if tune is not None else []
    written += [f"the gates are in {junit}"] if junit is not None else []
    has_tripped = any(not g.is_kept for g in found.gates)
    details = [f"note: {n}" for n in (*found.notes, *found.cut) if n not in odd]
    code = int(ExitCode.GATE_TRIPPED) if has_tripped else None
    return Output(found, [*odd, *written], details, code=code, files=files)
