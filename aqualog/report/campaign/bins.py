"""Regressions over a campaign for a reader: JSON documents of the contract, flat tables, and sections."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.campaign.bins import Group, Plan
from aqualog.campaign.full_speed import FullSpeed
from aqualog.campaign.means import MeanRow, ResistanceTable
from aqualog.campaign.slip_slope import SlopeRow, SlopeTable
from aqualog.campaign.spin_downs import SpinDownRow
from aqualog.core.intervals import Interval
from aqualog.core.notation import SIDES
from aqualog.report.sections import Lines, Para, Report, Section, Table
from aqualog.report.values import KMH, ends, fields_of, plain

__all__ = ["flat_rows", "resistance_document", "resistance_report", "slope_document", "slope_report"]

_DEFINITIONS = {
    "slope": "slope of the regression line of F_x / F_z over slip within mu_range (5 to 95 % of the traction driven). "
    "C_s / F_z is the tangent at zero slip and is larger",
    "slope_dry": "the same off the water, all speeds together, within mu_range_dry",
    "expected_slope": "slope of the model's regression line over mu_range",
    "contact_ratio": "share L of the contact length with which a brush model shows slope over mu_range. The brush "
    "has friction_wet and the tangent that belongs to slope_dry. At small traction L approaches "
    "sqrt(slope / slope_dry), (2.2). An estimate or an end above 1 is scatter and stands as 1",
    "reliable": "estimated, with an interval whose ends are within a factor of 3, by a line that explains more than a "
    "constant",
}  # fmt: skip
_TITLES = {
    "pressure_front_bar": "bar f", "pressure_rear_bar": "bar r", "water_depth_mm": "mm", "water_depth_left_mm": "mm l",
    "load_front_kg": "kg f", "load_rear_kg": "kg r", "tread_depth_mm": "tread",
}  # fmt: skip
_WAYS = {
    "slip_slope": "slip slope", "minor_spin_down": "minor spin-downs", "spin_down": "full spin-downs",
    "margin": "margin, foretold",
}  # fmt: skip
_LEGEND = (
    "Slope: regression line of F_x/F_z over slip within mu (5 to 95 % of the traction driven).\n"
    "C_s/F_z, the tangent at zero slip, is larger. Model slope: the model's line over the same mu.\n"
    "Contact: share of the contact length with which a brush model has this slope.\n"
    "Lost: bias of 1/slope from traction noise; it is corrected"
)
_SLOPE_HEADS = (
    "wheel", "road", "km/h", "runs", "samples", "mu", "slope", "95 %", "/ dry", "contact", "95 %", "model slope",
    "contact", "lost %",
)  # fmt: skip
_DOWN_HEADS = (
    "wheel", "km/h", "passes", "events", "per s", "95 %", "per 100 m", "passes with", "full", "deepest slip %",
)  # fmt: skip
_UNKNOWN = "on or off the water is not known"


def slope_document(
    name: str, slopes: SlopeTable, speeds: Sequence[FullSpeed], spin_ups: Sequence[tuple[MeanRow, MeanRow]],
    downs: Sequence[SpinDownRow],
) -> dict[str, Any]:  # fmt: skip
    """Slopes, dry references, delays of v_x, speeds of full aquaplaning, spin-ups, minor spin-downs."""
    return {
        **_head(name, slopes.plan, slopes.left_out, robust=slopes.robust),
        "definitions": dict(_DEFINITIONS),
        "rows": [_slope_row(r) for r in slopes.rows],
        "dry": [_slope_row(r) for r in slopes.dry],
        "delays": [
            {"vehicle": d.vehicle, "delay_s": _number(d.value), "delay_s_ci95": _pair(d.ci), "runs": d.runs,
             "samples": d.samples, "reason": d.reason or None} for d in slopes.delays
        ],
        "full_aquaplaning": [
            {**_place(f.group, f.place), "way": f.way, "event": f.event, "defines": f.defines,
             "v_full_kmh": _number(KMH * f.v), "v_full_ci95_kmh": _pair((KMH * f.ci[0], KMH * f.ci[1])),
             "exponent": _number(f.exponent), "rests_on": f.rests_on or None, "reason": f.reason or None}
            for f in speeds
        ],
        "spin_ups": [
            {**_place(u.group, u.place), **_bin(u), "mu": _number(u.value), "mu_ci95": _pair(u.ci),
             "mu_residual": _number(left.value), "mu_residual_ci95": _pair(left.ci), "reliable": u.reliable,
             "reason": u.reason or None} for u, left in spin_ups
        ],
        "minor_spin_downs": [
            {**_place(r.group, r.wheel), "v_low_kmh": r.low_kmh, "v_high_kmh": r.high_kmh, "passes": r.passes,
             "seconds": _number(r.seconds), "events": r.events, "per_s": _number(r.per_s),
             "per_s_ci95": _pair(r.per_s_ci), "per_100_m": _number(r.per_100_m), "share": _number(r.share),
             "share_ci95": _pair(r.share_ci), "passes_with_full_spin_down": r.full,
             "deepest_slip_median": _number(r.deepest)} for r in downs
        ],
    }  # fmt: skip


def resistance_document(name: str, found: ResistanceTable) -> dict[str, Any]:
    """Mean resistance measures."""
    return {
        **_head(name, found.plan, found.left_out, robust=found.robust),
        "less_own_dry_level": found.is_relative,
        "rows": [
            {**_place(r.group, ""), **_bin(r), "delta_a_x": _number(r.value), "delta_a_x_ci95": _pair(r.ci),
             "scatter": _number(r.scatter), "dof": _number(r.dof), "reliable": r.reliable, "reason": r.reason or None}
            for r in found.rows
        ],
    }  # fmt: skip


def flat_rows(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a document for a table: a pair `x_ci95` becomes `x_low` and `x_high`, other pairs likewise."""
    return [{name: value for key, x in row.items() for name, value in _flat(key, x)} for row in rows]


