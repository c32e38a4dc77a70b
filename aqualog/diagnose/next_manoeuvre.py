"""The run that would distinguish the remaining causes: each is simulated, and its information added to the log's.

Sets of effects are distinguished by the part of one that the other, with its own parameters fitted again, cannot
imitate.
Whitened inner products of the log and of a run add up, so a run is judged together with the information of the log.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.isolate import p_correct
from aqualog.diagnose.manoeuvres import SENSORS, Run, Sensor, checks, fitting
from aqualog.diagnose.noise import Noise
from aqualog.diagnose.outcome import CREDIBLE, Rival
from aqualog.diagnose.records import Manoeuvre
from aqualog.diagnose.run_information import Case, of_check, of_log, of_run
from aqualog.diagnose.words import listed, name_of
from aqualog.model.term import Check, Model

__all__ = ["next_manoeuvre", "resolving"]

TIMES = (1, 2, 4)  # that a run is driven
AGAIN = 1.5  # [min] for each further time
CERTAINTY = 1.645  # [sd] 95 of 100 cases
CONFIRMED = 3  # options that are judged with all tolerances
MENTIONED = 3  # pairs in a sentence


def resolving() -> float:
    """Separation that a run must add so that the wrong one of two sets is not credible any more in 95 % of cases.

    Twice the log of the ratio of evidence is normal with mean lambda and variance 4 lambda; the information of the log
    is used already and does not help again.
    """
    root = CERTAINTY + math.sqrt(CERTAINTY**2 + 2.0 * math.log(CREDIBLE))
    return root * root


@dataclass(frozen=True, slots=True)
class _Option:
    """A run or check, so many times, and the separation of each pair (P,) before and after it."""

    what: Run | Check
    times: int
    now: FloatArray
    then: FloatArray

    @property
    def minutes(self) -> float:
        return self.what.minutes + (self.times - 1) * AGAIN

    @property
    def decided(self) -> tuple[int, ...]:
        return tuple(int(p) for p in np.flatnonzero(self.then - self.now >= resolving()))

    @property
    def rank(self) -> tuple[int, float]:
        """Pairs that it decides, then the gain per minute for the worst of them (or of all pairs if it decides
        none)."""
        worth = self.then - self.now
        return len(self.decided), float(min(worth[list(self.decided)] if self.decided else worth)) / self.minutes


def next_manoeuvre(
    evidence: Evidence, credible: Sequence[Rival], noises: Sequence[Noise], model: Model
) -> Manoeuvre | None:
    """The run, check or sensor that distinguishes sets that the log cannot distinguish.

    Parameters
    ----------
    evidence : Evidence
        Drives with the signatures of all hypotheses.
    credible : sequence of Rival
        Refitted sets, best first.
    noises : sequence of Noise
        Of each drive, after the best set.
    model : Model
        On which the sets come.

    Returns
    -------
    manoeuvre : Manoeuvre or None
        None if no two sets differ in their effects. `name` is that of the run or check that decides most pairs and, of
        those, adds most to the worst pair per minute; `sensor` if only a further signal would decide one; `none` if the
        catalogue has no such run. `separates` has the decided pairs, the sentence lists the others. Separations are
        those of the worst decided pair. The same for the same input.
    """
    pairs = tuple(
        (i, j) for i, j in combinations(range(len(credible)), 2) if _effects(credible[i]) != _effects(credible[j])
    )
    if not pairs:
        return None
    names = [(h, n) for h in evidence.asked for n in h.free]  # in the order of the evidence's columns
    forgiven = tuple((h, n, sd) for (h, n), sd in zip(names, evidence.forgiven.tolist(), strict=True) if sd > 0.0)
    like = max(range(len(evidence.drives)), key=lambda d: evidence.drives[d].used_s)
    case = Case(evidence, tuple(credible), tuple(noises), model, pairs, forgiven, like)
    log = of_log(case)
    everything = tuple(range(len(forgiven)))
    first: list[Run | Check] = []
    first += fitting(case.effects, wet=bool(case.drive.course.lanes))
    first += checks(case.effects)
    options = _options(case, log, first, case.near)
    confirmed: list[_Option] = []
    # a run that decides a pair with a part of the tolerances may not do so with all of them
    for _ in range(CONFIRMED):
        promising = [o for o in options if o.decided]
        if not promising:
            break
        best = max(promising, key=lambda o: o.rank)
        whole = [o for o in _options(case, log, [best.what], everything) if o.decided]
        if whole:
            confirmed.append(max(whole, key=lambda o: o.rank))
            if len(confirmed[-1].decided) >= len(best.decided):
                break
        options = [o for o in options if o.what is not best.what]
    if confirmed:
        return _recommended(case, max(confirmed, key=lambda o: o.rank))
    return _otherwise(case, log)


def _effects(c: Rival) -> frozenset[str]:
    return frozenset(h.effect.name for h in c.refit.members)


def _options(case: Case, log: FloatArray, what: Sequence[Run | Check], kept: Sequence[int]) -> list[_Option]:
    """All options and repetitions, judged with a part of the tolerances."""
    at = case.rows(kept)
    known = log[np.ix_(at, at)]
    now = case.apart(known, kept)
    out = []
    for w in what:
        rows = of_run(case, w, kept) if isinstance(w, Run) else of_check(case, w, kept)
        added = rows @ rows.T
        out += [
            _Option(w, n, now, np.maximum(case.apart(known + n * added, kept), now))
            for n in (TIMES if isinstance(w, Run) else (1,))
        ]
    return out


def _recommended(case: Case, o: _Option) -> Manoeuvre:
    worst = min(o.decided, key=lambda p: o.then[p])
    told = _told(case, o.decided)
    often = "" if o.times == 1 else f", {o.times} times"
    text = f"Drive {o.what.how}{often}" if isinstance(o.what, Run) else o.what.how
    text += (
        f". It distinguishes {told}: the probability of naming the right one rises from {_percent(o.now[worst])} "
        f"to {_percent(o.then[worst])}"
    )
    rest = [p for p in range(len(case.pairs)) if p not in o.decided]
    if rest:
        text += f". It does not distinguish {_told(case, rest)}"
    return Manoeuvre(
        o.what.name, _pairs(case, o), f"{text}.", float(o.now[worst]), float(o.then[worst]), o.minutes
    )  # fmt: skip


def _otherwise(case: Case, log: FloatArray) -> Manoeuvre:
    """A sensor that decides a pair in one of the runs, or else the best run of all."""
    runs = [r for r in fitting(case.effects, wet=bool(case.drive.course.lanes)) if r.water is None]
    kept = case.near
    at = case.rows(kept)
    known = log[np.ix_(at, at)]
    now = case.apart(known, kept)
    plain = max(_options(case, log, runs, kept), key=lambda o: o.rank)
    assert isinstance(plain.what, Run)
    best: tuple[Sensor, _Option] | None = None
    for sensor in SENSORS:
        if set(sensor.signals) <= case.drive.present:
            continue
        rows = of_run(case, plain.what, kept, sensor)
        o = _Option(plain.what, 1, now, case.apart(known + rows @ rows.T, kept))
        if o.decided and (best is None or o.rank > best[1].rank):
            best = sensor, o
    if best is not None:
        sensor, o = best
        worst = min(o.decided, key=lambda p: o.then[p])
        told = _told(case, o.decided)
        text = (
            f"With these signals no run distinguishes {told}. With {sensor.name} in the log, one does: drive "
            f"{o.what.how}. The probability of naming the right one rises from {_percent(o.now[worst])} to "
            f"{_percent(o.then[worst])}."
        )
        return Manoeuvre("sensor", _pairs(case, o), text, float(o.now[worst]), float(o.then[worst]), o.minutes)
    everything = tuple(range(len(case.forgiven)))
    plain = max(_options(case, log, [plain.what], everything), key=lambda o: o.rank)
    worst = int(np.argmin(plain.then - plain.now))
    text = (
        f"No run of the catalogue decides between the causes: {_told(case, range(len(case.pairs)))}. The best of them, "
        f"{plain.what.name.replace('_', ' ')}, would change the probability of naming the right one from "
        f"{_percent(plain.now[worst])} to {_percent(plain.then[worst])}."
    )
    return Manoeuvre("none", (), text, float(plain.now[worst]), float(plain.then[worst]), 0.0)


def _percent(lam: float) -> str:
    p = p_correct(lam)
    return "over 99 %" if p > 0.99 else f"{100.0 * p:.0f} %"


def _apart_members(case: Case, p: int) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Members of each set of a pair that the other set does not hold."""
    a, b = (case.credible[i].refit.members for i in case.pairs[p])
    return [h for h in a if h not in b], [h for h in b if h not in a]


def _pair_words(case: Case, p: int) -> str:
    a, b = (
        listed([name_of(h.effect.name, h.where) for h in m]) if m else "nothing more" for m in _apart_members(case, p)
    )
    return f"{a} from {b}"


def _told(case: Case, pairs: Sequence[int]) -> str:
    words = list(dict.fromkeys(_pair_words(case, p) for p in pairs))
    more = len(words) - MENTIONED
    return listed(words if more <= 0 else [*words[:MENTIONED], f"{more} more"])


def _pairs(case: Case, o: _Option) -> tuple[tuple[str, str], ...]:
    """Keys of the effects that only one of the two sets of each decided pair has."""

    def keys(members: Sequence[Hypothesis]) -> str:
        return " + ".join(h.key for h in members)

    found = [_apart_members(case, p) for p in o.decided]
    return tuple(dict.fromkeys((keys(a), keys(b)) for a, b in found))
