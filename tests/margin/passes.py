"""Passes through water with a known distance to full aquaplaning, of the simulator and of another one of other laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.model.drawing import KMH, SCORING_POOL, TUNING_POOL, Drawing
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane
from aqualog.model.simulate import simulate
from aqualog.model.situations import believed_vehicle
from aqualog.model.tyre import TYRES, Tyre
from aqualog.physics import contact, water
from aqualog.physics.load import G
from tests.blind.multibody import tyre as foreign
from tests.blind.multibody.car import NO_ODD, draw_car, of_the_day, vehicle_file
from tests.blind.multibody.driver import ROWS, drive_along
from tests.blind.multibody.roads import Place, build_road
from tests.blind.multibody.sensors import NOISES, gusts, measure

DISTANCE = (-8.0 * KMH, 55.0 * KMH)  # [m/s] below full aquaplaning at the entry
V_FULL = (60.0 * KMH, 150.0 * KMH)
V_LEAST = 50.0 * KMH
AGAIN = (15.0 * KMH, 45.0 * KMH)  # [m/s] below full aquaplaning, of further runs of a campaign
DT = 0.01
STAY = 4.0  # [s] in the water
# exponents of lost contact: as sources have it, early with a rest that stays for long, and late within few km/h
LAWS = ((1.5, 6.0), (0.1, 1.5), (6.0, 20.0))
STOP_L = 0.13  # [-] contact share at which a free wheel stops
FOREIGN_FROM = 500_000  # seeds of the other simulator, so that no number is used twice
# exponents of film and load of full aquaplaning: Horne's, Gallaway's, Yager's and USF's, PAVDRN's, Gengenbach's
PUBLISHED = ((0.0, 0.0), (0.06, 0.0), (0.06, 0.2), (0.26, 0.0), (0.5, 0.5))
_SPEEDS = np.arange(30.0, 260.0, 0.25) * KMH


@dataclass(frozen=True, slots=True)
class Pass:
    """One drive over a lane: signals (n,) every `dt` [s], the vehicle file, and the truth.

    `v_full` [m/s]: a front wheel that rolls freely in the deeper track stops from there on. `wet`: time in which the
    front axle is on the lane [s].
    """

    columns: Mapping[str, np.ndarray]
    vehicle: Vehicle
    v_full: float
    wet: tuple[float, float]
    dt: float = DT


def first_stop(friction: np.ndarray, torque: np.ndarray) -> float:
    """Least of `_SPEEDS` at which the friction that is left no longer turns the wheel against the water. [m/s]"""
    stops = friction <= torque
    return float(_SPEEDS[int(np.argmax(stops))]) if stops.any() else float("inf")


def own_full(tyre: Tyre, vehicle: Vehicle, depth: float, p: float) -> float:
    """Full aquaplaning of a free front wheel in the simulator, by its laws on even water. [m/s]"""
    F_z = 0.5 * vehicle.mass * G * vehicle.l_r / vehicle.wheelbase
    end = tyre.full_speed(np.array(depth), np.array(F_z), p=p)
    L = contact.contact_share(_SPEEDS, end, exponent=tyre.contact_exponent)
    half = contact.contact_half_length(np.array(F_z), p=p, a_ref=tyre.half_length, F_z_ref=4000.0, p_ref=2.2e5)
    shift = contact.load_shift(L, half, arm=tyre.wedge_arm) / vehicle.r_e_f
    film = water.film_drag(
        np.array(depth), _SPEEDS, _SPEEDS, width=tyre.width, tread_capacity=tyre.tread_capacity, h_film=tyre.h_film,
        relief=tyre.groove_relief,
    )  # fmt: skip
    film = film * water.skimming_share(_SPEEDS, end)
    friction = vehicle.mu_max * tyre.mu_factor * tyre.wet_friction * contact.friction_ratio(L)
    return first_stop(friction * F_z, film + (shift + vehicle.rolling_resistance) * F_z)


def any_tyre(tyre: Tyre, rng: np.random.Generator, exponents: tuple[float, float]) -> Tyre:
    """A tyre whose laws of water, contact, drag and friction are drawn far wider than sources have them; `exponents`:
    ends of that of its lost contact."""

    def even(low: float, high: float) -> float:
        return float(low * (high / low) ** rng.uniform())

    v_anchor, pressure_exponent, thin_gain = tyre.v_anchor * even(0.85, 1.15), even(0.2, 0.5), even(0.2, 0.9)
    tread_gain, n = even(10.0, 50.0), even(*exponents)
    # contact that is lost early ends far beyond the speed at which a wheel stops, and that speed is to be any car's
    v_anchor *= (1.0 - STOP_L) ** (1.0 / LAWS[0][0] - 1.0 / min(n, LAWS[0][0]))
    drawn = replace(
        tyre, v_anchor=v_anchor, pressure_exponent=pressure_exponent, thin_gain=thin_gain, tread_gain=tread_gain,
        contact_exponent=n, wedge_arm=tyre.wedge_arm * 1.5 * rng.uniform() ** 2,
        h_film=even(0.15e-3, 1.0e-3), groove_relief=rng.uniform(0.2, 0.9), h_wave=even(0.8e-3, 4e-3),
        h_track=even(0.2e-3, 2.0e-3), width=tyre.width * even(0.1, 1.4), wet_friction=rng.uniform(0.65, 0.95),
        load_sensitivity=rng.uniform(0.0, 0.3), contact_scatter=even(0.001, 0.12), scatter_length=even(0.2, 2.0),
        track_irregularity=even(0.03, 0.4), slip_slope_factor=tyre.slip_slope_factor * even(0.8, 1.2),
    )  # fmt: skip
    # such a width stands for the drag alone
    return replace(drawn, v_anchor=drawn.v_anchor * (drawn.width / tyre.width) ** drawn.aspect_exponent)


def own_pass(
    seed: int, drivetrain: str | None = None, *, distance: tuple[float, float] = DISTANCE, law: int | None = None,
    run: int = 0, one_side: bool = False, stay: float = STAY,
) -> Pass:  # fmt: skip
    """A pass of the project's simulator at about one speed: tyre, pressure, water and car are drawn.

    `law`: one of `LAWS`, with the others drawn by `any_tyre`, to learn from. `run`: another pass of the same tyre,
    water and car. `one_side`: no water on the left. `stay`: time in the water. [s]
    """
    broad = law is not None
    rng = np.random.default_rng([seed, 79 if broad else 77])
    pool = (SCORING_POOL, TUNING_POOL)[int(rng.integers(2))]
    cars = [c for c in pool.vehicles if drivetrain in (None, c.drivetrain)]
    car = cars[int(rng.integers(len(cars)))]
    car = replace(car, mass=car.mass * rng.uniform(0.9, 1.1), drag_area=car.drag_area * rng.uniform(0.9, 1.1))
    away = rng.uniform(*distance)
    while True:
        tread = rng.uniform(1.0e-3, 8.0e-3)
        tyre = replace(TYRES["worn_summer"], tread_depth=tread, slip_slope_factor=1.03 - 0.018e3 * (tread - 1e-3),
                       width=rng.uniform(0.185, 0.235))  # fmt: skip
        tyre = tyre if law is None else any_tyre(tyre, rng, LAWS[law])
        depth, p = float(np.exp(rng.uniform(np.log(0.6e-3), np.log(6e-3)))), rng.uniform(1.8e5, 2.8e5)
        full = own_full(tyre, car, depth, p)
        v = full - away
        if V_FULL[0] <= full <= V_FULL[1] and V_LEAST <= v <= 160.0 * KMH:
            break
    if run:
        rng = np.random.default_rng([seed, run, 77])
        v = full - rng.uniform(*AGAIN)
    k = Drawing(rng, pool, car, tyre, p, int(rng.integers(2**31)))
    approach = k.between(9.0, 16.0)
    a = k.between(-0.4, 0.4) if k.between(0.0, 1.0) < 0.3 else 0.0
    start = (v - a * 4.0) * (approach - 4.0) + 4.0 * (v - 2.0 * a)
    calm = float(0.03 ** k.rng.uniform()) if broad else 1.0
    lane = Lane(
        start, start + stay * v, in_metres=True, depth_left=depth * k.between(0.6, 1.0) * (not one_side), depth_right=depth,
        irregularity_left=calm * k.between(0.05, 0.4), irregularity_right=calm * k.between(0.03, 0.4 if broad else 0.15),
    )  # fmt: skip
    speed = ((0.0, v - 4.0 * a), (approach - 4.0, v - 4.0 * a), (approach, v), (approach + stay, v + stay * a))
    scenario = k.drive(approach + stay + 2.0, speed, lanes=(lane,))
    believed = believed_vehicle(scenario, rng)
    signals = as_signals(simulate(scenario), vehicle=believed)
    film = np.nan_to_num(signals.array("true_film_fr"))
    on = np.flatnonzero(film > 0.0) * signals.dt_ns * 1e-9
    columns = {s: signals.array(s) for s in signals.symbols}
    return Pass(columns, believed, full, (float(on[0]), float(on[-1])), signals.dt_ns * 1e-9)


def foreign_full(car, depth: float) -> float:
    """Full aquaplaning of a free front wheel of the other simulator. [m/s]"""
    F_z, gain = float(car.static[0]), float(car.contact_gain[0])
    lost = np.array([min(foreign.lost_share(v, depth, F_z, 4000.0, car.law) * gain, 1.0) for v in _SPEEDS])
    push = np.array([foreign.water_push(v, depth, car.law) for v in _SPEEDS]) * float(car.water_gain[0])
    pace = _SPEEDS / 30.0
    rolling = float(car.roll_0[0]) + car.roll_1 * pace + car.roll_4 * pace**4
    return first_stop(0.78 * float(car.mu[0]) * (1.0 - lost) * F_z, 0.6 * push + rolling * F_z)


def drawn_law(rng: np.random.Generator) -> np.ndarray:
    """A law of water for `tests.blind.multibody`, each part drawn by itself from published forms, as its `LAW`."""
    depth_load = PUBLISHED[int(rng.integers(len(PUBLISHED)))]
    contact = ((0.0, 1.0, rng.uniform(1.5, 6.0)), (rng.uniform(0.1, 0.5), 0.6, 1.0))[int(rng.integers(2))]
    drag = rng.uniform(30.0, 250.0), (1.0, 0.5)[int(rng.integers(2))], (2.0, 1.0)[int(rng.integers(2))]
    return np.array([rng.uniform(24.0, 42.0), *depth_load, *contact, *drag, rng.uniform(1.0, 2.0)])


def foreign_pass(
    seed: int, drivetrain: str | None = None, *, distance: tuple[float, float] = DISTANCE, run: int = 0,
    any_law: bool = False,
) -> Pass:  # fmt: skip
    """A pass of `tests.blind.multibody`: other contact, drag and tyre laws, another driver and other sensors.

    `any_law`: with a law of water by `drawn_law` instead of its own.
    """
    rng = np.random.default_rng([seed + FOREIGN_FROM, 80 if any_law else 78])
    away = rng.uniform(*distance)
    while True:
        car, drive = draw_car(rng)
        if drivetrain not in (None, drive):
            continue
        vehicle = vehicle_file(car, drive, rng)
        gains = rng.uniform(0.7, 1.5), rng.uniform(0.6, 1.6)
        own = of_the_day(car, rng)._replace(
            contact_gain=np.full(4, gains[0]), water_gain=np.full(4, gains[1]), track_film=rng.uniform(2e-4, 6e-4)
        )
        own = own._replace(law=drawn_law(rng)) if any_law else own
        depth = float(np.exp(rng.uniform(np.log(0.6e-3), np.log(6e-3))))
        full = foreign_full(own, depth)
        v = full - away
        if V_FULL[0] <= full <= V_FULL[1] and V_LEAST <= v <= 160.0 * KMH:
            break
    if run:
        rng = np.random.default_rng([seed, run, 78])
        v = full - rng.uniform(*AGAIN)
    approach, stay = rng.uniform(9.0, 16.0), 4.0
    n = round((approach + stay + 2.0) / DT)
    base = own.l_f + own.l_r
    fine, slow, _ = build_road("country", rng, v * n * DT + 300.0, Place())
    first, last = round(v * approach), round(v * (approach + stay))
    rough = 1.0 + 0.1 * np.convolve(rng.standard_normal(last - first), np.full(5, 5**-0.5), mode="same")
    slow[first:last, 2] = depth * rng.uniform(0.6, 1.0) * rough
    slow[first:last, 3] = depth * rough
    style = np.array([0.3, 0.5, 0.5, 0.03, 0.15, 0.2, 0.4])
    knows = np.array(
        [vehicle.mass, 0.5 * vehicle.air_density * vehicle.drag_area, vehicle.rolling_resistance, vehicle.r_e_r]
    )
    noise = NOISES[int(rng.integers(len(NOISES)))]
    still = np.zeros(n)
    rows = drive_along(
        np.full(n + 200, v), np.zeros(n + 200), still, 0.06 * rng.standard_normal(n), still, gusts(noise, n, rng), fine,
        slow, own, NO_ODD, style, knows,
    )  # fmt: skip
    messages = measure(rows, own, {}, noise, rng)
    t = np.arange(0.05, n * DT - 0.05, DT)
    columns = {s: np.interp(t, m.t, x) for m in messages for s, x in m.columns.items()}
    way = np.interp(t, np.arange(n) * DT, rows[:, ROWS["way"]]) + base
    on = t[(way > first) & (way < last)] - t[0]
    return Pass(columns, vehicle, full, (float(on[0]), float(on[-1])))
