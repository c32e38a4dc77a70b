"""Every log of a campaign through detection and features into its store: only what is new, whatever single logs do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap
from aqualog.campaign.key import Contents, result_key
from aqualog.campaign.loaded import loaded
from aqualog.campaign.measure import Measurement, measure
from aqualog.campaign.records import Campaign, Run
from aqualog.campaign.store import Store
from aqualog.campaign.tables import write_tables
from aqualog.detect.stream import Settings
from aqualog.errors import AqualogError
from aqualog.evaluate.labels import Label
from aqualog.vehicle import Vehicle
from aqualog.workers import Crashed, work_on

__all__ = ["BatchOutcome", "Configured", "Job", "measure_one", "name_of", "plan_jobs", "run_batch"]

Report = Callable[[int, int, int], None]
"""Told logs that are settled, logs in all, and failed ones so far."""

CRASHED = "its process ended without a word: out of memory, or a fault of a reading library"
_HERE = 4  # so few logs are not worth the start of processes


@dataclass(frozen=True, slots=True)
class Configured:
    """A campaign with what its files say: vehicles and labels by path, signal map, databases, detectors' settings."""

    campaign: Campaign
    vehicles: Mapping[Path, Vehicle]
    labels: Mapping[Path, tuple[Label, ...]] = field(default_factory=dict)
    signal_map: SignalMap = field(default_factory=SignalMap)
    dbc: tuple[Path, ...] = ()
    settings: Settings = field(default_factory=Settings)


@dataclass(frozen=True, slots=True)
class Job:
    """A log with the car that drove it, and the runs (by index) that it serves. `reason` if it cannot be worked on."""

    key: str
    logs: tuple[Path, ...]
    vehicle: Vehicle
    runs: tuple[int, ...]
    reason: str = ""


@dataclass(frozen=True, slots=True)
class BatchOutcome:
    """What came of a batch: logs measured now, logs that were there, and name -> reason of those that gave nothing."""

    made: int
    kept: int
    failed: Mapping[str, str]

    @property
    def done(self) -> int:
        """Logs that have results."""
        return self.made + self.kept


def plan_jobs(configured: Configured, contents: Contents) -> list[Job]:
    """Jobs of a campaign: runs on the same logs with the same car and load share one."""
    runs = configured.campaign.runs
    found: dict[tuple[tuple[Path, ...], str], list[int]] = {}
    cars: dict[tuple[tuple[Path, ...], str], Vehicle | str] = {}
    for index, run in enumerate(runs):
        car = _car(configured, run)
        at = (run.logs, car if isinstance(car, str) else repr(car))
        found.setdefault(at, []).append(index)
        cars[at] = car
    return [_job(configured, contents, logs, cars[logs, said], indices) for (logs, said), indices in found.items()]


def _car(configured: Configured, run: Run) -> Vehicle | str:
    try:
        return loaded(configured.vehicles[run.vehicle], run)
    except AqualogError as error:
        return error.line()


def _job(
    configured: Configured, contents: Contents, logs: tuple[Path, ...], car: Vehicle | str, indices: Sequence[int]
) -> Job:
    if isinstance(car, str):
        return Job("", logs, Vehicle(), tuple(indices), car)
    try:
        key = result_key(contents, logs, car, configured.signal_map, configured.dbc, configured.settings)
    except OSError as error:
        missing = next((p for p in logs if not p.exists()), logs[0])
        what = "there is no such file" if not missing.exists() else error.strerror or str(error)
        return Job("", logs, car, tuple(indices), f"{missing}: {what}")
    return Job(key, logs, car, tuple(indices))


def run_batch(
    configured: Configured,
    store: Store,
    *,
    jobs: int = 1,
    force: bool = False,
    report: Report = lambda done, total, failed: None,
    told: Callable[[str, str], None] = lambda name, reason: None,
) -> BatchOutcome:
    """Bring the store up to date with the campaign.

    Parameters
    ----------
    configured : Configured
    store : Store
        Made if it is not there.
    jobs : int
        Processes.
    force : bool
        Also what is there already.
    report : callable
        Progress.
    told : callable
        Told name and reason of every log that gives nothing, at once.

    A log that fails leaves the others alone; that it failed is kept too, so that only a change of it, of its
    configuration or of aqualog makes it be tried again. An interrupt loses nothing that is finished.
    """
    store.prepare()
    contents = Contents(store.read_json("contents.json"))
    todo = plan_jobs(configured, contents)
    if contents.has_changed:
        store.write_json("contents.json", contents.known)
    done_keys, failed_keys = (set(), set()) if force else store.keys()
    failed: dict[str, str] = {}
    made = 0

    def fail(job: Job, reason: str, *, keep: bool) -> None:
        name = name_of(configured.campaign, job.logs)
        failed[name] = reason
        if keep:
            store.put_failure(job.key, reason)
        told(name, reason)

    new: dict[str, Job] = {}
    kept = 0
    for job in todo:
        if job.reason:
            fail(job, job.reason, keep=False)
        elif job.key in done_keys or job.key in new:
            kept += 1
        elif job.key in failed_keys:
            fail(job, store.failure(job.key), keep=False)
        else:
            new[job.key] = job

    def record(key: str, outcome: str | Crashed) -> None:
        nonlocal made
        if isinstance(outcome, Crashed):
            fail(new[key], CRASHED, keep=False)  # next time there may be more memory
        elif outcome:
            fail(new[key], outcome, keep=True)
        else:
            made += 1
        report(kept + made + len(failed), len(todo), len(failed))

    try:
        report(kept + len(failed), len(todo), len(failed))
        tasks = {k: (store.folder, k, j.logs, j.vehicle, configured) for k, j in new.items()}
        lean = {k: (*t[:4], configured.signal_map, configured.dbc, configured.settings) for k, t in tasks.items()}
        if len(lean) <= _HERE or jobs == 1:
            for key, task in lean.items():
                record(key, measure_one(*task))
        else:
            work_on(lean, measure_one, jobs=jobs, record=record)
    finally:
        write_tables(configured, store, todo)
    return BatchOutcome(made, kept, failed)


def measure_one(
    folder: Path,
    key: str,
    logs: tuple[Path, ...],
    vehicle: Vehicle,
    signal_map: SignalMap,
    dbc: tuple[Path, ...],
    settings: Settings,
) -> str:
    """Measure one log into the store; empty, or why it gave nothing."""
    try:
        measurement = _measured(logs, vehicle, signal_map, dbc, settings)
        Store(folder).put(key, measurement)
    except AqualogError as error:
        return error.line()
    except OSError as error:
        return f"{error.filename or ', '.join(map(str, logs))}: {error.strerror or error}"
    except MemoryError:
        return "not enough memory"
    except Exception as error:
        return f"aqualog failed ({type(error).__name__}: {str(error)[:200]}). Try: `aqualog detect` on it with --debug"
    return ""


def _measured(
    logs: Sequence[Path], vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path], settings: Settings
) -> Measurement:
    signals = load_signals(logs, vehicle=vehicle, signal_map=signal_map, dbc=dbc)
    return measure(signals, vehicle, settings=settings)


def name_of(campaign: Campaign, logs: Sequence[Path]) -> str:
    """A drive as the campaign file names it."""
    base = campaign.path.parent
    return "; ".join(str(p.relative_to(base)) if p.is_relative_to(base) else str(p) for p in logs)
