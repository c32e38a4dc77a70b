"""Results of a campaign in memory: runs with their configuration, events, and samples marked as on or off water."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import polars as pl

from aqualog.campaign.definition import Run
from aqualog.campaign.jobs import Configured, Job, name_of, plan_jobs
from aqualog.campaign.store import Store
from aqualog.core.errors import AqualogError
from aqualog.core.judgement import Judgement
from aqualog.core.records import BoolArray, FloatArray, Remark
from aqualog.core.vehicle import Vehicle
from aqualog.evaluate.labels import AQUAPLANING, Label, Span, disputed, without
from aqualog.io.fingerprint import Contents

__all__ = ["SETTLING_S", "CampaignData", "RunInfo", "RunSamples", "load_results"]

SETTLING_S = 0.3  # [s] after entry and before exit; wheels and centred means need it
_TRY = "Try: the lane times of this log, or none: then its on_water counts"
_KEPT = 64  # runs whose samples stay in memory


@dataclass(frozen=True, slots=True)
class RunInfo:
    """One run of a campaign with its result.

    `state` is `done`, `failed` or `to do`; `vehicle` has the run's load; `about` holds the findings of `measure`, empty
    unless done; `water_from` gives the source of the lane: `lane times`, `signal`, `labels`, `dry run`, or empty.
    `lanes` are those of all runs on its log, in order: what is found there belongs to the lanes that it touches, else
    to the nearest one. `dispute`: how its lane differs from the log's own `on_water`.
    """

    index: int
    name: str
    run: Run
    key: str
    state: str
    reason: str
    vehicle: Vehicle
    about: Mapping[str, Any]
    water_from: str
    lanes: tuple[Span, ...] = ()
    dispute: str = ""

    @property
    def is_done(self) -> bool:
        """Whether there are results."""
        return self.state == "done"

    @property
    def judgement(self) -> Judgement:
        """Verdict and episodes; of a run without results that it cannot be judged."""
        found = Judgement.of_document(self.about) if self.about else Judgement()
        own = tuple(e for e in found.episodes if self._is_own(e.start_s, e.end_s))
        verdict = "none" if found.of("aquaplaning") and all(e.kind != "aquaplaning" for e in own) else found.verdict
        return replace(found, episodes=own, verdict=verdict)

    @property
    def checks(self) -> tuple[Remark, ...]:
        """What does not fit among the signals of its log; empty in a store of an older version."""
        return tuple(
            Remark(
                c["kind"], tuple(c["signals"]), c["what"], c["advice"], tuple(c["lines"]), _number(c["value"]),
                (_number(c["value_ci95"][0]), _number(c["value_ci95"][1])),
            )
            for c in self.about.get("checks", ())
        )  # fmt: skip

    @property
    def events(self) -> Sequence[Mapping[str, Any]]:
        """Events as `measure` keeps them."""
        found: Sequence[Mapping[str, Any]] = self.about.get("events", ())
        return found if len(self.lanes) < 2 else [e for e in found if self._is_own(e["start_s"], e["end_s"])]

    def _is_own(self, start_s: float, end_s: float) -> bool:
        if self.run.lane is None:
            return True
        k = bisect(self.lanes, (start_s, end_s))
        far = {(a, b): max(a - end_s, start_s - b) for a, b in (*self.lanes[max(k - 1, 0) : k + 1], self.run.lane)}
        return far[self.run.lane] < 0.0 or min(far, key=far.__getitem__) == self.run.lane


@dataclass(frozen=True, slots=True)
class RunSamples:
    """Samples of one run, arrays (n,), ten a second or fewer; NaN where unknown. Columns as in `measure.Measurement`.

    `on_water` is 1 on the lane without `SETTLING_S` at its ends, 0 off it, NaN in between and where it is not known.
    """

    frame: pl.DataFrame
    t: FloatArray
    on_water: FloatArray

    @property
    def step_s(self) -> float:
        """Time between samples. [s]"""
        return float(self.t[1] - self.t[0]) if self.t.size > 1 else float("nan")

    def array(self, name: str) -> FloatArray:
        """A column as floats."""
        if name not in self.frame.columns:
            return np.full(self.t.size, np.nan)
        # nulls become NaN on the way to numpy
        values: FloatArray = self.frame.get_column(name).to_numpy().astype(np.float64)
        return values

    def bits(self, name: str) -> BoolArray:
        """A column of bits."""
        found: BoolArray = self.frame[name].to_numpy().astype(bool)
        return found

    @property
    def is_usable(self) -> BoolArray:
        """Straight driving that regressions can use."""
        return self.bits_of("reason", 0)

    def around(self, which: BoolArray) -> BoolArray:
        """Samples within `SETTLING_S` of marked ones: on its way there and back a wheel slides."""
        marked = self.t[which]
        found: BoolArray = np.searchsorted(marked, self.t + SETTLING_S) > np.searchsorted(marked, self.t - SETTLING_S)
        return found

    def bits_of(self, name: str, value: int) -> BoolArray:
        """Where a column of codes has a value."""
        found: BoolArray = self.frame[name].to_numpy() == value
        return found


class CampaignData:
    """A campaign's runs with access to their samples."""

    def __init__(self, configured: Configured, store: Store, runs: Sequence[RunInfo]) -> None:
        self.configured = configured
        self.store = store
        self.runs: tuple[RunInfo, ...] = tuple(runs)
        self._read = lru_cache(maxsize=_KEPT)(self.store.samples)

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.configured.campaign.name

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys by which the runs can be grouped."""
        return self.configured.campaign.keys

    @property
    def done(self) -> tuple[RunInfo, ...]:
        """Runs with results."""
        return tuple(r for r in self.runs if r.is_done)

    def samples(self, info: RunInfo) -> RunSamples:
        """Samples of a run; LogError if its file in the store is damaged."""
        frame = self._read(info.key)
        t: FloatArray = frame["t"].to_numpy()
        return RunSamples(frame, t, _on_water(info, frame, t, self.labels_of(info)))

    def full(self, info: RunInfo) -> pl.DataFrame | None:
        """Samples of a run at its log's own rate around its episodes; None without any, or in an older store."""
        return self.store.full(info.key)

    def labels_of(self, info: RunInfo) -> tuple[Label, ...] | None:
        """Labels of a run's labels file; None without one."""
        return None if info.run.labels is None else self.configured.labels[info.run.labels]


