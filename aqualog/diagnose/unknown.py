"""Test whether the remainder of a residual is a function of a coordinate, and find that coordinate.

Additive penalised splines on the whitened residual, a family-wise test over all channels and coordinates, followed by a
comparison of the coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.unknown_basis import Basis, bases
from aqualog.diagnose.unknown_fit import (
    energies,
    noise_level,
    noise_like,
    null_scores,
    parts_of,
    roughness,
    simultaneous,
)
from aqualog.diagnose.unknown_proxy import Candidate, Choice, blocks_of_rows, choose
from aqualog.diagnose.unknown_term import describe

__all__ = ["Residuals", "find_remainders"]

LEAST_S = 60.0  # [s] of drive that the search needs at the least
SHORTLIST = 6  # coordinates of a channel that are compared on held-out stretches
LEAST_NOISE = 0.05  # level of the noise beside a function, over that of the whitening
CLIP = 5.0  # standard deviations from which a whitened residual is an outlier


class Residuals(Protocol):
    """Input of the test: `residual` (C, n) at `dt` [s], `mask` (n,) of the samples that count, `coordinates` (n,) each.

    `whitened` is linear: it turns a residual-shaped array (C, n) into a flat one (C n,), in the same order, whose inner
    products are twice log-likelihoods under the noise; samples that do not count are zero.
    """

    @property
    def residual(self) -> FloatArray: ...  # noqa: D102
    @property
    def mask(self) -> BoolArray: ...  # noqa: D102
    @property
    def dt(self) -> float: ...  # noqa: D102
    @property
    def channels(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def coordinates(self) -> Mapping[str, FloatArray]: ...  # noqa: D102
    def whitened(self, x: FloatArray) -> FloatArray: ...  # noqa: D102


class _Group(NamedTuple):
    """A basis in one channel; its whitened columns (N, K) in single precision, to keep all of them."""

    channel: int
    basis: Basis
    columns: np.ndarray[tuple[int, ...], np.dtype[np.float32]]


class _Fit(NamedTuple):
    """Constant and coefficients (1 + K,), a square root of their covariance, the whitened function (N,) without it."""

    coefficients: FloatArray
    root: FloatArray
    rows: FloatArray


def find_remainders(
    stack: Residuals,
    *,
    signatures: Mapping[str, FloatArray],
    level: float = 0.01,
    seed: int = 1,
    surrogates: int = 99,
    most: int = 2,
) -> tuple[Remainder, ...]:
    """Functions of coordinates that the residual holds, the most certain one first.

    Parameters
    ----------
    stack : Residuals
        Left by the best set of known effects.
    signatures : mapping of (C, n)
        Signatures of known effects in the residual, at any size, to name the nearest one.
    level : float
        Chance that noise alone gives a remainder, over all channels and coordinates; at least 1 / (surrogates + 1).
    seed : int
        Of the surrogates; same seed, same answer.
    surrogates : int
        Noise series with the spectra of the residual. No effect is removed from the residual before: a fit leaves a gap
        in the spectrum just where the test looks.
    most : int
        Remainders, at most; each is tested with the earlier ones in the model.

    Returns
    -------
    remainders : tuple of Remainder
        `f` is NaN where the drive was not. Empty if the test finds no function, or the drive is shorter than a minute.
    """
    if np.count_nonzero(stack.mask) * stack.dt < LEAST_S:
        return ()
    rng = np.random.default_rng([seed, 77])
    residual = np.where(stack.mask & np.isfinite(stack.residual), stack.residual, 0.0)
    shape = (residual.shape[0], residual.shape[1])
    spaces = bases(stack.coordinates, stack.mask, stack.dt)
    groups = [_Group(c, b, _whitened(stack, c, b.columns)) for b in spaces for c in range(len(stack.channels))]
    ones = stack.mask.astype(np.float64)[:, None]
    constants = np.column_stack([_whitened(stack, c, ones) for c in range(len(stack.channels))]).astype(np.float64)
    taken = _orthonormal(constants)
    rows = _with_surrogates(stack, residual, surrogates, rng)
    blocks = blocks_of_rows(stack.whitened, shape, stack.dt, rng)
    found: list[Remainder] = []
    while groups and len(found) < most:
        scores = np.stack([_scores(g, taken, rows, shape) for g in groups])
        largest = scores.max(axis=0)
        p_value = float(np.count_nonzero(largest >= largest[0])) / largest.size
        if p_value > level:
            break
        channel = groups[int(np.argmax(scores[:, 0]))].channel
        of_channel = [(s, g) for s, g in zip(scores[:, 0], groups, strict=True) if g.channel == channel]
        of_channel.sort(key=lambda x: -x[0])
        threshold = float(np.quantile(largest[1:], 1.0 - level))
        choice = _choice([g for s, g in of_channel if s >= threshold], of_channel, taken, rows[:, 0], blocks, shape)
        if choice is None:
            break
        group = next(g for _, g in of_channel if g.basis.names == choice.names)
        fit = _fit(group, constants, taken, rows[:, 0], shape)
        values = np.where(stack.mask, fit.coefficients[0] + group.basis.columns @ fit.coefficients[1:], 0.0)
        left = residual.copy()
        left[channel] -= values
        rows = _with_surrogates(stack, left, surrogates, rng)
        nearest, cosine = _nearest(fit.rows, taken, signatures, stack)
        x, f, low, high = _function(group.basis, fit, rng)
        share = 1.0 - float(np.var(left[channel, stack.mask]) / np.var(residual[channel, stack.mask]))
        sentence = describe(stack.channels[channel], choice, x, f, low, high, share, nearest, cosine)
        found.append(
            Remainder(
                stack.channels[channel], choice.names, max(share, 0.0), p_value, x, f, low, high,
                (*choice.equals, *choice.proxies), nearest, cosine, sentence,
            )
        )  # fmt: skip
        residual, taken = left, _orthonormal(np.column_stack([taken, group.columns]))
        gone = {choice.names, *((e,) for e in choice.equals)}
        groups = [g for g in groups if g.channel != channel or g.basis.names not in gone]
    return tuple(found)


def _whitened(stack: Residuals, channel: int, columns: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    x = np.zeros(stack.residual.shape)
    out = []
    for column in columns.T:
        x[channel] = np.where(stack.mask, column, 0.0)
        out.append(stack.whitened(x).astype(np.float32))
    return np.stack(out, axis=1)


def _orthonormal(columns: FloatArray) -> FloatArray:
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, s > 1e-6 * s[0]], dtype=np.float64)


def _without(taken: FloatArray, columns: FloatArray) -> FloatArray:
    return columns - taken @ (taken.T @ columns)


def _with_surrogates(stack: Residuals, residual: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Whitened residual and its surrogates (N, 1 + count), outliers clipped."""
    own = stack.whitened(residual)
    limit = CLIP * max(1.0, 1.4826 * float(np.median(np.abs(own))))
    own = np.clip(own, -limit, limit)
    noise = noise_like(own.reshape(residual.shape), count, rng)
    return np.column_stack([own, noise.reshape(count, -1).T])


