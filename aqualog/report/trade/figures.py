"""Figures of a tyre test: values in the order of the runs, slip over speed, curves over the entry speed, indices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aqualog.report.campaign.labels import group_text
from aqualog.report.figures import PALETTE, axis, dots, error_bars, figure, line
from aqualog.report.theme import INK, MUTED
from aqualog.report.values import KMH, plot_text, pretty_unit
from aqualog.trade.curve import CurvePass
from aqualog.trade.curve_set import RESULTS
from aqualog.trade.evaluation import SetRow, TradeTest
from aqualog.trade.straight import StraightRun

__all__ = ["trade_figures"]

_CONTROLS = (INK, MUTED)  # the control of one configuration, and of the next
_MOST_CURVES = 60  # runs whose slip is drawn
_UNIT = {"straight": "speed of {level} slip [km/h]", "braking": "braking force coefficient [-]"}


def trade_figures(test: TradeTest) -> dict[str, Any]:
    """Return the figures by name: `data` and `layout` of plotly; those without data are left out."""
    found = {
        "mean": _curves(test, "mean") if test.options.kind == "curve" else None,
        "least": _curves(test, "least") if test.options.kind == "curve" else None,
        "order": _order_of_sets(test) if test.options.kind == "curve" else _order(test),
        "index": _index(test),
        "slip": _slip(test) if test.options.kind == "straight" else None,
    }
    return {n: f for n, f in found.items() if f is not None}


def _colour(test: TradeTest, s: SetRow) -> str:
    alike = [r.group for r in test.sets if r.is_control == s.is_control]
    colours = _CONTROLS if s.is_control else PALETTE
    return colours[alike.index(s.group) % len(colours)]


def _order(test: TradeTest) -> dict[str, Any] | None:
    """Values in the order of the runs: each set in its colour, censored runs as arrows, invalid ones as crosses."""
    data = []
    for s in test.sets:
        colour, name = _colour(test, s), group_text(s.group)
        members = [test.entries[i] for i in s.members if np.isfinite(test.entries[i].value)]
        for symbol, kind in (("circle", "valid"), ("triangle-up-open", "above"), ("x-thin-open", "not valid")):
            own = [
                e for e in members
                if ("not valid" if not e.valid else "above" if e.is_censored else "valid") == kind
            ]  # fmt: skip
            if own:
                data.append(dots(
                    name if kind == "valid" else f"{name}, {kind}", [e.order + 1.0 for e in own],
                    [e.value for e in own], colour, size=8, style={"symbol": symbol, "line": {"width": 2}},
                    hovertemplate="%{x}: %{y:.4g}<extra>%{fullData.name}</extra>",
                ))  # fmt: skip
    data += _control_lines(test)
    noun = "stop" if test.options.kind == "braking" else "run"
    title = f"{noun}s in their order" + (", and the control" if test.controls else "")
    return (
        figure(data, title, axis(noun), axis(_UNIT[test.options.kind].format(level=test.options.limits.straight.level)))
        if data
        else None
    )


def _control_lines(test: TradeTest) -> list[dict[str, Any]]:
    """The control between its sets, one line for each configuration."""
    return [
        line(
            f"{c.control.name} between its sets" + (f", {group_text(c.rest)}" if c.rest else ""),
            [b.order + 1.0 for b in c.control.blocks], [b.estimate.value for b in c.control.blocks],
            _CONTROLS[i % len(_CONTROLS)], width=1.5,
            style={"dash": "dash"}, mode="lines+markers",
        )
        for i, c in enumerate(test.controls)
    ]  # fmt: skip


def _order_of_sets(test: TradeTest) -> dict[str, Any] | None:
    """The number that is compared, set by set in the order of the passes, with the control's line."""
    data = []
    for s in (s for s in test.sets if s.curve is not None and np.isfinite(s.curve.result) and not s.is_control):
        order = [test.entries[i].order + 1.0 for i in s.members if test.entries[i].valid]
        assert s.curve is not None
        value, (low, high) = np.array([s.curve.result]), s.curve.ci
        colour = _colour(test, s)
        data.append(dots(
            group_text(s.group), [float(np.mean(order))], value, colour, size=9,
            error_y=error_bars(value, np.array([low]), np.array([high]), colour),
            hovertemplate="%{y:.4g}<extra>%{fullData.name}</extra>",
        ))  # fmt: skip
    data += _control_lines(test)
    y = axis(f"{test.options.result} [{pretty_unit(RESULTS[test.options.result][0])}]")
    return figure(data, "sets in the order of the passes", axis("pass"), y) if data else None


