"""What one blind case gave: what was hidden, what the engine said. The metrics are made from these rows alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

__all__ = ["Fact", "Row", "Said", "Second", "row_from", "row_text"]


def key_of(effect: str, where: str | None) -> str:
    """`tyre_radius@fl`, or the bare name for the whole car."""
    return effect if where is None else f"{effect}@{where}"


@dataclass(frozen=True, slots=True)
class Fact:
    """A hidden effect. `z`: whitened size of its trace in the log; `p_right`: forecast chance to tell it from its rivals.

    `known`: a library has it. NaN where a figure was not asked for.
    """

    effect: str
    where: str | None
    values: Mapping[str, float]
    z: float = float("nan")
    p_right: float = float("nan")
    known: bool = True

    @property
    def key(self) -> str:
        return key_of(self.effect, self.where)


@dataclass(frozen=True, slots=True)
class Said:
    """A cause as the engine gave it; parameter -> (value, low, high)."""

    effect: str
    where: str | None
    values: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def key(self) -> str:
        return key_of(self.effect, self.where)


@dataclass(frozen=True, slots=True)
class Second:
    """After the recommended manoeuvre: its name, whether any run of the catalogue can tell, and what came out."""

    name: str
    possible: bool
    verdict: str
    causes: tuple[Said, ...] = ()
    advantage: float = float("nan")  # separation over that of the catalogue's median run


@dataclass(frozen=True, slots=True)
class Row:
    """One diagnosed case. `group` is the part of the plan that it belongs to.

    `alternatives`: keys of each alternative set; `pairs`: (forecast, right) of each test of one effect against another;
    `gain`, `oracle`: log score won on the held-out drive by the extended model and by the truth; `worse`: relative change
    of the worst channel's error there; `detector`: false alarms and finds before, after, and with the truth.
    """

    key: str
    group: str
    programme: str
    noise: str
    seed: int
    truth: tuple[Fact, ...] = ()
    verdict: str = ""
    causes: tuple[Said, ...] = ()
    alternatives: tuple[tuple[str, ...], ...] = ()
    p_value: float = float("nan")
    limits: Mapping[str, float] = field(default_factory=dict)
    separation: float = float(
        "nan"
    )  # of the hidden set from its twins, or of two hidden effects from each other (share)
    pairs: tuple[tuple[float, bool], ...] = ()
    gain: float = float("nan")
    oracle: float = float("nan")
    worse: float = float("nan")
    members: tuple[str, ...] = ()  # all that a set which cannot be separated has to list
    second: Second | None = None
    detector: Mapping[str, float] = field(default_factory=dict)
    seconds: float = float("nan")  # of the wall clock, beside whatever else runs
    cpu_seconds: float = float("nan")  # of all threads together
    peak_mb: float = float("nan")
    error: str = ""

    @property
    def found(self) -> bool:
        """Something was said to be there."""
        return self.verdict not in ("no_effect", "not_testable", "")

    @property
    def names(self) -> tuple[str, ...]:
        """What the verdict names without reserve."""
        return tuple(c.key for c in self.causes) if self.verdict in ("named", "compound") else ()

    @property
    def single(self) -> bool:
        """One name without reserve."""
        return self.verdict == "named"

    @property
    def hidden(self) -> tuple[str, ...]:
        return tuple(f.key for f in self.truth)

    @property
    def wrong(self) -> bool:
        """Names without reserve something that is not there."""
        return any(n not in self.hidden for n in self.names)

    @property
    def listed(self) -> set[str]:
        """All that the verdict allows: its causes and the members of the alternatives."""
        return {c.key for c in self.causes} | {k for a in self.alternatives for k in a}


def row_text(row: Row) -> str:
    """One line of JSON."""
    return json.dumps(asdict(row), separators=(",", ":"))


def row_from(text: str) -> Row:
    """The row of a line that `row_text` made."""
    d: dict[str, Any] = json.loads(text)
    d["truth"] = tuple(Fact(**f) for f in d["truth"])
    d["causes"] = tuple(_said(c) for c in d["causes"])
    d["alternatives"] = tuple(tuple(a) for a in d["alternatives"])
    d["pairs"] = tuple((float(p), bool(r)) for p, r in d["pairs"])
    d["members"] = tuple(d["members"])
    if d["second"] is not None:
        d["second"]["causes"] = tuple(_said(c) for c in d["second"]["causes"])
        d["second"] = Second(**d["second"])
    return Row(**d)


def _said(d: dict[str, Any]) -> Said:
    return Said(d["effect"], d["where"], {k: tuple(v) for k, v in d["values"].items()})
