"""The numbers of each configuration that an engineer asks for first, and the lines that open the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from aqualog.campaign.bins import Group
from aqualog.campaign.full_speed import EVENTS, FullSpeed
from aqualog.campaign.results import CampaignData
from aqualog.core.judgement import VERDICTS
from aqualog.report.campaign.findings import Curve, Findings, crossing
from aqualog.report.campaign.labels import group_text
from aqualog.report.campaign.run_page import RunFacts
from aqualog.report.drive.judged import missing_words
from aqualog.report.values import KMH, counted, number, place

__all__ = [
    "RESISTANCE_LEVEL", "WAYS", "Answer", "Number", "answers_of", "headline", "off_water", "summaries", "verdicts",
]  # fmt: skip

RESISTANCE_LEVEL = 0.2  # [m/s^2] resistance from which a driver feels it, after the thesis (C46)
HALF = 0.5  # of the dry slip slope
WAYS = ("slip_slope", "minor_spin_down", "spin_down", "margin")
_WAY_NAMES = ("from the slip slope", "from the minor spin-downs", "from the spin-downs", "foretold")


class Number(NamedTuple):
    """A speed [km/h] with its 95 % interval and its wheel or side; without a value NaN, and `why` gives the reason."""

    v: float
    low: float
    high: float
    place: str
    why: str


NOTHING = Number(math.nan, math.nan, math.nan, "", "no values")


class Answer(NamedTuple):
    """Speeds of one configuration: full aquaplaning by each method, resistance above its level, half of the dry slip
    slope lost. Where several wheels have a value, the lowest speed counts.
    """

    group: Group
    full: tuple[Number, ...]
    resistance: Number
    half: Number


def answers_of(findings: Findings) -> tuple[Answer, ...]:
    """The speeds of all configurations that have values on water."""
    made = []
    for group in findings.groups:
        slopes, resistance = ([c for c in x if c.group == group] for x in (findings.slopes, findings.resistance))
        full = [f for f in findings.full if f.group == group]
        if slopes or resistance or full:
            made.append(Answer(
                group,
                tuple(_lowest([_full(f) for f in full if f.way == way]) for way in WAYS),
                _lowest([_crossed(c, RESISTANCE_LEVEL, rising=True) for c in resistance]),
                _lowest([_crossed(c, HALF * c.dry, rising=False) for c in slopes if c.told]),
            ))  # fmt: skip
    return tuple(made)


def _full(f: FullSpeed) -> Number:
    return Number(KMH * f.v, KMH * f.ci[0], KMH * f.ci[1], f.place, f.reason or f.rests_on)


def _crossed(curve: Curve, level: float, *, rising: bool) -> Number:
    if not math.isfinite(level):
        return Number(math.nan, math.nan, math.nan, curve.place, "no dry level")
    found = crossing(curve, level, rising=rising)
    if found is None:
        return Number(math.nan, math.nan, math.nan, curve.place, "fewer than two bins with an interval")
    slowest = next(p.v_kmh for p in curve.points if p.reliable)
    if found.v_kmh == slowest:  # a bound, and no speed
        return Number(
            math.nan, -math.inf, slowest, curve.place, f"already reached in the slowest bin, {slowest:.0f} km/h"
        )
    why = "" if math.isfinite(found.v_kmh) else f"not reached up to {found.to_kmh:.0f} km/h"
    return Number(found.v_kmh, *found.ci, curve.place, why)


def _lowest(found: Sequence[Number]) -> Number:
    told = [n for n in found if math.isfinite(n.v)]
    below = [n for n in found if math.isnan(n.v) and math.isfinite(n.high)]
    if below:
        return min(below, key=lambda n: n.high)
    if told:
        return min(told, key=lambda n: n.v)
    # of speeds that are only bounded below, the lowest bound holds for the car
    return min(found, key=lambda n: n.low if math.isfinite(n.low) else math.inf) if found else NOTHING


def headline(data: CampaignData, findings: Findings) -> str:
    """Runs, logs, failures, configurations."""
    logs = len({r.run.logs for r in data.runs})
    failed = sum(not r.is_done for r in data.runs)
    bad = f"{failed} without results" if failed else "all with results"
    groups = counted(len(findings.groups), "configuration")
    return f"{counted(len(data.runs), 'run')} of {counted(logs, 'log')}, {bad}, {groups}"


def verdicts(data: CampaignData) -> list[str]:
    """How many runs aquaplaned, how many did not, how many cannot be judged, and how many are doubtful."""
    doubtful = [r for r in data.done if r.checks and r.judgement.verdict != "cannot_be_judged"]
    of = {v: [r for r in data.done if r.judgement.verdict == v] for v in VERDICTS}
    wet, dry, blind = of["aquaplaning"], of["none"], of["cannot_be_judged"]
    lacks = sorted({missing_words(r.judgement.missing) for r in blind})
    episodes = counted(sum(len(r.judgement.of("aquaplaning")) for r in wet), "episode")
    told = [
        (wet, f"Aquaplaning in {counted(len(wet), 'run')}: {episodes}"),
        (dry, f"No aquaplaning in {counted(len(dry), 'run')}"),
        (blind, f"Aquaplaning cannot be judged in {counted(len(blind), 'run')}: {'; or '.join(lacks[:3])}"),
        (doubtful, f"Doubtful, check the inputs first: {counted(len(doubtful), 'run')}"),
    ]
    return [words for runs, words in told if runs]


class Summary(NamedTuple):
    """One line of the page's head: lowest and highest value as (speed, interval, configuration), and their number."""

    what: str
    lowest: tuple[str, str, str]
    highest: tuple[str, str, str]
    told: str


