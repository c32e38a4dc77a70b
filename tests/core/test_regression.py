"""Lines with the run as the unit: unbiased, honest intervals, noise of the traction given back."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core import regression
from aqualog.core.moments import Design, moments_of, starts_of
from aqualog.core.regression import estimate
from tests.campaign.slope_coverage import World, made, study


def line(mu, slip, run, step=None):
    n = len(mu)
    step = np.arange(n) if step is None else step
    columns = np.stack([np.asarray(mu, dtype=float), np.ones(n)])
    return Design(columns, np.asarray(slip, dtype=float), np.asarray(run), step, (True, True), (True, False))


def test_exact_line_comes_back_with_each_runs_own_offset():
    rng = np.random.default_rng(1)
    mu = np.concatenate([np.linspace(0.0, 0.2, 40) + c for c in (0.0, 0.05, 0.1, 0.0)])
    run = np.repeat(np.arange(4), 40)
    slip = mu / 25.0 + np.array([0.001, -0.002, 0.003, 0.0])[run] + 1e-7 * rng.normal(size=mu.size)
    found = estimate(line(mu, slip, run))
    assert found.value[0] == pytest.approx(1 / 25.0, rel=1e-3)
    assert found.value[1] == pytest.approx(0.0005, abs=5e-4)
    assert found.runs == 4
    assert found.scatter[1] == pytest.approx(0.002, rel=0.5)


@pytest.mark.parametrize("runs", [5, 12])
def test_coverage_and_bias_with_five_runs_or_more(runs):
    """120 experiments: a share of 0.95 has a standard error of 0.02. The table of thousand is that of the script."""
    held, _, _, bias, error, *_ = study(World(runs=runs), 120, 11)
    assert 0.88 <= held <= 1.0
    assert abs(bias) < 3.0 * error + 0.005


def test_samples_as_the_unit_would_be_far_too_sure():
    """The same data with every sample its own run: this is what the run as the unit protects against."""
    world, rng = World(runs=5, slope_scatter=0.15, offset_scatter=0.003), np.random.default_rng(5)
    held = []
    for _ in range(60):
        d = made(world, rng)
        x, y = d.columns[0] - d.columns[0].mean(), d.y - d.y.mean()
        k = x @ y / (x @ x)
        half = 1.96 * np.sqrt(np.mean((y - k * x) ** 2) / (x @ x))
        held.append(abs(k - 1 / world.slope) <= half)
    assert np.mean(held) < 0.7


def test_noise_of_the_traction_is_given_back_and_told():
    world = World(runs=15, mu_noise=0.02, mu_run=0.03, mu_within=0.03, shortest=60, longest=120)
    rng = np.random.default_rng(3)
    k, naive, lost = [], [], []
    for _ in range(40):
        d = made(world, rng)
        found = estimate(d)
        k.append(found.value[0] * world.slope)
        naive.append(estimate(d._replace(noisy=(False, False))).value[0] * world.slope)
        lost.append(found.attenuation)
    assert np.mean(k) == pytest.approx(1.0, abs=0.03)
    assert np.mean(naive) < 0.85
    assert np.mean(lost) == pytest.approx(1.0 - np.mean(naive), abs=0.05)


def test_robust_weights_hold_against_outliers():
    rng = np.random.default_rng(4)
    world = World(runs=8, outliers=0.05, slope_scatter=0.0, offset_scatter=0.0, mu_noise=0.0)
    plain, robust = [], []
    for _ in range(40):
        d = made(world, rng)
        plain.append(estimate(d).value[0] * world.slope - 1.0)
        robust.append(estimate(d, robust=True).value[0] * world.slope - 1.0)
    assert np.std(robust) < 0.8 * np.std(plain)


def test_one_run_has_a_line_and_no_interval():
    found = estimate(made(World(runs=1, shortest=60), np.random.default_rng(6)))
    assert np.isfinite(found.value[0])
    assert np.isinf(found.half[0])


def test_a_mean_is_a_random_effects_mean():
    """Four runs with levels of their own: the interval is Student's of the four levels, whatever their lengths."""
    levels, lengths = np.array([0.30, 0.36, 0.24, 0.34]), [20, 200, 60, 40]
    run = np.repeat(np.arange(4), lengths)
    y = levels[run] + 1e-4 * np.random.default_rng(7).normal(size=run.size)
    found = estimate(Design(np.ones((1, y.size)), y, run, np.arange(y.size), (True,), (False,)))
    assert found.value[0] == pytest.approx(levels.mean(), abs=2e-3)
    half = 3.182 * levels.std(ddof=1) / 2.0
    assert found.half[0] == pytest.approx(half, rel=0.05)
    # a column twice: the normal equations have no inverse
    twice = estimate(Design(np.ones((2, y.size)), y, run, np.arange(y.size), (True, True), (False, False)))
    assert twice.value == pytest.approx([found.value[0] / 2.0] * 2, abs=found.half[0] / 4.0)


def test_gaps_are_no_neighbours():
    """Second differences over a gap would book a real change of the traction as noise."""
    world = replace(World(), runs=4, mu_noise=0.0, shortest=40, longest=60)
    d = made(world, np.random.default_rng(8))
    jump = np.where(np.arange(d.y.size) % 20 < 10, 0.0, 0.2)  # between stretches of one second
    mu = d.columns[0] + jump
    slip = d.y + 0.5 * jump / world.slope * np.random.default_rng(9).normal(size=jump.size)
    step = d.step + 100 * (np.arange(d.y.size) // 10)
    gap = estimate(Design(np.stack([mu, np.ones_like(mu)]), slip, d.run, step, (True, True), (True, False)))
    none = estimate(Design(np.stack([mu, np.ones_like(mu)]), slip, d.run, d.step, (True, True), (True, False)))
    assert gap.noise < 0.2 * none.noise


def test_units_of_the_columns_do_not_matter():
    d = made(World(runs=6), np.random.default_rng(10))
    one = estimate(d)
    other = estimate(d._replace(columns=d.columns * np.array([[1e4], [1.0]]), y=d.y))
    assert other.value[0] * 1e4 == pytest.approx(one.value[0], rel=1e-6)
    assert other.half[0] * 1e4 == pytest.approx(one.half[0], rel=1e-6)


@pytest.mark.parametrize("p", [1, 2, 3])
def test_likelihood_by_moments_is_that_of_the_covariance_matrix(p):
    """-2 log of the restricted likelihood with V = sigma^2 I + X T X' written out, run by run."""
    rng = np.random.default_rng(p)
    run = np.repeat(np.arange(4), [5, 9, 3, 7])
    columns = rng.normal(size=(p, run.size)) * 10.0 ** -np.arange(p)[:, None]
    y, variance = rng.normal(size=run.size), 0.3
    grid = np.concatenate([np.zeros((1, p)), 10.0 ** rng.uniform(-2, 2, (6, p))])
    d = Design(columns, y, run, np.arange(run.size), (True,) * p, (False,) * p)
    found = regression._unlikelihood(moments_of(d, starts_of(run), np.ones_like(y)), variance, grid)
    dense = []
    for t in grid:
        V = np.where(run[:, None] == run, columns.T @ (t[:, None] * columns), 0.0) + variance * np.eye(run.size)
        W = np.linalg.inv(V)
        A = columns @ W @ columns.T
        e = y - columns.T @ np.linalg.solve(A, columns @ W @ y)
        dense.append(np.linalg.slogdet(V)[1] + np.linalg.slogdet(A)[1] + e @ W @ e)
    assert np.diff(found) == pytest.approx(np.diff(dense), rel=1e-9, abs=1e-9)
