"""Regressions over a campaign as text for a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from aqualog.campaign.bins import Group, Plan
from aqualog.campaign.full_speed import FullSpeed
from aqualog.campaign.regress import Interval
from aqualog.campaign.resistance import MeanRow, ResistanceTable
from aqualog.campaign.slip_slope import SlopeRow, SlopeTable
from aqualog.campaign.spin_downs import SpinDownRow
from aqualog.report.text import table

__all__ = ["resistance_text", "slope_text"]

_TITLES = {
    "pressure_front_bar": "bar f", "pressure_rear_bar": "bar r", "water_depth_mm": "mm", "water_depth_left_mm": "mm l",
    "load_front_kg": "kg f", "load_rear_kg": "kg r", "tread_depth_mm": "tread",
}  # fmt: skip
_WAYS = {
    "slip_slope": "slip slope",
    "minor_spin_down": "minor spin-downs",
    "spin_down": "full spin-downs",
}
_UNKNOWN = "on or off the water is not known"


def slope_text(
    slopes: SlopeTable,
    speeds: Sequence[FullSpeed],
    spin_ups: Sequence[tuple[MeanRow, MeanRow]],
    downs: Sequence[SpinDownRow],
) -> str:
    """Tables for a terminal."""
    keys = _titles(slopes.plan.keys)
    header = (
        *keys, "wheel", "road", "km/h", "runs", "samples", "mu", "slope", "95 %", "/ dry", "contact", "95 %",
        "model slope", "contact", "lost %",
    )  # fmt: skip
    blocks = [
        "Slope: regression line of F_x/F_z over slip within mu (5 to 95 % of the traction driven).\n"
        "C_s/F_z, the tangent at zero slip, is larger. Model slope: the model's line over the same mu.\n"
        "Contact: share of the contact length with which a brush model has this slope.\n"
        "Lost: bias of 1/slope from traction noise; it is corrected",
        table(header, [_slope_cells(r, slopes.plan.keys) for r in slopes.rows])
        if slopes.rows
        else _nothing(slopes.plan, slopes.left_out),
        _reasons([(_where(r.group, r.wheel, r.road, r.low_kmh, r.high_kmh), r.reason) for r in slopes.rows]),
        *_dry_block(slopes),
        "\n".join(_delay_line(d.vehicle, d.value, d.ci, d.reason) for d in slopes.delays),
    ]
    if speeds:
        rows = [_speed_cells(f) for f in speeds]
        header = (*keys, "wheel", "from", "event", "km/h", "95 %", "based on")
        blocks += ["Speed of full aquaplaning, estimated from three kinds of events", table(header, rows)]
    if spin_ups:
        header = (*keys, "wheel", "km/h", "runs", "samples", "mu", "95 %", "without resistance")
        rows = [_spin_up_cells(u, left) for u, left in spin_ups]
        blocks += ["Traction coefficient while driven wheels spin up", table(header, rows)]
    if any(r.events or r.full for r in downs):
        header = (
            *keys, "wheel", "km/h", "passes", "events", "per s", "95 %", "per 100 m", "passes with", "full",
            "deepest slip %",
        )  # fmt: skip
        rows = [_spin_down_cells(r) for r in downs if r.events or r.full]
        blocks += ["Minor spin-downs of the free wheels, bins that have any", table(header, rows)]
    blocks.append(_left_out(slopes.left_out))
    return "\n\n".join(b for b in blocks if b) + "\n"


def resistance_text(found: ResistanceTable) -> str:
    """Tables for a terminal."""
    less = ", less each run's own level on dry road before the lane" if found.is_relative else ""
    header = (*_titles(found.plan.keys), "road", "km/h", "runs", "samples", "m/s²", "95 %", "run to run")
    rows = [(*_values(r.group, found.plan.keys), r.road, _kmh(r.low_kmh, r.high_kmh), str(r.runs), str(r.samples),
             _told(r.value, 3), _ends(r.ci, 3), _told(r.scatter, 3)) for r in found.rows]  # fmt: skip
    blocks = [
        f"Resistance measure (2.9){less}",
        table(header, rows) if rows else _nothing(found.plan, found.left_out),
        _reasons([(_where(r.group, "", r.road, r.low_kmh, r.high_kmh), r.reason) for r in found.rows]),
        _left_out(found.left_out),
    ]
    return "\n\n".join(b for b in blocks if b) + "\n"


def _nothing(plan: Plan, left_out: Mapping[str, int]) -> str:
    """Reason why a table has no row, and what to try."""
    if any(_UNKNOWN in reason for reason in left_out):
        return (
            f"no samples: {_UNKNOWN}\n"
            "try: water_depth_mm = 0 for dry runs; lane_start_s and lane_end_s, labels or on_water for wet ones"
        )
    other = sorted({"wet", "dry"} - set(plan.roads))
    return f"no samples on {' or '.join(plan.roads)} road" + (f"\ntry: --road {other[0]}" if other else "")


def _dry_block(slopes: SlopeTable) -> list[str]:
    if not slopes.dry:
        return ["no dry driving in these configurations: no contact ratio"]
    keys = tuple(k for k, _ in slopes.dry[0].group)
    rows = [(*_values(r.group), r.wheel, _ends(r.mu_range, 2), _told(r.slope), _ends(r.slope_ci), str(r.runs),
             _told(r.expected.slope)) for r in slopes.dry]  # fmt: skip
    return [table((*_titles(keys), "wheel", "mu", "dry slope, all speeds", "95 %", "runs", "model slope"), rows)]


def _slope_cells(r: SlopeRow, keys: Sequence[str]) -> tuple[str, ...]:
    ratio = r.slope / r.slope_dry if r.told else math.nan
    return (
        *_values(r.group, keys), r.wheel, r.road, _kmh(r.low_kmh, r.high_kmh), str(r.runs), str(r.samples),
        _ends(r.mu_range, 2), _told(r.slope), _ends(r.slope_ci), _told(ratio, 2), _told(r.contact_ratio, 2),
        _ends(r.contact_ratio_ci, 2), _told(r.expected.slope), _told(r.expected.contact, 2), _told(100 * r.attenuation),
    )  # fmt: skip


def _speed_cells(f: FullSpeed) -> tuple[str, ...]:
    ends = _ends((3.6 * f.ci[0], 3.6 * f.ci[1]), 0)
    return (*_values(f.group), f.place, _WAYS[f.way], f.event, _told(3.6 * f.v, 0), ends, f.reason or f.rests_on)


def _spin_up_cells(u: MeanRow, left: MeanRow) -> tuple[str, ...]:
    return (
        *_values(u.group), u.place, _kmh(u.low_kmh, u.high_kmh), str(u.runs), str(u.samples), _told(u.value, 3),
        _ends(u.ci, 3), _told(left.value, 3),
    )  # fmt: skip


def _spin_down_cells(r: SpinDownRow) -> tuple[str, ...]:
    return (
        *_values(r.group), r.wheel, _kmh(r.low_kmh, r.high_kmh), str(r.passes), str(r.events), f"{r.per_s:.2f}",
        _ends(r.per_s_ci, 2), f"{r.per_100_m:.2f}", f"{r.share:.0%}", str(r.full), f"{100 * r.deepest:.1f}",
    )  # fmt: skip


def _titles(keys: Sequence[str]) -> tuple[str, ...]:
    return tuple(_TITLES.get(k, k.removeprefix("x_")) for k in keys)


def _values(group: Group, keys: Sequence[str] | None = None) -> tuple[str, ...]:
    """Values of the keys; `-` where a run does not state one, empty where the row covers all values."""
    found = dict(group)
    return tuple(
        "" if k not in found else "-" if found[k] is None else f"{found[k]:g}" if isinstance(found[k], float) else
        str(found[k]) for k in (found if keys is None else keys)
    )  # fmt: skip


def _kmh(low: float, high: float) -> str:
    return f"{low:.0f}-{high:.0f}" if math.isfinite(low) else "all"


def _told(x: float, digits: int = 1) -> str:
    return f"{x:.{digits}f}" if math.isfinite(x) else "-"


def _ends(ci: Interval, digits: int = 1) -> str:
    if not any(math.isfinite(x) for x in ci):
        return "-"
    return " ... ".join(f"{x:.{digits}f}" if math.isfinite(x) else "open" for x in ci)


def _where(group: Group, wheel: str, road: str, low: float, high: float) -> str:
    return " ".join(x for x in (*_values(group), wheel, road, _kmh(low, high)) if x)


def _reasons(rows: Sequence[tuple[str, str]]) -> str:
    """Rows without a reliable estimate, grouped by reason: a hundred rows of one kind are one line."""
    places: dict[str, list[str]] = {}
    for where, reason in rows:
        if reason:
            places.setdefault(_kind(reason), []).append(f"{where}: {reason}")
    if not places:
        return ""
    lines = [f"  {found[0]}" + (f" (and {len(found) - 1} more like it)" if len(found) > 1 else "")
             for found in places.values()]  # fmt: skip
    return "\n".join(["not available, or not reliable:", *lines])


def _kind(reason: str) -> str:
    return "".join(c for c in reason if not (c.isdigit() or c in ".-+"))[:40]


def _delay_line(vehicle: str, value: float, ci: Interval, reason: str) -> str:
    if reason:
        return f"{vehicle}: the delay of v_x is not available: {reason}"
    return f"{vehicle}: v_x is late by {value:.3f} s ({_ends(ci, 3)}), the slip is corrected for it"


def _left_out(left_out: Mapping[str, int]) -> str:
    if not left_out:
        return ""
    ranked = sorted(left_out.items(), key=lambda item: -item[1])
    return "samples left out: " + ", ".join(f"{name} {n}" for name, n in ranked)
