"""Test programmes as data: the drives of the thesis' chapter 2, and one of each situation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.model.drawing import KMH, slalom_angle
from aqualog.model.run import Run
from aqualog.model.scenario import Lane, Profile, Scenario, Steering
from aqualog.model.situations import SITUATIONS, TUNING_POOL, Drawn, draw
from aqualog.model.tyre import TYRES
from aqualog.model.tyre_tests import braking_test, curve_test, straight_test
from aqualog.model.water_numbers import drawn_tyre

__all__ = ["PROGRAMMES", "SCENES", "Run", "scene", "situations", "thesis"]

PRESSURES = {"low": 1.9e5, "medium": 2.3e5, "high": 2.8e5}  # [Pa] the thesis gives names only (K)
APPROACH_S = 4.0  # dry road before the lane
START_MIN = 1.0  # [m/s] a hard acceleration to a low speed begins so slowly, and has less dry road before the lane
LANE_M = 130.0  # about 4.5 s at 100 km/h (thesis Fig. 2.25)
RUN_OUT_S = 3.0
LEFT_SHARE = 0.6  # the left track has significantly less water, and less even (thesis 2.1; sizes K)
LEFT_IRREGULARITY, RIGHT_IRREGULARITY = 0.5, 0.05
# of the drives whose tie rods are looked at: a very good road, class A [iso8608_2016], and the rack's friction, 100 to
# 200 N (K). The contact of all others already fluctuates by what hopping wheels do (`contact_scatter`)
ROAD: dict[str, Any] = {"unevenness": 16e-6, "steering_friction": 150.0}  # [m^3], [N]

SEDAN = Vehicle(
    name="sedan RWD", drivetrain="rwd", torque_split_rear=1.0, mass=1680.0, l_f=1.32, l_r=1.48, h_cg=0.54, track=1.55,
    drag_area=0.66, rolling_resistance=0.0105, given=frozenset({"drivetrain"}),
)  # fmt: skip
SUV = Vehicle(
    name="SUV AWD", drivetrain="awd", torque_split_rear=0.6, mass=1950.0, l_f=1.40, l_r=1.41, h_cg=0.62, track=1.62,
    drag_area=0.91, rolling_resistance=0.0105, r_e_f=0.355, r_e_r=0.355, r_l_f=0.346, r_l_r=0.346, inertia_f=1.8,
    inertia_r=1.8, given=frozenset({"drivetrain"}),
)  # fmt: skip
SUV_REAR = replace(SUV, name="SUV AWD, drive to the rear", torque_split_rear=0.98)

CONSTANT = (60, 70, 80, 89, 98, 106, 112, 118, 124)
BETWEEN = (75, 84, 86, 92, 95, 101, 104, 109, 115)  # where spin-downs begin, minor and full ones
BINNED = (60, 70, 80, 90, 100, 110)
BINS = (65, 75, 85, 95, 105, 115)  # middles of the bins of 10 km/h in which slopes are estimated
REGRESSED = (0.0, 0.25, 0.5, 0.75, 1.0)  # [m/s^2] constant speed hardly varies the traction, one run is no interval
WEAR = {"very_worn_summer": "very_worn", "worn_summer": "worn", "new_summer": "new", "new_winter": "new"}


@dataclass(frozen=True, slots=True)
class _Case:
    """A configuration of car, tyres and water."""

    tyre: str = "worn_summer"
    pressure: str = "low"
    depth_mm: float = 1.3
    load_front: float = 0.0
    load_rear: float = 0.0
    vehicle: Vehicle = SEDAN


def thesis() -> tuple[Run, ...]:
    """Return the test programme of chapter 2, figure by figure; drives of several figures stand once."""
    runs: dict[str, Run] = {}
    for number, (case, kmh, a, repeat, manoeuvre, figures) in enumerate(_drives()):
        run = _run(case, kmh, a, repeat, manoeuvre, figures, seed=number + 1)
        if run.name in runs:
            old = runs[run.name]
            merged = ",".join(dict.fromkeys([*old.figures.split(","), *figures.split(",")]))
            runs[run.name] = replace(old, figures=merged)
        else:
            runs[run.name] = run
    return tuple(runs.values())


def situations() -> tuple[Run, ...]:
    """One drive of each situation, from the pool that thresholds are chosen with."""
    return tuple(_of_situation(draw(name, 1, TUNING_POOL)) for name in SITUATIONS)


def _of_situation(d: Drawn) -> Run:
    given = tuple((t.effect.name, tuple(sorted(t.values.items())), t.where) for t in d.model.terms)
    depth = max((max(lane.depth_left, lane.depth_right) for lane in d.scenario.lanes), default=0.0)
    return Run(f"{d.name}_1", d.scenario, d.name, "", depth, given, d.believed)


def thesis_drawn() -> tuple[Run, ...]:
    """The thesis' programme, each run on tyres drawn from what is known of the law of water (`water_numbers`)."""
    return tuple(replace(run, scenario=_on_drawn_tyres(run.scenario)) for run in thesis())


