"""One drive under all detectors, for the panels over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.records import BoolArray, DriveResult, FloatArray

__all__ = ["DriveRun"]


@dataclass(frozen=True, slots=True)
class DriveRun:
    """One drive; `t` (n,) [s], `entry` and `exit` of the water [s]."""

    result: DriveResult
    t: FloatArray
    entry: float
    exit: float

    @property
    def velocity(self) -> FloatArray:
        """The car's velocity: measured, else as it was estimated, array (n,). [m/s]"""
        return self.signal("v_x") if "v_x" in self.result.signals.symbols else self.feature("v_x_hat")

    def signal(self, name: str) -> FloatArray:
        """A measured signal, or the truth by which a drive is judged (`true_slip_fr`), array (n,)."""
        return self.result.signals.array(name)

    def feature(self, name: str) -> FloatArray:
        """A feature of the detectors, array (n,); NaN where the drive lacks its signals."""
        if name not in self.result.features.columns:
            return np.full(self.t.size, np.nan)
        return np.asarray(self.result.features[name].to_numpy(), dtype=np.float64)

    def within(self, start: float, end: float) -> BoolArray:
        """Samples from one time to another, bool array (n,)."""
        return (self.t >= start - 1e-9) & (self.t < end - 1e-9)

    def on_lane(self) -> BoolArray:
        """Samples from entry to exit, bool array (n,)."""
        return self.within(self.entry, self.exit)

    def active(self, detector: str, wheel: str | None = None) -> BoolArray:
        """Detection bit of a detector, of one wheel or of any, array (n,)."""
        bits = np.zeros(self.t.size, dtype=bool)
        for track in self.result.tracks:
            if track.detector == detector and wheel in (None, track.wheel):
                bits |= track.active
        return bits

    def statistic(self, detector: str) -> tuple[FloatArray, float]:
        """Statistic (n,) of a detector of the whole car, and its threshold; NaN where it could not run."""
        track = next((t for t in self.result.tracks if t.detector == detector), None)
        return (np.full(self.t.size, np.nan), float("nan")) if track is None else (track.statistic, track.threshold)

    def events(self, detector: str, wheel: str | None = None) -> list[float]:
        """Times at which its events begin. [s]"""
        return [e.start_s for e in self.result.events if e.detector == detector and wheel in (None, e.wheel)]

    def after_entry(self, bits: BoolArray) -> float:
        """Time from the entry to the first sample on the lane in which a bit is set; NaN without one. [s]"""
        at = np.flatnonzero(bits & self.on_lane())
        return float(self.t[at[0]] - self.entry) if at.size else float("nan")
