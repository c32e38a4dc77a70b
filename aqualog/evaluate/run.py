"""Evaluate many drives: score, sweep over thresholds, tune on some and report on others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from aqualog.core.errors import AqualogError, ConfigError
from aqualog.detect.registry import DETECTORS
from aqualog.detect.thresholds import DEFAULT, Thresholds
from aqualog.evaluate.drives import Drive, Source
from aqualog.evaluate.judge import judge
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.sweep import (
    FACTORS,
    JOINT,
    LIMIT_PER_HOUR,
    Choice,
    RocPoint,
    applied,
    choose,
    curve_points,
    records_at,
    split_runs,
)

__all__ = ["Evaluation", "Tuning", "evaluate", "tune"]

Report = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Tuning:
    """Thresholds proposed on some drives; `records` of the evaluation are those of the other drives only.

    `tuned_on`, `reported_on`, `unused` are names of drives; `before` the result of the reported drives with the
    original thresholds.
    """

    rule: str
    limit_per_hour: float
    tuned_on: tuple[str, ...]
    reported_on: tuple[str, ...]
    unused: tuple[str, ...]
    choices: Mapping[str, Choice]
    before: tuple[RunRecord, ...]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Result of all drives.

    `records` are the drives that are reported; `roc` the points of the curves, empty if not asked for; `failed` drive
    -> reason; `thresholds` and `rivals` those that were used (`rivals` None: without).
    """

    records: tuple[RunRecord, ...]
    thresholds: Thresholds
    rivals: Mapping[str, float] | None
    roc: tuple[RocPoint, ...] = ()
    failed: Mapping[str, str] = field(default_factory=dict)
    tuning: Tuning | None = None


def evaluate(
    sources: Sequence[Source], *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None,
    with_roc: bool = False, factors: Sequence[float] = FACTORS, report: Report = lambda _: None,
) -> Evaluation:  # fmt: skip
    """Score all drives; report one that cannot be read and leave it out.

    Parameters
    ----------
    sources : sequence of Source
    rivals : mapping name -> float, optional
        Thresholds of the rivals (those not named: default); None: without rivals.
    with_roc : bool
        Also at thresholds scaled by `factors`, which takes as much time for each.
    report : callable
        Called with the name of each step.
    """
    failed: dict[str, str] = {}
    swept = [f for f in factors if abs(f - 1.0) > 1e-9] if with_roc else []

    def work(drive: Drive) -> dict[float, RunRecord]:
        first = {1.0: judge(drive, thresholds=thresholds, rivals=rivals)}
        return first | _swept(drive, factors=swept, thresholds=thresholds, rivals=rivals)

    done = _each(sources, work, failed, report, "evaluating")
    by_factor = {f: [d[f] for d in done] for f in (1.0, *swept)}
    roc = curve_points(by_factor, thresholds=thresholds, rivals=rivals) if with_roc else ()
    return Evaluation(tuple(by_factor[1.0]), thresholds, rivals, roc, failed)


def tune(
    sources: Sequence[Source], *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None,
    with_roc: bool = False, factors: Sequence[float] = FACTORS, limit_per_hour: float = LIMIT_PER_HOUR,
    report: Report = lambda _: None,
) -> Evaluation:  # fmt: skip
    """Propose thresholds on some drives and evaluate them on others; arguments as `evaluate`.

    Single detectors and rivals come first, then the joint ones with the single ones at their proposals. Only their
    configuration decides which drives are tuned on (`sweep.split_runs`).

    Raises
    ------
    ConfigError
        If there are not enough drives for both.
    """
    split = split_runs([s.groups for s in sources])
    if not split.tuning or not split.reporting:
        raise ConfigError(f"{len(sources)} drives cannot be divided", expected="two or more, to tune and to report on")
    failed: dict[str, str] = {}
    on = [sources[i] for i in split.tuning]
    single = [d for d in DETECTORS if d not in JOINT]
    choices: dict[str, Choice] = {}
    tuned, tuned_rivals = thresholds, dict(rivals or {})
    for names, with_rivals in ((single, rivals is not None), (JOINT, False)):
        asked = tuned_rivals if with_rivals else None
        at = partial(_swept, factors=factors, thresholds=tuned, rivals=asked, names=names)
        done = _each(on, at, failed, report, "tuning")
        by_factor = {f: [d[f] for d in done] for f in factors}
        new = choose(curve_points(by_factor, thresholds=tuned, rivals=asked), limit=limit_per_hour)
        choices |= new
        tuned, tuned_rivals = applied(new, tuned, tuned_rivals)
    others = [sources[i] for i in split.reporting]
    used_rivals = None if rivals is None else tuned_rivals
    result = evaluate(
        others, thresholds=tuned, rivals=used_rivals, with_roc=with_roc, factors=factors, report=report
    )  # fmt: skip
    readable = [s for s in others if s.name not in result.failed]
    before = evaluate(readable, thresholds=thresholds, rivals=rivals, report=report)
    return Evaluation(
        result.records, tuned, used_rivals, result.roc, {**failed, **result.failed},
        Tuning(
            split.rule, limit_per_hour, tuple(s.name for s in on if s.name not in failed),
            tuple(r.name for r in result.records), tuple(sources[i].name for i in split.unused), choices,
            before.records,
        ),
    )  # fmt: skip


def _swept(drive: Drive, *, factors: Sequence[float], **given: Any) -> dict[float, RunRecord]:
    return {f: records_at(drive, f, **given) for f in factors}


def _each(
    sources: Sequence[Source], work: Callable[[Drive], dict[float, RunRecord]], failed: dict[str, str], report: Report,
    what: str,
) -> list[dict[float, RunRecord]]:  # fmt: skip
    """Process the drives one after the other; give a reason for each that cannot be read, which is not tried again."""
    done = []
    for number, source in enumerate(sources, 1):
        if source.name in failed:
            continue
        report(f"{what}: drive {number} of {len(sources)}")
        try:
            done.append(work(source.load()))
        except (AqualogError, OSError) as error:
            failed[source.name] = error.line() if isinstance(error, AqualogError) else str(error)
    return done
