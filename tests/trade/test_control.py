"""The control tyre: between its sets, drift, and the index with Fieller's interval."""

import math

import numpy as np
import pytest

from aqualog.trade.control import Block, Control, Estimate, blocks_of, combined, fieller, index_of, satterthwaite


def test_fieller_by_hand():
    # 80 +- 1 over 75 +- 2, t = 2 (dof 60.4 gives about 2): solved with the quadratic formula
    a, b = Estimate(80.0, 1.0, 1e6), Estimate(75.0, 4.0, 1e6)
    t2 = 1.959964**2
    A, B, C = 75.0**2 - t2 * 4.0, -2.0 * 80.0 * 75.0, 80.0**2 - t2 * 1.0
    root = math.sqrt(B * B - 4.0 * A * C)
    assert fieller(a, b) == pytest.approx(((-B - root) / (2 * A), (-B + root) / (2 * A)), rel=1e-4)


def test_fieller_limits():
    a, exact = Estimate(80.0, 1.0, 5.0), Estimate(40.0, 0.0, 5.0)
    low, high = fieller(a, exact)
    assert (low, high) == pytest.approx(((80 - 2.570582) / 40, (80 + 2.570582) / 40), rel=1e-4)
    assert fieller(Estimate(80.0, 0.0, 5.0), exact) == (2.0, 2.0)
    assert math.isnan(fieller(a, Estimate(1.0, 1.0, 5.0))[0])  # a control that may be 0
    assert math.isnan(fieller(Estimate(80.0, math.nan, 0.0), exact)[0])
    assert math.isnan(fieller(a, Estimate(0.0, 1.0, 5.0))[0])


def test_degrees_of_freedom():
    assert satterthwaite([2.0, 2.0], [4.0, 4.0]) == pytest.approx(8.0)
    assert satterthwaite([2.0, 0.0], [4.0, 9.0]) == pytest.approx(4.0)


def test_blocks():
    orders = [3.0, 0.0, 1.0, 2.0, 4.0]
    own = [True, True, False, False, True]  # in order: own, other, other, own, own
    assert blocks_of(orders, own) == [[1], [0, 4]]
    assert blocks_of([0.0], [False]) == []


def control(*blocks, pooled=True):
    made = tuple(Block(o, Estimate(v, 0.25, 10.0), 4) for o, v in blocks)
    return Control("SRTT", made, is_pooled=pooled)


def test_control_between_its_sets():
    c = control((2.0, 80.0), (12.0, 84.0))
    at = c.at([7.0])
    assert at.value == pytest.approx(82.0)
    assert at.variance == pytest.approx(0.5**2 * 0.25 * 2)  # half of each
    assert at.dof == 10.0
    assert c.at([4.0, 6.0]).value == pytest.approx(81.2)
    assert c.at([0.0]).value == 80.0  # before the first: the first
    assert c.at([99.0]).value == 84.0
    assert control((2.0, 80.0), (12.0, 84.0), pooled=False).at([7.0]).dof == pytest.approx(20.0)


def test_combined_leaves_out_what_has_no_weight():
    parts = [Estimate(80.0, 0.25, 10.0), Estimate(math.nan, math.nan, 0.0)]
    assert combined(parts, np.array([1.0, 0.0]), is_pooled=True).value == 80.0


def test_drift():
    drift = control((2.0, 80.0), (12.0, 84.0)).drift()
    assert drift is not None
    assert drift.change == pytest.approx(0.05)
    assert drift.ci[0] < 0.05 < drift.ci[1]
    assert control((2.0, 80.0)).drift() is None


def test_index_takes_the_drift_out():
    c = control((2.0, 80.0), (12.0, 84.0))
    same = index_of(Estimate(82.0, 0.25, 5.0), [6.0, 7.0, 8.0], c)
    assert same.value == pytest.approx(100.0)
    assert same.sentence.startswith("not different from SRTT: index 100.0 (")
    better = index_of(Estimate(86.1, 0.25, 5.0), [7.0], c, of=110.0)
    assert better.value == pytest.approx(115.5)
    assert better.sentence.startswith("5.5 points above SRTT: index 115.5 (")
    assert "5.0 points below SRTT" in index_of(Estimate(77.9, 0.25, 5.0), [7.0], c).sentence


def test_index_without_spread_says_so():
    found = index_of(Estimate(82.0, math.nan, 0.0), [7.0], control((2.0, 80.0)))
    assert "without an interval" in found.sentence
    assert index_of(Estimate(math.nan, math.nan, 0.0), [7.0], control((2.0, 80.0))).sentence.startswith("no index")
