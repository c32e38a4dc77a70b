"""High-frequency rotational oscillation of a wheel against its own reference (thesis [35])."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.detector import Detector, Scene, Setup
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN
from aqualog.detect.rivals.rival import WholeDrive, alarm_bits, needs_wheels
from aqualog.features.smoothing import gain

__all__ = ["THRESHOLD", "WHEEL_OSCILLATION", "BandParams", "level_change"]

MIN_RATE = 80.0  # [Hz] the band reaches from 15 Hz to near half of the rate
THRESHOLD = 20.0  # [dB]
F_LOW, F_HIGH = 15.0, 45.0  # [Hz] band where the rate allows
NYQUIST_SHARE = 0.9
TAU_POWER = 0.4  # [s]
TAU_REFERENCE = 20.0  # [s]
WARM_UP = 4.0  # [s] of usable signal before the reference means something
CLIP = 1.0  # [-] of the natural logarithm: a change beyond it does not move the reference faster
CAP = 1e3  # [-] 30 dB above the reference is loud enough; more would only outlast its cause
POWER_FLOOR = 1e-12  # [-] a rounded, perfectly even wheel has no power at all
V_MIN = 10.0  # [m/s]
DB = 10.0 / math.log(10.0)


class BandParams(NamedTuple):
    """Coefficients of the band-pass y = b (x - x2) - a1 y1 - a2 y2, and gains; made by `make`."""

    b: float
    a1: float
    a2: float
    k_power: float
    tau_reference: float
    warm_up: float
    dt: float

    @staticmethod
    def make(dt: float) -> BandParams:
        """Second order, 15 to 45 Hz or to 0.9 of half the rate; bilinear transform, gain 1 at the centre."""
        high = min(F_HIGH, NYQUIST_SHARE * 0.5 / dt)
        low, up = math.tan(math.pi * F_LOW * dt), math.tan(math.pi * high * dt)
        width, centre = up - low, up * low
        a0 = 1.0 + width + centre
        return BandParams(
            width / a0, 2.0 * (centre - 1.0) / a0, (1.0 - width + centre) / a0, gain(TAU_POWER, dt), TAU_REFERENCE,
            WARM_UP, dt,
        )  # fmt: skip


@compiled
def _level_change(p, x, usable, clip, cap, floor):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    x1, x2, y1, y2 = math.nan, 0.0, 0.0, 0.0
    power, reference, age = math.nan, 0.0, 0.0
    run_in = 0.0
    for i in range(x.size):
        out[i] = math.nan
        if math.isnan(x[i]):
            x1 = math.nan  # the filter starts anew after a gap; the reference is the wheel's and stays
            continue
        if math.isnan(x1):
            x1, x2, y1, y2 = x[i], x[i], 0.0, 0.0
            power, run_in = math.nan, 0.0
        y = p.b * (x[i] - x2) - p.a1 * y1 - p.a2 * y2
        x2, x1, y2, y1 = x1, x[i], y1, y
        run_in += p.dt
        if run_in < 0.3 or not usable[i]:
            power = math.nan
            continue
        square = min(y * y, cap * math.exp(reference)) if age >= p.warm_up else y * y
        power = square if math.isnan(power) else power + p.k_power * (square - power)
        level = math.log(max(power, floor))
        e = level - reference
        if age >= p.warm_up:
            out[i] = e
            e = min(max(e, -clip), clip)
        age = min(age + p.dt, p.tau_reference)
        reference += p.dt / age * e
    return out


def level_change(p: BandParams, x: FloatArray, usable: BoolArray) -> FloatArray:
    """Return the change of the band's power against its slow reference, as a natural logarithm.

    Parameters
    ----------
    x : array (n,)
        Wheel speed over the car's slow speed. NaN: the filter starts anew, 0.3 s without a value. [-]
    usable : bool array (n,)
        Elsewhere no value, and the reference is held.

    Returns
    -------
    change : array (n,)
        ln(P / P_ref), at most ln(1000); NaN for the first 4 s of usable samples. [-]
    """
    y: FloatArray = _level_change(p, np.ascontiguousarray(x, dtype=np.float64), usable, CLIP, CAP, POWER_FLOOR)
    return y


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per wheel; the statistic is the level of the oscillation over its reference. [dB]

    The torsional mode of a tyre lies at 30 to 60 Hz (K), partly beyond what a log of 100 Hz holds: the band is 15 to
    45 Hz, or less at a lower rate. The power is that of the wheel speed over the vehicle's; a shorter contact holds the
    wheel less, so that it oscillates more. Held under braking and below 36 km/h.

    Thesis [35].
    """
    p = BandParams.make(setup.dt)
    v_x = r.f["v_x_hat"]
    tracks = []
    for wheel in WHEELS:
        with np.errstate(invalid="ignore", divide="ignore"):
            usable = (v_x > V_MIN) & ~r.braking[wheel]
            x = r.f[f"v_w_delta_{wheel}"] / np.maximum(v_x, V_MIN)
        statistic = DB * level_change(p, x, usable)
        bits = alarm_bits(statistic, setup.threshold, dt=setup.dt)
        tracks.append(setup.track(statistic, bits, wheel=wheel))
    return tuple(tracks)


WHEEL_OSCILLATION = Detector(
    name="wheel_oscillation",
    title="high-frequency oscillation of the wheel",
    meaning="the wheel's rotational oscillation in a high band changes with the length of its contact",
    statistic="statistic",
    start=partial(WholeDrive, run=run),
    kind="rival",
    reference="[35]",
    unit="dB",
    threshold=THRESHOLD,
    needs=partial(needs_wheels, least=MIN_RATE),
    counterpart=MINOR_SPIN_DOWN,
)
