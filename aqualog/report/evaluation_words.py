"""The sentences of an evaluation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from aqualog.detect.registry import RIVALS
from aqualog.evaluate import score
from aqualog.evaluate.judge import LIMITS_S
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.run import Evaluation, Tuning
from aqualog.evaluate.sweep import JOINT
from aqualog.report.values import upper_first

__all__ = [
    "better_sentences", "coverage_sentences", "headline", "notes_of", "percent", "rate_text", "recall_text",
    "seconds_text", "short", "title_of", "tuning_sentences", "verdicts",
]  # fmt: skip

_MEASURES = {
    "full": "of full aquaplaning found",
    "partial": "of partial aquaplaning found",
    "false alarms": "false alarms per hour",
}


def title_of(detector: str) -> str:
    """`spin_down` -> `spin-down`; a rival with its reference, one in the log by its name."""
    if detector in RIVALS:
        return f"{RIVALS[detector].title} {RIVALS[detector].reference}"
    if score.is_rival(detector):
        return detector
    return detector.replace("_", " ")


def recall_text(r: score.Recall) -> str:
    """`12/13 (92 %)`; a dash without episodes."""
    return f"{r.found}/{r.episodes} ({percent(r.share)})" if r.episodes else "-"


def percent(share: float) -> str:
    """A share in per cent; one decimal where it matters."""
    if math.isnan(share):
        return "-"
    text = f"{100.0 * share:.1f}" if share > 0.9 and share < 1.0 else f"{100.0 * share:.0f}"
    return f"{text} %"


def rate_text(rate: score.Rate) -> str:
    """`0.4 (0.1 ... 1.4)` per hour, a dash without time."""
    if not rate.seconds > 0.0:
        return "-"
    low, high = rate.per_hour_ci95
    return f"{short(rate.per_hour)} ({short(low)} ... {short(high)})"


def short(x: float) -> str:
    """Two significant digits, never as a power of ten."""
    if math.isnan(x):
        return "-"
    return f"{x:.0f}" if abs(x) >= 10.0 else f"{x:.2g}"


def notes_of(records: Sequence[RunRecord]) -> list[str]:
    """Notes of all drives; a shared note appears once, with the number of drives."""
    drives: dict[str, list[str]] = {}
    for r in records:
        for text in r.notes:
            drives.setdefault(text, []).append(r.name)
    return [f"{names[0] if len(names) == 1 else f'{len(names)} drives'}: {text}" for text, names in drives.items()]


def seconds_text(x: float) -> str:
    """A latency: `0.12`; `never` where more episodes are missed than the quantile allows."""
    if math.isnan(x):
        return "-"
    return "never" if math.isinf(x) else f"{x:.2f}"


def headline(evaluation: Evaluation) -> str:
    """The verdict in one sentence: the best joint detector, else the best of all."""
    scores = score.score_all(evaluation.records)
    ran = {n: s for n, s in scores.items() if s.runs}
    joint = [ran[n] for n in JOINT if n in ran]
    if not ran:
        return "No detector could run."
    best = max(joint or list(ran.values()), key=_merit)
    return f"{upper_first(title_of(best.detector))} {_did(best)}."


def verdicts(records: Sequence[RunRecord]) -> list[str]:
    """A sentence for each joint detector: its result against the targets."""
    scores = score.score_all(records)
    return [f"{title_of(n)} {_did(scores[n])}; {_against(scores[n])}." for n in JOINT if n in scores and scores[n].runs]


def _against(s: score.Score) -> str:
    """A result against the targets."""
    lacks = [
        f"{effect} {percent(r.share)}, target {percent(score.TARGETS[effect])}"
        for effect, r in (("full", s.full), ("partial", s.partial))
        if r.episodes and r.share < score.TARGETS[effect]
    ]
    target, alarms = score.TARGETS["per_hour"], s.false_alarms
    if alarms.seconds > 0.0 and alarms.per_hour > target:
        lacks.append(f"{alarms.per_hour:.3g} false alarms per hour, target {target:g}")
    if lacks:
        return f"targets missed: {', '.join(lacks)}"
    if alarms.seconds > 0.0 and alarms.per_hour_ci95[1] > target:
        return (
            "targets met, but so few hours only show that false alarms are below "
            f"{short(alarms.per_hour_ci95[1])} per hour ({3.7 / target:.0f} h without one would show {target:g})"
        )
    return "all targets are met"


def _did(s: score.Score) -> str:
    parts = [
        f"found {recall_text(r)} of {effect} aquaplaning within {LIMITS_S[effect]:g} s{_already_on(r)}"
        for effect, r in (("full", s.full), ("partial", s.partial))
        if r.episodes
    ]
    hours = s.false_alarms.seconds / score.HOUR_S
    parts.append(f"raised {s.false_alarms.count} false alarms in {hours:.3g} h outside water")
    return ", ".join(parts)


def _already_on(r: score.Recall) -> str:
    """` (3 already on before)`: what was on for something else does not show that a detector knows this effect."""
    return f" ({'all' if r.before == r.found else r.before} already on before)" if r.before else ""


def _merit(s: score.Score) -> tuple[int, float, float]:
    """Rank by targets met, then recall, then few false alarms."""
    shares = {effect: r.share for effect, r in (("full", s.full), ("partial", s.partial)) if r.episodes}
    met = sum(share >= score.TARGETS[effect] for effect, share in shares.items())
    met += s.false_alarms.per_hour <= score.TARGETS["per_hour"]
    return met, (sum(shares.values()) / len(shares) if shares else 0.0), -s.false_alarms.count


def coverage_sentences(records: Sequence[RunRecord]) -> list[str]:
    """Number of situations in which each detector meets the targets (C78)."""
    return [
        f"{title_of(c.detector)}: finds {percent(score.TARGETS['partial'])} of partial aquaplaning in {c.found} of "
        f"{c.of_aquaplaning} situations, quiet in {c.quiet} of {c.of_dry}"
        for c in score.coverage(score.situation_scores(records)).values()
        if c.of_aquaplaning or c.of_dry
    ]


def better_sentences(records: Sequence[RunRecord]) -> list[str]:
    """Cases in which a rival is better than the thesis' method, or a sentence that there is no such case."""
    if not any(score.is_rival(n) for r in records for n in r.detectors):
        return []
    found = score.better_rivals(records)
    if not found:
        return ["No rival is better than the thesis' methods on the same drives."]
    groups: dict[tuple[str, str, str], list[score.Better]] = {}
    for b in found:
        groups.setdefault((b.rival, b.against, b.situation), []).append(b)
    return [_better(key, some) for key, some in groups.items()]


