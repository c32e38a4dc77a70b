"""Figures 2.24 and 2.25: the joint detectors as a diagram, and criterion by criterion."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray
from aqualog.detect.joint_criteria import GATE_HOLD, GATED, HOLD, SLOPE, Criteria
from aqualog.detect.registry import BY_NAME
from aqualog.detect.spin import MU_FULL, MU_SPIN_UP
from aqualog.detect.thresholds import DEFAULT
from aqualog.report.theme import INK, MUTED, THRESHOLD, WATER, WHEEL_COLOURS
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import Check, judge, limit, limits
from aqualog.thesis.evidence.campaign import DriveRun
from aqualog.thesis.evidence.scenes import MANY, SOME, SceneRun, dry_and_wet, in_runs, runs, spread, stretches
from aqualog.thesis.figures.panels import bit_panel, by_seed, drawn_lines, panel, scene_figure, speed_panel
from aqualog.thesis.record import Axis, Figure, Line, Note, Panel, Table, seconds

__all__ = ["FIGURES", "panels_2_25"]

_RESISTANCE = 5
_BOX_COLOURS = {1: WHEEL_COLOURS["fl"], 2: WHEEL_COLOURS["fr"], 3: WHEEL_COLOURS["rl"], 4: WHEEL_COLOURS["rr"]}
_BOX_WORDS = {
    1: ("1 Excessive spin-down", f"CUSUM of a_wΔ > {DEFAULT.spin_down:g} {BY_NAME['spin_down'].unit}, wheel slower",
        "than the car, no negative force"),
    2: ("2 Minor spin-down", f"Δσ² > {DEFAULT.minor_spin_down:g} {BY_NAME['minor_spin_down'].unit}, free wheel slower",
        "than the car, no negative force"),
    3: ("3 Spin-up", f"CUSUM of a_wΔ > {DEFAULT.spin_up:g} {BY_NAME['spin_up'].unit}, wheel faster,",
        f"traction < {MU_SPIN_UP:g}; full below {MU_FULL:g}"),
    4: ("4 Slip-slope drop", f"slope below {1.0 - DEFAULT.slip_slope_drop:g} of the dry one, tyre driven,",
        "wheels calm, goes with speed and Δa"),
    5: ("5 Resistance", f"CUSUM of Δa > {DEFAULT.resistance:g} {BY_NAME['resistance'].unit}:", "critical water level"),
}  # fmt: skip
_TALL, _STEP, _TOP = 14.0, 17.0, 84.0
_IN, _LEFT, _RIGHT, _OR, _AND, _OUT, _END = 15.0, 19.0, 62.0, 67.0, 79.0, 90.0, 109.0  # edges of the boxes


def _box(name: str, x: float, y: float, width: float, height: float, colour: str) -> Line:
    xs = np.array([x, x + width, x + width, x, x])
    ys = np.array([y, y, y + height, y + height, y])
    return Line(name, xs, ys, colour=colour, width=1.8, in_legend=False)


def _arrow(x0: float, y0: float, x1: float, y1: float) -> Note:
    return Note("", x1, y1, tail=(x0, y0), colour=MUTED)


def _diagram() -> Panel:
    boxes, notes = [], []
    middle = 0.5 * (_LEFT + _RIGHT)
    for k, (title, *details) in _BOX_WORDS.items():
        y = _TOP - _STEP * (k - 1)
        boxes.append(_box(f"criterion {k}", _LEFT, y, _RIGHT - _LEFT, _TALL, _BOX_COLOURS.get(k, WATER)))
        notes += [Note(f"<b>{title}</b>", middle, y + 11.2)]
        notes += [Note(text, middle, y + 6.9 - 4.0 * i, size=10, colour=MUTED) for i, text in enumerate(details)]
        notes.append(_arrow(_IN, y + 7.0, _LEFT, y + 7.0))
        if k in GATED:
            notes.append(_arrow(_RIGHT, y + 7.0, _OR, 62.0 - 4.0 * (k - 2.5)))
    inputs = ("wheel speeds", "wheel torques", "acceleration", "velocity:", "coarse will do")
    boxes.append(_box("inputs", 0.0, 16.0, _IN, 82.0, MUTED))
    notes += [Note(text, 0.5 * _IN, 69.0 - 6.0 * i, size=10) for i, text in enumerate(inputs)]
    boxes.append(_box("gate", _LEFT, -3.0, _RIGHT - _LEFT, _TALL, THRESHOLD))
    gate = f"CUSUM of Δa > {DEFAULT.joint_criteria:g} {BY_NAME['joint_criteria'].unit}, stays open {GATE_HOLD:g} s"
    notes += [
        Note("<b>Resistance gate</b>", middle, 8.2), Note(gate, middle, 3.8, size=10, colour=MUTED),
        Note("necessary for 1 to 4", middle, -0.2, size=10, colour=MUTED), _arrow(0.5 * _IN, 4.0, _LEFT, 4.0),
    ]  # fmt: skip
    x = 0.5 * _IN
    boxes.append(Line("to the gate", np.full(2, x), np.array([16.0, 4.0]), colour=MUTED, width=1.4, in_legend=False))
    for name, left, y in (("≥ 1", _OR, 55.0), ("&", _AND, 45.0)):
        boxes.append(_box(name, left, y, 8.0, _TALL, INK))
        notes.append(Note(f"<b>{name}</b>", left + 4.0, y + 7.0, size=16))
    end = 0.5 * (_OUT + _END)
    boxes.append(_box("warning", _OUT, 42.0, _END - _OUT, 20.0, THRESHOLD))
    boxes.append(_box("indicator", _OUT, 14.0, _END - _OUT, 18.0, WATER))
    notes += [
        Note("<b>aquaplaning</b>", end, 57.0), Note("<b>warning</b>", end, 52.0),
        Note(f"outlasts by {HOLD:g} s", end, 46.0, size=10, colour=MUTED),
        Note("<b>critical</b>", end, 27.0), Note("<b>water level</b>", end, 22.0),
        Note("on its own", end, 16.8, size=10, colour=MUTED),
        _arrow(_OR + 8.0, 62.0, _AND, 55.0), _arrow(_RIGHT, 4.0, _AND, 47.5), _arrow(_AND + 8.0, 52.0, _OUT, 52.0),
        _arrow(_RIGHT, 23.0, _OUT, 23.0),
    ]  # fmt: skip
    return Panel(
        "Joint detector 1", Axis("to the right", limits=(-1.0, 110.0)), Axis("up", limits=(-5.0, 100.0)), tuple(boxes),
        notes=tuple(notes), is_diagram=True,
    )  # fmt: skip


def _c64() -> tuple[Check, Table]:
    """Every combination of criteria and gate through the detector's own logic."""
    cases = np.array(list(product((False, True), repeat=6)))  # criteria 1 to 5, gate
    met = {k: cases[:, k - 1] for k in range(1, 6)}
    gate = cases[:, 5]
    n = cases.shape[0]
    c = Criteria(met, np.zeros(n, dtype=bool), np.full(n, np.nan))
    free = c.behind(gate, np.ones(n, dtype=bool))
    warned = np.any([free[k] for k in GATED], axis=0)
    expected = gate & np.any([met[k] for k in GATED], axis=0)
    alone = np.array_equal(free[_RESISTANCE], met[_RESISTANCE])
    held = c.behind(gate, np.zeros(n, dtype=bool))
    stricter = np.any([held[k] for k in GATED], axis=0)
    only_slope = gate & met[SLOPE] & ~np.any([met[k] for k in GATED if k != SLOPE], axis=0)
    agree = int(np.count_nonzero(warned == expected))
    is_strict = np.array_equal(stricter, expected & ~only_slope)
    whole = agree == n and alone and is_strict
    rows = tuple(
        (str(k), "warning" if bool(np.all(warned[gate & met[k]])) else "–",
         "warning" if bool(np.any(warned[~gate & met[k]])) else "–")
        for k in GATED
    )  # fmt: skip
    outcome = (
        f"{agree} of {n} combinations agree; criterion 5 stands for itself: {'yes' if alone else 'no'}. Where the loss "
        "of slope does not go with speed and resistance as water's does, criterion 4 alone gives no warning, which is "
        "stricter than the thesis"
    )
    finding = judge("C64.figure", outcome, whole=whole, part=agree == n, value=agree / n, fields={"n": n})
    return finding, Table("What a criterion does", ("criterion", "gate open", "gate closed"), rows)


