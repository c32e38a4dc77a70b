"""Figure 2.24: joint detector 1 as it is implemented, as a diagram."""

from __future__ import annotations

from itertools import product

import numpy as np

from aqualog.detect.joint import GATE_HOLD, GATED, HOLD, SLOPE, Criteria
from aqualog.detect.thresholds import DEFAULT, UNITS
from aqualog.detect.wheel_watch import MU_FULL, MU_SPIN_UP
from aqualog.figures.record import Axis, Figure, Finding, Line, Note, Panel, Table, judged
from aqualog.report.theme import INK, MUTED, THRESHOLD, WATER, WHEEL_COLOURS

__all__ = ["make"]

NUMBER = "2.24"
_RESISTANCE = 5
_COLOURS = {1: WHEEL_COLOURS["fl"], 2: WHEEL_COLOURS["fr"], 3: WHEEL_COLOURS["rl"], 4: WHEEL_COLOURS["rr"]}
_WORDS = {
    1: ("1 Excessive spin-down", f"CUSUM of a_wΔ > {DEFAULT.spin_down:g} {UNITS['spin_down']}, wheel slower",
        "than the car, no negative force"),
    2: ("2 Minor spin-down", f"Δσ² > {DEFAULT.minor_spin_down:g} {UNITS['minor_spin_down']}, free wheel slower",
        "than the car, no negative force"),
    3: ("3 Spin-up", f"CUSUM of a_wΔ > {DEFAULT.spin_up:g} {UNITS['spin_up']}, wheel faster,",
        f"traction < {MU_SPIN_UP:g}; full below {MU_FULL:g}"),
    4: ("4 Slip-slope drop", f"slope below {1.0 - DEFAULT.slip_slope_drop:g} of the dry one, tyre driven,",
        "wheels calm, goes with speed and Δa"),
    5: ("5 Resistance", f"CUSUM of Δa > {DEFAULT.resistance:g} {UNITS['resistance']}:", "critical water level"),
}  # fmt: skip
_TALL, _STEP, _TOP = 14.0, 17.0, 84.0
_IN, _LEFT, _RIGHT, _OR, _AND, _OUT, _END = 15.0, 19.0, 62.0, 67.0, 79.0, 90.0, 109.0  # edges of the boxes


def _box(name: str, x: float, y: float, width: float, height: float, colour: str) -> Line:
    xs = np.array([x, x + width, x + width, x, x])
    ys = np.array([y, y, y + height, y + height, y])
    return Line(name, xs, ys, colour=colour, width=1.8, in_legend=False)


def _arrow(x0: float, y0: float, x1: float, y1: float) -> Note:
    return Note("", x1, y1, tail=(x0, y0), colour=MUTED)


def _panel() -> Panel:
    boxes, notes = [], []
    middle = 0.5 * (_LEFT + _RIGHT)
    for k, (title, *details) in _WORDS.items():
        y = _TOP - _STEP * (k - 1)
        boxes.append(_box(f"criterion {k}", _LEFT, y, _RIGHT - _LEFT, _TALL, _COLOURS.get(k, WATER)))
        notes += [Note(f"<b>{title}</b>", middle, y + 11.2)]
        notes += [Note(text, middle, y + 6.9 - 4.0 * i, size=10, colour=MUTED) for i, text in enumerate(details)]
        notes.append(_arrow(_IN, y + 7.0, _LEFT, y + 7.0))
        if k in GATED:
            notes.append(_arrow(_RIGHT, y + 7.0, _OR, 62.0 - 4.0 * (k - 2.5)))
    inputs = ("wheel speeds", "wheel torques", "acceleration", "velocity:", "coarse will do")
    boxes.append(_box("inputs", 0.0, 16.0, _IN, 82.0, MUTED))
    notes += [Note(text, 0.5 * _IN, 69.0 - 6.0 * i, size=10) for i, text in enumerate(inputs)]
    boxes.append(_box("gate", _LEFT, -3.0, _RIGHT - _LEFT, _TALL, THRESHOLD))
    gate = f"CUSUM of Δa > {DEFAULT.joint_criteria:g} {UNITS['joint_criteria']}, stays open {GATE_HOLD:g} s"
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


def _c64() -> tuple[Finding, Table]:
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
    return (
        Finding(
            "C64",
            "The resistance criterion is an indicator of its own and a necessary gate: a warning needs it and at "
            "least one "
            "other criterion.",
            f"all {n} combinations of five criteria and gate, through the detector's own logic: warning exactly "
            "where the gate "
            "is open and one of 1 to 4 is met; 5 is reported whatever the gate is",
            f"{agree} of {n} combinations agree; criterion 5 stands for itself: {'yes' if alone else 'no'}. Where "
            "the loss of "
            "slope does not go with speed and resistance as water's does, criterion 4 alone gives no warning, which is "
            "stricter than the thesis",
            judged(whole=whole, part=agree == n),
            "" if whole else "The detector's logic is not that of the diagram.",
            agree / n, None, "-",
        ),
        Table("What a criterion does", ("criterion", "gate open", "gate closed"), rows),
    )  # fmt: skip


def make() -> Figure:
    """The detector as boxes and arrows, with its default thresholds; C64."""
    finding, table = _c64()
    return Figure(
        NUMBER,
        "joint detector 1, resistance and one other criterion",
        "As implemented, with the default thresholds. a_wΔ is the acceleration difference (2.3), Δσ² that of the "
        "variances (2.8), Δa the resistance measure (2.9). Criteria 1 to 3 do not count while the wheel is braked.",
        (_panel(),),
        (finding,),
        (table,),
    )
