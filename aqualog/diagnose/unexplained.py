"""Unknown forms that a competition has found: of what mechanism, over which coordinate, how large, like which one.

A force that changes over minutes is found apart: an error of the accelerometer is in force balance and kinematic
channel alike, a slope in the kinematic one alone, a force in the force balance alone. What remains is compared with
what forces on measured cars wander by anyway: gusts, bends, the road's surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.arena import SHAPE_PRIOR, TOLERATED, Arena, Field, unit_force
from aqualog.diagnose.channels import CHANNELS, block_step, contrasts
from aqualog.diagnose.compete import Fitted, Posterior
from aqualog.diagnose.competition import Block, Sets, evidence_of, fitted_in
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.hypotheses import WORTH
from aqualog.diagnose.records import SURE, Remainder, tempered
from aqualog.diagnose.shapes import ALONG, MECHANISMS, Mechanism
from aqualog.diagnose.unknown_term import ALIKE as SAME
from aqualog.diagnose.unknown_term import describe, form_of
from aqualog.model.term import Model

__all__ = ["MOST", "Clear", "clear_forms", "described", "outshone", "slow_force", "unknown_forms"]

AHEAD = 3.0  # [nats (natural logarithm)] that the best set must be ahead of the best one without unknown shapes
OUTSHONE = 0.25  # probability beside unknown forms, below which an effect is not named (K)
PART = 0.2  # of what the best set explains
NEEDED = 12.0  # [nats] that the best set loses, with their prior, without forms of which each explains less
WORTH_TELLING = 0.05  # of a channel's variance that a shape must explain
LEAST = {"m/s^2": 0.01, "m/s": 0.02, "N": 20.0}  # rms of what is large, by the channel's unit
# share of these from which a function that is certain counts: on drives without effects slips over the torque of 0.008
# to 0.010 m/s were certain, of hidden ones 0.0175 (D)
LITTLE = 0.5
LITTLE_ELSEWHERE = 0.3  # the same over coordinates along which simulators have no offsets (D)
PLAIN = 0.15  # of a channel's variance: a force that explains this much is no offset in one kind of driving (D)
ALIKE = 0.2  # share of the best one's probability from which the drive cannot distinguish another coordinate or axle
ERRS = frozenset({*TOLERATED, "since_braking", *ALONG})  # coordinates along which simulators have offsets
_SLIPS = tuple(f"slip_{w}" for w in WHEELS)
# most that is said of a form: what the library of forms lacks looks like another one. Of 59 that stood first with 0.95
# and more on sealed drives 48 were right in mechanism and coordinate, of kinds that nobody had seen 5 of 15 (S)
MOST = 0.75
DRAWS, LEVEL = 400, 0.95  # of the function, for a band that holds at all points together
WINDOW_S, LEAST_USED, LEAST_WINDOWS = 10.0, 0.3, 12  # of a mean; share of it that is used; windows of a drive
USUAL = 0.012  # [m/s^2] sd by which forces wander: of measured trips of one car the largest has 0.012, most 0.005 (S)
MOST_ALIKE = 0.95  # correlation of neighbouring windows, at most: 39 of them count as one then (K)
OVER = ("v_x", "torque")  # of the coordinates whose functions compete already, those with which forces change most


class Clear(NamedTuple):
    """A mechanism that no known effect replaces: its blocks, `first` the most needed one, and its probability.
    `instead`: mechanisms of its family that the drive cannot distinguish from it; `without`: their blocks in the best
    set, which does as well with this one alone. `loss`: what the best set loses without it [nats (natural logarithm)].
    """

    own: tuple[int, ...]
    first: int
    probability: float
    instead: tuple[Mechanism, ...]
    without: tuple[int, ...]
    loss: float


def clear_forms(
    field: Field, found: Sets, inner: FloatArray, shows: Callable[[tuple[int, ...]], bool] = lambda _: True
) -> list[Clear]:
    """Mechanisms of the best set that no known effect replaces, what explains most first. One counts if its family has
    a share of 0.95 of the posterior, the best set is e^3 times as likely as every set of known effects, its blocks show
    in the drives, and it explains a fifth of what the set explains. What a family explains together is its most needed
    mechanism's."""
    blocks, best = field.blocks, found.best
    known = max(e for members, e in found.sets if all(blocks[m].kind != "shape" for m in members))
    if found.sets[0][1] - known < AHEAD:
        return []
    sure = [m for m in best if blocks[m].kind == "shape" and found.marginal[field.name(m)] >= SURE]
    # over two coordinates that go together, either could be left out; the mechanism could not
    each = [tuple(m for m in sure if field.mechanism(m) == n) for n in dict.fromkeys(map(field.mechanism, sure))]
    clear = [own for own in each if shows(own)]
    hidden = {m for own in each if own not in clear for m in own}

    def evidence(without: Container[int]) -> float:
        return evidence_of(blocks, inner, [m for m in best if m not in without])

    whole, counted = evidence(()), evidence(hidden)
    out = []
    for family in dict.fromkeys(field.name(own[0]) for own in clear):
        together = [own for own in clear if field.name(own[0]) == family]
        lost = {own: whole - evidence(own) for own in together}
        needed = [own for own in together if lost[own] >= PART * counted]
        large = whole - evidence([m for own in together for m in own]) >= PART * counted
        if not needed and large:
            needed = [own for own in together if lost[own] + sum(blocks[m].log_prior for m in own) >= NEEDED]
        # where the set does as well without any one of them, it is one of them
        alike = [] if needed else [o[0] for o in together]
        if not needed and large:
            needed = [max(together, key=lambda own: lost[own])]
        for own in needed:
            first = min(own, key=lambda m: evidence((m,)))
            probability, instead = _of_mechanism(field, found, first, alike)
            without = tuple(m for o in together if alike and o is not own for m in o)
            out.append(Clear(own, first, tempered(probability / max(len(alike), 1)), instead, without, lost[own]))
    return sorted(out, key=lambda c: -c.loss)


