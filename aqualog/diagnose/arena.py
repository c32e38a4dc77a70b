"""What competes for the residuals of some drives: known effects and unknown shapes as blocks of columns."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from aqualog.core.errors import ConfigError
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import block_step, contrasts
from aqualog.diagnose.competition import Block
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.evidence import Evidence, forgiving
from aqualog.diagnose.hypotheses import Hypothesis, residual
from aqualog.diagnose.noise import Weighing, weighing, white_noise
from aqualog.diagnose.shapes import ALONG, Mechanism, Shape, shapes
from aqualog.diagnose.threads import beside
from aqualog.model.effects import EMPIRICAL
from aqualog.model.term import Model, Term

__all__ = [
    "CHUNK", "SHAPE_PRIOR", "TOLERATED", "Arena", "Field", "Part", "arena_of", "blocks_of", "by_drives",
    "competing", "known_only", "make_arena", "products", "unit_force",
]  # fmt: skip

# of an effect at any place, of a shape of a mechanism, and of a road that is not even, on one drive (K)
KNOWN_PRIOR, SHAPE_PRIOR, ROAD_PRIOR = 0.03, 0.01, 0.2
MOMENTS = 10  # that differ, of which the one that explains most competes
MOST_BLOCKS = 12000  # of 0.1 s that compete; a longer drive does with its best 20 min
FORCE_N = 100.0  # of the force whose response stands for any force
TOLERATED = ("v_x", "torque", "a_y", "a_x")  # coordinates along which a car and its simulation differ anyway
CHUNK = 4096  # entries of rows that are multiplied together


@dataclass(frozen=True, slots=True)
class Part:
    """A stretch `at` of drive number `drive`: residual (C, n), mask (n,), `signatures` (k, C, n), `responses` (C, n) by
    source."""

    drive: int
    at: slice
    residual: FloatArray
    mask: BoolArray
    channels: tuple[str, ...]
    signatures: FloatArray
    responses: dict[str, FloatArray]


@dataclass(frozen=True, slots=True)
class Field:
    """What competes on a drive or over a campaign: `blocks` of columns, which stand for effects or for `shapes`; `sd`
    (K,) prior size of each column, by which it is scaled."""

    evidence: Evidence
    blocks: tuple[Block, ...]
    sd: FloatArray
    shapes: tuple[Shape, ...]

    def name(self, block: int) -> str:
        """Name by which probabilities add up: that of the hypothesis, or of the shape's family with `()`."""
        b = self.blocks[block]
        if b.kind == "effect":
            return self.evidence.asked[b.tag].name
        m = self.mechanism(block)
        return f"{m.family or m.name}()"

    def mechanism(self, block: int) -> Mechanism:
        """Mechanism of a shape."""
        return self.shapes[self.blocks[block].tag].mechanism


@dataclass(frozen=True, slots=True)
class Arena(Field):
    """What competes on drives. `tolerance` (K, K) scaled covariance of what cars and files differ by anyway; `rows`:
    where each part's samples are in the shapes' bases."""

    parts: tuple[Part, ...]
    rows: tuple[slice, ...]
    tolerance: FloatArray

    def drawn(self, part: int, block: Block) -> FloatArray:
        """Scaled columns (k, C, n) of a block along a part."""
        p, c = self.parts[part], list(block.columns)
        if block.kind == "effect":
            return p.signatures[c] * self.sd[c, None, None]
        s = self.shapes[block.tag]
        modulation = s.basis.columns[self.rows[part]].T * self.sd[c, None]
        return np.asarray(modulation[:, None, :] * p.responses[s.mechanism.source][None])

    def inner(self, weighings: Sequence[Weighing]) -> FloatArray:
        """Inner products (K + 1, K + 1) of all columns, the residual last, summed over the parts."""
        each = enumerate(weighings)
        return np.asarray(sum(self._inner(i, w.width, partial(w.rows, kind=np.float32)) for i, w in each))

    def white(self, *, whole: bool = False) -> FloatArray:
        """The same under white noise of the size of the residuals' steps, or of the `whole` residuals."""
        total = np.zeros((self.sd.size + 1, self.sd.size + 1))
        for i, p in enumerate(self.parts):
            noise = white_noise(p.residual, p.mask, contrasts(p.channels), whole=whole)
            used = np.asarray((noise.weights > 0.0).any(axis=0))

            def white(x: FloatArray, rotation: FloatArray = noise.rotation, used: BoolArray = used) -> FloatArray:
                return np.asarray(np.matmul(rotation, x)[..., used].reshape(len(x), -1))

            total += self._inner(i, p.residual.shape[0] * int(used.sum()), white)
        return total

    def _inner(self, part: int, width: int, turned: Callable[[FloatArray], FloatArray]) -> FloatArray:
        p, k = self.parts[part], self.evidence.count
        rows = np.empty((self.sd.size + 1, width), dtype=np.float32)
        rows[:k] = turned(p.signatures)
        rows[:k] *= self.sd[:k, None].astype(np.float32)

        def fill(b: Block) -> None:
            rows[list(b.columns)] = turned(self.drawn(part, b))

        beside(fill, [b for b in self.blocks if b.kind != "effect"])
        rows[-1] = turned(p.residual[None])[0]
        return products(rows)

    def tolerant(self, gram: FloatArray) -> FloatArray:
        """Inner products that forgive the tolerances, by Woodbury's identity."""
        return forgiving(gram, self.tolerance).gram

    def made(self, part: int, values: FloatArray) -> FloatArray:
        """What scaled values (m, K) of all columns make of the residual of a part. (m, C, n)"""
        p, k = self.parts[part], self.evidence.count
        scaled = values * self.sd
        used = np.flatnonzero(scaled[:, :k].any(axis=0))
        out = np.tensordot(scaled[:, used], p.signatures[used], axes=1)
        by_source: dict[str, FloatArray] = {}
        for b in self.blocks:
            v = scaled[:, list(b.columns)]
            if b.kind != "effect" and np.any(v):
                s = self.shapes[b.tag]
                size = v @ s.basis.columns[self.rows[part]].T
                known = by_source.get(s.mechanism.source)
                by_source[s.mechanism.source] = size if known is None else known + size
        for source, size in by_source.items():
            out += size[:, None, :] * p.responses[source]
        return np.asarray(out)

    def weighed(self, residuals: Sequence[Sequence[FloatArray] | FloatArray]) -> tuple[Weighing, ...]:
        """The weighing of each part by the noise of draws of what is left of it."""
        return tuple(weighing(r, p.mask, contrasts(p.channels)) for r, p in zip(residuals, self.parts, strict=True))


