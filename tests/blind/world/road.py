"""Roads: curves, hills, wet lanes and patches over the position, drawn by seed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .world import World

__all__ = ["Road", "build_road"]

DS = 0.5  # [m]
_LATERAL = {"mixed": 1.8, "hilly": 1.8, "motorway": 0.6, "handling": 2.2, "stop_and_go": 1.2, "wet": 0.5}  # [m/s^2]
_AHEAD, _BEHIND = 400.0, 300.0  # [m] room for a driver who is elsewhere than the plan


class Road(NamedTuple):
    """`grid` (m, 5): curvature [1/m], grade [rad], water left and right [m], patch force [N]; `label` (m, 2): water as
    measured before the drive [m]; both every `ds` [m] from the start."""

    grid: np.ndarray
    label: np.ndarray
    ds: float


def build_road(programme: str, seed: int, plan: np.ndarray, world: World) -> Road:
    """The road for a planned speed (n,) at 100 Hz [m/s], in a world."""
    s_plan = np.concatenate([[0.0], np.cumsum(plan) * 0.01])[:-1]
    m = int((s_plan[-1] * 1.25 + 1500.0) / DS)
    s = np.arange(m) * DS
    grid = np.zeros((m, 5))
    grid[:, 0] = _curvature(programme, np.random.default_rng([seed, 21]), s, s_plan, plan)
    grid[:, 1] = world.grade + _hills(np.random.default_rng([seed, 22]), s, world.hills_rms, world.hills_length)
    label = np.zeros((m, 2))
    if programme == "wet":
        label = _lanes(np.random.default_rng([seed, 23]), s)
        noise = np.random.default_rng([seed, 24])
        for side in (0, 1):
            wet = label[:, side] * world.depth_gain[side]
            rough = _field(noise, m, 3.0)
            grid[:, 2 + side] = np.maximum(wet * (1.0 + world.irregularity[side] * rough), 0.0)
    if world.patch_force != 0.0:
        x = s - world.patch_start
        if world.patch_period > 0.0:
            x = np.where(x >= 0.0, np.mod(x, world.patch_period), x)
        ramp = np.clip(np.minimum(x, world.patch_length - x) / 10.0 + 0.5, 0.0, 1.0)
        grid[:, 4] = world.patch_force * ramp
    return Road(grid, label, DS)


def _curvature(programme, rng, s, s_plan, plan):
    """Bends that ask for no more lateral acceleration than the programme allows at the fastest speed around there."""
    wanted = np.zeros(s.size)
    x = rng.uniform(60.0, 150.0)
    while x < s[-1]:
        length = rng.uniform(40.0, 160.0) if programme != "motorway" else rng.uniform(300.0, 800.0)
        near = (s_plan > x - _BEHIND) & (s_plan < x + length + _AHEAD)
        v = max(float(plan[near].max()) if near.any() else float(plan.max()), 6.0)
        a_y = _LATERAL[programme] * rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0])
        limit = 1.0 / 25.0
        wanted[(s >= x) & (s < x + length)] = np.clip(a_y / v**2, -limit, limit)
        x += length + rng.uniform(30.0, 200.0)
    return _smooth(wanted, 25.0)


def _hills(rng, s, rms, length):
    if rms == 0.0:
        return np.zeros(s.size)
    waves = np.zeros(s.size)
    for _ in range(7):
        period = length * rng.uniform(0.45, 2.2)
        waves += rng.uniform(0.5, 1.0) * np.sin(2.0 * np.pi * (s / period + rng.random()))
    return rms * waves / waves.std()


def _lanes(rng, s):
    """Wet lanes of 100 to 220 m; the left track has less water."""
    label = np.zeros((s.size, 2))
    x = rng.uniform(150.0, 250.0)
    while x < s[-1]:
        length = rng.uniform(100.0, 220.0)
        depth = rng.uniform(0.5e-3, 2.5e-3)
        inside = (s >= x) & (s < x + length)
        label[inside, 0] = depth * rng.uniform(0.6, 1.0)
        label[inside, 1] = depth
        x += length + rng.uniform(120.0, 350.0)
    return label


def _field(rng, m, length):
    """Random field of unit variance with a correlation length [m]."""
    x = _smooth(rng.standard_normal(m), length)
    return x / max(x.std(), 1e-12)


def _smooth(x, length):
    k = max(int(length / DS), 1)
    kernel = np.hanning(2 * k + 1)
    return np.convolve(x, kernel / kernel.sum(), mode="same")
