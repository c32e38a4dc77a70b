"""Tuning of the slip-slope estimator, in seconds and per second, so that it holds at any sample rate."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["MEANINGS", "TUNING", "Params", "Tuning"]


class Tuning(NamedTuple):
    """Noise, prior knowledge and thresholds; k = 1 / C, beta slope ratio, delta offset of the differential slip."""

    # spectral density of the slip's noise: 5e-4 rms at 5 Hz with a correlation of 0.48 from sample to sample, measured
    # on a road (numbers (c)), is as much as white noise of this density
    r: float = 1.4e-7  # [s]
    # variance that a parameter's random walk gains per second
    q_k: float = 1e-8  # [1/s] 2.3 % of a dry slope in a minute
    q_beta: float = 1e-8  # [1/s] tyres warm up unevenly: 0.1 % in a minute
    q_delta: float = 1e-9  # [1/s] radii: follows a drift with a lag of about 12 s
    # standard deviations at the start
    sd_k: float = 0.01  # slopes of 25 to 50 about 33
    sd_beta: float = 0.05
    sd_delta: float = 5e-3  # radii in a vehicle file are right within half a per cent
    # standard deviation of k after an alarm: the step from a slope of 30 to one of 10 is 0.067
    sd_k_reset: float = 0.05
    # change detection: the prediction error beyond zeta, summed over time. zeta is half of what a step from a slope of
    # 30 to one of 10 shows at a differential traction of 0.03; an error of 2 zeta is found after h / zeta = 4 s
    zeta: float = 1.0e-3  # [-]
    h: float = 4.0e-3  # [s]
    adapted: bool = True  # (3.25) rather than (3.23)
    # after an alarm the offset, which is the car's, is not learnt for a while: what changed at once is the road
    tau_settle: float = 30.0  # [s]
    tau_sort: float = 5.0  # [s] then slope and offset are sorted out anew, in case it was a radius after all
    sd_delta_release: float = 2e-3
    rest: float = 0.25  # nor while a sum stands above this share of its threshold
    tau_fade: float = 10.0  # [s] evidence fades where nothing is seen
    # activation by the size of the differential traction and slip
    mu_min: float = 0.01  # [-] below, only the offset is learnt
    mu_max: float = 0.30  # [-]
    # off: the slip is the noisy one, and leaving out its small values picks the noise that makes it large
    s_min: float = 0.0  # [-] differential slip without its offset below which only the offset is learnt
    s_max: float = 0.05  # [-] beyond, a wheel spins
    # observability
    tau_window: float = 20.0  # [s]
    told_k: float = 0.2  # relative standard deviation of k in the window below which it may wander
    told_beta: float = 0.1


TUNING = Tuning()

MEANINGS: dict[str, tuple[str, str]] = {
    "r": (
        "s",
        "spectral density of the slip's noise: 5e-4 rms at 5 Hz, correlated by 0.48 from sample to sample, on a road",
    ),
    "q_k": ("1/s", "variance that 1/C gains per second"),
    "q_beta": ("1/s", "variance that the slope ratio of the axles gains per second"),
    "q_delta": ("1/s", "variance that the slip offset gains per second"),
    "sd_k": ("-", "standard deviation of 1/C at the start at a slope of 33, else in proportion to 1/C"),
    "sd_beta": ("-", "standard deviation of the slope ratio at the start"),
    "sd_delta": ("-", "standard deviation of the slip offset at the start"),
    "sd_k_reset": ("-", "standard deviation of 1/C after an alarm"),
    "zeta": ("-", "drift of the CUSUM on the slip's error"),
    "h": ("s", "threshold of that CUSUM"),
    "adapted": ("", "whether equation (3.25) of the thesis is used, rather than (3.23)"),
    "tau_settle": ("s", "the offset rests for this time after an alarm"),
    "tau_sort": ("s", "then slope and offset are separated anew, in case a radius has changed"),
    "sd_delta_release": ("-", "standard deviation for it, along the line on which both explain the same"),
    "rest": ("-", "the offset rests while a sum stands above this share of `h`"),
    "tau_fade": ("s", "evidence of a change fades in this time where no differential traction is seen"),
    "mu_min": ("-", "least differential traction that counts; below it only the offset is learnt"),
    "mu_max": ("-", "largest differential traction that counts"),
    "s_min": ("-", "least differential slip that counts"),
    "s_max": ("-", "largest differential slip that counts; beyond it a wheel spins"),
    "tau_window": ("s", "window of observability"),
    "told_k": ("-", "how well the window must determine 1/C: relative standard deviation"),
    "told_beta": ("-", "how well it must determine the slope ratio"),
}
"""Unit and meaning of each number."""


class Params(NamedTuple):
    """Per-step numbers; made by `Params.make`."""

    r: float
    r_density: float
    q_k: float
    q_beta: float
    q_delta: float
    P_k_reset: float
    zeta: float
    h: float
    adapted: bool
    settle: int
    sort: int
    fade: float
    g_trace: float
    sd_k: float
    P_delta_start: float
    P_delta_release: float
    h_rest: float
    mu_min: float
    mu_max: float
    s_min: float
    s_max: float
    keep: float
    told_k: float
    told_beta: float
    dt: float

    @staticmethod
    def make(tuning: Tuning, dt: float) -> Params:
        """Return the tuning at a sample time [s]."""
        t = tuning
        return Params(
            r=t.r / dt,
            r_density=t.r,
            q_k=t.q_k * dt,
            q_beta=t.q_beta * dt,
            q_delta=t.q_delta * dt,
            P_k_reset=t.sd_k_reset**2,
            zeta=t.zeta,
            h=t.h,
            adapted=t.adapted,
            settle=max(round(t.tau_settle / dt), 1),
            sort=max(round(t.tau_sort / dt), 1),
            fade=math.exp(-dt / t.tau_fade),
            g_trace=t.zeta * dt,
            sd_k=t.sd_k,
            P_delta_start=t.sd_delta**2,
            P_delta_release=t.sd_delta_release**2,
            h_rest=t.rest * t.h,
            mu_min=t.mu_min,
            mu_max=t.mu_max,
            s_min=t.s_min,
            s_max=t.s_max,
            keep=math.exp(-dt / t.tau_window),
            told_k=t.told_k,
            told_beta=t.told_beta,
            dt=dt,
        )
