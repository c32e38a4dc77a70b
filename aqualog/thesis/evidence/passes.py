"""Simulated passes over a watered lane: truth, not detectors, and the quantities that claims use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aqualog.campaign.expected import contact_of, tangent_of
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.evaluate.labels import CONTACT_PARTIAL, PARTIAL_S, spans_of
from aqualog.model.programme import LEFT_SHARE, SEDAN
from aqualog.model.scenario import Lane, Profile, Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth
from aqualog.model.tyre import TYRES
from aqualog.physics.load import wheel_loads
from aqualog.physics.resistance import nominal_acceleration
from aqualog.physics.slip import wheel_slip
from aqualog.physics.traction import traction_coefficient

__all__ = [
    "HIGH", "KMH", "LOW", "MEDIUM", "SLOPE_EDGES", "SPIN_EDGES", "SPIN_UP", "Pass", "PassFigures", "drive_pass",
    "figures_of", "initial_slope",
]  # fmt: skip

KMH = 1.0 / 3.6
LOW, MEDIUM, HIGH = 1.9e5, 2.3e5, 2.8e5  # [Pa]
ENTRY, EXIT, DURATION = 2.0, 7.0, 8.0  # [s]
LEFT_IRREGULARITY = 0.5  # with `LEFT_SHARE`: significantly lower and more irregular on the left (thesis 2.1)
DIP = -0.02  # [-] a minor spin-down: the rim 2 % slower than the car
STOP = -0.5  # [-] a full spin-down: less than half of its speed
SPIN_UP = 0.05  # [-]
_GAP_S = 0.1  # [s] dips closer than this are one


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass: speed in the middle of the lane [km/h], tyre, pressure [Pa], depth in the right track [m], loads [kg].

    `a` [m/s²]: speed rises through the pass; `wiggles`: drive torque that varies by 250 N·m with 1 s, for a slope to
    be regressed; `kick` [N·m]: extra drive torque for 0.7 s on the lane; `even`: both tracks alike; `scatter` scales
    the fluctuation of the contact; `rear_share` of the drive torque. A depth of 0 is a dry road.
    """

    kmh: float
    tyre: str = "worn_summer"
    p: float = LOW
    h: float = 1.3e-3
    load_front: float = 0.0
    load_rear: float = 0.0
    a: float = 0.0
    wiggles: bool = False
    kick: float = 0.0
    even: bool = False
    scatter: float = 1.0
    rear_share: float = 1.0


def scenario_of(p: Pass, seed: int) -> Scenario:
    """The drive behind a pass: 8 s, water from 2 to 7 s."""
    lane = Lane(
        ENTRY, EXIT,
        depth_left=p.h * (1.0 if p.even else LEFT_SHARE), depth_right=p.h,
        irregularity_left=0.05 if p.even else LEFT_IRREGULARITY, irregularity_right=0.05,
    )  # fmt: skip
    v = p.kmh * KMH
    speed: Profile = ((0.0, v),)
    if p.a != 0.0:
        speed = ((0.0, v - p.a * 4.5), (DURATION, v + p.a * (DURATION - 4.5)))
    tyre, car = TYRES[p.tyre], SEDAN
    if p.rear_share < 1.0:
        car = replace(SEDAN, drivetrain="awd" if p.rear_share > 0.0 else "fwd", torque_split_rear=p.rear_share)
    return Scenario(
        car, tyre, tyre, p.p, p.p, p.load_front, p.load_rear, DURATION, 100.0, seed, speed,
        (lane,) if p.h > 0.0 else (), extra_torque=_torque(p), water_scatter=p.scatter, sensors=IDEAL,
    )  # fmt: skip


def _torque(p: Pass) -> Profile:
    if p.kick:
        return ((0.0, 0.0), (3.0, 0.0), (3.05, p.kick), (3.75, p.kick), (3.8, 0.0), (DURATION, 0.0))
    if p.wiggles:
        t = np.arange(0.0, DURATION, 0.05)
        return tuple((float(x), float(250.0 * np.sin(2.0 * np.pi * x))) for x in t)
    return ()


def drive_pass(p: Pass, seed: int) -> tuple[FloatArray, Mapping[str, FloatArray], Scenario]:
    """Time (n,) [s], columns of the truth, and the scenario."""
    scenario = scenario_of(p, seed)
    truth = drive_truth(assemble(scenario))
    return truth.t, truth.columns, scenario


def events(t: FloatArray, x: FloatArray, level: float, gap: float = _GAP_S) -> list[tuple[float, float]]:
    """Start [s] and extreme of each stretch where x < level; stretches closer than `gap` [s] are one."""
    below = np.flatnonzero(x < level)
    if below.size == 0:
        return []
    parts = np.split(below, np.flatnonzero(np.diff(t[below]) > gap) + 1)
    return [(float(t[p[0]]), float(x[p].min())) for p in parts]


