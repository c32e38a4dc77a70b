"""Regressions over a campaign as the JSON documents of the contract, and as flat tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.campaign.bins import Group
from aqualog.campaign.full_speed import FullSpeed
from aqualog.campaign.regress import Interval
from aqualog.campaign.resistance import MeanRow, ResistanceTable
from aqualog.campaign.slip_slope import SlopeRow, SlopeTable
from aqualog.campaign.spin_downs import SpinDownRow
from aqualog.core.notation import SIDES

__all__ = ["SCHEMA_VERSION", "flat_rows", "resistance_document", "slope_document"]

SCHEMA_VERSION = 1

_DEFINITIONS = {
    "slope": "slope of the regression line of F_x / F_z over slip within mu_range (5 to 95 % of the traction driven). "
    "C_s / F_z is the tangent at zero slip and is larger",
    "slope_dry": "the same off the water, all speeds together, within mu_range_dry",
    "expected_slope": "slope of the model's regression line over mu_range",
    "contact_ratio": "share L of the contact length with which a brush model shows slope over mu_range. The brush "
    "has friction_wet and the tangent that belongs to slope_dry. At small traction L approaches "
    "sqrt(slope / slope_dry), (2.2). Values above 1 are scatter",
    "reliable": "estimated, with an interval whose ends are within a factor of 3, by a line that explains more than a "
    "constant",
}  # fmt: skip


def slope_document(
    name: str,
    slopes: SlopeTable,
    speeds: Sequence[FullSpeed],
    spin_ups: Sequence[tuple[MeanRow, MeanRow]],
    downs: Sequence[SpinDownRow],
) -> dict[str, Any]:
    """Slopes, dry references, delays of v_x, speeds of full aquaplaning, spin-ups, minor spin-downs."""
    return {
        **_head(name, slopes.plan.keys, slopes.plan.width_kmh, slopes.left_out, robust=slopes.robust),
        "definitions": dict(_DEFINITIONS),
        "rows": [_slope_row(r) for r in slopes.rows],
        "dry": [_slope_row(r) for r in slopes.dry],
        "delays": [
            {"vehicle": d.vehicle, "delay_s": _number(d.value), "delay_s_ci95": _pair(d.ci), "runs": d.runs,
             "samples": d.samples, "reason": d.reason or None} for d in slopes.delays
        ],
        "full_aquaplaning": [_speed(f) for f in speeds],
        "spin_ups": [_spin_up(u, left) for u, left in spin_ups],
        "minor_spin_downs": [_spin_down(r) for r in downs],
    }  # fmt: skip


def resistance_document(name: str, found: ResistanceTable) -> dict[str, Any]:
    """Mean resistance measures."""
    return {
        **_head(name, found.plan.keys, found.plan.width_kmh, found.left_out, robust=found.robust),
        "less_own_dry_level": found.is_relative,
        "rows": [
            {**_place(r.group, ""), **_bin(r.road, r.low_kmh, r.high_kmh, r.runs, r.samples, r.v_mean),
             "delta_a_x": _number(r.value), "delta_a_x_ci95": _pair(r.ci), "scatter": _number(r.scatter),
             "dof": _number(r.dof), "reliable": r.reliable, "reason": r.reason or None} for r in found.rows
        ],
    }  # fmt: skip


def flat_rows(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a document for a table: a pair `x_ci95` becomes `x_low` and `x_high`, other pairs likewise."""
    return [
        {name: value for key, x in row.items() for name, value in _flat(key, x)} for row in rows
    ]  # fmt: skip


def _flat(key: str, x: Any) -> list[tuple[str, Any]]:
    if not (isinstance(x, list) or key.endswith(("_ci95", "_ci95_kmh")) or key.startswith("mu_range")):
        return [(key, x)]
    stem = key.replace("_ci95", "")
    low, high = x if isinstance(x, list) else (None, None)
    return [(f"{stem}_low", low), (f"{stem}_high", high)]