def load_results(
    configured: Configured, store: Store, jobs: Sequence[Job] | None = None, *, damaged_fail: bool = False
) -> CampaignData:
    """The store's results of a campaign; runs without results are included, with the reason.

    AqualogError if a result is damaged; with `damaged_fail` its run has failed instead.
    """
    jobs = plan_jobs(configured, Contents(store.read_json("contents.json"))) if jobs is None else jobs
    done, failed = store.keys()
    store.look_at(done & {j.key for j in jobs})
    store.expect(j.key for j in sorted(jobs, key=lambda j: j.runs) if j.key in done)
    of_run = {index: job for job in jobs for index in job.runs}
    of_key: dict[str, set[Span]] = {}
    for index, run in enumerate(configured.campaign.runs):
        of_key.setdefault(of_run[index].key, set()).update({run.lane} if run.lane is not None else ())
    lanes = {key: tuple(sorted(own)) for key, own in of_key.items()}
    runs = []
    for index, run in enumerate(configured.campaign.runs):
        job = of_run[index]
        state, reason = "to do", job.reason
        about: Mapping[str, Any] = {}
        if job.reason:
            state = "failed"
        elif job.key in done:
            try:
                state, about = "done", store.about(job.key)
            except AqualogError as error:
                if not damaged_fail:
                    raise
                state, reason = "failed", error.line()
        elif job.key in failed:
            state, reason = "failed", store.failure(job.key)
        name = name_of(configured.campaign, run.logs)
        water, dispute, is_most = _water_from(run, about), *_dispute(run, about, lanes[job.key])
        if is_most:
            state, about, dispute, reason = "failed", {}, "", f"{dispute}. {_TRY}"
        runs.append(
            RunInfo(index, name, run, job.key, state, reason, job.vehicle, about, water, lanes[job.key], dispute)
        )
    return CampaignData(configured, store, runs)


def _number(x: float | None) -> float:
    return math.nan if x is None else float(x)


def _dispute(run: Run, about: Mapping[str, Any], lanes: tuple[Span, ...]) -> tuple[str, bool]:
    """As `disputed`; a store of an older version does not know the water."""
    if run.lane is None:
        return "", False
    wet = [(float(a), float(b)) for a, b in about.get("wet_s") or ()]
    return disputed(run.lane, without(wet, [x for x in lanes if x != run.lane]), is_dry=_is_dry(run))


def _water_from(run: Run, about: Mapping[str, Any]) -> str:
    if run.lane is not None:
        return "lane times"
    if run.labels is not None:
        return "labels"
    if "on_water" in about.get("signals", ()):
        return "signal"
    return "dry run" if _is_dry(run) else ""


def _is_dry(run: Run) -> bool:
    """Whether a run says that it has no water, in neither track: a trough may be on one side."""
    return run.values.get("water_depth_mm") == 0.0 == run.values.get("water_depth_left_mm", 0.0)


def _on_water(info: RunInfo, frame: pl.DataFrame, t: FloatArray, labels: tuple[Label, ...] | None) -> FloatArray:
    if info.water_from == "lane times" and info.run.lane is not None:
        # the water of another run is neither this one's nor dry road
        others = ~(_inside([lane for lane in info.lanes if lane != info.run.lane], t) == 0.0)
        # a stretch of dry road may be timed as a lane, too
        inside = _inside([info.run.lane], t) * float(not _is_dry(info.run))
        if "on_water" in frame.columns:  # water beside the lane is no dry road
            others |= (frame["on_water"].fill_null(0.0).to_numpy() > 0.0) & (inside == 0.0)
        return np.where(others, np.nan, inside)
    if info.water_from == "labels" and labels is not None:
        return _inside([(x.start_s, x.end_s) for x in labels if x.effect in AQUAPLANING], t)
    if info.water_from == "signal":
        wet = frame["on_water"].cast(pl.Float64).to_numpy()
        edges = np.flatnonzero(np.diff((wet > 0.5).astype(np.int8)))
        out: FloatArray = np.where(np.isnan(wet), np.nan, (wet > 0.5).astype(np.float64))
        for i in edges:
            out[np.abs(t - 0.5 * (t[i] + t[i + 1])) < SETTLING_S] = np.nan
        return out
    return np.zeros(t.size) if info.water_from == "dry run" else np.full(t.size, np.nan)


def _inside(spans: Sequence[Span], t: FloatArray) -> FloatArray:
    out: FloatArray = np.zeros(t.size)
    for start, end in spans:
        out[(t > start) & (t < end)] = 1.0
    for edge in (x for span in spans for x in span):
        out[np.abs(t - edge) < SETTLING_S] = np.nan
    return out
