"""Active excitation: one axle gains what the other loses, so that the car keeps its acceleration (thesis 3.3).

Waveforms are of unit amplitude and in phase: zero at t = 0, then positive for half a period (the step is at once at 1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray

__all__ = [
    "AMPLITUDE_KINDS", "WAVEFORMS", "axle_forces", "excitation_amplitude", "excitation_force_amplitude", "f_ramp",
    "f_sine", "f_step", "f_triangle", "force_rate", "waveform",
]  # fmt: skip


def f_triangle(t: FloatArray, *, period: float) -> FloatArray:
    """Triangle of unit amplitude.

    Parameters
    ----------
    t : array
        Time, of either sign. [s]
    period : float
        tau > 0. [s]

    Returns
    -------
    f : array
        -1 ... 1; rms 1 / sqrt(3). [-]

    Limits: 0 at t = 0, 1 at tau / 4, 0 at tau / 2, -1 at 3 tau / 4, as the sine.

    Thesis: Eq. (3.35) with the floored modulo, whose result has the sign of the divisor (E16): a truncated one would
    begin at 2.
    """
    u = 1.0 - np.mod(2.0 * t / period - 0.5, 2.0)
    return 2.0 * u * np.sign(u) - 1.0


def f_sine(t: FloatArray, *, period: float) -> FloatArray:
    """Sine of unit amplitude, sin(2 pi t / tau); rms 1 / sqrt(2). `t`, `period` as in `f_triangle`.

    Thesis: Eq. (3.36).
    """
    return np.sin(2.0 * np.pi / period * t)


def f_ramp(t: FloatArray, *, period: float) -> FloatArray:
    """Ramps and plateaus, 1.5 times the triangle held within -1 ... 1; rms sqrt(5) / 3.

    `t`, `period` as in `f_triangle`. A sixth of the period from 0 to 1, a sixth at 1, a third down to -1, a sixth
    there, a sixth back (E17).

    Thesis: Eq. (3.37). It repeats the line of `f_triangle`, so that it can be `inlined` by itself.
    """
    u = 1.0 - np.mod(2.0 * t / period - 0.5, 2.0)
    return np.minimum(np.maximum(1.5 * (2.0 * u * np.sign(u) - 1.0), -1.0), 1.0)


def f_step(t: FloatArray, *, period: float, printed_phase: bool = False) -> FloatArray:
    """Step between 1 and -1; rms 1.

    Parameters
    ----------
    t, period
        As in `f_triangle`.
    printed_phase : bool
        The phase as printed, -1 in the first half of the period; by default 1 there, as the other waveforms.

    Returns
    -------
    f : array
        1 in [0, tau / 2), 0 at tau / 2, -1 after. [-]

    Thesis: Eq. (3.38), of the opposite sign by default (E18).
    """
    f = np.sign(1.0 - np.mod(2.0 * t / period, 2.0))
    return -f if printed_phase else f


WAVEFORMS: dict[str, Callable[..., FloatArray]] = {
    "triangle": f_triangle,
    "sine": f_sine,
    "ramp": f_ramp,
    "step": f_step,
}

AMPLITUDE_KINDS = {"force": 0, "mu": 1, "relative": 2}


def waveform(name: str, t: FloatArray, *, period: float) -> FloatArray:
    """Return the waveform by its name in `WAVEFORMS`; the step in phase with the others."""
    if name not in WAVEFORMS:
        raise ConfigError(f"unknown waveform {name!r}", expected=", ".join(WAVEFORMS))
    return WAVEFORMS[name](t, period=period)


_RATES = {"triangle": 4.0, "sine": 2.0 * np.pi, "ramp": 6.0, "step": np.inf}


def force_rate(name: str, *, amplitude: float, period: float) -> float:
    """Return the largest rate of change of the excitation force: with the jump of the step, passengers feel it.

    Parameters
    ----------
    name : str
        In `WAVEFORMS`.
    amplitude, period : float
        [N], [s]

    Returns
    -------
    rate : float
        4 A / tau (triangle), 2 pi A / tau (sine), 6 A / tau (ramp); infinite for the step, which jumps by 2 A. [N/s]

    Thesis: derivatives of Eq. (3.35) to (3.38); section 3.3 asks for small change rates (C99, C107).
    """
    if name not in WAVEFORMS:
        raise ConfigError(f"unknown waveform {name!r}", expected=", ".join(WAVEFORMS))
    return _RATES[name] * amplitude / period


def axle_forces(F_sum: FloatArray, F_exc: FloatArray, *, nu: float) -> tuple[FloatArray, FloatArray]:
    """Longitudinal forces of both axles under excitation.

    Parameters
    ----------
    F_sum : array
        Total force that the driver requests, forward positive. [N]
    F_exc : array
        Excitation; positive loads the front axle. [N]
    nu : float
        Share of the REAR axle, 0 ... 1; nu = 0 is front drive (E19). [-]

    Returns
    -------
    F_x_f, F_x_r : array
        (1 - nu) F_sum + F_exc and nu F_sum - F_exc. Their sum is F_sum whatever the excitation. [N]

    Thesis: Eq. (3.26), (3.27).
    """
    return (1.0 - nu) * F_sum + F_exc, nu * F_sum - F_exc


def excitation_force_amplitude(
    kind: int, amplitude: float, F_0_f: FloatArray, F_0_r: FloatArray, F_z_f: FloatArray, F_z_r: FloatArray
) -> FloatArray:
    """Return `excitation_amplitude` with the number of the kind, for compiled code."""
    if kind == 1:
        return amplitude * np.minimum(F_z_f, F_z_r)
    if kind == 2:
        return amplitude * np.minimum(np.abs(F_0_f), np.abs(F_0_r))
    return amplitude + 0.0 * F_0_f


def excitation_amplitude(
    kind: str, amplitude: float, F_0_f: FloatArray, F_0_r: FloatArray, F_z_f: FloatArray, F_z_r: FloatArray
) -> FloatArray:
    """Amplitude of the excitation as a force, A_exc.

    Parameters
    ----------
    kind : str
        "force": an absolute force [N]; "mu": a traction coefficient, of the axle that carries less; "relative": a share
        of the smaller nominal axle force.
    amplitude : float
        >= 0. [N] or [-]
    F_0_f, F_0_r : array
        Nominal axle forces without excitation. [N]
    F_z_f, F_z_r : array
        Static axle loads. [N]

    Returns
    -------
    A : like F_0_f
        >= 0. [N]

    Limits: "relative" up to 1 keeps the sign of both axle forces (C110), and is 0 with one driven axle; "mu" bounds the
    traction coefficient that the excitation adds on either axle, and may turn forces negative.

    Thesis: section 3.3 on (3.34); it does not say to which axle a coefficient or a share refers.
    """
    if kind not in AMPLITUDE_KINDS:
        raise ConfigError(f"unknown kind of amplitude {kind!r}", expected=", ".join(AMPLITUDE_KINDS))
    return excitation_force_amplitude(AMPLITUDE_KINDS[kind], amplitude, F_0_f, F_0_r, F_z_f, F_z_r)
