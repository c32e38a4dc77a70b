"""Sets: means of censored runs, runs that differ from their set."""

import math

import numpy as np
import pytest
from scipy import optimize, stats

from aqualog.trade.likelihood import censored_mean, log_upper_tail
from aqualog.trade.limits import defaults
from aqualog.trade.sets import expected_in_set, summarised

LIMITS = defaults().set


def test_without_censored_runs_it_is_the_t_interval():
    x = np.array([76.0, 78.0, 80.0, 78.0])
    found = censored_mean(x, np.zeros(0))
    assert found.mean == 78.0
    assert found.sd == pytest.approx(math.sqrt(8.0 / 3.0))
    half = 3.182446 * math.sqrt(8.0 / 3.0) / 2.0  # t of 3 degrees of freedom
    assert found.ci == pytest.approx((78.0 - half, 78.0 + half), abs=1e-4)


def test_a_bound_far_below_says_nothing():
    x = np.array([76.0, 78.0, 80.0, 78.0])
    plain, more = censored_mean(x, np.zeros(0)), censored_mean(x, np.array([20.0]))
    assert more.mean == pytest.approx(plain.mean, abs=1e-4)
    assert more.ci == pytest.approx(plain.ci, abs=1e-4)
    assert more.sd == pytest.approx(plain.sd, abs=1e-4)


def test_censored_mean_is_the_maximum_of_the_likelihood():
    x, c = np.array([78.0, 79.0, 80.5, 77.2]), np.array([79.0, 81.0])

    def loss(p):
        s = math.exp(p[1])
        return -stats.norm.logpdf(x, p[0], s).sum() - stats.norm.logsf(c, p[0], s).sum()

    best = optimize.minimize(loss, [79.0, 0.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12})
    found = censored_mean(x, c)
    assert found.mean == pytest.approx(best.x[0], abs=1e-4)
    assert found.sd == pytest.approx(math.exp(best.x[1]) * math.sqrt(4.0 / 3.0), abs=1e-4)
    # the ends: the profile likelihood falls by m/2 log(1 + t^2 / (m - 1))
    fall = 2.0 * math.log1p(stats.t.ppf(0.975, 3) ** 2 / 3.0)
    for end in found.ci:
        at = optimize.minimize_scalar(lambda s, end=end: loss([end, s]), bounds=(-3.0, 5.0), method="bounded")
        assert at.fun - best.fun == pytest.approx(fall, abs=1e-3)


def test_upper_tail():
    z = np.array([-40.0, 0.0, 2.0, 10.0, 29.9, 30.1, 60.0])
    assert log_upper_tail(z) == pytest.approx(stats.norm.logsf(z), rel=2e-6)


@pytest.mark.parametrize(
    ("values", "bounds", "mean"),
    [([], [], None), ([80.0], [], 80.0), ([80.0], [85.0], None), ([80.0, 80.0], [], 80.0),
     ([80.0, 80.0], [79.0], 80.0)],
)  # fmt: skip
def test_too_little_for_an_interval_is_no_error(values, bounds, mean):
    found = censored_mean(np.array(values), np.array(bounds))
    assert (None if math.isnan(found.mean) else found.mean) == mean
    assert not found.ci[1] - found.ci[0] > 1e-9


def test_two_equal_values_below_a_bound_have_a_finite_mean():
    found = censored_mean(np.array([80.0, 80.0, 80.0]), np.array([81.0]))
    assert 80.0 < found.mean < 82.0
    assert found.ci[0] < found.mean < found.ci[1]


def test_a_mean_beyond_all_that_was_seen():
    x, c = np.array([78.0, 84.0]), np.full(6, 85.0)
    best = optimize.minimize(
        lambda p: -stats.norm.logpdf(x, p[0], math.exp(p[1])).sum() - stats.norm.logsf(c, p[0], math.exp(p[1])).sum(),
        [86.0, 1.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12},
    )  # fmt: skip
    found = censored_mean(x, c)
    assert found.mean == pytest.approx(best.x[0], abs=1e-3)
    assert found.mean > 85.0


