"""Figure 2.1: the contact patch, shortened by the water wedge."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.figures.evidence import KMH
from aqualog.figures.levels import PALETTE
from aqualog.figures.record import Axis, Figure, Finding, Line, Note, Panel, judged
from aqualog.figures.wedge import DEPTH, LOAD, TYRE, full_speed, half_length, share
from aqualog.model.tyre import P_ANCHOR
from aqualog.physics.contact import friction_ratio, load_shift
from aqualog.report.theme import INK, MUTED, WATER

__all__ = ["make"]

NUMBER = "2.1"
_SPEEDS = (80.0, 100.0, 120.0)  # [km/h]
_DEPTHS = (0.6, 1.3, 2.0)  # [mm] the thesis' least, usual and greatest
_GRID = np.arange(60.0, 121.0, 5.0)  # [km/h] of the thesis' passes
_DRY = "#8C6D31"
_POINTS = 101
_TOP = 4.6  # [bar] of the picture


def _parabola(x: FloatArray, a: float) -> FloatArray:
    """Pressure of the dry contact that (2.1) integrates: all the load over -a ... a and the width. [Pa]"""
    pressure: FloatArray = 0.75 * LOAD / (a * TYRE.width) * np.maximum(1.0 - (x / a) ** 2, 0.0)
    return pressure


def _panel(kmh: float) -> Panel:
    a = half_length(P_ANCHOR)
    L = float(share(np.array([kmh * KMH]), DEPTH, P_ANCHOR)[0])
    b = a * (2.0 * L - 1.0)
    whole = np.linspace(-a, a, _POINTS)
    dry = np.linspace(-a, b, _POINTS)
    carried = LOAD * (1.0 - float(friction_ratio(np.array([L]))[0]))
    wedge = carried / ((a - b) * TYRE.width)
    e = float(load_shift(np.array([L]), np.array([a]), peak=TYRE.wedge_peak)[0])
    mm, bar = 1e3, 1e-5
    edge = np.array([-a, *dry, b])
    height = np.array([0.0, *_parabola(dry, a), 0.0])
    return Panel(
        f"{kmh:g} km/h: {100 * L:.0f} % of the contact remains and carries {100 - 100 * carried / LOAD:.0f} % of "
        "the load",
        Axis("along the patch, forward", "mm", limits=(-1.25 * a * mm, 1.25 * a * mm)),
        Axis("pressure", "bar", limits=(0.0, _TOP)),
        (
            Line("dry contact", edge * mm, height * bar, colour=_DRY, is_filled=True),
            Line("water wedge (mean)", np.array([b, b, a, a]) * mm, np.array([0.0, wedge, wedge, 0.0]) * bar,
                 colour=WATER, is_filled=True),
            Line("on dry road", whole * mm, _parabola(whole, a) * bar, colour=MUTED, dash="dash", width=1.2),
        ),
        notes=(
            Note("b", b * mm + 3.0, 0.2, size=13),
            Note(f"load {e * mm:.0f} mm ahead", e * mm, 3.1, tail=(e * mm, 4.1), size=11),
            Note("drives this way →", 0.85 * a * mm, 4.4, size=11, colour=MUTED),
        ),
    )  # fmt: skip


def _shares() -> Panel:
    v = np.linspace(40.0, 140.0, _POINTS)
    lines = [
        Line(f"{h:g} mm", v, share(v * KMH, 1e-3 * h, P_ANCHOR), colour=PALETTE[i]) for i, h in enumerate(_DEPTHS)
    ]  # fmt: skip
    marks = Line(
        "shown", np.array(_SPEEDS), share(np.array(_SPEEDS) * KMH, DEPTH, P_ANCHOR), colour=INK, mode="markers"
    )
    return Panel("Remaining contact", Axis("velocity", "km/h"), Axis("share of the contact length"), (*lines, marks))


def _c9() -> Finding:
    grid = np.stack([share(_GRID * KMH, 1e-3 * h, P_ANCHOR) for h in _DEPTHS])
    # a contact that is lost completely cannot fall further
    by_speed = bool(np.all((np.diff(grid, axis=1) < 0.0) | (grid[:, :-1] == 0.0)))
    by_depth = bool(np.all((np.diff(grid, axis=0) < 0.0) | (grid[:-1] == 0.0)))
    L = float(share(np.array([100 * KMH]), DEPTH, P_ANCHOR)[0])
    return Finding(
        "C9",
        "A wedge of water shortens the patch from its front, the more the faster and the deeper.",
        f"in the simulator's tyre the remaining contact falls with speed at {', '.join(map(str, _DEPTHS))} mm, "
        "and with depth "
        f"at all speeds from {_GRID[0]:g} to {_GRID[-1]:g} km/h; in part: one of both",
        f"falls with speed: {'yes' if by_speed else 'no'}, with depth: {'yes' if by_depth else 'no'}; "
        f"{DEPTH * 1e3:g} mm at 100 km/h leave {100 * L:.0f} %, full aquaplaning at "
        + ", ".join(f"{full_speed(1e-3 * h, P_ANCHOR) / KMH:.0f}" for h in _DEPTHS)
        + " km/h. A property of the model, which was made to have it; it measures nothing",
        judged(whole=by_speed and by_depth, part=by_speed or by_depth),
        "" if by_speed and by_depth else "The tread takes the least depth whole.",
        L, None, "-",
    )  # fmt: skip


def make() -> Figure:
    """Pressures along the patch at three speeds, and the share that is left over speed and depth; C9."""
    return Figure(
        NUMBER,
        "the contact patch, shortened by the water wedge",
        f"Computed from the simulator's physics for a worn summer tyre with {LOAD:g} N at {P_ANCHOR * 1e-5:g} bar in "
        f"{DEPTH * 1e3:g} mm. The dry contact keeps its part of the parabola of (2.1), up to its front edge b; the "
        "rest of the "
        "load rests on the wedge, whose pressure is drawn as its mean. In the model its force acts near the front "
        "of the "
        f"wedge; the arrow is where that puts the resultant of the whole load.",
        (*(_panel(v) for v in _SPEEDS), _shares()),
        (_c9(),),
    )