def _better(key: tuple[str, str, str], some: Sequence[score.Better]) -> str:
    rival, against, situation = key
    where = f" in {situation}" if situation else " over all drives"
    things = []
    for b in some:
        value = short if b.measure == "false alarms" else percent
        sure = "" if b.is_sure else " (within chance)"
        things.append(f"{value(b.rival_value)} against {value(b.own_value)} {_MEASURES[b.measure]}{sure}")
    price = ", but worse in another measure" if some[0].at_a_price else ""
    verb = "is better" if any(b.is_sure for b in some) else "came out better, but within chance,"
    return f"{title_of(rival)} {verb} than {title_of(against)}{where}: {'; '.join(things)}{price}."


def tuning_sentences(tuning: Tuning, before: Mapping[str, score.Score], after: Mapping[str, score.Score]) -> list[str]:
    """Drives used for tuning, and the result of each proposal on drives not used for tuning."""
    lines = [
        f"thresholds proposed on {len(tuning.tuned_on)} drives, reported on {len(tuning.reported_on)} others"
        f"{f', {len(tuning.unused)} unused' if tuning.unused else ''}: {tuning.rule}"
    ]
    for name, choice in tuning.choices.items():
        p, told = choice.point, ""
        if name in before and name in after:
            old, new = before[name], after[name]
            told = (
                f"; on the others partial {recall_text(old.partial)} -> {recall_text(new.partial)}, false alarms "
                f"{old.false_alarms.count} -> {new.false_alarms.count}"
            )
        lines.append(
            f"{title_of(name)}: {p.threshold:.4g} ({p.factor:.2g} times), {choice.reason} "
            f"({p.false_alarms.count} in {p.false_alarms.seconds / score.HOUR_S:.3g} h){told}"
        )
    return lines