def _of_mechanism(
    field: Field, found: Sets, block: int, alike: Sequence[int]
) -> tuple[float, tuple[Mechanism, ...]]:  # fmt: skip
    """Share of the sets with a block's mechanism, and those of its family that sets have instead of it; `alike`: of
    these blocks of the best set each may be the one."""
    share, others = 0.0, {field.mechanism(m): math.inf for m in alike}
    beside = {field.mechanism(m) for m in found.best if field.blocks[m].kind == "shape"} - others.keys()
    for (members, _), q in zip(found.sets, found.probability.tolist(), strict=True):
        family = [m for m in members if field.blocks[m].kind == "shape" and field.name(m) == field.name(block)]
        mechanisms = dict.fromkeys(map(field.mechanism, family))
        if field.mechanism(block) in mechanisms:
            share += q
        else:
            others |= {m: others.get(m, 0.0) + q for m in mechanisms if m not in beside}
    return share, tuple(m for m, q in others.items() if q >= ALIKE * share and m is not field.mechanism(block))


def unknown_forms(arena: Arena, posterior: Posterior, *, seed: int) -> tuple[Remainder, ...]:
    """Shapes of the best set that no known effect replaces, what explains most first; empty if none is that clear.

    Beside the conditions of `clear_forms`, a mechanism must explain 5 % of what the others leave of a channel, or of a
    difference between axles or sides, and that must be large. Half is enough for a smooth function that surely reaches
    twice what a car and its simulation differ by anyway; one that may be smaller everywhere, or constant, is no
    finding. And no effect of the library may look like it.
    """
    whole = fitted_in(arena.blocks, posterior.tolerant, posterior.best)

    def shows(own: tuple[int, ...]) -> bool:
        return _where(arena, own, posterior.best, whole)[1] > WORTH_TELLING

    found = []
    for c in clear_forms(arena, posterior, posterior.tolerant, shows):
        members = [m for m in posterior.best if m not in c.without]
        fit = fitted_in(arena.blocks, posterior.tolerant, members)
        size, share, channel = _where(arena, c.own, members, fit)
        form = described(arena, posterior, posterior.gram, fit, c, channel, share, seed)
        sure = math.inf if form.manner else _surely(arena, fit, c.first, seed)
        allowed = arena.mechanism(c.first).allowed
        is_sure = not form.manner and sure >= WORTH * allowed
        little = LITTLE if ERRS.intersection(form.depends_on) else LITTLE_ELSEWHERE
        is_large = size > (little if is_sure else 1.0) and sure > allowed
        if is_large and share > WORTH_TELLING and form.cosine <= SAME:
            found.append(form)
    return tuple(found)


