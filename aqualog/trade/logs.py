"""Evaluate the logs of a campaign: each one read and measured, in processes where there are many."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from polars.exceptions import PanicException

from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap
from aqualog.campaign.batch import CRASHED
from aqualog.campaign.definition import Campaign, Run, with_load
from aqualog.campaign.jobs import Configured, name_of
from aqualog.core.errors import AqualogError
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.evaluate.labels import disputed
from aqualog.guard.worker import Crashed, work_on
from aqualog.io.fingerprint import Contents
from aqualog.trade.braking import Conditions, Stop, stops
from aqualog.trade.curve import curve_passes
from aqualog.trade.entry import Kind, Record
from aqualog.trade.lane import Span, depth_of, spans_of
from aqualog.trade.limits import Limits
from aqualog.trade.onset import Onset, onset_of
from aqualog.trade.straight import straight_runs

__all__ = ["Measured", "Request", "copies_in", "measure_log", "measure_logs", "measure_signals", "names_of_runs"]

_DEPTHS = ("water_depth_left_mm", "water_depth_mm")
_OPTIONAL = {"straight": frozenset({"v_x"})}  # mapped signals that a log may lack: another one stands in
_AIR = (0.8e5, 1.3e5)  # [Pa] that of the air, with what driving warms a tyre by
_HERE = 4  # for so few logs no processes are started

Report = Callable[[int, int, int], None]


@dataclass(frozen=True, slots=True)
class Request:
    """What is measured: the test, its thresholds, the radius of the circle [m] and the speeds of a stop [m/s].

    `whole_only`: a log that is cut gives nothing, as while it is still being copied.
    """

    kind: Kind
    limits: Limits
    radius: float | None = None
    v_from: float = 80.0 / 3.6
    v_to: float = 20.0 / 3.6
    with_onset: bool = True
    whole_only: bool = False


class Measured(NamedTuple):
    """Runs, passes or stops of one log, the onset of each, and when the log began [ns], None if it does not say."""

    found: tuple[Record, ...]
    onset: tuple[Onset, ...]
    start_ns: int | None
    notes: tuple[str, ...] = ()


def measure_signals(signals: Signals, vehicle: Vehicle, run: Run | None, request: Request) -> Measured:
    """Evaluate the signals of one run of a campaign; `run` says what the campaign knows of it."""
    lane: Span | None = run.lane if run is not None else None
    found: tuple[Record, ...]
    onset: tuple[Onset, ...] = ()
    if request.kind == "straight":
        runs = straight_runs(signals, vehicle, request.limits.straight, lane=lane, depths=_depths(run))
        found, onset = runs, onset_of(signals, vehicle, runs) if request.with_onset else ()
    elif request.kind == "curve":
        found = curve_passes(signals, request.limits.curve, lane=lane, radius=request.radius)
    else:
        found = stops(
            signals, request.limits.braking, v_from=request.v_from, v_to=request.v_to, conditions=_conditions(run),
            lane=lane,
        )  # fmt: skip
    if run is not None:
        found = tuple(_of_planned_depth(signals, r, run, request.limits.set.depth_share) for r in found)
        found = tuple(_of_planned_lane(signals, r, lane) for r in found)
    return Measured(found, onset, signals.start_ns, (*signals.quality.notes, *_absolute(signals, run)))


def _absolute(signals: Signals, run: Run | None) -> tuple[str, ...]:
    """Return a doubt where the log's tyre pressures are above the campaign's by about that of the air."""
    off = [
        float(np.nanmedian(x)) - 1e5 * _number(run.values, f"pressure_{axle}_bar")
        for axle in ("front", "rear") if run is not None for s in "lr"
        if np.isfinite(x := signals.array(f"pressure_{axle[0]}{s}")).any()
    ]  # fmt: skip
    if not off or not all(_AIR[0] < d < _AIR[1] for d in off):
        return ()
    by = 1e-5 * sum(off) / len(off)
    return (f"tyre pressures in the log are {by:.1f} bar above the campaign's: absolute? Both should be gauge",)


def _of_planned_depth(signals: Signals, record: Record, run: Run, share: float) -> Record:
    """Return a run or pass; it does not count where the log has another depth of water than the campaign."""
    told = [x for k in _DEPTHS if math.isfinite(x := _number(run.values, k))]
    if isinstance(record, Stop) or record.lane is None or not told:
        return record
    seen, planned = 1e3 * depth_of(signals, record.lane), max(told)
    if not abs(seen - planned) > share * planned:
        return record
    what = f"{seen:.1f} mm of water in the log, {planned:.1f} mm in the campaign"
    return replace(record, reasons=(*record.reasons, what))


def _of_planned_lane(signals: Signals, record: Record, lane: Span | None) -> Record:
    """Return a record; it does not count where the log has less than a half of its lane's water, or elsewhere."""
    what, is_most = disputed(lane, spans_of(signals)) if lane is not None else ("", False)
    if is_most:
        why = f"{what}. Try: the lane times of this log, or none"
        return replace(record, reasons=(*record.reasons, why))
    return replace(record, notes=(*record.notes, f"{what}: the campaign's counts")) if what else record


