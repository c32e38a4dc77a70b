"""Panels of one drive over time: speeds, features and detection bits, with entry and exit of the water."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.report.theme import INK, MUTED, WATER, wheel_colour
from aqualog.thesis.evidence.campaign import DriveRun
from aqualog.thesis.record import Axis, Line, Panel

__all__ = ["WHEEL_WORDS", "bit_panel", "feature_lines", "panel", "speed_panel", "tie_rod_panels"]

TIME = Axis("t", "s")
SPEED = Axis("speed", "m/s")
FORCE = Axis("tie-rod force", "N")
_BEFORE, _AFTER = 2.0, 2.0  # [s] that are drawn before entry and after exit
WHEEL_WORDS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}


def drawn(r: DriveRun, start: float | None = None) -> BoolArray:
    """Samples that are drawn, bool array (n,)."""
    return r.within(r.entry - _BEFORE if start is None else start, r.exit + _AFTER)


def water(r: DriveRun, low: float, high: float) -> Line:
    """Entry and exit as two upright lines."""
    t = [r.entry, r.entry, r.entry, r.exit, r.exit]
    y = [low, high, np.nan, low, high]
    return Line("entry and exit", np.array(t), np.array(y), colour=WATER, dash="dot", width=1.2)


def panel(r: DriveRun, title: str, y: Axis, lines: Sequence[Line]) -> Panel:
    """Lines over time between entry and exit of the water."""
    values = np.concatenate([line.y for line in lines])
    low, high = y.limits or (float(np.nanmin(values)), float(np.nanmax(values)))
    return Panel(title, TIME, y, (*lines, water(r, low, high)))


def feature_lines(r: DriveRun, lines: Mapping[str, tuple[FloatArray, str, str]]) -> list[Line]:
    """Lines by name: values (n,) of the whole drive, colour and dash."""
    span = drawn(r)
    return [Line(n, r.t[span], x[span], colour=c, dash=dash, width=1.5) for n, (x, c, dash) in lines.items()]


def speed_panel(r: DriveRun, wheels: Sequence[str] = WHEELS) -> Panel:
    """Velocity and the speeds of the wheels' rims on the centre line."""
    lines = {WHEEL_WORDS[w]: (r.feature(f"v_w_{w}"), wheel_colour(w), "solid") for w in wheels}
    speeds = feature_lines(r, {**lines, "velocity": (r.velocity, INK, "dash")})
    return panel(r, "Wheel speeds and velocity", SPEED, speeds)


def bit_panel(r: DriveRun, title: str, label: str, bits: Mapping[str, tuple[float, BoolArray, str]]) -> Panel:
    """Detection bits, each a bar at its own height: name -> (height, bits (n,), colour)."""
    span = drawn(r)
    heights = [h for h, _, _ in bits.values()]
    lines = [
        Line(n, r.t[span], np.where(b[span], h, np.nan), colour=c, width=6.0) for n, (h, b, c) in bits.items()
    ]  # fmt: skip
    return panel(r, title, Axis(label, "-", limits=(min(heights) - 0.5, max(heights) + 0.5)), lines)


def tie_rod_panels(r: DriveRun) -> list[Panel]:
    """Measured and calculated forces, left and right."""
    panels = []
    for wheel, side in (("fl", "left"), ("fr", "right")):
        lines = {
            "measured": (r.feature(f"tie_rod_meas_{wheel}"), wheel_colour(wheel), "solid"),
            "calculated": (r.feature(f"tie_rod_hat_{wheel}"), MUTED, "dash"),
        }
        panels.append(panel(r, f"Tie rod {side}", FORCE, feature_lines(r, lines)))
    return panels
