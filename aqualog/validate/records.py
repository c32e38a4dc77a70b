"""Records of a validation: plots as data, signals of drives, and what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.validate.boundary import Tolerance

__all__ = [
    "ABSCISSAE", "AGREED", "PLOTS", "SIGNALS", "Judged", "Kind", "Limit", "Plan", "Plot", "Rated", "Spread", "Trace",
    "Validity", "Worst",
]  # fmt: skip


class Kind(NamedTuple):
    """Title and unit of a quantity."""

    title: str
    unit: str


_SLIP = "minus v_x, at the rim on the centre line"
SIGNALS: dict[str, Kind] = {
    "a_x": Kind("longitudinal accelerometer", "m/s^2"),
    "a_y": Kind("lateral accelerometer", "m/s^2"),
    "yaw_rate": Kind("yaw rate", "rad/s"),
    **{f"slip_{w}": Kind(f"wheel {w} {_SLIP}", "m/s") for w in WHEELS},
    "axle_slip": Kind("driven axle minus the other one, at the rim", "m/s"),
    "side_slip_f": Kind("front wheels, left minus right, at the rim", "m/s"),
    "side_slip_r": Kind("rear wheels, left minus right, at the rim", "m/s"),
    "tie_rod_fl": Kind("tie-rod force left", "N"),
    "tie_rod_fr": Kind("tie-rod force right", "N"),
}
"""What can be compared, in the order of the page."""

ABSCISSAE: dict[str, Kind] = {
    "t": Kind("time", "s"),
    "v_x": Kind("speed", "m/s"),
    "torque": Kind("sum of the wheel torques", "N*m"),
    "a_x": Kind("acceleration by the speed", "m/s^2"),
    "a_y": Kind("speed times yaw rate", "m/s^2"),
    "steer_angle": Kind("road-wheel angle", "rad"),
}
"""What a plot may go over. Measured and simulated car share it."""

AGREED = 0.95  # share of the time within the boundaries with which a range of speed counts as valid


@dataclass(frozen=True, slots=True)
class Plot:
    """A cross plot: `y` of `SIGNALS` over `x` of `ABSCISSAE`, and how far the measurement may be off."""

    y: str
    x: str
    tolerance: Tolerance

    @property
    def name(self) -> str:
        """`a_x over t`."""
        return f"{self.y} over {self.x}"


_T = 0.1  # [s] a block of the signals
# aqualog's own, not a standard's: what series sensors and a vehicle file with 5 % of error leave
_OWN = {
    "a_x": (0.1, 0.05), "a_y": (0.2, 0.05), "yaw_rate": (0.01, 0.05),
    **{n: (0.15, 0.1) for n in SIGNALS if "slip" in n}, "tie_rod_fl": (150.0, 0.1), "tie_rod_fr": (150.0, 0.1),
}  # fmt: skip
_OVER = {"v_x": 0.3, "torque": 30.0, "a_x": 0.1, "a_y": 0.1, "steer_angle": 0.002}
_CROSS = (
    ("a_x", "v_x"), ("a_x", "torque"), ("a_y", "steer_angle"), ("yaw_rate", "steer_angle"),
    *((n, "torque") for n in SIGNALS if "slip" in n and not n.startswith("side")),
    ("side_slip_f", "a_y"), ("side_slip_r", "a_y"), ("tie_rod_fl", "a_y"), ("tie_rod_fr", "a_y"),
)  # fmt: skip
PLOTS: tuple[Plot, ...] = (
    *(Plot(y, "t", Tolerance(_T, 0.0, *own)) for y, own in _OWN.items()),
    *(Plot(y, x, Tolerance(_OVER[x], 0.0, *_OWN[y])) for y, x in _CROSS),
)
"""The built-in plots: each signal over time, and over what it mainly depends on."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is asked: plots, the share of time that a valid range needs, and the signals whose tolerance the user gave.

    Drives that repeat each other give the tolerance of the other signals.
    """

    plots: tuple[Plot, ...] = PLOTS
    agreed: float = AGREED
    given: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Trace:
    """One drive in blocks: `measured` and `simulated` signal -> (m,), `judged` and `wet` (m,), `over` abscissa -> (m,).

    `step` of the blocks [s].
    """

    name: str
    step: float
    duration_s: float
    measured: Mapping[str, FloatArray]
    simulated: Mapping[str, FloatArray]
    over: Mapping[str, FloatArray]
    judged: BoolArray
    wet: BoolArray
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Worst:
    """The stretch of a drive that is farthest beyond: `by` [unit of the signal], positive above the top boundary."""

    drive: str
    signal: str
    by: float
    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Judged:
    """A plot against the drives: of `points` (blocks over time, else bins) the share within.

    `x`, `simulated`, `measured` (k,) are the curves of a plot that is not over time; `seconds` is what was judged.
    """

    plot: Plot
    points: int
    within: int
    seconds: float
    worst: Worst | None = None
    x: FloatArray | None = field(default=None, repr=False)
    simulated: FloatArray | None = field(default=None, repr=False)
    measured: FloatArray | None = field(default=None, repr=False)

    @property
    def share(self) -> float:
        """Share within; NaN without points."""
        return self.within / self.points if self.points else float("nan")


@dataclass(frozen=True, slots=True)
class Limit:
    """A condition (`dry`, `on water`) and the speed from which the simulation is not valid in it.

    `above` [m/s], NaN where it is valid; `low` and `high` [m/s] of what was driven; `share` within above that speed, or
    in all where it is valid; `seconds` judged in the condition.
    """

    condition: str
    above: float
    low: float
    high: float
    share: float
    seconds: float

    @property
    def is_valid(self) -> bool:
        """Whether no range of speed is left out."""
        return self.above != self.above


@dataclass(frozen=True, slots=True)
class Rated:
    """Ratings of a signal, as means over stretches weighed by their length. `delay_s`: positive, simulation late."""

    signal: str
    seconds: float
    total: float
    corridor: float
    phase: float
    magnitude: float
    slope: float
    delay_s: float


class Spread(NamedTuple):
    """What drives that repeat each other give: y_offset = t_factor sqrt(scatter² + noise²). [unit of the signal]"""

    y_offset: float
    repeated_drives: int | None
    t_factor: float
    scatter: float
    noise: float


@dataclass(frozen=True, slots=True)
class Validity:
    """What was found. `share` of the judged time with all signals within; `spread` of signals, from repetitions."""

    traces: tuple[Trace, ...]
    plan: Plan
    share: float
    seconds: float
    duration_s: float
    judged: tuple[Judged, ...]
    worst: Worst | None
    limits: tuple[Limit, ...]
    rated: tuple[Rated, ...]
    spread: Mapping[str, Spread]
    notes: tuple[str, ...] = ()

    @property
    def total(self) -> float:
        """Mean rating over all signals; NaN where none was rated."""
        return sum(r.total for r in self.rated) / len(self.rated) if self.rated else float("nan")
