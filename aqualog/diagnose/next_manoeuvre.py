"""Which run would tell the surviving causes apart: each is simulated, and what it adds to the log is counted.

Sets of effects are told apart by what one shows and the other, with its own parameters fitted anew, cannot imitate.
Whitened inner products of the log and of a run add up, so a run is judged together with what is known already.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from aqualog.diagnose.bench import Bench
from aqualog.diagnose.drive import Drive, prepare
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in
from aqualog.diagnose.isolate import p_correct, separation
from aqualog.diagnose.manoeuvres import CHECKS, SENSORS, TURNING, Check, Run, Sensor, fitting, programme, turned
from aqualog.diagnose.noise import Noise, bridged, for_mask, spectra, whitened
from aqualog.diagnose.records import Manoeuvre
from aqualog.diagnose.search import CREDIBLE, Candidate
from aqualog.diagnose.words import listed, name_of
from aqualog.model.signals import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.term import Model
from aqualog.types import FloatArray, Signals

__all__ = ["next_manoeuvre", "resolving"]

STEP_S = 2e-3  # [s] of the integration
TIMES = (1, 2, 4)  # that a run is driven
AGAIN = 1.5  # [min] for each further time
CERTAINTY = 1.645  # [sd] 95 of 100 cases
CONFIRMED = 3  # options that are judged with all tolerances
MENTIONED = 3  # pairs in a sentence
# rms noise of channels that the log does not have yet, independent from second to second (K)
_ASSUMED = {"force_balance": 0.1, "kinematic": 0.15, "lateral": 0.2, "tie_rod": 100.0}
_ASSUMED_SPEED = 0.05  # [m/s] of all others


def resolving() -> float:
    """Separation that a run must add so that the wrong one of two sets is not credible any more in 95 % of cases.

    Twice the log of the ratio of evidence is normal with mean lambda and variance 4 lambda; what the log has said is
    known by now and does not help again.
    """
    root = CERTAINTY + math.sqrt(CERTAINTY**2 + 2.0 * math.log(CREDIBLE))
    return root * root


@dataclass(frozen=True, slots=True)
class _Case:
    """What is to be decided: the sets, pairs of them, and all that is forgiven, (hypothesis, parameter, its sd)."""

    bench: Bench
    credible: tuple[Candidate, ...]
    noises: tuple[Noise, ...]
    model: Model
    pairs: tuple[tuple[int, int], ...]
    forgiven: tuple[tuple[Hypothesis, str, float], ...]
    like: int  # the drive whose signals, noise and water a run is taken to have

    @property
    def drive(self) -> Drive:
        return self.bench.drives[self.like]

    @property
    def effects(self) -> frozenset[str]:
        return frozenset(h.effect.name for c in self.credible for h in c.refit.members)

    @property
    def near(self) -> tuple[int, ...]:
        """What is forgiven of the effects in question, and what every vehicle file is off by."""
        names = self.effects
        return tuple(i for i, (h, _, _) in enumerate(self.forgiven) if h.allowed or h.effect.name in names)

    def rows(self, kept: Sequence[int]) -> list[int]:
        """Rows of the sets, of what a run misses, and those of a part of what is forgiven."""
        first = len(self.credible) + sum(len(c.refit.values) for c in self.credible) + 1
        return [*range(first), *(first + i for i in kept)]

    def apart(self, gram: FloatArray, kept: Sequence[int]) -> FloatArray:
        """Separation of each pair by inner products of rows with a part of what is forgiven; the lesser of two ways."""
        k = len(gram) - len(kept) + np.arange(len(kept))
        inner = gram[np.ix_(k, k)] + np.diag([self.forgiven[i][2] ** -2.0 for i in kept])
        gram = gram - gram[:, k] @ np.linalg.solve(inner, gram[k, :])
        own, at = [], len(self.credible)
        for c in self.credible:
            own.append(tuple(range(at, at + len(c.refit.values))))
            at += len(c.refit.values)
        ways = [
            [
                _certain(gram, (a, b, at), own[b]) / max(self.credible[a].inflation, 1.0)
                for a, b in ((i, j), (j, i))
                # what holds the truth and more imitates it always
                if any(h not in self.credible[b].refit.members for h in self.credible[a].refit.members)
            ]
            for i, j in self.pairs
        ]
        return np.array([min(w) for w in ways])


def _certain(gram: FloatArray, rows: tuple[int, int, int], rivals: Sequence[int]) -> float:
    """Separation of a truth from its rivals, less what the simulation's own miss `rows[2]` may take from it.

    The difference d of two sets meets noise and the miss e: twice the log of the ratio of evidence has mean
    d^2 - 2 |e d| and variance 4 d^2. What is given back is the separation that is as sure without a miss.
    """
    plain = separation(gram, rows, rivals, np.array([-1.0, 1.0, 0.0]))
    if plain <= 0.0:
        return 0.0
    cross = 0.25 * (
        separation(gram, rows, rivals, np.array([-1.0, 1.0, 1.0]))
        - separation(gram, rows, rivals, np.array([-1.0, 1.0, -1.0]))
    )
    return max(plain - 2.0 * abs(cross), 0.0) ** 2 / plain


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
        """Pairs that it decides, then what it adds to the worst of them (of all, if none) per minute."""
        worth = self.then - self.now
        return len(self.decided), float(min(worth[list(self.decided)] if self.decided else worth)) / self.minutes


def next_manoeuvre(
    bench: Bench, credible: Sequence[Candidate], noises: Sequence[Noise], model: Model
) -> Manoeuvre | None:
    """The run, check or sensor that tells sets apart which the log cannot.

    Parameters
    ----------
    bench : Bench
        Drives with the signatures of all hypotheses.
    credible : sequence of Candidate
        Refitted sets, best first.
    noises : sequence of Noise
        Of each drive, after the best set.
    model : Model
        On which the sets come.

    Returns
    -------
    manoeuvre : Manoeuvre or None
        None if no two sets differ in their effects. `name` is that of the run or check that decides most pairs and, of
        those, adds most to the worst pair per minute; `sensor` if only a further signal would decide one; `none` if
        nothing of the catalogue does. `separates` has the decided pairs, the sentence tells the others. Separations
        are those of the worst decided pair. The same for the same input.
    """
    pairs = tuple(
        (i, j) for i, j in combinations(range(len(credible)), 2) if _effects(credible[i]) != _effects(credible[j])
    )
    if not pairs:
        return None
    forgiven = tuple(
        (h, n, h.tolerance(n)) for h in bench.asked for n in h.free if h.tolerance(n) > 0.0
    )  # in the order of the bench's columns
    like = max(range(len(bench.drives)), key=lambda d: bench.drives[d].used_s)
    case = _Case(bench, tuple(credible), tuple(noises), model, pairs, forgiven, like)
    log = _of_log(case)
    everything = tuple(range(len(forgiven)))
    first: list[Run | Check] = []
    first += fitting(case.effects, wet=bool(case.drive.course.lanes))
    first += [c for c in CHECKS if c.effect in case.effects]
    options = _options(case, log, first, case.near)
    confirmed: list[_Option] = []
    # what decides a pair with a part of the tolerances may not do so with all of them
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


def _effects(c: Candidate) -> frozenset[str]:
    return frozenset(h.effect.name for h in c.refit.members)


def _of_log(case: _Case) -> FloatArray:
    """Inner products of what each set leaves of the log, its columns, and all that is forgiven."""
    bench = case.bench
    forgiven = np.flatnonzero(bench.tolerance > 0.0).tolist()
    total: FloatArray | float = 0.0
    for d, (drive, noise) in enumerate(zip(bench.drives, case.noises, strict=True)):
        parts = [c.refit.residuals[d][None] for c in case.credible] + [c.refit.signatures[d] for c in case.credible]
        rows = whitened(spectra(bridged(np.concatenate(parts), drive.mask)), noise)
        nothing = np.zeros((1, rows.shape[1]))
        rows = np.concatenate([rows, nothing, whitened(bench.prepared[d].of(forgiven), noise)])
        total = total + rows @ rows.T
    return np.asarray(total)


def _options(case: _Case, log: FloatArray, what: Sequence[Run | Check], kept: Sequence[int]) -> list[_Option]:
    """All that can be done, so many times, judged with a part of what is forgiven."""
    at = case.rows(kept)
    known = log[np.ix_(at, at)]
    now = case.apart(known, kept)
    out = []
    for w in what:
        rows = _of_run(case, w, kept) if isinstance(w, Run) else _of_check(case, w, kept)
        added = rows @ rows.T
        out += [
            _Option(w, n, now, case.apart(known + n * added, kept)) for n in (TIMES if isinstance(w, Run) else (1,))
        ]
    return out


def _of_run(case: _Case, run: Run, kept: Sequence[int], sensor: Sensor | None = None) -> FloatArray:
    """Whitened rows of a run, simulated under the best set; without effect if nothing of it can be used."""
    drive = _driven(case, run, sensor)
    n_rows = len(case.rows(kept))
    if not drive.mask.any():
        return np.zeros((n_rows, 1))
    models = [c.refit.model for c in case.credible]
    model = case.model
    if run.opposite:
        models, model = [turned(m) for m in models], turned(model)
    left = [residual(drive, m) for m in models]
    own = [
        _signatures(drive, m, c.refit.members, r, run, each=True)
        for m, c, r in zip(models, case.credible, left, strict=True)
    ]
    asked: list[Hypothesis] = []
    for i in kept:
        if case.forgiven[i][0] not in asked[-1:]:
            asked.append(case.forgiven[i][0])
    shown = _signatures(drive, model, asked, residual(drive, model), run, each=False)
    rows = np.concatenate([np.array(left), *own, left[0][None], shown])
    return _weighed(case, drive, rows)


def _signatures(
    drive: Drive, model: Model, asked: Sequence[Hypothesis], base: FloatArray, run: Run, *, each: bool
) -> FloatArray:
    """Signatures by the values that the same road has in the log's direction. (k, C, m)"""
    parts = signatures(drive, model, asked, base=base, each=each)
    if run.opposite:
        parts = [-s if h.effect.name in TURNING else s for h, s in zip(asked, parts, strict=True)]
    return np.concatenate(parts)