def _index(test: TradeTest) -> dict[str, Any] | None:
    rows = [s for s in test.sets if s.index is not None and np.isfinite(s.index.value)]
    if not rows:
        return None
    names = [plot_text(group_text(s.group)) for s in rows]
    value, low, high = (
        np.array(x, dtype=np.float64)
        for x in zip(*((s.index.value, *s.index.ci) for s in rows if s.index is not None), strict=True)
    )
    bars = error_bars(value, low, high, INK)
    found = {
        **dots("index", value, np.zeros(len(rows)), PALETTE[0], size=9, hovertemplate="%{y}: %{x:.1f}<extra></extra>"),
        "y": names, "error_x": bars,
    }  # fmt: skip
    of = test.options.index
    shape = {
        "type": "line", "x0": of, "x1": of, "y0": 0, "y1": 1, "yref": "paper",
        "line": {"color": MUTED, "width": 1.5, "dash": "dash"},
    }  # fmt: skip
    return figure(
        [found], f"index against {plot_text(test.options.control, 40)} ({of:g}), 95 %", axis("index"),
        axis(type="category", automargin=True, autorange="reversed"), height=130 + 30 * len(rows), shapes=[shape],
    )  # fmt: skip


def _slip(test: TradeTest) -> dict[str, Any] | None:
    """Slip over speed of every run on its lane."""
    data: list[dict[str, Any]] = []
    shown: set[str] = set()
    left = _MOST_CURVES
    for s in test.sets:
        for i in s.members:
            f = test.entries[i].found
            if not isinstance(f, StraightRun) or not f.curve[0].size or left == 0:
                continue
            left -= 1
            v, slip = f.curve
            name = group_text(s.group)
            # not the way back, where the throttle is let go or the lane ends
            most = np.nan_to_num(v, nan=-1.0) if test.entries[i].is_censored else np.where(slip < 1.0, slip, -1.0)
            last = int(np.argmax(most))
            keep = np.flatnonzero(slip[: last + 1] < 1.0)
            end = int(keep[-1]) + 1 if keep.size else 0
            dash = "solid" if test.entries[i].valid else "dot"
            data.append(line(
                name, KMH * v[:end:2], 100.0 * slip[:end:2], _colour(test, s), width=1.2, style={"dash": dash},
                showlegend=name not in shown, legendgroup=name,
            ))  # fmt: skip
            shown.add(name)
    level = 100.0 * test.options.limits.straight.slip
    shape = {
        "type": "line", "y0": level, "y1": level, "x0": 0, "x1": 1, "xref": "paper",
        "line": {"color": MUTED, "width": 1, "dash": "dash"},
    }  # fmt: skip
    title = "slip of the wet driven wheel against the dry one; dotted: not valid"
    return figure(data, title, axis("speed [km/h]"), axis("slip [%]", [-5.0, 60.0]), shapes=[shape]) if data else None


def _curves(test: TradeTest, which: str) -> dict[str, Any] | None:
    """Lateral acceleration over the entry speed: passes, and the concave curves of the sets."""
    data: list[dict[str, Any]] = []
    for s in test.sets:
        if s.curve is None or not s.curve.v.size:
            continue
        colour, name = _colour(test, s), group_text(s.group)
        passes: Sequence[CurvePass] = [
            f for i in s.members if test.entries[i].valid and isinstance(f := test.entries[i].found, CurvePass)
        ]  # fmt: skip
        seen = [p.a_y_least if which == "least" else p.a_y_mean for p in passes]
        data.append(line(name, KMH * s.curve.v, getattr(s.curve, which), colour))
        data.append(dots(name, [KMH * p.v_entry for p in passes], seen, colour, size=5, showlegend=False))
    first = next((s.curve for s in test.sets if s.curve is not None and s.curve.v.size), None)
    if first is not None:
        data.append(line("dry", KMH * first.v, first.dry, MUTED, width=1.5, style={"dash": "dash"}))
    title = f"{which} lateral acceleration in the trough"
    return figure(data, title, axis("entry speed [km/h]"), axis("lateral acceleration [m/s²]")) if data else None
