"""Panels of drives and campaigns: speeds, features and bits over time, means and clouds over speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.results import RunInfo
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.report.theme import INK, MUTED, WATER, WHEEL_COLOURS, wheel_colour
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import Check
from aqualog.thesis.evidence.campaign import KMH, DriveRun, Evidence
from aqualog.thesis.evidence.measures import Means
from aqualog.thesis.evidence.scenes import SceneRun, runs
from aqualog.thesis.evidence.selection import Level, Selected
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table

__all__ = [
    "ALIGNED", "FRONT", "PALETTE", "STILL", "V_KMH", "WHEEL_WORDS", "Style", "Window", "bit_panel", "by_seed", "clouds",
    "drawn_lines", "means_line", "means_table", "panel", "rod_forces", "scene_figure", "shifts", "speed_panel",
    "speed_panels", "spread_over", "styles",
]  # fmt: skip

# wheels have their own colours, so levels take these last
PALETTE = ("#E69F00", "#56B4E9", "#7F6BB3", "#8C6D31", *WHEEL_COLOURS.values())
WHEEL_WORDS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
FRONT = ("fl", "fr")
V_KMH = Axis("velocity", "km/h")
ALIGNED = Axis("t (water from 1 s)", "s")
_TIME = Axis("t", "s")
_SYMBOLS = ("circle", "square", "diamond", "cross", "triangle-up", "x", "star", "hexagon")
_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "5px", "10px")
_BEFORE, _AFTER = 2.0, 2.0  # [s] that are drawn before entry and after exit
_ENTRY_S, _AFTER_S = 1.0, 1.0  # [s] the same on the common time axis, as in the thesis' Figures 2.3 and 2.5
_LONGEST_S = 20.0  # on water that is drawn there
STILL = -10.0  # [-] slip (3.13) of a wheel that turns at a tenth of the car's speed or less, the end of Fig. 2.4
_MOST = 2500  # points of a cloud: what a page can hold and an eye can see

Style = tuple[str, str, str]
"""Colour, dash, symbol."""


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a drive that is drawn: its samples, their time `t` (n,) on the axis [s], entry and exit there [s]."""

    part: slice | BoolArray
    t: FloatArray
    entry: float
    exit: float

    @classmethod
    def of(cls, r: DriveRun) -> Window:
        """Two seconds before the water to two after it, on the drive's own time."""
        span = r.within(r.entry - _BEFORE, r.exit + _AFTER)
        return cls(span, r.t[span], r.entry, r.exit)

    @classmethod
    def aligned(cls, r: DriveRun) -> Window:
        """A second before the water to one after it, with the entry at 1 s."""
        leave = min(r.exit, r.entry + _LONGEST_S)
        span = np.flatnonzero(r.within(r.entry - _ENTRY_S, leave + _AFTER_S))
        part = slice(int(span[0]), int(span[-1]) + 1)
        return cls(part, np.round(r.t[part] - r.entry + _ENTRY_S, 4), _ENTRY_S, leave - r.entry + _ENTRY_S)

    def water(self, low: float, high: float) -> Line:
        """Entry and exit as two upright lines."""
        t, y = [self.entry] * 3 + [self.exit] * 2, [low, high, np.nan, low, high]
        return Line("entry and exit", np.array(t), np.array(y), colour=WATER, dash="dot", width=1.2)


def panel(r: DriveRun, title: str, y: Axis, lines: Sequence[Line]) -> Panel:
    """Lines over time between entry and exit of the water."""
    return _with_water(Window.of(r), title, _TIME, y, lines)


def _with_water(window: Window, title: str, t: Axis, y: Axis, lines: Sequence[Line]) -> Panel:
    values = np.concatenate([line.y for line in lines])
    low, high = y.limits or (float(np.nanmin(values)), float(np.nanmax(values)))
    return Panel(title, t, y, (*lines, window.water(low, high)))


def drawn_lines(r: DriveRun, lines: Mapping[str, tuple[FloatArray, str, str]]) -> list[Line]:
    """Lines by name: values (n,) of the whole drive, colour and dash."""
    w = Window.of(r)
    return [Line(n, w.t, x[w.part], colour=c, dash=dash, width=1.5) for n, (x, c, dash) in lines.items()]