def _driven(case: _Case, run: Run, sensor: Sensor | None) -> Drive:
    """A run under the best set, with perfect sensors for the signals that the log has."""
    truth = case.credible[0].refit.model
    simulation = simulate(programme(run, case.drive), turned(truth) if run.opposite else truth, dt=STEP_S)
    signals = as_signals(simulation, truth=False)
    present = case.drive.present | set(sensor.signals if sensor else ())
    keep = [s for s in signals.frame.columns if s in present or s == "t" or s.startswith("water_depth")]
    signals = Signals(signals.frame.select(keep), signals.dt_ns, signals.start_ns, {}, signals.quality, signals.files)
    drive = prepare(signals, case.drive.vehicle, run.name)
    known = case.drive.channels
    return replace(drive, channels=(*known, *(c for c in drive.channels if c not in known)))


def _weighed(case: _Case, drive: Drive, rows: FloatArray) -> FloatArray:
    """Rows (k, C, m), the driven set's first, by the noise of the log; channels that it lacks by assumed noise."""
    count = len(case.drive.channels)
    noise = for_mask(case.noises[case.like], drive.mask)
    out = whitened(spectra(bridged(rows[:, :count], drive.mask)), noise)
    # what the simulation along the run misses of the set that was driven counts as noise: it will be there
    of_channels = out.reshape(len(out), count, -1)
    missed = (of_channels[0] ** 2).sum(axis=-1) / max(int(drive.mask.sum()), 1)
    out = (of_channels / np.sqrt(1.0 + missed)[:, None]).reshape(len(out), -1)
    step = max(0.1, drive.dt)
    for c, name in enumerate(drive.channels[count:], count):
        sd = next((x for n, x in _ASSUMED.items() if name.startswith(n)), _ASSUMED_SPEED)
        out = np.concatenate([out, rows[:, c, drive.mask] / sd * math.sqrt(min(step, 1.0))], axis=1)
    return out


