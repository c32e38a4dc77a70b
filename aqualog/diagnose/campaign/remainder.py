"""Deviation that no effect of the library explains, as a function of speed, depth, pressure or load."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.intervals import chi2_log_p
from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.any_effect import Anything, anything
from aqualog.diagnose.campaign.catalogue import Library
from aqualog.diagnose.campaign.noise import Fit
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes
from aqualog.diagnose.campaign.refit import conditioned
from aqualog.diagnose.records import Remainder

__all__ = ["remainders"]

COORDINATES = {"v_x": "speed", "depth": "depth", "pressure": "pressure", "load": "load"}
KNOTS = 4
AMPLITUDE = 0.2  # of the channel's rms: prior size of a function's value at a knot
PROXY = 0.8  # of the best coordinate's statistic


class _Shape(NamedTuple):
    """Columns of one function: of `channels` (indices), over a coordinate with its knots."""

    name: str
    channels: tuple[int, ...]
    coordinate: str
    knots: FloatArray
    columns: tuple[int, ...]


def _shapes(passes: Passes) -> tuple[list[_Shape], FloatArray]:
    """All functions, and their columns (g, c, k)."""
    slips = [i for i, n in enumerate(passes.names) if n.startswith("slip_slope_")]
    axles = {a: tuple(i for i in slips if passes.names[i][-2] == a) for a in "fr"}
    whats = {f"slip_slope_{a}": c for a, c in axles.items() if c}
    whats |= {f"slip_slope_{s}": tuple(i for i in slips if passes.names[i][-1] == s[0]) for s in ("left", "right")}
    whats[RESISTANCE] = (passes.names.index(RESISTANCE),)
    out: list[_Shape] = []
    columns: list[FloatArray] = []
    wet = np.isfinite(passes.values[:, -1])
    for what, channels in whats.items():
        for coordinate in COORDINATES:
            x = passes.coordinates[coordinate]
            knots = _knots(x[wet])
            if knots.size < 2:
                continue
            tents = np.stack([np.interp(x, knots, np.eye(knots.size)[k]) for k in range(knots.size)], axis=-1)
            scale = np.zeros(len(passes.names))
            for c in channels:
                scale[c] = AMPLITUDE * float(np.sqrt(np.nanmean(passes.values[:, c] ** 2)))
            first = sum(c.shape[-1] for c in columns)
            columns.append(tents[:, None, :] * scale[None, :, None])
            out.append(_Shape(what, channels, coordinate, knots, tuple(range(first, first + knots.size))))
    return out, np.concatenate(columns, axis=-1) if columns else np.zeros((*passes.values.shape, 0))


def _knots(x: FloatArray) -> FloatArray:
    values = np.unique(np.round(x, 9))
    return values if values.size <= KNOTS else np.unique(np.quantile(x, np.linspace(0.02, 0.98, KNOTS)))


def remainders(
    passes: Passes,
    residual: FloatArray,
    own: FloatArray,
    lib: Library,
    scatter: Fit,
    *,
    rng: np.random.Generator,
    level: float,
    surrogates: int,
    report: Callable[[float], None] = lambda share: None,
) -> tuple[tuple[Remainder, ...], Anything | None]:
    """Test whether the residual of the best set is a function of a coordinate, and describe it.

    Parameters
    ----------
    residual : array (g, c)
    own : array (g, c, k)
        Columns of the best set, whose sizes stay free.
    lib : Library
        For the nearest known effect.
    scatter : Fit

    Returns
    -------
    One remainder per channel that has one at the level, the clearest first; and the test.
    """
    shapes, x = _shapes(passes)
    if not shapes:
        return (), None
    free = np.concatenate([passes.nuisances, own], axis=-1)
    groups = [(f"{s.name}:{s.coordinate}", s.columns) for s in shapes]
    found = anything(
        residual, x, groups, lib.road, free, rng=rng, level=level, surrogates=surrogates, report=report
    )  # fmt: skip
    if found.p_value > level:
        return (), found
    information, score, _ = conditioned(x, residual, free, scatter.weight)
    scored = []
    sizes: dict[int, tuple[FloatArray, FloatArray]] = {}
    for s in shapes:
        c = list(s.columns)
        inverse = np.linalg.pinv(information[np.ix_(c, c)], rcond=1e-8, hermitian=True)
        size = inverse @ score[c]
        sizes[id(s)] = size, np.sqrt(np.maximum(np.diag(inverse), 0.0))
        scored.append((chi2_log_p(float(score[c] @ size), len(c)), s))
    scored.sort(key=lambda item: -item[0])
    out: list[Remainder] = []
    told: set[int] = set()
    for statistic, s in scored:
        if statistic < found.threshold or told & set(s.channels):
            continue
        told |= set(s.channels)
        proxies = tuple(o.coordinate for q, o in scored if o.name == s.name and o is not s and q >= PROXY * statistic)
        made = x[:, :, list(s.columns)] @ sizes[id(s)][0]
        nearest = _nearest(made, residual, lib, free, scatter)
        out.append(_described(passes, residual, s, made, *sizes[id(s)], nearest, found.p_value, proxies))
    return tuple(out), found


def _described(
    passes: Passes, residual: FloatArray, s: _Shape, made: FloatArray, size: FloatArray, sd: FloatArray,
    nearest: tuple[str | None, float], p_value: float, proxies: Sequence[str],
) -> Remainder:  # fmt: skip
    scale = AMPLITUDE * float(np.mean([np.sqrt(np.nanmean(passes.values[:, i] ** 2)) for i in s.channels]))
    half = math.sqrt(float(_band(size.size))) * sd * scale
    f = size * scale
    e = residual[:, list(s.channels)]
    left = e - made[:, list(s.channels)]
    share = max(1.0 - float(np.nansum(left**2) / np.nansum(e**2)), 0.0)
    effect, cosine = nearest
    unit = "m/s²" if s.name == RESISTANCE else "slip"
    word = COORDINATES[s.coordinate]
    sentence = (
        f"{s.name} departs from the model by {f.min():+.2g} to {f.max():+.2g} ({unit}) over the {word}; "
        f"the most similar effect is {effect} (similarity {cosine:.2f} of 1)."
    )  # fmt: skip
    return Remainder(
        s.name, (s.coordinate,), share, p_value, s.knots[:, None], f, f - half, f + half, tuple(proxies), effect,
        cosine, sentence,
    )  # fmt: skip


def _band(dof: int) -> float:
    """95 % quantile of chi^2: for a band that holds at all knots together."""
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if chi2_log_p(middle, dof) < -math.log10(0.05) else (low, middle)
    return high


def _nearest(
    made: FloatArray, residual: FloatArray, lib: Library, free: FloatArray, scatter: Fit
) -> tuple[str | None, float]:
    best, cosine = None, 0.0
    y = np.where(np.isfinite(residual), made, np.nan)
    for h, columns in zip(lib.hypotheses, lib.columns, strict=True):
        information, score, energy = conditioned(lib.x[:, :, list(columns)], y, free, scatter.weight)
        told = float(score @ np.linalg.pinv(information, rcond=1e-10, hermitian=True) @ score)
        value = math.sqrt(max(told, 0.0) / energy) if energy > 0.0 else 0.0
        if value > cosine:
            best, cosine = h.key, min(value, 1.0)
    return best, cosine