def measure_logs(
    configured: Configured, request: Request, *, jobs: int = 1, report: Report = lambda done, total, failed: None
) -> dict[int, Measured | str]:
    """Measure every run of a campaign, by its number; a text is the reason why a log gave nothing."""
    tasks = {}
    for index, run in enumerate(configured.campaign.runs):
        vehicle = configured.vehicles[run.vehicle]
        tasks[index] = (run, vehicle, configured.signal_map, configured.dbc, request)
    found: dict[int, Measured | str] = {}

    def record(index: int, outcome: Measured | str | Crashed) -> None:
        found[index] = CRASHED if isinstance(outcome, Crashed) else outcome
        report(len(found), len(tasks), sum(isinstance(x, str) for x in found.values()))

    if len(tasks) > _HERE and jobs > 1:
        work_on(tasks, measure_log, jobs=jobs, record=record)
    else:
        for index, task in tasks.items():
            record(index, measure_log(*task))
    return {index: found[index] for index in sorted(found)}


def copies_in(campaign: Campaign) -> dict[int, int]:
    """Return the runs whose logs have the content of an earlier run's on the same lane, each with that run's number.

    Only logs of one size are read for it. A log that cannot be read is nobody's copy.
    """
    by_size: dict[tuple[object, ...], list[int]] = {}
    for index, run in enumerate(campaign.runs):
        with suppress(OSError):
            by_size.setdefault((run.lane, *(p.stat().st_size for p in run.logs)), []).append(index)
    contents = Contents()
    found: dict[int, int] = {}
    for alike in (runs for runs in by_size.values() if len(runs) > 1):
        first: dict[tuple[str, ...], int] = {}
        for index in alike:
            with suppress(OSError):
                key = tuple(contents.of(p) for p in campaign.runs[index].logs)
                if (own := first.setdefault(key, index)) != index:
                    found[index] = own
    return found


def names_of_runs(configured: Configured) -> list[str]:
    """Return the name of each run's log as the campaign has it."""
    return [name_of(configured.campaign, run.logs) for run in configured.campaign.runs]


def measure_log(
    run: Run, vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path], request: Request
) -> Measured | str:
    """Read and measure the log of one run; a text is the reason why it gave nothing."""
    try:
        car = with_load(vehicle, run)
        own = replace(signal_map, optional=_OPTIONAL.get(request.kind, frozenset()))
        signals = load_signals(run.logs, vehicle=car, signal_map=own, dbc=dbc)
        if request.whole_only and signals.quality.truncated:
            why = "; ".join(signals.quality.notes[:1]) or "part of it is missing"
            return f"{run.logs[0].name} is cut ({why}). Try: copy it again"
        return measure_signals(signals, car, run, request)
    except AqualogError as error:
        return error.line()
    except OSError as error:
        return f"{error.filename or run.logs[0]}: {error.strerror or error}"
    except MemoryError:
        return "not enough memory"
    except PanicException as error:
        return f"aqualog failed ({error!s:.200}). Try: `aqualog doctor` on it"


def _number(values: Mapping[str, float | str], key: str) -> float:
    """Return a number of a run's row; NaN where it is missing."""
    try:
        return float(values.get(key, "nan"))
    except ValueError:
        return float("nan")


def _depths(run: Run | None) -> tuple[float, float] | None:
    """Return the water in the left and right track [m] where the campaign gives both."""
    if run is None or not all(k in run.values for k in _DEPTHS):
        return None
    left, right = (1e-3 * _number(run.values, k) for k in _DEPTHS)
    return left, right


def _conditions(run: Run | None) -> Conditions:
    values = {} if run is None else run.values
    return Conditions(
        1e-3 * _number(values, "water_depth_mm"), _number(values, "x_temperature_c"),
        1e-3 * _number(values, "x_texture_mm"),
    )  # fmt: skip
