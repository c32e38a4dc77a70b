"""Joint detectors: their rules on drawn drives, coarse velocities, joint against single ones, and the sum by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.core.intervals import wilson
from aqualog.core.notation import WHEELS
from aqualog.core.records import Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect import ewvar, joint_cusum
from aqualog.detect.braking import BrakeWatch
from aqualog.detect.joint_cusum import JointCusumParams
from aqualog.detect.minor_spin_down import MinorParams
from aqualog.detect.slip_slope.watch import TAU_VARIANCE, VARIANCE_MAX, Memory
from aqualog.detect.stream import detect_drive
from aqualog.evaluate.drives import Drive, labels_in
from aqualog.evaluate.judge import judge as judge_drive
from aqualog.evaluate.labels import CONTACT_FULL
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.score import Coverage, coverage, situation_scores
from aqualog.evaluate.score import Score as DetectorScore
from aqualog.evaluate.score import score as score_of
from aqualog.evaluate.sweep import JOINT
from aqualog.model.drawing import SCORING_POOL, Pool
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS, draw
from aqualog.physics.contact import friction_ratio, slip_stiffness_ratio
from aqualog.thesis.claims import Check, Checks, judge, limit
from aqualog.thesis.evidence import drives as evidence
from aqualog.thesis.evidence.drives import NUISANCE, WATER, Score, Taken, detected, drives, score, starts, variants
from aqualog.thesis.evidence.seeds import PASS_SEEDS, Maker, Plan, estimate, ratio_of_counts, share, spread_over

__all__ = ["CHECKS"]

COUNTED = {f"criterion {k}": f"criterion_{k}" for k in (1, 2, 3)}  # as they count: the gate is open
SPEEDY = (*COUNTED, *JOINT)
SINGLE = ("spin_down", "minor_spin_down", "spin_up", "resistance", "slip_slope_drop", "tie_rod")
LATE_S = 0.2
HALF = 0.5  # of the partial aquaplaning, which a detector finds that is worth a comparison of its false alarms
RECALL = limit("recall", "C70.drives")  # by which a recall may change
MORE_ALARMS = limit("more_alarms", "C70.drives")  # false alarms on top, over all drives
OF_KIND = 20  # drives of each kind for C70
WET_DRIVES, DRY_DRIVES = 10, 5  # of each situation for C78

Change = Callable[[pl.DataFrame, Vehicle], pl.DataFrame]


def _scaled(factor: float) -> Change:
    return lambda frame, _: frame.with_columns(pl.col("v_x") * factor)


def _late(frame: pl.DataFrame, _: Vehicle) -> pl.DataFrame:
    """The whole signal 0.2 s late; at the start it is what it was first."""
    rows = round(LATE_S / (frame["t"][1] - frame["t"][0]))
    return frame.with_columns(pl.col("v_x").shift(rows).fill_null(strategy="backward"))


def _mean_of_wheels(frame: pl.DataFrame, vehicle: Vehicle) -> pl.DataFrame:
    speeds = [pl.col(f"omega_{w}") * vehicle.r_e(w) for w in WHEELS]
    return frame.with_columns(pl.mean_horizontal(speeds).alias("v_x"))


VARIANTS: Mapping[str, Change] = {
    "as measured": _scaled(1.0),
    "2 % too fast": _scaled(1.02),
    "2 % too slow": _scaled(0.98),
    "0.2 s late": _late,
    "none (estimated from wheels and accelerometer)": lambda frame, _: frame.drop("v_x"),
    "mean of the four wheels": _mean_of_wheels,
}
AS_MEASURED = "as measured"
MEASURED = ("2 % too fast", "2 % too slow", "0.2 s late")  # coarse, but a measurement


Counts = NDArray[np.int64]
"""Found and all episodes of full, then of partial aquaplaning; false alarms. (5,)"""


def is_like(row: Counts, base: Counts) -> bool:
    """Whether recalls are at most 0.1 below others, and false alarms at most two more."""
    recall, before = (x[[0, 2]] / np.maximum(x[[1, 3]], 1) for x in (row, base))
    return bool(np.all(before - recall <= RECALL) and row[4] - base[4] <= MORE_ALARMS)


Item = tuple[str, int, Pool]  # situation, seed, what it is drawn from


def _drive(item: Item) -> Drive:
    name, seed, pool = item
    drawn = draw(name, seed, pool)
    signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
    labels = labels_in(signals)
    assert labels is not None  # a simulation holds its truth
    return Drive(f"{name} {seed}", signals, drawn.believed, labels, {"manoeuvre": name, "kind": drawn.kind})


def drawn_items(count: int, first_seed: int, pool: Pool) -> list[Item]:
    """As many drives of both kinds, taking turns through the situations, a seed for each."""
    found: list[Item] = []
    for kind in ("aquaplaning", "nuisance"):
        names = [n for n, s in SITUATIONS.items() if s.kind == kind]
        found += [(names[i % len(names)], first_seed + i, pool) for i in range(count)]
    return found


def with_velocity(d: Taken, change: Change) -> Taken:
    """The same drive with another velocity signal."""
    return replace(d, signals=replace(d.signals, frame=change(d.signals.frame, d.vehicle)))


Rows = Mapping[tuple[str, str], Counts]
"""Of each detector and velocity."""


def variants_of(item: Item) -> Rows:
    """A drive with each velocity, judged."""
    name, seed, pool = item
    drawn = draw(name, seed, pool)
    d = evidence.made(name, seed, drawn.scenario, drawn.believed, drawn.model)
    rows = {}
    for variant, change in VARIANTS.items():
        bits = evidence.bits_of(with_velocity(d, change))
        for detector in SPEEDY:
            on = bits[COUNTED[detector]] & bits["gate"] if detector in COUNTED else bits[detector]
            a, b = (score([(d, on)], [(d, on)], effect) for effect in ("full", "partial"))
            rows[detector, variant] = np.array([a.found, a.episodes, b.found, b.episodes, a.false])
    return rows


def rows_of(records: Sequence[Rows]) -> Rows:
    """All drives together."""
    return {key: np.sum([r[key] for r in records], axis=0) for key in records[0]}


def _likeness(rows: Rows) -> dict[tuple[str, str], bool]:
    return {key: is_like(row, rows[key[0], AS_MEASURED]) for key, row in rows.items()}


def c70(plan: Plan, pool: Pool = SCORING_POOL, count: int = OF_KIND) -> Check:
    """Criteria 1 to 3, as joint detector 1 counts them, and both joint detectors with coarse velocities."""
    records = spread_over(variants_of, drawn_items(count, plan.seeds[0], pool), plan, "drives")
    rows = rows_of(records)
    like = _likeness(rows)
    of_detector = [all(like[d, v] for v in VARIANTS) for d in SPEEDY]
    part = all(like[d, v] for d in SPEEDY for v in MEASURED) or sum(of_detector) >= len(SPEEDY) - 1
    other = [f"{d} with {v}: {_told(rows[d, v])}" for (d, v), same in like.items() if not same]
    base = "; ".join(f"{d} {_told(rows[d, AS_MEASURED])}" for d in SPEEDY)
    share, ci = estimate(
        lambda r: float(np.mean(list(_likeness(rows_of([records[i] for i in r])).values()))), len(records)
    )
    outcome = (
        f"{sum(like.values())} of {len(like)} combinations alike over {count} drives with aquaplaning and {count} "
        f"others. As measured: {base}. Not alike: {'; '.join(other) or 'none'}"
    )
    whole, fields = all(like.values()), {"pool": pool.name}
    return judge("C70.drives", outcome, whole=whole, part=part, value=share, ci95=ci, fields=fields)


def _told(row: Counts) -> str:
    return "full {} of {}, partial {} of {}, false alarms {}".format(*row)


def _judged(item: Item) -> RunRecord:
    return judge_drive(_drive(item))


def c78(plan: Plan, pool: Pool = SCORING_POOL, wet: int = WET_DRIVES, dry: int = DRY_DRIVES) -> Checks:
    """Each joint detector against every single one over all situations."""
    items = [
        (name, s, pool) for name, x in SITUATIONS.items() for s in plan.first(wet if x.kind == "aquaplaning" else dry)
    ]
    records = spread_over(_judged, items, plan, "drives")
    return compared(records, pool.name)


def compared(records: Sequence[RunRecord], pool: str) -> Checks:
    """Judge C78 from drives of situations (their `manoeuvre`) drawn from a pool."""
    covered = coverage(situation_scores(records))
    scores = {d: score_of(records, d) for d in (*SINGLE, *JOINT)}
    return tuple(_joint_check(d, covered, scores, len(records), pool) for d in JOINT)


def _joint_check(
    name: str, covered: Mapping[str, Coverage], scores: Mapping[str, DetectorScore], n: int, pool: str
) -> Check:
    own, singles = scores[name], {d: scores[d] for d in SINGLE if scores[d].runs}

    def total(d: str) -> int:
        return covered[d].found + covered[d].quiet

    more = all(total(name) > total(d) for d in singles)
    keen = all(own.partial.share >= s.partial.share for s in singles.values())
    # a detector without any detection is quiet as well
    calm = all(
        own.false_alarms.count <= s.false_alarms.count for s in singles.values() if s.partial.share >= HALF
    )  # fmt: skip
    text = "; ".join(f"{d} {_scored(covered[d], s)}" for d, s in {name: own, **singles}.items())
    lacks = [w for ok, w in ((more, "situations"), (keen, "recall"), (calm, "false alarms")) if not ok]
    outcome = f"{n} drives in {len(SITUATIONS)} situations. {text}"
    fields = {"name": name.replace("_", " "), "pool": pool, "lacks": ", ".join(lacks)}
    found, whole, part = own.partial, more and keen and calm, more and (keen or calm)
    return judge("C78.drives", outcome, whole=whole, part=part, value=found.share, ci95=found.ci95, fields=fields)


def _scored(c: Coverage, s: DetectorScore) -> str:
    low, high = s.partial.ci95
    a, b = s.false_alarms.per_hour_ci95
    return (
        f"found in {c.found} of {c.of_aquaplaning} situations, quiet in {c.quiet} of {c.of_dry}, partial "
        f"{s.partial.found} of {s.partial.episodes} ({low:.2f} to {high:.2f}), full {s.full.found} of "
        f"{s.full.episodes}, false alarms {s.false_alarms.count} ({a:.1f} to {b:.1f} per h)"
    )


def _track(detector: str, wheel: str | None, statistic: float) -> Track:
    return Track(detector, wheel, None, "-", np.array([statistic]), 1.0, np.zeros(1, dtype=np.bool_))


def _sum(plan: Plan) -> Check:
    """C71: the sum of 2.11 by hand."""
    rng = np.random.default_rng(plan.seeds[0])
    p = JointCusumParams(with_slope=False)
    worst, n, least = 0.0, 2000, math.inf
    for _ in range(n):
        up, down = rng.uniform(0.0, 4.0, 2), rng.uniform(0.0, 4.0, 4)
        rr, variance = rng.uniform(0.0, 1.0), rng.uniform(-3.0, 9.0, 2)
        tracks = [
            *(_track("spin_up", w, x) for w, x in zip(("rl", "rr"), up, strict=True)),
            *(_track("spin_down", w, x) for w, x in zip(WHEELS, down, strict=True)),
            _track("resistance", None, rr),
            *(_track("minor_spin_down", w, x) for w, x in zip(("fl", "fr"), variance, strict=True)),
        ]
        everywhere = np.ones(1, dtype=np.bool_)
        terms = joint_cusum.terms(p, [(t, everywhere) for t in tracks], np.zeros(1), 1)
        ours = math.fsum(float(x[0]) for x in terms.values())
        printed = (min(max(variance), p.var_high) - p.var_low) / (p.var_high - p.var_low)
        least = min(least, printed)
        of_spins = min(max(up) / p.g_up, 1.0) + min(max(down) / p.g_down, 1.0)
        by_hand = of_spins + min(rr / p.g_resistance, 1.0) + max(printed, 0.0)
        worst = max(worst, abs(ours - by_hand))
    exact = worst < 1e-12
    outcome = f"{worst:.1e} over {n} random states; the printed variance term would fall to {least:.2f} in them"
    return judge("C71.theory", outcome, part=exact, value=worst)


_PER_WATER, _PER_OTHER, _PER_BRAKED = 6, 3, 12  # seeds of each situation
_BRAKED = ("abs_dry", "abs_damp", "abs_snow", "hard_braking")
_DIP = -0.015  # [-] slip of a minor spin-down


def _score(
    plan: Plan, variant: str, effect: str, others: Sequence[str] = NUISANCE, each: int = _PER_OTHER
) -> Score:  # fmt: skip
    """A variant on all drives on water and on so many of each of the others."""
    water = [(d, variants(d.name, d.seed)[variant]) for d in drives(WATER, plan, _PER_WATER)]
    other = [(d, variants(d.name, d.seed)[variant]) for d in drives(others, plan, each)]
    return score(water, other, effect)


def _gate(plan: Plan) -> Check:
    """C64: joint detector 1 with the gate of the resistance and without it."""
    gated, ungated = (_score(plan, v, "full") for v in ("joint_criteria", "ungated"))
    partial = [_score(plan, v, "partial") for v in ("joint_criteria", "ungated")]
    # that the gate is necessary: no warning begins while it is shut, and none without another criterion
    breaches = 0
    for d in (*drives(WATER, plan, _PER_WATER), *drives(NUISANCE, plan, _PER_OTHER)):
        v = variants(d.name, d.seed)
        met = np.any([v[f"criterion_{k}"] for k in (1, 2, 3, 4)], axis=0)
        begins = v["joint_criteria"] & ~np.concatenate([[False], v["joint_criteria"][:-1]])
        breaches += int(np.count_nonzero(begins & ~(v["gate"] & met)))
    kept = gated.recall >= ungated.recall - 0.05
    fewer = gated.false <= 0.5 * ungated.false and ungated.false > 0
    whole = kept and fewer and breaches == 0
    outcome = (
        f"full aquaplaning with the gate {gated.in_words()}; without {ungated.in_words()}; partial "
        f"{partial[0].found} and {partial[1].found} of {partial[1].episodes}; breaches of the rule: {breaches}"
    )
    ci95 = ratio_of_counts(gated.false, ungated.false)
    part = gated.false < ungated.false and breaches == 0
    return judge("C64.drives", outcome, whole=whole, part=part, value=gated.false / max(ungated.false, 1), ci95=ci95)


def _spin_down(plan: Plan) -> Check:
    """C65: spin-downs under a braking force, counted and not."""
    full = {v: _score(plan, v, "full", _BRAKED, _PER_BRAKED) for v in ("criterion_1", "spin_down")}
    with_, without = full["criterion_1"], full["spin_down"]
    kept = with_.recall >= without.recall - 0.05
    whole = kept and without.false > 0 and with_.false <= 0.1 * without.false
    outcome = f"criterion 1: {with_.in_words()}; under braking forces too: {without.in_words()}"
    ci95 = ratio_of_counts(with_.false, without.false)
    part = kept and with_.false <= 0.5 * without.false
    return judge("C65.drives", outcome, whole=whole, part=part, value=with_.false / max(without.false, 1), ci95=ci95)


def _minor(plan: Plan) -> Check:
    """C66: detections of criterion 2 against its conditions and the true slip."""
    lawful, true = [], []
    for d in _all(plan):
        result = detected(d)
        f = {c: result.features[c].to_numpy() for c in result.features.columns}
        braking = BrakeWatch(d.vehicle, d.signals.dt).push(f, {s: d.signals.array(s) for s in d.signals.symbols})
        p = MinorParams.make(d.signals.dt)
        half, late = round(0.5 / d.signals.dt), round(0.3 / d.signals.dt)
        for track in result.tracks:
            if track.detector != "minor_spin_down" or track.wheel is None:
                continue
            w, other = track.wheel, next(x for x in WHEELS if x[1] == track.wheel[1] and x != track.wheel)
            for k in starts(track.active):
                before = slice(max(k - half, 0), k + 1)
                var, difference = f[f"variance_{w}"][k], f[f"variance_{w}"][k] - f[f"variance_{other}"][k]
                is_slower = float(np.mean(d.truth[f"slip_{w}"][before])) < 0.0
                lawful.append(var > p.var_min and difference > p.delta_min and is_slower and not braking[w][k])
                true.append(float(np.nanmin(d.truth[f"slip_{w}"][before.start : k + late])) < _DIP)
    return _by_rule("C66.drives", "minor spin-down", lawful, true)


def _all(plan: Plan) -> list[Taken]:
    return [*drives(WATER, plan, _PER_WATER), *drives(NUISANCE, plan, _PER_OTHER)]


def _by_rule(key: str, what: str, lawful: Sequence[bool], true: Sequence[bool]) -> Check:
    """Detections that begin as a criterion of the thesis has it, and those that the truth bears out."""
    n, right = len(true), sum(true)
    whole = n > 0 and all(lawful) and right >= limit("many") * n
    outcome = f"{sum(lawful)} of {n} begin with all conditions met; {share(right, n)} with a true {what}"
    part = right >= limit("many") * n > 0
    return judge(key, outcome, whole=whole, part=part, value=right / max(n, 1), ci95=wilson(right, n))


def _full_or_partial(plan: Plan) -> Check:
    """C67: severity of spin-ups against the true contact of the wheel."""
    right: dict[bool, list[bool]] = {True: [], False: []}
    for d in drives(WATER, plan, _PER_WATER):
        for e in detected(d).events:
            if e.detector == "spin_up":
                within = (d.t >= e.start_s) & (d.t <= e.end_s)
                is_full = bool(np.nanmin(d.truth[f"contact_{e.wheel}"][within]) < CONTACT_FULL)
                right[is_full].append((e.severity == "full") == is_full)
    n = {k: len(v) for k, v in right.items()}
    shares = {k: float(np.mean(v)) if v else math.nan for k, v in right.items()}
    balanced = 0.5 * (shares[True] + shares[False]) if all(n.values()) else 0.0
    whole = min(n.values()) >= 5 and balanced >= 0.75
    outcome = (
        f"full called full {share(sum(right[True]), n[True])}, partial called partial "
        f"{share(sum(right[False]), n[False])} of the spin-ups on water"
    )
    return judge("C67.drives", outcome, whole=whole, part=balanced >= 0.6, value=balanced)


def _slope(plan: Plan) -> Checks:
    """C68: half of the slope by the contact patch, and the calm wheel left out."""
    # slope of 2.2 is the square of L: bisect where the integral of the bristles is half of the whole one
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(slip_stiffness_ratio(np.array([middle]))[0]) < 0.5 else (low, middle)
    x, w = np.polynomial.legendre.leggauss(8)
    b = 2.0 * low - 1.0
    node = 0.5 * (b + 1.0) * x + 0.5 * (b - 1.0)
    left = float(np.sum(0.75 * (1.0 - node**2) * w) * 0.5 * (b + 1.0))
    meaning = abs(low - math.sqrt(0.5)) < 1e-9 and abs(left - float(friction_ratio(np.array([low]))[0])) < 1e-9
    outcome = f"contact {low:.6f}, friction {left:.4f} of the dry one"
    return judge("C68.drives_half_of_the_slope", outcome, whole=meaning, value=left), _drops(plan)


def _drops(plan: Plan) -> Check:
    lawful, true = [], []
    for d in drives(WATER, plan, _PER_WATER):
        result = detect_drive(d.signals, d.vehicle, memory=Memory(rule="max"))
        ew = ewvar.from_seconds(TAU_VARIANCE, TAU_VARIANCE, d.signals.dt)
        for track in result.tracks:
            if track.detector != "slip_slope_drop" or track.wheel is None:
                continue
            a = result.features[f"a_w_delta_{track.wheel}"].to_numpy()
            _, variance, _ = ewvar.scan(ew, ewvar.initial_state(), np.ascontiguousarray(a))
            for k in starts(track.active):
                before = slice(max(k - round(2.0 / d.signals.dt), 0), k + 1)
                is_driven = track.wheel in d.vehicle.driven
                lawful.append(is_driven and track.statistic[k] > 0.5 and not variance[k] > VARIANCE_MAX)
                contact = min(float(np.nanmin(d.truth[f"contact_{w}"][before])) for w in d.vehicle.driven)
                true.append(contact < math.sqrt(0.5))
    return _by_rule("C68.drives_rule", "loss of half of the slope", lawful, true)


def _resistance(plan: Plan) -> Check:
    """C69: the resistance as an indicator of a critical water level."""
    bits = {id(d): variants(d.name, d.seed)["criterion_5"] for d in _all(plan)}
    found = score([(d, bits[id(d)]) for d in drives(WATER, plan, _PER_WATER)], [], "partial")
    dry = drives(NUISANCE, plan, _PER_OTHER)
    quiet = sum(not bits[id(d)].any() for d in dry)
    is_found = found.episodes > 10 and found.recall >= 0.5
    outcome = f"{share(found.found, found.episodes)} found within 2 s; {share(quiet, len(dry))} of the others without"
    ci95 = wilson(found.found, found.episodes)
    whole = is_found and quiet >= 0.95 * len(dry)
    return judge("C69.drives", outcome, whole=whole, part=is_found, value=found.recall, ci95=ci95)


CHECKS = (
    Maker(("C71",), _sum),
    Maker(("C70",), c70, PASS_SEEDS, spreads=True),
    Maker(("C78",), c78, PASS_SEEDS, spreads=True),
    Maker(("C64",), _gate, spreads=True),
    Maker(("C65",), _spin_down, spreads=True),
    Maker(("C66",), _minor, spreads=True),
    Maker(("C67",), _full_or_partial, spreads=True),
    Maker(("C68",), _slope, spreads=True),
    Maker(("C69",), _resistance, spreads=True),
)