def figure_2_24() -> Figure:
    """The detector as boxes and arrows, with its default thresholds; C64."""
    finding, table = _c64()
    return figure_of("2.24", (_diagram(),), (finding,), (table,))


_COLOURS = (*WHEEL_COLOURS.values(), "#E69F00")
_WORDS = {1: "large spin-down", 2: "minor spin-down", 3: "spin-up", 4: "slip-slope drop", 5: "resistance"}
_DIP = limit("dip", "C72.figure")  # [-] slip of a minor spin-down
_STOP = limit("stop", "C72.figure")  # [-] of a wheel that has lost the road
_REAR = limit("rear", "C72.figure")  # times the dry slip that the rear wheel has on the lane
_SOON = limit("soon")  # [s] criterion 2
# [s] "after approximately 1.5 s" and "2.5 s after", half a second more each
_SLOPE_S, _RESISTANCE_S = limit("slope_s", "C74.figure"), limit("resistance_s", "C76.figure")
_KEPT = limit("kept")  # of the time that the text has a bit active
_ACTIVE_2 = limits("active_2", "C73.figure")  # [s] after the entry: 24.5 to 27.5 s
_RISE = limit("rise", "C77.figure")  # of its threshold that the sum must reach when it "increases"
_CROSS_S = limit("cross_s", "C77.figure")  # [s] by then the sum has crossed: 25.8 s