def _flat(key: str, x: Any) -> list[tuple[str, Any]]:
    if not (isinstance(x, list) or key.endswith(("_ci95", "_ci95_kmh")) or key.startswith("mu_range")):
        return [(key, x)]
    stem = key.replace("_ci95", "")
    low, high = x if isinstance(x, list) else (None, None)
    return [(f"{stem}_low", low), (f"{stem}_high", high)]


def _head(name: str, plan: Plan, left_out: Mapping[str, int], *, robust: bool) -> dict[str, Any]:
    return {
        "schema_version": 1, "tool_version": __version__, "campaign": name, "by": list(plan.keys),
        "bin_width_kmh": plan.width_kmh, "robust": robust, "left_out_samples": dict(left_out),
    }  # fmt: skip


def _slope_row(r: SlopeRow) -> dict[str, Any]:
    return {
        **_place(r.group, r.wheel), **_bin(r),
        "slope": _number(r.slope), "slope_ci95": _pair(r.slope_ci), "intercept": _number(r.intercept),
        "intercept_ci95": _pair(r.intercept_ci), "r2": _number(r.r2), "mu_range": _pair(r.mu_range),
        **fields_of(r, "attenuation", "scatter", "dof", "reliable", digits=6), "reason": r.reason or None,
        "slope_dry": _number(r.slope_dry), "slope_dry_ci95": _pair(r.slope_dry_ci), "runs_dry": r.runs_dry,
        "mu_range_dry": _pair(r.mu_range_dry), "friction_dry": _number(r.friction[0]),
        "friction_wet": _number(r.friction[1]), "contact_ratio": _number(min(r.contact_ratio, 1.0)),
        "contact_ratio_ci95": _pair(_share(r.contact_ratio_ci)), "expected_contact_ratio": _number(r.expected.contact),
        "expected_slope": _number(r.expected.slope), "expected_slope_dry": _number(r.expected.slope_dry),
        "expected_reason": r.expected.reason or None,
    }  # fmt: skip


def _place(group: Group, place: str) -> dict[str, Any]:
    head: dict[str, Any] = {k: v if isinstance(v, str) or v is None else _number(v) for k, v in group}
    return head | ({"side" if place in SIDES else "wheel": place} if place else {})


def _bin(r: SlopeRow | MeanRow) -> dict[str, Any]:
    return {
        "road": r.road, "v_low_kmh": _number(r.low_kmh), "v_high_kmh": _number(r.high_kmh),
        "v_mean_kmh": _number(KMH * r.v_mean), "runs": r.runs, "samples": r.samples,
    }  # fmt: skip


def _number(x: float) -> float | None:
    """A number with six digits; null for NaN and infinities."""
    shown: float | None = plain(float(x), 6)
    return shown