def _on_drawn_tyres(s: Scenario) -> Scenario:
    return replace(s, tyre_front=drawn_tyre(s.tyre_front, s.seed), tyre_rear=drawn_tyre(s.tyre_rear, s.seed))


PROGRAMMES: dict[str, Callable[[], tuple[Run, ...]]] = {
    "thesis": thesis, "thesis-drawn": thesis_drawn, "situations": situations,
    "straight-test": straight_test, "curve-test": curve_test, "braking-test": braking_test,
}  # fmt: skip

_Drive = tuple[_Case, float, float, int, str, str]


def _drives() -> Iterator[_Drive]:
    """Case, speed over the lane [km/h], acceleration [m/s²], number of the repeat, manoeuvre, figures."""
    worn = _Case()

    def constant(case: _Case, speeds: tuple[int, ...], repeats: int, figures: str) -> Iterator[_Drive]:
        return ((case, v, 0.0, k, "constant", figures) for v in speeds for k in range(repeats))

    def accelerated(case: _Case, speeds: tuple[int, ...], a: tuple[float, ...], figures: str) -> Iterator[_Drive]:
        return ((case, v, x, 0, "acceleration", figures) for v in speeds for x in a)

    def third(case: _Case, figures: str) -> Iterator[_Drive]:
        return ((case, v, 0.0, 2, "constant", figures) for v in BINNED)

    def binned(case: _Case, figures: str, speeds: tuple[int, ...] = BINS, k: int = 0) -> Iterator[_Drive]:
        return ((case, v, a, k, "acceleration" if a else "constant", figures) for v in speeds for a in REGRESSED)

    yield from constant(worn, CONSTANT, 3, "2.3,2.4,2.10,2.14,2.17")
    yield from accelerated(worn, (70, 80, 90, 100, 110, 120), (1.0,), "2.4")
    high = _Case(pressure="high")
    yield from constant(high, (80, 100, 120, 130), 2, "2.5,2.6")
    yield from accelerated(high, (80, 90, 100, 110, 120, 130), (2.0, 3.0, 4.0), "2.5,2.6,2.7")
    yield from constant(_Case(depth_mm=0.8), (60, 70, 80, 90, 100, 110, 120), 2, "2.8,2.9,2.17,2.25")
    for depth in (0.6, 0.8, 1.1, 1.3, 2.0):
        yield from constant(_Case("very_worn_summer", depth_mm=depth), BINNED, 2, "2.10,2.11,2.12,2.13,2.16")
    for depth in (1.1, 2.0):
        yield from constant(_Case("new_summer", depth_mm=depth), BINNED, 2, "2.12")
    for depth in (1.3, 2.0):
        yield from constant(_Case("new_winter", depth_mm=depth), BINNED, 2, "2.13")
        yield from accelerated(_Case("new_winter", depth_mm=depth), BINNED, (0.5,), "2.19")
        yield from accelerated(_Case(depth_mm=depth), BINNED, (0.5,), "2.17,2.19")
    for pressure in ("medium", "high"):
        yield from constant(_Case(pressure=pressure), BINNED, 2, "2.14")
    for pressure in ("low", "medium"):
        for front, rear in ((0.0, 0.0), (270.0, 0.0), (0.0, 270.0)):
            case = _Case(pressure=pressure, depth_mm=1.2, load_front=front, load_rear=rear)
            yield from constant(case, BINNED, 2, "2.15")
            yield from accelerated(case, BINNED, (0.5,), "2.20")
    for depth in (0.6, 0.8, 1.1):
        yield from accelerated(_Case(depth_mm=depth), BINNED, (0.5,), "2.17")
    for pressure in ("low", "medium", "high"):
        yield from accelerated(_Case(pressure=pressure, depth_mm=1.2), BINNED, (0.5,), "2.18")
    # dry references: moderate acceleration, for the slip slope and the calibration
    for case in (
        worn, _Case("very_worn_summer"), _Case("new_summer"), _Case("new_winter"), _Case(pressure="medium"), high,
        _Case(load_front=270.0), _Case(load_rear=270.0), _Case(vehicle=SUV),
    ):  # fmt: skip
        yield (replace(case, depth_mm=0.0), 90, 1.0, 0, "acceleration", "2.16")
    rear_drive = _Case(vehicle=SUV_REAR)
    for k in range(3):
        yield (rear_drive, 110, -0.4, k, "deceleration", "2.21")
        yield (_Case(vehicle=SUV), 112, 1.5, k, "acceleration", "2.22")
        yield (rear_drive, 104, 0.0, k, "slalom", "2.23")
    yield from constant(_Case(vehicle=SUV), BINNED, 2, "2.10")
    # slip slopes per bin: passes that vary the traction, five a bin (behind all others, whose seeds are their places)
    for depth in (0.6, 0.8, 1.1, 1.3, 2.0):
        yield from binned(_Case(depth_mm=depth), "2.17")
    for pressure in ("low", "medium", "high"):
        yield from binned(_Case(pressure=pressure, depth_mm=1.2), "2.18")
    for depth in (1.3, 2.0):
        yield from binned(_Case("new_winter", depth_mm=depth), "2.19")
    for pressure in ("low", "medium"):
        for front, rear in ((270.0, 0.0), (0.0, 270.0)):
            yield from binned(_Case(pressure=pressure, depth_mm=1.2, load_front=front, load_rear=rear), "2.20")
    yield from binned(_Case("very_worn_summer", depth_mm=0.8), "2.16", (95, 105))
    # a third pass where there were two, since two give no interval
    for depth in (0.6, 0.8, 1.1, 1.3, 2.0):
        yield from third(_Case("very_worn_summer", depth_mm=depth), "2.11,2.12,2.13")
    for depth in (1.1, 2.0):
        yield from third(_Case("new_summer", depth_mm=depth), "2.12")
    for pressure in ("medium", "high"):
        yield from third(_Case(pressure=pressure), "2.14")
    yield from constant(worn, BETWEEN, 3, "2.4")  # the thesis has passes at more speeds than it shows over time
    for k in (1, 2):  # five drives a bin leave the scatter of the slope above what a fall would be
        yield from binned(_Case("new_winter"), "2.19", k=k)


