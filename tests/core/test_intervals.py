"""Intervals and chances against tables, equations and SciPy."""

import math
from statistics import NormalDist

import numpy as np
import pytest

from aqualog.core.intervals import (
    jackknife_sd,
    poisson,
    same_decimals,
    student_quantile,
    variance_ratio_chance,
    widened,
    wilson,
)  # fmt: skip


def test_quantiles_of_student():
    for dof, quantile in ((1, 12.7062), (2, 4.3027), (5, 2.5706), (11, 2.2010), (100, 1.9840), (10_000_000, 1.95996)):
        assert student_quantile(0.975, dof) == pytest.approx(quantile, rel=1e-4)


def test_normal_draws_give_the_interval_of_student():
    draws = np.array([NormalDist(7.0, 2.0).inv_cdf(p) for p in np.linspace(0.0005, 0.9995, 1000)])
    assert widened(7.0, draws, 2.0) == pytest.approx((7.0 - 4.3027 * 2.0, 7.0 + 4.3027 * 2.0), abs=0.05)
    assert widened(9.0, np.full(10, 8.0), 2.0) == pytest.approx((9.0 - 4.3027 / 1.96, 9.0), rel=1e-4)


def test_an_estimate_has_the_decimals_of_its_interval():
    assert same_decimals(0.31710338, (0.317098, 0.317109)) == ("0.3171034", "0.3170980", "0.3171090")
    assert same_decimals(1970.86, (1893.14, 2048.58)) == ("1971", "1893", "2049")
    assert same_decimals(0.5, (0.4, 0.6)) == ("0.50", "0.40", "0.60")
    assert same_decimals(1890.04, (math.nan, math.nan)) == ("1890", "", "")


def test_jackknife_of_a_mean_is_its_standard_error():
    x = np.random.default_rng(1).normal(0.0, 2.0, (7, 3))
    left = np.array([np.delete(x, i, axis=0).mean(axis=0) for i in range(7)])
    assert jackknife_sd(left) == pytest.approx(x.std(axis=0, ddof=1) / math.sqrt(7.0), rel=1e-12)


@pytest.mark.parametrize(("ratio", "dof", "below"), [(3.708, 3, 10), (4.534, 4, 6), (2.214, 5, 1000.0), (161.4, 1, 1)])
def test_chance_of_a_variance_ratio(ratio, dof, below):
    """Tables of F: 5 %."""
    expected = 0.05 if below < 1000 else 0.0508
    assert variance_ratio_chance(ratio, dof, below) == pytest.approx(expected, abs=3e-4)


# Garwood's exact limits as tabulated (Pearson and Hartley, Biometrika Tables 1, table 40)
@pytest.mark.parametrize(
    ("k", "low", "high"),
    [(0, 0.0, 3.69), (1, 0.0253, 5.57), (2, 0.242, 7.22), (5, 1.62, 11.67), (10, 4.80, 18.39), (30, 20.24, 42.83),
     (50, 37.11, 65.92)],
)  # fmt: skip
def test_poisson_limits_are_the_tabulated_ones(k, low, high):
    assert poisson(k) == pytest.approx((low, high), abs=0.006)


@pytest.mark.parametrize("k", [1, 3, 40, 2500])
def test_poisson_limits_leave_the_tails(k):
    low, high = poisson(k, 0.9)

    def at_most(n, mean):
        return sum(math.exp(i * math.log(mean) - mean - math.lgamma(i + 1)) for i in range(n + 1))

    assert at_most(k, high) == pytest.approx(0.05, abs=1e-9)
    assert 1.0 - at_most(k - 1, low) == pytest.approx(0.05, abs=1e-9)


def test_wilson_solves_its_equation():
    z = 1.959963984540054
    for k, n in ((1, 10), (9, 10), (50, 100), (990, 1000)):
        for p in wilson(k, n):
            assert abs(k / n - p) == pytest.approx(z * math.sqrt(p * (1 - p) / n))
    assert wilson(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)
    assert wilson(10, 10) == pytest.approx((0.7225, 1.0), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_intervals_against_scipy():
    stats = pytest.importorskip("scipy.stats")
    for k in (0, 1, 7, 123):
        low = stats.chi2.ppf(0.025, 2 * k) / 2 if k else 0.0
        assert poisson(k) == pytest.approx((low, stats.chi2.ppf(0.975, 2 * k + 2) / 2), rel=1e-9)
        wanted = stats.binomtest(k, 200).proportion_ci(method="wilson")
        assert wilson(k, 200) == pytest.approx((wanted.low, wanted.high), abs=1e-12)