def unit_force(drive: Drive, model: Model, base: FloatArray) -> FloatArray:
    """Change (C, n) of a drive's residual by 1 N against the motion; `base`: the residual under the model."""
    effect = EMPIRICAL["unexplained_force"]
    knots: tuple[tuple[float, float], ...] = ((0.0, FORCE_N), (150.0, FORCE_N))
    known = next((t for t in model.terms if t.effect is effect), None)
    if known is not None:
        knots = tuple((x, y + FORCE_N) for x, y in known.knots)
    term = Term(effect, knots=knots)
    others = tuple(t for t in model.terms if t is not known)
    return np.asarray((base - residual(drive, Model((*others, term)))) / FORCE_N)


def make_arena(evidence: Evidence, model: Model) -> Arena:
    """All effects of the evidence that are not tolerances, and all shapes that the drives can show; those of time and
    place on a single drive only."""
    try:
        forces = [unit_force(d, model, r) for d, r in zip(evidence.drives, evidence.residuals, strict=True)]
    except ConfigError:
        forces = []
    return arena_of(evidence, forces)


def arena_of(evidence: Evidence, forces: Sequence[FloatArray]) -> Arena:
    """The arena with the responses to a unit force at hand, one per drive; without any, no shape of a force."""
    chosen = _stretches(evidence.drives)
    parts, coordinates = [], []
    for d, at in chosen:
        drive, signatures = evidence.drives[d], evidence.signatures[d][..., at]
        responses = {
            h.key: signatures[c[0]]
            for h, c in zip(evidence.asked, evidence.columns, strict=True)
            if len(c) == 1 and not h.drive
        }
        if forces:
            responses["unit_force"] = forces[d][:, at]
        mask = drive.mask[at]
        parts.append(Part(d, at, evidence.residuals[d][:, at], mask, drive.channels, signatures, responses))
        coordinates.append({n: x[at] for n, x in drive.coordinates.items()})
    names = [n for n in coordinates[0] if all(n in c for c in coordinates) and (len(parts) == 1 or n not in ALONG)]
    joint = {n: np.concatenate([c[n] for c in coordinates]) for n in names}
    mask = np.concatenate([p.mask for p in parts])
    # where one axle has nearly all of the torque, its slip is that of all wheels
    only = evidence.drives[0].vehicle.drivetrain != "awd"
    has = [source for source in parts[0].responses if not (only and source == "slip_stiffness")]
    made = shapes(joint, mask, block_step(evidence.drives[chosen[0][0]].dt), has)
    ends = np.cumsum([0, *(p.mask.size for p in parts)])
    rows = tuple(slice(a, b) for a, b in pairwise(ends.tolist()))
    blocks, sd = blocks_of(evidence, made)
    return Arena(evidence, blocks, sd, made, tuple(parts), rows, _tolerance(evidence, made, blocks, sd))


def known_only(arena: Arena) -> Arena:
    """The arena without unknown shapes and without the tolerances along coordinates, which forgive a drag or a slip
    slope that is off by several of its own: known effects may be judged more sharply."""
    k = arena.evidence.count
    blocks = tuple(b for b in arena.blocks if b.kind == "effect")
    return replace(arena, blocks=blocks, sd=arena.sd[:k], tolerance=arena.tolerance[:k, :k])


