"""A drive's result as text for a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

from aqualog.core.records import DriveResult, Event, SlopeSummary
from aqualog.report.names import cut

__all__ = ["CELL", "NOTE", "event_table", "lacking", "table"]

CELL = 200  # characters of a table's cell
NOTE = 1000  # characters of a sentence that names what a log holds


def event_table(result: DriveResult) -> str:
    """Events, detectors that could not judge with their missing signals, and slip slopes."""
    signals = result.signals
    rate = 1e9 / signals.step_ns
    lines = [f"{result.vehicle_name}: {signals.duration_s:.1f} s at {rate:g} Hz, {len(signals.symbols)} signals"]
    if result.events:
        header = ("detector", "where", "from s", "to s", "severity", "peak", "limit", "v km/h", "evidence")
        lines.append(table(header, [_row(e) for e in result.events]))
    else:
        lines.append("no event")
    judged = [u for u in result.unavailable if u.missing]
    if judged:
        lines.append("\nnot judged:")
        lines += [f"  {u.detector}: missing {lacking(u.missing)}" for u in judged]
    if result.limited:
        lines.append("\njudged in part:")
        lines += [f"  {u.detector}: without {', '.join(u.missing)}" for u in result.limited]
    told = [s for s in (_slope(s) for s in result.slopes) if s]
    if told:
        lines.append("\nslip slope C_s/F_z at the end:")
        lines += [f"  {s}" for s in told]
    return "\n".join(lines) + "\n"


def _slope(summary: SlopeSummary) -> str:
    """Slip slope of one side with the shares of its states; empty without an estimate."""
    total = sum(summary.seconds.values())
    if not math.isfinite(summary.slope) or total <= 0.0:
        return ""
    dry = (
        f", dry {summary.reference:.1f} ({summary.reference_from})"
        if math.isfinite(summary.reference)
        else ", no dry value yet"
    )
    states = {"estimated": "estimating", "traction too even": "slope_frozen", "blind": "blind"}
    shares = [f"{label} {summary.seconds[key] / total:.0%}" for label, key in states.items()]
    name = summary.wheel or summary.place
    return f"{name}: {summary.slope:.1f} ± {summary.slope_sd:.1f}{dry}; {', '.join(shares)} of the time"


def lacking(missing: Sequence[str]) -> str:
    """Missing signals of a detector, with possible replacements."""
    text = ", ".join(missing)
    for axle in "fr":  # an axle's torque will do
        text = text.replace(f"torque_{axle}l, torque_{axle}r", f"torque_{axle}l, torque_{axle}r (or torque_{axle})")
    return text


def _row(event: Event) -> tuple[str, ...]:
    v_x = event.evidence.get("v_x")
    return (
        event.detector,
        event.wheel or event.side or "-",
        f"{event.start_s:.2f}",
        f"{event.end_s:.2f}",
        event.severity,
        f"{event.peak:.3g}",
        f"{event.threshold:.3g}",
        f"{3.6 * v_x:.0f}" if v_x is not None else "-",
        _evidence(event),
    )


def _evidence(event: Event) -> str:
    evidence = event.evidence
    parts = []
    slip = evidence.get("slip_max") if event.detector == "spin_up" else evidence.get("slip_min")
    if slip is not None:
        parts.append(f"slip {100 * slip:.1f} %")
    if event.detector == "spin_up" and "mu_min" in evidence:
        parts.append(f"mu {evidence['mu_min']:.3f}")
    if "slope_min" in evidence:
        parts.append(f"slope down to {evidence['slope_min']:.1f}, dry {evidence.get('slope_ref', math.nan):.1f}")
    if "delta_a_x_max" in evidence:
        parts.append(f"resistance up to {evidence['delta_a_x_max']:.2f} m/s²")
    for key in ("force_residual", "torque_residual"):
        if f"{key}_min" in evidence:
            worst = max(evidence[f"{key}_min"], evidence[f"{key}_max"], key=abs)
            parts.append(f"{worst:+.0f} N off the model" if key[0] == "f" else f"{worst:+.1f} N·m off the model")
    if evidence.get("from_steering_torque"):
        parts.append("from the steering torque")
    met = [n for n in (1, 2, 3, 4, 5) if evidence.get(f"criterion_{n}")]
    if met:
        parts.append("criteria " + "+".join(str(n) for n in met))
    if evidence.get("decided_by"):
        parts.append("decided by " + " + ".join(d.replace("_", " ") for d in evidence["decided_by"]))
    if evidence.get("braking_at_start"):
        parts.append("while braking")
    return ", ".join(parts)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], most: int = CELL) -> str:
    """Columns padded to their widest cell; numbers to the right. A cell is one line, of `most` characters at most."""
    header, *rows = ([cut(str(c), most) for c in r] for r in (header, *rows))
    widths = [max(len(r[i]) for r in (header, *rows)) for i in range(len(header))]
    return "\n".join("  ".join(_pad(c, w) for c, w in zip(r, widths, strict=True)).rstrip() for r in (header, *rows))


def _pad(cell: str, width: int) -> str:
    is_number = cell.lstrip("+-").split(" ")[0].replace(".", "", 1).isdigit() and cell.count(" ") < 2
    return cell.rjust(width) if is_number else cell.ljust(width)
