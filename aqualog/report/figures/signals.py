"""The signals of a drive over time, a row for each unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from aqualog.core.notation import SYMBOLS, WHEELS
from aqualog.core.records import Signals
from aqualog.core.units import displayed_unit
from aqualog.report.figures.row import VEHICLE, Line, Row
from aqualog.report.standalone import rows_figure
from aqualog.report.theme import wheel_colour

if TYPE_CHECKING:
    import plotly.graph_objects as go

__all__ = ["signals_figure"]

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#7F6BB3", "#8C6D31")


def signals_figure(signals: Signals, title: str) -> go.Figure:
    """Return the signals over time; those of one stem and unit share a row."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in signals.symbols:
        if np.isfinite(signals.array(name)).any():
            groups.setdefault((_stem(name), SYMBOLS[name].unit), []).append(name)
    rows = [
        Row(stem, _caption(names), displayed_unit(unit), lines=tuple(_line(signals, n, i) for i, n in enumerate(names)))
        for (stem, unit), names in groups.items()
    ]
    made = rows_figure(rows, signals.frame.height, signals.dt)
    made.update_layout(meta={"title": title})
    return made


def _caption(names: Sequence[str]) -> str:
    """The meaning of a signal, or the names where several share the row."""
    return SYMBOLS[names[0]].meaning if len(names) == 1 else ", ".join(names)


def _stem(name: str) -> str:
    stem, _, end = name.rpartition("_")
    return stem if end in WHEELS else name


def _line(signals: Signals, name: str, i: int) -> Line:
    wheel = name[-2:] if name[-2:] in WHEELS else None
    return Line(
        name, wheel or VEHICLE, wheel_colour(wheel) if wheel else _COLOURS[i % len(_COLOURS)], signals.array(name)
    )