def summaries(answers: Sequence[Answer]) -> list[Summary]:
    """Lowest and highest speed over all configurations, by kind; a kind without any value shows dashes."""
    kinds = [
        *((f"Full aquaplaning, {name}: {EVENTS[way][0]}", [(a, a.full[i]) for a in answers])
          for i, (way, name) in enumerate(zip(WAYS, _WAY_NAMES, strict=True))),
        (f"Resistance reaches {RESISTANCE_LEVEL:g} m/s²", [(a, a.resistance) for a in answers]),
        ("Half of the dry slip slope lost", [(a, a.half) for a in answers]),
    ]  # fmt: skip
    made = []
    for what, found in kinds:
        told = sorted((n.v, i) for i, (_, n) in enumerate(found) if math.isfinite(n.v))
        nothing = ("–", "", "")
        lowest = _one(*found[told[0][1]]) if told else nothing
        highest = _one(*found[told[-1][1]]) if len(told) > 1 else nothing
        made += [Summary(what, lowest, highest, f"{len(told)} of {len(found)}")] if found else []
    return made


def _one(answer: Answer, n: Number) -> tuple[str, str, str]:
    free = "free wheels" if n.place == "free" else place(n.place if len(n.place) == 2 else None, n.place)
    return f"{number(n.v, 0)} km/h", interval_text(n), " · ".join(x for x in (group_text(answer.group), free) if x)


def interval_text(n: Number) -> str:
    """`95 % 93 … 101`, `95 % 93 and up`; `interval open` where both ends are open."""
    low, high = (number(x, 0) if math.isfinite(x) else "" for x in (n.low, n.high))
    if low and high:
        return f"95 % {low} … {high}"
    return f"95 % {low} and up" if low else f"95 % up to {high}" if high else "interval open"


def off_water(facts: Sequence[RunFacts | None]) -> str:
    """Events off the water and the distance driven there; empty where no lane is known."""
    known = [f for f in facts if f is not None and math.isfinite(f.dry_km)]
    way = sum(f.dry_km for f in known)
    count = sum(e.off for f in known for e in f.events)
    return f"{counted(count, 'event')} off the water in {number(way, 1)} km" if way > 0.0 else ""
