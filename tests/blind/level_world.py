"""Campaigns for blind cases of the diagnosis on campaign level, from formulas of their own.

Nothing of the library's physics is called. The laws are the thesis' and its sources', but written otherwise: the tyre's
curve is a rational function and no brush, contact and depth are processes along the lane that are drawn and averaged
afterwards, the film's drag saturates smoothly, and the noise has heavy tails, an offset and a gain per run. So the model
is never exactly right, not even where nothing is hidden.
"""

import math
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.campaign.definition import Campaign, Run, with_load
from aqualog.campaign.jobs import Configured
from aqualog.campaign.results import CampaignData, RunInfo
from aqualog.core.vehicle import Vehicle

CAR = Vehicle(name="blind rwd", mass=1610.0, l_f=1.35, l_r=1.45, h_cg=0.53, rolling_resistance=0.0102)
CAR_AWD = Vehicle(
    name="blind awd", drivetrain="awd", torque_split_rear=0.55, mass=1790.0, l_f=1.38, l_r=1.45, h_cg=0.56,
    rolling_resistance=0.0108,
)  # fmt: skip
GRAVITY = 9.81
RHO = 1000.0
# room of the grooves [m], slope factor, their depth [mm]
TREADS = {
    "very_worn_summer": (0.25e-3, 1.03, 1.0), "worn_summer": (0.40e-3, 1.0, 1.6), "new_summer": (1.95e-3, 0.90, 7.8),
}  # fmt: skip
PLAN = (
    ("worn_summer", 1.9, 1.3, 0.0), ("worn_summer", 1.9, 2.0, 0.0), ("worn_summer", 1.9, 0.8, 0.0),
    ("worn_summer", 2.8, 1.3, 0.0), ("very_worn_summer", 1.9, 1.3, 0.0), ("worn_summer", 1.9, 1.3, 270.0),
    ("new_summer", 1.9, 2.0, 0.0), ("worn_summer", 1.9, 0.6, 0.0),
)  # fmt: skip


@dataclass(frozen=True)
class Hidden:
    """What the campaign hides; neutral: nothing. Gains on front and rear (`f`, `r`) or of a side (`left`)."""

    contact: dict[str, float] = field(default_factory=dict)
    drag: dict[str, float] = field(default_factory=dict)
    stiffness: dict[str, float] = field(default_factory=dict)
    depth: dict[str, float] = field(default_factory=dict)
    track: float = 0.0  # [m] more film in the front wheels' track
    hump: float = 0.0  # [m/s^2] resistance about 80 km/h, in no library


class Frames:
    """What a store is asked for: samples by key."""

    def __init__(self, frames):
        self.frames = frames

    def samples(self, key):
        return self.frames[key]


def campaign_of(rows, vehicles):
    """Campaign in memory of (name, vehicle path, values, lane, samples) rows."""
    runs, infos, frames = [], [], {}
    for i, (name, path, values, lane, samples) in enumerate(rows):
        run = Run((Path(name),), path, None, lane, values)
        runs.append(run)
        frames[name] = samples
        about = {"duration_s": float(samples["t"][-1]), "slip_against": "v_x", "signals": []}
        water = "lane times" if lane else "dry run"
        infos.append(RunInfo(i, name, run, name, "done", "", with_load(vehicles[path], run), about, water))
    configured = Configured(Campaign("blind", Path("blind.toml"), None, tuple(runs)), vehicles)
    return CampaignData(configured, Frames(frames), infos)


def world(seed, hidden=None, *, runs=64, car=CAR):
    """One campaign: passes over a lane at several speeds and accelerations, and some dry runs."""
    rng = np.random.default_rng([seed, 771])
    path = Path("car.toml")
    rows = []
    for k in range(runs + 4):
        tyre, bar, mm, load = PLAN[k % len(PLAN)]
        depth = mm * 1e-3 if k < runs else 0.0
        v = float(rng.uniform(60.0, 92.0)) / 3.6
        a = float(rng.choice([0.0, 0.0, 0.4, 0.8, 1.0])) if k < runs else 0.3 * (k - runs)
        share = float(rng.choice([0.6, 1.0]))
        values = {
            "tyre": tyre, "pressure_front_bar": bar, "pressure_rear_bar": bar, "water_depth_mm": depth * 1e3,
            "water_depth_left_mm": share * depth * 1e3, "load_front_kg": 0.0, "load_rear_kg": load,
        }  # fmt: skip
        lane = (4.0, 4.0 + 130.0 / v) if depth else None
        samples = _pass(rng, hidden or Hidden(), car, values, v, a, lane)
        rows.append((f"run_{k:03d}", path, values, lane, samples))
    return campaign_of(rows, {path: car})


