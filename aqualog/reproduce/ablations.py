"""Alarm bits of a drive with all conditions of the detectors, and with single conditions left out."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from aqualog.core.notation import SIDES, WHEELS
from aqualog.core.records import BoolArray, DriveResult, FloatArray
from aqualog.detect import minor_spin_down
from aqualog.detect.joint import CRITERIA, GATED
from aqualog.detect.negative_force import hold_on
from aqualog.detect.scene import BrakeWatch
from aqualog.detect.slip_slope.watch import SlipSlopeWatch, pairs
from aqualog.detect.wheel_watch import A_Y_MINOR
from aqualog.reproduce.drawn import Taken, detected, taken

__all__ = ["bits_of", "variants"]

_HOLD_S = 0.5  # [s] as long as a joint warning outlasts its criteria


def variants(name: str, seed: int) -> Mapping[str, BoolArray]:
    """Bits (n,) of a drawn drive by the name of a variant.

    `joint_criteria`, `ungated` (criteria 1 to 4 without the gate), `gate`, `resistance`, `criterion_1` to
    `criterion_5`, `spin_up`, `spin_down` (criterion 1 under braking forces too), `minor` and
    `minor_no_difference`, `minor_no_sign`, `minor_no_force`, `minor_no_difference_no_sign` (its conditions left out),
    `slope` and `slope_uncalm`.
    """
    return _variants(name, seed)


@lru_cache(maxsize=320)
def _variants(name: str, seed: int) -> Mapping[str, BoolArray]:
    return bits_of(taken(name, seed))


def bits_of(d: Taken) -> Mapping[str, BoolArray]:
    """As `variants`, of any drive."""
    result = detected(d)
    n = d.t.size
    f = {c: np.ascontiguousarray(result.features[c].to_numpy()) for c in result.features.columns}
    none = np.zeros(n, dtype=np.bool_)
    out: dict[str, BoolArray] = {}
    for detector in ("joint_criteria", "joint_cusum", "resistance", "spin_down", "spin_up"):
        out[detector] = _any(result, detector, none)
    for k in CRITERIA.values():
        out[f"criterion_{k}"] = f.get(f"criterion_{k}", none.astype(np.float64)) > 0.0
    out["gate"] = f.get("joint_gate", none.astype(np.float64)) > 0.0
    met = np.any([out[f"criterion_{k}"] for k in GATED], axis=0)
    out["ungated"], _ = hold_on(met, 0, seconds=_HOLD_S, dt=d.signals.dt)
    columns = {s: d.signals.array(s) for s in d.signals.symbols}
    braking = BrakeWatch(d.vehicle, d.signals.dt).push(f, columns)
    out |= _minor(d, f, braking)
    out["slope"] = _any(result, "slip_slope_drop", none)
    out["slope_uncalm"] = _uncalm(d, f, braking, none)
    return out


def _any(result: DriveResult, detector: str, none: BoolArray) -> BoolArray:
    bits: BoolArray = np.any([none, *(t.active for t in result.tracks if t.detector == detector)], axis=0)
    return bits


def _minor(d: Taken, f: Mapping[str, FloatArray], braking: Mapping[str, BoolArray]) -> dict[str, BoolArray]:
    p = minor_spin_down.MinorParams.make(d.signals.dt)
    kinds = ("", "_no_difference", "_no_sign", "_no_force", "_no_difference_no_sign")
    out = {k: np.zeros(d.t.size, dtype=np.bool_) for k in kinds}
    with np.errstate(invalid="ignore"):
        upright = ~(np.abs(f["a_y_slow"]) > A_Y_MINOR)
    for pair in SIDES.values():
        watched = next(w for w in pair if w[0] == d.vehicle.watched_axle)
        other = next(w for w in pair if w[0] != d.vehicle.watched_axle)
        if any(f"a_w_delta_{w}" not in f for w in (watched, other)):
            continue
        a, a_other = f[f"a_w_delta_{watched}"], f[f"a_w_delta_{other}"]
        dv = f[f"v_w_delta_{watched}"] - f["v_w_delta_common"]
        free = ~braking[watched] & upright
        for k in out:
            _, _, bits, _ = minor_spin_down.scan(
                p._replace(one_sided=0.0) if "_no_sign" in k else p, minor_spin_down.initial_state(), a,
                np.zeros_like(a) if "_no_difference" in k else a_other, dv, f["v_x_hat"],
                upright if k == "_no_force" else free,
            )  # fmt: skip
            out[k] |= bits
    return {f"minor{k}": bits for k, bits in out.items()}


class _Uncalm(SlipSlopeWatch):
    """Criterion 4 on wheels that shake, too."""

    def _calm(self, f: Mapping[str, FloatArray]) -> BoolArray:
        return np.ones(f["v_x_hat"].size, dtype=np.bool_)


def _uncalm(d: Taken, f: Mapping[str, FloatArray], braking: Mapping[str, BoolArray], none: BoolArray) -> BoolArray:
    if any(f"mu_{w}" not in f for w in WHEELS):
        return none
    found = [_Uncalm(d.vehicle, p, d.signals.dt).push(f, braking, f["yaw_rate_slow"]).active for p in pairs(d.vehicle)]
    bits: BoolArray = np.any([none, *found], axis=0)
    return bits
