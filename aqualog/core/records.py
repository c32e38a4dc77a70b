"""Frozen records that the layers share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from aqualog.core.judgement import Judgement

if TYPE_CHECKING:
    import polars as pl

__all__ = [
    "BoolArray", "Channel", "ChannelInfo", "Drift", "DriveResult", "Event", "FileFaults", "FloatArray", "Origin",
    "Quality", "Remark", "Signals", "SlopeSummary", "TimeArray", "TimeFaults", "Track", "Unavailable",
]  # fmt: skip

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A channel as the file lists it, before any sample is decoded.

    `path` is unique within the file: group, bus, message or topic stand before the name (`ESP_19.ESP_v_Signal`,
    `/imu/data.linear_acceleration.x`). `key` is the reader's own address and means nothing outside it.
    """

    path: str
    name: str
    unit: str
    count: int
    file: str
    key: Any = field(default=None, compare=False, repr=False)
    comment: str = ""


@dataclass(frozen=True, slots=True)
class Channel:
    """Samples of one channel as they stand in the file, in the file's own order.

    `t_ns` are nanoseconds: since 1970 UTC if `absolute`, else on the file's own clock. Nothing is sorted, repaired
    or dropped by a reader; a sample that the file marks as invalid is NaN.
    """

    info: ChannelInfo
    t_ns: TimeArray
    values: FloatArray
    absolute: bool


@dataclass(frozen=True, slots=True)
class Drift:
    """Two clocks of a log that drift apart: `against` gains `ppm` on `clock`, the reference; `shift_s` in all."""

    clock: str
    against: str
    ppm: float
    shift_s: float


@dataclass(frozen=True, slots=True)
class FileFaults:
    """Losses of a reader. `notes` are sentences for the user.

    `lost_samples` counts what the format stores as one: records of an MDF group, messages, rows of a table (cells,
    where the rest of the row is sound), whatever the number of channels in them.
    `unfinalised`: the logger has not finished the file, and aqualog has completed it. `drifts`: clocks in the file that
    drift apart.
    """

    truncated: bool = False
    lost_samples: int = 0
    notes: tuple[str, ...] = ()
    unfinalised: bool = False
    drifts: tuple[Drift, ...] = ()


@dataclass(frozen=True, slots=True)
class TimeFaults:
    """Faults of one source's time stamps, classified and counted.

    `drifts` are clocks in its file that run apart, `strays` samples that have a stamp from elsewhere and are left out.
    `first_s` has, for each kind that has a place, where the first one is, from the source's first sample. [s]
    """

    KINDS: ClassVar[tuple[str, ...]] = ("duplicates", "back_steps", "resets", "wraps", "pauses", "drifts", "strays")

    duplicates: int = 0
    back_steps: int = 0
    resets: int = 0
    wraps: int = 0
    pauses: int = 0
    drifts: int = 0
    strays: int = 0
    first_s: Mapping[str, float] = field(default_factory=dict, kw_only=True)

    def __add__(self, other: TimeFaults) -> TimeFaults:
        return self._joined(other, lambda a, b: a + b)

    def worse(self, other: TimeFaults) -> TimeFaults:
        """Of each kind the greater count and the earlier place."""
        return self._joined(other, max)

    def _joined(self, other: TimeFaults, count: Callable[[int, int], int]) -> TimeFaults:
        first = {n: min(f[n] for f in (self.first_s, other.first_s) if n in f)
                 for n in TimeFaults.KINDS if n in self.first_s or n in other.first_s}  # fmt: skip
        return TimeFaults(*(count(getattr(self, n), getattr(other, n)) for n in TimeFaults.KINDS), first_s=first)

    def place(self, kind: str) -> str:
        """Where the first of a kind is, for a sentence; empty if it has no place."""
        return f" (first at {self.first_s[kind]:.2f} s)" if kind in self.first_s else ""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a signal on the grid comes from and what was wrong with it.

    `frozen`: samples with which the sensor repeated itself; `joined`: with which a logger filled a gap by a straight
    line. `mapped`: its line in the signal map, by key: channel, unit, scale, offset, invalid. `between`: mean of
    phi (1 - phi), where phi is the share of a sample time from a sample to a point of the grid: 0 on the samples, 1/4
    in the middle between two, 1/6 anywhere. A line between two samples leaves sqrt(1 - 2 phi (1 - phi) (1 - cos wT)) of
    a vibration.
    """

    symbol: str
    channel: str
    file: str
    unit: str
    rate_hz: float
    samples: int
    not_finite: int = 0
    out_of_range: int = 0
    invalid_code: int = 0
    missing_fraction: float = 0.0
    faults: TimeFaults = field(default_factory=TimeFaults)
    frozen: int = 0
    joined: int = 0
    mapped: Mapping[str, Any] = field(default_factory=dict)
    between: float = 0.0


@dataclass(frozen=True, slots=True)
class Quality:
    """Losses between the files and the grid.

    `dropped_samples` are all samples that were not used; among them `lost_in_files` those that a reader could not get
    out of a damaged file, `frozen_samples` those with which a sensor repeated itself. `unfinalised`: a logger has not
    finished a file.
    """

    dropped_samples: int = 0
    time_jumps: int = 0
    truncated: bool = False
    lost_in_files: int = 0
    faults: TimeFaults = field(default_factory=TimeFaults)
    notes: tuple[str, ...] = ()
    frozen_samples: int = 0
    unfinalised: bool = False

    @property
    def has_loss(self) -> bool:
        """Return whether a file was cut or lost samples."""
        return self.truncated or self.lost_in_files > 0


@dataclass(frozen=True, slots=True)
class Signals:
    """All signals of one drive on one time base.

    `frame` has `t` [s] from the first sample and one column per canonical symbol in SI; a missing value is null.
    `origins` has one entry per symbol; `start_ns` is the absolute time of `t = 0` where the log has it. `full`: rows
    and step [ns] of the drive if `frame` is only a coarser picture of it.
    """

    frame: pl.DataFrame
    dt_ns: int
    start_ns: int | None
    origins: Mapping[str, Origin]
    quality: Quality
    files: tuple[str, ...]
    full: tuple[int, int] | None = None

    @property
    def rows(self) -> int:
        """Return the points of the drive's grid."""
        return self.full[0] if self.full else self.frame.height

    @property
    def step_ns(self) -> int:
        """Return the step of the drive's grid. [ns]"""
        return self.full[1] if self.full else self.dt_ns

    @property
    def duration_s(self) -> float:
        """Points times step. [s]"""
        return self.rows * self.step_ns * 1e-9

    @property
    def dt(self) -> float:
        """Sample time. [s]"""
        return self.dt_ns * 1e-9

    @property
    def symbols(self) -> tuple[str, ...]:
        """Return the names of the columns beside `t`."""
        return tuple(c for c in self.frame.columns if c != "t")

    def array(self, symbol: str) -> FloatArray:
        """Return one column as float array, NaN where missing or if the drive has no such signal. Shape (n,)."""
        if symbol not in self.frame.columns:
            return np.full(self.frame.height, np.nan)
        import polars as pl

        return self.frame[symbol].cast(pl.Float64).to_numpy()


