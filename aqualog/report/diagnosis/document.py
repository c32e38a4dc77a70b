"""A diagnosis as the JSON document of the contract."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from aqualog.diagnose.records import Cause, Confusion, Consequence, Diagnosis, Estimate, Gain, Limit, Remainder
from aqualog.diagnose.shapes import MECHANISMS
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Term
from aqualog.report.values import fields_of, plain, quantity_text

__all__ = ["diagnosis_document"]

CRITERIA = {"interval": 0.95, "power": 0.9, "told_apart": 0.95}
"""Level of all intervals; power at the detection limits; P(right name) from which two causes are distinguished."""


def diagnosis_document(
    diagnosis: Diagnosis,
    *,
    logs: Sequence[str],
    tool_version: str,
    extended_model: str | None,
    notes: Sequence[str],
    vehicle: str = "",
) -> dict[str, Any]:
    """The JSON document; NaN and infinities become null, floats keep 9 significant digits.

    Parameters
    ----------
    diagnosis : Diagnosis
    logs : sequence of str
        Files as they were named.
    tool_version : str
    extended_model : str, optional
        File of the extended model; None if it was not written.
    notes : sequence of str
        On the files, beside those of the diagnosis.
    vehicle : str
        Name of the vehicle file's car.
    """
    d, test, m = diagnosis, diagnosis.significance, diagnosis.manoeuvre
    gained = {c.channel: c.unit for c in d.gain.channels} if d.gain is not None else {}
    units = gained | {v.channel: v.unit for v in d.views}
    return {
        "schema_version": 1,
        "tool_version": tool_version,
        "vehicle": vehicle,
        "logs": list(logs),
        **fields_of(d, "drives", "duration_s", "used_s", "verdict", "sentence"),
        "causes": [_cause(c) for c in d.causes],
        "alternatives": [[c.key for c in a.causes] for a in d.alternatives],
        "alternative_sets": [
            {"causes": [_cause(c) for c in a.causes], "evidence_ratio": plain(a.evidence_ratio)} for a in d.alternatives
        ],
        "agreement": [
            {**fields_of(a, "key", "parameter", "p_value", "holds"), "drives": [
                {"drive": x.drive, **_estimate(x.alone), **fields_of(x, from_others="others", log_score_gain="gain")}
                for x in a.drives
            ]} for a in d.agreement
        ],
        "unexplained": [_remainder(r) for r in d.remainders],
        "gain": _gain(d.gain) if d.gain is not None else None,
        "false_alarm_level": None if test is None else plain(test.level),
        "significance": None if test is None else fields_of(
            test, "statistic", "threshold", "p_value", "level", achieved_level="achieved", surrogates="surrogates"
        ),
        "detection_limits": {_key(x.effect, x.where): quantity_text(x.size, x.unit) or None for x in d.limits},
        "limits": [_limit(x) for x in d.limits],
        "isolability": [
            fields_of(c, "effect", "rivals", "separation", "p_correct", "relation", "sizes")
            # those that a sentence reports; a log distinguishes thousands of other sets
            for c in d.confusions if c.relation or not c.p_correct >= CRITERIA["told_apart"]
        ],
        "isolability_pairs": _pairs(d.confusions),
        "next_manoeuvre": None if m is None else {
            **fields_of(m, "name", "separates", "sentence", "separation_now", "separation_then"),
            "p_correct_now": _p_correct(m.separation_now) if math.isnan(m.before) else plain(m.before),
            "p_correct_then": _p_correct(m.separation_then) if math.isnan(m.after) else plain(m.after),
            "minutes": plain(m.minutes),
        },
        "extended_model": extended_model,
        "model": [_term(t) for t in d.model.terms],
        "deviations": [_term(t) for t in d.deviations],
        "channels": list(d.channels),
        "channel_units": units,
        "untested": dict(d.untested),
        "criteria": dict(CRITERIA),
        "caution": d.caution or None,
        "notes": [*([d.caution] if d.caution else []), *notes, *d.notes],
    }  # fmt: skip


def _estimate(e: Estimate) -> dict[str, Any]:
    return {"value": plain(e.value), "ci95": plain([e.low, e.high]), "unit": e.unit}


def _cause(c: Cause) -> dict[str, Any]:
    return {
        **fields_of(c, "effect", "where", "key"),
        "parameters": {name: _estimate(e) for name, e in c.parameters.items()},
        **fields_of(c, "explains", "sentence", "probability"),
        "drives": list(c.drives),
    }


def _remainder(r: Remainder) -> dict[str, Any]:
    x = np.asarray(r.x, dtype=np.float64).reshape(len(r.f), -1)
    # an error of a gain that goes with the speed goes with what is measured, too
    scaled = [m.scales for m in MECHANISMS if m.name == r.mechanism and m.scales]
    return {
        **fields_of(r, "channel", "mechanism", "unit"),
        "depends_on": list(dict.fromkeys([*r.depends_on, *scaled])),
        **fields_of(r, "share", "p_value", "probability"),
        "x": plain(x),
        **{name: plain(np.asarray(getattr(r, name), dtype=np.float64)) for name in ("f", "low", "high")},
        **fields_of(r, "proxies", "nearest", "cosine", "sentence", similar_to="nearest"),
    }


def _term(t: Term) -> dict[str, Any]:
    knots = {"knots": plain(t.knots)} if t.knots else {}
    return {"effect": t.effect.name, "where": t.where, "parameters": plain(t.values), **knots}


def _gain(g: Gain) -> dict[str, Any]:
    score, interval, nothing = plain(g.log_score), plain([g.low, g.high]), [None, None]
    return {
        "channel": {
            c.channel: {
                **fields_of(c, "unit", "rmse_before", "rmse_after"),
                "rmse_change": _change(c.rmse_before, c.rmse_after),
                **fields_of(c, "free_before", "free_after"),
                "free_change": _change(c.free_before, c.free_after),
            }
            for c in g.channels
        },
        "heldout_log_score_gain": None if g.in_sample else score,
        "ci95": nothing if g.in_sample else interval,
        "promised_log_score_gain": plain(g.promised),
        "in_sample_log_score_gain": score if g.in_sample else None,
        "in_sample_ci95": interval if g.in_sample else nothing,
        "unit": "nats",
        **fields_of(g, "heldout", "in_sample"),
        "consequences": [_consequence(c) for c in g.consequences],
        "notes": list(g.notes),
    }


def _change(before: float, after: float) -> float | None:
    """Relative change, negative where the error falls."""
    change: float | None = plain(after / before - 1.0) if before > 0.0 else None
    return change


def _consequence(c: Consequence) -> dict[str, Any]:
    per_100km = 100.0 / c.distance_km if c.distance_km > 0.0 else math.nan
    return {
        **fields_of(c, "detector", "false_alarms_before", "false_alarms_after", "distance_km"),
        "per_100km_before": plain(c.false_alarms_before * per_100km),
        "per_100km_after": plain(c.false_alarms_after * per_100km),
        **fields_of(c, "latency_before_s", "latency_after_s", "found_before", "found_after", "passes"),
    }


def _limit(x: Limit) -> dict[str, Any]:
    effect = EFFECTS.get(x.effect)
    # the limit and the smallest size worth naming refer to the first parameter
    smallest = x.smallest
    if math.isnan(smallest) and effect is not None and effect.parameters:
        smallest = effect.parameters[0].smallest
    return {
        "key": _key(x.effect, x.where),
        **fields_of(x, "effect", "where", "size", "unit"),
        "smallest_worth_naming": plain(smallest),
        "ratio": plain(x.size / smallest),
    }


def _pairs(confusions: Sequence[Confusion]) -> dict[str, Any]:
    """P(right name) of every effect (rows) against every single rival (columns); null on the diagonal."""
    pairs = {(c.effect, c.rivals[0]): c.p_correct for c in confusions if len(c.rivals) == 1}
    keys = sorted({k for pair in pairs for k in pair})
    known = {pair: float(f"{p:.4g}") for pair, p in pairs.items() if math.isfinite(p)}
    return {"effects": keys, "p_correct": [[known.get((a, b), known.get((b, a))) for b in keys] for a in keys]}


def _p_correct(separation: float) -> float | None:
    """P(right name) = Phi(sqrt(lambda) / 2) of two causes at the distance lambda."""
    if not math.isfinite(separation) or separation < 0.0:
        return None
    return float(f"{NormalDist().cdf(0.5 * math.sqrt(separation)):.9g}")


def _key(effect: str, where: str | None) -> str:
    return effect if where is None else f"{effect}@{where}"
