"""Rules of the joint detectors and of the vehicle file: each checked on drawn drives, with the rule and without it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.core.intervals import wilson
from aqualog.core.notation import WHEELS
from aqualog.detect import ewvar
from aqualog.detect.braking import BrakeWatch
from aqualog.detect.minor_spin_down import MinorParams
from aqualog.detect.slip_slope.watch import TAU_VARIANCE, VARIANCE_MAX, Memory
from aqualog.detect.stream import detect_drive
from aqualog.evaluate.labels import CONTACT_FULL
from aqualog.physics.contact import friction_ratio, slip_stiffness_ratio
from aqualog.thesis.claims import Check, Checks, judge, limit
from aqualog.thesis.evidence.drives import NUISANCE, WATER, Score, Taken, detected, drives, score, starts, variants
from aqualog.thesis.evidence.seeds import Maker, Plan, ratio_of_counts, share

__all__ = ["CHECKS"]

_PER_WATER, _PER_OTHER = 6, 3  # seeds of each situation
_BRAKED = ("abs_dry", "abs_damp", "abs_snow", "hard_braking")
_DIP = -0.015  # [-] slip of a minor spin-down
_SEE = "See the numbers."


def _score(plan: Plan, variant: str, effect: str, others: Sequence[str] = NUISANCE) -> Score:
    """A variant on all drives on water and on those that others name."""
    water = [(d, variants(d.name, d.seed)[variant]) for d in drives(WATER, plan, _PER_WATER)]
    other = [(d, variants(d.name, d.seed)[variant]) for d in drives(others, plan, _PER_OTHER)]
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
    full = {v: _score(plan, v, "full", _BRAKED) for v in ("criterion_1", "spin_down")}
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
                dv = float(np.mean((f[f"v_w_delta_{w}"] - f["v_w_delta_common"])[before]))
                lawful.append(var > p.var_min and difference > p.delta_min and dv < 0.0 and not braking[w][k])
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
    return (
        judge(
            "C68.drives_half_of_the_slope",
            f"contact {low:.6f}, friction {left:.4f} of the dry one",
            whole=meaning,
            value=left,
        ),
        _drops(plan),
    )


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
    Maker(("C64",), _gate, spreads=True),
    Maker(("C65",), _spin_down, spreads=True),
    Maker(("C66",), _minor, spreads=True),
    Maker(("C67",), _full_or_partial, spreads=True),
    Maker(("C68",), _slope, spreads=True),
    Maker(("C69",), _resistance, spreads=True),
)
