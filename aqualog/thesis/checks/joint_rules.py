"""Rules of the joint detectors and of the vehicle file: each checked on drawn drives, with the rule and without it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import BoolArray
from aqualog.evaluate.intervals import wilson
from aqualog.evaluate.match import LIMITS_S, hits
from aqualog.evaluate.truth import CONTACT_FULL, spans_of
from aqualog.physics.contact import friction_ratio, slip_stiffness_ratio
from aqualog.thesis.claims import Check, Checks, judge
from aqualog.thesis.evidence.drives import NUISANCE, WATER, Score, Taken, bits_of, detected, drives, score, variants
from aqualog.thesis.evidence.seeds import Maker, Plan, ratio_of_counts, share

__all__ = ["CHECKS"]

_PER_WATER, _PER_OTHER = 6, 3  # seeds of each situation
_BRAKED = ("abs_dry", "abs_damp", "abs_snow", "hard_braking")
_SHAKEN = ("rough_asphalt", "gravel", "deep_snow", "kerbs_and_holes")
_FIRM = ("rough_asphalt", "kerbs_and_holes")  # they shake, but do not yield: the slope is that of the dry road
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
    return judge(
        "C64.drives",
        outcome,
        whole=whole,
        part=gated.false < ungated.false and breaches == 0,
        value=gated.false / max(ungated.false, 1),
        ci95=ratio_of_counts(gated.false, ungated.false),
    )


def _spin_down(plan: Plan) -> Check:
    """C65: spin-downs under a braking force, counted and not."""
    full = {v: _score(plan, v, "full", _BRAKED) for v in ("criterion_1", "spin_down")}
    with_, without = full["criterion_1"], full["spin_down"]
    kept = with_.recall >= without.recall - 0.05
    whole = kept and without.false > 0 and with_.false <= 0.1 * without.false
    outcome = f"criterion 1: {with_.in_words()}; under braking forces too: {without.in_words()}"
    return judge(
        "C65.drives",
        outcome,
        whole=whole,
        part=kept and with_.false <= 0.5 * without.false,
        value=with_.false / max(without.false, 1),
        ci95=ratio_of_counts(with_.false, without.false),
    )


def _minor(plan: Plan) -> Check:
    """C66: the conditions of criterion 2 left out one by one."""
    cases = {
        "the difference": ("minor_no_difference", _SHAKEN),
        "the sign of the speed": ("minor_no_sign", _SHAKEN),
        "the braking force": ("minor_no_force", _BRAKED),
    }
    factors, words = [], []
    for name, (variant, others) in cases.items():
        base, without = _score(plan, "minor", "partial", others), _score(plan, variant, "partial", others)
        factors.append(without.false / max(base.false, 1))
        words.append(
            f"{name} {base.false} to {without.false} (found {base.found} and {without.found} of {base.episodes})"
        )
    together = _score(plan, "minor_no_difference_no_sign", "partial", _SHAKEN).false
    whole = min(factors) >= 2.0
    outcome = f"false alarms with all conditions and without {'; '.join(words)}; without difference and sign {together}"
    return judge("C66.drives", outcome, whole=whole, part=sum(x >= 2.0 for x in factors) >= 2, value=min(factors))


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
    calm, uncalm = (_score(plan, v, "partial", _FIRM) for v in ("slope", "slope_uncalm"))
    fewer = calm.false <= 0.5 * uncalm.false and uncalm.false > 0
    return (
        judge(
            "C68.drives_half_of_the_slope",
            f"contact {low:.6f}, friction {left:.4f} of the dry one",
            whole=meaning,
            value=left,
        ),
        judge(
            "C68.drives_calm_wheel",
            f"calm wheels only: {calm.in_words()}; any: {uncalm.in_words()}",
            whole=fewer,
            part=calm.false < uncalm.false,
            value=calm.false / max(uncalm.false, 1),
            ci95=ratio_of_counts(calm.false, uncalm.false),
            reason=""
            if fewer
            else "The estimator's own gates leave out the wheels that shake: on these roads no false drop is reported, "
            "with the condition or without it."
            if calm.false == uncalm.false == 0
            else "The condition interrupts a report, which then begins again.",
        ),
    )


def _resistance(plan: Plan) -> Check:
    """C69: contribution of the resistance to criteria 1 to 4."""
    found = added = episodes = 0
    for d in drives(WATER, plan, _PER_WATER):
        v = variants(d.name, d.seed)
        water = d.labels.water_widened
        spans = d.labels.of("partial")
        met = np.any([v[f"criterion_{k}"] for k in (1, 2, 3, 4)], axis=0) & v["gate"]
        own, others = (
            hits(spans, spans_of(d.t, bits), limit=LIMITS_S["partial"], water=water) for bits in (v["resistance"], met)
        )
        episodes += len(spans)
        found += sum(h.found for h in own)
        added += sum(a.found and not b.found for a, b in zip(own, others, strict=True))
    whole = episodes > 10 and found >= 0.5 * episodes and added > 0
    outcome = f"{share(found, episodes)} found within 2 s, {added} of them by none of the others in that time"
    return judge(
        "C69.drives",
        outcome,
        whole=whole,
        part=found >= 0.5 * episodes > 0,
        value=found / max(episodes, 1),
        ci95=wilson(found, episodes),
    )


_OTHER = {"rwd": ("fwd", 0.0), "fwd": ("rwd", 1.0), "awd": ("rwd", 1.0)}


def _found(d: Taken, bits: BoolArray) -> tuple[int, int]:
    """Episodes of partial aquaplaning found in time, and all."""
    spans = d.labels.of("partial")
    found = hits(spans, spans_of(d.t, bits), limit=LIMITS_S["partial"], water=d.labels.water_widened)
    return sum(h.found for h in found), len(spans)


def _drivetrains(plan: Plan) -> Check:
    """C6: every drivetrain works, with a vehicle file that states it."""
    by_drivetrain: dict[str, list[Taken]] = {"rwd": [], "fwd": [], "awd": []}
    for d in drives(WATER, plan, _PER_WATER):
        by_drivetrain[d.vehicle.drivetrain].append(d)
    full = {
        k: score([(d, variants(d.name, d.seed)["joint_criteria"]) for d in ds], []) for k, ds in by_drivetrain.items()
    }
    right = wrong = episodes = 0
    for kind in ("rwd", "fwd"):
        drivetrain, split = _OTHER[kind]
        for d in by_drivetrain[kind][:12]:
            k, n = _found(d, variants(d.name, d.seed)["minor"])
            car = replace(d.vehicle, drivetrain=drivetrain, torque_split_rear=split)  # type: ignore[arg-type]
            mistaken, _ = _found(d, bits_of(replace(d, vehicle=car))["minor"])
            right, wrong, episodes = right + k, wrong + mistaken, episodes + n
    served = all(s.recall >= 0.8 and s.episodes >= 3 for s in full.values())
    matters = right > 0 and wrong <= 0.5 * right
    outcome = (
        "; ".join(f"{k} {share(s.found, s.episodes)}" for k, s in full.items())
        + f"; minor spin-downs find {right} of {episodes} partial episodes with the right and {wrong} with the "
        "wrong axle"
    )
    return judge(
        "C6.drives", outcome, whole=served and matters, part=served, value=min(s.recall for s in full.values())
    )


CHECKS = (
    Maker(("C64",), _gate, spreads=True),
    Maker(("C65",), _spin_down, spreads=True),
    Maker(("C66",), _minor, spreads=True),
    Maker(("C67",), _full_or_partial, spreads=True),
    Maker(("C68",), _slope, spreads=True),
    Maker(("C69",), _resistance, spreads=True),
    Maker(("C6",), _drivetrains, spreads=True),
)