def _run(case: _Case, kmh: float, a: float, repeat: int, manoeuvre: str, figures: str, seed: int) -> Run:
    v = kmh * KMH
    on_lane_s = LANE_M / v
    approach = min(APPROACH_S, (v - START_MIN) / a - 0.5 * on_lane_s) if a > 0.0 else APPROACH_S
    duration = approach + on_lane_s + RUN_OUT_S
    depth = case.depth_mm * 1e-3
    half = approach + 0.5 * on_lane_s  # the speed of the name is reached in the middle of the lane
    speed = ((0.0, v),) if a == 0.0 else ((0.0, v - a * half), (duration, v + a * (duration - half)))
    start = approach * (v - a * half) + 0.5 * a * approach**2
    lane = Lane(
        start, start + LANE_M, in_metres=True, depth_left=LEFT_SHARE * depth, depth_right=depth,
        irregularity_left=LEFT_IRREGULARITY, irregularity_right=RIGHT_IRREGULARITY,
    )  # fmt: skip
    steering = None
    if manoeuvre == "slalom":  # 2 m/s^2 with a period of 4 s (thesis 2.4), by the steady gain of the two-track model
        steering = Steering(slalom_angle(case.vehicle, TYRES[case.tyre], v, 2.0), 4.0)
    p = PRESSURES[case.pressure]
    scenario = Scenario(
        case.vehicle, TYRES[case.tyre], TYRES[case.tyre], p, p, case.load_front, case.load_rear,
        duration_s=round(duration, 2), seed=seed, speed=speed, lanes=(lane,) if depth > 0 else (), steering=steering,
        **({} if case.vehicle is SEDAN else ROAD),
    )  # fmt: skip
    return Run(_name(case, kmh, a, repeat, manoeuvre), scenario, manoeuvre, figures, depth)


def _name(case: _Case, kmh: float, a: float, repeat: int, manoeuvre: str) -> str:
    car = {"sedan RWD": "rwd", "SUV AWD": "awd"}.get(case.vehicle.name, "awdr")
    load = f"_front{case.load_front:.0f}" if case.load_front else f"_rear{case.load_rear:.0f}" if case.load_rear else ""
    motion = {"constant": "const", "slalom": "slalom"}.get(manoeuvre, f"a{a:+.{1 if a == round(a, 1) else 2}f}")
    return f"{car}_{case.tyre}_{case.pressure}_{case.depth_mm:.1f}mm{load}_{kmh:03.0f}kmh_{motion}_{repeat + 1}"


