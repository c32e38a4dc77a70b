"""Slip slope as a sign of water: its reference, and other causes of a drop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from aqualog.core.intervals import wilson
from aqualog.core.records import DriveResult
from aqualog.core.vehicle import KEYS
from aqualog.detect.slip_slope.history import History, Rule, remembered
from aqualog.detect.slip_slope.watch import Memory
from aqualog.detect.stream import detect_drive
from aqualog.model.drawing import SCORING_POOL
from aqualog.model.effects import EFFECTS
from aqualog.model.scenario import SURFACES, Lane, Scenario
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES
from aqualog.thesis.claims import NEEDS_DATA, Check, Checks, judge
from aqualog.thesis.evidence.drives import drives, made, variants
from aqualog.thesis.evidence.passes import HIGH, LOW, Pass, figures_of
from aqualog.thesis.evidence.seeds import Maker, Plan, bootstrap, share

__all__ = ["CHECKS"]

_CAR = replace(SCORING_POOL.vehicles[0], given=frozenset({"name", *KEYS}))
_GAINS = (0.45, 1.8)  # slope of the tyres on the car over that in the vehicle file: soft winter tyres, stiff worn ones
_DRY_S, _WET_S, _ENTRY = 45.0, 40.0, 25.0  # [s]


def _drive(
    gain: float, seed: int, memory: Memory | None, *, snow: bool = False, seconds: float = _WET_S
) -> DriveResult:
    rng = np.random.default_rng([seed, 56])
    speed = tuple((float(t), float(rng.uniform(70.0, 105.0)) / 3.6) for t in np.arange(0.0, seconds + 8.0, 8.0))
    lanes = (Lane(_ENTRY, seconds, surface=SURFACES["snow"]),) if snow else ()
    scenario = Scenario(
        _CAR, TYRES["worn_summer"], TYRES["worn_summer"], duration_s=seconds, seed=seed, speed=speed, lanes=lanes
    )
    model = Model((Term(EFFECTS["slip_stiffness"], {"gain": gain}, None),))
    d = made("reference", seed, scenario, _CAR, model)
    return detect_drive(d.signals, d.vehicle, memory=memory)


def _drops(result: DriveResult, after: float = 0.0) -> bool:
    return any(e.detector == "slip_slope_drop" and e.start_s >= after for e in result.events)


def _history(plan: Plan) -> Check:
    """C56: reference from the vehicle file against the largest slope of the configuration's history."""
    false: dict[str, int] = {"file": 0, "max": 0, "robust": 0}
    missed = dict(false)
    n = 0
    for gain in _GAINS:
        for seed in plan.first(4):
            n += 1
            dry = _drive(gain, seed, None, seconds=_DRY_S)
            rules: tuple[Rule, ...] = ("max", "robust")
            # the file's own slope is removed, so that the first drive alone determines the slope of these tyres
            learnt = _learn(gain, seed)
            memories: dict[str, Memory | None] = {"file": None, **{r: Memory(learnt, rule=r) for r in rules}}
            false["file"] += int(_drops(dry))
            for name, memory in memories.items():
                if name != "file":
                    false[name] += int(_drops(_drive(gain, seed + 1, memory, seconds=_DRY_S)))
                missed[name] += int(not _drops(_drive(gain, seed + 2, memory, snow=True), _ENTRY))
    wrong = {k: false[k] + missed[k] for k in false}
    whole = wrong["max"] <= 0.1 * 2 * n and wrong["file"] >= 3 * max(wrong["max"], 1)
    outcome = (
        f"false drops on dry road {false['file']} (file), {false['max']} (largest of the history), "
        f"{false['robust']} (upper quartile of its means, the default) of {n} drives; snow missed "
        f"{missed['file']}, {missed['max']}, {missed['robust']} of {n}"
    )
    ci95 = wilson(wrong["max"], 2 * n)
    part = wrong["max"] < wrong["file"]
    return judge("C56.drives", outcome, whole=whole, part=part, value=wrong["max"] / (2 * n), ci95=ci95)


def _learn(gain: float, seed: int) -> History:
    car = replace(_CAR, given=_CAR.given - {"tyre.slip_slope_f", "tyre.slip_slope_r"})
    rng = np.random.default_rng([seed, 57])
    speed = tuple((float(t), float(rng.uniform(70.0, 105.0)) / 3.6) for t in np.arange(0.0, _DRY_S + 8.0, 8.0))
    scenario = Scenario(
        car, TYRES["worn_summer"], TYRES["worn_summer"], duration_s=_DRY_S, seed=seed + 500, speed=speed
    )
    d = made("history", seed, scenario, car, Model((Term(EFFECTS["slip_stiffness"], {"gain": gain}, None),)))
    return remembered(History(), _CAR.name, detect_drive(d.signals, d.vehicle).slopes)