def _of_check(case: _Case, check: Check, kept: Sequence[int]) -> FloatArray:
    """One column: what each set leaves of the reading, and what its parameters take away."""

    def meant(h: Hypothesis, name: str) -> bool:
        return h.effect.name == check.effect and h.where in check.where and name == check.parameter

    asked = next(h for h in case.bench.asked if h.effect.name == check.effect and h.where in check.where)
    left = [-value_in(c.refit.model, asked, check.parameter) for c in case.credible]
    own = [float(meant(c.refit.members[i], n)) for c in case.credible for i, n in c.refit.names]
    forgiven = [float(meant(*case.forgiven[i][:2])) for i in kept]
    return np.array([*left, *own, 0.0, *forgiven])[:, None] / check.sd


def _recommended(case: _Case, o: _Option) -> Manoeuvre:
    worst = min(o.decided, key=lambda p: o.then[p])
    told = _told(case, o.decided)
    often = "" if o.times == 1 else f", {o.times} times"
    text = f"Drive {o.what.how}{often}" if isinstance(o.what, Run) else o.what.how
    text += (
        f". It tells {told} apart: the right one is named with a probability of {_percent(o.then[worst])} then, "
        f"{_percent(o.now[worst])} now"
    )
    rest = [p for p in range(len(case.pairs)) if p not in o.decided]
    if rest:
        text += f". It does not tell {_told(case, rest)} apart"
    return Manoeuvre(
        o.what.name, _pairs(case, o), f"{text}.", float(o.now[worst]), float(o.then[worst]), o.minutes
    )  # fmt: skip


