"""A tyre test as sections of text and page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from textwrap import wrap

from aqualog.core.intervals import Interval
from aqualog.report.campaign.labels import group_text
from aqualog.report.sections import Cell, Figures, Headline, Line, Lines, Para, Report, Section, Table
from aqualog.report.trade.document import TABLES, limit_rows
from aqualog.report.trade.figures import trade_figures
from aqualog.report.values import KMH, counted, cut, number, pretty_unit
from aqualog.trade.braking import Stop
from aqualog.trade.curve import CurvePass
from aqualog.trade.curve_set import RESULTS, CurveSet
from aqualog.trade.entry import Entry
from aqualog.trade.evaluation import SetRow, TradeTest
from aqualog.trade.onset import SIGNS
from aqualog.trade.straight import StraightRun

__all__ = ["headline", "run_name", "trade_report"]

_TITLES = {
    "straight": ("straight aquaplaning", "speed at which the wet driven wheel turns {level} faster than the dry one"),
    "curve": ("curved aquaplaning", "lateral acceleration in a trough on a circle"),
    "braking": ("wet braking", "braking force coefficient (v1² - v2²) / (2 d g)"),
}
_DRAWN = {
    "straight": "In the order of the runs", "curve": "Over speed and order", "braking": "In the order of the stops",
}  # fmt: skip
_NOUNS = {"straight": "run", "curve": "pass", "braking": "stop"}
_MOST_RUNS = 30  # in a terminal; all of them are in page, CSV and JSON
_WIDTH = 110  # characters of a line of thresholds
_LATE_APART = 0.04  # [s]
_TIED = "\N{NO-BREAK SPACE}"  # between a key, its value and its unit
_FOOTER = (
    "Intervals: 95 %. Straight and braking: Student's t; censored runs by likelihood [tobin1958]. Curve: bootstrap "
    "over passes, widened by Student's t. Index: Fieller [fieller1954], the control tyre linear between its sets by "
    "run order. Each interval stands for itself: of twenty sets that equal the control, one is called different."
)


def headline(test: TradeTest) -> str:
    """The answer in one sentence."""
    what, noun = _TITLES[test.options.kind][0], _NOUNS[test.options.kind]
    runs = f"{test.valid} of {_several(len(test.entries), noun)} valid"
    if not test.entries:
        return f"{what}: no log could be read"
    if not test.valid:
        return f"{what}: {runs}; the list below says why"
    sets = [s for s in test.sets if _valid(s)]
    return f"{what}: {runs}, {counted(len(sets), 'set')}"


def _several(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 'es' if noun == 'pass' else 's'}"


def trade_report(test: TradeTest) -> Report:
    """Sets with their verdicts, control tyre, runs and why some do not count, thresholds."""
    kind = test.options.kind
    title, meaning = _TITLES[kind]
    figures = trade_figures(test)
    verdicts: list[Line] = [
        (group_text(s.group), s.index.sentence) for s in test.sets if s.index is not None and s.index.sentence
    ]
    has_sets = bool(test.valid)
    invalid = [(run_name(e), "; ".join(e.reasons)) for e in test.entries if not e.valid]
    remarks = [(group_text(s.group), note) for s in test.sets if _valid(s) for note in _notes(s)]
    meaning = meaning.format(level=test.options.limits.straight.level)
    sections = [
        Section("", [Headline(headline(test), [*verdicts, *test.notes])], "verdict", look="verdict open", where="page"),
        Section("", [Headline(headline(test))], where="text"),
        Section("Sets", [_sets(test), Para(_legend(test), where="everywhere")] if has_sets else [], "sets"),
        Section("Against the control", [Lines(verdicts)], where="text"),
        Section("Control tyre", [Lines(_control_lines(test))], "control"),
        Section("Remarks", [Lines([*test.notes, *remarks], most=1000)], "remarks"),
        Section(_DRAWN[kind], [Figures([n for n in figures if n != "slip"])], "plot-section"),
        Section("Slip over speed", [Figures(["slip"])] if "slip" in figures else [], "slip-section"),
        Section(f"Not valid: {len(invalid)} of {len(test.entries)}", [Lines(invalid, most=20, most_text=20)], "invalid",
                look="problems"),
        Section("Not read", [Lines(list(test.failed.items()), most=1000)], "failed", look="problems"),
        Section(f"All {_NOUNS[kind]}{'es' if kind == 'curve' else 's'}", [
            *([_runs(test)] if len(test.entries) <= _MOST_RUNS else [replace(_runs(test), where="page")]),
            *([Lines([f"{len(test.entries)}: --csv, --json or --page lists them"], where="text")]
              if len(test.entries) > _MOST_RUNS else []),
        ], "runs-section"),
        Section("Not checked", [Lines(_unchecked(test), most=20)], "unchecked"),
        Section("Thresholds", [_limits(test), Lines(_limits_text(test), where="text")], "limits-section",
                "source K: general knowledge"),
    ]  # fmt: skip
    facts = [
        (_NOUNS[kind] + ("es" if kind == "curve" else "s"), str(len(test.entries))), ("valid", str(test.valid)),
        ("sets", str(len(test.sets))), *([("control", test.options.control)] if test.options.control else []),
    ]  # fmt: skip
    return Report(title, meaning, sections, facts, figures, _FOOTER)


def run_name(e: Entry) -> str:
    """Name of a run: its log, and its number there from the second one on."""
    name = cut(e.log)
    return name if e.number == 1 else f"{name} ({e.number})"


def _speed_head(test: TradeTest) -> tuple[str, str]:
    """Return the head of the speed at the slip in use."""
    own = test.options.limits.straight
    return f"Speed of {own.level} slip [km/h]", f"{own.speed_name} [km/h]"


def _valid(s: SetRow) -> int:
    return s.curve.valid if s.curve is not None else s.summary.valid if s.summary is not None else 0


def _notes(s: SetRow) -> Sequence[str]:
    own = s.summary.notes if s.summary is not None else s.curve.notes if s.curve is not None else ()
    return [*own, *([s.index_note] if s.index_note else [])]


def _ends(ci: Interval, decimals: int, factor: float = 1.0) -> str:
    low, high = (factor * x for x in ci)
    if not math.isfinite(low) and not math.isfinite(high):
        return "–"
    return " … ".join(f"{x:.{decimals}f}" if math.isfinite(x) else "open" for x in (low, high))


def _sets(test: TradeTest) -> Table:
    has_index = bool(test.controls)
    heads: list[str | tuple[str, str]] = ["Set", "Valid"]
    if test.options.kind == "straight":
        heads += [_speed_head(test), "95 %", "CV [%]", "v_05 [km/h]"]
        heads += [("First minor spin-down [km/h]", "minor [km/h]"), ("Drop of the slip slope [km/h]", "slope [km/h]")]
    elif test.options.kind == "braking":
        heads += ["BFC", "95 %", "CV [%]"]
    else:
        unit = pretty_unit(RESULTS[test.options.result][0])
        heads += [f"{test.options.result} [{unit}]", "95 %", "greatest [km/h]", "half of dry [km/h]", "zero [km/h]"]
    heads += ["Index", "95 % "] if has_index else []
    has_grip = any(math.isfinite(s.grip_index) for s in test.sets)
    heads += ["Wet grip index"] if has_grip else []
    rows = []
    for s in test.sets:
        row: list[str | Cell] = [Cell(group_text(s.group), note="control" if s.is_control else "")]
        row += _curve_cells(s.curve) if s.curve is not None else _summary_cells(s, test)
        if has_index:
            shown = s.index is not None and not s.is_control
            row += [number(s.index.value, 1), _ends(s.index.ci, 1)] if shown and s.index else ["–", "–"]
        rows.append([*row, *([number(s.grip_index, 2)] if has_grip else [])])
    return Table(heads, rows, "set-table", is_sortable=True)


def _summary_cells(s: SetRow, test: TradeTest) -> list[str | Cell]:
    assert s.summary is not None
    x, decimals = s.summary, 1 if test.options.kind == "straight" else 3
    mean = f"> {x.above:.{decimals}f}" if math.isfinite(x.above) else number(x.mean, decimals)
    cells: list[str | Cell] = [f"{x.valid} of {x.runs}", mean, _ends(x.ci, decimals), number(100.0 * x.cv, 1)]
    if test.options.kind != "straight":
        return cells
    good = [e for i in s.members if (e := test.entries[i]).valid]
    early = [e.found.speeds.get("v_05", math.nan) for e in good if isinstance(e.found, StraightRun)]
    signs = [[e.onset.speeds.get(n, math.nan) for e in good if e.onset is not None] for n in SIGNS]
    return [*cells, *(_mean_text(v) for v in (early, *signs))]


def _mean_text(speeds: Sequence[float]) -> str:
    known = [v for v in speeds if math.isfinite(v)]
    return f"{KMH * sum(known) / len(known):.1f}" if known else "–"


def _curve_cells(c: CurveSet) -> list[str | Cell]:
    told = [_speed_text(*x) for x in (c.v_greatest, c.v_half, c.v_zero)]
    return [f"{c.valid} of {c.passes}", number(c.result, 2), _ends(c.ci, 2), *told]


def _speed_text(v: float, ci: Interval) -> str:
    low, high = ci
    if math.isfinite(v):
        return f"{KMH * v:.1f}" + (f" ({_ends(ci, 1, KMH)})" if math.isfinite(low) or math.isfinite(high) else "")
    return f"≥ {KMH * low:.1f}" if math.isfinite(low) else f"≤ {KMH * high:.1f}" if math.isfinite(high) else "–"


def _legend(test: TradeTest) -> str:
    o = test.options
    if o.kind == "straight":
        late = [f.late for e in test.entries if isinstance(f := e.found, StraightRun) and math.isfinite(f.late)]
        told = f"v_x is late by {_late_text(late)}: taken off.\n" if late else ""
        level = o.limits.straight.level
        return told + (
            f"v_05, minor spin-down, slip slope: other signs of lost contact, before or after {level}; "
            "means of the runs that show them.\n"
            f"Where runs did not reach {level}, they count as above their highest speed."
        )
    if o.kind == "braking":
        gate, least = o.limits.braking.cv, o.limits.braking.runs
        return f"Expected of a set: at least {least:g} valid stops and a CV of at most {100.0 * gate:g} %."
    low, high = test.between
    span = f"{KMH * low:.0f} to {KMH * high:.0f} km/h" if math.isfinite(low) else "none"
    return f"{o.result}: {RESULTS[o.result][1]} ({span})."


def _late_text(late: Sequence[float]) -> str:
    """Return the delays of runs, with their range where they differ by more than a receiver's scatter."""
    runs = _several(len(late), _NOUNS["straight"])
    if max(late) - min(late) > _LATE_APART:
        return f"{min(late):.2f} to {max(late):.2f} s ({runs}, median {median(late):.2f} s)"
    return f"{median(late):.2f} s (" + (f"median of {runs})" if len(late) > 1 else f"{runs})")