def outshone(arena: Arena, posterior: Posterior) -> dict[str, str]:
    """Effects in whose place a form stands in nearly all of the posterior, though not as clearly as it takes to report
    it, by name, with the form in words."""
    whole = fitted_in(arena.blocks, posterior.tolerant, posterior.best)
    forms = [m for m in posterior.best if arena.blocks[m].kind == "shape"]
    shown = [m for m in forms if _where(arena, (m,), posterior.best, whole)[1] > WORTH_TELLING]
    if not shown:
        return {}
    words = form_of(arena.shapes[arena.blocks[shown[0]].tag])
    names = {arena.name(i) for i, b in enumerate(arena.blocks) if b.kind == "effect"}
    return {n: words for n in names if posterior.marginal.get(n, 0.0) < OUTSHONE}


def _surely(field: Field, fit: Fitted, block: int, seed: int) -> float:
    """Least size that a function surely has somewhere, or its deviation from its mean over the points: a constant may
    be known less well than how it changes."""
    at, mean, covariance, supported = _function(field, fit, block)
    centred = at - at[supported].mean(axis=0)
    sizes = [np.abs(a @ mean) - _band(a, covariance, supported, seed) for a in (at, centred)]
    return max(float(x[supported].max(initial=0.0)) for x in sizes)


def _function(field: Field, fit: Fitted, block: int) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Rows of a block's function at its points (k, n), its values (n,) with their covariance, and where data are."""
    b = field.blocks[block]
    basis, own = field.shapes[b.tag].basis, [fit.columns.index(c) for c in b.columns]
    at = basis.at_points * field.sd[list(b.columns)]
    return at, fit.mean[own], fit.covariance[np.ix_(own, own)], basis.supported


def _where(arena: Arena, members: Sequence[int], best: Sequence[int], fit: Fitted) -> tuple[float, float, str]:
    """Rms of what shapes explain over what is large, the largest share of the variance that the others leave of a
    channel, and that channel.

    Between axles and sides the reference velocity's noise, which is in the slip of all wheels, cancels. What the wheels
    do must show in their slip. A smooth function of speed, torque or braking must explain some of the variance where
    half of its energy is, too: else it is an offset in one kind of driving, as simulators have it. A force that
    explains much of a channel counts in any case.
    """
    channels = arena.parts[0].channels
    names, turned = _with_differences(channels)
    left, made = [], []
    for i, p in enumerate(arena.parts):
        drawn = {m: _drawn(arena, i, m, fit) for m in best}
        others = sum((x for m, x in drawn.items() if m not in members), np.zeros_like(p.residual))
        left.append(turned @ (p.residual - others)[:, p.mask])
        made.append(turned @ sum((drawn[m] for m in members), np.zeros_like(p.residual))[:, p.mask])
    y, f = np.concatenate(left, axis=1), np.concatenate(made, axis=1)
    share = _share(y, f, np.ones_like(f))
    rms = np.sqrt((f**2).mean(axis=1))
    own, is_force = [arena.shapes[arena.blocks[m].tag] for m in members], arena.mechanism(members[0]).name == "force"
    if not any(s.manner for s in own) and any(ERRS.intersection(s.coordinates) for s in own):
        varies = _share(y, f, np.abs(f) >= _most(f)) > 0.0
        share = np.where(varies | (is_force & (share > PLAIN)), share, 0.0)
    size = [float(r / LEAST[CHANNELS[c].unit]) for r, c in zip(rms, names, strict=True)]
    of_wheels = arena.mechanism(members[0]).name.startswith(("slip", "radius"))
    every = [x for x in zip(size, share.tolist(), names, strict=True) if not of_wheels or "slip" in x[2]]
    # what is large first, then what counts if it is certain, then what explains most
    clear = [((q > WORTH_TELLING) * ((s > 1.0) + (s > LITTLE)), q) for s, q, _ in every]
    return every[clear.index(max(clear))] if every else (0.0, 0.0, channels[0])


def _most(f: FloatArray) -> FloatArray:
    """Size of each function (C, n) above which half of its energy is: where it acts, however seldom. (C, 1)"""
    size = np.sort(np.abs(f), axis=1)
    energy = np.cumsum(size**2, axis=1)
    at = (energy < 0.5 * energy[:, -1:]).sum(axis=1, keepdims=True)
    return np.asarray(np.take_along_axis(size, np.minimum(at, size.shape[1] - 1), axis=1))


