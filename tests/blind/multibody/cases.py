"""Blind cases: a car, a day, a drive and a held-out one, and what is hidden in both.

A case is a function of seed, number and kind alone. Detectability z of a hidden cause: both drives without noise, with
and without it; the difference of the residual channels over their noise, summed over frequencies in the best channel.
`z_own` is the same for what speed, its square, force and time together do not explain of the difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.vehicle import Vehicle

from .car import NO_ODD, Car, draw_car, of_the_day, vehicle_file
from .driver import ROWS, draw_style, drive_along
from .functions import points_of
from .hidden import DRY, KINDS, TWINS, Hidden, Setup, applied, draw, enlarged, in_worths, names_of
from .roads import Place, bends, build_road, speeds
from .sensors import NOISES, WHEELS, Message, coloured, gusts, ideal, measure

__all__ = ["KIND_NAMES", "Z_LEAST", "Case", "Plan", "detectability", "draw_plan", "drive", "make_case", "residuals"]

DT = 0.01
G = 9.81
KIND_NAMES = ("null", "known", "unknown", "compound", "mixed")
Z_LEAST = 8.0
LARGEST = 6.0  # sizes worth naming: a cause that is not shown then stays weak, and its z says so
BLOCK = 20  # samples of 10 ms in a block of the residuals whose difference counts
_FAST = ("tone_ring", "turn_ripple")  # faster than blocks


class Plan(NamedTuple):
    """What a case is made from."""

    hidden: tuple[Hidden, ...]
    programme: str
    noise: str
    car: Car
    drivetrain: str
    seed: tuple[int, ...]
    duration_s: float


@dataclass(frozen=True, slots=True)
class Case:
    """Messages of the drive and of the held-out one, the vehicle file, the truth."""

    drive: list[Message]
    held: list[Message]
    vehicle: Vehicle
    truth: dict[str, object]


class Ride(NamedTuple):
    """What happened: rows of `driver.ROWS`, and the labels of the water every metre."""

    rows: np.ndarray
    label: np.ndarray


def draw_plan(
    seed: int, number: int, kind: str, *, wet: bool = False, held_back: bool = False, scale: float = 1.0,
    duration_s: float = 300.0,
) -> Plan:  # fmt: skip
    """Draw a case; with `wet` the water's effects, with `held_back` the forms that no development has seen."""
    key = (seed, number, KIND_NAMES.index(kind), int(wet), int(held_back))
    rng = np.random.default_rng(key)
    if kind == "mixed":
        kind = str(rng.choice(["null", "known", "unknown", "compound"], p=[0.25, 0.35, 0.25, 0.15]))
    car, drivetrain = draw_car(rng)
    noise = NOISES[rng.integers(len(NOISES))]
    names: tuple[str, ...] = ()
    if kind == "compound":
        pool = names_of(known=True)
        while not names or frozenset(names) in TWINS or not _programmes(names):
            names = tuple(pool[i] for i in rng.choice(len(pool), 2, replace=False))
    elif kind != "null":
        pool = names_of(known=kind == "known", wet=wet and kind == "known", held_back=held_back and kind == "unknown")
        names = (pool[rng.integers(len(pool))],)
    hidden = tuple(draw(n, rng, scale) for n in names)
    programmes = _programmes(names) if names else DRY
    programme = programmes[rng.integers(len(programmes))]
    return Plan(hidden, programme, noise, car, drivetrain, key, duration_s)


def _programmes(names: tuple[str, ...]) -> list[str]:
    return [p for p in KINDS[names[0]].programmes if all(p in KINDS[n].programmes for n in names)]


def make_case(plan: Plan, *, z_least: float = Z_LEAST) -> Case:
    """Drive it, with every hidden cause as large as a detectability of `z_least` asks for (0: as drawn)."""
    vehicle = vehicle_file(plan.car, plan.drivetrain, np.random.default_rng((*plan.seed, 3)))
    sized, shown = [], []
    for h in plan.hidden:
        h, z = _shown(plan, vehicle, h, z_least)
        sized.append(h)
        shown.append(z)
    hidden = tuple(sized)
    seen = [_seen(plan, vehicle, hidden, k) for k in (0, 1)]
    truth: dict[str, object] = {
        "hidden": [
            {"effect": h.name, "where": h.where, "values": dict(h.values), "known": KINDS[h.name].known,
             "held_back": KINDS[h.name].held_back, "accepts": KINDS[h.name].accepts, "channel": KINDS[h.name].channel,
             "depends_on": KINDS[h.name].depends_on, "points": points_of(h.name, _setup(plan, (h,), 0), seen[0]), **z}
            for h, z in zip(hidden, shown, strict=True)
        ],
        "programme": plan.programme, "noise": plan.noise, "seed": plan.seed, "electric": plan.car.is_electric > 0.5,
        "foreign_water": plan.programme == "wet",
    }  # fmt: skip
    return Case(seen[0], seen[1], vehicle, truth)


