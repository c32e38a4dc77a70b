"""Limits that an evaluation must keep, for a build server: `joint_cusum.recall>=0.9`."""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from aqualog.core.errors import ConfigError
from aqualog.detect.registry import DETECTORS, RIVALS
from aqualog.evaluate.score import HOUR_S, Recall, Score

__all__ = ["MEASURES", "Gate", "GateResult", "judge_gates", "parse_gates"]

_KINDS = ("full", "partial", "wheel_full", "wheel_partial", "own")
_OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip
_GATE = re.compile(r"\s*(?P<detector>[^\s.<>=]+)\.(?P<measure>[^\s<>=]+)\s*(?P<sign>>=|<=|>|<)\s*(?P<limit>\S+)\s*")


_OF_RECALL: Mapping[str, Callable[[Recall], float]] = {
    "recall": lambda r: r.share,
    "warned_before": lambda r: r.before_share,
    "latency_median_s": lambda r: r.latency(0.5),
    "latency_95_s": lambda r: r.latency(0.95),
    "episodes": lambda r: r.episodes,
    "found": lambda r: r.found,
}
_OF_SCORE: Mapping[str, Callable[[Score], float]] = {
    "false_alarms.count": lambda s: s.false_alarms.count,
    "false_alarms.hours": lambda s: s.false_alarms.seconds / HOUR_S,
    "false_alarms.per_hour": lambda s: s.false_alarms.per_hour,
    "false_alarms.per_100km": lambda s: s.false_alarms.per_100km,
    "on_water.count": lambda s: s.on_water.count,
    "on_water.per_hour": lambda s: s.on_water.per_hour,
    "drives": lambda s: s.runs,
    "unavailable": lambda s: s.unavailable,
}
MEASURES = (*_OF_RECALL, *(f"{kind}.{name}" for kind in _KINDS for name in _OF_RECALL), *_OF_SCORE)
"""What a gate can ask for, by the names of the document; without a kind, of partial aquaplaning."""


@dataclass(frozen=True, slots=True)
class Gate:
    """`detector.measure sign limit`, with the measure one of `MEASURES`; `text` as it was given."""

    text: str
    detector: str
    measure: str
    sign: str
    limit: float


@dataclass(frozen=True, slots=True)
class GateResult:
    """Whether a gate was kept. `value` is NaN where nothing was measured, which keeps no gate; `found` in words."""

    gate: Gate
    value: float
    is_kept: bool
    found: str


def parse_gates(texts: Sequence[str], *, with_rivals: bool = False, logged: Sequence[str] = ()) -> tuple[Gate, ...]:
    """Read gates; a rival can be named `with_rivals` only, or as one of those that are `logged`.

    Raises
    ------
    ConfigError
        With the nearest known name where one is wrong.
    """
    return tuple(_parsed(text, logged, with_rivals=with_rivals) for text in texts)


def _parsed(text: str, logged: Sequence[str], *, with_rivals: bool) -> Gate:
    where, example = f"--gate {text[:80]}", "such as joint_cusum.recall>=0.9"
    match = _GATE.fullmatch(text)
    if match is None:
        raise ConfigError("is no gate", where=where, expected=f"DETECTOR.MEASURE>=NUMBER, {example}")
    detector, measure = match["detector"], match["measure"]
    if detector in RIVALS and not with_rivals:
        raise ConfigError(f'"{detector}" is a rival', where=where, expected="--rivals beside it")
    _check_name("detector", detector, (*DETECTORS, *RIVALS, *logged), where)
    _check_name("measure", measure, MEASURES, where)
    try:
        limit = float(match["limit"])
    except ValueError:
        limit = math.nan
    if not math.isfinite(limit):
        raise ConfigError(f'"{match["limit"][:40]}" is no number', where=where, expected=f"a limit, {example}")
    return Gate(text.strip(), detector, measure, match["sign"], limit)


def _check_name(what: str, name: str, known: Sequence[str], where: str) -> None:
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
        hint = f'did you mean "{near[0]}"?' if near else f"known: {', '.join(known)}"
        raise ConfigError(f'"{name[:60]}" is no {what} ({hint})', where=where)


def judge_gates(gates: Sequence[Gate], scores: Mapping[str, Score]) -> tuple[GateResult, ...]:
    """Hold scores against gates. Where nothing was measured no gate is kept."""
    return tuple(_judged(gate, scores.get(gate.detector)) for gate in gates)


def _judged(gate: Gate, score: Score | None) -> GateResult:
    value, found = math.nan, "the detector could not run on any drive"
    if score is not None and score.runs:
        value = _value(score, gate.measure)
        shown = "never, too many were missed" if math.isinf(value) else f"{value:.6g}"
        found = f"{shown}, on {score.runs} drive{'s' if score.runs != 1 else ''}"
        if math.isnan(value):
            found = "nothing to measure it on: no such episode, or no time outside water"
    return GateResult(gate, value, _OPERATORS[gate.sign](value, gate.limit), found)


def _value(score: Score, measure: str) -> float:
    if measure in _OF_SCORE:
        return float(_OF_SCORE[measure](score))
    kind, _, name = measure.rpartition(".")
    return float(_OF_RECALL[name](getattr(score, kind or "partial")))
