"""Spreads put together: pooled where they agree, by drives where those refute the assumptions."""

import numpy as np
import pytest

from aqualog.calibrate import spread as spreads
from aqualog.calibrate.derive import estimates
from tests.calibrate.test_balance import RHO, drives


@pytest.mark.parametrize("times", [1.0, 4.0, *(pytest.param(x, marks=pytest.mark.nightly) for x in (2.0, 25.0))])
def test_combined_intervals_cover_whatever_the_drives_differ_by(times):
    """Four drives whose variance is so many times the assumed one."""
    rng = np.random.default_rng([int(times), 5])
    inside = []
    for _ in range(3000):
        seen = spreads.Spread({"x": np.sqrt(times * rng.chisquare(3) / 3.0)}, {"x": 3.0}, by_drive=True)
        both = spreads.combined(spreads.Spread({"x": 1.0}, {"x": 1e6}, by_drive=False), seen)
        inside.append(abs(np.sqrt(times) * rng.normal()) <= spreads.half_width(both.sd["x"], both.dof["x"]))
    assert 0.92 < np.mean(inside) < 0.98


def test_pooled_where_they_agree_by_drives_where_not():
    assumed = spreads.Spread({"x": 1.0}, {"x": 9.0}, by_drive=False)
    agreeing = spreads.combined(assumed, spreads.Spread({"x": 0.8}, {"x": 3.0}, by_drive=True))
    assert agreeing.dof["x"] == 12.0
    assert agreeing.sd["x"] == pytest.approx(np.sqrt((9.0 + 3.0 * 0.64) / 12.0))
    refuting = spreads.combined(assumed, spreads.Spread({"x": 3.0}, {"x": 3.0}, by_drive=True))
    assert (refuting.sd["x"], refuting.dof["x"]) == (3.0, 3.0)
    unknown = spreads.combined(
        spreads.Spread({"x": np.nan}, {"x": 9.0}, by_drive=False), spreads.Spread({"x": np.nan}, {"x": 3.0}, True)
    )
    assert np.isnan(spreads.half_width(unknown.sd["x"], unknown.dof["x"]))


def test_what_sets_a_drive_apart_is_not_within_it():
    plain = [{"x": v} for v in (0.0, 1.0, 2.0, 1.0)]
    moved = [{"x": v + 50.0} for v in (0.0, 1.0, 2.0, 1.0)]
    assert spreads.stratified([plain, moved]).sd["x"] == pytest.approx(
        np.sqrt(2.0) * spreads.stratified([plain]).sd["x"]
    )
    assert spreads.stratified([plain, moved]).dof["x"] == 6.0
    # drives of one block each are one stratum; a lone one joins another
    assert spreads.stratified([[e] for e in plain]).sd["x"] == pytest.approx(spreads.stratified([plain]).sd["x"])
    assert spreads.stratified([plain[:3], plain[3:]]).dof["x"] == 3.0


def test_winds_of_drives_count_once():
    """Four drives in winds of their own: half the spread of one, not more because their blocks differ."""
    within, between = [], []
    for seed in range(20):
        samples = drives(seed, 4, noise=0.002)
        within.append(spreads.jackknife_of(lambda s: estimates(s, {}), samples).sd["drag_area"])
        spread = spreads.spread_of(lambda s: estimates(s, {}), samples, drag=4.7e-4, air_density=RHO)
        between.append(spread.sd["drag_area"])
    one = 0.7 * spreads.WIND_SD / 22.0  # [m^2] a wind w adds 2 v w to v^2: w / v of the drag area
    assert np.median(between) == pytest.approx(one / np.sqrt(4.0), rel=0.25)
    assert np.median(within) < 0.25 * np.median(between)


def test_one_drive_more_lies_within_its_spread():
    """Five drives and a sixth, seen from the mean of the five."""
    rng = np.random.default_rng(7)
    inside = []
    for _ in range(2000):
        x = rng.normal(size=6)
        seen = spreads.Spread({"x": float(np.std(x[:5], ddof=1)) / np.sqrt(5.0)}, {"x": 4.0}, by_drive=True)
        inside.append(abs(x[5] - x[:5].mean()) <= 1.96 * spreads.one_more(seen, 5)["x"])
    assert 0.93 < np.mean(inside) < 0.97
    assert spreads.one_more(spreads.Spread({"x": 1.0}, {"x": 9.0}, by_drive=False), 2) == {}
