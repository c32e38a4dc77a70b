"""Gain of an extended model: root mean squares, log scores with their interval, share of the truth's gain."""

import math

import numpy as np
import pytest

from aqualog.core.errors import FitError
from aqualog.diagnose.gain import BLOCK_S, HeldOut, block_scores, channel_gain, corridor_share, gain, log_score_gain

RNG = np.random.default_rng(11)
UNITS = {"force_balance": "m/s^2", "kinematic": "m/s^2"}


def made(name, n=3000, after=1.0, seed=0, blocks=15):
    """A drive of 0.1 s samples whose residual falls from 2 to `after`."""
    rng = np.random.default_rng(seed)
    z = rng.standard_normal((1, n))
    before, now = 2.0 * z, after * z
    mask = np.ones(n, dtype=bool)
    return HeldOut(
        name, mask, {"force_balance": before[0]}, {"force_balance": now[0]}, block_scores(before, dt=0.1),
        block_scores(now, dt=0.1),
    )  # fmt: skip


def test_rms_over_all_drives_counts_samples_that_both_have():
    a, b = np.array([3.0, np.nan, 1.0, 100.0]), np.array([1.0, 1.0, np.nan, 100.0])
    mask = np.array([True, True, True, False])
    c = channel_gain("slip_fl", "-", [a, np.array([4.0])], [b, np.array([2.0])], masks=[mask, np.array([True])])
    assert (c.channel, c.unit) == ("slip_fl", "-")
    assert c.rmse_before == pytest.approx(math.sqrt((9.0 + 16.0) / 2.0))
    assert c.rmse_after == pytest.approx(math.sqrt((1.0 + 4.0) / 2.0))
    assert math.isnan(c.free_before)
    assert math.isnan(c.free_after)


def test_free_running_is_told_beside_one_step():
    x = np.ones(10)
    c = channel_gain("kinematic", "m/s^2", [x], [0.5 * x], free_before=[4.0 * x], free_after=[3.0 * x])
    assert (c.rmse_before, c.rmse_after, c.free_before, c.free_after) == (1.0, 0.5, 4.0, 3.0)


def test_no_sample_is_no_number():
    assert math.isnan(channel_gain("a", "-", [np.full(3, np.nan)], [np.zeros(3)]).rmse_before)


def test_blocks_add_up_to_the_whole():
    z = RNG.standard_normal((2, 1050))
    z[0, 100:200] = np.nan
    scores = block_scores(z, dt=0.1, log_scale=np.log([2.0, 3.0]))
    assert scores.size == 5  # the last 5 s belong to the block before
    whole = -0.5 * np.nansum(z**2) - 950 * math.log(2.0) - 1050 * math.log(3.0)
    assert scores.sum() == pytest.approx(whole)
    first = -0.5 * np.nansum(z[:, :200] ** 2) - 100 * math.log(2.0) - 200 * math.log(3.0)
    assert scores[0] == pytest.approx(first)


def test_a_short_drive_is_one_block():
    assert block_scores(np.ones(7), dt=0.1).tolist() == [-3.5]


def test_score_gain_is_that_of_the_densities():
    """A model whose noise is twice too large against the right one, each judged with its own noise."""
    x = RNG.standard_normal(40_000)
    before = block_scores(x / 2.0, dt=0.1, log_scale=math.log(2.0))
    after = block_scores(x, dt=0.1)
    found = log_score_gain([before], [after], seed=1)
    expected = x.size * (math.log(2.0) - 0.5 + 0.125)  # Kullback-Leibler divergence
    assert found.low < expected < found.high
    assert found.value == pytest.approx(expected, rel=0.03)


def test_gain_is_deterministic():
    g = [RNG.standard_normal(12)]
    zero = [np.zeros(12)]
    assert log_score_gain(zero, g, seed=3) == log_score_gain(zero, g, seed=3)
    assert log_score_gain(zero, g, seed=3) != log_score_gain(zero, g, seed=4)


