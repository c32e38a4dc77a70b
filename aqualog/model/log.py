"""A simulated drive as a log file, or as the table of signals without a file between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.align.grid import bin_mean, gap_limit_ns, hold, linear, median_period_ns, placed
from aqualog.align.mapping import Entry, SignalMap, resolve
from aqualog.align.table import build_signals
from aqualog.core.notation import ACCEPTED, SYMBOLS
from aqualog.core.records import Channel, ChannelInfo, FloatArray, Signals, TimeArray
from aqualog.core.vehicle import Vehicle
from aqualog.io.write_log import LogGroup, write_log
from aqualog.model.sensors import Measured
from aqualog.model.simulate import TRUTH_SYMBOLS, Simulation

__all__ = ["START_NS", "as_signals", "grid_of", "groups_of", "signals_of", "table_of", "write_simulation"]

START_NS = 1_748_000_000_000_000_000  # arbitrary: a drive must be the same whenever it is simulated
_OWN_STAMPS = (".mf4", ".mcap")  # formats in which each group keeps the time stamps of its messages


def write_simulation(path: Path, simulation: Simulation, *, suffix: str, comment: str) -> None:
    """Write a drive in the format of a suffix; the same drive gives the same bytes."""
    groups = groups_of(simulation) if suffix in _OWN_STAMPS else table_of(simulation)
    write_log(path, grid_of(simulation), groups, suffix=suffix, start_ns=START_NS, comment=comment, written_ns=START_NS)


def signals_of(simulation: Simulation, vehicle: Vehicle, file: str) -> Signals:
    """Return the signals that reading the drive's MDF log gives, without writing it; `file` is the log's name."""
    channels = {}
    for group in groups_of(simulation):
        assert group.t_ns is not None
        for name, (unit, _, x) in group.columns.items():
            info = ChannelInfo(f"{group.name}.{name}", name, unit, x.size, file)
            channels[info.path] = Channel(info, group.t_ns + START_NS, x, absolute=True)
    found = resolve([c.info for c in channels.values()], SignalMap())
    mapped = {symbol: (entry, channels[info.path]) for symbol, (entry, info) in found.items()}
    return build_signals(mapped, signal_map=SignalMap(), vehicle=vehicle, file_faults=[], rate_hz=None)


def groups_of(simulation: Simulation) -> list[LogGroup]:
    """Return groups with the time stamps of their bus messages."""
    return [
        LogGroup(g.name, {n: (*_about(n), x) for n, x in g.columns.items()}, _stamps(g)) for g in simulation.measured
    ]


def table_of(simulation: Simulation) -> list[LogGroup]:
    """Put all groups on one grid at the scenario's rate, as in a logger's table."""
    grid = grid_of(simulation)
    return [
        LogGroup(g.name, {n: (*_about(n), x) for n, x in _onto(grid, _stamps(g), g.columns).items()})
        for g in simulation.measured
    ]


def grid_of(simulation: Simulation) -> TimeArray:
    """Return the time of the table's rows from the start. [ns]"""
    scenario = simulation.setup.scenario
    dt_ns = round(1e9 / scenario.rate_hz)
    return np.arange(max(round(scenario.duration_s * scenario.rate_hz), 2), dtype=np.int64) * dt_ns


def _stamps(group: Measured) -> TimeArray:
    return np.rint(group.t * 1e9).astype(np.int64)


def _about(name: str) -> tuple[str, str]:
    """Return unit and meaning of a channel."""
    symbol = SYMBOLS.get(name) or ACCEPTED.get(name)
    return (symbol.unit, symbol.meaning) if symbol else TRUTH_SYMBOLS[name]


def _onto(grid: TimeArray, t_ns: TimeArray, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Resample linearly; hold states; average where signals are much faster than the grid."""
    period_ns, dt_ns = median_period_ns(t_ns), int(grid[1] - grid[0])
    at = placed(t_ns, grid, dt_ns) if t_ns.size else None
    found = {}
    for name, x in columns.items():
        symbol = SYMBOLS.get(name)
        is_state = symbol is not None and symbol.kind == "state"
        gap_ns = gap_limit_ns(period_ns, is_state=is_state)
        if is_state:
            found[name] = hold(t_ns, x, grid, gap_ns=gap_ns, at=at)
        elif 0 < period_ns < dt_ns / 2:
            found[name] = bin_mean(t_ns, x, grid, dt_ns=dt_ns, gap_ns=gap_ns, period_ns=period_ns, at=at)[0]
        else:
            found[name] = linear(t_ns, x, grid, gap_ns=gap_ns, period_ns=period_ns, at=at)[0]
    return found


_FILE = "simulated"


def as_signals(simulation: Simulation, *, vehicle: Vehicle | None = None, truth: bool = True) -> Signals:
    """Return the signals that loading this drive's written table gives, and the truth beside them.

    Parameters
    ----------
    vehicle : Vehicle, optional
        The car as the reader of the log knows it (it decides which wheel speeds are impossible); default the
        simulated one.
    truth : bool
        With the columns `true_*` on the same grid. No detector reads them, nor the labels (`on_water`,
        `water_depth_left`): `aqualog.features.stream.INPUTS`.

    Returns
    -------
    signals : Signals
        `frame`: `t` [s] from 0 on the grid of the scenario's rate, canonical columns, truth last; a sample that no
        sensor gave is null. `start_ns` is that of the written logs; `origins` has the canonical columns only.

    Raises
    ------
    SignalError
        If no signal has a sample.
    """
    grid = grid_of(simulation)
    columns = {n: (unit, x) for g in table_of(simulation) for n, (unit, _, x) in g.columns.items()}
    mapped = {}
    for name, (unit, x) in columns.items():
        if name in SYMBOLS or name in ACCEPTED:
            info = ChannelInfo(name, name, unit, x.size, _FILE)
            mapped[name] = (Entry(name, (name,)), Channel(info, START_NS + grid, x, absolute=True))
    signals = build_signals(mapped, signal_map=SignalMap(), vehicle=vehicle or simulation.setup.scenario.vehicle)
    if not truth:
        return signals
    known = [pl.Series(n, x, nan_to_null=True) for n, (_, x) in columns.items() if n.startswith("true_")]
    # a grid that begins or ends with dropped samples is shorter than the drive
    first = round((signals.start_ns or START_NS) - START_NS) // signals.dt_ns
    known = [s.slice(first, signals.frame.height) for s in known]
    return replace(signals, frame=signals.frame.with_columns(known))