def _control_lines(test: TradeTest) -> list[Line]:
    lines: list[Line] = []
    noun = _NOUNS[test.options.kind]
    decimals = 3 if test.options.kind == "braking" else 2 if test.options.kind == "curve" else 1
    for c in test.controls:
        name = c.control.name + (f", {group_text(c.rest)}" if c.rest else "")
        values = "; ".join(f"{b.estimate.value:.{decimals}f} ({_several(b.runs, noun)})" for b in c.control.blocks)
        lines.append((name, f"in the order of the {_several(2, noun)[2:]}: {values}"))
        if c.drift is not None:
            low, high = c.drift.ci
            sure = f"; {'not different from none, yet ' if low <= 0.0 <= high else ''}taken out of the index"
            told = f"{100.0 * c.drift.change:+.1f} % from the first to the last set"
            lines.append(("drift", f"{told} ({_ends(c.drift.ci, 1, 100.0)} %){sure}"))
    return lines


def _runs(test: TradeTest) -> Table:
    heads: list[str | tuple[str, str]] = ["Run", "Set", "Counts"]
    if test.options.kind == "straight":
        heads += [
            _speed_head(test),
            ("By the other reference [km/h]", "other"),
            "v_05",
            "v_10",
            "v_50",
            ("Acceleration [m/s²]", "a [m/s²]"),
        ]
    elif test.options.kind == "braking":
        heads += ["BFC", "BFC at 20 °C", "way [m]", "water [mm]", "texture [mm]", "°C"]
    else:
        heads += ["entry [km/h]", "a_y dry [m/s²]", "least", "mean"]
    rows = [
        [Cell(run_name(e), key=e.order), group_text(e.group), "yes" if e.valid else "no", *_cells(e)]
        for e in test.entries
    ]
    return Table(heads, rows, "runs", words=(0, 1, 2), is_sortable=True)