def _share(ci: Interval) -> Interval:
    """An interval of a share: no contact is longer than the whole one."""
    return min(ci[0], 1.0), min(ci[1], 1.0)


def _pair(ci: Interval) -> list[float | None] | None:
    """Both ends, null for an open one; null where there is no interval."""
    ends = [_number(x) for x in ci]
    return None if ends == [None, None] else ends


# --- sections --------------------------------------------------------------------------------------------------------


def slope_report(
    slopes: SlopeTable,
    speeds: Sequence[FullSpeed],
    spin_ups: Sequence[tuple[MeanRow, MeanRow]],
    downs: Sequence[SpinDownRow],
) -> Report:
    """Tables of slopes, dry references, speeds of full aquaplaning, spin-ups and minor spin-downs."""
    keys = slopes.plan.keys
    dry_keys = tuple(k for k, _ in slopes.dry[0].group) if slopes.dry else ()
    some = [r for r in downs if r.events or r.full]
    sections = [
        Section("", [Para(_LEGEND, "everywhere")]),
        Section("", [
            _table((*_titles(keys), *_SLOPE_HEADS), [_slope_cells(r, keys) for r in slopes.rows]),
            Para("" if slopes.rows else _nothing(slopes), "everywhere"),
        ]),
        _reasons([(_where(r.group, r.wheel, r.road, r.low_kmh, r.high_kmh), r.reason) for r in slopes.rows]),
        Section("", [
            _table((*_titles(dry_keys), "wheel", "mu", "dry slope, all speeds", "95 %", "runs", "model slope"), [
                (*_values(r.group), r.wheel, ends(r.mu_range, 2), _shown(r.slope), ends(r.slope_ci), str(r.runs),
                 _shown(r.expected.slope)) for r in slopes.dry
            ]),
            Para("" if slopes.dry else _no_reference(slopes.dry_left_out), "everywhere"),
        ]),
        Section("", [Para("\n".join(
            f"{d.vehicle}: the delay of v_x is not available: {d.reason}" if d.reason else
            f"{d.vehicle}: v_x is late by {d.value:.3f} s ({ends(d.ci, 3)}), the slip is corrected for it"
            for d in slopes.delays
        ), "everywhere")]),
        Section("Speed of full aquaplaning, estimated in four ways", [
            _table((*_titles(keys), "wheel", "from", "event", "km/h", "95 %", "based on"), [
                (*_values(f.group), f.place, _WAYS[f.way], f.event, _shown(KMH * f.v, 0),
                 ends((KMH * f.ci[0], KMH * f.ci[1]), 0), f.reason or f.rests_on) for f in speeds
            ]),
        ]),
        Section("Traction coefficient while driven wheels spin up", [
            _table((*_titles(keys), "wheel", "km/h", "runs", "samples", "mu", "95 %", "without resistance"), [
                (*_values(u.group), u.place, _kmh(u.low_kmh, u.high_kmh), str(u.runs), str(u.samples),
                 _shown(u.value, 3), ends(u.ci, 3), _shown(left.value, 3)) for u, left in spin_ups
            ]),
        ]),
        Section("Minor spin-downs of the free wheels, bins that have any", [
            _table((*_titles(keys), *_DOWN_HEADS), [
                (*_values(r.group), r.wheel, _kmh(r.low_kmh, r.high_kmh), str(r.passes), str(r.events),
                 f"{r.per_s:.2f}", ends(r.per_s_ci, 2), f"{r.per_100_m:.2f}", f"{r.share:.0%}", str(r.full),
                 f"{100 * r.deepest:.1f}") for r in some
            ]),
        ]),
        _left_out(slopes.left_out),
    ]  # fmt: skip
    return Report("slip slope", "slip slope over speed", sections)


def resistance_report(found: ResistanceTable) -> Report:
    """Table of the mean resistance measures."""
    less = ", less each run's own level on dry road before the lane" if found.is_relative else ""
    keys = found.plan.keys
    sections = [
        Section("", [Para(f"Resistance measure (2.9){less}", "everywhere")]),
        Section("", [
            _table((*_titles(keys), "road", "km/h", "runs", "samples", "m/s²", "95 %", "run to run"), [
                (*_values(r.group, keys), r.road, _kmh(r.low_kmh, r.high_kmh), str(r.runs), str(r.samples),
                 _shown(r.value, 3), ends(r.ci, 3), _shown(r.scatter, 3)) for r in found.rows
            ]),
            Para("" if found.rows else _nothing(found), "everywhere"),
        ]),
        _reasons([(_where(r.group, "", r.road, r.low_kmh, r.high_kmh), r.reason) for r in found.rows]),
        _left_out(found.left_out),
    ]  # fmt: skip
    return Report("resistance", "resistance over speed", sections)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    return Table(header, rows, words=range(len(header)))


