"""Runs detection and features for every new log of a campaign into its store; a failing log does not stop the rest."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from polars.exceptions import PanicException

from aqualog.align.load import load_drive
from aqualog.align.mapping import SignalMap
from aqualog.campaign.jobs import Configured, Job, name_of, plan_jobs
from aqualog.campaign.measure import measure, measure_long
from aqualog.campaign.place import Address
from aqualog.campaign.results import load_results
from aqualog.campaign.store import Store
from aqualog.campaign.tables import write_tables
from aqualog.core.errors import AqualogError, ConfigError, FitError, LogError, SignalError
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import Settings
from aqualog.guard.reading import VARIABLES, limits_from, size_of
from aqualog.guard.worker import NO_LIMITS, Crashed, Limits, WorkOn, work_on
from aqualog.io.fingerprint import Contents, Seen, change_since

__all__ = ["BatchOutcome", "Compared", "Fault", "compared", "measure_one", "run_batch"]

Report = Callable[[int, int, int], None]
"""Called with the numbers of finished logs, of all logs and of failed logs."""

CRASHED = "its process ended without a message: out of memory, or a fault of a reading library"
_HERE = 4  # for so few logs no processes are started


class Fault(NamedTuple):
    """Reason why a log gave no result.

    `is_proven`: its content is at fault, so that only a change of it justifies another try; `ends_batch`: the store,
    not the log, is at fault.
    """

    reason: str
    is_proven: bool = False
    ends_batch: bool = False


@dataclass(frozen=True, slots=True)
class BatchOutcome:
    """Result of a batch: logs measured now, logs already there, and name -> reason of logs without result."""

    made: int
    kept: int
    failed: Mapping[str, str]

    @property
    def done(self) -> int:
        """Logs that have results."""
        return self.made + self.kept


class Compared(NamedTuple):
    """Jobs compared with the store: to measure (by key), already there, failed before with reasons, damaged files."""

    new: Mapping[str, Job]
    kept: int
    failed: Sequence[tuple[Job, str]]
    damaged: Sequence[str]


def compared(todo: Sequence[Job], store: Store, *, force: bool) -> Compared:
    """Jobs that a batch would measure, and the store's state of the others."""
    done, known_failed = store.keys()
    asked = sorted(done & {j.key for j in todo})
    store.look_at(asked)
    damaged = [k for k in asked if not store.is_sound(k)]
    done = set() if force else done - set(damaged)
    new: dict[str, Job] = {}
    kept = 0
    failed = []
    for job in todo:
        if job.reason:
            failed.append((job, job.reason))
        elif job.key in done or job.key in new:
            kept += 1
        elif job.key in known_failed and not force:
            failed.append((job, store.failure(job.key)))
        else:
            new[job.key] = job
    return Compared(new, kept, failed, damaged)


def run_batch(
    configured: Configured, store: Store, *, jobs: int = 1, force: bool = False, limits: Limits = NO_LIMITS,
    elsewhere: WorkOn | None = None, report: Report = lambda done, total, failed: None,
    told: Callable[[str, str], None] = lambda name, reason: None,
) -> BatchOutcome:  # fmt: skip
    """Bring the store up to date with the campaign.

    Parameters
    ----------
    configured, store
        The store is made if it is not there.
    jobs : int
        Processes on this machine.
    force : bool
        Measure logs again that already have results.
    limits : Limits
        Limits of one log.
    elsewhere : callable, optional
        Works on the logs in place of these processes: `aqualog.campaign.cluster.on_cluster`.
    report, told : callable
        Progress; name and reason of every log without result, at once.

    A log that fails does not affect the others. If its content is at fault, the failure is stored too, and the log is
    tried again only after a change of it, of its configuration or of aqualog. An interrupt keeps all finished results.
    A damaged result counts as missing. The store of a shard gets no tables. Where no log is left to measure, the store
    may be read-only or in use by another batch.

    Raises
    ------
    ConfigError
        If the folder is not a store, or only this process sees it while others are to work.
    AqualogError
        If it cannot be written, another batch writes there, or results written by other machines are missing; finished
        results stay.
    """
    store.check()
    if not store.is_shared and (elsewhere is not None or limits != NO_LIMITS):
        raise ConfigError("is in the memory of one process", where=store.name, expected="a store that others see too")
    contents = Contents(store.contents())
    todo = plan_jobs(configured, contents)
    plan = compared(todo, store, force=force)

    def write_all() -> None:
        write_tables(load_results(configured, store, todo, damaged_fail=True))

    with store.held(must=bool(plan.new)) as is_held:
        if plan.new:
            plan = compared(todo, store, force=force)  # another batch may have been at work until now
            for key in plan.damaged:
                store.drop(key)
        if is_held and contents.has_changed:
            store.keep_contents(contents.known)
        tally = _Tally(configured, store, len(todo), plan, limits, report, told)
        try:
            _work(configured, store, plan.new, tally.record, jobs=jobs, limits=limits, elsewhere=elsewhere)
        except BaseException:
            if not store.part:
                with suppress(AqualogError):  # the user should see the reason that ended the batch
                    write_all()
            raise
        if lost := tally.made - len(store.keys()[0] & plan.new.keys()):
            raise AqualogError(
                f"{lost} results that were written are missing", where=store.name, expected="the disk of the start",
                hint="its mounts; the same command goes on with the rest",
            )  # fmt: skip
        if is_held and not store.part:
            write_all()
    return BatchOutcome(tally.made, plan.kept, tally.failed)


