"""A tyre test as a JSON document. Speeds in km/h, everything else SI; null where there is no value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aqualog import __version__
from aqualog.campaign.bins import Group
from aqualog.core.intervals import Interval
from aqualog.report.values import KMH, fields_of, plain
from aqualog.trade.braking import Stop
from aqualog.trade.control import Index
from aqualog.trade.curve import CurvePass
from aqualog.trade.curve_set import RESULTS, CurveSet
from aqualog.trade.entry import Entry
from aqualog.trade.evaluation import ControlRow, SetRow, TradeTest
from aqualog.trade.limits import Limits, described
from aqualog.trade.onset import SIGNS
from aqualog.trade.sets import Summary
from aqualog.trade.straight import LEVELS, StraightRun

__all__ = ["TABLES", "limit_rows", "trade_document"]

TABLES = {"straight": ("straight", "set"), "curve": ("curve",), "braking": ("braking",)}
"""Tables of `limits.toml` that a test uses."""


def trade_document(test: TradeTest, name: str) -> dict[str, Any]:
    """Return the document of `aqualog test`; `name` is that of the campaign."""
    o = test.options
    head: dict[str, Any] = {
        "schema_version": 1,
        "tool_version": __version__,
        "test": o.kind,
        "name": name,
        "by": list(o.keys),
        "runs": [_run(e, o.limits.straight.slip) for e in test.entries],
        "sets": [_set(s, test) for s in test.sets],
        "controls": [_control(c, o.kind) for c in test.controls],
    }
    if o.kind == "curve":
        unit, meaning = RESULTS[o.result]
        head |= {"result": {"name": o.result, "unit": unit, "meaning": meaning}, "common_kmh": _pair(test.between, KMH)}
    return head | {
        "limits": limit_rows(o.limits, TABLES[o.kind]),
        "failed": [{"log": n, "reason": r} for n, r in test.failed.items()],
        "notes": list(test.notes),
    }


def limit_rows(limits: Limits, tables: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the thresholds in use, each with its default, unit, meaning and source."""
    return [
        {"key": d.path, "value": plain(limits.value(d)), "default": d.value, "unit": d.unit, "meaning": d.meaning,
         "source": "the user's file" if d.path in limits.changed else d.source}
        for d in described() if d.table in tables
    ]  # fmt: skip


def _kmh(v: float) -> float | None:
    found: float | None = plain(KMH * v, 6)
    return found


def _pair(ci: Interval, factor: float = 1.0) -> list[float] | None:
    """Return an interval for JSON; null where an end is not known. An open end is null in the list."""
    low, high = (plain(factor * x, 6) for x in ci)
    return None if low is None and high is None else [low, high]


def _run(e: Entry, slip: float) -> dict[str, Any]:
    row: dict[str, Any] = {
        "log": e.log,
        "number": e.number,
        "order": int(e.order) + 1,
        "tyre": e.tyre or None,
        **dict(_flat(e.group)),
        "valid": e.valid,
        "reason": "; ".join(e.reasons) or None,
    }
    if isinstance(e.found, StraightRun):
        row |= _straight(e, e.found, slip)
    elif isinstance(e.found, CurvePass):
        row |= _pass(e.found)
    else:
        row |= _stop(e.found)
    return row | {"notes": list(e.found.notes)}


def _straight(e: Entry, r: StraightRun, slip: float) -> dict[str, Any]:
    onset = {} if e.onset is None else e.onset.speeds
    return {
        "v_15_kmh": _kmh(r.v), "slip": plain(slip), "censored": r.is_censored,
        **{f"{n}_kmh": _kmh(r.speeds.get(n, np.nan)) for n in LEVELS if n != "v_15"},
        **{f"v_{n}_kmh": _kmh(onset.get(n, np.nan)) for n in SIGNS},
        "onset_missing": None if e.onset is None else dict(e.onset.missing), "reference": r.reference or None,
        "other_reference": r.other or None, "v_15_other_kmh": _kmh(r.speeds_other.get("v_15", np.nan)),
        "a_x": plain(r.a_x, 6), "yaw_rate": plain(r.yaw_rate, 6), "radius_ratio": plain(r.ratio),
        "v_x_late_s": plain(r.late, 4),
        "wet_side": r.wet_side, "axle": r.axle or None, "crossing_s": plain(r.t_15, 6),
        "lane_s": None if r.lane is None else list(r.lane),
    }  # fmt: skip


