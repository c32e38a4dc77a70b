"""Recursions and the simulator."""

from __future__ import annotations

import importlib.util

import numpy as np

from tests.bench import ekf
from tests.bench.compare import Row

STEPS, SLOW_STEPS = 1_000_000, 10_000


def rows() -> list[Row]:
    """The filter of the slip slope, the simulator."""
    return [*_filter(), *_simulator()]


def _filter() -> list[Row]:
    big, small = ekf.drive(STEPS), ekf.drive(SLOW_STEPS)

    def ours() -> np.ndarray:
        return ekf.aqualog_slopes(big)[:SLOW_STEPS]

    def alike(a: np.ndarray, b: np.ndarray) -> str:
        # another draw of the noise: the first steps are compared on the small drive
        del a
        off = ekf.disagreement(ekf.aqualog_slopes(small), b)
        return "" if off < 1e-9 else f"slopes differ by {off:.1e}"

    def row(name: str, target: float, slopes: object) -> Row:
        return Row(
            "slip-slope filter (EKF, 3 states), per step", name, target, ours, lambda: slopes(small), alike,
            conditions=f"{STEPS:.0e} and {SLOW_STEPS:.0e} steps", rounds=5, work=STEPS, peer_work=SLOW_STEPS,
        )  # fmt: skip

    out = [row("plain Python", 100.0, ekf.python_slopes)]
    if importlib.util.find_spec("filterpy"):
        out.append(row("filterpy", 1000.0, ekf.filterpy_slopes))
    else:
        print("filterpy is not installed and is left out: pip install '.[bench]'")
    return out


def _simulator() -> list[Row]:
    from aqualog.model.scenario import Scenario
    from aqualog.model.simulate import simulate
    from aqualog.vehicle import Vehicle

    scenario = Scenario(Vehicle(name="sedan"), duration_s=120.0, rate_hz=100.0)
    return [Row(
        "four-wheel simulation with sensors", "real time", 200.0, lambda: simulate(scenario), 120.0,
        conditions="120 s, 5 ms steps, one core",
    )]  # fmt: skip