def _share(y: FloatArray, f: FloatArray, weight: BoolArray | FloatArray) -> FloatArray:
    """Share of the variance of channels (C, n) that functions explain, over samples of this weight. (C,)"""

    def variance(x: FloatArray) -> FloatArray:
        total = weight.sum(axis=1)
        mean = (weight * x).sum(axis=1) / total
        return np.asarray((weight * (x - mean[:, None]) ** 2).sum(axis=1) / total)

    return np.asarray(1.0 - variance(y - f) / np.maximum(variance(y), 1e-30))


def _drawn(arena: Arena, part: int, member: int, fit: Fitted) -> FloatArray:
    block = arena.blocks[member]
    return np.tensordot(fit.mean[[fit.columns.index(c) for c in block.columns]], arena.drawn(part, block), axes=1)


def _with_differences(channels: tuple[str, ...]) -> tuple[list[str], FloatArray]:
    """Channels, and after them the differences of axles and sides where each wheel's slip is one. Names, rows (k, C)"""
    at = [i for i, c in enumerate(channels) if c in _SLIPS]
    rows = contrasts(channels)[at[1:]] if len(at) == len(_SLIPS) else np.zeros((0, len(channels)))
    names = [*channels, *("axle_slip", "side_slip_f", "side_slip_r")[: len(rows)]]
    return names, np.concatenate([np.eye(len(channels)), rows])


def described(
    field: Field, found: Sets, gram: FloatArray, fit: Fitted, clear: Clear, channel: str, share: float, seed: int
) -> Remainder:  # fmt: skip
    """A mechanism of the best set as a function with its band, from a fit of that set."""
    m, s = clear.first, field.shapes[field.blocks[clear.first].tag]
    at, mean, covariance, supported = _function(field, fit, m)
    f, half = (np.where(supported, x, np.nan) for x in (at @ mean, _band(at, covariance, supported, seed)))
    f, low, high = (s.mechanism.change(x) for x in (f, f - half, f + half))
    likely = [o for o, q in found.blocks.items() if field.blocks[o].kind == "shape" and q >= ALIKE * found.blocks[m]]
    over = [field.shapes[field.blocks[o].tag].coordinates for o in likely if field.mechanism(o) is s.mechanism]
    alike = sorted({n for c in over for n in c} - set(s.coordinates))
    nearest, cosine = _nearest(field.blocks, gram, m, mean)
    r = Remainder(
        channel, s.coordinates, share, math.nan, s.basis.points, f, low, high, tuple(alike), nearest, cosine,
        "", s.mechanism.name, s.mechanism.unit, min(clear.probability, MOST), s.manner,
    )  # fmt: skip
    return replace(r, sentence=describe(s.mechanism, r, clear.instead))


def _band(at: FloatArray, covariance: FloatArray, supported: BoolArray, seed: int) -> FloatArray:
    """Half width of a band that the function leaves nowhere with 95 %. (k,)"""
    sd = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", at, covariance, at), 1e-30))
    root = np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(len(covariance)))
    z = at @ root @ np.random.default_rng(seed).standard_normal((len(covariance), DRAWS))
    most = np.abs(z / sd[:, None])[supported].max(axis=0) if np.any(supported) else np.ones(1)
    return np.asarray(sd * float(np.quantile(most, LEVEL)))


def _nearest(blocks: Sequence[Block], gram: FloatArray, m: int, mean: FloatArray) -> tuple[str | None, float]:
    """The known effect whose signature is most alike, with the cosine."""
    c = list(blocks[m].columns)
    energy = float(mean @ gram[np.ix_(c, c)] @ mean)
    best: tuple[str | None, float] = (None, 0.0)
    for b in blocks:
        if b.kind != "effect" or len(b.columns) > 1 or energy <= 0.0:
            continue
        e = b.columns[0]
        cosine = abs(float(gram[e, c] @ mean)) / math.sqrt(max(energy * gram[e, e], 1e-30))
        if cosine > best[1]:
            best = (b.key, min(cosine, 1.0))
    return best