@dataclass(eq=False, slots=True)
class _Tally:
    """State of the logs so far."""

    configured: Configured
    store: Store
    total: int
    plan: Compared
    limits: Limits
    report: Report
    told: Callable[[str, str], None]
    made: int = 0
    failed: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for job, reason in self.plan.failed:
            self._fail(job, reason)
        self._tell()

    def record(self, key: str, outcome: Fault | Crashed | None) -> None:
        """Take the outcome of a job; AqualogError if the store is at fault."""
        job = self.plan.new[key]
        if isinstance(outcome, Crashed):
            # next time there may be more memory, or a quieter machine
            self._fail(job, _how_it_ended(outcome, job, self.limits))
        elif outcome is None:
            self.made += 1
        elif outcome.ends_batch:
            raise AqualogError(outcome.reason)
        else:
            if outcome.is_proven:
                self.store.put_failure(key, outcome.reason)
            self._fail(job, outcome.reason)
        self._tell()

    def _fail(self, job: Job, reason: str) -> None:
        name = name_of(self.configured.campaign, job.logs)
        self.failed[name] = reason
        self.told(name, reason)

    def _tell(self) -> None:
        self.report(self.plan.kept + self.made + len(self.failed), self.total, len(self.failed))


def _how_it_ended(crashed: Crashed, job: Job, limits: Limits) -> str:
    own = limits.seconds
    most = own if own is not None else limits_from(os.environ).wall_for(max(map(size_of, job.logs)))
    if most and crashed.seconds >= most:
        return f"took longer than {most:g} s ({VARIABLES['wall'] if own is None else '--limit-s'})"
    return CRASHED


def _work(
    configured: Configured, store: Store, new: Mapping[str, Job],
    record: Callable[[str, Fault | Crashed | None], None], *, jobs: int, limits: Limits, elsewhere: WorkOn | None,
) -> None:  # fmt: skip
    shared = (configured.signal_map, configured.dbc, configured.settings)
    tasks = {k: (store.address, k, j.seen, j.logs, j.vehicle, *shared) for k, j in new.items()}
    if elsewhere is None and store.is_shared and ((len(tasks) > _HERE and jobs > 1) or limits != NO_LIMITS):
        work_on(tasks, measure_one, jobs=jobs, record=record, limits=limits)
    elif elsewhere is None:
        for key, task in tasks.items():
            record(key, measure_one(*task))
    else:
        made: set[str] = set()

        def taken(key: str, outcome: Fault | Crashed | None) -> None:
            if outcome is None:
                made.add(key)
            record(key, outcome)

        elsewhere(tasks, measure_one, taken)
        if lost := made - store.keys()[0]:
            raise AqualogError(
                f"{len(lost)} results that workers have written are missing here", where=store.name,
                expected="the same store on every machine",
                hint="a shared disk, or a URL that means the same everywhere",
            )  # fmt: skip


def measure_one(
    address: Address, key: str, seen: Seen, logs: tuple[Path, ...], vehicle: Vehicle, signal_map: SignalMap,
    dbc: tuple[Path, ...], settings: Settings,
) -> Fault | None:  # fmt: skip
    """Measure one log into the store; returns None, or the reason why it gave no result."""
    try:
        store = Store(address)
    except AqualogError as error:
        return Fault(error.line(), ends_batch=True)
    try:
        loaded = load_drive(logs, vehicle=vehicle, signal_map=signal_map, dbc=dbc)
        if isinstance(loaded, Signals):
            measurement = measure(loaded, vehicle, settings=settings)
        else:
            with loaded.opened:
                measurement = measure_long(loaded.drive, vehicle, settings=settings, faults=loaded.faults)
        found = None
    except (Exception, PanicException) as error:
        found = _fault(error, logs)
    changed = change_since((*logs, *dbc), seen)
    if changed:
        return Fault(changed)  # the content that was read does not belong to the key
    if found is not None:
        return found
    try:
        store.put(key, measurement)
    except AqualogError as error:
        return Fault(error.line(), ends_batch=True)
    except Exception as error:
        return Fault(_told(error, logs))
    return None


def _fault(error: BaseException, logs: Sequence[Path]) -> Fault:
    """Only faults found by reading a log are proven; faults of a disk, of memory or of aqualog may disappear."""
    behind: BaseException | None = error
    while behind is not None:
        if isinstance(behind, OSError | MemoryError):
            return Fault(_told(error, logs))
        if isinstance(behind, KeyboardInterrupt):  # compiled code turns it into an error of its own
            raise KeyboardInterrupt from error
        behind = behind.__cause__ or behind.__context__
    return Fault(_told(error, logs), is_proven=isinstance(error, LogError | SignalError | ConfigError | FitError))


def _told(error: BaseException, logs: Sequence[Path]) -> str:
    if isinstance(error, AqualogError):
        return error.line()
    if isinstance(error, OSError):
        return f"{error.filename or ', '.join(map(str, logs))}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        return "not enough memory"
    return f"aqualog failed ({type(error).__name__}: {str(error)[:200]}). Try: `aqualog detect` on it with --debug"
