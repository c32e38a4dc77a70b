"""A calibration for a reader: the JSON document, the sections of text and page, and figures of the residual."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from aqualog import __version__
from aqualog.calibrate.records import Calibration, DriveFit, Parameter, PassFit, TieRodFit
from aqualog.calibrate.words import left_out
from aqualog.core.intervals import Interval, same_decimals
from aqualog.core.records import FloatArray, Remark
from aqualog.core.units import displayed_text
from aqualog.report.figures import axis, dots, figure
from aqualog.report.inputs import input_sections
from aqualog.report.sections import Figures, Lines, Para, Report, Section, Table
from aqualog.report.theme import MUTED, wheel_colour
from aqualog.report.values import KMH, counted, fields_of, plain, pretty_unit

__all__ = ["balance_residuals", "calibration_document", "calibration_report", "estimated", "parameter_cells"]

_PARAMETERS = ("Parameter", "Value", "95 %", "Unit", "Vehicle file", "Remark")
_DRIVES = (
    "Drive", "Used [s]", "Mass [kg]", "SD [kg]", "Against the others [kg]", "Offset [m/s²]", "Drift [1e-4 m/s³]",
    "Torque delay [s]", "Before [m/s²]", "After [m/s²]",
)  # fmt: skip
_PASSES = ("Pass", "Mean speed [km/h]", "Water [mm]", "Windows", "Wheel lost at [km/h]", "Left out")
_MOST_DOTS = 6000
_DOTS = (
    "Each dot is the mean of 2 s of straight, unbraked driving. It shows measured acceleration minus the acceleration "
    "expected from torques, drag and rolling resistance. One colour uses the vehicle file's values, the other the "
    "calibrated ones."
)


def calibration_document(c: Calibration, *, logs: Sequence[str], notes: Sequence[str] = ()) -> dict[str, Any]:
    """The JSON document; NaN and infinities become null."""
    parameters = ("name", "value", "ci95", "unit", "identified", "why_not", "remark", "file_value", "kept")
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "vehicle": c.vehicle_name,
        "logs": list(logs),
        "fixed": dict(c.fixed),
        "parameters": [fields_of(p, *parameters, digits=None) for p in c.parameters],
        "drives": [
            {
                **fields_of(d, "name", "mass", "mass_sd", digits=None),
                "against_others": {
                    "value": plain(d.against_others[0], None), "ci95": plain(d.against_others[1:], None), "unit": "kg",
                },
                **fields_of(
                    d, digits=None, accelerometer_offset="offset", accelerometer_offset_sd="offset_sd",
                    accelerometer_drift="drift", torque_lag_s="torque_lag_s", velocity_lag_s="v_lag_s",
                    used_s="used_s", driven_s="driven_s", left_out_s="left_out", rmse_before="rmse_before",
                    rmse_after="rmse_after",
                ),
            }
            for d in c.drives
        ],
        "transfers": {
            section: fields_of(fit, "coefficients", "ci95", "sigma", "explained", "seconds", digits=None)
            for section, fit in c.transfers.items()
        },
        "cannot_tell": list(c.cannot_tell),
        "notes": [*notes, *c.notes],
        "passes": [
            fields_of(p, "name", "v", "v_lost", "windows", "why", digits=None, water_depth="h_w") for p in c.passes
        ],
    }  # fmt: skip


def calibration_report(c: Calibration, notes: Sequence[str] = (), checks: Sequence[Remark] = ()) -> Report:
    """Parameters, drives and polynomials, what could not be estimated, and the residual of the force balance.

    Parameters
    ----------
    c : Calibration
    notes : sequence of str
        On the files, beside those of the result.
    checks : sequence of Remark
        What does not fit among the signals.
    """
    known = [p for p in c.parameters if p.identified]
    head = f"{c.vehicle_name}: {estimated(c)}"
    plots = {f"residual-{i}": figure for i, figure in enumerate(balance_residuals(c))} if c.drives else {}
    sections = [
        *input_sections(checks),
        Section("", [Para(head, where="text")]),
        Section("Parameters", [
            Table(_PARAMETERS, [parameter_cells(p) for p in known], "parameters", (0, 3, 5), wide=(5,)),
        ], "parameters-section"),
        Section("Not determined by these drives", [Lines([displayed_text(x) for x in c.cannot_tell], most=1000)],
                "cannot-tell", look="problems"),
        Section("Drives", [
            Table(_DRIVES, [_drive_cells(d) for d in c.drives], "drives"),
            Lines([f"{d.name}: left out {why}" for d in c.drives if (why := left_out(d.left_out))]),
        ], "drives-section"),
        Section("Passes over water", [Table(_PASSES, [_pass_cells(p) for p in c.passes], "passes", (0, 5))]),
        *(
            Section(f"{name}: explains {fit.explained:.1%} of the variance in {fit.seconds:.0f} s", [
                Table(("Coefficient", "Value", "95 %"), [*_coefficients(fit), ("sigma", _short(fit.sigma), "")]),
            ])
            for name, fit in c.transfers.items()
        ),
        Section("Notes", [Lines([*notes, *c.notes], most=1000)], "notes", look="problems", where="page"),
        *([Section("Balance of forces", [Figures(list(plots)), Para(_DOTS)], "plot-section")] if plots else []),
    ]  # fmt: skip
    facts = [("vehicle", c.vehicle_name), ("estimated", f"{len(known)} of {len(c.parameters)} parameters")]
    return Report(
        "calibration", f"calibration from {'passes over water' if c.passes else 'dry drives'}", sections, facts, plots
    )


def estimated(c: Calibration) -> str:
    """`9 of 12 parameters estimated from 4 drives`, and how many of these the vehicle file contradicts."""
    known, kept = ([p for p in c.parameters if p.identified], [p for p in c.parameters if p.kept])
    used = f"{sum(not p.why for p in c.passes)} passes over water" if c.passes else counted(len(c.drives), "drive")
    verb = "contradicts" if len(kept) == 1 else "contradict"
    own = f"; {len(kept)} of them {verb} the vehicle file, which keeps its own" if kept else ""
    return f"{len(known)} of {len(c.parameters)} parameters estimated from {used}{own}"


def _pass_cells(p: PassFit) -> tuple[str, ...]:
    v, lost, depth = (
        f"{k * x:.{d}f}" if math.isfinite(x) else "" for k, x, d in ((KMH, p.v, 1), (KMH, p.v_lost, 1), (1e3, p.h_w, 2))
    )
    return p.name, v, depth, str(p.windows), lost, p.why


def parameter_cells(p: Parameter) -> tuple[str, ...]:
    """One row of the table: name, value, interval, unit, value of the vehicle file, remark."""
    why = p.remark or p.why_not
    return p.name, *_estimate(p.value, p.ci95), pretty_unit(p.unit), _short(p.file_value), why


def _drive_cells(d: DriveFit) -> tuple[str, ...]:
    difference, low, high = d.against_others
    against = f"{difference:+.0f} ({low:+.0f} ... {high:+.0f})" if math.isfinite(difference) else ""
    mass, sd = (f"{x:.0f}" if math.isfinite(x) else "" for x in (d.mass, d.mass_sd))
    offset = f"{d.offset:+.3f} ± {1.96 * d.offset_sd:.3f}" if math.isfinite(d.offset) else ""
    drift = f"{1e4 * d.drift:+.1f}" if math.isfinite(d.drift) else ""
    before, after = (f"{x:.3f}" if math.isfinite(x) else "" for x in (d.rmse_before, d.rmse_after))
    return d.name, f"{d.used_s:.0f}", mass, sd, against, offset, drift, f"{d.torque_lag_s:+.2f}", before, after


def _coefficients(fit: TieRodFit) -> list[tuple[str, str, str]]:
    return [
        (key if len(values) == 1 else f"{key}[{i}]", *_estimate(x, fit.ci95[key][i]))
        for key, values in fit.coefficients.items()
        for i, x in enumerate(values)
    ]


def _short(x: float) -> str:
    return f"{x:.5g}" if math.isfinite(x) else ""


def _estimate(x: float, ci: Interval) -> tuple[str, str]:
    """A value and its interval; empty without one."""
    value, low, high = same_decimals(x, ci)
    return value, f"{low} ... {high}" if low and high and low != high else ""


def balance_residuals(c: Calibration) -> list[dict[str, Any]]:
    """Two figures: residual of the force balance over speed, and over wheel force, before and after."""
    v, force, before, after = (
        np.concatenate([getattr(d, name) for d in c.drives]) for name in ("v", "force", "before", "after")
    )
    return [
        _residual(KMH * v, before, after, "residual over speed", "speed [km/h]"),
        _residual(1e-3 * force, before, after, "residual over wheel force", "force of the wheel torques [kN]"),
    ]


def _residual(x: FloatArray, before: FloatArray, after: FloatArray, title: str, label: str) -> dict[str, Any]:
    step = max(1, -(-x.size // _MOST_DOTS))
    data = [
        dots(name, x[::step], y[::step], colour, style={"opacity": 0.5})
        for name, y, colour in (("vehicle file", before, MUTED), ("calibrated", after, wheel_colour("fl")))
    ]
    return figure(data, title, axis(label), axis("measured minus expected [m/s²]"))
