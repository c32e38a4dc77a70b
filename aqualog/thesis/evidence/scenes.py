"""A scene of chapter 2 driven again and again, under all detectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from aqualog.calibrate.derive import calibrated
from aqualog.calibrate.design import prepare
from aqualog.calibrate.tie_rod import transfers
from aqualog.core.errors import FitError
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.slip_slope.history import History, remembered
from aqualog.detect.slip_slope.watch import Memory
from aqualog.detect.stream import detect_drive
from aqualog.model.drawing import KMH, slalom_angle
from aqualog.model.log import as_signals
from aqualog.model.programme import scene
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.simulate import simulate
from aqualog.thesis.claims import limit
from aqualog.thesis.evidence.campaign import DriveRun

__all__ = [
    "MANY", "SEEDS", "SOME", "SceneRun", "dry_and_wet", "in_runs", "known", "residual", "run_of", "runs", "scatter",
    "share", "spread", "stretches",
]  # fmt: skip

Speed = tuple[tuple[float, float], ...]  # (t [s], v [m/s])

SEEDS = tuple(range(3001, 3021))
"""The first one is drawn; claims are judged over all."""

DRY_SEED = 3000
MANY, SOME = limit("many"), limit("some")  # shares of the runs for "mostly" and for "at least in every other run"
_SLALOM_S, _DRY_S = 80.0, 80.0
_PUSH_S, _ROUND_S, _CHANGE_S = 5.0, 20.0, 12.0  # pushes of 1 m/s^2 and rolling out; changes of speed in the dry drive
_SETTLED_S = 5.0  # after which a drive has settled
_A_Y = 2.0  # [m/s^2] the slalom of the thesis' Figure 2.23
_FALL, _RISE = 70 * KMH, 110 * KMH  # [m/s] between which the dry drive varies


@dataclass(frozen=True, slots=True)
class Known:
    """Known parameters of a car before the wet drive.

    `vehicle` with the tie-rod polynomial of a dry slalom, `memory` with the slip slopes of a dry drive, `explained` the
    share of the variance of the dry rods that the polynomial explains. [-]
    """

    vehicle: Vehicle
    memory: Memory
    explained: float


@dataclass(frozen=True, slots=True)
class SceneRun(DriveRun):
    """One drive of a scene; entry and exit are those of its lanes."""

    seed: int
    scenario: Scenario

    @property
    def velocity(self) -> FloatArray:
        """The true velocity, array (n,). [m/s]"""
        return self.signal("true_v_x")


@lru_cache(maxsize=8)
def known(number: str) -> Known:
    """Parameters from dry drives of a scene's car on the same tyres, never from the wet drive.

    Raises
    ------
    FitError
        If the dry slalom gives no polynomial.
    """
    wet = scene(number)
    car = replace(wet.vehicle, given=wet.vehicle.given | {"drivetrain", "mass"})
    v = 0.5 * (_FALL + _RISE)
    steering = Steering(slalom_angle(car, wet.tyre_front, v, _A_Y), 4.0)
    # pushes, and rolling out without the brake: they determine the coefficient of the longitudinal force
    starts = np.arange(0.0, _SLALOM_S + _ROUND_S, _ROUND_S)
    pushes = tuple((float(t + after), share * v) for t in starts for after, share in ((0.0, 0.9), (_PUSH_S, 1.1)))
    slalom = _dry(wet, car, _SLALOM_S, pushes, steering)
    found, reasons = transfers([prepare(slalom, car, "dry slalom")], car)
    if "tie_rod" not in found:
        raise FitError("the dry slalom gives no tie-rod polynomial: " + "; ".join(reasons), where=f"figure {number}")
    shown = detect_drive(_dry(wet, car, _DRY_S, _turns(_DRY_S, _CHANGE_S, _RISE, _FALL), None), car)
    memory = Memory(remembered(History(), car.name, shown.slopes))
    return Known(calibrated(car, (), {"tie_rod": found["tie_rod"]}), memory, found["tie_rod"].explained)


def _turns(duration_s: float, every_s: float, first: float, second: float) -> Speed:
    """Speed that goes from one value to another and back. [s, m/s]"""
    times = np.arange(0.0, duration_s + every_s, every_s)
    return tuple((float(t), second if i % 2 else first) for i, t in enumerate(times))


def _dry(wet: Scenario, car: Vehicle, duration_s: float, speed: Speed, steering: Steering | None) -> Signals:
    dry = replace(
        wet, vehicle=car, duration_s=duration_s, speed=speed, steering=steering, lanes=(), seed=DRY_SEED, split_rear=()
    )
    return as_signals(simulate(dry), vehicle=car)


def run(number: str, seed: int) -> SceneRun:
    """A scene driven with other noise and another fluctuation of the contact, with the detectors' results."""
    return run_of(replace(scene(number), seed=seed), known(number))


def run_of(scenario: Scenario, car: Known) -> SceneRun:
    """A drive under all detectors."""
    signals = as_signals(simulate(scenario), vehicle=car.vehicle)
    result = detect_drive(signals, car.vehicle, memory=car.memory)
    lanes = scenario.lanes
    return SceneRun(result, signals.array("t"), lanes[0].start, lanes[-1].end, scenario.seed, scenario)


@lru_cache(maxsize=1)
def runs(number: str) -> tuple[SceneRun, ...]:
    """A scene over all `SEEDS`; only those of one scene are kept."""
    return tuple(run(number, seed) for seed in SEEDS)


def stretches(r: SceneRun, bits: BoolArray, *, gap_s: float = 0.05) -> list[slice]:
    """Where a bit is set, as slices; stretches less than a gap apart are one."""
    at = np.flatnonzero(bits)
    if not at.size:
        return []
    parts = np.split(at, np.flatnonzero(np.diff(r.t[at]) > gap_s + 1e-9) + 1)
    return [slice(int(p[0]), int(p[-1]) + 1) for p in parts]


def residual(r: SceneRun, wheel: str) -> FloatArray:
    """Measured minus calculated tie-rod force, array (n,). [N]"""
    return r.feature(f"tie_rod_meas_{wheel}") - r.feature(f"tie_rod_hat_{wheel}")


def scatter(r: SceneRun, wheel: str) -> float:
    """Root mean square of the residual on the dry road before the entry. [N]"""
    return float(np.sqrt(np.nanmean(residual(r, wheel)[r.within(_SETTLED_S, r.entry)] ** 2)))


def dry_and_wet(r: SceneRun, signal: str) -> tuple[float, float]:
    """Median of a signal on the settled dry road before the entry, and on the lane."""
    x = r.signal(signal)
    return float(np.nanmedian(x[r.within(2.0 * _SETTLED_S, r.entry)])), float(np.nanmedian(x[r.on_lane()]))


def share(all_runs: Sequence[SceneRun], holds: Callable[[SceneRun], bool]) -> float:
    """Share of the runs of which something is true. [-]"""
    return float(np.mean([holds(r) for r in all_runs]))


def in_runs(x: float) -> str:
    """A share in words: 17 of 20."""
    return f"{round(x * len(SEEDS))} of {len(SEEDS)}"


def spread(values: Sequence[float], digits: int = 2) -> str:
    """Median and range of the values that are there; how many are not."""
    there = [v for v in values if np.isfinite(v)]
    if not there:
        return "never"
    text = f"{np.median(there):.{digits}f} ({min(there):.{digits}f} to {max(there):.{digits}f})"
    missing = len(values) - len(there)
    return f"{text}, {missing} without" if missing else text
