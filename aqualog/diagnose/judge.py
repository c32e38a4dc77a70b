"""From refitted causes and the competition to the verdict: probabilities, and what a name must stand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.compete import Posterior, fitted
from aqualog.diagnose.hypotheses import Hypothesis, value_in, with_values
from aqualog.diagnose.noise import Noise, bridged, spectra, whitened
from aqualog.diagnose.outcome import EXPLAINS, Outcome, Z
from aqualog.diagnose.probability import SURE, tempered
from aqualog.diagnose.records import Alternative, Cause, Estimate, Remainder
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.words import cause_sentence, name_of
from aqualog.model.term import Model

__all__ = ["judged", "repeats", "with_causes"]

THIRDS = 3
SEEN = 2.0  # standard deviations at which a third of the drive says something of a value


def judged(
    outcome: Outcome,
    forms: Sequence[Remainder],
    arena: Arena,
    posterior: Posterior,
    model: Model,
    failed: Sequence[str],
) -> Outcome:
    """The verdict with probabilities.

    An unknown form comes before any name; beside it stand the effects of the same set whose probability is 0.95 or
    more. A name needs that probability too and must not have `failed` a check. Else the answer is what the posterior
    consists of, up to 0.95.
    """
    if forms:
        beside = tuple(
            c for c, large in _linear(arena, posterior, posterior.best, model)
            if large and c.probability >= SURE
        )  # fmt: skip
        return Outcome("unexplained", beside, (), None, outcome.small, frozenset(c.effect for c in beside))
    causes = tuple(_with_probability(c, posterior) for c in outcome.causes)
    others = tuple(
        replace(a, causes=tuple(_with_probability(c, posterior) for c in a.causes)) for a in outcome.alternatives
    )
    outcome = outcome._replace(causes=causes, alternatives=others)
    if outcome.verdict not in ("named", "compound"):
        return outcome
    small = tuple(f"Not named: {reason}" for reason in failed)
    unsure = [c for c in causes if c.probability < SURE]
    if not unsure and not failed:
        return outcome
    rivals = _rivals(arena, posterior, model, frozenset(c.effect for c in causes))
    shown = {c.effect: c for a in reversed(rivals) for c in a.causes} | {c.effect: c for c in causes}
    first = [c.effect for c in causes]
    ordered = tuple(shown[e] for e in (*first, *(e for e in shown if e not in first)))
    certain = frozenset() if failed else frozenset(c.effect for c in causes if c not in unsure)
    return outcome._replace(
        verdict="cannot_tell", causes=ordered, alternatives=rivals, small=(*outcome.small, *small), certain=certain
    )


def _with_probability(cause: Cause, posterior: Posterior) -> Cause:
    return replace(cause, probability=tempered(posterior.marginal.get(cause.effect, 0.0)))


def _rivals(arena: Arena, posterior: Posterior, model: Model, own: frozenset[str]) -> tuple[Alternative, ...]:
    """Other sets of known effects of the posterior, one for each set of names, up to 0.95 in sum."""
    out: list[Alternative] = []
    seen = {own, frozenset[str]()}
    total, best = 0.0, posterior.sets[0][1]
    for (members, evidence), q in zip(posterior.sets, posterior.probability.tolist(), strict=True):
        if total >= SURE:
            break
        total += q
        causes = tuple(c for c, large in _linear(arena, posterior, members, model) if large)
        names = frozenset(c.effect for c in causes)
        if names not in seen:
            seen.add(names)
            out.append(Alternative(causes, math.exp(min(best - evidence, 700.0))))
    return tuple(out)


def _linear(arena: Arena, posterior: Posterior, members: Sequence[int], model: Model) -> list[tuple[Cause, bool]]:
    """The known effects of a set with their values in the competition, and whether each is worth naming."""
    if not members:
        return []
    fit = fitted(arena, posterior.tolerant, members)
    sd = np.sqrt(np.diag(fit.covariance)) * arena.sd[fit.columns]
    mean = fit.mean * arena.sd[fit.columns]
    out = []
    for m in members:
        block = arena.blocks[m]
        if block.kind != "effect":
            continue
        h = arena.evidence.asked[block.tag]
        parameters, large = {}, False
        for name, c in zip(h.free, block.columns, strict=True):
            k = fit.columns.index(c)
            p, off = h.parameter(name), float(mean[k])
            v = min(max(value_in(model, h, name) + off, p.low), p.high)
            half = Z * float(sd[k])
            parameters[name] = Estimate(v, max(v - half, p.low), min(v + half, p.high), p.unit)
            large |= abs(off) >= max(h.worth_naming(name), half)
        for name, value in h.fixed.items():
            if name in {p.name for p in h.effect.parameters} and name not in parameters:
                parameters[name] = Estimate(float(value), math.nan, math.nan, h.parameter(name).unit)
        explains = _explains(arena, block.columns, mean[[fit.columns.index(c) for c in block.columns]])
        cause = Cause(
            h.effect.name, h.where, parameters, explains, cause_sentence(h.effect, h.where, parameters)
        )  # fmt: skip
        out.append((_with_probability(cause, posterior), large))
    return out


def _explains(arena: Arena, columns: Sequence[int], theta: FloatArray) -> tuple[str, ...]:
    """Channels whose rms is less without what these columns make."""
    part = arena.parts[0]
    made = np.tensordot(theta, part.signatures[list(columns)], axes=1)[:, part.mask]
    y = part.residual[:, part.mask]
    before, after = (np.sqrt((x**2).mean(axis=1)) for x in (y, y - made))
    gain = before / np.maximum(after, 1e-15) - 1.0
    names = tuple(c for c, g in zip(part.channels, gain.tolist(), strict=True) if g > EXPLAINS)
    return names or (part.channels[int(np.argmax(gain))],)


def with_causes(model: Model, causes: Sequence[Cause], asked: Sequence[Hypothesis]) -> Model:
    """The model with causes at their values."""
    found = []
    for c in causes:
        values = {n: e.value for n, e in c.parameters.items()}
        for h in asked:
            if h.key == c.key and all(values.get(n, v) == v for n, v in h.fixed.items()):
                found.append((h, {n: values[n] for n in h.free}))
                break
    return with_values(model, found)


def repeats(refit: Refit, arena: Arena, noises: Sequence[Noise], model: Model) -> tuple[str, ...]:
    """What speaks against naming the members of a refitted set; empty if nothing does.

    Each third of the drives that says something of a value must give it the same sign, and must be predicted better
    with the values of the other two thirds than without the set.
    """
    off = np.array(
        [v - value_in(model, refit.members[i], n) for (i, n), v in zip(refit.names, refit.values, strict=True)]
    )
    G, b = _by_third(refit, arena, noises, off)
    prior = np.diag(np.array([refit.members[i].parameter(n).sigma for i, n in refit.names]) ** -2.0)
    out = []
    total = 0.0
    for t in range(THIRDS):
        own = np.linalg.inv(G[t] + prior)
        alone, sd = own @ b[t], np.sqrt(np.diag(own))
        for k, (i, _) in enumerate(refit.names):
            if abs(off[k]) > SEEN * sd[k] and alone[k] * off[k] < 0.0 and abs(alone[k]) > SEEN * sd[k]:
                h = refit.members[i]
                out.append(f"{name_of(h.effect.name, h.where)} has the other sign in {_ORDINAL[t]} third of the drive.")
        rest = [o for o in range(THIRDS) if o != t]
        others = np.linalg.solve(sum(G[o] for o in rest) + prior, sum(b[o] for o in rest))
        total += float(2.0 * b[t] @ others - others @ G[t] @ others)
    if total <= 0.0:
        names = ", ".join(name_of(h.effect.name, h.where) for h in refit.members)
        out.append(f"{names}: two thirds of the drive do not predict the other third better with it.")
    return tuple(out)


_ORDINAL = ("the first", "the second", "the last")


def _by_third(
    refit: Refit, arena: Arena, noises: Sequence[Noise], off: FloatArray
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Inner products of the set's signatures, and theirs with the residual before it, by thirds of the used time."""
    k = len(off)
    G, b = [np.zeros((k, k)) for _ in range(THIRDS)], [np.zeros(k) for _ in range(THIRDS)]
    for drive, noise, after, own in zip(arena.evidence.drives, noises, refit.residuals, refit.signatures, strict=True):
        before = after + np.tensordot(off, own, axes=1)
        rows = whitened(spectra(bridged(np.concatenate([own, before[None]]), drive.mask)), noise)
        rows = rows.reshape(k + 1, *after.shape)
        third = np.minimum(THIRDS * np.cumsum(drive.mask) // max(int(drive.mask.sum()), 1), THIRDS - 1)
        for t in range(THIRDS):
            x = rows[..., third == t].reshape(k + 1, -1)
            G[t] += x[:k] @ x[:k].T
            b[t] += x[:k] @ x[k]
    return G, b