def speed_panel(r: DriveRun, wheels: Sequence[str] = WHEELS) -> Panel:
    """Velocity and the speeds of the wheels' rims on the centre line. [m/s]"""
    lines = {WHEEL_WORDS[w]: (r.feature(f"v_w_{w}"), wheel_colour(w), "solid") for w in wheels}
    speeds = drawn_lines(r, {**lines, "velocity": (r.velocity, INK, "dash")})
    return panel(r, "Wheel speeds and velocity", Axis("speed", "m/s"), speeds)


def speed_panels(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Panel]:
    """A panel per run, all on one scale: wheel speeds on the centre line and velocity, in km/h."""
    panels = []
    for info in runs:
        r, facts = evidence.drive(info), evidence.of(info)
        w = Window.aligned(r)
        speeds = {WHEEL_WORDS[x]: (r.feature(f"v_w_{x}")[w.part] / KMH, wheel_colour(x), "solid") for x in WHEELS}
        speeds = {name: x for name, x in speeds.items() if np.isfinite(x[0]).any()}
        speeds["velocity"] = r.velocity[w.part] / KMH, INK, "dash"
        lines = [Line(name, w.t, y, colour=c, dash=dash, width=1.5) for name, (y, c, dash) in speeds.items()]
        kind = "constant speed" if facts.is_constant else f"{facts.a:+.1f} m/s²"
        panels.append((w, f"{facts.v / KMH:.0f} km/h, {kind}", lines))
    every = np.concatenate([line.y for _, _, lines in panels for line in lines])
    scale = Axis("speed", "km/h", limits=(float(np.nanmin(every)), float(np.nanmax(every))))
    return [_with_water(w, title, ALIGNED, scale, lines) for w, title, lines in panels]


def bit_panel(r: DriveRun, title: str, label: str, bits: Mapping[str, tuple[float, BoolArray, str]]) -> Panel:
    """Detection bits, each a bar at its own height: name -> (height, bits (n,), colour)."""
    w = Window.of(r)
    heights = [h for h, _, _ in bits.values()]
    lines = [Line(n, w.t, np.where(b[w.part], h, np.nan), colour=c, width=6.0) for n, (h, b, c) in bits.items()]
    return panel(r, title, Axis(label, "-", limits=(min(heights) - 0.5, max(heights) + 0.5)), lines)


def rod_forces(r: DriveRun) -> list[Panel]:
    """Measured and calculated forces, left and right."""
    panels = []
    for wheel, side in zip(FRONT, ("left", "right"), strict=True):
        lines = {
            "measured": (r.feature(f"tie_rod_meas_{wheel}"), wheel_colour(wheel), "solid"),
            "calculated": (r.feature(f"tie_rod_hat_{wheel}"), MUTED, "dash"),
        }
        panels.append(panel(r, f"Tie rod {side}", Axis("tie-rod force", "N"), drawn_lines(r, lines)))
    return panels


def by_seed(title: str, all_runs: Sequence[SceneRun], columns: Mapping[str, Sequence[str]]) -> Table:
    """Numbers of every run of a scene, as text."""
    rows = zip((str(r.seed) for r in all_runs), *columns.values(), strict=True)
    return Table(title, ("seed", *columns), tuple(rows))


def scene_figure(
    number: str, panels: Callable[[SceneRun], Sequence[Panel]], checks: Sequence[Check], tables: Sequence[Table]
) -> Figure:
    """A figure of a scene: the first run drawn, checks over all."""
    all_runs = runs(number)
    first, last = all_runs[0], all_runs[-1].seed
    drawn = (
        f"Drawn: seed {first.seed}; judged over seeds {first.seed} to {last}, which differ in sensor noise and in how "
        "the contact fluctuates along the lane."
    )
    return figure_of(number, panels(first), checks, tables, entry=first.entry, drawn=drawn)


