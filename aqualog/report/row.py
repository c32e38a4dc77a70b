"""The parts of a row of the stack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import DriveResult, FloatArray
from aqualog.report.reduce import Spans
from aqualog.report.theme import wheel_colour

if TYPE_CHECKING:
    import polars as pl

__all__ = ["VEHICLE", "Lane", "Line", "Row", "feature", "wheel_lines"]

VEHICLE = "vehicle"  # group of everything that belongs to no wheel


@dataclass(frozen=True, slots=True)
class Line:
    """One signal over time. Lines of one `group` are shown and hidden together.

    `units` are the values' and the axis's: of a long drive only the drawn values are converted.
    """

    label: str
    group: str
    colour: str
    values: FloatArray
    width: float = 1.3
    units: tuple[str, str] = ("-", "-")


@dataclass(frozen=True, slots=True)
class Lane:
    """One bit over time, drawn as bars."""

    label: str
    group: str
    colour: str
    spans: Spans


@dataclass(frozen=True, slots=True)
class Row:
    """One pair of axes in the stack.

    `caption` describes the row; `thresholds` are drawn dashed; the y axis always shows the values in `include` and
    never less than `least_span`;    `shades` are index ranges marked by a strip along the bottom.
    """

    title: str
    caption: str
    unit: str
    lines: tuple[Line, ...] = ()
    lanes: tuple[Lane, ...] = ()
    thresholds: tuple[float, ...] = ()
    include: tuple[float, ...] = ()
    shades: Spans | None = None
    least_span: float = 0.0
    height: int = 120
    decimals: int = 2


def feature(frame: pl.DataFrame, name: str) -> FloatArray | None:
    """A column as floats; None where it is absent or has no value at all."""
    import polars as pl

    if name not in frame.columns:
        return None
    column = frame[name].cast(pl.Float64)
    values: FloatArray = (column.fill_null(np.nan) if column.null_count() else column).to_numpy()
    return values if np.isfinite(values).any() else None


def wheel_lines(result: DriveResult, stem: str, units: tuple[str, str] = ("-", "-")) -> tuple[Line, ...]:
    """The lines of the wheels that have this feature; `units` are the feature's and the axis's."""
    columns: Sequence[tuple[str, FloatArray | None]] = [(w, feature(result.features, f"{stem}_{w}")) for w in WHEELS]
    return tuple(Line(w.upper(), w, wheel_colour(w), v, units=units) for w, v in columns if v is not None)
