"""What a name must stand: the same sign in each third of a drive, and thirds that predict each other."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.hypotheses import value_in
from aqualog.diagnose.noise import Noise, bridged, whitened
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.words import name_of
from aqualog.model.term import Model

__all__ = ["repeats"]

THIRDS = 3
SEEN = 2.0  # standard deviations at which a third of the drive says something of a value


def repeats(
    refit: Refit, arena: Arena, noises: Sequence[Noise], model: Model, names: Container[str]
) -> tuple[str, ...]:  # fmt: skip
    """What speaks against naming some members of a refitted set, by their keys; empty if nothing does.

    Each third of the drives that says something of a value must give it the same sign, and must be predicted better
    with the values of the other two thirds than without the set. No value may stand at its physical bound.
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
            is_named = refit.members[i].key in names
            if is_named and abs(off[k]) > SEEN * sd[k] and alone[k] * off[k] < 0.0 and abs(alone[k]) > SEEN * sd[k]:
                h = refit.members[i]
                out.append(f"{name_of(h.effect.name, h.where)} has the other sign in {_ORDINAL[t]} third of the drive.")
        rest = [o for o in range(THIRDS) if o != t]
        others = np.linalg.solve(sum(G[o] for o in rest) + prior, sum(b[o] for o in rest))
        total += float(2.0 * b[t] @ others - others @ G[t] @ others)
    if total <= 0.0:
        every = ", ".join(name_of(h.effect.name, h.where) for h in refit.members)
        out.append(f"{every}: two thirds of the drive do not predict the other third better with it.")
    if any(at and refit.members[i].key in names for (i, _), at in zip(refit.names, refit.bounded, strict=True)):
        out.append("a value stands at its physical bound.")
    return tuple(out)


_ORDINAL = ("the first", "the second", "the last")


def _by_third(
    refit: Refit, arena: Arena, noises: Sequence[Noise], off: FloatArray
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Inner products of the set's signatures, and theirs with the residual before it, by thirds of the used time."""
    k = len(off)
    G, b = [np.zeros((k, k)) for _ in range(THIRDS)], [np.zeros(k) for _ in range(THIRDS)]
    for part, noise in zip(arena.parts, noises, strict=True):
        own, after = refit.signatures[part.drive][..., part.at], refit.residuals[part.drive][:, part.at]
        before = after + np.tensordot(off, own, axes=1)
        rows = whitened(bridged(np.concatenate([own, before[None]]), part.mask), noise)
        rows = rows.reshape(k + 1, *after.shape)
        third = np.minimum(THIRDS * np.cumsum(part.mask) // max(int(part.mask.sum()), 1), THIRDS - 1)
        for t in range(THIRDS):
            x = rows[..., third == t].reshape(k + 1, -1)
            G[t] += x[:k] @ x[:k].T
            b[t] += x[:k] @ x[k]
    return G, b
