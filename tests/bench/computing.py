"""The filter of the slip slope and the simulator."""

from __future__ import annotations

import numpy as np

from tests.bench import ekf
from tests.bench.compare import Row
from tests.bench.scale import Scale


def rows(scale: Scale) -> list[Row]:
    """The filter of the slip slope, the simulator."""
    return [*_filter(scale), *_simulator(scale)]


def _filter(scale: Scale) -> list[Row]:
    big, small = ekf.drive(scale.steps), ekf.drive(scale.slow_steps)

    def ours() -> np.ndarray:
        return ekf.aqualog_slopes(big)

    def alike(a: np.ndarray, b: np.ndarray) -> str:
        # another draw of the noise: the first steps are compared on the small drive
        del a
        off = ekf.disagreement(ekf.aqualog_slopes(small), b)
        return "" if off < 1e-9 else f"slopes differ by {off:.1e}"

    def row(name: str, target: float, slopes: object, *needs: str) -> Row:
        return Row(
            "slip-slope filter (EKF, 3 states), per step", name, target, ours, lambda: slopes(small), alike,
            conditions=f"{scale.steps:.0e} and {scale.slow_steps:.0e} steps, one thread", rounds=5, work=scale.steps,
            peer_work=scale.slow_steps, needs=needs,
        )  # fmt: skip

    return [
        row("plain Python", 100.0, ekf.python_slopes),
        row("filterpy", 1000.0, ekf.filterpy_slopes, "filterpy"),
    ]


def _simulator(scale: Scale) -> list[Row]:
    from aqualog.model.scenario import Scenario
    from aqualog.model.simulate import STEP_S, simulate
    from aqualog.vehicle import Vehicle

    seconds = scale.simulated_s
    scenario = Scenario(Vehicle(name="sedan"), duration_s=seconds, rate_hz=100.0)
    return [Row(
        "four-wheel simulation with sensors", "real time", 200.0, lambda: simulate(scenario), seconds,
        conditions=f"{seconds:g} s, {1e3 * STEP_S:g} ms steps, one core",
    )]  # fmt: skip