def _stretches(drives: Sequence[Drive]) -> list[tuple[int, slice]]:
    """The longest drives first, up to the most that compete; of one that is longer, its best stretch."""
    out: list[tuple[int, slice]] = []
    left = MOST_BLOCKS
    for d in sorted(range(len(drives)), key=lambda i: -drives[i].used_s):
        mask = drives[d].mask
        if mask.size <= left:
            out.append((d, slice(0, mask.size)))
            left -= mask.size
        elif not out:
            total = np.concatenate([[0], np.cumsum(mask)])
            start = int(np.argmax(total[left:] - total[:-left]))
            return [(d, slice(start, start + left))]
    return out


def competing(parts: Sequence[Part], drives: Sequence[Drive]) -> tuple[str, ...]:
    """A note on the drives that no part of the competition is of."""
    there = {p.drive for p in parts}
    left = [d.name for i, d in enumerate(drives) if i not in there]
    most = f"the longest, up to {MOST_BLOCKS * 0.1 / 60.0:.0f} min together, decide between the causes"
    return (f"Of these drives {most}; left out: {', '.join(left)}.",) if left else ()


def by_drives(parts: Sequence[Part], given: int) -> str:
    """The begin of a verdict that does not stand on all of the given drives; else empty."""
    used = len({p.drive for p in parts})
    return f"By {used} of {given} drives: " if used < given else ""


def blocks_of(evidence: Evidence, made: Sequence[Shape]) -> tuple[tuple[Block, ...], FloatArray]:
    """What competes, and the prior size of every column."""
    shares = _place_shares([h for h, barred in zip(evidence.asked, evidence.barred, strict=True) if not barred])
    each = Counter(s.mechanism.name for s in made)
    sd = [evidence.prior]
    out = []
    for i, (h, columns) in enumerate(zip(evidence.asked, evidence.columns, strict=True)):
        if h.allowed or evidence.barred[i]:
            continue
        c = list(columns)
        low = evidence.low[c]
        if h.effect.drive.divides:
            least = h.parameter(h.free[0]).low
            low = low * (least - low) / least  # where a straight line from the value at hand ends for the least one
        is_sought = h.effect.drive.begins_like and "start" in h.fixed and (h.drive or len(evidence.drives) == 1)
        moments = MOMENTS if is_sought else 1
        out.append(
            Block(
                h.key, "effect", columns, np.eye(len(c)), math.log(KNOWN_PRIOR * shares[id(h)] / moments), i,
                low / evidence.prior[c], evidence.high[c] / evidence.prior[c],
            )
        )  # fmt: skip
    n = evidence.count
    for j, s in enumerate(made):
        k = s.basis.columns.shape[1]
        own = tuple(range(n, n + k))
        kind: Literal["road", "shape"] = "road" if s.mechanism.is_road else "shape"
        usual = ROAD_PRIOR if s.mechanism.is_road else SHAPE_PRIOR / each[s.mechanism.name]
        out.append(Block(s.key, kind, own, s.basis.prior, math.log(usual), j))
        sd.append(np.full(k, s.mechanism.usual))
        n += k
    return tuple(out), np.concatenate(sd)


def _place_shares(asked: Sequence[Hypothesis]) -> dict[int, float]:
    """Share of an effect's prior that each hypothesis has, by its identity: places, variants, drives that alone have
    it. What acts on the whole car has half of it in all drives, because tyres are changed and worn together."""
    whole = [h.where is None and not h.drive for h in asked]
    count = Counter((h.effect.name, w) for h, w in zip(asked, whole, strict=True))
    both = {n: 0.5 if count[n, True] and count[n, False] else 1.0 for n, _ in count}
    return {id(h): both[h.effect.name] / count[h.effect.name, w] for h, w in zip(asked, whole, strict=True)}


def _tolerance(evidence: Evidence, made: Sequence[Shape], blocks: Sequence[Block], sd: FloatArray) -> FloatArray:
    out = np.zeros((sd.size, sd.size))
    k = np.arange(evidence.count)
    out[k, k] = (evidence.forgiven / evidence.prior) ** 2
    for b in blocks:
        if b.kind != "shape":
            continue
        s = made[b.tag]
        m = s.mechanism
        if len(s.coordinates) == 1 and s.coordinates[0] in TOLERATED and m.allowed > 0.0 and not m.is_whole:
            c = list(b.columns)
            out[np.ix_(c, c)] = (m.allowed / m.usual) ** 2 * s.basis.prior
    return out


def products(rows: npt.NDArray[Any]) -> FloatArray:
    """Inner products of single-precision rows, in double precision: else large ones would not be positive definite."""

    def of(i: int) -> FloatArray:
        x = rows[:, i : i + CHUNK].astype(np.float64)
        return np.asarray(x @ x.T)

    total = np.zeros((len(rows), len(rows)))
    for part in beside(of, range(0, rows.shape[1], CHUNK)):
        total += part
    return total
