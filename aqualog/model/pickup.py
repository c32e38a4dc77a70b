"""Wheel-speed pick-ups: a toothed ring, the times of its edges, and the speed that a controller computes from them."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["OMEGA_MIN", "edge_times", "reported_speed", "ring_angles", "rolled_angle"]

TURN = 2.0 * math.pi
OMEGA_MIN = 1.5  # [rad/s] 1.7 km/h; what is slower is reported as standstill (K)


def rolled_angle(omega: FloatArray, *, dt: float) -> FloatArray:
    """Return the angle of a wheel since the first sample, by the trapezoidal rule.

    Parameters
    ----------
    omega : array (n,)
        Wheel speed on an even grid. [rad/s]
    dt : float
        [s]

    Returns
    -------
    angle : array (n,)
        [rad]
    """
    return np.concatenate(([0.0], np.cumsum(0.5 * dt * (omega[1:] + omega[:-1]))))


def ring_angles(pattern: FloatArray, *, phase: float, tone_ring: float) -> FloatArray:
    """Return wheel angles in the first turn of the ring at which its teeth pass the pick-up.

    Parameters
    ----------
    pattern : array (teeth,)
        Fixed error of each tooth's place. [pitches]
    phase : float
        Place of the ring at wheel angle 0. [rad]
    tone_ring : float
        Relative amplitude of the once-per-turn error of the speed, < 1. [-]

    Returns
    -------
    angles : array (teeth,)
        The same plus whole turns in every other turn. [rad]

    The controller takes tooth j to be at theta_j = 2 pi j / teeth. It shows omega (1 + A sin psi), psi being the ring's
    angle, if theta = psi + A (1 - cos psi); the fixed-point iteration for psi gains a factor A per step.
    """
    theta = TURN * np.arange(pattern.size) / pattern.size
    psi = theta
    if tone_ring:
        for _ in range(12):
            psi = theta - tone_ring * (1.0 - np.cos(psi))
    return psi + pattern * (TURN / pattern.size) - phase


def edge_times(
    t: FloatArray, angle: FloatArray, ring: FloatArray, *, jitter: float, rng: np.random.Generator, before: float
) -> FloatArray:
    """Return times at which the teeth of a ring pass the pick-up.

    Parameters
    ----------
    t, angle : array (n,)
        Time on an even grid from 0; angle of the wheel. [s], [rad]
    ring : array (teeth,)
        From `ring_angles`. [rad]
    jitter : float
        rms of an edge's place, anew for each edge. [pitches]
    rng : Generator
        Gives the jitter: one number per edge from the start on, and backward in a stream of its own, so that neither
        a delay nor the length of the drive changes it.
    before : float
        Time before 0 that edges are needed for; the wheel is taken to have rolled at its first speed. [s]

    Returns
    -------
    edges : array (k,)
        Ascending. [s]

    Limits: a wheel that rolls backwards counts as standing until it is back. The angle is linear between the grid's
    points: at 100 rad/s² and 1 ms an edge is off by 1e-4 pitches at most.
    """
    teeth = ring.size
    pitch = TURN / teeth
    rolled = np.maximum.accumulate(angle)
    omega_0 = (rolled[1] - rolled[0]) / (t[1] - t[0])
    if omega_0 >= OMEGA_MIN:
        back = omega_0 * before + 3.0 * pitch
        t = np.concatenate(([t[0] - back / omega_0], t))
        rolled = np.concatenate(([rolled[0] - back], rolled))
    # one tooth more at either end: a tooth's own error is less than a pitch
    first, start, last = (math.floor((a - ring[0]) / pitch) for a in (rolled[0] - pitch, angle[0], rolled[-1] + pitch))
    j = np.arange(first, last + 1)
    # An error of place is an error of time relative to the pitch's duration, and stays small while a wheel stands.
    at = TURN * (j // teeth) + ring[j % teeth]
    if jitter > 0.0:
        backward, forward = rng.spawn(2)
        errors = (backward.standard_normal(start - first)[::-1], forward.standard_normal(last + 1 - start))
        at = at + jitter * pitch * np.concatenate(errors)
    at = at[(at > rolled[0]) & (at <= rolled[-1])]
    return np.maximum.accumulate(np.interp(at, rolled, t))


def reported_speed(edges: FloatArray, at: FloatArray, *, window: float, teeth: int) -> FloatArray:
    """Return the wheel speed that a controller reports.

    Parameters
    ----------
    edges : array (k,)
        Times of the edges, ascending. [s]
    at : array (m,)
        Times at which the report is made. [s]
    window : float
        Period of the reports. [s]

    Returns
    -------
    omega : array (m,)
        [rad/s] Between the last edge and the last edge one window ago, with the ring's nominal pitch.

    It lags by half a window and half a pitch's duration, as the real one does. Limits: no edge in the window: the
    speed of the last two edges, but not above one pitch in the time since; below `OMEGA_MIN`: 0. The first window
    after a standstill begins at the edge before it and shows too little.
    """
    if edges.size < 2:
        return np.zeros(at.size)
    pitch = TURN / teeth
    last = np.searchsorted(edges, at, side="right") - 1
    known = last >= 1
    last = np.maximum(last, 1)
    window_start = np.searchsorted(edges, at - window, side="right") - 1
    start = np.clip(window_start, 0, last - 1)
    omega = pitch * (last - start) / np.maximum(edges[last] - edges[start], 1e-9)
    since = np.maximum(at - edges[last], 1e-9)
    omega = np.where(window_start >= last, np.minimum(omega, pitch / since), omega)
    return np.where(known & (omega >= OMEGA_MIN), omega, 0.0)
