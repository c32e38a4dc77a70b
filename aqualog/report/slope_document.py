"""Slip slopes of a drive as text for a terminal, as the JSON document, and as a table of the session's parts."""

from __future__ import annotations

import math
from typing import Any

from aqualog import __version__
from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope, Recursion
from aqualog.detect.slip_slope.regression import Interval, Line
from aqualog.detect.slip_slope.stability import percent
from aqualog.report.text import table

__all__ = [
    "SCHEMA_VERSION",
    "delay_sentence",
    "slope_csv",
    "slope_document",
    "slope_lines",
    "slope_text",
    "used_and_left_out",
    "way_sentence",
]

SCHEMA_VERSION = 1

_METHODS = {
    "axle": "slip of each driven wheel against the free wheel of its side",
    "velocity": "slip of each driven wheel against v_x",
    "differential": "differential slip of both axles, recursive estimate",
}
_TRACTIONS = {"torque": "traction from the wheel torques", "accelerometer": "traction from the accelerometer"}
_HEADER = ("place", "slope", "95 %", "offset %", "samples", "used s", "mu from", "to", "recursive, at the end")
_CSV = (
    "place", "start_s", "end_s", "used_s", "samples", "slope", "slope_low", "slope_high", "offset", "offset_low",
    "offset_high", "reason",
)  # fmt: skip


def way_sentence(result: DirectResult) -> str:
    """Sources of slip and traction."""
    return f"{_METHODS[result.method]}, {_TRACTIONS[result.traction]}"


def delay_sentence(line: Line) -> str:
    """Delay of v_x; empty if it was not requested or could not be estimated."""
    if not (line.told and math.isfinite(line.delay)):
        return ""
    low, high = line.delay_ci
    interval = f" (95 %: {low:+.3f} ... {high:+.3f})" if math.isfinite(low) else " (given)"
    return f"v_x is late by {line.delay:+.3f} s{interval}; the slip is corrected for it"


# --- text ------------------------------------------------------------------------------------------------------------


def slope_text(result: DirectResult) -> str:
    """Slopes, stability, and what was used."""
    lines = [f"{result.vehicle_name}: {result.duration_s:.1f} s at {result.rate_hz:.6g} Hz; {way_sentence(result)}"]
    if not result.places:
        rows = [(r.place, f"{r.slope:.1f}", f"{r.slope_sd:.1f}", f"{r.seconds:.0f}", str(r.alarms))
                for r in result.recursions]  # fmt: skip
        return "\n".join([*lines, table(("place", "slope", "sd", "learnt s", "changes"), rows)]) + "\n"
    lines.append(table(_HEADER, [_row(p) for p in result.places]))
    lines += [f"  {p.place}: not estimated: {p.line.reason}" for p in result.places if not p.line.told]
    lines += [f"  {p.place}: {delay_sentence(p.line)}" for p in result.places if delay_sentence(p.line)]
    lines += ["", "over the session"]
    parts = [_segment_row(p, i) for p in result.places for i in range(len(p.segments))]
    if parts:
        lines.append(table(("place", "from min", "to min", "used s", "slope", "95 %"), parts))
    lines += [f"{p.place}: {p.stability.sentence}{_per_hour(p)}" for p in result.places]
    used, left_out = used_and_left_out(result)
    lines += ["", f"used {used:.0f} s of {result.duration_s:.0f} s; left out: " + _listed(left_out)]
    return "\n".join(lines) + "\n"


def slope_lines(result: DirectResult) -> list[str]:
    """Return a line for each place: slope, interval, stability; without a regression the recursive estimate."""
    if not result.places:
        return [f"{r.place}: {r.slope:.1f} ± {r.slope_sd:.1f}, recursive" for r in result.recursions]
    return [
        f"{p.place}: {p.line.slope:.1f} (95 %: {_interval(p.line.slope_ci)}), {p.stability.sentence}"
        if p.line.told
        else f"{p.place}: not estimated: {p.line.reason}"
        for p in result.places
    ]


def used_and_left_out(result: DirectResult) -> tuple[float, dict[str, float]]:
    """Seconds used and left out by reason, of the place that has most."""
    if not result.places:
        return 0.0, {}
    best = max(result.places, key=lambda p: p.seconds)
    return best.seconds, {name: s for name, s in best.left_out.items() if s > 0.0}


def _listed(seconds: dict[str, float]) -> str:
    ranked = sorted(seconds.items(), key=lambda item: -item[1])
    return ", ".join(f"{name} {s:.0f} s" for name, s in ranked if s >= 0.5) or "nothing"


def _interval(ci: Interval) -> str:
    """`29.7 ... 37.0`; an end beyond 999 is where 1 / slope is next to 0."""
    if not math.isfinite(ci[0]):
        return "-"
    return " ... ".join("> 999" if x > 999.0 else f"{x:.1f}" for x in ci)


def _row(p: PlaceSlope) -> tuple[str, ...]:
    line, end = p.line, p.recursion
    return (
        p.place,
        f"{line.slope:.1f}" if line.told else "-",
        _interval(line.slope_ci),
        f"{100 * line.offset:+.2f}" if line.told else "-",
        str(line.samples),
        f"{p.seconds:.1f}",
        f"{p.mu_range[0]:+.3f}" if line.samples else "-",
        f"{p.mu_range[1]:+.3f}" if line.samples else "-",
        f"{end.slope:.1f} ± {end.slope_sd:.1f}" if math.isfinite(end.slope) else "-",
    )