class Times(NamedTuple):
    """When each criterion is met first after the entry, and the sum; NaN where never. [s]"""

    one: float
    two: float
    four: float
    five: float
    rise: float
    cross: float


def _bit(r: DriveRun, k: int) -> BoolArray:
    return np.asarray(r.feature(f"criterion_{k}") > 0.5)


def _times(r: SceneRun) -> Times:
    total, threshold = r.statistic("joint_cusum")
    one, two, four, five = (r.after_entry(_bit(r, k)) for k in (1, 2, 4, 5))
    rise = r.after_entry(np.nan_to_num(total) > _RISE * threshold)
    return Times(one, two, four, five, rise, r.after_entry(r.active("joint_cusum")))


def _kept(r: SceneRun, k: int, start: float, end: float) -> float:
    """Share of a time after the entry in which a criterion is met. [-]"""
    span = r.within(r.entry + start, r.entry + end)
    return float(np.mean(_bit(r, k)[span])) if span.any() else 0.0


def _judged_s(r: SceneRun, wheel: str) -> float:
    """Time on the lane in which the lost share of the dry slip slope is judged. [s]"""
    track = next(t for t in r.result.tracks if t.detector == "slip_slope_drop" and t.wheel == wheel)
    return float(np.mean(np.isfinite(track.statistic[r.on_lane()]))) * (r.exit - r.entry)


def _share(bits: list[bool]) -> float:
    return float(np.mean(bits))


def _median(values: list[float]) -> float:
    """Median where a criterion that is never met counts as the longest; infinite if most never are."""
    return float(np.median([np.inf if np.isnan(v) else v for v in values]))


def _c72(all_runs: tuple[SceneRun, ...]) -> Check:
    rear, minor = [], []
    for r in all_runs:
        dry, wet = dry_and_wet(r, "true_slip_rr")
        rear.append(wet > _REAR * dry)
        slip, on = r.signal("true_slip_fr"), r.on_lane()
        minor.append(len(stretches(r, (slip < _DIP) & on)) > 1 and bool(np.nanmin(slip[on]) > _STOP))
    both = _share([a and b for a, b in zip(rear, minor, strict=True)])
    outcome = (
        f"both in {in_runs(both)} runs: rear slip {in_runs(_share(rear))}, minor spin-downs {in_runs(_share(minor))}"
    )
    return judge("C72.figure", outcome, whole=both >= MANY, part=_share(rear) >= MANY, value=both)


