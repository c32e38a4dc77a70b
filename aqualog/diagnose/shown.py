"""Whether a refitted set explains something in every third of the drive, and in the channels that it acts on."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.noise import Noise, bridged, whitened
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.words import name_of

__all__ = ["repeats", "silent"]

THIRDS = 3
SEEN = 2.0  # standard deviations at which a third of the drive says something of a value
# least share of what its values predict that an effect of the wheels must explain in their slip: right names have 0.37
# to 1.1, wrong ones at most 0.30, mostly less than nothing (S)
BY_WHEELS = 1.0 / 3.0
# what effects show one by one, over what they show together, from which on they cancel: ten right pairs of another
# simulator had 0.7 to 1.1, a torque gain with a trailer for a slip slope 12 (S)
CANCELS = 3.0
_ORDINAL = ("the first", "the second", "the last")


def repeats(refit: Refit, arena: Arena, noises: Sequence[Noise], names: Container[tuple[str, str]]) -> tuple[str, ...]:
    """What speaks against naming some members of a refitted set, by their keys and drives; empty if nothing does. Each
    third of the drives must give a value the same sign, if any, and must be predicted better with the values of the
    others than without the set. No value may stand at its physical bound, and effects must not cancel each other."""
    off = refit.off
    G, b = (x.sum(axis=1) for x in _by_third(refit, arena, noises))
    prior = np.diag(np.array([h.parameter(n).sigma for h, n in refit.names]) ** -2.0)
    out = []
    total = 0.0
    for t in range(THIRDS):
        own = np.linalg.inv(G[t] + prior)
        alone, sd = own @ b[t], np.sqrt(np.diag(own))
        for k, (h, _) in enumerate(refit.names):
            if (
                (h.key, h.drive) in names
                and abs(off[k]) > SEEN * sd[k]
                and alone[k] * off[k] < 0.0
                and abs(alone[k]) > SEEN * sd[k]
            ):
                out.append(f"{name_of(h.effect.name, h.where)} has the other sign in {_ORDINAL[t]} third of the drive.")
        rest = [o for o in range(THIRDS) if o != t]
        others = np.linalg.solve(sum(G[o] for o in rest) + prior, sum(b[o] for o in rest))
        total += float(2.0 * b[t] @ others - others @ G[t] @ others)
    if total <= 0.0:
        every = ", ".join(name_of(h.effect.name, h.where) for h in refit.members)
        out.append(f"{every}: two thirds of the drive do not predict the other third better with it.")
    whole = G.sum(axis=0)
    each = np.array([np.where([owner is h for owner, _ in refit.names], off, 0.0) for h in refit.members])
    if float(np.einsum("hi,ij,hj->", each, whole, each)) > CANCELS * float(off @ whole @ off):
        out.append("the effects cancel each other for the most part: together they stand for something else.")
    if any(at and (h.key, h.drive) in names for (h, _), at in zip(refit.names, refit.bounded, strict=True)):
        out.append("a value stands at its physical bound.")
    return tuple(out)


def silent(refit: Refit, arena: Arena, noises: Sequence[Noise]) -> frozenset[str]:
    """Names in a refitted set that are worth naming but do not make the measurement likelier, each beside the others;
    what needs wheel speeds must do so in their channels."""
    G, b = (x.sum(axis=0) for x in _by_third(refit, arena, noises))
    # without a reference velocity they are those between axles and sides
    wheels = np.array(["slip" in c for c in arena.evidence.drives[0].channels])
    out = set()
    for h in refit.members:
        k = [i for i, (owner, _) in enumerate(refit.names) if owner is h]
        off = refit.off[k]
        predicted = 0.5 * np.einsum("i,cij,j->c", off, G[:, k][:, :, k], off)
        gain = (b[:, k] - G[:, k] @ refit.off) @ off + predicted
        shown = gain[wheels].sum() >= BY_WHEELS * predicted[wheels].sum()
        large = any(abs(x) >= h.worth_naming(n) for x, n in zip(off.tolist(), h.free, strict=True))
        if large and (gain.sum() <= 0.0 or ("wheel speeds" in h.effect.drive.needs and not shown)):
            out.add(h.name)
    return frozenset(out)


def _by_third(refit: Refit, arena: Arena, noises: Sequence[Noise]) -> tuple[FloatArray, FloatArray]:
    """Inner products of the set's signatures, and theirs with the residual before it, by thirds of the used time and by
    channel, (3, C, k, k) and (3, C, k)."""
    k, count = len(refit.off), len(arena.evidence.drives[0].channels)
    G, b = np.zeros((THIRDS, count, k, k)), np.zeros((THIRDS, count, k))
    for part, noise in zip(arena.parts, noises, strict=True):
        own = np.concatenate([refit.signatures[part.drive], refit.before(part.drive)[None]])[..., part.at]
        rows = whitened(bridged(own, part.mask), noise).reshape(own.shape)
        third = np.minimum(THIRDS * np.cumsum(part.mask) // max(int(part.mask.sum()), 1), THIRDS - 1)
        for t in range(THIRDS):
            x = rows[..., third == t].transpose(1, 0, 2)
            G[t] += x[:, :k] @ x[:, :k].transpose(0, 2, 1)
            b[t] += (x[:, :k] @ x[:, k, :, None])[..., 0]
    return G, b