def _pass(rng, hidden, car, values, v_mid, a, lane):
    dt = 0.02
    end = (lane[1] if lane else 8.0) + 3.0
    t = np.arange(0.0, end, dt)
    v = v_mid + a * (t - 0.5 * (sum(lane) if lane else end))
    wet = (t >= lane[0]) & (t < lane[1]) if lane else np.zeros(t.size, dtype=bool)
    load = values["load_rear_kg"]
    mass = car.mass + load
    rear_weight = (car.mass * car.l_f + load * car.wheelbase) / car.wheelbase * GRAVITY
    transfer = mass * a * car.h_cg / car.wheelbase
    loads = {"f": 0.5 * (mass * GRAVITY - rear_weight - transfer), "r": 0.5 * (rear_weight + transfer)}
    still = {"f": 0.5 * car.mass * GRAVITY * car.l_r / car.wheelbase}
    still["r"] = 0.5 * car.mass * GRAVITY - still["f"]
    capacity, factor, tread = TREADS[values["tyre"]]
    bar = values["pressure_rear_bar"]
    slope0 = 31.0 * factor * _softness(bar) / _softness(1.9)
    contact, slowing, water = {}, {}, np.zeros(t.size)
    for side, s in (("left", "l"), ("right", "r")):
        told = values["water_depth_left_mm" if side == "left" else "water_depth_mm"] * 1e-3
        depth = told * hidden.depth.get(side, 1.0) * np.maximum(1.0 + 0.05 * _ou(rng, v, dt, 5.0), 0.0)
        road = _ou(rng, v, dt, 0.4)
        film = depth
        for axle in "fr":
            scatter = 0.06 * (road + _ou(rng, v, dt, 0.4)) / math.sqrt(2.0)
            float_at = _floating(film, loads[axle], bar, capacity, tread) * (1.0 + scatter)
            lost = np.minimum((v / np.maximum(float_at, 1.0)) ** 3.5 * hidden.contact.get(axle, 1.0), 1.0)
            L = 1.0 - lost
            gain = hidden.drag.get(axle, 1.0)
            grooves = 1.0 - _outside(film, capacity)
            thrown = gain * RHO * 0.205 * _saturated(film, 0.5e-3) * (1.0 - 0.7 * grooves) * v * v
            half = 0.07 * math.sqrt(loads[axle] / 4000.0 * 2.2 / bar)
            lever = 0.45 * half * lost
            ahead = gain * RHO * 0.205 * np.maximum(film - 1.3e-3, 0.0) * v * v
            contact[axle + s], slowing[axle + s] = (
                np.where(wet, L, 1.0),
                np.where(wet, thrown + lever * loads[axle] / 0.317, 0.0),
            )
            water += np.where(wet, thrown + lever * loads[axle] / 0.317 + ahead, 0.0)
            left = 0.5e-3 + hidden.track
            behind = -left * np.expm1(-depth / left)
            film = (behind + (depth - behind) * lost**6) * np.maximum(1.0 + 0.3 * _ou(rng, v, dt, 1.0), 0.0)
    water += mass * np.where(wet, hidden.hump * np.exp(-(((v * 3.6 - 78.0) / 6.0) ** 2)), 0.0)
    air = 0.5 * car.drag_area * 1.204 * v * v
    pull = mass * a + air + car.rolling_resistance * mass * GRAVITY + water
    gain = 1.0 + 0.015 * rng.standard_normal()
    late = 0.08
    frame = {"t": t, "v_x": v, "a_x": np.full(t.size, a), "a_over_v": a / v}
    radius = 2e-4 * rng.standard_normal()
    for w in ("fl", "fr", "rl", "rr"):
        axle = w[0]
        share = 0.5 * (car.torque_split_rear if axle == "r" else 1.0 - car.torque_split_rear)
        told = share * pull / loads[axle] - car.rolling_resistance
        real = told - slowing[w] / loads[axle]
        slope = slope0 * (1.0 + 0.22 * (loads[axle] / still[axle] - 1.0)) * hidden.stiffness.get(axle, 1.0)
        friction = car.mu_max * np.where(wet, 0.8, 1.0) * contact[w] ** 2 * (3.0 - 2.0 * contact[w])
        slip = _inverse_curve(real, slope * contact[w] ** 2, friction)
        frame[f"slip_{w}"] = slip + radius + late * a / v + 2e-4 * rng.standard_t(4, t.size)
        frame[f"mu_{w}"] = gain * told + 2e-3 * rng.standard_normal(t.size)
    offset = 0.05 * rng.standard_normal()
    frame["delta_a_x"] = water / mass + (gain - 1.0) * pull / mass + offset + 0.06 * rng.standard_t(4, t.size)
    step = round(0.1 / dt)
    n = t.size // step
    thin = {k: _smooth(x, 15 if k[:4] in ("slip", "mu_f", "mu_r") else step)[: n * step].reshape(n, step).mean(axis=1)
            for k, x in frame.items() if k != "t"}  # fmt: skip
    for w in ("fl", "fr", "rl", "rr"):
        thin[f"spin_{w}"] = np.zeros(n, dtype=bool)
    return pl.DataFrame(
        {"t": t[: n * step].reshape(n, step).mean(axis=1), **thin, "reason": np.zeros(n, dtype=np.uint8)}
    )


