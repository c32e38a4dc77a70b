"""Figure W.1: what others have published on water under tyres, and the simulator in the same conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.published import V_MOST, Compared, Condition, compared, contact, drag, full_speed, rms, tyre_of
from aqualog.physics.hydroplaning import gallaway_speed, horne_speed, pavdrn_speed, usf_speed
from aqualog.report.theme import MUTED
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.evidence.campaign import KMH
from aqualog.thesis.figures.panels import PALETTE, V_KMH
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table

__all__ = ["FIGURES"]

Of = Callable[[Condition], float]

_DEPTHS = np.concatenate([np.arange(0.4, 2.0, 0.1), np.arange(2.0, 10.1, 0.25)])  # [mm]
_V = np.arange(20.0, 141.0, 1.0)  # [km/h]
_USUAL = Condition(3.0, 1.6, 1.9, 4000.0)
_TREADS, _PRESSURES, _LOADS = (1.6, 4.0, 7.8), (1.4, 1.9, 2.2, 2.8), (3000.0, 4000.0, 5200.0)
_DRAG_DEPTHS = (0.6, 1.3, 2.0, 8.0)
_tread_of, _depth_of, _speed_of = attrgetter("tread"), attrgetter("depth"), attrgetter("speed")
_TEXTURE = 0.78e-3  # [m] of the road in the formula of [gallaway1979]
_NAMES = {
    "full_speed": "full aquaplaning", "contact": "contact", "fade": "fade of friction", "drag": "drag",
    "drag_ratio": "ratio of drags", "drag_by_speed": "drag: exponent over speed",
    "drag_by_depth": "drag: exponent over depth", "drag_peak": "drag: speed of its peak over full",
}  # fmt: skip
_HEAD = ("Point", "Quantity", "Condition", "Source", "Published", "Simulated", "Inside its tolerance")


def _float_line(name: str, at: Condition, colour: str) -> Line:
    """Speed of full aquaplaning over depth; broken where the tyre does not float."""
    speeds = [full_speed(tyre_of(at), replace(at, depth=float(h)), "spin-down") for h in _DEPTHS]
    y = np.array([v if v < V_MOST else np.nan for v in speeds])
    return Line(name, _DEPTHS, y, colour=colour)


def _marks(rows: Sequence[Compared], level: Of, levels: Sequence[float], x: Of) -> list[Line]:
    """Published points over `x`, in the colour of the nearest level; those from memory are hollow."""
    lines = []
    for i, nearest in enumerate(levels):
        for memory in (False, True):
            own = [r.point for r in rows if (r.point.mark == "K") == memory
                   and min(levels, key=lambda v: abs(v - level(r.point.at))) == nearest]  # fmt: skip
            if own:
                low, high = np.array([p.low for p in own]), np.array([p.high for p in own])
                name = f"published{' (K)' if memory else ''}, near {nearest:g}"
                lines.append(
                    Line(name, np.array([x(p.at) for p in own]), 0.5 * (low + high), low=low, high=high,
                         colour=PALETTE[i], mode="markers", symbol="circle-open" if memory else "circle")
                )  # fmt: skip
    return lines


def _formulas(p: float) -> list[Line]:
    """The formulas of `physics.hydroplaning`, worn tyre and 4 kN, at a pressure [bar]; that of thin films to 2.4 mm."""
    h, pressure, load = _DEPTHS * 1e-3, np.full_like(_DEPTHS, p * 1e5), np.full_like(_DEPTHS, 4000.0)
    thin = np.where(_DEPTHS <= 2.4, pavdrn_speed(h), np.nan)
    found: dict[str, tuple[FloatArray, str]] = {
        "Gallaway": (gallaway_speed(h, pressure, tread_depth=1.6e-3, texture_depth=_TEXTURE), "dash"),
        "USF": (usf_speed(h, pressure, load), "dot"),
        "PAVDRN": (thin, "dashdot"),
        "Horne": (horne_speed(pressure), "longdash"),
    }
    return [Line(f"{n} (K)", _DEPTHS, v / KMH, colour=MUTED, dash=d, width=1.2) for n, (v, d) in found.items()]


def _speeds(rows: Sequence[Compared]) -> list[Panel]:
    """Full aquaplaning over depth: by tread, by pressure, by load."""
    own = [r for r in rows if r.point.quantity == "full_speed"]
    axes = Axis("water", "mm", limits=(0.0, 10.0)), Axis("full aquaplaning", "km/h", limits=(40.0, 160.0))
    by_tread = [_float_line(f"{t:g} mm", replace(_USUAL, tread=t), PALETTE[i]) for i, t in enumerate(_TREADS)]
    by_p = [_float_line(f"{p:g} bar", replace(_USUAL, pressure=p), PALETTE[i]) for i, p in enumerate(_PRESSURES)]
    by_load = [_float_line(f"{f:g} N", replace(_USUAL, load=f), PALETTE[i]) for i, f in enumerate(_LOADS)]
    worn = [r for r in own if r.point.at.tread <= 2.4]
    depth = _depth_of
    return [
        Panel("Tread: 1.9 bar, 4000 N", *axes, (*by_tread, *_marks(own, _tread_of, _TREADS, depth), *_formulas(1.9))),
        Panel("Pressure: worn, 4000 N", *axes, (*by_p, *_marks(worn, attrgetter("pressure"), _PRESSURES, depth))),
        Panel("Load: worn, 1.9 bar", *axes, (*by_load, *_marks(worn, attrgetter("load"), _LOADS, depth))),
    ]


def _contact(rows: Sequence[Compared]) -> Panel:
    at = replace(_USUAL, pressure=2.2)
    lines = [
        Line(f"{t:g} mm of tread", _V, contact(tyre_of(replace(at, tread=t)), at, _V * KMH), colour=PALETTE[i])
        for i, t in enumerate(_TREADS)
    ]
    own = [r for r in rows if r.point.quantity == "contact"]
    return Panel("Contact: 3 mm, 2.2 bar, 4000 N", V_KMH, Axis("share of the contact"),
                 (*lines, *_marks(own, _tread_of, _TREADS, _speed_of)))  # fmt: skip


def _drag(rows: Sequence[Compared]) -> Panel:
    of = {h: replace(_USUAL, depth=h, tread=1.0) for h in _DRAG_DEPTHS}
    lines = [Line(f"{h:g} mm", _V, drag(tyre_of(at), at, _V * KMH), colour=PALETTE[i])
             for i, (h, at) in enumerate(of.items())]  # fmt: skip
    own = [r for r in rows if r.point.quantity == "drag"]
    return Panel("Drag of both front wheels: 1.0 mm of tread, 1.9 bar, 4000 N", V_KMH, Axis("deceleration", "m/s^2"),
                 (*lines, *_marks(own, _depth_of, _DRAG_DEPTHS, _speed_of)))  # fmt: skip


def _number(value: float, unit: str) -> str:
    return f"{value:.0f}" if unit == "km/h" else f"{value:.2f}"


def _row(r: Compared) -> tuple[str, ...]:
    p, at = r.point, r.point.at
    unit = "" if p.unit == "-" else f" {p.unit}"
    condition = f"{at.depth:g} mm, tread {at.tread:g} mm, {at.pressure:g} bar, {at.load:g} N"
    condition += f", {at.speed:g} km/h" if np.isfinite(at.speed) else ""
    condition += f", contact {at.aspect:g} as wide as long" if np.isfinite(at.aspect) else ""
    condition += f"; {p.path}" if p.path != "straight" else ""
    condition += f"; assumed: {', '.join(p.assumed)}" if p.assumed else ""
    low, high = _number(p.low, p.unit), _number(p.high, p.unit)
    value = f"> {V_MOST:g}" if p.unit == "km/h" and r.value >= V_MOST else _number(r.value, p.unit)
    outside = f"no, {r.deviation:+.3g}{unit}{': ' + p.reason if p.reason else ''}"
    return (
        f"{p.id} ({p.mark})", _NAMES[p.quantity] + (f", {p.criterion}" if p.criterion else ""), condition,
        f"[{p.source}] {p.where}", f"{low if low == high else f'{low} to {high}'} ± {p.tolerance:g}{unit}",
        f"{value}{unit}", "yes" if r.is_inside else outside,
    )  # fmt: skip


def figure_w_01() -> Figure:
    """Full aquaplaning over depth, contact and drag over speed: lines of the simulator, published points, a table."""
    rows = compared()
    speeds = [r for r in rows if r.point.unit == "km/h"]
    return figure_of(
        "W.1",
        (*_speeds(rows), _contact(rows), _drag(rows)),
        (),
        (Table("Published figures and the simulator", _HEAD, tuple(_row(r) for r in rows)),),
        inside=sum(r.is_inside for r in rows),
        total=len(rows),
        rms=rms(speeds),
        rms_read=rms(r for r in speeds if r.point.mark != "K"),
    )


FIGURES = {"W.1": figure_w_01}
