"""Programmes of the tyre tests: straight and curved aquaplaning, wet braking, with a control tyre between the sets."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.model.drawing import KMH, slalom_angle
from aqualog.model.run import Run
from aqualog.model.scenario import Lane, Scenario, Steering
from aqualog.model.tyre import TYRES

__all__ = ["CONTROL", "HATCH", "SALOON", "braking_test", "curve_test", "straight_run", "straight_test"]

CONTROL = "worn_summer"
"""The control tyre: driven first, last, and between the others."""
PRESSURE = 2.3e5  # [Pa]
STRAIGHT_DEPTH, CURVE_DEPTH, BRAKING_DEPTH = 7e-3, 6e-3, 1e-3  # [m] trade: 7; 4 to 10; about 1 mm
START_KMH, ACCELERATION = 40.0, 1.3  # [km/h, m/s²] full throttle in third or fourth gear (K)
DRY_S, LANE_S = 3.0, 14.0  # [s] of a straight run
RADIUS, TROUGH_M = 100.0, 20.0  # [m] of the circle; length of its trough (K)
CURVE_KMH = tuple(range(60, 95, 5))
PASSES, CONTROL_RUNS, RUNS = 3, 3, 6
FROM_KMH, TORQUE = 88.0, 6000.0  # [km/h, N·m] a stop begins there; more torque than the tyres can take

HATCH = Vehicle(
    name="hatch FWD", drivetrain="fwd", torque_split_rear=0.0, mass=1420.0, l_f=1.08, l_r=1.55, h_cg=0.53, track=1.54,
    drag_area=0.63, given=frozenset({"drivetrain"}),
)  # fmt: skip
SALOON = Vehicle(
    name="saloon RWD", drivetrain="rwd", torque_split_rear=1.0, mass=1680.0, l_f=1.32, l_r=1.48, h_cg=0.54, track=1.55,
    drag_area=0.66, given=frozenset({"drivetrain"}),
)  # fmt: skip


def straight_test() -> tuple[Run, ...]:
    """Full throttle over a lane with 7 mm of water in the right track and a dry left one, front- and rear-driven."""
    runs: list[Run] = []
    for car in (HATCH, SALOON):
        for tyre, repeat in _sets(others=RUNS, control=CONTROL_RUNS):
            seed = 10_000 + len(runs)
            name = f"straight_{car.drivetrain}_{len(runs) + 1:02d}_{tyre}_{repeat}"
            runs.append(Run(name, straight_run(car, tyre, seed), "straight-test", "", STRAIGHT_DEPTH))
    return tuple(runs)


def straight_run(car: Vehicle, tyre: str, seed: int) -> Scenario:
    """Return one run of the straight test; its acceleration scatters by 2 % from run to run."""
    a = ACCELERATION * (1.0 + 0.02 * float(np.random.default_rng(seed).standard_normal()))
    v, duration = START_KMH * KMH, DRY_S + LANE_S + 1.0
    return Scenario(
        car, TYRES[tyre], TYRES[tyre], PRESSURE, PRESSURE, duration_s=duration, seed=seed,
        speed=((0.0, v), (duration, v + a * duration)),
        lanes=(Lane(DRY_S, DRY_S + LANE_S, depth_left=0.0, depth_right=STRAIGHT_DEPTH),),
    )  # fmt: skip


def curve_test() -> tuple[Run, ...]:
    """A circle of 100 m with a trough of 6 mm: three passes each at 60, 65 ... 90 km/h, the control first and last."""
    runs: list[Run] = []
    for tyre in (CONTROL, "new_summer", "very_worn_summer", CONTROL):
        for kmh in CURVE_KMH:
            for repeat in range(PASSES):
                name = f"curve_{len(runs) + 1:03d}_{tyre}_{kmh}kmh_{repeat + 1}"
                runs.append(Run(name, _pass(tyre, kmh, 20_000 + len(runs)), "curve-test", "", CURVE_DEPTH))
    return tuple(runs)


def _pass(tyre: str, kmh: float, seed: int) -> Scenario:
    v = kmh * KMH
    lane = Lane(4.5, 4.5 + TROUGH_M / v, depth_left=CURVE_DEPTH, depth_right=CURVE_DEPTH)
    angle = slalom_angle(HATCH, TYRES[tyre], v, v * v / RADIUS)
    return Scenario(
        HATCH, TYRES[tyre], TYRES[tyre], PRESSURE, PRESSURE, duration_s=round(6.5 + TROUGH_M / v, 2), seed=seed,
        speed=((0.0, v),), lanes=(lane,), steering=Steering(angle, 3.0, 0.5, "hold"),
    )  # fmt: skip


def braking_test() -> tuple[Run, ...]:
    """Antilock stops from above 80 km/h on 1 mm of water: six of each tyre, the control first and last."""
    runs: list[Run] = []
    for tyre in (CONTROL, "new_summer", "new_winter", CONTROL):
        for repeat in range(RUNS):
            seed = 30_000 + len(runs)
            scenario = Scenario(
                HATCH, TYRES[tyre], TYRES[tyre], PRESSURE, PRESSURE, duration_s=8.0, seed=seed,
                speed=((0.0, FROM_KMH * KMH),), lanes=(Lane(1.0, 8.0, depth_left=BRAKING_DEPTH,
                depth_right=BRAKING_DEPTH),), brake_torque=((2.5, 0.0), (2.8, TORQUE)), antilock=True,
            )  # fmt: skip
            name = f"braking_{len(runs) + 1:02d}_{tyre}_{repeat + 1}"
            runs.append(Run(name, scenario, "braking-test", "", BRAKING_DEPTH))
    return tuple(runs)


def _sets(*, others: int, control: int) -> Iterator[tuple[str, int]]:
    """Tyre and number of each run: the control, then each other tyre with the control after it."""
    yield from ((CONTROL, k + 1) for k in range(control))
    for n, tyre in enumerate(t for t in TYRES if t != CONTROL):
        yield from ((tyre, k + 1) for k in range(others))
        yield from ((CONTROL, control * (n + 1) + k + 1) for k in range(control))