@dataclass(frozen=True, slots=True)
class Event:
    """One detection. `peak` and `threshold` are in the unit of the detector's statistic.

    `cause_s` estimates when the cause began and ended: without the detector's delay, decay and hold. None: as the
    detection. [s]
    """

    detector: str
    wheel: str | None
    side: str | None
    start_s: float
    end_s: float
    severity: str
    peak: float
    threshold: float
    evidence: Mapping[str, Any]
    cause_s: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Unavailable:
    """A detector that could not run and what it lacks."""

    detector: str
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Track:
    """A detector's statistic over the whole drive, on the time base of the signals.

    `statistic` (n,) is NaN where the detector was held or its signals were missing; `active` (n,) is the detection bit.
    """

    detector: str
    wheel: str | None
    side: str | None
    unit: str
    statistic: FloatArray
    threshold: float
    active: BoolArray


@dataclass(frozen=True, slots=True)
class SlopeSummary:
    """Result of the slip-slope estimator for a drive at one place (`left`, `right`, `axle`).

    `slope` C_s / F_z at the end, `slope_sd` its standard deviation by the filter; `reference` the dry slope for
    comparison (NaN without one); `beta` the slope ratio (None with one driven axle); `offset` of the slip [-].
    `seconds` by state of the estimator, `inactive` seconds by reason, `alarms` of its change detection. `periods` that
    the drive adds to the history of the dry slope: largest, mean [-], length [s]. `reference_from`: source of the dry
    slope (`history`, `vehicle file`, `this drive`, or empty). `judged_s`: time of comparison with the dry slope;
    `dropped_s`: part of it with less than half of that slope; `stiff_s`: time with an estimate stiffer than any tyre
    [s].
    """

    place: str
    wheel: str | None
    slope: float
    slope_sd: float
    reference: float
    beta: float | None
    offset: float
    alarms: int
    seconds: Mapping[str, float]
    inactive: Mapping[str, float]
    periods: tuple[tuple[float, float, float], ...] = ()
    reference_from: str = ""
    judged_s: float = 0.0
    dropped_s: float = 0.0
    stiff_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Remark:
    """What does not fit among the signals of a drive, and what to change.

    `kind`: `sign`, `exchange`, `offset`, `scale`, `torque`, `drivetrain` or `resistance`; `signals`: the symbols in
    question, or the keys of the vehicle file; `lines`: what to put under [signals] of the map. `value` with `ci95`:
    what was measured, SI (NaN without).
    """

    kind: str
    signals: tuple[str, ...]
    what: str
    advice: str
    lines: tuple[str, ...] = ()
    value: float = math.nan
    ci95: tuple[float, float] = (math.nan, math.nan)

    @property
    def sentence(self) -> str:
        """What and advice in one."""
        return f"{self.what}: {self.advice}" if self.advice else self.what


@dataclass(frozen=True, slots=True)
class Margin:
    """The least distance to full aquaplaning of a drive.

    `least` with its 90 % interval `ci90` [m/s], negative beyond full aquaplaning; `at_s` when, `warned_s` when the
    first warning began, NaN without one. [s]
    """

    least: float
    ci90: tuple[float, float]
    at_s: float
    warned_s: float


@dataclass(frozen=True, slots=True)
class DriveResult:
    """All results of `detect` for one drive.

    `features` has the rows of `signals.frame` and no `t`; `features.names.FEATURES` holds names, units and meanings. A
    column is present only if its signals are.
    `limited` are detectors that ran without one of their conditions, with the signals that are missing for it.
    `checks`: what does not fit among the signals; the notes hold their sentences.
    `judgement` has the verdict and the episodes, `margin` the least distance to full aquaplaning.
    """

    signals: Signals
    features: pl.DataFrame
    tracks: tuple[Track, ...]
    events: tuple[Event, ...]
    unavailable: tuple[Unavailable, ...]
    limited: tuple[Unavailable, ...]
    vehicle_name: str
    notes: tuple[str, ...] = ()
    slopes: tuple[SlopeSummary, ...] = ()
    checks: tuple[Remark, ...] = ()
    judgement: Judgement = field(default_factory=Judgement)
    margin: Margin | None = None
