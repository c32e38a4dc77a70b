"""What a log can tell apart: exact twins are named as such, and limits fall as the signature grows."""

import numpy as np
import pytest

from aqualog.diagnose.competition import COARSE, Block, packed, scores
from aqualog.diagnose.evidence import forgiving
from aqualog.diagnose.isolate import confusions, likelier_than_none, limits, p_correct, reference_sizes
from tests.diagnose.test_subsets import ASKED, AT, bench_of, plain, waves

THRESHOLD = 20.0


def scaled(change=lambda s: None, by=1.0):
    s = by * waves(1500, len(ASKED), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
    change(s)
    return bench_of(np.random.default_rng(0).standard_normal((2, 1500)), s)


def judged(b):
    G = plain(b)
    sizes = reference_sizes(b, G, THRESHOLD)
    return G, sizes, confusions(b, G, sizes)


def pair(found, effect, rival):
    return next(c for c in found if c.effect == effect and c.rivals == (rival,))


def test_exact_twins_are_a_coin_toss_with_a_relation():
    def twin(s):
        s[AT["accelerometer_bias@a_x"]] = s[AT["road_grade"]] / 9.81

    b = scaled(twin)
    _, _, found = judged(b)
    one = pair(found, "road_grade", "accelerometer_bias@a_x")
    assert one.p_correct == pytest.approx(0.5, abs=0.02)
    assert (
        one.relation
        == "On this log road grade of +0.002 rad looks exactly like accelerometer bias (longitudinal) of +0.0196 m/s²."
    )
    assert one.sizes == pytest.approx((0.002, 0.01962), rel=1e-3)
    other = pair(found, "accelerometer_bias@a_x", "road_grade")
    assert other.sizes[1] == pytest.approx(0.03 / 9.81, rel=1e-3)


def test_what_is_unlike_is_told_apart():
    _, _, found = judged(scaled())
    one = pair(found, "road_grade", "payload_mass")
    assert one.p_correct > 0.95
    assert one.relation == ""
    assert one.sizes == ()


def test_two_rivals_that_only_imitate_together_are_told():
    def sum_of_two(s):
        s[0] = (0.02 * s[0] * 0.0 + 0.1 * s[AT["aero_drag"]] + 100.0 * s[AT["payload_mass"]]) / 0.02

    _, _, found = judged(scaled(sum_of_two))
    both = [c for c in found if c.effect == "road_grade" and set(c.rivals) == {"aero_drag", "payload_mass"}]
    assert len(both) == 1
    assert both[0].p_correct == pytest.approx(0.5, abs=0.02)
    assert "aero drag" in both[0].relation
    assert "payload mass" in both[0].relation
    assert pair(found, "road_grade", "payload_mass").p_correct > 0.9


def test_limits_shrink_with_energy():
    far, near = (limits(b, reference_sizes(b, plain(b), THRESHOLD)) for b in (scaled(by=0.2), scaled(by=0.4)))
    assert {x.effect for x in far} == {h.effect.name for h in ASKED}
    for a, b in zip(far, near, strict=True):
        smallest = ASKED[[h.key for h in ASKED].index(a.effect if a.where is None else f"{a.effect}@{a.where}")]
        least = smallest.worth_naming(smallest.free[0])
        assert a.unit == b.unit
        if b.size > least:
            assert b.size == pytest.approx(0.5 * a.size, rel=0.01)
        else:
            assert b.size == b.smallest == least


def test_the_limit_has_the_power_it_says():
    b = scaled(by=0.2)
    G = plain(b)
    i = AT["head_wind"]
    size = reference_sizes(b, G, THRESHOLD)[i]
    found = np.random.default_rng(1).standard_normal(20000) + size * np.sqrt(G[i, i])
    assert (found**2 > THRESHOLD).mean() == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("of_file", [0.0, 0.05, 0.5, 1.0])
def test_at_the_limit_an_effect_is_as_likely_as_none(of_file):
    b = scaled(by=0.2)
    i = AT["head_wind"]
    c, sigma = b.columns[i][0], b.prior[b.columns[i][0]]
    allowed = np.zeros((b.count, b.count))
    allowed[c, c] = (of_file * sigma) ** 2
    block = Block("head_wind", "effect", (c,), np.eye(1) * sigma**2, np.log(0.03), i)
    size = likelier_than_none(b, [block], forgiving(COARSE * plain(b), allowed).gram)[c]
    inner = COARSE * plain(b)
    inner[:, -1] = inner[-1] = size * np.append(inner[:-1, c], 0.0)
    gain = scores(forgiving(inner, allowed).gram, packed([block])[0])[0][0]
    assert 0.0 <= gain + block.log_prior <= np.log(2.0)  # one of the prior's two scales alone reaches zero


def test_what_is_never_seen_has_no_limit():
    def silent(s):
        s[AT["road_grade"]] *= 1e-9

    b = scaled(silent)
    found = {x.effect: x.size for x in limits(b, reference_sizes(b, plain(b), THRESHOLD))}
    assert np.isnan(found["road_grade"])
    _, _, told = judged(b)
    assert all(c.effect != "road_grade" and "road_grade" not in c.rivals for c in told)


def test_the_chance_of_the_right_one():
    assert p_correct(0.0) == 0.5
    assert p_correct(4.0) == pytest.approx(0.8413, abs=1e-4)
