"""The drive from above, from latitude and longitude: where the car was how fast, and where the events are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.judgement import Episode, EpisodeKind
from aqualog.core.records import DriveResult, FloatArray
from aqualog.report.drive.judged import FOLDED, KIND_NAMES, episode_sentence
from aqualog.report.figures import axis, dots, figure, line, rounded
from aqualog.report.theme import INK, MUTED, THRESHOLD
from aqualog.report.values import KMH, plot_text

__all__ = ["route_figure", "route_metres"]

EARTH_M = 6_371_000.0  # mean radius of the earth
_PARTS = 20  # points of a mark
LEAST_M = 30.0  # a shorter way than this is the noise of a position
POINTS = 2500  # of the whole way, at equal distances
MOST_MARKS = 400  # of a kind of episode
_LOOKS: Mapping[EpisodeKind, str] = {
    "aquaplaning": THRESHOLD, "suspected": "#E69F00", "other_surface": "#8C6D31", "wheel_lock": "#7F6BB3",
    "single_detector": "#CC79A7",
}  # fmt: skip
"""Colour of each kind of episode; the first ones lie above."""


def route_metres(latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres to the east and to the north of the first known position.

    Parameters
    ----------
    latitude, longitude : array (n,)
        [deg], NaN where unknown. A position of exactly 0, 0 is that of a receiver without a fix and counts as unknown.

    Returns
    -------
    east, north : array (n,)
        [m] NaN where unknown. The scale to the east is that of the first position: 100 km to the north of it, at 50
        degrees, it is 2 % too large.
    """
    known = np.isfinite(latitude) & np.isfinite(longitude) & ((latitude != 0.0) | (longitude != 0.0))
    east, north = np.full(latitude.size, np.nan), np.full(latitude.size, np.nan)
    if known.any():
        first = int(np.argmax(known))
        # the shorter way around the earth
        turn = (longitude[known] - longitude[first] + 180.0) % 360.0 - 180.0
        east[known] = EARTH_M * np.cos(np.radians(latitude[first])) * np.radians(turn)
        north[known] = EARTH_M * np.radians(latitude[known] - latitude[first])
    return east, north


def route_figure(result: DriveResult, tables: Mapping[str, Sequence[Episode]]) -> dict[str, Any] | None:
    """The figure; None for a log without positions, or of a car that stood.

    Parameters
    ----------
    result : DriveResult
    tables : mapping
        Episodes by the page's table that has them as rows. A mark has both, so that a click can lead there.
    """
    if not {"latitude", "longitude"} <= set(result.signals.frame.columns):
        return None
    east, north = route_metres(*(result.signals.array(s) for s in ("latitude", "longitude")))
    step = np.hypot(np.diff(east, prepend=east[:1]), np.diff(north, prepend=north[:1]))
    way = np.cumsum(np.nan_to_num(step))
    if not way.size or way[-1] < LEAST_M:
        return None
    shown = _spread(way, np.isfinite(east))
    data = [
        *_marks(tables, east, north, result.signals.dt),
        _drive(result, east, north, shown),
        _end("start", "circle-open", east[shown[0]], north[shown[0]], "top center"),
        _end("end", "x", east[shown[-1]], north[shown[-1]], "bottom center"),
    ]
    return figure(
        data, "", axis("east [m]"), axis("north [m]", scaleanchor="x", scaleratio=1), height=480, showlegend=True,
        margin={"t": 10, "l": 66},
    )  # fmt: skip


def _drive(result: DriveResult, east: FloatArray, north: FloatArray, shown: NDArray[np.int64]) -> dict[str, Any]:
    """The way as dots, coloured by speed where that is known."""
    v = (
        result.features["v_x_hat"].to_numpy()[shown]
        if "v_x_hat" in result.features.columns
        else np.full(shown.size, np.nan)
    )
    fast = [None if x is None else round(x, 1) for x in rounded(KMH * v)]
    times = [round(float(i) * result.signals.dt, 2) for i in shown]
    if all(x is None for x in fast):
        hover = "%{customdata[0]:.2f} s<extra></extra>"
        colour: dict[str, Any] = {"color": MUTED}
    else:
        hover = "%{customdata[0]:.2f} s, %{customdata[1]} km/h<extra></extra>"
        colour = {
            "color": fast, "colorscale": "Cividis", "showscale": True,
            "colorbar": {"title": {"text": "v_x [km/h]", "side": "right"}, "thickness": 12, "outlinewidth": 0},
        }  # fmt: skip
    return dots(
        "drive", east[shown], north[shown], None, style=colour, showlegend=False, hovertemplate=hover,
        customdata=[list(x) for x in zip(times, fast, strict=True)],
    )  # fmt: skip


def _spread(way: FloatArray, known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Known samples at about equal distances along the way."""
    steps = np.floor(way / way[-1] * POINTS)
    inside = np.flatnonzero(known)
    first: NDArray[np.int64] = inside[np.concatenate([[True], np.diff(steps[inside]) > 0])].astype(np.int64)
    return first


def _marks(
    tables: Mapping[str, Sequence[Episode]], east: FloatArray, north: FloatArray, dt: float
) -> list[dict[str, Any]]:
    """Each episode as a thick line under the drive; one trace for each kind."""
    found: list[dict[str, Any]] = []
    for kind in reversed(tuple(_LOOKS)):
        own = [(t, i, e) for t, of in tables.items() for i, e in enumerate(of) if e.kind == kind][:MOST_MARKS]
        x: list[float | None] = []
        y: list[float | None] = []
        which: list[list[Any] | None] = []
        for table, row, episode in own:
            begin, end = (int(np.clip(round(t / dt), 0, east.size - 1)) for t in (episode.start_s, episode.end_s))
            part = np.unique(np.linspace(begin, end, min(_PARTS, end - begin + 1)).astype(np.int64))
            x += [*rounded(east[part]), None]
            y += [*rounded(north[part]), None]
            words = plot_text(f"{KIND_NAMES[kind].capitalize()}: {episode_sentence(episode)}")
            which += [*[[table, row, words]] * part.size, None]
        if own:
            width = 9 if kind in FOLDED else 13
            found.append(line(
                KIND_NAMES[kind], x, y, _LOOKS[kind], width=width, mode="lines+markers", customdata=which, opacity=0.75,
                marker={"color": _LOOKS[kind], "size": width}, hovertemplate="%{customdata[2]}<extra></extra>",
            ))  # fmt: skip
    return found


def _end(name: str, symbol: str, x: float, y: float, place: str) -> dict[str, Any]:
    return dots(
        name, [x], [y], INK, size=12, style={"symbol": symbol}, mode="markers+text", text=[name], showlegend=False,
        textposition=place,
    )  # fmt: skip