def _softness(bar):
    """Slip slope over pressure: a published set's parabola."""
    d = bar / 2.2 - 1.0
    return 1.0 - 0.3485 * d + 0.378 * d * d


def _outside(film, room):
    """Share of the film that finds no room in the grooves."""
    return 1.0 - room / np.cbrt(room**3 + film**3)


def _floating(film, load, bar, room, tread):
    """Speed of floating: 120.5 km/h at 1.3 mm, 1.9 bar, 4 kN, 1.6 mm of tread; bulk water from 2 mm on."""

    def over_depth(h, groove):
        bulk = 0.49 + 0.82 * np.exp(-0.06 * np.log(1e3 * h))
        wedge = -np.expm1(-h * _outside(h, groove) / 0.15e-3)
        return bulk * (1.58 + (500.0 * h) ** 4) / (1.0 + (500.0 * h) ** 4) / wedge ** (2.0 / 7.0)

    channels = (1.0 + 0.0335 * tread) / (1.0 + 0.0335 * 1.6)
    depth = over_depth(np.maximum(film, 1e-5), room) / over_depth(1.3e-3, 0.4e-3)
    return 120.5 / 3.6 * (bar / 1.9) ** 0.3 * (load / 4000.0) ** 0.2 * channels * depth


def _saturated(h, top):
    """min(h, top) with a rounded corner."""
    x = h / top
    return top * x / (1.0 + x**16) ** (1.0 / 16.0)


def _inverse_curve(force, slope, peak):
    """Slip of F = C s / (1 + C |s| / 3 D) at a force per load; at small slip it bends as any tyre of bristles does."""
    peak, slope = np.maximum(peak, 1e-4), np.maximum(slope, 1e-2)
    ratio = np.clip(force / peak, -1.5, 1.5)
    return ratio * peak / slope / (1.0 - np.abs(ratio) / 3.0)


def _ou(rng, v, dt, length):
    keep, own = np.exp(-v * dt / length), rng.standard_normal(v.size)
    own[1:] *= np.sqrt(1.0 - keep[1:] ** 2)
    steps = zip(keep.tolist(), own.tolist(), strict=True)
    return np.array(list(accumulate(steps, lambda x, step: step[0] * x + step[1], initial=0.0)))[1:]


def _smooth(x, width):
    padded = np.pad(x, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")