def _pass(p: CurvePass) -> dict[str, Any]:
    own = fields_of(p, "a_y_dry", "a_y_least", "a_y_mean", digits=6, radius_m="radius", steer_change="steer")
    return {"v_entry_kmh": _kmh(p.v_entry), **own, "lane_s": None if p.lane is None else list(p.lane)}


def _stop(s: Stop) -> dict[str, Any]:
    own = fields_of(s, "bfc", "bfc_20", "start_s", "end_s", digits=6, distance_m="distance")
    depths = {"water_depth_mm": plain(1e3 * s.water_depth, 6), "texture_mm": plain(1e3 * s.texture, 6)}
    speeds = {"v_from_kmh": _kmh(s.v_from), "v_to_kmh": _kmh(s.v_to)}
    return own | speeds | depths | {"temperature_c": plain(s.temperature, 6)}


def _set(s: SetRow, test: TradeTest) -> dict[str, Any]:
    values = dict(_flat(s.group))
    members = [test.entries[i] for i in s.members]
    row: dict[str, Any] = {"tyre": None, **values, "control": s.is_control}
    if s.curve is not None:
        row |= _curve(s.curve)
    else:
        assert s.summary is not None
        row |= _summary(s.summary, test.options.kind)
    row |= _index(s.index)
    if test.options.kind == "straight":
        row |= _onset(members)
    if test.options.kind == "braking":
        row |= {"wet_grip_index": plain(s.grip_index, 6), "temperature_c": plain(s.temperature, 6)}
    notes = [*(s.summary.notes if s.summary else s.curve.notes if s.curve else ()), *filter(None, [s.index_note])]
    return row | {"notes": notes}


def _summary(s: Summary, kind: str) -> dict[str, Any]:
    stem = "_kmh" if kind == "straight" else ""
    return {
        "runs": s.runs, "valid": s.valid, "censored": s.censored, f"mean{stem}": plain(s.mean, 6),
        "ci95": _pair(s.ci), f"sd{stem}": plain(s.sd, 6), "cv": plain(s.cv, 6), f"above{stem}": plain(s.above, 6),
        "enough": s.is_enough,
    }  # fmt: skip


def _curve(c: CurveSet) -> dict[str, Any]:
    speeds = {"v_greatest": c.v_greatest, "v_half": c.v_half, "v_zero": c.v_zero}
    return {
        "runs": c.passes, "valid": c.valid, "value": plain(c.result, 6), "ci95": _pair(c.ci),
        **{f"{n}_kmh": _kmh(v) for n, (v, _) in speeds.items()},
        **{f"{n}_kmh_ci95": _pair(ci, KMH) for n, (_, ci) in speeds.items()},
        "curve": {
            "v_kmh": plain(c.v * KMH, 6), "a_y_least": plain(c.least, 6), "a_y_mean": plain(c.mean, 6),
            "a_y_dry": plain(c.dry, 6),
        },
    }  # fmt: skip


def _index(index: Index | None) -> dict[str, Any]:
    found = index or Index()
    return {
        "index": plain(found.value, 6),
        "index_ci95": _pair(found.ci),
        "control_value": plain(found.control, 6),
        "verdict": found.sentence or None,
    }


def _onset(members: list[Entry]) -> dict[str, Any]:
    """Return the means of a set's signs before 15 %, over the valid runs that show them."""
    good = [e for e in members if e.valid]

    def mean(values: list[float]) -> float | None:
        known = [v for v in values if np.isfinite(v)]
        return _kmh(float(np.mean(known))) if known else None

    of_run = [e.found.speeds.get("v_05", np.nan) for e in good if isinstance(e.found, StraightRun)]
    onset = {n: [e.onset.speeds.get(n, np.nan) for e in good if e.onset is not None] for n in SIGNS}
    return {"v_05_kmh": mean(of_run), **{f"v_{n}_kmh": mean(v) for n, v in onset.items()}}


def _control(c: ControlRow, kind: str) -> dict[str, Any]:
    return {
        "tyre": c.control.name,
        "configuration": dict(_flat(c.rest)),
        "sets": [
            {"order": plain(b.order + 1.0, 6), "runs": b.runs, "value": plain(b.estimate.value, 6)}
            for b in c.control.blocks
        ],
        "drift": None if c.drift is None else plain(c.drift.change, 6),
        "drift_ci95": None if c.drift is None else _pair(c.drift.ci),
    }


def _flat(group: Group) -> Mapping[str, Any]:
    return {k: plain(v) for k, v in group}
