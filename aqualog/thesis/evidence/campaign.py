"""A campaign's runs as evidence, a user's or the simulated one: what of a run is usable, a drive under detectors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aqualog.align.load import load_signals
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, DriveResult, FloatArray
from aqualog.detect.stream import detect_drive
from aqualog.thesis.catalogue import rows
from aqualog.thesis.evidence.selection import Selected, choose

__all__ = ["KMH", "DriveRun", "Evidence"]


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


KMH = 1.0 / 3.6  # [m/s]
CONSTANT = 0.3  # [m/s^2] mean acceleration on the lane below which a pass counts as one at constant speed
LEAST_SAMPLES = 5  # of 0.1 s that a run must have


@dataclass(frozen=True, slots=True)
class Facts:
    """Usable data of a run. `wet` samples on water; of these `resistance`, `slope` usable for it; `v` [m/s] and `a`
    [m/s²] means on water, `entry` and `exit` [s] of it. NaN and 0 without water.
    """

    wet: int = 0
    resistance: int = 0
    slope: int = 0
    v: float = float("nan")
    a: float = float("nan")
    entry: float = float("nan")
    exit: float = float("nan")
    why_no_water: str = ""

    @property
    def is_constant(self) -> bool:
        """Whether the speed is kept on the water."""
        return abs(self.a) < CONSTANT


class Evidence:
    """A campaign's results for figures.

    Parameters
    ----------
    data : CampaignData
    """

    def __init__(self, data: CampaignData) -> None:
        self.data = data

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.data.name

    @cached_property
    def facts(self) -> Mapping[int, Facts]:
        """Usable data of each finished run, by its index."""
        return {info.index: _facts(info, self.data.samples(info)) for info in self.data.done}

    def of(self, info: RunInfo) -> Facts:
        """Usable data of a run."""
        return self.facts.get(info.index, Facts())

    def part(self, runs: Sequence[RunInfo]) -> CampaignData:
        """The campaign with some of its runs only."""
        return CampaignData(self.data.configured, self.data.store, runs)

    def choose(
        self, number: str, is_of_use: Callable[[RunInfo], str], runs: Sequence[RunInfo] | None = None
    ) -> Selected:
        """Choose the configuration that a figure shows, of all runs or of some; `is_of_use` as in `choose`.

        Raises
        ------
        NotInCampaign
        """
        row = rows()[number]
        some = self.data.runs if runs is None else runs
        return choose(some, row.wish, campaign=self.name, number=number, is_of_use=is_of_use, needs=row.needs)

    def wet(self, info: RunInfo) -> tuple[RunSamples, BoolArray]:
        """Samples of a run, and which of them are on water (n,)."""
        samples = self.data.samples(info)
        return samples, samples.on_water == 1.0

    def has_water(self, info: RunInfo) -> str:
        """Empty if a run was on water, else the reason why not."""
        f = self.of(info)
        return "" if f.wet >= LEAST_SAMPLES else f.why_no_water or "without water"

    def has_resistance(self, info: RunInfo) -> str:
        """Empty if a run has a resistance on water, else the reason why not."""
        why = self.has_water(info)
        if not why and self.of(info).resistance < LEAST_SAMPLES:
            why = "without torque or acceleration, or braked or turned on the water"
        return why

    def has_slope(self, info: RunInfo) -> str:
        """Empty if a run has slip and traction of a driven wheel on water, else the reason why not."""
        why = self.has_water(info)
        if not why and self.of(info).slope < LEAST_SAMPLES:
            why = "without slip or traction of a driven wheel"
        return why

    def events(self, info: RunInfo, *detectors: str, wheels: Sequence[str] = WHEELS) -> list[Mapping[str, object]]:
        """Events of a run that begin on the water, or at its edge."""
        f = self.of(info)
        return [
            e for e in info.events
            if e["detector"] in detectors and (e["wheel"] is None or e["wheel"] in wheels)
            and f.entry - 0.1 <= e["start_s"] <= f.exit + 0.1
        ]  # fmt: skip

    def drive(self, info: RunInfo) -> DriveRun:
        """A run read again, whole, under all detectors."""
        c = self.data.configured
        signals = load_signals(info.run.logs, vehicle=info.vehicle, signal_map=c.signal_map, dbc=c.dbc)
        result = detect_drive(signals, info.vehicle, settings=c.settings)
        f = self.of(info)
        return DriveRun(result, signals.array("t"), f.entry, f.exit)


def _facts(info: RunInfo, samples: RunSamples) -> Facts:
    wet = samples.on_water == 1.0
    if not wet.any():
        known = not np.isnan(samples.on_water).all()
        return Facts(why_no_water="without water" if known else "of which it is not known when they were on water")
    good = wet & samples.is_usable
    slope = np.zeros_like(good)
    for w in info.vehicle.driven:
        slope |= good & np.isfinite(samples.array(f"slip_{w}") + samples.array(f"mu_{w}"))
    t = samples.t[wet]
    if info.run.lane is not None:
        entry, leave = info.run.lane
    else:
        entry, leave = float(t[0]), float(t[-1])
    return Facts(
        int(np.count_nonzero(wet)),
        int(np.count_nonzero(good & np.isfinite(samples.array("delta_a_x")))),
        int(np.count_nonzero(slope)),
        float(np.nanmean(samples.array("v_x")[wet])),
        float(np.nanmean(samples.array("a_x")[wet])) if np.isfinite(samples.array("a_x")[wet]).any() else float("nan"),
        entry,
        leave,
    )  # fmt: skip
