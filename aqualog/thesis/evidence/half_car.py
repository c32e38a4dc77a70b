"""The study of chapter 3: a half-car under excitation, its estimate, and when the drop is found."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.slip_slope.estimator import Estimate, initial_state, scan
from aqualog.detect.slip_slope.tuning import TUNING, Params, Tuning
from aqualog.model.half_car import HalfCar, HalfCarRun, SurfaceChange, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics.differential import differential_slip, speed_ratio

__all__ = [
    "DT", "GATE_OFF", "HIGH_MU", "HIGH_SLOPE", "LOW_MU", "LOW_SLOPE", "RATE_HZ", "ROAD_NOISE", "SUV", "Case",
    "adaption_time", "drive", "estimate", "estimated", "false_alarms", "first_alarm", "inputs", "is_used", "noise",
    "slope_at",
]  # fmt: skip

HIGH_SLOPE, LOW_SLOPE = 30.0, 10.0  # C_s / F_z on both axles before and after the change (thesis 3.3) [-]
HIGH_MU, LOW_MU = 1.0, 0.4  # [-] thesis Fig. 3.4
REAR_SHARE = 0.6  # of the load and of the torque: both axles slip alike, which excitation must change (C95)
RATE_HZ, DT = 100.0, 0.01  # [Hz], [s]
STEP_S = 1e-3
T_START = -10.0  # the change is at t = 0 and the excitation's phase zero there
V_CHANGE = 20.0  # [m/s]

SUV = HalfCar(
    mass=2714.0, l_f=1.686, l_r=1.124, h_cg=0.62, drag_area=0.91, inertia_f=5.1, inertia_r=5.1,
    r_e_f=0.40, r_e_r=0.40, r_l_f=0.39, r_l_r=0.39, mu=HIGH_MU, slope_f=HIGH_SLOPE, slope_r=HIGH_SLOPE,
)  # fmt: skip
"""An all-wheel-drive SUV; 40 % of its load on the front axle (thesis Fig. 3.4)."""

GATE_OFF = TUNING._replace(mu_min=0.0)
"""Every sample is used, however small the differential traction."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run: excitation (waveform "" for none), acceleration [m/s²], tuning, and what may be switched off."""

    waveform: str = "sine"
    amplitude: float = 250.0
    kind: str = "force"
    period: float = 8.0
    a_x: float = 1.0
    tuning: Tuning = TUNING
    car: HalfCar = SUV
    low_mu: float = LOW_MU
    nu: float = REAR_SHARE
    t_end: float = 20.0
    phase: float = 0.0  # of the excitation at the change, as a share of its period


@dataclass(frozen=True, slots=True)
class Drive:
    """Samples (n,) of the half-car at `RATE_HZ`, SI; names as in `HalfCarResult`."""

    t: FloatArray
    v_x: FloatArray
    a_x: FloatArray
    omega_f: FloatArray
    omega_r: FloatArray
    s_f: FloatArray
    s_r: FloatArray
    mu_f: FloatArray
    mu_r: FloatArray
    F_x_f: FloatArray
    F_x_r: FloatArray


def drive(case: Case) -> Drive:
    """Drive from -10 s to `t_end`; at t = 0 the surface changes under both axles and the car does 20 m/s."""
    return _drive(case.waveform, case.amplitude, case.kind, case.period, case.a_x, case.car, case.low_mu, case.nu,
                  case.t_end, case.phase * case.period)  # fmt: skip


