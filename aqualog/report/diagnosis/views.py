"""Residual channels before and after for the page: thin points of the drive, medians in bins of each coordinate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.records import ResidualView
from aqualog.diagnose.unknown_term import COORDINATES
from aqualog.report.diagnosis.words import channel_title
from aqualog.report.figures import axis, dots, figure, line, rounded
from aqualog.report.theme import wheel_colour
from aqualog.report.values import plot_text, pretty_unit

__all__ = ["AFTER", "BEFORE", "binned", "coordinate_axis", "view_data", "view_figures"]

BEFORE, AFTER = "#D55E00", wheel_colour("fl")
MOST_POINTS = 1200  # of one channel of one drive
MOST_PLOTTED = 60_000  # of all channels and drives together
_ALONG = ("t", "position")  # coordinates that a drive passes through in order
_BINS = {True: 60, False: 24}
_FEWEST, _MEANT = 8, 15  # samples in a bin that is drawn; on average where there are few
_SPREAD = (50.0, 15.865, 84.135)  # [%] median, and what one standard deviation of a normal distribution holds


def coordinate_axis(name: str) -> tuple[str, float, float]:
    """Title with unit, factor and offset of a coordinate; one that is not known keeps its name and value."""
    if name not in COORDINATES:
        return plot_text(name.replace("_", " ")), 1.0, 0.0
    c = COORDINATES[name]
    return f"{c.title} [{c.page_unit}]", c.factor, c.offset


def view_data(views: Sequence[ResidualView], explained: Sequence[str] = (), over: str = "") -> dict[str, Any]:
    """Data that the page's script draws.

    Parameters
    ----------
    views : sequence of ResidualView
    explained : sequence of str
        Channels whose error the causes reduce, the most reduced first. The page opens with that panel, over the
        coordinate that matters most to all of them.
    over : str
        Coordinate with which it opens, if the drives have it: that of the cause, as the place of a road.

    Returns
    -------
    dict
        `drives` names; `coordinates` [name, axis title, drawn as a line]; `start` the first coordinate; `tables`
        decimated coordinates, shared by the channels of a drive; `views` with `before`, `after` (None: the model is
        unchanged), `bins` by coordinate as [x, before (median, low, high), after], and `limits` of the residual's axis.
    """
    drives = list(dict.fromkeys(v.drive for v in views))
    names = list(dict.fromkeys(c for v in views for c in v.coordinates))
    tables: list[dict[str, list[float | None]]] = []
    known: dict[tuple[str, int, bytes], int] = {}
    most = min(MOST_POINTS, max(100, MOST_PLOTTED // max(1, len(views))))
    shown = []
    order = {c: i for i, c in enumerate(explained)}
    # sorting keeps the order of the channels that no cause explains
    for v in sorted(views, key=lambda v: order.get(v.channel, len(order))):
        step = max(1, -(-v.before.size // most))
        key = (v.drive, v.before.size, b"".join(x[::step].tobytes() for x in v.coordinates.values()))
        if key not in known:
            known[key] = len(tables)
            tables.append({c: rounded(_scaled(c, x[::step])) for c, x in v.coordinates.items()})
        shown.append(_view(v, drives.index(v.drive), known[key], step))
    return {
        "drives": [plot_text(d) for d in drives],
        "coordinates": [[c, coordinate_axis(c)[0], c in _ALONG] for c in names],
        "start": over if over in names else _start(views, explained),
        "tables": tables,
        "views": shown,
    }


def view_figures(
    views: Sequence[ResidualView], explained: Sequence[str] = (), *, most: int = 4
) -> list[dict[str, Any]]:
    """Return the first channels over the coordinate that the page opens with: points before, medians before and after.

    Arguments as `view_data`; `most` is the number of figures.
    """
    data = view_data(views, explained)
    start = data["start"]
    if start is None:
        return []
    figures = []
    for v in data["views"][:most]:
        x, bins = data["tables"][v["coordinates"]].get(start), v["bins"].get(start)
        if x is None:
            continue
        lines = [] if bins is None else [
            line(name, bins[0], part[0], colour)
            for part, name, colour in zip(bins[1:], ("before", "after"), (BEFORE, AFTER), strict=False)
        ]  # fmt: skip
        samples = dots("samples before", x, v["before"], BEFORE, size=3, style={"opacity": 0.25})
        drive = f", {data['drives'][v['drive']]}" if len(data["drives"]) > 1 else ""
        title = v["title"] + drive
        figures.append(figure([samples, *lines], title, axis(coordinate_axis(start)[0]), axis("", v["limits"])))
    return figures


def _view(v: ResidualView, drive: int, coordinates: int, step: int) -> dict[str, Any]:
    is_changed = not np.array_equal(v.before, v.after, equal_nan=True) and bool(np.isfinite(v.after).any())
    both = [v.before, v.after] if is_changed else [v.before]
    unit = pretty_unit(v.unit)
    is_plain = v.title.lower().replace("_", " ") in ("", v.channel.replace("_", " "))
    title = channel_title(v.channel) if is_plain else v.title
    return {
        "drive": drive,
        "coordinates": coordinates,
        "title": plot_text(f"{title[:1].upper()}{title[1:]}{f' [{unit}]' if unit else ''}"),
        "unit": plot_text(unit.strip("–")),
        "every_s": round(step * v.dt, 3) if math.isfinite(v.dt) else None,  # None: no samples of a drive but runs
        "before": rounded(v.before[::step]),
        "after": rounded(v.after[::step]) if is_changed else None,
        "bins": {c: _bins(_scaled(c, x), both, is_along=c in _ALONG) for c, x in v.coordinates.items()},
        "limits": _limits(both),
    }


def _scaled(name: str, x: FloatArray) -> FloatArray:
    _, factor, offset = coordinate_axis(name)
    return factor * np.asarray(x, dtype=np.float64) + offset


def _bins(x: FloatArray, both: Sequence[FloatArray], *, is_along: bool) -> list[Any] | None:
    """Centres, and median with spread of each residual; None where the coordinate does not change."""
    edges = _edges(x, is_along=is_along)
    if edges is None:
        return None
    centres = 0.5 * (edges[1:] + edges[:-1])
    return [rounded(centres), *([rounded(row) for row in binned(x, y, edges)] for y in both)]


def _edges(x: FloatArray, *, is_along: bool) -> FloatArray | None:
    known = x[np.isfinite(x)]
    if not known.size:
        return None
    low, high = np.percentile(known, (0.0, 100.0) if is_along else (0.5, 99.5)).tolist()
    bins = min(_BINS[is_along], max(2, known.size // _MEANT))
    return np.linspace(low, high, bins + 1) if high > low else None


def _start(views: Sequence[ResidualView], explained: Sequence[str]) -> str | None:
    """Coordinate whose bins explain most of what the causes take off, mean over the explained channels; else time.

    All panels share it: that of the first channel alone may show nothing in the others. Time and place explain whatever
    is smooth, so they count half.
    """
    names = [c for v in views for c in v.coordinates]
    own = [next(v for v in views if v.channel == c) for c in explained if any(v.channel == c for v in views)]
    told: dict[str, float] = {}
    for v in own:
        gained = v.before if v.after is None else v.before - v.after
        for name, x in v.coordinates.items():
            told[name] = told.get(name, 0.0) + _share(x, gained, _edges(x, is_along=False)) * (
                0.5 if name in _ALONG else 1.0
            )
    if told:
        return max(told, key=lambda name: told[name])
    return "t" if "t" in names else next(iter(names), None)


def _share(x: FloatArray, y: FloatArray, edges: FloatArray | None) -> float:
    """Share of the mean size of `y`, about its median, that bins of `x` explain: no outlier or end of `x` decides."""
    if edges is None:
        return 0.0
    middle = binned(x, y, edges)[0]
    rest = y - middle[np.clip(np.searchsorted(edges, x, side="right") - 1, 0, middle.size - 1)]
    known = np.isfinite(rest)
    total = float(np.abs(y[known] - np.median(y[known])).sum())
    return 1.0 - float(np.abs(rest[known]).sum()) / total if total > 0.0 else 0.0


def binned(x: FloatArray, y: FloatArray, edges: FloatArray) -> FloatArray:
    """Median, and the ends of the middle 68 %, of `y` in bins of `x`; NaN in bins of less than 8 samples.

    The median is used because a single outlier is not an effect.

    Parameters
    ----------
    x, y : array (n,)
        NaN where not known.
    edges : array (k + 1,)
        Increasing; the last bin holds its upper end.

    Returns
    -------
    array (3, k)
        Median, low, high.
    """
    out = np.full((3, edges.size - 1), np.nan)
    both: BoolArray = np.isfinite(x) & np.isfinite(y) & (x >= edges[0]) & (x <= edges[-1])
    place = np.minimum(np.searchsorted(edges, x[both], side="right") - 1, edges.size - 2)
    order = np.argsort(place, kind="stable")
    values, begins = y[both][order], np.searchsorted(place[order], np.arange(edges.size))
    for i, (a, b) in enumerate(pairwise(begins.tolist())):
        if b - a >= _FEWEST:
            out[:, i] = np.percentile(values[a:b], _SPREAD)
    return out


def _limits(both: Sequence[FloatArray]) -> list[float] | None:
    """Axis range of a residual that holds zero and does not stretch to single outliers."""
    values = np.concatenate([y[np.isfinite(y)] for y in both])
    if not values.size:
        return None
    low, high = np.percentile(values, (0.3, 99.7)).tolist()
    low, high = min(low, 0.0), max(high, 0.0)
    margin = 0.08 * (high - low) or 1.0
    return [float(f"{low - margin:.5g}"), float(f"{high + margin:.5g}")]
