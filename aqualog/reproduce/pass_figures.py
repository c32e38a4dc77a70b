"""Quantities that claims use from a simulated pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.evaluate.truth import CONTACT_PARTIAL, PARTIAL_S, spans_of
from aqualog.model.scenario import Scenario
from aqualog.reproduce.passes import (
    DIP,
    ENTRY,
    EXIT,
    KMH,
    SPIN_UP,
    STOP,
    Pass,
    drive_pass,
    events,
    resistance,
    slip_and_traction,
    slope_of,
    wheel_dip,
)

__all__ = ["SLOPE_EDGES", "SPIN_EDGES", "PassFigures", "figures_of"]

GONE, STILL = 0.01, 5.0  # contact that counts as none [-], turning that counts as none [rad/s]
SPIN_EDGES = np.arange(80.0, 160.0, 10.0)  # [km/h] bins of Figure 2.7
SLOPE_EDGES = np.arange(60.0, 115.0, 10.0)  # [km/h] bins of Figures 2.17 to 2.20
LARGEST_SLIP = 0.1  # [-] of a point that a slope is regressed from
_EVERY = 10  # rows between points of a regression: 10 ms


@dataclass(frozen=True, slots=True)
class PassFigures:
    """Quantities of one pass that claims use; NaN or infinite times without an event.

    Times are from the entry [s]; `rl` and `rr` are the rear wheels; slips are (omega r_e - v) / v unless stated
    otherwise.
    """

    dips: int  # of both front wheels below `DIP`
    depth: float  # median extreme of the dips [-]
    low_slip: float  # 5 % quantile of the slip (3.13) on the lane, worse front wheel [-]
    stop_s: float  # front right below `STOP`
    any_stop: bool  # a front wheel below `STOP`
    rear_spin: float  # largest slip of a rear wheel [-]
    rear_spin_s: float  # a rear wheel above `SPIN_UP`
    rear_spin_v: float  # speed then [km/h]
    rear_contact: float  # its contact then [-]
    rear_stop_s: float  # a rear wheel below `STOP`
    overload_s: float  # time in which the drive asks a rear wheel for more than its residual friction [s]
    afloat_force: float  # largest tangential force over load of a wheel without contact (below `GONE`) [-]
    gone_still_s: float  # from the front right wheel's loss of contact until it stands [s]
    is_partial: bool  # some wheel in partial aquaplaning, as labels have it
    mean_kmh: float  # on the lane
    speed_change: float  # largest deviation from the speed at the entry, until a wheel stops or spins [km/h]
    delta_a: float  # mean resistance measure (2.9) on the lane [m/s^2]
    delta_a_dry: float  # before the entry
    rise_s: float  # resistance beyond half of its mean on the lane
    lever: float  # torque of the water against the front right wheel over its load [m]
    yaw: float  # largest heading on the lane [rad]
    slope_rl: float  # slip slope by regression [-]
    slope_rr: float
    spins: FloatArray  # (2, bins of SPIN_EDGES, 2): samples and sum of the traction coefficient in spin-ups, rl and rr
    moments: FloatArray  # (bins of SLOPE_EDGES, 6): n, sums of mu, s, mu^2, mu s, and of the true slope, rr


def figures_of(p: Pass, seed: int) -> PassFigures:
    """Drive a pass and compute the quantities of the claims; the same pass and seed give the same values."""
    t, c, scenario = drive_pass(p, seed)
    on = (t > ENTRY) & (t < EXIT)
    # the wheels settle at both ends, and the rear axle comes later
    inner = (t > ENTRY + 0.2) & (t < EXIT - 0.1)
    before = (t > 0.5) & (t < ENTRY)
    slip = {w: wheel_dip(c, w) for w in WHEELS}
    dips = [e for w in ("fl", "fr") for e in events(t[on], slip[w][on], DIP)]
    rear = np.maximum(slip["rl"], slip["rr"])
    spin = _first(t, on & (rear > SPIN_UP))
    gone = _first(t, on & (c["true_contact_fr"] < GONE))
    still = _first(t, on & (c["omega_fr"] < STILL))
    delta_a = resistance(t, c, scenario)
    level, dry = float(delta_a[inner].mean()), float(delta_a[before].mean())
    v = c["true_v_x"] / KMH
    calm = on & (t < _first(t, on & ((rear > SPIN_UP) | (np.minimum(slip["fl"], slip["fr"]) < STOP))))
    k = int(np.searchsorted(t, spin)) if np.isfinite(spin) else -1
    dt = float(t[1] - t[0])
    slopes, moments = _slopes(t, c, scenario, inner)
    return PassFigures(
        dips=len(dips),
        depth=float(np.median([d for _, d in dips])) if dips else np.nan,
        low_slip=min(float(np.quantile(_slip_313(slip[w][inner]), 0.05)) for w in ("fl", "fr")),
        stop_s=_first(t, on & (slip["fr"] < STOP)) - ENTRY,
        any_stop=bool((np.minimum(slip["fl"], slip["fr"])[on] < STOP).any()),
        rear_spin=float(rear[on].max()),
        rear_spin_s=spin - ENTRY,
        rear_spin_v=float(v[k]) if k >= 0 else np.nan,
        rear_contact=float(c["true_contact_rl" if slip["rl"][k] > slip["rr"][k] else "true_contact_rr"][k])
        if k >= 0
        else np.nan,
        rear_stop_s=_first(t, on & (np.minimum(slip["rl"], slip["rr"]) < STOP)) - ENTRY,
        overload_s=max(float(np.count_nonzero(on & (_demand(c, w, scenario) > 1.0))) * dt for w in ("rl", "rr")),
        afloat_force=_afloat(c, on),
        gone_still_s=still - gone if np.isfinite(still) else np.inf,
        is_partial=_is_partial(t, c),
        mean_kmh=float(v[on].mean()),
        speed_change=float(np.abs(v[calm] - v[np.searchsorted(t, ENTRY)]).max()) if calm.any() else 0.0,
        delta_a=level,
        delta_a_dry=dry,
        rise_s=_first(t, on & (delta_a - dry > 0.5 * (level - dry))) - ENTRY,
        lever=float(np.mean(c["true_water_torque_fr"][inner] / c["true_load_fr"][inner])),
        yaw=float(np.abs(np.cumsum(c["yaw_rate"]) * dt)[on].max()),
        slope_rl=slopes["rl"],
        slope_rr=slopes["rr"],
        spins=np.stack([_spins(c, w, on & (slip[w] > SPIN_UP)) for w in ("rl", "rr")]),
        moments=moments,
    )


def _slopes(
    t: FloatArray, c: Mapping[str, FloatArray], scenario: Scenario, inner: BoolArray
) -> tuple[dict[str, float], FloatArray]:
    """Slope of each rear wheel, and the sums that slopes of speed bins are regressed from, rear right."""
    found = {}
    moments = np.zeros((SLOPE_EDGES.size - 1, 6))
    for w in ("rl", "rr"):
        s, mu = slip_and_traction(t, c, w, scenario)
        good = np.flatnonzero(inner & np.isfinite(s) & (np.abs(s) < LARGEST_SLIP))
        found[w] = slope_of(s[good][::_EVERY], mu[good][::_EVERY]) if good.size > 100 else np.nan
        if w == "rr" and good.size:
            at = good[::_EVERY]
            parts = np.column_stack([np.ones(at.size), mu[at], s[at], mu[at] ** 2, mu[at] * s[at],
                                     c["true_slip_slope_rr"][at]])  # fmt: skip
            bins = np.digitize(c["true_v_x"][at] / KMH, SLOPE_EDGES) - 1
            inside = (bins >= 0) & (bins < moments.shape[0])
            np.add.at(moments, bins[inside], parts[inside])
    return found, moments


def _spins(c: Mapping[str, FloatArray], wheel: str, spinning: BoolArray) -> FloatArray:
    traction = c[f"true_force_x_{wheel}"][spinning] / c[f"true_load_{wheel}"][spinning]
    v = c["true_v_x"][spinning] / KMH
    count, _ = np.histogram(v, SPIN_EDGES)
    total, _ = np.histogram(v, SPIN_EDGES, weights=traction)
    return np.column_stack([count, total]).astype(np.float64)


def _demand(c: Mapping[str, FloatArray], wheel: str, scenario: Scenario) -> FloatArray:
    """Drive force minus the water's resistance, over the limit of the remaining contact, array (n,). [-]"""
    force = (c[f"torque_{wheel}"] - c[f"true_water_torque_{wheel}"]) / scenario.vehicle.r_l(wheel)
    residual = c[f"true_mu_max_{wheel}"] * c[f"true_load_{wheel}"]
    return np.asarray(force / np.maximum(residual, 1.0), dtype=np.float64)


def _afloat(c: Mapping[str, FloatArray], on: BoolArray) -> float:
    largest = 0.0
    for w in WHEELS:
        gone = on & (c[f"true_contact_{w}"] < GONE)
        if gone.any():
            force = np.hypot(c[f"true_force_x_{w}"][gone], c[f"true_force_y_{w}"][gone])
            largest = max(largest, float((force / c[f"true_load_{w}"][gone]).max()))
    return largest


def _is_partial(t: FloatArray, c: Mapping[str, FloatArray]) -> bool:
    spans = (s for w in WHEELS for s in spans_of(t, c[f"true_contact_{w}"] < CONTACT_PARTIAL))
    return any(b - a >= PARTIAL_S - 1e-9 for a, b in spans)


def _slip_313(dip: FloatArray) -> FloatArray:
    """Slip over the wheel's speed (3.13) from that over the car's; a wheel that stands counts as -10, not -inf."""
    return np.asarray(dip / np.maximum(1.0 + dip, 0.1), dtype=np.float64)


def _first(t: FloatArray, bits: BoolArray) -> float:
    at = np.flatnonzero(bits)
    return float(t[at[0]]) if at.size else np.inf