@pytest.mark.parametrize(("n", "cut"), [(6, 0.5), (5, 1.0)])
def test_coverage_with_censored_runs(n, cut):
    rng = np.random.default_rng(3)
    inside = done = 0
    for _ in range(150):
        y = rng.normal(78.0, 1.5, n)
        high = y > 78.0 + 1.5 * cut
        found = censored_mean(y[~high], np.full(high.sum(), 78.0 + 1.5 * cut))
        if math.isfinite(found.mean):
            done += 1
            inside += found.ci[0] <= 78.0 <= found.ci[1]
    assert done > 130
    assert 0.91 < inside / done <= 1.0


def test_summary():
    found = summarised([76.0, 78.0, 80.0], [], 5, LIMITS)
    assert (found.runs, found.valid, found.censored, found.dof) == (5, 3, 0, 2)
    assert found.cv == pytest.approx(2.0 / 78.0)
    assert found.notes == ()
    assert found.is_enough
    assert not summarised([76.0, 78.0], [], 5, LIMITS).is_enough
    assert not summarised([68.0, 78.0, 88.0], [], 3, LIMITS).is_enough
    assert "coefficient of variation is 12.8 %" in summarised([68.0, 78.0, 88.0], [], 3, LIMITS).notes[0]


def test_summary_of_runs_that_all_went_beyond():
    found = summarised([], [88.0, 92.0, 90.0], 3, LIMITS)
    assert math.isnan(found.mean)
    assert found.above == 88.0
    assert "the mean lies above" in found.notes[0]


def test_summary_of_one_run_and_of_none():
    one = summarised([78.0], [], 1, LIMITS)
    assert one.mean == 78.0
    assert math.isnan(one.ci[0])
    assert "1 valid run of 1, at least 3 needed" in one.notes
    assert summarised([], [], 4, LIMITS).valid == 0
    assert "give no mean" in " ".join(summarised([78.0], [80.0, 81.0], 3, LIMITS).notes)
    assert "no width" in " ".join(summarised([78.0, 78.0, 78.0], [], 3, LIMITS).notes)
    assert summarised([0.7] * 6, [], 6, LIMITS).sd == 0.0  # a mean of equal floats is another float


def away(values, *of):
    expected = expected_in_set(values, *of)
    return [bool(abs(x - e) > 0.1 * e) for x, e in zip(values, expected, strict=True)]


def test_away_from_the_median():
    assert away([1.3, 1.31, 1.29, 1.6]) == [False, False, False, True]
    assert away([1.3, 1.6]) == [False, False]  # which of two is the odd one?
    assert away([1.3, math.nan, 1.31, 1.0]) == [False, False, False, True]


def test_accelerations_are_compared_at_like_share_of_water():
    v, wet = np.linspace(66.0, 69.0, 7), np.array([0.6, 0.4, 0.7, 0.45, 0.4, 1.0, 0.5])  # the sixth entered slowly
    full = 1.7 * (67.0 / v) * (1.0 - 0.35 * (wet - 0.4))
    assert away(full, v)[5]
    assert not any(away(full, v, wet))
    assert away(np.where(np.arange(7) == 5, 0.75 * full, full), v, wet) == [False] * 5 + [True, False]


def test_accelerations_are_compared_at_like_speed():
    v = np.array([77.0, 86.0, 86.5, 87.0, 88.0, 85.0])  # the first one ends with a short lane
    full = 1.3 * (86.0 / v) ** 1.2
    assert away(full) == [True, *[False] * 5]
    assert expected_in_set(full, v) == pytest.approx(full, rel=0.01)
    for k in (0, 3):
        part = np.where(np.arange(6) == k, 0.75 * full, full)
        assert away(part, v) == [i == k for i in range(6)]
    assert expected_in_set([1.3, 1.2, 1.1], [86.0, 86.1, 86.2]) == pytest.approx([1.2028, 1.2, 1.1972], abs=1e-4)
    assert expected_in_set([1.3, 1.2, 1.1], [86.0, 86.0, 86.0]) == pytest.approx([1.2, 1.2, 1.2])
