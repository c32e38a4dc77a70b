"""Slip slopes of a drive for a reader: the JSON document, a table of the session's parts, sections of text and page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from aqualog import __version__
from aqualog.core.intervals import Interval
from aqualog.core.records import Remark
from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope, Recursion
from aqualog.detect.slip_slope.regression import Line
from aqualog.detect.slip_slope.stability import percent
from aqualog.report.inputs import input_sections, without_remarks
from aqualog.report.sections import Cell, Figures, Lines, Para, Report, Section, Table
from aqualog.report.slope_figures import place_name, slope_plots
from aqualog.report.theme import WHEEL_COLOURS
from aqualog.report.values import fields_of, number, plain

__all__ = ["slope_csv", "slope_document", "slope_lines", "slope_report", "way_sentence"]

_METHODS = {
    "axle": "slip of each driven wheel against the free wheel of its side",
    "velocity": "slip of each driven wheel against v_x",
    "differential": "differential slip of both axles, recursive estimate",
}
_TRACTIONS = {"torque": "traction from the wheel torques", "accelerometer": "traction from the accelerometer"}
_PLACES = (
    "Place", "Slope", "95 %", ("Offset [%]", "offset %"), "Samples", ("Used [s]", "used s"),
    ("Traction 5 … 95 %", "mu 5 to 95 %"), ("Scatter of slip [%]", "scatter %"),
    ("Bias from noise [%]", "noise bias %"), "Recursive, at the end",
)  # fmt: skip
_PARTS = ("Place", "From [min]", "To [min]", "Used [s]", "Slope", "95 %")
_RECURSIVE = ("Place", "Recursive, at the end", "Standard deviation", "Learnt [s]", "Changes found")
_CSV = (
    "place", "start_s", "end_s", "used_s", "samples", "slope", "slope_low", "slope_high", "offset", "offset_low",
    "offset_high", "reason",
)  # fmt: skip
_LINE = (
    "The line is a regression of slip on traction. The band shows the slopes within the 95 % interval. Intervals come "
    "from leaving out one block of 10 to 30 s at a time (jackknife)."
)


def way_sentence(result: DirectResult) -> str:
    """Sources of slip and traction."""
    return f"{_METHODS[result.method]}, {_TRACTIONS[result.traction]}"


# --- sections --------------------------------------------------------------------------------------------------------


def slope_report(result: DirectResult, notes: Sequence[str] = (), checks: Sequence[Remark] = ()) -> Report:
    """Slopes, stability, what was used, and the regressions as figures.

    Parameters
    ----------
    result : DirectResult
    notes : sequence of str
        On the files, beside those of the result.
    checks : sequence of Remark
        What does not fit among the signals.
    """
    plots = slope_plots(result)
    head = f"{result.vehicle_name}: {result.duration_s:.1f} s at {result.rate_hz:.6g} Hz; {way_sentence(result)}"
    places = result.places
    below = {i: x for i, p in enumerate(places) if (x := _below(p))}
    estimated = Table(_PLACES, [_row(p) for p in places], "slopes", below=below)
    if not places:
        rows = [
            (r.place, number(r.slope, 1), number(r.slope_sd, 1), number(r.seconds, 0), str(r.alarms))
            for r in result.recursions
        ]
        estimated = Table(_RECURSIVE, rows, "slopes")
    parts = [
        (place_name(p), f"{s.start_s / 60.0:.1f}", f"{s.end_s / 60.0:.1f}", f"{s.seconds:.1f}",
         f"{s.line.slope:.1f}" if s.line.told else "–", _interval(s.line.slope_ci) if s.line.told else s.line.reason)
        for p in places for s in p.segments
    ]  # fmt: skip
    stability = [(place_name(p), f"{p.stability.sentence}{_per_hour(p)}") for p in places]
    sections = [
        *input_sections(checks),
        Section("Slip slope C_s/F_z", [Para(head, where="text"), estimated], "slopes-section"),
        Section("Over the session", [
            Table(_PARTS, parts, words=(0, 5)),
            Lines(stability, "stability", looks=[p.stability.verdict.replace(" ", "-") for p in places]),
            Para(_used(result), where="everywhere"),
        ]),
        Section("Notes", [Lines([*without_remarks(notes, checks), *result.notes], most=1000)], "notes",
                look="problems", where="page"),
        Section("Slip over traction, and over the session", [Figures(list(plots)), Para(_LINE)], "plot-section"),
    ]  # fmt: skip
    facts = [
        ("vehicle", result.vehicle_name),
        ("duration", f"{number(result.duration_s / 60.0, 1)} min at {number(result.rate_hz)} Hz"),
        ("way", way_sentence(result)),
        ("traction up to", number(result.mu_max, 2)),
    ]
    return Report("slip slope", "slip slope of one drive", sections, facts, plots)


def slope_lines(result: DirectResult) -> list[str]:
    """A line for each place: slope, interval, stability; without a regression the recursive estimate."""
    if not result.places:
        return [f"{r.place}: {r.slope:.1f} ± {r.slope_sd:.1f}, recursive" for r in result.recursions]
    return [
        f"{p.place}: {p.line.slope:.1f} (95 %: {_interval(p.line.slope_ci)}), {p.stability.sentence}"
        if p.line.told
        else f"{p.place}: not estimated: {p.line.reason}"
        for p in result.places
    ]


def _row(p: PlaceSlope) -> tuple[str | Cell, ...]:
    line, end = p.line, p.recursion
    return (
        Cell(place_name(p), WHEEL_COLOURS.get(p.wheel or "", "ink")),
        number(line.slope, 1),
        _interval(line.slope_ci) if line.told else "–",
        number(100.0 * line.offset, 2) if line.told else "–",
        str(line.samples),
        number(p.seconds, 1),
        f"{number(p.mu_range[0], 3)} … {number(p.mu_range[1], 3)}" if line.samples else "–",
        number(100.0 * line.scatter, 3),
        f"{number(100.0 * line.attenuation, 1)}{' (corrected)' if line.is_corrected else ''}",
        f"{number(end.slope, 1)} ± {number(end.slope_sd, 1)}" if math.isfinite(end.slope) else "–",
    )


def _below(p: PlaceSlope) -> str:
    """Why a place has no slope, or the delay of v_x that its slope is corrected for."""
    line = p.line
    if not line.told:
        return f"not estimated: {line.reason}"
    if not math.isfinite(line.delay):
        return ""
    low, high = line.delay_ci
    interval = f" (95 %: {low:+.3f} ... {high:+.3f})" if math.isfinite(low) else " (given)"
    return f"v_x is late by {line.delay:+.3f} s{interval}; the slip is corrected for it"


def _per_hour(p: PlaceSlope) -> str:
    if math.isnan(p.stability.per_hour):
        return ""
    low, high = p.stability.per_hour_ci
    return f"; {percent(p.stability.per_hour)} per hour (95 %: {percent(low)} ... {percent(high)})"


def _used(result: DirectResult) -> str:
    """Seconds used and left out by reason, of the place that has most."""
    if not result.places:
        return ""
    best = max(result.places, key=lambda p: p.seconds)
    ranked = sorted(best.left_out.items(), key=lambda item: -item[1])
    listed = ", ".join(f"{name} {s:.0f} s" for name, s in ranked if s >= 0.5) or "nothing"
    return f"used {best.seconds:.0f} s of {result.duration_s:.0f} s; left out: {listed}"


def _interval(ci: Interval) -> str:
    """`29.7 ... 37.0`; an end beyond 999 is where 1 / slope is next to 0."""
    if not math.isfinite(ci[0]):
        return "–"
    return " ... ".join("> 999" if x > 999.0 else f"{x:.1f}" for x in ci)


# --- JSON and CSV ----------------------------------------------------------------------------------------------------


def slope_document(result: DirectResult, *, log: str, notes: Sequence[str] = ()) -> dict[str, Any]:
    """The JSON document of `slip-slope`. NaN and infinities become null; floats keep 9 significant digits.

    Parameters
    ----------
    result : DirectResult
    log : str
        What the user named.
    notes : sequence of str
        On the files, beside those of the result.
    """
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "log": log,
        **fields_of(
            result, vehicle="vehicle_name", duration_s="duration_s", sample_rate_hz="rate_hz", method="method",
            traction="traction", mu_max="mu_max",
        ),
        "slip_slope": [
            {
                **fields_of(p, "place", "wheel"),
                **_line(p.line),
                **fields_of(p, used_s="seconds", mu_range="mu_range", lag_s="lag_s"),
                "recursive": _recursion(p.recursion),
                "left_out_s": plain(p.left_out),
                "stability": fields_of(
                    p.stability, "verdict", "sentence", "span_s", change="change", change_ci95="change_ci",
                    change_per_hour="per_hour", change_per_hour_ci95="per_hour_ci",
                ),
                "segments": [
                    {**fields_of(s, "start_s", "end_s", used_s="seconds"), **_line(s.line)} for s in p.segments
                ],
            }
            for p in result.places
        ],
        "recursive": [_recursion(r) for r in result.recursions],
        "notes": [*notes, *result.notes],
    }  # fmt: skip


def _line(line: Line) -> dict[str, Any]:
    return {
        **fields_of(
            line, "slope", slope_ci95="slope_ci", inverse_slope="k", inverse_slope_ci95="k_ci", offset="offset",
            offset_ci95="offset_ci", scatter="scatter", attenuation="attenuation",
            attenuation_corrected="is_corrected", samples="samples", blocks="blocks", delay_s="delay",
            delay_ci95="delay_ci", delay_shared="shared",
        ),
        "reason": line.reason or None,
    }  # fmt: skip


def _recursion(r: Recursion) -> dict[str, Any]:
    return fields_of(r, "place", "slope", "slope_sd", changes="alarms", learnt_s="seconds")


def slope_csv(result: DirectResult) -> str:
    """One line per place over the whole drive, and one per part of the session; an empty cell has no estimate."""
    rows = [",".join(_CSV)]
    for p in result.places:
        whole = (float(p.t[0]), float(p.t[-1])) if p.t.size else (math.nan, math.nan)
        spans = [(*whole, p.seconds, p.line), *((s.start_s, s.end_s, s.seconds, s.line) for s in p.segments)]
        for start, end, seconds, line in spans:
            offset = (line.offset, *line.offset_ci) if line.told else (math.nan,) * 3
            numbers = (start, end, seconds, float(line.samples), line.slope, *line.slope_ci, *offset)
            rows.append(",".join([p.place, *map(_cell, numbers), f'"{line.reason}"' if line.reason else ""]))
    for r in result.recursions:
        values = (r.place, "", "", _cell(r.seconds), "", _cell(r.slope), "", "", "", "", "", "recursive estimate")
        rows.append(",".join(values))
    return "\n".join(rows) + "\n"


def _cell(x: float) -> str:
    return f"{x:.9g}" if math.isfinite(x) else ""
