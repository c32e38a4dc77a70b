"""Run both joint detectors over a drive, with the criteria and terms that decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, Event, FloatArray, Track
from aqualog.detect import cusum, joint, joint_cusum, other_surface
from aqualog.detect.events import EventBook
from aqualog.detect.joint_cusum import JointCusumParams
from aqualog.detect.negative_force import began_free, hold_on
from aqualog.detect.scene import Scene, traction

__all__ = ["JointCriteriaWatch", "JointCusumWatch", "SlopeJudge"]

_NAMES = {number: name for name, number in joint.CRITERIA.items()}
ALONE = 0.7  # of a wheel's variance that the other axle must not have: gravel shakes both (C33)
LEAST_TERM = 0.1  # [-] a term below that has decided nothing


class SlopeJudge:
    """Return where a lost slip slope counts; both joint detectors use the same condition."""

    def __init__(self, dt: float) -> None:
        self._p = other_surface.OtherParams.make(dt)
        self._state = other_surface.initial_state()

    def push(self, scene: Scene, tracks: Sequence[Track], x: FloatArray) -> BoolArray:
        """Return bits (n,) of the next piece; `x` is the trusted resistance measure. [m/s²]"""
        slopes = [t for t in tracks if t.detector == "slip_slope_drop"]
        nothing = np.full(scene.size, np.nan)
        loss = reduce(np.fmax, (t.statistic for t in slopes), nothing)
        dropped = np.any([np.zeros(scene.size, dtype=bool), *(t.active for t in slopes)], axis=0)
        allowed, self._state = other_surface.scan(self._p, self._state, x, scene.f["v_x_hat"], dropped, loss)
        return allowed


class JointCriteriaWatch:
    """Joint detector 1: criteria 1 to 4 behind the resistance gate, 5 beside them."""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._free: dict[tuple[str, str], tuple[bool, bool]] = {}
        self._hold = 0

    def push(
        self, scene: Scene, tracks: Sequence[Track], x: FloatArray, gate: BoolArray, slope: BoolArray, book: EventBook
    ) -> tuple[Track, list[Event], dict[str, FloatArray]]:
        """Return track, closed events and features `criterion_1` ... `criterion_5`, `criterion_full`, `joint_gate`.

        Parameters
        ----------
        scene : Scene
        tracks : sequence of Track
            Of the single detectors in this piece.
        x : array (n,)
            Trusted resistance measure, NaN where missing. [m/s²]
        gate : bool array (n,)
            The resistance gate.
        slope : bool array (n,)
            Where water may be the cause of a lost slope.
        """
        f = scene.f
        found = joint.criteria(
            [(t, self._began_free(t, scene)) for t in tracks],
            {w: f[f"v_w_{w}"] for w in scene.wheels},
            {w: traction(f, w) for w in WHEELS},
            f["v_x_hat"],
        )
        bits = found.behind(gate, slope)
        count = np.sum([bits[k] for k in joint.GATED], axis=0, dtype=np.float64)
        warned: BoolArray = np.asarray(count > 0)
        active, self._hold = hold_on(warned, self._hold, seconds=joint.HOLD, dt=self._dt)
        track = Track("joint_criteria", None, None, "-", np.where(np.isnan(x), np.nan, count), 1.0, active)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "slip_min": ("min", found.slip_min),
            "delta_a_x_max": ("max", scene.unbraked_resistance),
            **{f"criterion_{k}": ("any", b) for k, b in bits.items()},
            **{f"at_start_{k}": ("at_start", b) for k, b in bits.items()},
            "full": ("any", found.is_full),
        }
        features = {f"criterion_{k}": b.astype(np.float64) for k, b in found.met.items()}
        features["joint_gate"] = gate.astype(np.float64)
        features["criterion_full"] = found.is_full.astype(np.float64)
        return track, book.take(track, evidence, _severity, _explain_criteria), features

    def _began_free(self, track: Track, scene: Scene) -> BoolArray:
        if track.detector not in ("spin_down", "minor_spin_down", "spin_up") or track.wheel is None:
            return track.active
        key = (track.detector, track.wheel)
        bits, self._free[key] = began_free(
            track.active, scene.braking[track.wheel], self._free.get(key, (False, False))
        )
        return bits


class JointCusumWatch:
    """Joint detector 2: the sum of scaled statistics."""

    def __init__(self, dt: float, params: JointCusumParams, threshold: float) -> None:
        self._dt = dt
        self._p = params
        self._threshold = threshold
        self._variance = cusum.CusumParams(params.var_low, 1.0, params.g_variance, dt)
        self._variances: dict[str, cusum.CusumState] = {}
        self._hold = 0

    def push(
        self, scene: Scene, tracks: Sequence[Track], x: FloatArray, gate: BoolArray, slope: BoolArray, book: EventBook
    ) -> tuple[Track, list[Event], dict[str, FloatArray]]:
        """Return track, closed events and features `joint_term_*` of the next piece; arguments as above."""
        f, p = scene.f, self._p
        counting = [(t, _counts(t, scene) & (slope | (t.detector != "slip_slope_drop"))) for t in tracks]
        parts = joint_cusum.terms(p, counting, self._variance_sum(tracks), scene.size)
        total = np.sum(list(parts.values()), axis=0)
        known = ~np.isnan(x)
        above = known & (total > self._threshold)
        if p.gated:
            above &= gate
        active, self._hold = hold_on(above, self._hold, seconds=joint.HOLD, dt=self._dt)
        track = Track("joint_cusum", None, None, "-", np.where(known, total, np.nan), self._threshold, active)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "delta_a_x_max": ("max", scene.unbraked_resistance),
            **{f"term_{name}": ("max", part) for name, part in parts.items()},
            **{f"at_start_{name}": ("first", part) for name, part in parts.items()},
            "full": ("any", f.get("criterion_full", np.zeros(scene.size)) > 0.0),
        }
        features = {f"joint_term_{name}": part for name, part in parts.items()}
        return track, book.take(track, evidence, _severity, _explain_terms), features

    def _variance_sum(self, tracks: Sequence[Track]) -> FloatArray:
        sums = []
        for track in tracks:
            if track.detector == "minor_spin_down" and track.side is not None:
                state = self._variances.get(track.side, cusum.initial_state())
                g, _, self._variances[track.side] = cusum.scan(self._variance, state, track.statistic)
                sums.append(np.nan_to_num(g))
        return np.max(sums, axis=0) if sums else np.zeros(0 if not tracks else tracks[0].statistic.size)


def _counts(track: Track, scene: Scene) -> BoolArray:
    """Flag samples without a braking force on the statistic's wheel; of a variance 0.7 must belong to one axle."""
    bits = ~scene.braking[track.wheel] if track.wheel is not None else np.ones(scene.size, dtype=bool)
    if track.detector == "minor_spin_down":
        with np.errstate(invalid="ignore"):
            bits &= track.statistic > ALONE * scene.f.get(f"variance_{track.wheel}", track.statistic)
    return bits


def _severity(evidence: Mapping[str, Any]) -> str:
    return "full" if evidence.get("full", False) else "partial"


def _explain_criteria(evidence: dict[str, Any]) -> dict[str, Any]:
    """Return `decided_by`: the criteria that were met when the warning began."""
    rest = {k: v for k, v in evidence.items() if not k.startswith("at_start_")}
    return {**rest, "decided_by": [_NAMES[k] for k in sorted(_NAMES) if evidence.get(f"at_start_{k}")]}


def _explain_terms(evidence: dict[str, Any]) -> dict[str, Any]:
    """Return `decided_by`: the terms of the sum when it crossed the threshold, largest first."""
    rest = {k: v for k, v in evidence.items() if not k.startswith("at_start_")}
    start = {name: float(evidence.get(f"at_start_{name}", 0.0)) for name in joint_cusum.TERMS}
    found = sorted((n for n, v in start.items() if v >= LEAST_TERM), key=lambda n: -start[n])
    return {**rest, "decided_by": found}