def _segment_row(p: PlaceSlope, i: int) -> tuple[str, ...]:
    s = p.segments[i]
    return (
        p.place,
        f"{s.start_s / 60.0:.1f}",
        f"{s.end_s / 60.0:.1f}",
        f"{s.seconds:.1f}",
        f"{s.line.slope:.1f}" if s.line.told else "-",
        _interval(s.line.slope_ci) if s.line.told else s.line.reason,
    )


def _per_hour(p: PlaceSlope) -> str:
    if math.isnan(p.stability.per_hour):
        return ""
    low, high = p.stability.per_hour_ci
    return f"; {percent(p.stability.per_hour)} per hour (95 %: {percent(low)} ... {percent(high)})"


# --- JSON and CSV ----------------------------------------------------------------------------------------------------


def slope_document(result: DirectResult, *, log: str, notes: tuple[str, ...] = ()) -> dict[str, Any]:
    """The JSON document of `slip-slope`. NaN and infinities become null; floats keep 9 significant digits.

    Parameters
    ----------
    result : DirectResult
    log : str
        What the user named.
    notes : tuple of str
        On the files, beside those of the result.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "log": log,
        "vehicle": result.vehicle_name,
        "duration_s": _number(result.duration_s),
        "sample_rate_hz": _number(result.rate_hz),
        "method": result.method,
        "traction": result.traction,
        "mu_max": _number(result.mu_max),
        "slip_slope": [_place(p) for p in result.places],
        "recursive": [_recursion(r) for r in result.recursions],
        "notes": [*notes, *result.notes],
    }


def _number(x: float) -> float | None:
    return float(f"{x:.9g}") if math.isfinite(x) else None


def _pair(ci: Interval) -> list[float | None]:
    return [_number(ci[0]), _number(ci[1])]


def _line(line: Line) -> dict[str, Any]:
    return {
        "slope": _number(line.slope),
        "slope_ci95": _pair(line.slope_ci),
        "inverse_slope": _number(line.k),
        "inverse_slope_ci95": _pair(line.k_ci),
        "offset": _number(line.offset),
        "offset_ci95": _pair(line.offset_ci),
        "scatter": _number(line.scatter),
        "attenuation": _number(line.attenuation),
        "attenuation_corrected": line.is_corrected,
        "samples": line.samples,
        "blocks": line.blocks,
        "delay_s": _number(line.delay),
        "delay_ci95": _pair(line.delay_ci),
        "delay_shared": _number(line.shared),
        "reason": line.reason or None,
    }


def _recursion(r: Recursion) -> dict[str, Any]:
    return {
        "place": r.place,
        "slope": _number(r.slope),
        "slope_sd": _number(r.slope_sd),
        "changes": r.alarms,
        "learnt_s": _number(r.seconds),
    }


def _place(p: PlaceSlope) -> dict[str, Any]:
    stability = p.stability
    return {
        "place": p.place,
        "wheel": p.wheel,
        **_line(p.line),
        "used_s": _number(p.seconds),
        "mu_range": _pair(p.mu_range),
        "lag_s": _number(p.lag_s),
        "recursive": _recursion(p.recursion),
        "left_out_s": {name: _number(s) for name, s in p.left_out.items()},
        "stability": {
            "verdict": stability.verdict,
            "sentence": stability.sentence,
            "span_s": _number(stability.span_s),
            "change": _number(stability.change),
            "change_ci95": _pair(stability.change_ci),
            "change_per_hour": _number(stability.per_hour),
            "change_per_hour_ci95": _pair(stability.per_hour_ci),
        },
        "segments": [
            {"start_s": _number(s.start_s), "end_s": _number(s.end_s), "used_s": _number(s.seconds), **_line(s.line)}
            for s in p.segments
        ],
    }


def slope_csv(result: DirectResult) -> str:
    """One line per place over the whole drive, and one per part of the session; an empty cell has no estimate."""
    rows = [",".join(_CSV)]
    for p in result.places:
        whole = (float(p.t[0]), float(p.t[-1])) if p.t.size else (math.nan, math.nan)
        rows.append(_csv_row(p.place, *whole, p.seconds, p.line))
        rows += [_csv_row(p.place, s.start_s, s.end_s, s.seconds, s.line) for s in p.segments]
    for r in result.recursions:
        values = (r.place, "", "", _cell(r.seconds), "", _cell(r.slope), "", "", "", "", "", "recursive estimate")
        rows.append(",".join(values))
    return "\n".join(rows) + "\n"


def _csv_row(place: str, start: float, end: float, seconds: float, line: Line) -> str:
    told = line.told
    numbers = (
        start, end, seconds, float(line.samples), line.slope, *line.slope_ci,
        *((line.offset, *line.offset_ci) if told else (math.nan,) * 3),
    )  # fmt: skip
    return ",".join([place, *(_cell(x) for x in numbers), f'"{line.reason}"' if line.reason else ""])


def _cell(x: float) -> str:
    return f"{x:.9g}" if math.isfinite(x) else ""
