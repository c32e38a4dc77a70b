"""What a detector is: its description, its needs, what it sees of a drive and what it returns."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from aqualog.core.notation import WHEELS, side_of
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import UNLOGGED
from aqualog.detect.events import Evidence, Explain, Severity, as_they_are
from aqualog.detect.slip_slope.history import Memory
from aqualog.features.stream import Features

__all__ = [
    "Detector", "Found", "JointCusumParams", "Kind", "Needs", "Output", "Scene", "Settings", "Setup", "Watch",
    "always_partial", "any_wheel", "missing_balance", "missing_drivetrain", "missing_torques", "missing_wheels",
    "too_slow", "traction",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class JointCusumParams:
    """Scales of the terms of joint detector 2; each term reaches 1 at its scale and no more.

    `third` is the third term of (2.11): `resistance`, as the text has it, or `variance`, a CUSUM of the variance
    difference, as its printed index says (E6). `with_slope` adds the lost share of the slip slope, an option in the
    thesis. `gated`: the sum warns only while the resistance gate is open. A wheel that is braked or spun on ice, or a
    bus that loses messages, fills several terms at once, and the thesis calls resistance necessary.
    """

    g_up: float = 1.5  # [m/s]
    g_down: float = 1.5  # [m/s]
    g_resistance: float = 0.3  # [m/s]
    var_low: float = 0.5  # [(m/s^2)^2] what tooth noise and rough asphalt leave of the difference
    var_high: float = 4.0
    g_variance: float = 1.0  # [(m/s^2)^2 s]
    loss_low: float = 0.25  # [-] what load, grip and noise of the estimate cost on dry road
    loss_high: float = 0.75
    third: Literal["resistance", "variance"] = "resistance"
    with_slope: bool = True
    gated: bool = True
    weights: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the detectors.

    `thresholds` by the name of the detector, in the unit of its statistic; those left out keep their default.
    `correct_yaw` as in `FeatureStream`. `learns_offset`: the offset of the resistance measure on dry road is estimated
    and subtracted. `joint_cusum`: scales of joint detector 2.
    """

    thresholds: Mapping[str, float] = field(default_factory=dict)
    correct_yaw: bool = True
    learns_offset: bool = True
    joint_cusum: JointCusumParams = field(default_factory=JointCusumParams)


Kind = Literal["effect", "joint", "warning", "rival"]
"""A single effect of the thesis, a joint detector that reads the single ones, a warning before it, or prior art."""


class Needs(NamedTuple):
    """Signals (or `vehicle.KEY`) that are missing: without `missing` a detector cannot run, without `lacks` it can."""

    missing: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()


def always_partial(_: Mapping[str, Any]) -> str:
    """Return the severity of a detector that does not distinguish partial from full aquaplaning."""
    return "partial"


Found = tuple[Track, Evidence]
"""A track of one piece, and the evidence from which its events are made."""


