"""What to do next: the run, check or sensor with the most expected information on which cause is the right one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.manoeuvres import SENSORS, Run, Sensor, checks, fitting
from aqualog.diagnose.noise import Noise
from aqualog.diagnose.records import SURE, Manoeuvre
from aqualog.diagnose.run_information import Case, Forecast, Rival, entropy, forecast, of_check, of_log, of_run
from aqualog.diagnose.threads import beside
from aqualog.diagnose.words import name_of
from aqualog.model.term import Check, Model

__all__ = ["next_manoeuvre"]

TIMES = (1, 2, 3)  # that a run is driven
OFTEN = {1: "", 2: ", twice", 3: ", three times"}
AGAIN = 1.0  # [min] for each further time
LEAST = 0.1  # share of the missing information below which nothing is recommended
CONFIRMED = 2  # runs that are judged with all tolerances
MENTIONED = 3  # pairs in a sentence


@dataclass(frozen=True, slots=True)
class _Option:
    """A run or check, so many times, perhaps with a further sensor, and what it would give."""

    what: Run | Check
    times: int
    gives: Forecast
    sensor: Sensor | None = None

    @property
    def minutes(self) -> float:
        return self.what.minutes + (self.times - 1) * AGAIN

    @property
    def rank(self) -> tuple[bool, float]:
        """Options that reach the wanted certainty first, by information per minute; the others by information."""
        sure = self.gives.right >= SURE
        return sure, self.gives.information / (self.minutes if sure else 1.0)


def next_manoeuvre(
    evidence: Evidence, rivals: Sequence[Rival], noises: Sequence[Noise], model: Model
) -> Manoeuvre | None:
    """The run, check or sensor that distinguishes sets that the log cannot; None if no two differ in their effects.
    `rivals`: refitted sets on `model`, best first; `noises`: of each drive, after the best set. The `name` is that of
    the run or check with the most information per minute of those that reach a probability of 0.95, else with the most
    information. It is `sensor` if only a further signal would give a tenth of the missing information, and `none` if
    nothing does. `separates` has the pairs that it decides in 95 of 100 cases."""
    names = [frozenset(h.key for h in c.refit.members) for c in rivals]
    if len(set(names)) < 2:
        return None
    group = np.array([[float(n == m) for m in dict.fromkeys(names)] for n in names])
    asked = [(h, n) for h in evidence.asked for n in h.free]  # in the order of the evidence's columns
    whole = Case(
        evidence, tuple(rivals), tuple(noises), model,
        tuple((k, *asked[k], sd) for k, sd in enumerate(evidence.forgiven.tolist()) if sd > 0.0),
        max(range(len(evidence.drives)), key=lambda d: evidence.drives[d].used_s),
    )  # fmt: skip
    near = whole.near
    runs = fitting(near.effects, near.drive)
    p = np.array([c.probability for c in rivals])
    p = p / p.sum() @ group
    least = LEAST * float(entropy(p))
    options = _options(near, [*runs, *checks(near.effects)], group)
    best = _confirmed(whole, options, group)
    if best.gives.information < least:
        plain = [r for r in runs if r.water is None]
        extra = [s for s in SENSORS if not set(s.signals) <= near.drive.present]
        with_sensor = [o for s in extra for o in _options(near, plain, group, s, times=(1,))]
        top = max(with_sensor, key=lambda o: o.rank, default=best)
        best = top if top.gives.information >= least else best
    return _recommended(near, best, float(p.max()), enough=best.gives.information >= least)


def _options(
    case: Case, what: Sequence[Run | Check], group: FloatArray, sensor: Sensor | None = None,
    times: Sequence[int] = TIMES,
) -> list[_Option]:  # fmt: skip
    log = of_log(case)

    def one(w: Run | Check) -> list[_Option]:
        added = of_run(case, w, sensor) if isinstance(w, Run) else of_check(case, w)
        often = times if isinstance(w, Run) else (1,)
        return [_Option(w, n, forecast(case, log, added, n, group), sensor) for n in often]

    return list(chain.from_iterable(beside(one, what)))


def _confirmed(case: Case, options: Sequence[_Option], group: FloatArray) -> _Option:
    """The best option with all tolerances: a run that decides with a part of them may not with all."""
    found: list[_Option] = []
    rest = list(options)
    while rest and len(found) < CONFIRMED * len(TIMES):
        what = max(rest, key=lambda o: o.rank).what
        found += _options(case, [what], group)
        if max(found, key=lambda o: o.rank).gives.right >= SURE:
            break
        rest = [o for o in rest if o.what is not what]
    return max(found, key=lambda o: o.rank)


def _recommended(case: Case, o: _Option, before: float, *, enough: bool) -> Manoeuvre:
    after = o.gives.right
    members = [c.refit.members for c in case.rivals]
    pairs = [
        (i, j) for i, j in combinations(range(len(members)), 2)
        if {h.key for h in members[i]} != {h.key for h in members[j]}
    ]  # fmt: skip
    decided = [q for q in pairs if o.gives.pairs[q] >= SURE]
    rises = _rises(before, after)
    how = f"{o.what.how}{OFTEN[o.times]} ({o.minutes:.0f} min)"
    if not enough:
        text = f"No run, check or further sensor distinguishes: {_told(members, pairs)}."
        if _percent(after) != _percent(before):
            text += f" The best is {o.what.name.replace('_', ' ')}{OFTEN[o.times]}: {rises}."
        return Manoeuvre("none", (), text, np.nan, np.nan, 0.0, before, after)
    text = f"{how}: {rises}."
    if o.sensor is not None:
        text = f"With these signals no run helps. Add {o.sensor.name} to the log. {text}"
    rest = [q for q in pairs if q not in decided]
    if rest:
        text += f" It does not distinguish for certain: {_told(members, rest)}."
    keys = tuple(dict.fromkeys((_keys(a), _keys(b)) for a, b in (_apart(members, q) for q in decided)))
    name = o.what.name if o.sensor is None else "sensor"
    return Manoeuvre(name, keys, text, np.nan, np.nan, o.minutes, before, after)


def _rises(before: float, after: float) -> str:
    if _percent(after) == _percent(before):
        return f"less likely causes are ruled out; the right one is named with {_percent(after)}, as before"
    return f"the probability of naming the right cause rises from {_percent(before)} to {_percent(after)}"


def _percent(p: float) -> str:
    return "over 99 %" if p > 0.99 else f"{100.0 * p:.0f} %"


def _apart(members: Sequence[Sequence[Hypothesis]], pair: tuple[int, int]) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Members of each set of a pair that the other set does not hold."""
    a, b = members[pair[0]], members[pair[1]]
    return [h for h in a if h not in b], [h for h in b if h not in a]


def _keys(members: Sequence[Hypothesis]) -> str:
    return " + ".join(h.key for h in members)


def _told(members: Sequence[Sequence[Hypothesis]], pairs: Sequence[tuple[int, int]]) -> str:
    sides = [sorted(_apart(members, q), key=len, reverse=True) for q in pairs]
    words = list(dict.fromkeys(
        " from ".join(" with ".join(name_of(h.effect.name, h.where) for h in s) or "no effect" for s in both)
        for both in sides
    ))  # fmt: skip
    more = len(words) - MENTIONED
    return "; ".join(words if more <= 0 else [*words[:MENTIONED], f"{more} more"])
