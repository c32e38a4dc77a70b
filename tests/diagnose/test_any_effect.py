"""The family-wise test: the level that is asked for on noise, and a large effect beyond it."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose.evidence import SURROGATES, calibrate, gumbel_p, significance, tolerant
from tests.diagnose.test_noise import first_order
from tests.diagnose.test_subsets import ASKED, bench_of, made, plain, waves


def null(seed, n=400):
    rng = np.random.default_rng([7, seed])
    s = waves(n, len(ASKED), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
    y = np.array([first_order(rng, 0.9, n), first_order(rng, 0.6, n) + rng.standard_normal(n)])
    return bench_of(y, s)


def p_of(b, *, surrogates=SURROGATES, seed=1):
    gram = plain(b)
    c = calibrate(b, gram, surrogates=surrogates, level=0.05, seed=seed)
    return gumbel_p(c.maxima, significance(b, tolerant(b, gram), c, 0.05).statistic), c


def test_noise_without_effect_is_called_as_often_as_asked_for():
    p = np.array([p_of(null(s))[0] for s in range(120)])
    # at 0.05, more than 12 of 120 happen in 0.7 % of all cases; at 0.01, more than 4 in 0.8 %
    assert (p < 0.05).sum() <= 12
    assert (p < 0.01).sum() <= 4
    assert 0.35 < np.median(p) < 0.65


def test_a_large_effect_is_beyond_all_noise():
    p, c = p_of(made(seed=1, n=600, torque_gain=2.0))
    assert p < 1e-3
    assert c.maxima.max() < 40.0


def test_the_same_seed_gives_the_same_draws():
    b = null(1)
    a, same, other = (calibrate(b, plain(b), surrogates=9, level=0.05, seed=s).maxima for s in (1, 1, 2))
    assert np.array_equal(a, same)
    assert not np.array_equal(a, other)


def test_the_units_of_columns_do_not_matter_for_the_draws():
    b = null(1)
    by = np.where(np.arange(b.count) % 2, 1.0, 1e9)
    other = replace(b, tolerance=b.tolerance / by, signatures=(b.signatures[0] * by[:, None, None],))
    usual, found = (calibrate(x, plain(x), surrogates=199, level=0.05, seed=1).maxima for x in (b, other))
    assert np.median(found) == pytest.approx(np.median(usual), rel=1e-3)


def test_without_surrogates_the_bound_grows_with_the_number_of_questions():
    b = null(2)
    c = calibrate(b, plain(b), surrogates=0, level=0.05, seed=1)
    assert c.maxima.size == 0
    assert c.threshold > 3.84  # one question at 0.05
    assert calibrate(b, plain(b), surrogates=0, level=0.01, seed=1).threshold > c.threshold


def test_gumbel_is_the_share_beyond():
    rng = np.random.default_rng(3)
    maxima = rng.gumbel(5.0, 2.0, 20000)
    for q in (0.5, 0.1, 0.01):
        x = 5.0 - 2.0 * np.log(-np.log1p(-q))
        assert gumbel_p(maxima, x) == pytest.approx(q, rel=0.1)


def test_gumbel_is_never_below_what_was_counted():
    maxima = np.array([1.0, 1.0, 1.0, 1.0, 50.0])
    assert gumbel_p(maxima, 49.0) >= 0.2
    assert gumbel_p(maxima, 1e6) < 1e-6
    assert gumbel_p(np.zeros(9), 0.5) >= 0.0