def slow_force(drive: Drive, left: FloatArray, model: Model) -> Remainder | None:
    """The form of a force over time in what a model leaves (C, m) of a drive; None unless its probability is 0.95. The
    evidence is that of a wander of a force's usual size against the usual wander, over windows that count as
    independent after their own correlation: n (1 - rho) / (1 + rho)."""
    if drive.course.lanes or not {"force_balance", "kinematic"} <= set(drive.channels):
        return None  # on water no law of drag is exact
    t, s, whole, apart = _wander(drive, left)
    near = np.diff(t) < 1.5 * WINDOW_S
    if s.size < LEAST_WINDOWS or near.sum() < LEAST_WINDOWS // 2:
        return None
    slow = float(np.mean((s[1:] * s[:-1])[near]))  # noise of a window is in no other one
    # a wandering accelerometer and a road agree by chance now and then, but mostly they differ
    if slow <= USUAL**2 or apart > float(np.mean(s**2)):
        return None
    rho = min(slow / float(np.mean(s**2)), MOST_ALIKE)
    kind = next(m for m in MECHANISMS if m.name == "force")
    as_force = kind.usual / drive.vehicle.mass
    each = math.log(USUAL / as_force) + 0.5 * slow * (USUAL**-2 - as_force**-2)
    nats = s.size * (1.0 - rho) / (1.0 + rho) * each + math.log(SHAPE_PRIOR)
    if nats < math.log(SURE / (1.0 - SURE)):
        return None
    chance = 1.0 / (1.0 + math.exp(-nats))
    y, at = left[drive.channels.index("force_balance")], np.arange(left.shape[1]) * block_step(drive.dt)
    used = y[drive.mask]
    share = 1.0 - float(np.var(used - np.interp(at, t, whole)[drive.mask]) / max(np.var(used), 1e-30))
    if share <= WORTH_TELLING:
        return None
    try:
        by_newton = float(np.mean(unit_force(drive, model, left)[0][drive.mask]))
    except ConfigError:
        return None
    f = whole / by_newton
    # second differences of a slow function are those of its noise, with six times its variance
    noise = math.sqrt(float(np.mean(np.diff(whole, 2) ** 2)) / 6.0) / abs(by_newton)
    half = NormalDist().inv_cdf(1.0 - 0.025 / s.size) * noise
    every = np.arange(t[0], t[-1] + 0.5 * WINDOW_S, WINDOW_S)
    drawn = np.full(every.size, np.nan)  # where the drive was not usable
    drawn[np.rint((t - t[0]) / WINDOW_S).astype(np.intp)] = f
    found = Remainder(
        "force_balance", ("t",), share, math.nan, every[:, None], drawn, drawn - half, drawn + half, (), None, 0.0, "",
        kind.name, kind.unit, tempered(chance),
    )  # fmt: skip
    return replace(found, sentence=describe(kind, found))


def _wander(drive: Drive, left: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Middles of windows of 10 s [s], what force balance and wheels against torque show alike there, without what goes
    with speed and torque and with it, 0 where they disagree [m/s²], each (k,), and the mean square of the
    accelerometer's own [m²/s⁴]."""
    step = block_step(drive.dt)
    number = (np.arange(left.shape[1]) * step // WINDOW_S).astype(np.intp)
    known = drive.mask & np.isfinite(left).all(axis=0)
    count = np.bincount(number, weights=known)
    full = np.flatnonzero(count >= LEAST_USED * WINDOW_S / step)

    def mean(x: FloatArray) -> FloatArray:
        return np.bincount(number, weights=np.where(known, x, 0.0))[full] / count[full]

    force, kinematic = (mean(left[drive.channels.index(c)]) for c in ("force_balance", "kinematic"))
    over = [mean(drive.coordinates[n]) for n in OVER if n in drive.coordinates]
    A = np.array([np.ones(full.size), *over, *(x**2 for x in over)]).T

    def own(x: FloatArray) -> FloatArray:
        return np.asarray(x - A @ np.linalg.lstsq(A, x, rcond=None)[0])

    wheels = force - kinematic
    means = [np.full(full.size, x.mean() if full.size else 0.0) for x in (force, wheels)]
    whole = _alike(force - means[0], wheels - means[1]) + _alike(*means)
    apart = float(np.mean(own(kinematic) ** 2)) if full.size else 0.0
    return np.asarray((full + 0.5) * WINDOW_S), _alike(own(force), own(wheels)), whole, apart


def _alike(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smaller of two values that have the same sign; else 0."""
    return np.asarray(np.where(a * b > 0.0, np.sign(a) * np.minimum(np.abs(a), np.abs(b)), 0.0))