@dataclass(frozen=True, slots=True)
class Output:
    """Result of a detector on one piece, arrays (n,): tracks, features for the user, `shared` for later detectors."""

    found: tuple[Found, ...]
    features: Mapping[str, FloatArray] = field(default_factory=dict)
    shared: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Scene:
    """One piece of a drive, arrays (n,).

    `f` features, with those of the detectors that ran before; `braking` wheel -> where a braking force acts; `columns`
    the signals that features read; `tracks` and `shared` of the detectors that ran before.
    """

    f: Features
    braking: Mapping[str, BoolArray]
    columns: Mapping[str, FloatArray] = field(default_factory=dict)
    tracks: tuple[Track, ...] = ()
    shared: Mapping[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.f["v_x_hat"].size

    @property
    def wheels(self) -> list[str]:
        """Return wheels whose speeds are known."""
        return [w for w in WHEELS if f"v_w_{w}" in self.f]

    @property
    def is_braking(self) -> BoolArray:
        """Return whether a braking force acts on any wheel, or may act where no torque says so. (n,)"""
        bits = any_wheel(self.braking)
        return bits | self.braking.get(UNLOGGED, bits)

    @property
    def one_side_braked(self) -> BoolArray:
        """Return whether a braking force acts on one wheel of an axle alone, as no driver brakes. (n,)"""
        b = self.braking
        return (b["fl"] ^ b["fr"]) | (b["rl"] ^ b["rr"])

    @property
    def unbraked_resistance(self) -> FloatArray:
        """Return the resistance measure less its dry offset; braking is no evidence of water. (n,) [m/s²]"""
        return np.where(self.is_braking, np.nan, self.f["delta_a_x"] - self.f.get("delta_a_x_offset", 0.0))

    def of(self, *detectors: Detector) -> list[Track]:
        """Return the tracks of detectors that ran before."""
        names = {d.name for d in detectors}
        return [t for t in self.tracks if t.detector in names]

    def after(self, output: Output) -> Scene:
        """Return what the next detector sees."""
        tracks = (*self.tracks, *(track for track, _ in output.found))
        shared = {**self.shared, **output.shared}
        return Scene({**self.f, **output.features}, self.braking, self.columns, tracks, shared)


class Watch(Protocol):
    """A detector on one drive, with its state."""

    def push(self, scene: Scene) -> Output:
        """Take the next piece of the drive."""


@dataclass(frozen=True, slots=True)
class Detector:
    """Description of a detector; all that lists detectors reads it.

    Parameters
    ----------
    name : str
        In events, files and options.
    title : str
        On pages.
    unit : str
        Of the threshold.
    meaning : str
        Of the threshold, in one plain phrase.
    statistic : str
        What the track shows, in one phrase.
    threshold : float
        Default, > 0 and below `highest`; a larger one means fewer alarms.
    needs : callable
        (vehicle, symbols of the drive, rate of the grid [Hz]) -> Needs.
    start : callable
        Setup -> Watch.
    reads : tuple of Detector
        Those whose tracks, features or `shared` it reads: they run first.
    severity : callable
        Evidence of an event -> `partial` or `full`.
    explain : callable
        Gathered evidence -> that of the event.
    highest : float
        A share stays below 1.
    reference : str
        Number in the thesis' bibliography, of a rival.
    counterpart : Detector, optional
        The thesis' own for the same effect, of a rival.
    """

    name: str
    title: str
    unit: str
    meaning: str
    statistic: str
    threshold: float
    needs: Callable[[Vehicle, Collection[str], float], Needs]
    start: Callable[[Setup], Watch]
    kind: Kind = "effect"
    reads: tuple[Detector, ...] = ()
    severity: Severity = always_partial
    explain: Explain = as_they_are
    highest: float = math.inf
    reference: str = ""
    counterpart: Detector | None = None

    def scaled(self, threshold: float, factor: float) -> float:
        """Return a threshold times a factor; of a share, what may be left is divided by the factor instead."""
        if math.isinf(self.highest):
            return threshold * factor
        return min(max(1.0 - (1.0 - threshold) / factor, 1e-3), 0.999 * self.highest)


@dataclass(frozen=True, slots=True)
class Setup:
    """What a detector is started with on a drive; `dt` [s], `threshold` in the unit of the detector."""

    detector: Detector
    vehicle: Vehicle
    dt: float
    threshold: float
    settings: Settings = field(default_factory=Settings)
    memory: Memory = field(default_factory=Memory)

    def track(
        self, statistic: FloatArray, active: BoolArray, *, wheel: str | None = None, side: str | None = None
    ) -> Track:
        """Return a track with the detector's name, unit and threshold; the side of a wheel is its own."""
        side = side_of(wheel) if wheel is not None and side is None else side
        return Track(self.detector.name, wheel, side, self.detector.unit, statistic, self.threshold, active)


def any_wheel(bits: Mapping[str, BoolArray]) -> BoolArray:
    """Return whether a bit is set at any wheel. (n,)"""
    return bits["fl"] | bits["fr"] | bits["rl"] | bits["rr"]


def traction(f: Features, wheel: str) -> FloatArray | None:
    """Return the traction coefficient of a wheel, less the water's resistance where known; None without torque."""
    return f.get(f"mu_res_{wheel}", f.get(f"mu_{wheel}"))


# --- needs that several detectors have -----------------------------------------------------------------------------


def missing_wheels(have: Collection[str], wheels: Collection[str] = WHEELS) -> list[str]:
    """Wheel speeds that the drive does not have."""
    return [f"omega_{w}" for w in wheels if f"omega_{w}" not in have]


def missing_drivetrain(vehicle: Vehicle) -> list[str]:
    """The vehicle's key of the driven axle, if its file does not have it: no detector assumes one."""
    return [] if vehicle.knows_drivetrain else ["vehicle.drivetrain"]


def missing_torques(vehicle: Vehicle, have: Collection[str]) -> list[str]:
    """Torques of driven wheels that the drive does not have, and the drivetrain where it is not known."""
    if not vehicle.knows_drivetrain:
        torque = () if any(f"torque_{w}" in have for w in WHEELS) else ("torque of the driven wheels",)
        return [*torque, *missing_drivetrain(vehicle)]
    return [f"torque_{w}" for w in vehicle.driven if f"torque_{w}" not in have]


def missing_balance(vehicle: Vehicle, have: Collection[str]) -> list[str]:
    """Signals and vehicle keys of the longitudinal balance."""
    no_speed = "v_x" not in have and len(missing_wheels(have)) == len(WHEELS)
    return [
        *missing_torques(vehicle, have),
        *(() if "a_x" in have else ("a_x",)),
        *(("v_x",) if no_speed else ()),
        *(() if "mass" in vehicle.given else ("vehicle.mass",)),
    ]


def too_slow(rate_hz: float, least: float, what: str = "wheel speeds at {:g} Hz or more") -> list[str]:
    """Name the rate that a detector needs if the grid is slower. [Hz]"""
    # sample times are whole nanoseconds
    return [] if rate_hz > least * (1.0 - 1e-6) else [what.format(least)]
