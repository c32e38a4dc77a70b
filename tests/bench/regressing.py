"""Slip slopes in bins of speed beside a loop of scipy's linregress."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from tests.bench.compare import Row
from tests.bench.scale import Scale

BINS = 12
SLOPE = 30.0


class Samples(NamedTuple):
    """Samples (n,) of all runs: run, bin of speed, place in time, traction [-], slip [-]."""

    run: np.ndarray
    bin: np.ndarray
    step: np.ndarray
    mu: np.ndarray
    slip: np.ndarray


def made(runs: int, samples: int) -> Samples:
    """Runs through all bins, each with an offset and a slope of its own."""
    rng = np.random.default_rng(runs)
    n = runs * samples
    run, step = np.repeat(np.arange(runs), samples), np.tile(np.arange(samples), runs)
    place = step * BINS // samples
    mu = 0.05 + 0.03 * np.sin(step / 9.0 + rng.uniform(0.0, 6.0, runs)[run])
    k = (1.0 + 0.05 * rng.standard_normal(runs)[run]) / (SLOPE - place)
    slip = k * mu + rng.normal(0.0, 0.001, runs)[run] + rng.normal(0.0, 0.001, n)
    return Samples(run, place, step, mu, slip)


def lines_with_aqualog(s: Samples) -> np.ndarray:
    """1 / slope and offset of each run in each bin (cells, 2), by the moments that all fits rest on."""
    from aqualog.core.moments import Design, moments_of, starts_of

    cell = s.run * BINS + s.bin
    columns = np.stack([s.mu, np.ones_like(s.mu)])
    design = Design(columns, s.slip, cell, s.step, (True, True), (False, False))
    m = moments_of(design, starts_of(cell))
    return np.linalg.solve(m.h, m.c[:, :, None])[:, :, 0]


def lines_with_scipy(s: Samples) -> np.ndarray:
    """The same, fit by fit."""
    from scipy.stats import linregress

    cell = s.run * BINS + s.bin
    edges = [*np.flatnonzero(np.diff(cell, prepend=-1)), cell.size]
    fits = [linregress(s.mu[a:b], s.slip[a:b]) for a, b in itertools.pairwise(edges)]
    return np.array([(f.slope, f.intercept) for f in fits])


def slopes_with_aqualog(s: Samples) -> np.ndarray:
    """1 / slope of each bin with the half width of its interval (bins, 2), runs as the unit, as `bin-slipslope` has it."""
    from aqualog.core.moments import Design, starts_of
    from aqualog.core.regression import estimate

    found = []
    first = starts_of(s.run * BINS + s.bin)
    cells = np.stack([first, np.append(first[1:], s.bin.size)], axis=1)
    for k in range(BINS):
        here = [slice(a, b) for a, b in cells[s.bin[first] == k].tolist()]
        run, step, mu, slip = (np.concatenate([x[c] for c in here]) for x in (s.run, s.step, s.mu, s.slip))
        columns = np.stack([mu, np.ones_like(mu)])
        e = estimate(Design(columns, slip, run, step, (True, True), (True, False)))
        found.append((e.value[0], e.half[0]))
    return np.array(found)


def slopes_with_scipy(s: Samples) -> np.ndarray:
    """Mean over the runs of each run's own slope, with its Student interval."""
    from scipy.stats import t

    k = lines_with_scipy(s)[:, 0].reshape(-1, BINS)
    half = t.ppf(0.975, len(k) - 1) * k.std(axis=0, ddof=1) / np.sqrt(len(k))
    return np.column_stack([k.mean(axis=0), half])


def _lines_unlike(a: np.ndarray, b: np.ndarray) -> str:
    off = float(np.abs(a - b).max() / np.abs(b).max())
    return "" if off < 1e-9 else f"coefficients differ by {off:.1e}"


def _slopes_unlike(a: np.ndarray, b: np.ndarray) -> str:
    # weights differ: more than a tenth of the interval is another answer
    off = float((np.abs(a[:, 0] - b[:, 0]) / b[:, 1]).max())
    wide = float(np.abs(a[:, 1] / b[:, 1] - 1.0).max())
    return "" if off < 0.1 and wide < 0.2 else f"slopes differ by {off:.2f} intervals, intervals by {100 * wide:.0f} %"


def rows(scale: Scale) -> list[Row]:
    """Lines of every run and bin; slopes of the bins with intervals."""
    s = made(scale.runs, scale.samples)
    size = f"{scale.runs} runs, {BINS} bins, {s.mu.size} samples, one thread"
    needs = ("scipy",)
    return [
        Row(
            "binned slip slope: a line of each run and bin", "scipy linregress loop", 25.0,
            lambda: lines_with_aqualog(s), lambda: lines_with_scipy(s), _lines_unlike, rounds=5, needs=needs,
            conditions=f"{size}; the peer gives errors too",
        ),
        Row(
            "same: slopes of the bins with intervals by run", "scipy linregress loop, mean over runs", 25.0,
            lambda: slopes_with_aqualog(s), lambda: slopes_with_scipy(s), _slopes_unlike, rounds=5, needs=needs,
            conditions=f"{size}; the peer weighs all runs alike, leaves the noise of the traction in, and has plain intervals",
        ),
    ]  # fmt: skip
