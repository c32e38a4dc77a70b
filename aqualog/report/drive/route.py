"""The drive from above, from latitude and longitude: where the car was how fast, and where the events are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import DriveResult, Event, FloatArray
from aqualog.report.figures import axis, dots, figure, rounded
from aqualog.report.theme import INK, MUTED
from aqualog.report.values import KMH, place, plot_text
from aqualog.report.wording import detector_name

__all__ = ["route_figure", "route_metres"]

EARTH_M = 6_371_000.0  # mean radius of the earth
LEAST_M = 30.0  # a shorter way than this is the noise of a position
POINTS = 2500  # of the whole way, at equal distances
MOST_EVENTS = 400  # that are marked, the most important ones
_LOOKS = (("partial", "event", "#E69F00"), ("full", "event, full", "#B2182B"))


def route_metres(latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres to the east and to the north of the first known position.

    Parameters
    ----------
    latitude, longitude : array (n,)
        [deg], NaN where unknown. A position of exactly 0, 0 is that of a receiver without a fix and counts as unknown.

    Returns
    -------
    east, north : array (n,)
        [m] on a plane that touches the earth there, which is off by less than 0.1 % within 100 km of the equator's
        side of 60 degrees; NaN where unknown.
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


def route_figure(result: DriveResult, events: Sequence[Event]) -> dict[str, Any] | None:
    """The figure; None for a log without positions, or of a car that stood.

    Parameters
    ----------
    result : DriveResult
    events : sequence of Event
        The most important first. A mark has the index of its event in `result.events` for the page's script.
    """
    frame = result.signals.frame
    if not {"latitude", "longitude"} <= set(frame.columns):
        return None
    east, north = route_metres(*(result.signals.array(s) for s in ("latitude", "longitude")))
    step = np.hypot(np.diff(east, prepend=east[:1]), np.diff(north, prepend=north[:1]))
    way = np.cumsum(np.nan_to_num(step))
    if not way.size or way[-1] < LEAST_M:
        return None
    dt = result.signals.dt
    shown = _spread(way, np.isfinite(east))
    v = KMH * (
        result.features["v_x_hat"].to_numpy() if "v_x_hat" in result.features.columns else np.full(way.size, np.nan)
    )
    fast = [None if x is None else round(x, 1) for x in rounded(v[shown])]
    has_speed = any(x is not None for x in fast)
    colour = {
        "color": fast, "colorscale": "Cividis", "showscale": True,
        "colorbar": {"title": {"text": "v_x [km/h]", "side": "right"}, "thickness": 12, "outlinewidth": 0},
    } if has_speed else {"color": MUTED}  # fmt: skip
    data = [
        *_marks(result, events, east, north),
        {
            "type": "scatter", "mode": "markers", "name": "drive", "showlegend": False, "x": rounded(east[shown]),
            "y": rounded(north[shown]), "marker": {"size": 5, **colour},
            "customdata": [[round(float(i) * dt, 2), x] for i, x in zip(shown, fast, strict=True)],
            "hovertemplate": "%{customdata[0]:.2f} s, %{customdata[1]} km/h<extra></extra>",
        },
        _end("start", "circle-open", east[shown[0]], north[shown[0]]),
        _end("end", "x", east[shown[-1]], north[shown[-1]]),
    ]  # fmt: skip
    return figure(
        data, "", axis("east [m]"), axis("north [m]", scaleanchor="x", scaleratio=1), height=480, showlegend=True,
        margin={"t": 10, "l": 66},
    )  # fmt: skip


def _spread(way: FloatArray, known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Known samples at about equal distances along the way."""
    steps = np.floor(way / way[-1] * POINTS)
    inside = np.flatnonzero(known)
    return inside[np.concatenate([[True], np.diff(steps[inside]) > 0])].astype(np.int64)


def _marks(result: DriveResult, events: Sequence[Event], east: FloatArray, north: FloatArray) -> list[dict[str, Any]]:
    """Each event as a thick line under the drive, where it begins as a marker; by severity."""
    dt, found = result.signals.dt, []
    index = {id(e): i for i, e in enumerate(result.events)}
    for severity, name, colour in _LOOKS:
        x: list[float | None] = []
        y: list[float | None] = []
        which: list[list[Any] | None] = []
        for event in events[:MOST_EVENTS]:
            if event.severity != severity:
                continue
            begin, end = (int(np.clip(round(t / dt), 0, east.size - 1)) for t in (event.start_s, event.end_s))
            own = np.unique(np.linspace(begin, end, min(20, end - begin + 1)).astype(np.int64))
            x += [*rounded(east[own]), None]
            y += [*rounded(north[own]), None]
            where = place(event.wheel, event.side)
            text = f"{detector_name(event.detector)} {where}".rstrip()
            words = plot_text(f"{text}, {event.start_s:.2f} – {event.end_s:.2f} s")
            which += [[index[id(event)], words]] * own.size + [None]
        if x:
            found.append({
                "type": "scatter", "mode": "lines+markers", "name": name, "x": x, "y": y, "customdata": which,
                "line": {"color": colour, "width": 13}, "marker": {"color": colour, "size": 13}, "opacity": 0.75,
                "hovertemplate": "%{customdata[1]}<extra></extra>",
            })  # fmt: skip
    return found


def _end(name: str, symbol: str, x: float, y: float) -> dict[str, Any]:
    return dots(
        name, [x], [y], INK, size=12, style={"symbol": symbol}, mode="markers+text", text=[name], showlegend=False,
        textposition="top center",
    )  # fmt: skip