_YIELDING = ("snow_entry", "snow", "deep_snow", "gravel")


def _not_unique(plan: Plan) -> Check:
    """C57: roads that yield lower the slope; results of the drop alone and of the joint detector."""
    rows = {}
    for name in _YIELDING:
        found = [variants(d.name, d.seed) for d in drives((name,), plan, 6 if name == "snow_entry" else 3)]
        rows[name] = (len(found), *(sum(bool(v[k].any()) for v in found) for k in ("slope", "joint_criteria")))
    n, drops, joint = (sum(r[i] for r in rows.values()) for i in range(3))
    whole = drops >= 0.5 * n and joint <= 0.05 * n
    outcome = (
        f"drop alone {share(drops, n)}, joint detector 1 {share(joint, n)} of the drives ("
        + ", ".join(f"{k.replace('_', ' ')} {r[1]} and {r[2]} of {r[0]}" for k, r in rows.items())
        + ")"
    )
    part = joint <= 0.2 * drops and drops > 0
    return judge("C57.drives", outcome, whole=whole, part=part, value=drops / n, ci95=wilson(drops, n))


def _unchanged(plan: Plan) -> Checks:
    """C58: a damp road and dry ice must not be reported; that their slope is that of dry road is put in, not found."""
    rows = {}
    for name in ("damp", "ice"):
        found = [variants(d.name, d.seed) for d in drives((name,), plan, 8)]
        rows[name] = (*(sum(bool(v[k].any()) for v in found) for k in ("slope", "joint_criteria")), len(found))
    false = sum(r[0] for r in rows.values())
    joint = sum(r[1] for r in rows.values())
    n = sum(r[2] for r in rows.values())
    whole = false <= 0.05 * n and joint == 0
    return (
        judge(
            "C58.drives_detection",
            f"drop reported in {share(false, n)} of the drives (damp {rows['damp'][0]} of {rows['damp'][2]}, dry ice "
            f"{rows['ice'][0]} of {rows['ice'][2]}), joint warning in {joint}",
            whole=whole,
            part=joint == 0,
            value=false / n,
            ci95=wilson(false, n),
        ),
        judge(
            "C58.drives_road",
            "the simulator's damp road and dry ice have the slope of the dry one by assumption",
            verdict=NEEDS_DATA,
        ),
    )


def _pressure_and_tread(plan: Plan) -> Check:
    """C118: share of the slope that is lost between 70 and 102 km/h."""
    seeds = plan.first(8)

    def lost(p: Pass, fast: float) -> list[float]:
        out = []
        for seed in seeds:
            slow_, fast_ = (figures_of(replace(p, kmh=v), seed).slope_rr for v in (70.0, fast))
            if math.isfinite(slow_) and math.isfinite(fast_):
                out.append(1.0 - fast_ / slow_)
        return out

    base = Pass(70.0, wiggles=True)
    low, high = lost(base, 102.0), lost(replace(base, p=HIGH), 102.0)
    winter = lost(replace(base, tyre="new_winter", p=LOW), 110.0)
    ratio = float(np.mean(high) / np.mean(low))
    less, none = ratio < 0.7, abs(float(np.mean(winter))) < 0.05
    whole = less and none
    interval = bootstrap(np.array([low, high]).T, lambda x: float(x[:, 1].mean() / x[:, 0].mean()))
    outcome = (
        f"reduction {100 * np.mean(low):.0f} % at low and {100 * np.mean(high):.0f} % at high pressure; new "
        f"winter {100 * np.mean(winter):+.1f} % ({100 * min(winter):+.1f} to {100 * max(winter):+.1f} %, "
        f"{len(winter)} runs)"
    )
    return judge(
        "C118.drives", outcome, whole=whole, part=less or none, value=ratio, ci95=(min(interval), max(interval))
    )


CHECKS = (
    Maker(("C56",), _history, spreads=True),
    Maker(("C57",), _not_unique, spreads=True),
    Maker(("C58",), _unchanged, spreads=True),
    Maker(("C118",), _pressure_and_tread, spreads=True),
)