@pytest.mark.parametrize(("drives", "blocks"), [(1, 15), (3, 15), (8, 15), (3, 1)])
@pytest.mark.parametrize(
    ("n", "least", "most"), [(120, 0.88, 0.995), pytest.param(500, 0.90, 0.98, marks=pytest.mark.nightly)]
)
def test_interval_covers(drives, blocks, n, least, most):
    """Many sets of drives; where drives are the units, their own gains vary too. All of 120 sets within: too wide."""
    rng = np.random.default_rng(5)
    covered = 0
    for seed in range(n):
        mean = 3.0 + rng.standard_normal(drives) * (2.0 if drives >= 5 or blocks == 1 else 0.0)
        gains = [m + 5.0 * rng.standard_normal(blocks) for m in mean]
        found = log_score_gain([np.zeros(blocks)] * drives, gains, seed=seed, draws=400)
        covered += found.low <= 3.0 * drives * blocks <= found.high
    assert least <= covered / n <= most


def test_spread_between_drives_counts_from_five_drives_on():
    """Drives that differ widely, each the same throughout: blocks see no doubt, drives do."""
    each = [np.full(15, float(m)) for m in (1, 2, 9, 4, 3)]
    zeros = [np.zeros(15)] * 5
    few = log_score_gain(zeros[:4], each[:4], seed=1)
    many = log_score_gain(zeros, each, seed=1)
    assert few.high - few.low < 1e-9
    assert many.low < 0.75 * many.value < many.high


def test_one_block_has_no_interval():
    found = log_score_gain([np.zeros(1)], [np.ones(1)], seed=1)
    assert found.value == 1.0
    assert math.isnan(found.low)


def test_blocks_that_do_not_match_are_refused():
    with pytest.raises(FitError, match="same blocks"):
        log_score_gain([np.zeros(3)], [np.zeros(4)], seed=1)
    with pytest.raises(FitError, match="finite"):
        log_score_gain([np.zeros(3)], [np.full(3, np.nan)], seed=1)


def test_corridor_share():
    measured = np.array([10.0, 0.0, -5.0, 5.0])
    assert corridor_share(measured, measured) == 1.0
    assert corridor_share(measured + 0.4, measured) == 1.0
    assert corridor_share(measured + 6.0, measured) == 0.0
    assert corridor_share(measured + 2.75, measured) == pytest.approx(0.25)
    assert corridor_share(measured + np.array([0.0, 9.0, 0.0, 9.0]), measured) == 0.5
    assert corridor_share(measured, measured, np.array([True, False, False, False])) == 1.0
    assert math.isnan(corridor_share(measured, np.zeros(4)))


def test_the_record_of_a_gain():
    g = gain([made("a", seed=1), made("b", seed=2)], UNITS, seed=1)
    assert [c.channel for c in g.channels] == ["force_balance"]
    assert g.channels[0].rmse_after == pytest.approx(0.5 * g.channels[0].rmse_before)
    assert 0.0 < g.low < g.log_score < g.high
    assert g.heldout == ("a", "b")
    assert not g.in_sample
    assert g.notes == (
        "the interval of the log score holds for the drives named; they are too few for a wider statement",
    )


def test_the_record_tells_what_is_worse():
    g = gain([made("a", seed=1), made("b", after=2.5, seed=2)], UNITS, seed=1)
    assert "worse with the model: b" in g.notes
    none = gain([made("a", after=2.0, seed=1)], UNITS, seed=1)
    assert none.log_score == 0.0
    assert "no measurable gain" in none.notes


def test_in_sample_is_told():
    g = gain([made("a")], UNITS, seed=1, in_sample=True)
    assert g.in_sample
    assert g.heldout == ()
    assert "fitted to" in g.notes[0]


def test_many_drives_are_units():
    g = gain([made(str(i), seed=i) for i in range(6)], UNITS, seed=1)
    assert g.notes == ("the interval of the log score holds for 6 other drives of this kind",)
    with pytest.raises(FitError):
        gain([], UNITS, seed=1)


def test_a_block_is_as_long_as_it_says():
    assert block_scores(np.zeros(round(3 * BLOCK_S / 0.05)), dt=0.05).size == 3