def _c73(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Check:
    two = [t.two for t in times]
    soon = _share([t <= _SOON for t in two])
    kept = [_kept(r, 2, *_ACTIVE_2) for r in all_runs]
    whole = soon >= MANY and float(np.median(kept)) >= _KEPT
    outcome = f"within {_SOON:g} s in {in_runs(soon)} runs, after {spread(two)} s; met for {spread(kept)} of that time"
    return judge("C73.figure", outcome, whole=whole, part=_median(two) <= _SOON, value=_median(two))


def _c74(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Check:
    four = [t.four for t in times]
    found = _share([np.isfinite(t) for t in four])
    ends = [
        _kept(r, 4, t, r.exit - r.entry) >= _KEPT if np.isfinite(t) else False
        for r, t in zip(all_runs, four, strict=True)
    ]
    right = _share([bool((r.active("slip_slope_drop", "rr") & r.on_lane()).any()) for r in all_runs])
    judged_s = [_judged_s(r, "rr") for r in all_runs]
    whole = found >= MANY and _median(four) <= _SLOPE_S and _share(ends) >= MANY and right >= MANY
    outcome = (
        f"met in {in_runs(found)} runs, after {spread(four)} s; kept in {in_runs(_share(ends))}; by the rear right "
        f"wheel in {in_runs(right)}, whose slope could be judged for {spread(judged_s)} s on the lane"
    )
    return judge("C74.figure", outcome, whole=whole, part=found >= SOME, value=_median(four))


def _c75(times: list[Times]) -> Check:
    found = [np.isfinite(t.one) for t in times]
    later = [t.one > t.two for t in times if np.isfinite(t.one) and np.isfinite(t.two)]
    whole = _share(found) >= SOME and bool(later) and _share(later) >= MANY
    outcome = (
        f"met in {in_runs(_share(found))} runs, after {spread([t.one for t in times])} s; later than criterion 2 in "
        f"{sum(later)} of {len(later)}"
    )
    return judge("C75.figure", outcome, whole=whole, part=any(found), value=_share(found))


def _c76(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Check:
    five = [t.five for t in times]
    order = _share([t.two < t.four < t.five for t in times])
    pairs = (("2 before 4", [t.two < t.four for t in times]), ("4 before 5", [t.four < t.five for t in times]))
    in_time = _median(five) <= _RESISTANCE_S
    whole = in_time and order >= MANY
    outcome = (
        f"criterion 5 after {spread(five)} s; order in {in_runs(order)} runs "
        f"({', '.join(f'{n} {in_runs(_share(x))}' for n, x in pairs)})"
    )
    part = in_time or order >= MANY
    drag = [float(np.nanmedian(r.feature("delta_a_x")[r.on_lane()])) for r in all_runs]  # [m/s^2]
    fields = {"drag": spread(drag), "threshold": DEFAULT.resistance}
    return judge("C76.figure", outcome, whole=whole, part=part, value=_median(five), fields=fields)


def _c77(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Check:
    in_order = _share([t.rise < t.cross for t in times])
    crosses = _share([_SOON < t.cross <= _CROSS_S for t in times])
    again = _share([len(stretches(r, r.active("joint_cusum") & r.on_lane())) > 1 for r in all_runs])
    active = _share([np.isfinite(t.cross) for t in times])
    whole = in_order >= MANY and crosses >= MANY and again >= SOME
    outcome = (
        f"rise before crossing in {in_runs(in_order)} runs, crossed in that time in {in_runs(crosses)} (after "
        f"{spread([t.cross for t in times])} s, rise after {spread([t.rise for t in times])} s), more than once "
        f"in {in_runs(again)}"
    )
    value = _median([t.cross for t in times])
    return judge("C77.figure", outcome, whole=whole, part=in_order >= MANY and active >= MANY, value=value)


def panels_2_25(r: DriveRun) -> tuple[Panel, ...]:
    """Speeds, bits of the criteria, and the sum with its terms."""
    total, threshold = r.statistic("joint_cusum")
    bits = {f"{k}: {_WORDS[k]}": (float(k), _bit(r, k), c) for k, c in zip(_WORDS, _COLOURS, strict=True)}
    names = ("spin_down", "minor_spin_down", "spin_up", "slip_slope_drop", "resistance")
    terms = {
        n.replace("_", " "): (r.feature(f"joint_term_{n}"), c, "dot") for n, c in zip(names, _COLOURS, strict=True)
    }
    lines = {
        "sum": (total, INK, "solid"), **terms,
        "threshold": (np.full(r.t.size, threshold), THRESHOLD, "dash"),
    }  # fmt: skip
    below = {"warning": (np.where(r.active("joint_cusum"), -0.15, np.nan), MUTED, "solid")}
    warning = [replace(line, width=6.0) for line in drawn_lines(r, below)]
    return (
        speed_panel(r),
        bit_panel(r, "Criteria of joint detector 1", "criterion", bits),
        panel(r, "Sum of joint detector 2", Axis("scaled sum"), [*drawn_lines(r, lines), *warning]),
    )


def figure_2_25() -> Figure:
    """Speeds, bits of the criteria and the sum of one run; C72 to C77 over all runs."""
    all_runs = runs("2.25")
    times = [_times(r) for r in all_runs]
    columns = {
        name: [seconds(getattr(t, key)) for t in times]
        for name, key in (("criterion 2", "two"), ("criterion 4", "four"), ("criterion 1", "one"),
                          ("criterion 5", "five"), ("sum rises", "rise"), ("sum active", "cross"))
    }  # fmt: skip
    table = by_seed("First time after the entry [s]", all_runs, columns)
    of_times = (_c73(all_runs, times), _c74(all_runs, times), _c75(times), _c76(all_runs, times), _c77(all_runs, times))
    return scene_figure("2.25", panels_2_25, (_c72(all_runs), *of_times), (table,))


FIGURES = {"2.24": figure_2_24, "2.25": figure_2_25}