def _otherwise(case: _Case, log: FloatArray) -> Manoeuvre:
    """A sensor that decides a pair in one of the runs, or nothing."""
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
        rows = _of_run(case, plain.what, kept, sensor)
        o = _Option(plain.what, 1, now, case.apart(known + rows @ rows.T, kept))
        if o.decided and (best is None or o.rank > best[1].rank):
            best = sensor, o
    if best is not None:
        sensor, o = best
        worst = min(o.decided, key=lambda p: o.then[p])
        told = _told(case, o.decided)
        text = (
            f"With these signals no run tells {told} apart; with {sensor.name} in the log, one does: drive "
            f"{o.what.how}. The right one is named with a probability of {_percent(o.then[worst])} then, "
            f"{_percent(o.now[worst])} now."
        )
        return Manoeuvre("sensor", _pairs(case, o), text, float(o.now[worst]), float(o.then[worst]), o.minutes)
    everything = tuple(range(len(case.forgiven)))
    plain = max(_options(case, log, [plain.what], everything), key=lambda o: o.rank)
    worst = int(np.argmin(plain.then - plain.now))
    text = (
        f"None of these runs decides between the causes, {_told(case, range(len(case.pairs)))}; the best of them, "
        f"{plain.what.name.replace('_', ' ')}, would name the right one with a probability of "
        f"{_percent(plain.then[worst])}, now {_percent(plain.now[worst])}."
    )
    return Manoeuvre("none", (), text, float(plain.now[worst]), float(plain.then[worst]), 0.0)


def _percent(lam: float) -> str:
    p = p_correct(lam)
    return "over 99 %" if p > 0.99 else f"{100.0 * p:.0f} %"


def _apart_members(case: _Case, p: int) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """What each set of a pair has and the other has not."""
    a, b = (case.credible[i].refit.members for i in case.pairs[p])
    return [h for h in a if h not in b], [h for h in b if h not in a]


def _pair_words(case: _Case, p: int) -> str:
    a, b = (
        listed([name_of(h.effect.name, h.where) for h in m]) if m else "nothing more" for m in _apart_members(case, p)
    )
    return f"{a} from {b}"


def _told(case: _Case, pairs: Sequence[int]) -> str:
    words = list(dict.fromkeys(_pair_words(case, p) for p in pairs))
    more = len(words) - MENTIONED
    return listed(words if more <= 0 else [*words[:MENTIONED], f"{more} more"])


def _pairs(case: _Case, o: _Option) -> tuple[tuple[str, str], ...]:
    """Keys of what the two sets of each decided pair have for themselves."""

    def keys(members: Sequence[Hypothesis]) -> str:
        return " + ".join(h.key for h in members)

    found = [_apart_members(case, p) for p in o.decided]
    return tuple(dict.fromkeys((keys(a), keys(b)) for a, b in found))
