"""What to do next: the run, check or sensor with the most expected information on which cause is the right one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray, Signals
from aqualog.diagnose.channels import block_step
from aqualog.diagnose.competition import COARSE
from aqualog.diagnose.drive import Drive, prepare
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in
from aqualog.diagnose.manoeuvres import SENSORS, Run, Sensor, checks, fitting, programme, turned
from aqualog.diagnose.noise import Noise, bridged, for_mask, whitened
from aqualog.diagnose.records import SURE, Manoeuvre
from aqualog.diagnose.refit import PRIOR_WIDTH, Refit
from aqualog.diagnose.threads import beside
from aqualog.diagnose.words import name_of
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.term import Check, Model

__all__ = ["Case", "Forecast", "Rival", "entropy", "forecast", "next_manoeuvre", "of_check", "of_log", "of_run"]

STEP_S = 5e-3  # [s] of the integration
DRAWS = 300  # of the run's data, for each set
SEED = 1
# rms noise of channels that the log does not have yet, independent from second to second (K)
_ASSUMED = {"force_balance": 0.1, "kinematic": 0.15, "lateral": 0.2, "tie_rod": 100.0}
_ASSUMED_SPEED = 0.05  # [m/s] of all others
TIMES = (1, 2, 3)  # that a run is driven
OFTEN = {1: "", 2: ", twice", 3: ", three times"}
AGAIN = 1.0  # [min] for each further time
LEAST = 0.1  # share of the missing information below which nothing is recommended
CONFIRMED = 2  # runs that are judged with all tolerances
MENTIONED = 3  # pairs in a sentence


class Rival(NamedTuple):
    """A refitted set that remains, and its probability."""

    refit: Refit
    probability: float


_Driven = tuple[Drive, list[FloatArray], dict[int, FloatArray]]


@dataclass(frozen=True, slots=True)
class Case:
    """The decision to make: the sets with their probabilities, and tolerances as (hypothesis, parameter, its sd)."""

    evidence: Evidence
    rivals: tuple[Rival, ...]
    noises: tuple[Noise, ...]
    model: Model
    tolerances: tuple[tuple[int, Hypothesis, str, float], ...]  # the first is the column of the evidence
    like: int  # the drive whose signals, noise and water a run is assumed to have
    # those that were simulated: what each set leaves, then the sets' own columns; tolerances by identity
    runs: dict[tuple[Run, Sensor | None], _Driven] = field(default_factory=dict)

    @property
    def drive(self) -> Drive:
        """The drive whose signals a run has."""
        return self.evidence.drives[self.like]

    @property
    def effects(self) -> frozenset[str]:
        """Names of all effects in question."""
        return frozenset(h.effect.name for c in self.rivals for h in c.refit.members)

    @property
    def near(self) -> Case:
        """The same with the tolerances of the effects in question and of every vehicle file only."""
        names = self.effects
        return replace(self, tolerances=tuple(x for x in self.tolerances if x[1].allowed or x[1].effect.name in names))


@dataclass(frozen=True, slots=True)
class Forecast:
    """`information` [nats (natural logarithm)] that a run is expected to give; `right`: probability that the likeliest
    cause is the true one; `pairs` (S, S): the same between two sets."""

    information: float
    right: float
    pairs: FloatArray


def entropy(p: FloatArray) -> FloatArray:
    """Missing information of probabilities (..., S). [nats (natural logarithm)]"""
    return np.asarray(-(p * np.log(np.maximum(p, 1e-300))).sum(axis=-1))


def of_log(case: Case) -> FloatArray:
    """Inner products of the remainders of the log after each set, the sets' columns, and the tolerances."""
    total: FloatArray | float = 0.0
    for d, (drive, noise) in enumerate(zip(case.evidence.drives, case.noises, strict=True)):
        parts = [c.refit.residuals[d][None] for c in case.rivals] + [c.refit.signatures[d] for c in case.rivals]
        rows = whitened(bridged(np.concatenate(parts), drive.mask), noise)
        kept = bridged(case.evidence.signatures[d][[x[0] for x in case.tolerances]], drive.mask)
        rows = np.concatenate([rows, whitened(kept, noise)])
        total = total + rows @ rows.T
    return np.asarray(COARSE * total)


