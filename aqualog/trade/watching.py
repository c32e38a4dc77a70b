"""A tyre test while it is driven: each log that has arrived is one run, measured once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from aqualog.campaign.batch import CRASHED
from aqualog.campaign.definition import Run
from aqualog.campaign.jobs import Configured
from aqualog.guard.worker import Crashed
from aqualog.io.fingerprint import Contents, hash_of, state_of
from aqualog.trade.arrivals import Arrivals, Look, State
from aqualog.trade.entry import UNPLANNED
from aqualog.trade.evaluation import Options, TradeTest, entries_of, evaluated
from aqualog.trade.logs import Measured, Request, measure_log

__all__ = ["Arrived", "Watched", "Watching"]

AGAIN_S, MOST_S = 10.0, 600.0  # [s] until a log that could not be read is looked at again: twice as long each time

Do = Callable[..., object]
"""Calls a function with its arguments, here or in another process; `Crashed` where that has ended it."""


class Arrived(NamedTuple):
    """A drive that has come: its files, and its runs in the campaign; none where the campaign does not name it."""

    paths: tuple[Path, ...]
    runs: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Watched:
    """What is known by now.

    `new`: the drive that this look has measured, else empty; `same`: a log that is another one's copy,
    by name; `failed`: why logs gave nothing; `missing`: runs of the campaign whose logs have not come or gave nothing,
    and `unplanned` logs that no run names.
    """

    test: TradeTest
    look: Look
    new: str = ""
    failed: Mapping[str, str] = field(default_factory=dict)
    same: Mapping[str, str] = field(default_factory=dict)
    missing: tuple[Run, ...] = ()
    unplanned: tuple[str, ...] = ()


class Watching:
    """The state of a watch.

    Parameters
    ----------
    arrivals : Arrivals
    configured : Configured
        The campaign; `reconfigured` takes a later one.
    options, request
        As of the test: `options.keys` are those of a set.
    """

    def __init__(self, arrivals: Arrivals, configured: Configured, options: Options, request: Request) -> None:
        self._arrivals, self._configured = arrivals, configured
        self._options, self._request = options, request
        self._contents = Contents()
        self._digests: dict[Path, tuple[State, str]] = {}  # in the order of arrival
        self._outcomes: dict[str, tuple[Measured | str, ...]] = {}
        self._again: dict[Path, tuple[float, float]] = {}  # when, and how long it waited for that

    def reconfigured(self, configured: Configured, options: Options) -> None:
        """Go on with another campaign: what it says otherwise of a log is measured anew."""
        self._configured, self._options = configured, options

    def step(self, now: float, do: Do) -> Watched:
        """Look at the folder, and measure one drive that is new and complete; with `new` there may be more.

        Parameters
        ----------
        now : float
            A clock that only goes forward. [s]
        do : callable
            See `Do`.
        """
        look = self._arrivals.look(now)
        for path, state in look.complete:
            self._identify(path, state, now)
        for drive in self._drives():
            key = self._key(drive)
            if key not in self._outcomes and self._measure(drive, key, do):
                if any(isinstance(x, str) for x in self._outcomes[key]):
                    self._again.update({p: (now + AGAIN_S, AGAIN_S) for p in drive.paths if p not in self._again})
                return self._told(look, self._name(drive.paths[0]))
        return self._told(look)

    # --- which logs there are ----------------------------------------------------------------------------------------

    def _identify(self, path: Path, state: State, now: float) -> None:
        """Hash a complete log that is new or has changed, or that could not be read and is looked at again."""
        known = self._digests.get(path)
        due, waited = self._again.get(path, (now + 1.0, 0.0))
        if known is not None and known[0] == state and now < due:
            return
        if known is not None and now >= due:
            self._contents.known.clear()  # the same size and time: only the content says whether it is the same
            self._again[path] = now + min(2.0 * waited, MOST_S), min(2.0 * waited, MOST_S)
        digest = f"no content: {path}"  # an empty or unreadable log is nobody's copy; measuring it says why
        try:
            digest = self._contents.of(path) if state.size else digest
        except FileNotFoundError:  # away again: the next look finds it
            return
        except OSError:
            pass
        if known is not None and known[1] != digest:
            self._again.pop(path, None)
        self._digests[path] = state, digest

    def _drives(self) -> list[Arrived]:
        """Drives in the order of arrival, each content once: the copy that the campaign names goes before others."""
        named, planned = self._by_run()
        owners: dict[str, Path] = {}
        for path, (_, digest) in self._digests.items():
            if digest not in owners or (path in planned and owners[digest] not in planned):
                owners[digest] = path
        order = {path: i for i, path in enumerate(self._digests)}
        own = set(owners.values())
        found = [d for d in named if all(p in own for p in d.paths)]
        found += [Arrived((p,), ()) for p in own if p not in planned]
        return sorted(found, key=lambda d: max(order[p] for p in d.paths))

    def _by_run(self) -> tuple[list[Arrived], set[Path]]:
        """Drives whose files have all come, and all files that belong to a run of the campaign."""
        by_name: dict[str, Path] = {}
        for path in self._digests:
            by_name.setdefault(path.name.lower(), path)
        runs: dict[tuple[Path, ...], list[int]] = {}
        for i, run in enumerate(self._configured.campaign.runs):
            runs.setdefault(run.logs, []).append(i)
        found, planned = [], set()
        for logs, indices in runs.items():
            paths = [p if p in self._digests else by_name.get(p.name.lower()) for p in logs]
            here = tuple(p for p in paths if p is not None)
            planned |= set(here)
            if len(here) == len(logs):
                found.append(Arrived(here, tuple(indices)))
        return found, planned

    # --- measuring ---------------------------------------------------------------------------------------------------

    def _runs_of(self, drive: Arrived) -> list[Run | str]:
        campaign = self._configured.campaign
        if drive.runs:
            return [replace(campaign.runs[i], logs=drive.paths) for i in drive.runs]
        cars = list(dict.fromkeys(r.vehicle for r in campaign.runs))
        if len(cars) > 1:
            return ["is in no run of the campaign, whose runs have several cars. Try: a run that names it"]
        return [Run(drive.paths, cars[0], None, None, {})]

    def _key(self, drive: Arrived) -> str:
        runs = [r if isinstance(r, str) else repr(replace(r, logs=())) for r in self._runs_of(drive)]
        cars = [repr(v) for v in self._configured.vehicles.values()]
        return hash_of([*(self._digests[p][1] for p in drive.paths), str(bool(drive.runs)), *runs, *cars])

    def _measure(self, drive: Arrived, key: str, do: Do) -> bool:
        """Measure a drive; False where it was no longer what was hashed: it grows on, or is away."""
        found: list[Measured | str] = []
        for run in self._runs_of(drive):
            if isinstance(run, str):
                found.append(run)
                continue
            given = self._configured
            result = do(measure_log, run, given.vehicles[run.vehicle], given.signal_map, given.dbc, self._request)
            found.append(
                CRASHED if isinstance(result, Crashed) else result if isinstance(result, Measured) else str(result)
            )
        now = {Path(name): State(size, mtime) for name, size, mtime in state_of(drive.paths)}
        if any(now.get(p) != self._digests[p][0] for p in drive.paths):
            return False
        self._outcomes[key] = tuple(found)
        return True

    # --- what is said of it ------------------------------------------------------------------------------------------

    def _name(self, path: Path) -> str:
        folder = self._arrivals.folder
        return str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)

    def _told(self, look: Look, new: str = "") -> Watched:
        runs: list[Run] = []
        names: list[str] = []
        measured: dict[int, Measured | str] = {}
        failed: dict[str, str] = {}
        drives = self._drives()
        for drive in drives:
            name = self._name(drive.paths[0])
            for run, outcome in zip(self._runs_of(drive), self._outcomes.get(self._key(drive), ()), strict=False):
                if isinstance(outcome, Measured) and isinstance(run, Run):
                    measured[len(runs)] = outcome
                    runs.append(run)
                    names.append(name)
                else:
                    failed[name] = str(outcome)
        campaign = self._configured.campaign
        entries = entries_of(replace(campaign, runs=tuple(runs)), names, measured, self._options.keys)
        unplanned = tuple(self._name(d.paths[0]) for d in drives if not d.runs)
        entries = tuple(replace(e, group=UNPLANNED) if e.log in unplanned else e for e in entries)
        own = {p for d in drives for p in d.paths}
        digests = {self._digests[p][1]: self._name(p) for p in own}
        came = {i for d in drives if self._name(d.paths[0]) not in failed for i in d.runs}
        return Watched(
            evaluated(entries, self._options, failed), look, new, failed,
            {self._name(p): digests[x] for p, (_, x) in self._digests.items() if p not in own and x in digests},
            tuple(r for i, r in enumerate(campaign.runs) if i not in came), unplanned,
        )  # fmt: skip
