"""Known effects and unknown forms of a campaign in one competition about its best set; the best sets are refitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Field, blocks_of
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes, expected_values
from aqualog.diagnose.campaign.refit import Fit, Refit, fit, inner, refit
from aqualog.diagnose.compete import rule
from aqualog.diagnose.competition import COARSE, Block, Members, Sets, fitted_in, joined, placed, ranked, searched
from aqualog.diagnose.evidence import Calibration, Evidence, calibrate, significance
from aqualog.diagnose.hypotheses import WORTH, Hypothesis, value_in, with_values
from aqualog.diagnose.records import Remainder, Significance
from aqualog.diagnose.run import Options
from aqualog.diagnose.shapes import Mechanism, Shape, basis
from aqualog.diagnose.unexplained import clear_forms, described
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model

__all__ = ["Found", "Option", "compete", "evidence_of", "hypotheses", "signatures", "untested"]

STEP = 0.5  # standard deviations of the prior to either side, of a finite difference
ROUNDS = 3  # of the competition around its own best set
COVERED, REFITTED = 0.999, 10  # share of the posterior that is refitted, and the most sets
OVER = (("v_x",), ("depth",), ("pressure",), ("load",))
USUAL = 0.2  # of the channel's rms
TITLES = {
    "f": "the slip of the front wheels", "r": "the slip of the rear wheels", "left": "the slip of the left wheels",
    "right": "the slip of the right wheels", RESISTANCE: "the resistance of the water",
}  # fmt: skip


def hypotheses(passes: Passes) -> tuple[Hypothesis, ...]:
    """Hypotheses that these runs can test: stiffness of the driven axles only."""
    driven = {n[-2] for n in passes.names if n.startswith("slip_slope_")}
    searches = sorted(((e.campaign, e) for e in EFFECTS.values() if e.campaign is not None), key=lambda x: x[0].order)
    return tuple(
        Hypothesis(e, where, tuple(p.name for p in e.parameters), room=e.parameters[0].smallest / WORTH)
        for asked, e in searches for where in asked.places if not asked.driven or where in driven
    )  # fmt: skip


def untested(tested: Sequence[Hypothesis]) -> dict[str, str]:
    """Effects of the simulator that are not tested here, with the reason."""
    names = {h.effect.name for h in tested}
    reason = "acts alike on and off the water, so a campaign's wet-dry difference cancels it: diagnose single drives"
    return {name: reason for name in EFFECTS if name not in names}


def evidence_of(asked: Sequence[Hypothesis], given: Model) -> Evidence:
    """Hypotheses with priors and bounds, as for drives; bounds count from the values of the model at hand."""
    names = [(h, n) for h in asked for n in h.free]
    ends = np.cumsum([0, *(len(h.free) for h in asked)]).tolist()
    columns = tuple(tuple(range(a, b)) for a, b in pairwise(ends))
    now = np.array([value_in(given, h, n) for h, n in names])
    sigma, low, high, smallest = (
        np.array([getattr(h.parameter(n), of) for h, n in names]) for of in ("sigma", "low", "high", "smallest")
    )
    none = np.zeros(sigma.size)
    return Evidence(
        (), tuple(asked), (), (), columns, sigma, low - now, high - now, smallest, none,
        np.zeros(len(asked), dtype=bool), none, tuple("" for _ in names), none,
    )  # fmt: skip


def signatures(passes: Passes, model: Model, asked: Sequence[Hypothesis], expected: FloatArray) -> FloatArray:
    """Change (g, c, k) of the observations by one prior standard deviation of each parameter, from differences of the
    expectation about a model, whose own is `expected` (g, c)."""
    columns = []
    for h, n in [(own, n) for own in asked for n in own.free]:
        p, at = h.parameter(n), value_in(model, h, n)
        ends = [min(max(at + s * STEP * p.sigma, p.low), p.high) for s in (-1.0, 1.0)]
        models = (with_values(model, [(h, {n: x})]) for x in ends)
        low, high = (expected if x == at else expected_values(passes, m)[0] for x, m in zip(ends, models, strict=True))
        columns.append((high - low) * (p.sigma / (ends[1] - ends[0])))
    return np.nan_to_num(np.stack(columns, axis=-1))


class Option(NamedTuple):
    """A refitted set and its log evidence with its prior. [nats (natural logarithm)]"""

    refit: Refit
    evidence: float


class Found(NamedTuple):
    """`gram` of the effects and `calibration` describe what the runs can distinguish; `nothing`: the model at hand;
    `options`: sets, most likely first, none where there are `forms`, or the test finds no more than chance."""

    evidence: Evidence
    significance: Significance
    gram: FloatArray
    calibration: Calibration
    scatter: Fit
    nothing: Refit
    forms: tuple[Remainder, ...]
    options: tuple[Option, ...]


@dataclass(frozen=True, slots=True)
class _Ring(Field):
    """What competes in these runs; `functions` (g, c, K): columns of the shapes, after those of the effects."""

    functions: FloatArray
    passes: Passes
    given: Model

    @property
    def known(self) -> tuple[Block, ...]:
        return tuple(b for b in self.blocks if b.kind == "effect")

    def sets(self, blocks: Sequence[Block], gram: FloatArray) -> Sets:
        found = searched(blocks, gram, rule(self.evidence, blocks, gram))
        return ranked({m: COARSE * e for m, e in found.items()}, self.name)


@dataclass(frozen=True, slots=True)
class _Stand:
    """The runs about a refitted set: signatures `x` (g, c, k) there, residual `y` (g, c) that a linear model about it
    has without it, variances `road` (g, c), and the scatter with all effects free."""

    best: Refit
    x: FloatArray
    y: FloatArray
    road: FloatArray
    scatter: Fit

    @staticmethod
    def about(best: Refit, own: Sequence[int], ring: _Ring, start: Fit | None = None) -> _Stand:
        """`own`: columns of the set."""
        expected, road = expected_values(ring.passes, best.model)
        x = signatures(ring.passes, best.model, ring.evidence.asked, expected)
        y = best.residual + x[:, :, own] @ best.theta
        return _Stand(best, x, y, road, fit(best.residual, x, road, ring.passes.nuisances, start))

    def gram(self, passes: Passes, *more: FloatArray) -> FloatArray:
        return inner(np.concatenate([self.x, *more], axis=-1), self.y, passes.nuisances, self.scatter.weight)


def compete(
    passes: Passes, given: Model, asked: tuple[Hypothesis, ...], o: Options, say: Callable[[str], None]
) -> Found:
    """Unknown forms and sets of known effects with their evidence. Forms compete with signatures about the best set of
    effects; effects are asked for only if the test for any effect finds more than chance."""
    say("signatures of the effects")
    evidence = evidence_of(asked, given)
    shapes, functions = _shapes_of(passes)
    ring = _Ring(evidence, *blocks_of(evidence, shapes), shapes, functions, passes, given)
    y = passes.values - expected_values(passes, given)[0]
    nothing = Refit((), np.zeros(0), given, y, np.zeros((*y.shape, 0)), at_bound=False)
    stand = _Stand.about(nothing, [], ring)
    plain = stand.gram(passes) / np.outer(scale := np.append(evidence.prior, 1.0), scale)
    calibration = calibrate(evidence, plain, surrogates=o.surrogates, level=o.level, seed=o.seed)
    test = significance(evidence, plain, calibration, o.level)
    if test.p_value <= o.level:
        say("known effects")
        stand = _repeated(ring, stand)
    say("known effects against unknown forms")
    forms, stand = _forms(ring, stand, o.seed)
    options: tuple[Option, ...] = ()
    if not forms and test.p_value <= o.level:
        say("refitting the sets of effects")
        options = _options(ring, stand, nothing)
    return Found(evidence, test, plain, calibration, stand.scatter, nothing, forms, options)


def _refitted(ring: _Ring, stand: _Stand, members: Members, gram: FloatArray) -> Refit:
    linear = fitted_in(ring.known, gram, members)
    chosen, x = [ring.known[m].tag for m in members], stand.x[:, :, linear.columns]
    return refit(ring.passes, ring.evidence, chosen, linear.mean, x, stand.scatter.weight, ring.given)


def _repeated(ring: _Ring, stand: _Stand) -> _Stand:
    """The competition of known effects around its own best set, until that stays the same."""
    done: Members = ()
    for _ in range(ROUNDS):
        gram = stand.gram(ring.passes)
        best = ring.sets(ring.known, gram).best
        if best == done:
            break
        own = [c for m in best for c in ring.known[m].columns]
        stand, done = _Stand.about(_refitted(ring, stand, best, gram), own, ring, stand.scatter), best
    return stand


def _forms(ring: _Ring, stand: _Stand, seed: int) -> tuple[tuple[Remainder, ...], _Stand]:
    """Unknown forms that no known effect replaces; the scatter is that with the forms of the best set free too."""
    passes, k = ring.passes, ring.evidence.count
    after: Members = ()
    for _ in range(ROUNDS):
        gram = stand.gram(passes, ring.functions)
        sets = ring.sets(ring.blocks, gram)
        new = tuple(m for m in sets.best if ring.blocks[m].kind == "shape")
        if new == after:
            break
        after, own = new, [ring.blocks[m] for m in new]
        drawn = [ring.functions[:, :, [c - k for c in b.columns]] @ np.linalg.cholesky(b.prior) for b in own]
        x = np.concatenate([stand.x, *drawn], axis=-1)
        stand = replace(stand, scatter=fit(stand.best.residual, x, stand.road, passes.nuisances, stand.scatter))
    out = []
    linear = fitted_in(ring.blocks, gram, sets.best)
    for c in clear_forms(ring, sets, gram):
        at, name = [i for m in c.own for i in ring.blocks[m].columns], ring.mechanism(c.first).name
        form = ring.functions[:, :, [i - k for i in at]] @ linear.mean[[linear.columns.index(i) for i in at]]
        # share of the variance, where the mechanism acts, that the form explains
        there = _channels(passes.names)[name]
        share = max(1.0 - float(np.nanvar((stand.y - form)[:, there]) / np.nanvar(stand.y[:, there])), 0.0)
        out.append(described(ring, sets, gram, linear, c, name, share, seed))
    return tuple(out), stand


def _options(ring: _Ring, stand: _Stand, nothing: Refit) -> tuple[Option, ...]:
    """The sets that hold most of the posterior, refitted, with the evidence about their own values."""
    sets = ring.sets(ring.known, gram := stand.gram(ring.passes))
    enough = 1 + int(np.searchsorted(np.cumsum(sets.probability), COVERED))
    chosen = [members for members, _ in sets.sets[: min(enough, REFITTED)] if members]
    refits = [(members, _refitted(ring, stand, members, gram)) for members in chosen]
    out = []
    for members, r in [((), nothing), *(x for x in refits if not x[1].at_bound)]:
        gram = inner(r.x, r.at_start, ring.passes.nuisances, stand.scatter.weight)
        state = joined(gram, placed([ring.known[m] for m in members]), range(len(members)))
        out.append(Option(r, state.evidence - 0.5 * float(gram[-1, -1])))
    return tuple(sorted(out, key=lambda o: -o.evidence))


def _shapes_of(passes: Passes) -> tuple[tuple[Shape, ...], FloatArray]:
    """Functions by which slip or resistance may depart from the model, and their columns (g, c, K) at a usual size."""
    wet = np.asarray(np.isfinite(passes.values[:, -1]))
    shapes, columns = [], [np.zeros((*passes.values.shape, 0))]
    for name, channels in _channels(passes.names).items():
        usual = USUAL * float(np.sqrt(np.nanmean(passes.values[:, channels] ** 2)))
        unit = "m/s^2" if name == RESISTANCE else "-"
        mechanism = Mechanism(name, TITLES[name.removeprefix("slip_slope_")], name, unit, usual, 0.0, OVER)
        response = np.zeros((len(passes.names), 1))
        response[channels] = usual
        for names in OVER:
            found = basis(names, [passes.coordinates[n] for n in names], wet, 1.0)
            if found is not None:
                shapes.append(Shape(mechanism, names, found))
                columns.append(found.columns[:, None, :] * response)
    return tuple(shapes), np.concatenate(columns, axis=-1)


def _channels(names: Sequence[str]) -> dict[str, list[int]]:
    """Columns of the observations by what departs: an axle's slip, a side's, the resistance."""
    slips = [i for i, n in enumerate(names) if n.startswith("slip_slope_")]
    out = {f"slip_slope_{a}": [i for i in slips if names[i][-2] == a] for a in "fr"}
    out |= {f"slip_slope_{s}": [i for i in slips if names[i][-1] == s[0]] for s in ("left", "right")}
    out[RESISTANCE] = [names.index(RESISTANCE)]
    return {n: c for n, c in out.items() if c}