def _head(name: str, keys: Sequence[str], width: float, left_out: Mapping[str, int], *, robust: bool) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION, "tool_version": __version__, "campaign": name, "by": list(keys),
        "bin_width_kmh": width, "robust": robust, "left_out_samples": dict(left_out),
    }  # fmt: skip


def _slope_row(r: SlopeRow) -> dict[str, Any]:
    return {
        **_place(r.group, r.wheel), **_bin(r.road, r.low_kmh, r.high_kmh, r.runs, r.samples, r.v_mean),
        "slope": _number(r.slope), "slope_ci95": _pair(r.slope_ci), "intercept": _number(r.intercept),
        "intercept_ci95": _pair(r.intercept_ci), "r2": _number(r.r2), "mu_range": _pair(r.mu_range),
        "attenuation": _number(r.attenuation), "scatter": _number(r.scatter), "dof": _number(r.dof),
        "reliable": r.reliable, "reason": r.reason or None, "slope_dry": _number(r.slope_dry),
        "slope_dry_ci95": _pair(r.slope_dry_ci), "runs_dry": r.runs_dry, "mu_range_dry": _pair(r.mu_range_dry),
        "friction_dry": _number(r.friction[0]), "friction_wet": _number(r.friction[1]),
        "contact_ratio": _number(r.contact_ratio),
        "contact_ratio_ci95": _pair(r.contact_ratio_ci), "expected_contact_ratio": _number(r.expected.contact),
        "expected_slope": _number(r.expected.slope), "expected_slope_dry": _number(r.expected.slope_dry),
        "expected_reason": r.expected.reason or None,
    }  # fmt: skip


def _speed(f: FullSpeed) -> dict[str, Any]:
    low, high = f.ci
    return {
        **_place(f.group, f.place), "way": f.way, "event": f.event, "defines": f.defines,
        "v_full_kmh": _number(3.6 * f.v), "v_full_ci95_kmh": _pair((3.6 * low, 3.6 * high)),
        "exponent": _number(f.exponent),
        "rests_on": f.rests_on or None, "reason": f.reason or None,
    }  # fmt: skip


def _spin_up(u: MeanRow, left: MeanRow) -> dict[str, Any]:
    return {
        **_place(u.group, u.place), **_bin(u.road, u.low_kmh, u.high_kmh, u.runs, u.samples, u.v_mean),
        "mu": _number(u.value), "mu_ci95": _pair(u.ci), "mu_residual": _number(left.value),
        "mu_residual_ci95": _pair(left.ci), "reliable": u.reliable, "reason": u.reason or None,
    }  # fmt: skip


def _spin_down(r: SpinDownRow) -> dict[str, Any]:
    return {
        **_place(r.group, r.wheel), "v_low_kmh": r.low_kmh, "v_high_kmh": r.high_kmh, "passes": r.passes,
        "seconds": _number(r.seconds), "events": r.events, "per_s": _number(r.per_s), "per_s_ci95": _pair(r.per_s_ci),
        "per_100_m": _number(r.per_100_m), "share": _number(r.share), "share_ci95": _pair(r.share_ci),
        "passes_with_full_spin_down": r.full, "deepest_slip_median": _number(r.deepest),
    }  # fmt: skip


def _place(group: Group, place: str) -> dict[str, Any]:
    head: dict[str, Any] = {k: v if isinstance(v, str) or v is None else _number(v) for k, v in group}
    return head | ({"side" if place in SIDES else "wheel": place} if place else {})


def _bin(road: str, low: float, high: float, runs: int, samples: int, v_mean: float) -> dict[str, Any]:
    return {
        "road": road, "v_low_kmh": _number(low), "v_high_kmh": _number(high), "v_mean_kmh": _number(3.6 * v_mean),
        "runs": runs, "samples": samples,
    }  # fmt: skip


def _number(x: float) -> float | None:
    """A number with six digits; null for NaN and infinities."""
    return float(f"{x:.6g}") if math.isfinite(x) else None


def _pair(ci: Interval) -> list[float | None] | None:
    """Both ends, null for an open one; null where there is no interval."""
    ends = [_number(x) for x in ci]
    return None if ends == [None, None] else ends