def _nothing(found: SlopeTable | ResistanceTable) -> str:
    """Reason why a table has no row, and what to try: another road only if it has rows."""
    road = " or ".join(found.plan.roads)
    known = _known(found.left_out)
    most = max(known, key=lambda reason: known[reason], default="")
    lines = [f"all samples on {road} road are left out, most of them because: {most}" if known else ""]
    if sum(found.left_out.values()) > sum(known.values()):
        lines += [
            f"{'some' if known else 'no'} samples: {_UNKNOWN}",
            "try: water_depth_mm = 0 for dry runs; lane_start_s and lane_end_s, labels or on_water for wet ones",
        ]
    lines = [line for line in lines if line] or [f"no samples on {road} road"]
    return "\n".join([*lines, *(f"try: --road {other}" for other in found.elsewhere)])


def _known(left_out: Mapping[str, int]) -> Mapping[str, int]:
    """Samples left out on a road that is known."""
    return {reason: n for reason, n in left_out.items() if _UNKNOWN not in reason}


def _no_reference(left_out: Mapping[str, int]) -> str:
    """Why there is no dry slope."""
    known = _known(left_out)
    if not known:
        return "no dry driving in these configurations: no contact ratio"
    return f"no dry slope, so no contact ratio; of the dry driving: {max(known, key=lambda reason: known[reason])}"


def _slope_cells(r: SlopeRow, keys: Sequence[str]) -> tuple[str, ...]:
    ratio = r.slope / r.slope_dry if r.told else math.nan
    return (
        *_values(r.group, keys), r.wheel, r.road, _kmh(r.low_kmh, r.high_kmh), str(r.runs), str(r.samples),
        ends(r.mu_range, 2), _shown(r.slope), ends(r.slope_ci), _shown(ratio, 2), _shown(min(r.contact_ratio, 1.0), 2),
        ends(_share(r.contact_ratio_ci), 2), _shown(r.expected.slope), _shown(r.expected.contact, 2),
        _shown(100 * r.attenuation),
    )  # fmt: skip


def _titles(keys: Sequence[str]) -> tuple[str, ...]:
    return tuple(_TITLES.get(k, k.removeprefix("x_")) for k in keys)


def _values(group: Group, keys: Sequence[str] | None = None) -> tuple[str, ...]:
    """Values of the keys; `-` where a run does not state one, empty where the row covers all values."""
    found = {k: "-" if v is None else f"{v:g}" if isinstance(v, float) else str(v) for k, v in group}
    return tuple(found.get(k, "") for k in (found if keys is None else keys))


def _kmh(low: float, high: float) -> str:
    return f"{low:.0f}-{high:.0f}" if math.isfinite(low) else "all"


def _shown(x: float, digits: int = 1) -> str:
    return f"{x:.{digits}f}" if math.isfinite(x) else "-"


def _where(group: Group, wheel: str, road: str, low: float, high: float) -> str:
    return " ".join(x for x in (*_values(group), wheel, road, _kmh(low, high)) if x)


def _reasons(rows: Sequence[tuple[str, str]]) -> Section:
    """Rows without a reliable estimate, grouped by reason: a hundred rows of one kind are one line."""
    places: dict[str, list[str]] = {}
    for where, reason in rows:
        if reason:
            kind = "".join(c for c in reason if not (c.isdigit() or c in ".-+"))[:40]
            places.setdefault(kind, []).append(f"{where}: {reason}")
    lines = [f"{x[0]}{f' (and {len(x) - 1} more like it)' if len(x) > 1 else ''}" for x in places.values()]
    return Section("Not available, or not reliable:", [Lines(lines, most=1000)])


def _left_out(left_out: Mapping[str, int]) -> Section:
    ranked = ", ".join(f"{name} {n}" for name, n in sorted(left_out.items(), key=lambda item: -item[1]))
    return Section("", [Para(f"samples left out: {ranked}" if ranked else "", "everywhere")])