@lru_cache(maxsize=256)
def _drive(
    waveform: str, amplitude: float, kind: str, period: float, a_x: float, car: HalfCar, low_mu: float, nu: float,
    t_end: float, lag: float,
) -> Drive:  # fmt: skip
    # apart from the tuning, so that a sweep of it drives once
    excitation = Excitation(waveform, amplitude, kind, period) if waveform else None  # type: ignore[arg-type]
    run = HalfCarRun(
        t_end - T_START, dt=STEP_S, v0=V_CHANGE + a_x * T_START, a_x=a_x, nu=nu, excitation=excitation,
        surface=(SurfaceChange(lag, LOW_SLOPE, LOW_SLOPE, low_mu),), t_start=T_START + lag,
    )  # fmt: skip
    result = simulate_half_car(car, run)
    every = round(1.0 / (RATE_HZ * STEP_S))
    columns = {name: np.ascontiguousarray(getattr(result, name)[::every]) for name in Drive.__dataclass_fields__}
    return Drive(**{**columns, "t": columns["t"] - lag})


def inputs(d: Drive, car: HalfCar = SUV) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Differential slip, mu_F and rho mu_R: input of the estimator formulated at the front axle, (3.18). [-]"""
    v_f, v_r = car.r_e_f * d.omega_f, car.r_e_r * d.omega_r
    return differential_slip(v_f, v_r), d.mu_f, speed_ratio(v_f, v_r) * d.mu_r


def estimate(case: Case) -> Estimate:
    """The estimator over the drive, noise-free as in the thesis."""
    return estimated(case.tuning, *inputs(drive(case), case.car))


def first_alarm(d: Drive, e: Estimate) -> float:
    """Detection time: the first drop found after the change; NaN without a detection. [s]"""
    found = d.t[(e.alarm > 0.0) & (d.t > 0.0)]
    return float(found[0]) if found.size else float("nan")


def false_alarms(d: Drive, e: Estimate) -> int:
    """Changes found before there was one."""
    return int(np.count_nonzero((e.alarm != 0.0) & (d.t <= 0.0)))


def slope_at(d: Drive, e: Estimate, t: float) -> float:
    """Estimated slope at a time. [-]"""
    return float(e.slope[np.searchsorted(d.t, t - 1e-6)])


def is_used(e: Estimate) -> BoolArray:
    """Samples that update the slope: status 0 or 1."""
    return e.status <= 1.0


def adaption_time(d: Drive, e: Estimate, *, within: float = 0.1, after: float = 8.0) -> float:
    """From the alarm until the estimate stays within a share of its value `after` seconds later; NaN without. [s]"""
    t_alarm = first_alarm(d, e)
    if not t_alarm + after <= d.t[-1]:
        return float("nan")
    final = slope_at(d, e, t_alarm + after)
    span = (d.t >= t_alarm - 1e-6) & (d.t <= t_alarm + after)
    outside = np.flatnonzero(np.abs(e.slope[span] - final) > within * final)
    return float((outside[-1] + 1) / RATE_HZ) if outside.size else 0.0


ROAD_NOISE = 5e-4  # [-] rms of the slip as measured on a road (V, Gustafsson [gustafsson2000])
_KEEP = 0.48 ** (DT / 0.2)  # its memory from sample to sample: a correlation of 0.48 after 0.2 s


def estimated(
    tuning: Tuning,
    s_delta: FloatArray,
    mu_i: FloatArray,
    rho_mu_j: FloatArray,
    *,
    slope: float = HIGH_SLOPE,
    beta: float = 1.0,
    active: BoolArray | None = None,
) -> Estimate:
    """The estimator over samples (n,), from a slope and ratio at the start; `active` everywhere by default."""
    used = np.ones(s_delta.size, dtype=np.bool_) if active is None else active
    state = initial_state(tuning, slope=slope, beta=beta)
    return scan(Params.make(tuning, DT), state, s_delta, mu_i, rho_mu_j, used)[0]


def noise(rng: np.random.Generator, n: int) -> FloatArray:
    """Noise of the differential slip as measured on a road, (n,). [-]"""
    white = ROAD_NOISE * np.sqrt(1.0 - _KEEP**2) * rng.standard_normal(n)
    out = np.empty(n)
    last = 0.0
    for i in range(n):
        last = _KEEP * last + white[i]
        out[i] = last
    return out
