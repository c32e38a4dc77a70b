"""Records of a figure: panels of lines, tables, and the checks of its claims."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from aqualog.core.records import FloatArray
from aqualog.thesis.claims import Check

__all__ = ["Axis", "Figure", "Line", "Note", "Panel", "RunsUsed", "Sheet", "Table", "seconds", "stem_of"]


@dataclass(frozen=True, slots=True)
class Axis:
    """Label and unit of an axis.

    `limits` where not all data shall set the view, `log_base` 2 or 10 for a logarithmic one.
    """

    label: str
    unit: str = "-"
    limits: tuple[float, float] | None = None
    log_base: int = 0

    @property
    def title(self) -> str:
        """Label with unit, as in the header of a table."""
        return f"{self.label} [{self.unit}]"


@dataclass(frozen=True, slots=True)
class Line:
    """One line or cloud of points, arrays (n,); NaN breaks it.

    `low` and `high` (n,) are the ends of an interval about `y`, drawn as a bar; NaN without an interval. `is_filled`:
    the area down to zero. `z` in panels of three dimensions; `count` samples behind each point, which sets its size.
    `group` lines are shown and hidden together, `in_legend` the one that is listed.
    """

    name: str
    x: FloatArray
    y: FloatArray
    z: FloatArray | None = None
    count: FloatArray | None = None
    low: FloatArray | None = None
    high: FloatArray | None = None
    is_filled: bool = False
    colour: str = "@ink"
    dash: str = "solid"
    width: float = 2.0
    opacity: float = 1.0
    mode: Literal["lines", "markers", "lines+markers"] = "lines"
    symbol: str = "circle"
    size: float = 7.0
    group: str = ""
    in_legend: bool = True


@dataclass(frozen=True, slots=True)
class Sheet:
    """A surface: `z` (m, n) over `y` (m,) and `x` (n,)."""

    name: str
    x: FloatArray
    y: FloatArray
    z: FloatArray
    colour: str


@dataclass(frozen=True, slots=True)
class Note:
    """Words at a point; with `tail` an arrow comes from there."""

    text: str
    x: float
    y: float
    tail: tuple[float, float] | None = None
    size: int = 12
    colour: str = "@ink"


@dataclass(frozen=True, slots=True)
class Panel:
    """One plot; of three dimensions if it has an axis `z`. `is_diagram`: boxes and arrows, without scales."""

    title: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]
    z: Axis | None = None
    sheets: tuple[Sheet, ...] = ()
    notes: tuple[Note, ...] = ()
    is_diagram: bool = False


@dataclass(frozen=True, slots=True)
class RunsUsed:
    """Which runs of a campaign a figure rests on: rows of (run, shown as), and how many were left out, by reason."""

    campaign: str
    used: tuple[tuple[str, str], ...]
    left_out: tuple[tuple[str, int], ...] = ()

    @property
    def sentence(self) -> str:
        """In one sentence."""
        out = "; ".join(f"{n} {why}" for why, n in self.left_out)
        return f"{len(self.used)} runs of the campaign {self.campaign}" + (f"; left out: {out}" if out else "")


@dataclass(frozen=True, slots=True)
class Table:
    """Numbers that a verdict rests on."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the thesis with the checks of its claims.

    `caption` gives the settings, in aqualog's words; `runs` the runs used, if it is made from a campaign.
    """

    number: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    checks: tuple[Check, ...] = ()
    tables: tuple[Table, ...] = ()
    runs: RunsUsed | None = None

    @property
    def stem(self) -> str:
        """Name of its files."""
        return stem_of(self.number)


def stem_of(number: str) -> str:
    """Name of a figure's files: figure_3_06 for 3.6."""
    chapter, n = number.split(".")
    return f"figure_{chapter}_{int(n):02d}"


def seconds(t: float) -> str:
    """A detection time; a dash without a detection."""
    return "–" if math.isnan(t) else f"{t:.2f}"