def _shown(plan: Plan, vehicle: Vehicle, h: Hidden, z_least: float) -> tuple[Hidden, dict[str, float]]:
    """The cause at a size that the drive shows, with its detectability; at most six sizes worth naming."""
    own = not KINDS[h.name].known
    z = detectability(plan, vehicle, h)
    for _ in range(2):
        least = z["z_own"] if own else z["z"]
        if least >= z_least or in_worths(h) >= 0.99 * LARGEST:
            break
        h = enlarged(h, min(1.1 * z_least / max(least, 1e-6), LARGEST / in_worths(h)))
        z = detectability(plan, vehicle, h)
    return h, {k: round(x, 2) for k, x in z.items()}


def detectability(plan: Plan, vehicle: Vehicle, h: Hidden) -> dict[str, float]:
    """`z` and `z_own` of one hidden cause in the first drive of a plan."""
    block = 2 if h.name in _FAST else BLOCK
    clean = [_clean(plan, vehicle, of) for of in ((h,), ())]
    with_it, without, noise = (
        residuals(m, vehicle, block, plan.duration_s) for m in (*clean, _seen(plan, vehicle, (), 0))
    )
    forms = _forms(_on_a_grid(clean[1], plan.duration_s), block)
    best, own = 0.0, 0.0
    for name, x in with_it.items():
        d = x - without[name]
        rest = d - forms @ np.linalg.lstsq(forms, d, rcond=None)[0]
        best, own = max(best, _energy(d, noise[name])), max(own, _energy(rest, noise[name]))
    return {"z": float(np.sqrt(best)), "z_own": float(np.sqrt(own))}


def _energy(d: np.ndarray, noise: np.ndarray) -> float:
    """Energy of a difference over the noise's spectrum, smoothed over an octave's third."""
    n = d.size
    level = np.abs(np.fft.rfft(noise - noise.mean())) ** 2
    f = np.arange(level.size)
    low, high = np.maximum((f / 1.25).astype(int), 1), np.minimum((f * 1.25).astype(int) + 8, level.size)
    total = np.concatenate([[0.0], np.cumsum(level)])
    smooth = (total[high] - total[low]) / np.maximum(high - low, 1)
    weight = np.full(f.size, 2.0)
    weight[0] = 1.0
    if n % 2 == 0:
        weight[-1] = 1.0
    return float(np.sum(weight * np.abs(np.fft.rfft(d)) ** 2 / np.maximum(smooth, 1e-30)) / 2.0)


def _forms(x: Mapping[str, np.ndarray], block: int) -> np.ndarray:
    v = _blocks(x["v_x"], block)
    force = _blocks(sum(x[f"torque_{w}"] for w in WHEELS), block)
    t = np.linspace(0.0, 1.0, v.size)
    return np.stack([np.ones(v.size), t, v, v * v, force], axis=1) / np.array([1.0, 1.0, 30.0, 900.0, 1000.0])


def _blocks(x: np.ndarray, block: int) -> np.ndarray:
    m = x.size // block
    return x[: m * block].reshape(m, block).mean(axis=1)


def residuals(messages: list[Message], vehicle: Vehicle, block: int, seconds: float) -> dict[str, np.ndarray]:
    """Channels of a log of so many seconds against the vehicle file, as means over blocks of samples of 10 ms."""
    x = _on_a_grid(messages, seconds)
    v, gain = x["v_x"], vehicle.torque_gain
    rim = {w: x[f"omega_{w}"] * vehicle.r_e(w) for w in WHEELS}
    pull = sum(
        (gain * x[f"torque_{w}"] - vehicle.inertia(w) * np.gradient(x[f"omega_{w}"], DT)) / vehicle.arm(w)
        for w in WHEELS
    )
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * v**2
    scrub = x["a_y"] * vehicle.l_r / vehicle.wheelbase * np.sin(x["steer_angle"])
    expected = (pull - drag) / vehicle.mass - vehicle.rolling_resistance * G * np.tanh(v / 0.5) - scrub
    mean = sum(rim.values()) / 4.0
    out = {"force_balance": x["a_x"] - expected, "kinematic": x["a_x"] - np.gradient(mean, DT)}
    for w in WHEELS:
        side = 0.5 * vehicle.track if w[1] == "l" else -0.5 * vehicle.track
        load = 0.5 * vehicle.mass * G * (vehicle.l_r if w[0] == "f" else vehicle.l_f) / vehicle.wheelbase
        slope = vehicle.slip_slope_f if w[0] == "f" else vehicle.slip_slope_r
        along = v - x["yaw_rate"] * side
        turn = vehicle.inertia(w) * np.gradient(x[f"omega_{w}"], DT)
        out[f"slip_{w}"] = rim[w] - along * (1.0 + (gain * x[f"torque_{w}"] - turn) / (vehicle.arm(w) * slope * load))
    out["lateral"] = x["a_y"] - v * x["yaw_rate"]
    moving = v > 2.0
    return {n: _blocks(np.where(moving, r, 0.0), block) for n, r in out.items()}