def resistance(t: FloatArray, c: Mapping[str, FloatArray], scenario: Scenario) -> FloatArray:
    """Resistance measure (2.9) with the vehicle's own dry parameters and load, array (n,). [m/s²]"""
    car = scenario.vehicle
    mass = car.mass + scenario.load_front + scenario.load_rear
    l_f = (car.mass * car.l_f + scenario.load_rear * car.wheelbase) / mass
    loads = wheel_loads(c["a_x"], c["a_y"], mass=mass, l_f=l_f, l_r=car.wheelbase - l_f, h_cg=car.h_cg, track=car.track)
    torque = np.array([c[f"torque_{w}"] for w in WHEELS])
    omega_dot = np.array([np.gradient(c[f"omega_{w}"], t) for w in WHEELS])
    nominal = nominal_acceleration(
        torque, loads, c["true_v_x"], omega_dot, arm=np.array([car.arm(w) for w in WHEELS]),
        inertia=np.array([car.turning_inertia(w) for w in WHEELS]), mass=mass, r_w=car.rolling_resistance,
        drag_area=car.drag_area, air_density=car.air_density,
    )  # fmt: skip
    return np.asarray(nominal - c["a_x"], dtype=np.float64)


def slip_and_traction(
    t: FloatArray, c: Mapping[str, FloatArray], wheel: str, scenario: Scenario
) -> tuple[FloatArray, FloatArray]:
    """Slip (3.13) and traction coefficient of a wheel from its torque and true load, arrays (n,). [-]"""
    car = scenario.vehicle
    omega = c[f"omega_{wheel}"]
    s = wheel_slip(omega, c["true_v_x"], car.r_e(wheel))
    mu = traction_coefficient(
        c[f"torque_{wheel}"], c[f"true_load_{wheel}"], np.gradient(omega, t), arm=car.arm(wheel),
        inertia=car.turning_inertia(wheel), r_w=car.rolling_resistance,
    )  # fmt: skip
    return np.asarray(s, dtype=np.float64), np.asarray(mu, dtype=np.float64)


def initial_slope(s: FloatArray, mu: FloatArray, *, friction: float, dry: float | None = None) -> float:
    """Slip slope at zero slip of points of a brush whose friction is known.

    Parameters
    ----------
    s, mu : array (n,)
        Slip and traction coefficient; n > 1 and mu varies. [-]
    friction : float
        Of the tread on this road. [-]
    dry : float, optional
        Initial slope of the full contact; without it these points are from one. [-]

    Slip, the noisy one, is regressed on traction. The line lies below the initial slope, because the curve bends (E22).
    Friction and range of the traction say by how much; the contact that has this line is found as in a campaign.
    """
    k = float(np.linalg.lstsq(np.column_stack([mu, np.ones_like(mu)]), s, rcond=None)[0][0])
    low, high = (float(x) for x in np.quantile(mu, (0.05, 0.95)))
    if high - low < LEAST_RANGE or k <= 0.0:
        return np.nan
    if dry is None:
        return float(tangent_of(np.array(1.0 / k), friction, (low, high)))
    return dry * float(contact_of(np.array(1.0 / (k * dry)), friction, (low, high))) ** 2


GONE, STILL = 0.01, 5.0  # contact that counts as none [-], turning that counts as none [rad/s]
SPIN_EDGES = np.arange(80.0, 160.0, 10.0)  # [km/h] bins of Figure 2.7
SLOPE_EDGES = np.arange(60.0, 115.0, 10.0)  # [km/h] bins of Figures 2.17 to 2.20
LARGEST_SLIP = 0.1  # [-] of a point that a slope is regressed from
LEAST_RANGE = 0.02  # [-] of the traction, 5 to 95 %
_EVERY, _LEAST = 10, 10  # rows between points of a regression, 10 ms; points that one needs


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
    lever: float  # torque of the water against the front right wheel over its load, as long as it turns [m]
    yaw: float  # largest heading on the lane [rad]
    slope_rl: float  # slip slope at zero slip [-]
    slope_rr: float
    slope_dry: float  # the same before the entry, rear right
    spins: FloatArray  # (2, bins of SPIN_EDGES, 2): samples and sum of the traction coefficient in spin-ups, rl and rr
    points: FloatArray  # (m, 4): speed [km/h], slip, traction, true slope, rear right every 10 ms; NaN where it spins


