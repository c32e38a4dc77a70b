"""Joint detector 2: one sum of the scaled statistics of all effects (thesis 2.11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect import cusum
from aqualog.detect.braking import hold_on
from aqualog.detect.detector import Detector, JointCusumParams, Output, Scene, Setup
from aqualog.detect.events import AFTER
from aqualog.detect.joint_criteria import (
    FULL,
    GATE,
    GATE_AFTER,
    HOLD,
    JOINT_CRITERIA,
    MAY_BE_WATER,
    ROTATES,
    is_alone,
    joint_needs,
    joint_severity,
    without_start,
)
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN
from aqualog.detect.resistance import MEASURE, RESISTANCE
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP
from aqualog.detect.spin import SPIN_DOWN, has_lost_traction, spins_round
from aqualog.detect.spin_up import SPIN_UP

__all__ = ["JOINT_CUSUM", "TERMS", "JointCusumParams", "JointCusumWatch", "terms"]

TERMS = tuple(d.name for d in (SPIN_UP, SPIN_DOWN, RESISTANCE, MINOR_SPIN_DOWN, SLIP_SLOPE_DROP))
LEAST_TERM = 0.1  # [-] a term below that has decided nothing


def terms(
    p: JointCusumParams, tracks: Sequence[tuple[Track, BoolArray]], g_variance: FloatArray, n: int
) -> Mapping[str, FloatArray]:
    """Return the weighted terms of the sum, each by the wheel or side where it is largest.

    Parameters
    ----------
    tracks : sequence of (Track, bool array (n,))
        Statistic of each single detector, and where it may count (no braking force on its wheel).
    g_variance : array (n,)
        CUSUM of the variance difference, used with `third = "variance"`. [(m/s²)^2 s]
    n : int
        Samples.

    Returns
    -------
    mapping
        Name in `TERMS` -> array (n,) within 0 and its weight; zero where a statistic is missing. With
        `third = "variance"` the term `resistance` holds that CUSUM.

    Thesis: Eq. (2.11). Departures (E6): the third term is g_RR / g_RR,max by default; the variance term is clamped at
    both ends, since as printed it is negative below its lower bound; sides and wheels enter by their largest value.
    """
    ends = (
        (0.0, p.g_up), (0.0, p.g_down), (0.0, p.g_resistance), (p.var_low, p.var_high), (p.loss_low, p.loss_high),
    )  # fmt: skip
    span = dict(zip(TERMS, ends, strict=True))
    out = {name: np.zeros(n) for name in TERMS}
    for track, counts in tracks:
        if track.detector not in out or (track.detector == SLIP_SLOPE_DROP.name and not p.with_slope):
            continue
        if track.detector == RESISTANCE.name and p.third == "variance":
            continue
        low, high = span[track.detector]
        scaled = np.clip((np.nan_to_num(track.statistic) - low) / (high - low), 0.0, 1.0)
        out[track.detector] = np.maximum(out[track.detector], np.where(counts, scaled, 0.0))
    if p.third == "variance":
        out[RESISTANCE.name] = np.clip(np.nan_to_num(g_variance) / p.g_variance, 0.0, 1.0)
    return {name: weight * out[name] for name, weight in zip(TERMS, p.weights, strict=True)}


class JointCusumWatch:
    """Joint detector 2: the sum of scaled statistics. Features: `joint_term_spin_up` ..."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._p = p = setup.settings.joint_cusum
        self._variance = cusum.CusumParams(p.var_low, 1.0, p.g_variance, setup.dt)
        self._variances: dict[str, cusum.CusumState] = {}
        self._hold = 0

    def push(self, scene: Scene) -> Output:
        """Take the next piece: one track, the sum. [-]"""
        f, x = scene.f, scene.shared[MEASURE]
        slope = scene.shared[MAY_BE_WATER]
        counting = [(t, _counts(t, scene) & (slope | (t.detector != SLIP_SLOPE_DROP.name))) for t in scene.tracks]
        parts = terms(self._p, counting, self._variance_sum(scene), scene.size)
        total = np.sum(list(parts.values()), axis=0)
        known = ~np.isnan(x)
        above = known & (total > self._setup.threshold)
        if self._p.gated:
            above &= scene.shared[GATE]
        active, self._hold = hold_on(above, self._hold, seconds=HOLD, dt=self._setup.dt)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "delta_a_x_max": ("max", scene.unbraked_resistance),
            **{f"term_{name}": ("max", part) for name, part in parts.items()},
            **{f"at_start_{name}": ("first", part) for name, part in parts.items()},
            "full": ("any", f[FULL] > 0.0),
            AFTER: ("last", scene.shared[GATE_AFTER]),
        }
        track = self._setup.track(np.where(known, total, np.nan), active)
        return Output(((track, evidence),), {f"joint_term_{name}": part for name, part in parts.items()})

    def _variance_sum(self, scene: Scene) -> FloatArray:
        sums = []
        for track in scene.of(MINOR_SPIN_DOWN):
            assert track.side is not None
            state = self._variances.get(track.side, cusum.initial_state())
            g, _, self._variances[track.side] = cusum.scan(self._variance, state, track.statistic)
            sums.append(np.nan_to_num(g))
        return np.max(sums, axis=0) if sums else np.zeros(scene.size)


def _counts(track: Track, scene: Scene) -> BoolArray:
    """Flag samples without a braking force on the statistic's wheel, in a car that does not rotate.

    Of a variance 0.7 must belong to one axle. A wheel that spins up must have lost its traction, as the single detector
    asks (C27), and not in a car that spins round: on a dry road the engine spins it up with all of it.
    """
    if track.wheel is None:
        return np.ones(scene.size, dtype=bool)
    bits: BoolArray = ~scene.braking[track.wheel] & ~scene.shared[ROTATES]
    if track.detector == MINOR_SPIN_DOWN.name:
        bits &= is_alone(track, scene.f)
    if track.detector == SPIN_UP.name:
        bits &= (track.active & ~spins_round(scene.f)) | has_lost_traction(scene.f, track.wheel)
    return bits


def _explain(evidence: dict[str, Any]) -> dict[str, Any]:
    """Add `decided_by`: the terms of the sum when it crossed the threshold, largest first."""
    start = {name: float(evidence.get(f"at_start_{name}", 0.0)) for name in TERMS}
    found = sorted((n for n, v in start.items() if v >= LEAST_TERM), key=lambda n: -start[n])
    return {**without_start(evidence), "decided_by": found}


JOINT_CUSUM = Detector(
    name="joint_cusum",
    title="Joint CUSUM",
    unit="-",
    meaning="scaled sum of all effects",
    statistic="scaled sum of the single detectors",
    threshold=1.15,
    needs=joint_needs,
    start=JointCusumWatch,
    kind="joint",
    reads=(*JOINT_CRITERIA.reads, JOINT_CRITERIA),
    severity=joint_severity,
    explain=_explain,
)
