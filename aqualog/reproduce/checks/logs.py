"""Information that a log needs besides its signals: the drivetrain, checked with a wrong one."""

from __future__ import annotations

from dataclasses import replace

from aqualog.core.records import BoolArray
from aqualog.evaluate.match import LIMITS_S, hits
from aqualog.evaluate.truth import spans_of
from aqualog.reproduce.ablations import bits_of, variants
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.drawn import WATER, Taken, drives, score
from aqualog.reproduce.statistics import share
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(11000, 11200)
_OTHER = {"rwd": ("fwd", 0.0), "fwd": ("rwd", 1.0), "awd": ("rwd", 1.0)}
_PER_WATER = 6  # seeds of each situation


def _found(d: Taken, bits: BoolArray) -> tuple[int, int]:
    """Episodes of partial aquaplaning found in time, and all."""
    spans = d.labels.of("partial")
    found = hits(spans, spans_of(d.t, bits), limit=LIMITS_S["partial"], water=d.labels.water_widened)
    return sum(h.found for h in found), len(spans)


def _drivetrains(plan: Plan) -> Checks:
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
    return (
        Check(
            "C6",
            "joint detector 1 finds at least 80 % of full aquaplaning with each drivetrain; a file with the wrong "
            "driven axle at least halves what the minor spin-downs find; in part: the former",
            "; ".join(f"{k} {share(s.found, s.episodes)}" for k, s in full.items())
            + f"; minor spin-downs find {right} of {episodes} partial episodes with the right and {wrong} with the "
            "wrong axle",
            judged(whole=served and matters, part=served),
            value=min(s.recall for s in full.values()),
            reason=""
            if served and matters
            else "With the wrong axle the driven wheels are watched, and on water they dip "
            "too; a part of the episodes is lost, but not half.",
            source="drawn situations; tyres, pressures and depths of a campaign are its columns",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = ((("C6",), _drivetrains),)