def _on_a_grid(messages: list[Message], seconds: float) -> dict[str, np.ndarray]:
    t = 0.2 + DT * np.arange(round((seconds - 0.5) / DT))
    return {s: np.interp(t, m.t, x) for m in messages for s, x in m.columns.items()}


def _clean(plan: Plan, vehicle: Vehicle, hidden: tuple[Hidden, ...]) -> list[Message]:
    ride = _ride(plan, vehicle, hidden, 0, smooth=True)
    setup = _setup(plan, hidden, 0)
    return ideal(ride.rows, setup.car, setup.errors, np.random.default_rng((*plan.seed, 8)))


def _seen(plan: Plan, vehicle: Vehicle, hidden: tuple[Hidden, ...], index: int) -> list[Message]:
    """Messages of drive `index` as the logger has them."""
    ride = _ride(plan, vehicle, hidden, index, smooth=False)
    setup = _setup(plan, hidden, index)
    messages = measure(ride.rows, setup.car, setup.errors, plan.noise, np.random.default_rng((*plan.seed, 9, index)))
    if plan.programme != "wet":
        return messages
    base = plan.car.l_f + plan.car.l_r
    way = ride.rows[:, ROWS["way"]]
    front, rear = (ride.label[np.clip(np.rint(way + x).astype(int), 0, len(ride.label) - 1)] for x in (base, 0.0))
    wet = ((front.max(axis=1) > 0.0) | (rear.max(axis=1) > 0.0)).astype(float)
    columns = {"water_depth_left": front[:, 0], "water_depth_right": front[:, 1], "on_water": wet}
    return [*messages, Message("lane", np.arange(way.size) * DT, columns)]


def drive(plan: Plan, vehicle: Vehicle, index: int = 0, *, smooth: bool = False) -> np.ndarray:
    """Rows of what happens in drive `index` of a plan; `smooth`: no unevenness and no wind."""
    return _ride(plan, vehicle, plan.hidden, index, smooth=smooth).rows


def _setup(plan: Plan, hidden: tuple[Hidden, ...], index: int) -> Setup:
    car = of_the_day(plan.car, np.random.default_rng((*plan.seed, 4, index)))
    driven = {"rwd": (2, 3), "fwd": (0, 1), "awd": (0, 1, 2, 3)}[plan.drivetrain]
    return applied(Setup(car, NO_ODD, Place(), {}, driven), hidden)


def _ride(plan: Plan, vehicle: Vehicle, hidden: tuple[Hidden, ...], index: int, *, smooth: bool) -> Ride:
    setup = _setup(plan, hidden, index)
    stays = any(KINDS[h.name].on_the_road for h in plan.hidden)
    rng = np.random.default_rng((*plan.seed, 5, index))
    pull = {"rwd": 2.8, "fwd": 2.2, "awd": 3.2}[plan.drivetrain]
    target, coast = speeds(plan.programme, rng, plan.duration_s, pull)
    n = round(plan.duration_s / DT)
    lateral = bends(plan.programme, rng, n)
    unrest = rng.uniform(0.04, 0.12) * coloured("ou1", n, DT, rng)
    wander = rng.uniform(2e-4, 8e-4) * coloured("ou1", n, DT, rng)
    style = draw_style(rng)
    wind = np.zeros(n) if smooth else gusts(plan.noise, n, rng)
    road_rng = np.random.default_rng((*plan.seed, 6, 0 if stays else index))
    # the longest way of any drive of the case, so that a road is the same for all
    fine, slow, label = build_road(plan.programme, road_rng, 45.0 * plan.duration_s + 300.0, setup.place)
    if smooth:
        fine = np.zeros_like(fine)
    knows = np.array(
        [vehicle.mass, 0.5 * vehicle.air_density * vehicle.drag_area, vehicle.rolling_resistance, vehicle.r_e_f]
    )
    rows = drive_along(target, coast, lateral, unrest, wander, wind, fine, slow, setup.car, setup.odd, style, knows)
    if not np.isfinite(rows).all():
        raise ArithmeticError(f"a drive of {plan.programme} diverged, seed {plan.seed}")
    return Ride(rows, label)