def styles(selected: Selected) -> dict[str, Style]:
    """Style of each level by its name: of two varied families the first sets the colour, the second the dash."""
    levels = selected.levels
    if len(selected.wish.varies) < 2:
        return {x.name: (PALETTE[i % len(PALETTE)], "solid", _SYMBOLS[i % len(_SYMBOLS)]) for i, x in enumerate(levels)}
    first = list(dict.fromkeys(x.value[0] for x in levels))
    rest = list(dict.fromkeys(x.value[1:] for x in levels))
    return {
        x.name: (
            PALETTE[first.index(x.value[0]) % len(PALETTE)], _DASHES[rest.index(x.value[1:]) % len(_DASHES)],
            _SYMBOLS[rest.index(x.value[1:]) % len(_SYMBOLS)],
        )
        for x in levels
    }  # fmt: skip


def shifts(levels: Sequence[Level]) -> dict[str, float]:
    """Small shifts along the speed that keep the bars apart. [km/h]"""
    n = len(levels)
    return {x.name: 0.6 * (i - 0.5 * (n - 1)) for i, x in enumerate(levels)}


def means_line(name: str, means: Means, style: Style, *, shift: float = 0.0) -> Line:
    """Means with their intervals over speed; `shift` [km/h] keeps bars of several lines apart."""
    colour, dash, symbol = style
    return Line(
        name, means.v_kmh + shift, means.mean, low=means.low, high=means.high, colour=colour, dash=dash, width=1.6,
        mode="lines+markers", symbol=symbol,
    )  # fmt: skip


def means_table(title: str, means: Mapping[str, Means], digits: int) -> Table:
    """Bins of all levels with intervals and counts."""
    rows = []
    for name, m in means.items():
        for i in range(m.v_kmh.size):
            ci = f"{m.low[i]:.{digits}f} to {m.high[i]:.{digits}f}" if np.isfinite(m.low[i]) else "–"
            rows.append(
                (name, f"{m.v_kmh[i]:.0f}", f"{m.mean[i]:.{digits}f}", ci, f"{m.runs[i]:.0f}", f"{m.samples[i]:.0f}")
            )
    return Table(title, ("level", "km/h", "mean", "95 %", "runs", "samples"), tuple(rows))


def spread_over(runs: Sequence[RunInfo], evidence: Evidence, speeds: Sequence[float]) -> list[RunInfo]:
    """For each speed [m/s] the run nearest to it that is not taken yet; by speed."""
    left = list(runs)
    taken: list[RunInfo] = []
    for v in speeds[: len(left)]:
        nearest = min(left, key=lambda r: (abs(evidence.of(r).v - v), r.index))
        left.remove(nearest)
        taken.append(nearest)
    return sorted(taken, key=lambda r: evidence.of(r).v)


def clouds(evidence: Evidence, runs: Sequence[RunInfo], column: str, wheels: Sequence[str]) -> list[Line]:
    """Extremes of the slip (3.13) within each 0.1 s over velocity [km/h], a cloud per wheel and kind of pass.

    Parameters
    ----------
    column : str
        `slip_min` or `slip_max`: rim against car, over the car's speed. (3.13) is over the rim's [-]; a wheel that
        stands counts as `STILL`.
    """
    lines = []
    for kind, is_constant in (("constant speed", True), ("accelerated", False)):
        of_kind = [evidence.wet(info) for info in runs if evidence.of(info).is_constant == is_constant]
        for wheel in wheels:
            pairs = [(s.array("v_x")[wet], s.array(f"{column}_{wheel}")[wet]) for s, wet in of_kind]
            v, slip = (np.concatenate([np.empty(0), *(p[i] for p in pairs)]) for i in (0, 1))
            good = np.isfinite(v) & np.isfinite(slip)
            v, slip = v[good] / KMH, np.maximum(slip[good] / np.maximum(1.0 + slip[good], 1e-9), STILL)
            if v.size:
                every = slice(None, None, max(1, -(-v.size // _MOST)))
                lines.append(
                    Line(
                        f"{WHEEL_WORDS[wheel]}, {kind}", v[every], slip[every], colour=wheel_colour(wheel),
                        mode="markers", symbol="circle" if is_constant else "cross", size=3.5, opacity=0.6,
                    )
                )  # fmt: skip
    return lines