LOW = 1.9e5  # [Pa]
WORN = TYRES["worn_summer"]


def scene(number: str) -> Scenario:
    """Return the drive of a figure.

    Raises
    ------
    ConfigError
        If there is no such scene.
    """
    if number not in _SCENES:
        raise ConfigError(f'no scene of figure "{number}"', expected=", ".join(SCENES))
    return _SCENES[number]()


def _sedan(kmh: float, *, entry_s: float, on_lane_s: float, a: float = 0.0) -> Scenario:
    """Rear-wheel drive on worn summer tyres with low pressure; 0.8 mm of water, less in the left track."""
    v, depth, end = kmh * KMH, 0.8 * 1e-3, entry_s + on_lane_s
    lane = Lane(entry_s, end, depth_left=LEFT_SHARE * depth, depth_right=depth, irregularity_left=0.3)
    speed: Profile = ((0.0, v), (entry_s, v), (end + 3.0, v + a * (on_lane_s + 3.0)))
    return _drive(SEDAN, speed, (lane,), end + 3.0, 3)


def _drive(
    car: Vehicle, speed: Profile, lanes: tuple[Lane, ...], duration_s: float, seed: int, **given: Any
) -> Scenario:
    return Scenario(car, WORN, WORN, LOW, LOW, duration_s=duration_s, seed=seed, speed=speed, lanes=lanes, **given)


def _deceleration() -> Scenario:
    """All-wheel drive with 2 % of the torque in front, straight on, slowing down slightly from 113 km/h (C61)."""
    lane = Lane(10.0, 15.0, depth_left=0.2e-3, depth_right=1.3e-3)
    return _drive(SUV_REAR, ((0.0, 113 * KMH), (10.0, 113 * KMH), (18.0, 104 * KMH)), (lane,), 18.0, 3, **ROAD)


def _two_accelerations() -> Scenario:
    """All-wheel drive, straight on: rolling at 18 s, a short push before 19 s, slower again, faster from 22.6 s (C62).

    60 % of the torque go to the front axle.
    """
    speed: Profile = (
        (0.0, 113 * KMH), (18.6, 113 * KMH), (19.1, 116 * KMH), (20.8, 116 * KMH), (22.6, 110 * KMH),
        (25.0, 129 * KMH), (28.0, 129 * KMH),
    )  # fmt: skip
    lane = Lane(17.5, 24.5, depth_left=1.3e-3, depth_right=1.3e-3)
    return _drive(SUV, speed, (lane,), 28.0, 5, split_rear=((0.0, 0.4),), **ROAD)


def _slalom() -> Scenario:
    """Slalom of 2 m/s² and 4 s, almost constant speed; water at 23 s, left from 26 s, right from 27 s on (C63).

    At 23 s the left track has less water, as on all lanes.
    """
    v = 112 * KMH
    steering = Steering(slalom_angle(SUV_REAR, WORN, v, 2.0), 4.0, 2.0)
    lanes = (
        Lane(22.9, 23.3, depth_left=LEFT_SHARE * 1.6e-3, depth_right=1.6e-3),
        Lane(26.0, 27.1, depth_left=1.2e-3, depth_right=0.3e-3),
        Lane(27.1, 29.0, depth_left=1.2e-3, depth_right=1.6e-3),
    )
    return _drive(SUV_REAR, ((0.0, v),), lanes, 32.0, 8, steering=steering, **ROAD)


_SCENES: dict[str, Callable[[], Scenario]] = {
    # full aquaplaning: front right spins down, rear right spins up; 0.8 mm (C28)
    "2.8": lambda: _sedan(118.0, entry_s=23.0, on_lane_s=4.0, a=0.5),
    # minor spin-downs of the front right wheel from the entry on, almost constant speed; 0.8 mm, 23 s (C33)
    "2.9": lambda: _sedan(104.0, entry_s=23.0, on_lane_s=5.0),
    "2.21": _deceleration,
    "2.22": _two_accelerations,
    "2.23": _slalom,
    # below full speed: rear slip rises, minor spin-downs front right; 0.8 mm, 24 s (C72-C77)
    "2.25": lambda: _sedan(119.0, entry_s=24.0, on_lane_s=6.0),
}
SCENES = tuple(_SCENES)
