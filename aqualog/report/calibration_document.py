"""A calibration as text for a terminal and as the JSON document."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.calibrate.records import Calibration, DriveFit, Parameter, TieRodFit
from aqualog.calibrate.words import left_out
from aqualog.report.text import table

__all__ = ["SCHEMA_VERSION", "calibration_document", "calibration_text", "drive_cells", "parameter_cells"]

SCHEMA_VERSION = 1
DRIVE_HEADER = (
    "drive", "used s", "mass kg", "sd", "against the others kg", "offset m/s²", "drift 1e-4 m/s³", "torque delay s",
    "before m/s²", "after m/s²",
)  # fmt: skip
PARAMETER_HEADER = ("parameter", "value", "95 %", "unit", "vehicle file", "remark")


def calibration_text(c: Calibration) -> str:
    """Parameters, drives and polynomials, and the parameters that could not be estimated."""
    told = [p for p in c.parameters if p.identified]
    lines = [f"{c.vehicle_name}: {len(told)} of {len(c.parameters)} parameters estimated from {len(c.drives)} drives"]
    lines.append(table(PARAMETER_HEADER, [parameter_cells(p) for p in told]))
    lines += ["", table(DRIVE_HEADER, [drive_cells(d) for d in c.drives])]
    lines += [f"  {d.name}: left out {left_out(d.left_out)}" for d in c.drives if d.left_out]
    for section, fit in c.transfers.items():
        lines += ["", f"{section}: explains {fit.explained:.1%} of the variance in {fit.seconds:.0f} s"]
        lines.append(table(("coefficient", "value", "95 %"), _coefficients(fit)))
    if c.cannot_tell:
        lines += ["", "not determined by these drives", *(f"  {s}" for s in c.cannot_tell)]
    return "\n".join(lines) + "\n"


def parameter_cells(p: Parameter) -> tuple[str, ...]:
    """One row of the table."""
    file_value = _short(p.file_value) if math.isfinite(p.file_value) else ""
    return (p.name, _short(p.value), _interval(p.ci95), p.unit, file_value, p.remark or p.why_not)


def drive_cells(d: DriveFit) -> tuple[str, ...]:
    """One row of the drives."""
    difference, low, high = d.against_others
    against = f"{difference:+.0f} ({low:+.0f} ... {high:+.0f})" if math.isfinite(difference) else ""
    mass, sd = (f"{x:.0f}" if math.isfinite(x) else "" for x in (d.mass, d.mass_sd))
    offset = f"{d.offset:+.3f} ± {1.96 * d.offset_sd:.3f}" if math.isfinite(d.offset) else ""
    return (
        d.name, f"{d.used_s:.0f}", mass, sd, against, offset, f"{1e4 * d.drift:+.1f}", f"{d.torque_lag_s:+.2f}",
        f"{d.rmse_before:.3f}", f"{d.rmse_after:.3f}",
    )  # fmt: skip


def calibration_document(c: Calibration, *, logs: Sequence[str], notes: Sequence[str] = ()) -> dict[str, Any]:
    """The JSON document; NaN and infinities become null."""
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "vehicle": c.vehicle_name,
        "logs": list(logs),
        "fixed": dict(c.fixed),
        "parameters": [
            {
                "name": p.name, "value": _number(p.value), "ci95": [_number(x) for x in p.ci95], "unit": p.unit,
                "identified": p.identified, "why_not": p.why_not, "remark": p.remark,
                "file_value": _number(p.file_value),
            }
            for p in c.parameters
        ],
        "drives": [_drive(d) for d in c.drives],
        "transfers": {section: _transfer(fit) for section, fit in c.transfers.items()},
        "cannot_tell": list(c.cannot_tell),
        "notes": [*notes, *c.notes],
    }  # fmt: skip


def _drive(d: DriveFit) -> dict[str, Any]:
    difference, low, high = d.against_others
    return {
        "name": d.name, "mass": _number(d.mass), "mass_sd": _number(d.mass_sd),
        "against_others": {"value": _number(difference), "ci95": [_number(low), _number(high)], "unit": "kg"},
        "accelerometer_offset": _number(d.offset), "accelerometer_offset_sd": _number(d.offset_sd),
        "accelerometer_drift": _number(d.drift), "torque_lag_s": d.torque_lag_s, "velocity_lag_s": d.v_lag_s,
        "used_s": d.used_s, "driven_s": d.driven_s, "left_out_s": dict(d.left_out),
        "rmse_before": _number(d.rmse_before), "rmse_after": _number(d.rmse_after),
    }  # fmt: skip


def _transfer(fit: TieRodFit) -> dict[str, Any]:
    return {
        "coefficients": {n: [_number(x) for x in c] for n, c in fit.coefficients.items()},
        "ci95": {n: [[_number(x) for x in pair] for pair in pairs] for n, pairs in fit.ci95.items()},
        "sigma": fit.sigma, "explained": fit.explained, "seconds": fit.seconds,
    }  # fmt: skip


def _coefficients(fit: TieRodFit) -> list[tuple[str, ...]]:
    def power(name: str, i: int, of: Mapping[str, tuple[float, ...]]) -> str:
        return name if len(of[name]) == 1 else f"{name}[{i}]"

    rows = [
        (power(n, i, fit.coefficients), _short(x), _interval(fit.ci95[n][i]))
        for n, values in fit.coefficients.items()
        for i, x in enumerate(values)
    ]
    return [*rows, ("sigma", _short(fit.sigma), "")]


def _number(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def _short(x: float) -> str:
    return f"{x:.5g}" if math.isfinite(x) else ""


def _interval(ci: tuple[float, float]) -> str:
    low, high = ci
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return "" if low == high else f"{low:.5g} ... {high:.5g}"
