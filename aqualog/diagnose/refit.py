"""Values and intervals of a set of effects, refitted in the simulator itself, and whether it explains something in
every third of the drive, and in the channels that it acts on."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aqualog.core.errors import ConfigError
from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import CHUNK, Arena, Part, products
from aqualog.diagnose.evidence import FARTHEST, Evidence
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in, with_free, with_values
from aqualog.diagnose.noise import Noise, Weighing, bridged, whitened
from aqualog.diagnose.words import name_of
from aqualog.model.term import Model, Term

__all__ = [
    "KNOWN", "PRIOR_WIDTH", "Metric", "Refit", "likeliest", "metric", "refit", "repeats", "secants", "silent",
    "strained",
]  # fmt: skip

KNOWN = 0.25  # share of the tolerances that values and intervals take into account
PRIOR_WIDTH = 3.0  # the prior is this much wider than the effect's: it only keeps huge, cancelling pairs apart
SHRINK = (1.0, 0.5, 0.2)
ROUNDS = 6
HOLDS = 0.1  # share by which a signature may miss its predicted gain before it is simulated again
ENOUGH = 0.3  # of twice the log-likelihood
SMALLEST = 1.0  # change, in steps of its parameter, from which a signature is simulated from the start to there
THIRDS = 3
SEEN = 2.0  # standard deviations at which a third of the drive says something of a value
# least share of what its values predict that an effect of the wheels must explain in their slip: right names have 0.37
# to 1.1, wrong ones at most 0.30, mostly less than nothing (S)
BY_WHEELS = 1.0 / 3.0
# what effects show one by one, over what they show together, from which on they cancel: ten right pairs of another
# simulator had 0.7 to 1.1, a torque gain with a trailer for a slip slope 12 (S)
CANCELS = 3.0
END = 0.999  # of a tolerance, from which on a value stands at its end
_ORDINAL = ("the first", "the second", "the last")


@dataclass(frozen=True, slots=True)
class Refit:
    """A set at its best values: `values` (k,) absolute, `off` (k,) from those of the model that it came on,
    `covariance` (k, k) without inflation, `loss` the sum of squares in the metric of noise and tolerances; `residuals`
    (C, n) and `signatures` (k, C, n) per drive there; `bounded` (k,): whether a value sits at its physical bound."""

    members: tuple[Hypothesis, ...]
    values: FloatArray
    off: FloatArray
    covariance: FloatArray
    loss: float
    model: Model
    residuals: tuple[FloatArray, ...]
    signatures: tuple[FloatArray, ...]
    bounded: tuple[bool, ...]

    @property
    def names(self) -> tuple[tuple[Hypothesis, str], ...]:
        """Effect and parameter of each value."""
        return tuple((h, n) for h in self.members for n in h.free)

    def before(self, drive: int, own: Sequence[int] | slice = slice(None)) -> FloatArray:
        """Residual (C, n) of a drive that a linear model about these values has without them, or some of them."""
        made = np.tensordot(self.off[own], self.signatures[drive][own], axes=1)
        return np.asarray(self.residuals[drive] + made)


@dataclass(frozen=True, slots=True)
class Metric:
    """Inner products under noise and tolerances: u' (I - A' M A) w for whitened rows; `A` (k, N), `M` (k, k); `allowed`
    (K,): standard deviations of the tolerances, `apart` (K,): those that are added to those of the values found
    instead; `coarse`: share of the log-likelihood that counts."""

    parts: tuple[Part, ...]
    weighings: tuple[Weighing, ...]
    A: FloatArray
    M: FloatArray
    allowed: FloatArray
    apart: FloatArray
    coarse: float = 1.0

    def rows(self, each: Sequence[FloatArray], kind: npt.DTypeLike = np.float64) -> FloatArray:
        """Arrays (k, C, n) of each drive as rows (k, N)."""
        found = [w.rows(each[p.drive][..., p.at], kind) for p, w in zip(self.parts, self.weighings, strict=True)]
        return np.asarray(np.concatenate(found, axis=1) * np.asarray(math.sqrt(self.coarse), dtype=kind))

    def inner(self, u: FloatArray, w: FloatArray) -> FloatArray:
        """Inner products of rows (a, N) and (b, N): (a, b)."""
        at_u = self.across(u)
        out = -at_u @ self.M @ (at_u if w is u else self.across(w)).T
        for i in range(0, u.shape[1], CHUNK):
            x = u[:, i : i + CHUNK].astype(np.float64, copy=False)
            out += x @ (x if w is u else w[:, i : i + CHUNK].astype(np.float64, copy=False)).T
        return np.asarray(out)

    def deviations(self, residuals: Sequence[FloatArray]) -> FloatArray:
        """What the tolerances most likely deviate by beside residuals (C, n) of each drive. (K,)"""
        out = np.zeros(self.allowed.size)
        k = self.allowed > 0.0
        out[k] = self.allowed[k] * (self.M @ self.across(self.rows([r[None] for r in residuals]))[0])
        return out

    def across(self, u: FloatArray) -> FloatArray:
        """Inner products of rows (a, N) with those of the tolerances, in double precision. (a, k)"""
        out = np.zeros((len(u), len(self.A)))
        for i in range(0, u.shape[1], CHUNK):
            out += u[:, i : i + CHUNK] @ self.A[:, i : i + CHUNK].T.astype(np.float64)
        return out


def metric(
    arena: Arena, weighings: Sequence[Weighing], *, share: float = 1.0, beside: Sequence[int] = (),
    coarse: float = 1.0,
) -> Metric:  # fmt: skip
    """Inner products under noise and a share of the tolerances, as in `Arena.tolerant`.

    Sets are compared with the full tolerances. Values are estimated with the share `KNOWN`: a fit that tolerates its
    own effect would look for it where it hardly shows. Tolerances of lanes always count in full, and so do the car's
    drive-to-drive spread and the errors of the file's own values. The columns `beside`, whose values are estimated, are
    an exception, and so is every effect that looks the same: their spread is added to the variance of the values
    (`Metric.apart`).
    """
    evidence = arena.evidence
    apart = np.zeros(evidence.count)
    apart[list(beside)] = evidence.as_values[list(beside)]
    owner = {c: h for h, columns in zip(evidence.asked, evidence.columns, strict=True) for c in columns}
    kinds = [(kind, owner[c].drive) for c, kind in enumerate(evidence.kinds)]
    sought = [kinds[c] for c in beside if kinds[c][0]]
    alike = [any(kind == k and o in ("", d) for k, o in sought) for kind, d in kinds]
    known = np.where(alike, 0.0, evidence.spread)
    known[list(beside)] = 0.0
    shares = np.array([share if owner[c].lane is None else 1.0 for c in range(evidence.count)])
    sd = np.maximum(shares * evidence.tolerance, known)
    k = np.flatnonzero(sd > 0.0)
    each = zip(arena.parts, weighings, strict=True)
    pieces = [w.rows(p.signatures[k] * sd[k, None, None], np.float32) for p, w in each]
    A = np.concatenate(pieces, axis=1) if len(pieces) > 1 else pieces[0]
    A *= np.float32(math.sqrt(coarse))
    M = np.asarray(np.linalg.inv(np.eye(len(A)) + products(A)))
    return Metric(arena.parts, tuple(weighings), A, M, sd, apart, coarse)


def likeliest(evidence: Evidence, measure: Metric, residuals: Sequence[FloatArray], model: Model) -> Model:
    """The model with what the car and its tyres differ by from their file, most likely beside these residuals (C, n).
    All tolerances deviate together, theta = (S^-2 + A'A)^-1 A'y, each up to `FARTHEST`; those of a drive or a lane, and
    less friction, with which wheels would spin, are left out. A term that the model has keeps its values. `measure`:
    with all tolerances in full."""
    owner = {c: h for h, columns in zip(evidence.asked, evidence.columns, strict=True) for c in columns}
    least = [0.0 if owner[c].effect.name == "friction" else -FARTHEST for c in range(evidence.count)]
    theta = np.clip(measure.deviations(residuals), least * measure.allowed, FARTHEST * measure.allowed)
    own, has = [], {(t.effect.name, t.place) for t in model.terms}
    for h, columns in zip(evidence.asked, evidence.columns, strict=True):
        stays = h.lane is None and h.effect.belongs in ("car", "tyre")
        if stays and theta[list(columns)].any() and (h.effect.name, h.where or h.effect.default) not in has:
            at = [(n, h.parameter(n), value_in(model, h, n) + theta[c]) for n, c in zip(h.free, columns, strict=True)]
            own.append((h, {n: min(max(float(x), p.low), p.high) for n, p, x in at}))
    return with_values(model, own)


def strained(evidence: Evidence, model: Model, settled: Model) -> tuple[Term, ...]:
    """Effects of sensors worth naming whose values `likeliest` has moved from a model as far as a tolerance goes: there
    a fault is as likely. Values of car and tyres at that end are nothing that can be checked."""
    out = []
    new = {(t.effect.name, t.place): t for t in settled.terms if t not in model.terms}
    for h, columns in zip(evidence.asked, evidence.columns, strict=True):
        term = new.get((h.effect.name, h.where or h.effect.default))
        if term is None or h.where is None or h.where in (*WHEELS, *AXLES, *SIDES):
            continue
        each = [(n, abs(term.values[n] - value_in(model, h, n)), c) for n, c in zip(h.free, columns, strict=True)]
        if any(x > END * FARTHEST * evidence.forgiven[c] and x >= h.worth_naming(n) for n, x, c in each):
            out.append(term)
    # several delays of one sign are that of another signal, such as a wheel speed that is the mean of its last interval
    late = [t for t in out if t.effect.name == "signal_delay"]
    is_shared = len(late) > 1 and len({t.values["delay"] > 0.0 for t in late}) == 1
    return tuple(t for t in out if not is_shared or t not in late)


def refit(evidence: Evidence, chosen: Sequence[int], start: FloatArray, measure: Metric, model: Model) -> Refit | None:
    """Gauss-Newton in the simulator from the linear values on; None if it has no solution within the bounds. `chosen`:
    hypotheses of the set; `start` (k,): changes of their values with which the search starts; `measure`: held fixed, so
    that sets can be compared; `model`: on which the set comes."""

    def tried_at(values: FloatArray) -> tuple[FloatArray, list[FloatArray], Model] | None:
        try:
            extended = with_free(model, members, values)
            residuals = [residual(d, extended) for d in evidence.drives]
        except ConfigError:
            return None
        return measure.rows([r[None] for r in residuals])[0], residuals, extended

    def loss_of(y: FloatArray, off: FloatArray) -> float:
        return float(measure.inner(y[None], y[None])[0, 0] + off @ off)

    def slopes(residuals: Sequence[FloatArray], extended: Model) -> tuple[FloatArray, ...]:
        own = zip(evidence.drives, residuals, strict=True)
        return tuple(np.concatenate(signatures(d, extended, members, base=r, each=True)) for d, r in own)

    members = tuple(evidence.asked[m] for m in chosen)
    columns = [c for m in chosen for c in evidence.columns[m]]
    base = np.array([value_in(model, h, n) for h in members for n in h.free])
    low, high = base + evidence.low[columns], base + evidence.high[columns]
    width = PRIOR_WIDTH * evidence.prior[columns]
    J = measure.rows([s[columns] for s in evidence.signatures])  # (k, N): change of the residual by one unit
    for shrink in SHRINK:
        # slip goes with one over the slip stiffness: half of it left is, by a straight line, nothing left
        values = np.clip(base + shrink * start, low, high)
        found = tried_at(values)
        if found is not None:
            break
    else:
        return None
    y, residuals, extended = found
    loss = loss_of(y, (values - base) / width)
    fresh, here = False, None  # whether J still predicts; the slopes, where they were simulated at these values
    for _ in range(ROUNDS):
        P = np.diag(width**-2.0)
        G = measure.inner(J, J) + P
        step = np.linalg.solve(G, measure.inner(J, y[None])[:, 0] - (values - base) / width**2)
        promised = float(step @ G @ step)
        won = 0.0
        for shrink in SHRINK if promised >= ENOUGH else ():
            new = np.clip(values + shrink * step, low, high)
            tried = tried_at(new)
            if tried is None:
                continue
            won = loss - loss_of(tried[0], (new - base) / width)
            if won > 0.0:
                y, residuals, extended = tried
                values, loss, here = new, loss - won, None
                break
            if not fresh:
                break
        if won > 0.0:
            # as good as the signature predicted: it is still valid here
            fresh = fresh and shrink == 1.0 and abs(won - promised) < HOLDS * promised
        elif fresh:
            break
        if not fresh:
            here = slopes(residuals, extended)
            J, fresh = measure.rows(here), True
    if here is None:
        here = slopes(residuals, extended)
        J = measure.rows(here)
    covariance = np.linalg.inv(measure.inner(J, J) + np.diag(width**-2.0)) + np.diag(measure.apart[columns] ** 2)
    bounded = tuple(bool(x) for x in (values <= low + 1e-12) | (values >= high - 1e-12))
    off = values - base
    loss -= float(((off / width) ** 2).sum())
    return Refit(members, values, off, np.asarray(covariance), loss, extended, tuple(residuals), here, bounded)


def secants(evidence: Evidence, found: Refit, model: Model) -> tuple[FloatArray, ...]:
    """Signatures (k, C, n) per drive from each value's start to where it was found, the others where they were found.
    The slope stays where nothing changed, and where a signal is shifted: its noise would correlate with itself."""
    out = [s.copy() for s in found.signatures]
    for k, ((h, _), off) in enumerate(zip(found.names, found.off.tolist(), strict=True)):
        if h.effect.drive.is_shift or abs(off) < SMALLEST * h.parameter(found.names[k][1]).step:
            continue
        values = found.values.copy()
        values[k] -= off
        try:
            without = with_free(model, found.members, values)
            for own, d, r in zip(out, evidence.drives, found.residuals, strict=True):
                own[k] = (residual(d, without) - r) / off
        except ConfigError:
            continue
    return tuple(out)


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
            is_seen = min(abs(off[k]), abs(alone[k])) > SEEN * sd[k]
            if (h.key, h.drive) in names and is_seen and alone[k] * off[k] < 0.0:
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


def silent(refit: Refit, arena: Arena, noises: Sequence[Noise], measure: Metric) -> frozenset[str]:
    """Names in a refitted set that are worth naming but do not make the measurement likelier, each beside the others
    and what the file allows; what needs wheel speeds must do so in their channels."""
    theta = measure.deviations(refit.residuals)
    allowed = [np.tensordot(theta, s, axes=1) for s in arena.evidence.signatures]
    G, b = (x.sum(axis=0) for x in _by_third(refit, arena, noises, allowed))
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


def _by_third(
    refit: Refit, arena: Arena, noises: Sequence[Noise], allowed: Sequence[FloatArray] = ()
) -> tuple[FloatArray, FloatArray]:
    """Inner products of the set's signatures, and theirs with the residual before it, less what is `allowed` of each
    drive, by thirds of the used time and by channel, (3, C, k, k) and (3, C, k)."""
    k, count = len(refit.off), len(arena.evidence.drives[0].channels)
    G, b = np.zeros((THIRDS, count, k, k)), np.zeros((THIRDS, count, k))
    for part, noise in zip(arena.parts, noises, strict=True):
        before = refit.before(part.drive) - (allowed[part.drive] if allowed else 0.0)
        own = np.concatenate([refit.signatures[part.drive], before[None]])[..., part.at]
        rows = whitened(bridged(own, part.mask), noise).reshape(own.shape)
        third = np.minimum(THIRDS * np.cumsum(part.mask) // max(int(part.mask.sum()), 1), THIRDS - 1)
        for t in range(THIRDS):
            x = rows[..., third == t].transpose(1, 0, 2)
            G[t] += x[:, :k] @ x[:, :k].transpose(0, 2, 1)
            b[t] += (x[:, :k] @ x[:, k, :, None])[..., 0]
    return G, b