def forecast(case: Case, log: FloatArray, run: FloatArray, times: int, group: FloatArray) -> Forecast:
    """Expected information of a run that is driven so many times.

    Under set i, the parameters and tolerances have a normal posterior after the log, and so have the data of the run;
    tolerances of a drive, as the wind, the run has for itself. The data are drawn under each set in the space that all
    rows span, and each set's density gives the posterior, as coarse as in the verdict. `log`, `run` (N, N): inner
    products of the rows of `of_log`, and of `of_run` or `of_check`; `group` (S, S): 1 where a set (row) has the effects
    of a group (column), since such sets are one cause.
    """
    size, turn = np.linalg.eigh(run * times)
    seen = size > 1e-9 * max(float(size[-1]), 1e-9)
    at = turn[:, seen] * np.sqrt(size[seen])  # rows in coordinates of unit noise
    rng = np.random.default_rng(SEED)
    unit = rng.standard_normal((DRAWS, at.shape[1]))
    means, roots = [], []
    wide = [sd for _, _, _, sd in case.tolerances]
    anew = [h.effect.belongs == "drive" and h.effect.name not in case.effects for _, h, _, _ in case.tolerances]
    first = len(case.rivals)  # the rows of the sets' own parameters and of the tolerances stand behind the remainders
    for i, c in enumerate(case.rivals):
        own = [*range(first, first + len(c.refit.names)), *range(len(log) - len(case.tolerances), len(log))]
        first += len(c.refit.names)
        sd = [PRIOR_WIDTH * h.parameter(n).sigma for h, n in c.refit.names] + wide
        spread = np.linalg.inv(log[np.ix_(own, own)] + np.diag(np.array(sd) ** -2.0))
        mean = spread @ log[own, i]
        fresh = len(own) - len(anew) + np.flatnonzero(anew)
        spread[fresh] = spread[:, fresh] = mean[fresh] = 0.0
        spread[fresh, fresh] = np.array(sd)[fresh] ** 2
        means.append(at[own].T @ mean - at[i])
        roots.append(np.linalg.cholesky(np.eye(at.shape[1]) + at[own].T @ spread @ at[own]))
    p = np.array([c.probability for c in case.rivals])
    p = p / p.sum()
    density = np.empty((len(p), DRAWS, len(p)))
    for j, (mean, root) in enumerate(zip(means, roots, strict=True)):
        y = mean + unit @ root.T
        for i, (other, its) in enumerate(zip(means, roots, strict=True)):
            z = np.linalg.solve(its, (y - other).T)
            density[j, :, i] = math.log(p[i] + 1e-300) - np.log(np.diag(its)).sum() - 0.5 * (z * z).sum(axis=0)
    after = np.exp(density - density.max(axis=2, keepdims=True))
    after = after / after.sum(axis=2, keepdims=True) @ group
    right = (after.argmax(axis=2) == group.argmax(axis=1)[:, None]).mean(axis=1)
    pairs = np.ones((len(p), len(p)))
    for i, j in combinations(range(len(p)), 2):
        won = [float((density[a, :, a] > density[a, :, b]).mean()) for a, b in ((i, j), (j, i))]
        pairs[i, j] = pairs[j, i] = (p[i] * won[0] + p[j] * won[1]) / (p[i] + p[j])
    gained = float(entropy(p @ group) - p @ entropy(after).mean(axis=1))
    return Forecast(max(gained, 0.0), max(float(p @ right), float((p @ group).max())), pairs)


def of_run(case: Case, run: Run, sensor: Sensor | None = None) -> FloatArray:
    """Inner products of the rows of a run, simulated under the best set; zero if no sample of it can be used."""
    drive, rows, shown = case.runs.get((run, sensor)) or case.runs.setdefault((run, sensor), _seen(case, run, sensor))
    if not rows:
        n = len(case.rivals) + sum(len(c.refit.names) for c in case.rivals) + len(case.tolerances)
        return np.zeros((n, n))
    model = turned(case.model) if run.opposite else case.model
    asked = {id(h): h for _, h, _, _ in case.tolerances}
    if new := [h for i, h in asked.items() if i not in shown]:
        parts = _signatures(drive, model, new, residual(drive, model), run, each=False)
        shown.update(zip(map(id, new), parts, strict=True))
    weighed = _weighed(case, drive, np.concatenate([*rows, *(shown[i] for i in asked)]))
    return np.asarray(COARSE * weighed @ weighed.T)


