"""What a verdict's JSON says, by the names by which it is judged."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from aqualog.model.effects import EFFECTS
from tests.blind.metrics.plan import TWINS
from tests.blind.metrics.rows import Said, key_of

__all__ = ["Answer", "Form", "exact_twins", "judged_by", "mechanism_of", "read_answer", "twins_of"]

_NUMBER = re.compile(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?")
_MECHANISMS = {"accel": "accelerometer", "tie": "tie_rod", "lateral": "lateral", "slip": "slip", "force": "force"}
_CHANNELS = {  # a residual channel may show either; an engine that gives the mechanism is judged by it
    "force_balance": ("force", "accelerometer"), "kinematic": ("accelerometer", "force"), "slip": ("slip",),
    "lateral": ("lateral",), "yaw": ("lateral",), "tie_rod": ("tie_rod",),
}  # fmt: skip
_COORDINATES = {
    "v": "v_x", "speed": "v_x", "velocity": "v_x", "time": "t", "s": "position", "way": "position", "distance": "position",
    "depth": "water_depth", "water": "water_depth", "acceleration": "a_x", "steering": "steer_angle", "traction": "torque",
    "time since braking": "since_braking",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Form:
    """A shape without a name: what it may act by, over which coordinates, and how probable it is (NaN: not said).

    `points`: (x, f) of its function over one coordinate, `f` in `unit`; `name`: the mechanism in the engine's words.
    """

    mechanisms: tuple[str, ...]
    depends_on: frozenset[str]
    probability: float = math.nan
    name: str = ""
    unit: str = ""
    points: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """`probability` belongs to `causes`, NaN where it is not said; `limits` by key; `told` is the chance to tell an effect
    from its nearest rival, by key, as forecast before the residual was seen."""

    verdict: str
    causes: tuple[Said, ...] = ()
    probability: tuple[float, ...] = ()
    alternatives: tuple[tuple[str, ...], ...] = ()
    forms: tuple[Form, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    told: Mapping[str, float] = field(default_factory=dict)
    p_value: float = math.nan
    gain: float = math.nan
    gain_low: float = math.nan
    worse: float = math.nan
    error: str = ""


def judged_by(effect: str, where: str | None) -> tuple[str, str | None]:
    """Name and place of an effect: a load is a load wherever it lies, a default place is spelled out."""
    if effect == "payload_mass":
        return effect, None
    return effect, where or (EFFECTS[effect].default if effect in EFFECTS else None)


def key_from(text: str) -> str:
    effect, _, where = text.partition("@")
    return key_of(*judged_by(effect, where or None))


def twins_of(effect: str) -> frozenset[str]:
    """Effects that a log may not tell from this one: by their rows in either direction, and by exact relations."""
    rows = {e.name for e in EFFECTS.values() if effect in e.twins}
    own = set(EFFECTS[effect].twins) if effect in EFFECTS else set()
    exact = {m for t in TWINS if effect in t.members for m in t.members}
    return frozenset((rows | own | exact) - {effect})


def exact_twins(effect: str) -> frozenset[str]:
    """Effects that no log tells from this one, one for one; in a relation of three none is the other by itself."""
    pairs = [t.members for t in TWINS if not t.can and len(t.members) == 2]
    return frozenset(m for p in pairs if effect in p for m in p) - {effect}


def mechanism_of(text: str) -> str:
    """`force`, `accelerometer`, `slip`, `lateral`, `tie_rod`, or the text itself: however an engine spells it."""
    return next((m for part, m in _MECHANISMS.items() if part in text.lower()), text)


def coordinates_of(names: object) -> frozenset[str]:
    given = names if isinstance(names, list | tuple) else [str(names)]
    return frozenset(_COORDINATES.get(str(n), str(n)) for n in given)


def read_answer(document: Mapping[str, Any]) -> Answer:
    """The answer of a JSON document of `aqualog diagnose`; keys that an older one lacks are not needed."""
    causes, chances = [], []
    for c in document.get("causes") or ():
        values = {n: (_finite(p["value"]), *map(_finite, p["ci95"])) for n, p in (c["parameters"] or {}).items()}
        causes.append(Said(*judged_by(c["effect"], c["where"]), values))
        chances.append(_finite(c.get("probability")))
    gain = document.get("gain") or {}
    changes = [c.get("rmse_change") for c in (gain.get("channel") or {}).values()]
    known = [x for x in changes if x is not None] if gain.get("heldout") else []
    return Answer(
        verdict=document["verdict"],
        causes=tuple(causes),
        probability=tuple(chances),
        alternatives=tuple(tuple(key_from(k) for k in a) for a in document.get("alternatives") or ()),
        forms=tuple(_form(u) for u in document.get("unexplained") or ()),
        limits=_limits(document),
        told=_told(document.get("isolability_pairs") or {}),
        p_value=_finite((document.get("significance") or {}).get("p_value")),
        gain=_finite(gain.get("heldout_log_score_gain")),
        gain_low=_finite((gain.get("ci95") or [None])[0]),
        worse=max(known, default=math.nan),
        error=document.get("error", ""),
    )


def _form(row: Mapping[str, Any]) -> Form:
    if row.get("mechanism"):
        by: tuple[str, ...] = (mechanism_of(str(row["mechanism"])),)
    else:
        channel = str(row.get("channel", ""))
        by = next((m for name, m in _CHANNELS.items() if channel.startswith(name)), (mechanism_of(channel),))
    pairs = zip(row.get("x") or (), row.get("f") or (), strict=True)
    points = tuple((x[0], f) for x, f in pairs if len(x) == 1 and None not in (x[0], f))
    return Form(
        by, coordinates_of(row.get("depends_on") or []), _finite(row.get("probability")), str(row.get("mechanism")),
        str(row.get("unit")), points,
    )  # fmt: skip


def _limits(document: Mapping[str, Any]) -> dict[str, float]:
    rows = {x["key"]: x["size"] for x in document.get("limits") or ()}
    if not rows:  # the fixed page has them as text
        texts = {k: _NUMBER.match(str(t)) for k, t in (document.get("detection_limits") or {}).items() if t}
        rows = {k: float(m[0]) for k, m in texts.items() if m}
    return {key_from(k): float(x) for k, x in rows.items() if x is not None and math.isfinite(x)}


def _told(pairs: Mapping[str, Any]) -> dict[str, float]:
    rows = zip(pairs.get("effects") or (), pairs.get("p_correct") or (), strict=True)
    least = {key_from(k): min((p for p in row if p is not None), default=math.nan) for k, row in rows}
    return {k: p for k, p in least.items() if math.isfinite(p)}


def _finite(x: object) -> float:
    return float(x) if isinstance(x, int | float) else math.nan
