"""Turn a simulated drive into the table of signals, without a file between."""

from __future__ import annotations

import polars as pl

from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.table import build_signals
from aqualog.core.notation import ACCEPTED, SYMBOLS
from aqualog.core.records import Channel, ChannelInfo, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.model.log import START_NS, grid_of, table_of
from aqualog.model.simulate import Simulation

__all__ = ["as_signals"]

_FILE = "simulated"


def as_signals(simulation: Simulation, *, vehicle: Vehicle | None = None, truth: bool = True) -> Signals:
    """Return the signals that loading this drive's written table gives, and the truth beside them.

    Parameters
    ----------
    simulation : Simulation
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
    known = [pl.Series(n, x).fill_nan(None) for n, (_, x) in columns.items() if n.startswith("true_")]
    # a grid that begins or ends with dropped samples is shorter than the drive
    first = round((signals.start_ns or START_NS) - START_NS) // signals.dt_ns
    known = [s.slice(first, signals.frame.height) for s in known]
    return Signals(
        signals.frame.with_columns(known),
        signals.dt_ns,
        signals.start_ns,
        signals.origins,
        signals.quality,
        signals.files,
    )
