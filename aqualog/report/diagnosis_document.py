"""A diagnosis as the JSON document of the contract, and as terminal text made from that document alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from aqualog.diagnose.records import (
    Agreement,
    Alternative,
    Cause,
    ChannelGain,
    Confusion,
    Consequence,
    Diagnosis,
    Gain,
    Limit,
    Manoeuvre,
    Remainder,
    Significance,
)
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model
from aqualog.report.diagnosis_numbers import interval_text, ordinary, quantity_text, unit_text
from aqualog.report.diagnosis_words import effect_title, limit_sentences, sentences
from aqualog.report.text import table

__all__ = ["SCHEMA_VERSION", "diagnosis_document", "diagnosis_text"]

SCHEMA_VERSION = 1
CRITERIA = {"interval": 0.95, "power": 0.9, "told_apart": 0.95}
"""Level of all intervals; power at the detection limits; P(right name) from which two causes are distinguished."""
_MOST_LIMITS, _MOST_CONFUSED, _MOST_CHANNELS = 6, 5, 3  # in the terminal
_CAUSE_HEADER = ("effect", "parameter", "value", "interval (95 %)", "unit")


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
    d = diagnosis
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": tool_version,
        "vehicle": vehicle,
        "logs": list(logs),
        "drives": list(d.drives),
        "duration_s": _number(d.duration_s),
        "used_s": _number(d.used_s),
        "verdict": d.verdict,
        "sentence": d.sentence,
        "causes": [_cause(c) for c in d.causes],
        "alternatives": [[c.key for c in a.causes] for a in d.alternatives],
        "alternative_sets": [_alternative(a) for a in d.alternatives],
        "agreement": [_agreement(a) for a in d.agreement],
        "unexplained": [_remainder(r) for r in d.remainders],
        "gain": _gain(d.gain) if d.gain is not None else None,
        "false_alarm_level": _number(d.significance.level) if d.significance is not None else None,
        "significance": _significance(d.significance) if d.significance is not None else None,
        "detection_limits": {_key(x.effect, x.where): quantity_text(x.size, x.unit) or None for x in d.limits},
        "limits": [_limit(x) for x in d.limits],
        "isolability": [_confusion(c) for c in d.confusions if _is_confused(c)],
        "isolability_pairs": _pairs(d.confusions),
        "next_manoeuvre": _manoeuvre(d.manoeuvre) if d.manoeuvre is not None else None,
        "extended_model": extended_model,
        "model": _model(d.model),
        "channels": list(d.channels),
        "channel_units": _units(d),
        "untested": dict(d.untested),
        "criteria": dict(CRITERIA),
        "notes": [*notes, *d.notes],
    }


def diagnosis_text(document: Mapping[str, Any]) -> str:
    """Terminal text: the verdict first, then its basis in a few lines."""
    said = sentences(document)
    lines = [said["headline"][0]]
    if document["causes"]:
        lines += ["", table(_CAUSE_HEADER, _cause_rows(document))]
    lines += _block("other explanations that fit as well", said["alternatives"])
    lines += _block("drive by drive", said["agreement"])
    lines += _block("not explained", said["unexplained"])
    same = _first(said["causes_relations"] + said["causes_confused"], _MOST_CONFUSED)
    lines += _block("this log cannot distinguish", same)
    lines += _block("gain", said["score"] + _first(said["channels"], _MOST_CHANNELS) + said["consequences"])
    lines += _block("next drive", said["manoeuvre"])
    is_result = document["verdict"] == "no_effect"  # then the limits are the result
    limits = _first(limit_sentences(document), 24 if is_result else _MOST_LIMITS)
    lines += _block("smallest effects that would have been detected", limits)
    lines += _block("test", said["test"])
    return ordinary("\n".join(lines)) + "\n"


def _first(lines: Sequence[str], most: int) -> list[str]:
    return [*lines[:most], "more: --json or --page"] if len(lines) > most else list(lines)


def _block(title: str, lines: Sequence[str]) -> list[str]:
    return ["", title, *(f"  {x}" for x in lines)] if lines else []


def _cause_rows(document: Mapping[str, Any]) -> list[tuple[str, ...]]:
    return [
        (effect_title(c["key"]) if i == 0 else "", name.replace("_", " "), *interval_text(p), unit_text(p["unit"]))
        for c in document["causes"]
        for i, (name, p) in enumerate(c["parameters"].items())
    ]


def _cause(c: Cause) -> dict[str, Any]:
    return {
        "effect": c.effect,
        "where": c.where,
        "key": c.key,
        "parameters": {
            name: {"value": _number(e.value), "ci95": [_number(e.low), _number(e.high)], "unit": e.unit}
            for name, e in c.parameters.items()
        },
        "explains": list(c.explains),
        "sentence": c.sentence,
    }


def _alternative(a: Alternative) -> dict[str, Any]:
    return {"causes": [_cause(c) for c in a.causes], "evidence_ratio": _number(a.evidence_ratio)}


def _agreement(a: Agreement) -> dict[str, Any]:
    return {
        "key": a.key,
        "parameter": a.parameter,
        "p_value": _number(a.p_value),
        "holds": a.holds,
        "drives": [
            {
                "drive": d.drive,
                "value": _number(d.alone.value),
                "ci95": [_number(d.alone.low), _number(d.alone.high)],
                "unit": d.alone.unit,
                "from_others": _number(d.others),
                "log_score_gain": _number(d.gain),
            }
            for d in a.drives
        ],
    }


def _remainder(r: Remainder) -> dict[str, Any]:
    x = np.asarray(r.x, dtype=np.float64).reshape(len(r.f), -1)
    return {
        "channel": r.channel,
        "depends_on": list(r.depends_on),
        "share": _number(r.share),
        "p_value": _number(r.p_value),
        "x": [[_number(v) for v in row] for row in x.tolist()],
        "f": _numbers(r.f),
        "low": _numbers(r.low),
        "high": _numbers(r.high),
        "proxies": list(r.proxies),
        "nearest": r.nearest,
        "cosine": _number(r.cosine),
        "sentence": r.sentence,
    }


def _gain(g: Gain) -> dict[str, Any]:
    score, interval = _number(g.log_score), [_number(g.low), _number(g.high)]
    nothing = [None, None]
    return {
        "channel": {c.channel: _channel(c) for c in g.channels},
        "heldout_log_score_gain": None if g.in_sample else score,
        "ci95": nothing if g.in_sample else interval,
        "in_sample_log_score_gain": score if g.in_sample else None,
        "in_sample_ci95": interval if g.in_sample else nothing,
        "unit": "nats",
        "heldout": list(g.heldout),
        "in_sample": g.in_sample,
        "consequences": [_consequence(c) for c in g.consequences],
        "notes": list(g.notes),
    }


def _channel(c: ChannelGain) -> dict[str, Any]:
    return {
        "unit": c.unit,
        "rmse_before": _number(c.rmse_before),
        "rmse_after": _number(c.rmse_after),
        "rmse_change": _change(c.rmse_before, c.rmse_after),
        "free_before": _number(c.free_before),
        "free_after": _number(c.free_after),
        "free_change": _change(c.free_before, c.free_after),
    }


def _consequence(c: Consequence) -> dict[str, Any]:
    per_100km = 100.0 / c.distance_km if c.distance_km > 0.0 else math.nan
    return {
        "detector": c.detector,
        "false_alarms_before": c.false_alarms_before,
        "false_alarms_after": c.false_alarms_after,
        "distance_km": _number(c.distance_km),
        "per_100km_before": _number(c.false_alarms_before * per_100km),
        "per_100km_after": _number(c.false_alarms_after * per_100km),
        "latency_before_s": _number(c.latency_before_s),
        "latency_after_s": _number(c.latency_after_s),
        "found_before": c.found_before,
        "found_after": c.found_after,
        "passes": c.passes,
    }


def _significance(s: Significance) -> dict[str, Any]:
    return {
        "statistic": _number(s.statistic),
        "threshold": _number(s.threshold),
        "p_value": _number(s.p_value),
        "level": _number(s.level),
        "achieved_level": _number(s.achieved),
        "surrogates": s.surrogates,
    }


def _limit(x: Limit) -> dict[str, Any]:
    effect = EFFECTS.get(x.effect)
    # the limit and the smallest size worth naming refer to the first parameter
    smallest = x.smallest
    if math.isnan(smallest) and effect is not None and effect.parameters:
        smallest = effect.parameters[0].smallest
    return {
        "key": _key(x.effect, x.where),
        "effect": x.effect,
        "where": x.where,
        "size": _number(x.size),
        "unit": x.unit,
        "smallest_worth_naming": _number(smallest),
        "ratio": _number(x.size / smallest),
    }


def _confusion(c: Confusion) -> dict[str, Any]:
    return {
        "effect": c.effect,
        "rivals": list(c.rivals),
        "separation": _number(c.separation),
        "p_correct": _number(c.p_correct),
        "relation": c.relation,
        "sizes": [_number(x) for x in c.sizes],
    }


def _units(d: Diagnosis) -> dict[str, str]:
    """Units of the channels, as far as they are known."""
    gained = {c.channel: c.unit for c in d.gain.channels} if d.gain is not None else {}
    return gained | {v.channel: v.unit for v in d.views}


def _is_confused(c: Confusion) -> bool:
    """Whether a sentence reports it; a log distinguishes thousands of other sets."""
    return bool(c.relation) or not c.p_correct >= CRITERIA["told_apart"]


def _pairs(confusions: Sequence[Confusion]) -> dict[str, Any]:
    """P(right name) of every effect (rows) against every single rival (columns); null on the diagonal."""
    pairs = {(c.effect, c.rivals[0]): c.p_correct for c in confusions if len(c.rivals) == 1}
    keys = sorted({k for pair in pairs for k in pair})
    told = {pair: float(f"{p:.4g}") for pair, p in pairs.items() if math.isfinite(p)}
    return {"effects": keys, "p_correct": [[told.get((a, b), told.get((b, a))) for b in keys] for a in keys]}


def _manoeuvre(m: Manoeuvre) -> dict[str, Any]:
    return {
        "name": m.name,
        "separates": [list(pair) for pair in m.separates],
        "sentence": m.sentence,
        "separation_now": _number(m.separation_now),
        "separation_then": _number(m.separation_then),
        "p_correct_now": _p_correct(m.separation_now),
        "p_correct_then": _p_correct(m.separation_then),
        "minutes": _number(m.minutes),
    }


def _model(model: Model) -> list[dict[str, Any]]:
    return [
        {
            "effect": t.effect.name,
            "where": t.where,
            "parameters": {n: _number(v) for n, v in t.values.items()},
            **({"knots": [[_number(x) for x in knot] for knot in t.knots]} if t.knots else {}),
        }
        for t in model.terms
    ]


def _p_correct(separation: float) -> float | None:
    """P(right name) = Phi(sqrt(lambda) / 2) of two causes at the distance lambda."""
    if not math.isfinite(separation) or separation < 0.0:
        return None
    return _number(NormalDist().cdf(0.5 * math.sqrt(separation)))


def _change(before: float, after: float) -> float | None:
    """Relative change, negative where the error falls."""
    return _number(after / before - 1.0) if before > 0.0 else None


def _key(effect: str, where: str | None) -> str:
    return effect if where is None else f"{effect}@{where}"


def _numbers(values: Any) -> list[float | None]:
    return [_number(v) for v in np.asarray(values, dtype=np.float64).tolist()]


def _number(x: float | None) -> float | None:
    return float(f"{x:.9g}") if x is not None and math.isfinite(x) else None
