"""The filter of the slip slope and the simulator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.bench import ekf
from tests.bench.compare import Row
from tests.bench.scale import Scale

Slopes = Callable[[object], np.ndarray]


def rows(scale: Scale) -> list[Row]:
    """The filter of the slip slope, the simulator."""
    return [*_filter(scale), *_simulator(scale)]


def _filter(scale: Scale) -> list[Row]:
    big, small = ekf.drive(scale.steps), ekf.drive(scale.slow_steps)

    def row(what: str, name: str, target: float, ours: Slopes, peer: Slopes, note: str, *needs: str) -> Row:
        def alike(a: np.ndarray, b: np.ndarray) -> str:
            # another draw of the noise: the first steps are compared on the small drive
            del a
            off = ekf.disagreement(ours(small), b)
            return "" if off < 1e-9 else f"slopes differ by {off:.1e}"

        return Row(
            f"slip-slope {what} (EKF, 3 states), per step", name, target, lambda: ours(big), lambda: peer(small), alike,
            conditions=f"{scale.steps:.0e} and {scale.slow_steps:.0e} steps, one thread; {note}", rounds=5,
            work=scale.steps, peer_work=scale.slow_steps, needs=needs,
        )  # fmt: skip

    alone = "the filter on both sides"
    scalar = f"{alone}; the peer's loop is scalar, in the shortest form, and gains no more than about 40 when compiled"
    more = (
        "beside the filter ours judges what can be estimated, carries two sums and gates; the peer has the filter alone"
    )
    return [
        row("filter", "plain Python", 100.0, ekf.filter_slopes, ekf.python_slopes, scalar),
        row("filter", "filterpy", 1000.0, ekf.filter_slopes, ekf.filterpy_slopes, alone, "filterpy"),
        row("estimator", "filterpy", 1000.0, ekf.aqualog_slopes, ekf.filterpy_slopes, more, "filterpy"),
    ]


def _simulator(scale: Scale) -> list[Row]:
    from aqualog.core.vehicle import Vehicle
    from aqualog.model.scenario import Scenario
    from aqualog.model.simulate import STEP_S, simulate

    seconds = scale.simulated_s
    scenario = Scenario(Vehicle(name="sedan"), duration_s=seconds, rate_hz=100.0)
    return [Row(
        "four-wheel simulation with sensors", "real time", 200.0, lambda: simulate(scenario), seconds,
        conditions=f"{seconds:g} s, {1e3 * STEP_S:g} ms steps, one core",
    )]  # fmt: skip