def _scores(group: _Group, taken: FloatArray, rows: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Largest score (1 + S,) over smoothnesses of a function in one group."""
    columns = _without(taken, group.columns.astype(np.float64))
    parts = parts_of(columns.T @ columns, group.basis.penalty)
    ratios = energies(parts, columns.T @ rows) / noise_level(columns @ parts.directions, rows, shape)
    return np.asarray(null_scores(ratios).max(axis=0), dtype=np.float64)


def _smoothing(group: _Group, taken: FloatArray, row: FloatArray, shape: tuple[int, int]) -> tuple[float, float]:
    """Penalty factor of a group, and level of the noise beside it."""
    columns = _without(taken, group.columns.astype(np.float64))
    parts = parts_of(columns.T @ columns, group.basis.penalty)
    level = max(float(noise_level(columns @ parts.directions, row[:, None], shape)[0]), LEAST_NOISE)
    return roughness(parts, columns.T @ row, level), level


def _choice(
    passed: Sequence[_Group], of_channel: Sequence[tuple[float, _Group]], taken: FloatArray, row: FloatArray,
    blocks: np.ndarray[tuple[int, ...], np.dtype[np.int64]], shape: tuple[int, int],
) -> Choice | None:  # fmt: skip
    """Compare the coordinates that passed the test, with both coordinates of a pair beside it."""
    short = list(passed[:SHORTLIST]) or [of_channel[0][1]]
    names = {g.basis.names for g in short}
    parts = {(n,) for pair in names if len(pair) == 2 for n in pair} - names
    short += [g for _, g in of_channel if g.basis.names in parts]
    candidates = []
    for g in short:
        columns = g.columns.astype(np.float64)
        weight, _ = _smoothing(g, taken, row, shape)
        tested = g.basis.names in names
        candidates.append(Candidate(g.basis.names, columns, weight * g.basis.penalty, g.basis.along, tested))
    return choose(candidates, taken, row, blocks)


def _fit(group: _Group, constants: FloatArray, taken: FloatArray, row: FloatArray, shape: tuple[int, int]) -> _Fit:
    """Function with a constant of its own channel, after the earlier functions."""
    columns = group.columns.astype(np.float64)
    weight, level = _smoothing(group, taken, row, shape)
    others = (
        _orthonormal(np.delete(constants, group.channel, axis=1)) if constants.shape[1] > 1 else np.zeros((row.size, 0))
    )
    design = np.column_stack([constants[:, group.channel], columns])
    clean = _without(others, design)
    k = design.shape[1]
    penalty = np.zeros((k, k))
    penalty[1:, 1:] = weight * group.basis.penalty
    gram = clean.T @ clean + penalty
    values, vectors = np.linalg.eigh(gram)
    seen = values > 1e-12 * values[-1]
    root = vectors[:, seen] / np.sqrt(values[seen])
    coefficients = root @ (root.T @ (clean.T @ row))
    return _Fit(coefficients, root * np.sqrt(level), design @ coefficients)


def _nearest(
    rows: FloatArray, taken: FloatArray, signatures: Mapping[str, FloatArray], stack: Residuals
) -> tuple[str | None, float]:
    best, largest = None, 0.0
    mine = _without(taken, rows[:, None])[:, 0]
    for name, signature in signatures.items():
        x = np.where(stack.mask & np.isfinite(signature), signature, 0.0)
        other = _without(taken, stack.whitened(x)[:, None])[:, 0]
        norm = float(np.linalg.norm(mine) * np.linalg.norm(other))
        cosine = abs(float(mine @ other)) / norm if norm > 0.0 else 0.0
        if cosine > largest:
            best, largest = name, cosine
    return best, largest


def _function(
    basis: Basis, fit: _Fit, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Points (k, d), value and simultaneous band (k,); NaN where the drive was not."""
    at = np.column_stack([np.ones(basis.points.shape[0]), basis.at_points])
    gone = ~basis.supported
    f = at @ fit.coefficients
    sd, factor = simultaneous(at[basis.supported], fit.root, rng)
    half = np.full(f.size, np.nan)
    half[basis.supported] = factor * sd
    f = np.where(gone, np.nan, f)
    return basis.points, f, f - half, f + half
