"""How a benchmark is judged: by results first, then by the time of the same work."""

import time

import pytest

from tests.bench.compare import Row, line, measured


def test_results_that_differ_are_no_benchmark():
    with pytest.raises(AssertionError, match="row: 1 is not 2"):
        measured(Row("row", "peer", 1.0, lambda: 1, lambda: 2, lambda a, b: "" if a == b else f"{a} is not {b}"))


def test_the_ratio_is_per_unit_of_work():
    row = Row("row", "peer", 1.5, lambda: 0.02, lambda: 0.02, cost=float, work=10.0, peer_work=5.0, rounds=3)
    m = measured(row)
    assert m.ratios == pytest.approx((2.0, 2.0, 2.0))
    assert m.is_reached
    assert "| reached |" in line(m)


def test_a_time_in_seconds_is_a_peer():
    m = measured(Row("row", "real time", 1e6, lambda: time.sleep(0.01), 1.0, clock="wall", rounds=3))
    assert all(1.0 < r < 101.0 for r in m.ratios)  # a busy machine sleeps longer, never shorter
    assert "not reached" in line(m)