def _seen(case: Case, run: Run, sensor: Sensor | None) -> _Driven:
    drive = _driven(case, run, sensor)
    if not drive.mask.any():
        return drive, [], {}
    shared = [c.refit.model.of("") for c in case.rivals]  # what one drive alone had, no other run has
    models = [turned(m) if run.opposite else m for m in shared]
    left = [residual(drive, m) for m in models]
    own = [
        s for m, c, r in zip(models, case.rivals, left, strict=True)
        for s in _signatures(drive, m, c.refit.members, r, run, each=True)
    ]  # fmt: skip
    return drive, [np.array(left), *own], {}


def _signatures(
    drive: Drive, model: Model, asked: Sequence[Hypothesis], base: FloatArray, run: Run, *, each: bool
) -> list[FloatArray]:
    """Signatures (k, C, m) by the values that the same road has in the log's direction."""
    parts = signatures(drive, model, asked, base=base, each=each)
    return [-s if run.opposite and h.effect.drive.turns else s for h, s in zip(asked, parts, strict=True)]


def _driven(case: Case, run: Run, sensor: Sensor | None) -> Drive:
    """A run under the best set, with perfect sensors for the signals that the log has."""
    truth = case.rivals[0].refit.model.of("")
    simulation = simulate(programme(run, case.drive), turned(truth) if run.opposite else truth, dt=STEP_S)
    signals = as_signals(simulation, truth=False)
    present = case.drive.present | set(sensor.signals if sensor else ())
    keep = [s for s in signals.frame.columns if s in present or s == "t" or s.startswith("water_depth")]
    signals = Signals(signals.frame.select(keep), signals.dt_ns, signals.start_ns, {}, signals.quality, signals.files)
    drive = prepare(signals, case.drive.vehicle, run.name)
    known = case.drive.channels
    return replace(drive, channels=(*known, *(c for c in drive.channels if c not in known)))


def _weighed(case: Case, drive: Drive, rows: FloatArray) -> FloatArray:
    """Rows (k, C, m), the driven set's first, by the noise of the log; channels that it lacks by assumed noise."""
    count = len(case.drive.channels)
    noise = for_mask(case.noises[case.like], drive.mask)
    out = whitened(bridged(rows[:, :count], drive.mask), noise)
    # the simulation's error for the driven set counts as noise, because a real run has it too
    of_channels = out.reshape(len(out), count, -1)
    missed = (of_channels[0] ** 2).sum(axis=-1) / max(int(drive.mask.sum()), 1)
    out = (of_channels / np.sqrt(1.0 + missed)[:, None]).reshape(len(out), -1)
    step = block_step(drive.dt)
    for c, name in enumerate(drive.channels[count:], count):
        sd = next((x for n, x in _ASSUMED.items() if name.startswith(n)), _ASSUMED_SPEED)
        out = np.concatenate([out, rows[:, c, drive.mask] / sd * math.sqrt(min(step, 1.0))], axis=1)
    return out


def of_check(case: Case, check: Check) -> FloatArray:
    """Inner products of one reading: the remainder after each set, and the change by its parameters."""

    def share(h: Hypothesis, name: str) -> float:
        if h.effect.drive.check is not check or h.where not in check.where or name != check.parameter:
            return 0.0
        return 0.25 if h.where in WHEELS else 0.5 if h.where in AXLES else 1.0

    sets = [[(h, n, value_in(c.refit.model, h, n)) for h, n in c.refit.names] for c in case.rivals]
    left = [-sum(share(h, n) * (x - h.parameter(n).neutral) for h, n, x in own) for own in sets]
    own = [share(h, n) for c in case.rivals for h, n in c.refit.names]
    row = np.array([*left, *own, *(share(h, n) for _, h, n, _ in case.tolerances)]) / check.sd
    return np.outer(row, row)


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
    if not enough:
        text = f"No run, check or further sensor distinguishes: {_told(members, pairs)}."
        if _percent(after) != _percent(before):
            text += f" The best is {o.what.name.replace('_', ' ')}{OFTEN[o.times]}: {rises}."
        return Manoeuvre("none", (), text, np.nan, np.nan, 0.0, before, after)
    text = f"{o.what.how}{OFTEN[o.times]} ({o.minutes:.0f} min): {rises}."
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
