"""Gain of an extended model: root mean squares, log scores with their interval, what the interval holds for."""

import math

import numpy as np
import pytest

from aqualog.core.errors import FitError
from aqualog.diagnose import arena, gain, run
from aqualog.diagnose.gain import BLOCK_S, block_scores, log_score_gain, rms_of_both, scope
from aqualog.diagnose.records import Gain
from aqualog.diagnose.verdict import Outcome
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, term
from tests.diagnose.test_run import FEW, QUICK, ask, noisy
from tests.diagnose.test_verdict import cause

RNG = np.random.default_rng(11)


def test_rms_over_all_drives_counts_samples_that_both_have():
    a, b = np.array([3.0, np.nan, 1.0, 100.0]), np.array([1.0, 1.0, np.nan, 100.0])
    mask = np.array([True, True, True, False])
    before, after = rms_of_both([a, np.array([4.0])], [b, np.array([2.0])], [mask, np.array([True])])
    assert before == pytest.approx(math.sqrt((9.0 + 16.0) / 2.0))
    assert after == pytest.approx(math.sqrt((1.0 + 4.0) / 2.0))


def test_no_sample_is_no_number():
    assert np.isnan(rms_of_both([np.full(3, np.nan)], [np.zeros(3)], [np.ones(3, dtype=bool)])).all()


def test_blocks_add_up_to_the_whole():
    z = RNG.standard_normal((2, 1050))
    scores = block_scores(z, 0.1)
    assert scores.size == 5  # the last 5 s belong to the block before
    assert scores.sum() == pytest.approx(-0.5 * (z**2).sum())
    assert scores[0] == pytest.approx(-0.5 * (z[:, :200] ** 2).sum())
    assert block_scores(np.zeros((1, round(3 * BLOCK_S / 0.05))), 0.05).size == 3


def test_a_short_drive_is_one_block():
    assert block_scores(np.ones((1, 7)), 0.1).tolist() == [-3.5]


def test_score_gain_is_that_of_the_densities():
    """Innovations that are twice too large against unit ones."""
    x = RNG.standard_normal((1, 40_000))
    found = log_score_gain([block_scores(2.0 * x, 0.1)], [block_scores(x, 0.1)], seed=1)
    expected = 1.5 * x.size
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
def test_interval_covers(drives, blocks, n, least, most, monkeypatch):
    """Many sets of drives; where drives are the units, their own gains vary too. All of 120 sets within: too wide."""
    monkeypatch.setattr(gain, "DRAWS", 400)
    rng = np.random.default_rng(5)
    covered = 0
    for seed in range(n):
        mean = 3.0 + rng.standard_normal(drives) * (2.0 if drives >= 5 or blocks == 1 else 0.0)
        gains = [m + 5.0 * rng.standard_normal(blocks) for m in mean]
        found = log_score_gain([np.zeros(blocks)] * drives, gains, seed=seed)
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


def scores_of(*after, drives=2):
    """Scores of drives in blocks: 2 by innovations of twice the size, and with `after` in their place."""
    z = [np.random.default_rng(k).standard_normal((1, 3000)) for k in range(drives)]
    factors = [*after, *[1.0] * (drives - len(after))]
    before = [block_scores(2.0 * x, 0.1) for x in z]
    return before, [block_scores(f * x, 0.1) for f, x in zip(factors, z, strict=True)]


def notes(*after, drives=2, in_sample=False):
    scores = scores_of(*after, drives=drives)
    won = log_score_gain(*scores, seed=1)
    return won, scope([str(k) for k in range(drives)], *scores, won, in_sample=in_sample)


def test_few_drives_speak_for_themselves():
    won, said = notes()
    assert 0.0 < won.low < won.value < won.high
    assert said == ("the interval of the log score holds for the drives named; they are too few for a wider statement",)


def test_notes_tell_what_is_worse():
    assert "the model predicts 0 worse than before" in notes(2.5)[1]
    won, said = notes(2.0, drives=1)
    assert won.value == 0.0
    assert "no measurable gain" in said


def test_in_sample_is_told():
    assert "to which the model was fitted" in notes(drives=1, in_sample=True)[1][0]


def test_many_drives_are_units():
    assert notes(drives=6)[1] == ("the interval of the log score holds for 6 other drives of this kind",)


@pytest.mark.parametrize(("is_burst", "in_sample", "certain", "left"), [
    (True, True, False, "no_effect"), (True, False, False, "no_effect"), (False, True, False, "named"),
    (True, True, True, "named"),
])  # fmt: skip
def test_an_answer_that_one_block_alone_speaks_for_is_none(is_burst, in_sample, certain, left):
    """A burst of noise fits a delay in 20 s, and the rest of the drive is predicted worse with it."""
    own, _ = cause("payload_mass")
    found = Gain((), 30.0, 1.0, 60.0, () if in_sample else ("b",), in_sample, promised=100.0, is_burst=is_burst)
    named = Outcome("named", (own,), certain=frozenset({"payload_mass"}))
    after = run._by_gain(named, found, frozenset({"payload_mass"} if certain else ()))
    assert after.verdict == left
    assert after.causes == (() if left == "no_effect" else (own,))
    assert bool(after.notes) == (left == "no_effect")


@pytest.mark.parametrize(("gains", "burst"), [
    ([97.0, 8.0, -23.0, -52.0], True), ([97.0, 8.0, -3.0, 1.0], False), ([97.0, -3.0, -4.0], False), ([-5.0, -30.0, -40.0], False),
    ([40.0, 30.0, 20.0], False), ([50.0], False),
])  # fmt: skip
def test_one_block_alone_gains_and_the_rest_loses(gains, burst, monkeypatch):
    """More than a tenth of the 100 that are promised, on both sides; of a single block there is no rest."""
    compared = gain._Compared([], [], [np.zeros(len(gains))], [np.array(gains)], 100.0)
    monkeypatch.setattr(gain, "_compared", lambda *_: compared)
    assert gain.gains_by_burst((), (Model(),) * 3, None) == burst


@pytest.mark.parametrize("holdout", [False, True])
def test_a_burst_is_sought_in_the_diagnosed_drive(holdout, monkeypatch):
    """Where others are held out as well."""
    ask(monkeypatch, FEW)
    monkeypatch.setattr(arena, "shapes", lambda *_: ())
    monkeypatch.setattr(gain, "_is_burst", lambda before, *_: len(before[0]) == 4)  # blocks of the diagnosed drive
    others = [("b", noisy(term("payload_mass", delta_mass=250.0), seed=9, duration_s=60.0))] if holdout else []
    log = noisy(term("payload_mass", delta_mass=250.0), seed=3)
    d = run.diagnose([("a", log)], CAR, holdout=others, options=QUICK)
    assert d.verdict == "no_effect"
    assert any("speak for it" in n for n in d.notes)