def figures_of(p: Pass, seed: int) -> PassFigures:
    """Drive a pass and compute the quantities of the claims; the same pass and seed give the same values."""
    t, c, scenario = drive_pass(p, seed)
    on = (t > ENTRY) & (t < EXIT)
    # the wheels settle at both ends, and the rear axle comes later
    inner = (t > ENTRY + 0.2) & (t < EXIT - 0.1)
    before = (t > 0.5) & (t < ENTRY)
    slip = {w: (c[f"omega_{w}"] * SEDAN.r_e(w) - c["true_v_x"]) / c["true_v_x"] for w in WHEELS}
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
    spun = "rl" if slip["rl"][k] > slip["rr"][k] else "rr"
    dt = float(t[1] - t[0])
    partial = (s for w in WHEELS for s in spans_of(t, c[f"true_contact_{w}"] < CONTACT_PARTIAL))
    slopes, points = _slopes(t, c, scenario, inner if p.wiggles else np.zeros_like(inner))
    return PassFigures(
        dips=len(dips),
        depth=float(np.median([d for _, d in dips])) if dips else np.nan,
        low_slip=min(float(np.quantile(_slip_313(slip[w][inner]), 0.05)) for w in ("fl", "fr")),
        stop_s=_first(t, on & (slip["fr"] < STOP)) - ENTRY,
        any_stop=bool((np.minimum(slip["fl"], slip["fr"])[on] < STOP).any()),
        rear_spin=float(rear[on].max()),
        rear_spin_s=spin - ENTRY,
        rear_spin_v=float(v[k]) if k >= 0 else np.nan,
        rear_contact=float(c[f"true_contact_{spun}"][k]) if k >= 0 else np.nan,
        rear_stop_s=_first(t, on & (np.minimum(slip["rl"], slip["rr"]) < STOP)) - ENTRY,
        overload_s=max(float(np.count_nonzero(on & (_demand(c, w, scenario) > 1.0))) * dt for w in ("rl", "rr")),
        afloat_force=_afloat(c, on),
        gone_still_s=still - gone if np.isfinite(still) else np.inf,
        is_partial=any(b - a >= PARTIAL_S - 1e-9 for a, b in partial),
        mean_kmh=float(v[on].mean()),
        speed_change=float(np.abs(v[calm] - v[np.searchsorted(t, ENTRY)]).max()) if calm.any() else 0.0,
        delta_a=level,
        delta_a_dry=dry,
        rise_s=_first(t, on & (delta_a - dry > 0.5 * (level - dry))) - ENTRY,
        lever=float(np.mean((c["true_water_torque_fr"] / c["true_load_fr"])[inner & (c["omega_fr"] > STILL)])),
        yaw=float(np.abs(np.cumsum(c["yaw_rate"]) * dt)[on].max()),
        slope_rl=slopes["rl"],
        slope_rr=slopes["rr"],
        slope_dry=slopes["dry"],
        spins=np.stack([_spins(c, w, on & (slip[w] > SPIN_UP)) for w in ("rl", "rr")]),
        points=points,
    )


def _slopes(
    t: FloatArray, c: Mapping[str, FloatArray], scenario: Scenario, inner: BoolArray
) -> tuple[dict[str, float], FloatArray]:
    """Slope of each rear wheel, on the lane and of the right one before it, and the points that slopes of speed bins
    are regressed from, rear right.
    """
    tyre = scenario.tyre_rear
    known = scenario.vehicle.mu_max * tyre.mu_factor  # friction of the tread on dry road
    wet = known * (tyre.wet_friction if scenario.lanes else 1.0)
    found, at = {}, np.flatnonzero(inner)[::_EVERY]
    dry = np.flatnonzero((t > 0.5) & (t < ENTRY))[::_EVERY]
    for w in ("rl", "rr"):
        s, mu = slip_and_traction(t, c, w, scenario)
        found["dry"] = initial_slope(s[dry], mu[dry], friction=known)
        good = at[np.isfinite(s[at]) & (np.abs(s[at]) < LARGEST_SLIP)]
        enough = good.size > _LEAST
        found[w] = initial_slope(s[good], mu[good], friction=wet, dry=found["dry"]) if enough else np.nan
    points = np.column_stack([c["true_v_x"][at] / KMH, s[at], mu[at], c["true_slip_slope_rr"][at]])
    points[~(np.abs(points[:, 1]) < LARGEST_SLIP)] = np.nan
    return found, points


def _spins(c: Mapping[str, FloatArray], wheel: str, spinning: BoolArray) -> FloatArray:
    traction = c[f"true_force_x_{wheel}"][spinning] / c[f"true_load_{wheel}"][spinning]
    v = c["true_v_x"][spinning] / KMH
    count, _ = np.histogram(v, SPIN_EDGES)
    total, _ = np.histogram(v, SPIN_EDGES, weights=traction)
    return np.column_stack([count, total]).astype(np.float64)


def _demand(c: Mapping[str, FloatArray], wheel: str, scenario: Scenario) -> FloatArray:
    """Drive force minus the water's resistance, over the limit of the remaining contact, array (n,). [-]"""
    force = (c[f"torque_{wheel}"] - c[f"true_water_torque_{wheel}"]) / scenario.vehicle.arm(wheel)
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


def _slip_313(dip: FloatArray) -> FloatArray:
    """Slip over the wheel's speed (3.13) from that over the car's; a wheel that stands counts as -10, not -inf."""
    return np.asarray(dip / np.maximum(1.0 + dip, 0.1), dtype=np.float64)


def _first(t: FloatArray, bits: BoolArray) -> float:
    at = np.flatnonzero(bits)
    return float(t[at[0]]) if at.size else np.inf