def _cells(e: Entry) -> list[str | Cell]:
    f = e.found
    if isinstance(f, StraightRun):
        own = f"> {KMH * f.v:.1f}" if f.is_censored else number(KMH * f.v, 1)
        levels = [number(KMH * f.speeds.get(n, math.nan), 1) for n in ("v_05", "v_10", "v_50")]
        return [own, number(KMH * f.speeds_other.get("v_15", math.nan), 1), *levels, number(f.a_x, 2)]
    if isinstance(f, CurvePass):
        return [number(KMH * f.v_entry, 1), *(number(x, 2) for x in (f.a_y_dry, f.a_y_least, f.a_y_mean))]
    assert isinstance(f, Stop)
    return [
        number(f.bfc, 3), number(f.bfc_20, 3), number(f.distance, 2), number(1e3 * f.water_depth, 1),
        number(1e3 * f.texture, 2), number(f.temperature, 1),
    ]  # fmt: skip


def _unchecked(test: TradeTest) -> list[Line]:
    """Return what could not be checked, each once with the number of runs."""
    count: dict[str, int] = {}
    for e in test.entries:
        missing = () if e.onset is None else tuple(f"{SIGNS[n]}: {why} missing" for n, why in e.onset.missing.items())
        for note in (*e.found.notes, *missing):
            count[note] = count.get(note, 0) + 1
    noun = _NOUNS[test.options.kind]
    return [f"{note} ({_several(n, noun)})" for note, n in sorted(count.items(), key=lambda item: -item[1])]


def _limits(test: TradeTest) -> Table:
    rows = [
        [r["key"], f"{r['value']:g}", f"{r['default']:g}", "" if r["unit"] == "-" else pretty_unit(r["unit"]),
         r["meaning"], r["source"]]
        for r in limit_rows(test.options.limits, TABLES[test.options.kind])
    ]  # fmt: skip
    return Table(
        ("Key", "In use", "Default", "Unit", "Meaning", "Source"), rows, "limits", words=(0, 3, 4, 5), wide=(4, 5),
        where="page",
    )  # fmt: skip


def _limits_text(test: TradeTest) -> list[str]:
    """Return the thresholds in a few lines for a terminal."""
    rows = limit_rows(test.options.limits, TABLES[test.options.kind])
    told = [
        f"{r['key']} {r['value']:g}{'' if r['unit'] == '-' else ' ' + r['unit']}"
        + (f" (default {r['default']:g})" if r["value"] != r["default"] else "")
        for r in rows
    ]
    lines = wrap(", ".join(t.replace(" ", _TIED) for t in told), _WIDTH, break_long_words=False)
    return [*(x.replace(_TIED, " ") for x in lines), "--limits FILE changes them"]
