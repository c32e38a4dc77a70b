"""The curve test: one pass, concave curves, and what a set says."""

import math

import numpy as np
import pytest

from aqualog.report.trade.sections import _speed_text
from aqualog.trade.concave import area_under, concave_fit, falls_to, nonnegative
from aqualog.trade.curve import CurvePass, curve_passes
from aqualog.trade.curve_set import common_speeds, curve_set
from aqualog.trade.limits import defaults
from tests.trade.made import KMH, signals

LIMITS = defaults().curve


def drive(*, kmh=80.0, radius=100.0, wet=2.0, least=1.0, sign=1.0, rate=100.0):
    """Eight seconds on a circle; from 5 s on 1 s in the trough with `wet` m/s², `least` for 0.3 s."""
    t = np.arange(0.0, 8.0, 1.0 / rate)
    v = np.full(t.size, kmh * KMH)
    on = (t >= 5.0) & (t <= 6.0)
    a_y = np.where(on, wet, v**2 / radius)
    a_y[(t >= 5.3) & (t < 5.6)] = least
    return {"v_x": v, "a_y": sign * a_y, "steer_angle": np.full(t.size, sign * 0.03), "on_water": on.astype(float)}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_pass(sign):
    (p,) = curve_passes(signals(drive(sign=sign)), radius=100.0)
    assert p.valid, p.reasons
    assert p.v_entry == pytest.approx(80 * KMH)
    assert p.a_y_dry == pytest.approx((80 * KMH) ** 2 / 100)
    assert p.a_y_least == pytest.approx(1.0)
    assert p.a_y_mean == pytest.approx((71 * 2.0 + 30 * 1.0) / 101)
    assert p.radius == pytest.approx(100.0)
    assert p.steer == pytest.approx(0.0)


def changed(**columns):
    return {**drive(), **columns}


T = np.arange(0.0, 8.0, 0.01)
ODD = {
    "no steering": (
        changed(steer_angle=np.where(T > 5.2, 0.04, 1e-7)),
        "grows more than tenfold in the trough",
    ),
    "steering": (changed(steer_angle=np.where(T > 5.2, 0.04, 0.03)), "steering angle changes by 33 %"),
    "speed": (changed(v_x=80 * KMH + np.where(T < 5.0, T - 4.0, 1.0)), "the speed changes by"),
    "straight": (changed(a_y=np.zeros(T.size)), "no curve"),
    "other circle": (changed(a_y=np.full(T.size, 2.0)), "give 4.94"),
    "no a_y": ({k: x for k, x in drive().items() if k != "a_y"}, "a_y is not in the log"),
    "no speed": ({k: x for k, x in drive().items() if k != "v_x"}, "v_x is not in the log"),
    "no lane": ({k: x for k, x in drive().items() if k != "on_water"}, "no watered lane"),
    "gap": (changed(a_y=np.where((T > 5.1) & (T < 5.5), np.nan, drive()["a_y"])), "a_y is missing there"),
    "no dry road": (changed(on_water=(T < 6.0).astype(float)), "of dry road before the trough"),
    "all NaN": (changed(a_y=np.full(T.size, np.nan)), "a_y is not in the log"),
    "km/h": (changed(omega_fl=drive()["v_x"] / 1.1, omega_rr=drive()["v_x"] / 1.1), "a radius of 1.10 m"),
    "turned yaw rate": (
        changed(yaw_rate=-drive()["a_y"] / drive()["v_x"]),
        "v_x times yaw_rate is -4.94 m/s², a_y 4.94",
    ),
    "deg/s": (changed(yaw_rate=drive()["a_y"] / drive()["v_x"] * 57.3), "v_x times yaw_rate is 282.96 m/s², a_y 4.94"),
}


@pytest.mark.parametrize("name", ODD)
def test_a_pass_that_is_none_says_why(name):
    columns, words = ODD[name]
    (p,) = curve_passes(signals(columns), radius=100.0)
    assert not p.valid
    assert words in "; ".join(p.reasons)


def test_a_pass_without_steering_angle_is_a_note():
    (p,) = curve_passes(signals({k: x for k, x in drive().items() if k != "steer_angle"}))
    assert p.valid
    assert "no steering angle" in p.notes[0]


def test_nonnegative_least_squares():
    rng = np.random.default_rng(1)
    from scipy.optimize import nnls

    for _ in range(100):
        A, b = rng.uniform(size=(12, 6)), rng.uniform(size=12)  # in one of eight a column goes out again
        assert nonnegative(A, b) == pytest.approx(nnls(A, b)[0], abs=1e-9)
    assert nonnegative(np.eye(2), np.array([-1.0, 2.0])) == pytest.approx([0.0, 2.0])


def test_concave_fit():
    x = np.array([60.0, 70.0, 80.0, 90.0])
    kept = np.array([1.0, 3.0, 4.0, 2.0])
    assert concave_fit(x, kept, x) == pytest.approx(kept)
    # a dent at 70: the best concave curve is the line through 2, 1, 3 with slope 0.05 -> 1.5, 2, 2.5
    assert concave_fit(x[:3], np.array([2.0, 1.0, 3.0]), x[:3]) == pytest.approx([1.5, 2.0, 2.5])
    twice = np.repeat(x, 2)
    assert concave_fit(twice, np.repeat(kept, 2) + np.tile([-0.5, 0.5], 4), x) == pytest.approx(kept)
    assert concave_fit(np.array([70.0, 70.0]), np.array([1.0, 3.0]), np.array([70.0])) == pytest.approx([2.0])


def test_places_and_area():
    x, y = np.array([60.0, 70.0, 80.0]), np.array([2.0, 4.0, 0.0])
    assert falls_to(x, y, 1.0) == pytest.approx(77.5)
    assert math.isnan(falls_to(x, y + 5.0, 1.0))
    assert falls_to(x, y, np.array([1.0, 2.0, 2.0])) == pytest.approx(75.0)
    assert area_under(x, y, 60.0, 80.0) == pytest.approx(30.0 + 20.0)
    assert area_under(x, y, 65.0, 75.0) == pytest.approx(0.5 * (3 + 4) * 5 + 0.5 * (4 + 2) * 5)


def passes(shift=0.0, spread=0.0, speeds=(60, 65, 70, 75, 80, 85)):
    """Least acceleration: 4 - 0.2 (v - 60) km/h, 0 at 80; mean 1 above; dry v²/R."""
    found = []
    for kmh in speeds:
        for k in (-1.0, 0.0, 1.0):
            v, least = kmh * KMH, 4.0 - 0.2 * (kmh - 60.0) + shift + k * spread
            found.append(CurvePass(v, v * v / 100.0, least, least + 1.0, 100.0))
    return found


def test_the_greatest_lies_between_steps():
    made = []
    for kmh in (55.0, 60.0, 65.0, 70.0, 75.0):
        for k in (-0.02, 0.0, 0.02):
            mean = 3.0 - 0.01 * (kmh - 66.3) ** 2 + k
            made.append(CurvePass(kmh * KMH, 2.0 + 0.04 * kmh, mean - 0.5, mean, 100.0))
    top, (low, high) = curve_set(made, LIMITS, result="mean", between=(60 * KMH, 70 * KMH)).v_greatest
    assert top / KMH == pytest.approx(66.3, abs=0.01)
    assert low < top < high


@pytest.mark.parametrize(
    ("top", "told"),
    [(50.0, "≤ 60.0"), (90.0, "≥ 80.0"), (61.5, "≤ 63.3"), (63.5, "63.5 (open … 64.5)"), (76.5, "76.5 (75.6 … open)")],
)
def test_the_greatest_at_an_end_is_a_bound(top, told):
    def at(v, k):
        mean = 3.0 - 0.01 * (v - top) ** 2 + 0.1 * k
        return CurvePass(v * KMH, 8.0, mean - 0.5, mean, 100.0)

    found = curve_set(
        [at(v, k) for v in (60.0, 65.0, 70.0, 75.0, 80.0) for k in (-1, 0, 1)], LIMITS, result="mean",
        between=(60 * KMH, 80 * KMH),
    )  # fmt: skip
    assert _speed_text(*found.v_greatest) == told
    assert any("ones may have more" in n for n in found.notes) == math.isnan(found.v_greatest[0])


def test_set_by_hand():
    made = curve_set(passes(), LIMITS, result="mean", between=(60 * KMH, 80 * KMH))
    assert made.valid == made.passes == 18
    assert made.result == pytest.approx(3.0)  # mean of 5 ... 1
    assert made.v_zero[0] / KMH == pytest.approx(79.0)  # 0.2 m/s² counts as 0
    # half of dry: least 2.0 at 70 and 1.0 at 75 km/h, half of dry 1.8904 and 2.1701 there
    assert made.v_half[0] / KMH == pytest.approx(70.0 + 5.0 * 0.1096 / (0.1096 + 1.1701), abs=0.01)
    least = curve_set(passes(), LIMITS, result="min", between=(60 * KMH, 80 * KMH))
    assert least.result == pytest.approx(2.0)
    area = curve_set(passes(), LIMITS, result="area", between=(60 * KMH, 80 * KMH))
    assert area.result == pytest.approx(3.0 * 20.0)  # m/s² km/h


def test_interval_of_a_set_by_bootstrap():
    made = curve_set(passes(spread=0.3), LIMITS, result="mean", between=(60 * KMH, 80 * KMH))
    # passes of each step scatter by 0.3: the mean over the steps by about 0.3 sqrt(weights) / sqrt(3)
    assert made.ci[0] < 3.0 < made.ci[1]
    assert 0.02 < made.estimate.variance**0.5 < 0.12
    assert made.estimate.dof == 12.0
    few = curve_set(passes(spread=0.3, speeds=(60, 65)), LIMITS, result="mean", between=(60 * KMH, 65 * KMH))
    for found, t in ((made, 2.179), (few, 2.776)):  # of 12 and 4 degrees of freedom; a step has three values to draw
        assert 0.5 * (found.ci[1] - found.ci[0]) == pytest.approx(t * found.estimate.variance**0.5, rel=0.1)
    assert made.v_zero[1][0] < made.v_zero[0] < made.v_zero[1][1]


def test_sets_that_do_not_meet():
    slow, fast = passes(speeds=(60, 65)), passes(speeds=(80, 85))
    between = common_speeds([slow, fast], LIMITS)
    assert math.isnan(between[0])
    found = curve_set(slow, LIMITS, result="mean", between=between)
    assert math.isnan(found.result)
    assert "no speed in common" in " ".join(found.notes)
    assert common_speeds([slow, passes()], LIMITS) == pytest.approx((60 * KMH, 65 * KMH))


def test_a_set_without_valid_passes_and_one_of_single_passes():
    assert curve_set([CurvePass(reasons=("no",))], LIMITS, result="mean", between=(1.0, 2.0)).valid == 0
    fast = curve_set(passes(speeds=(75, 80)), LIMITS, result="mean", between=(75 * KMH, 80 * KMH))
    assert "slowest passes, 75 km/h: slower ones may have more" in " ".join(fast.notes)
    assert "below half of the dry one from 75 km/h on" in " ".join(fast.notes)
    single = curve_set(passes()[::3], LIMITS, result="mean", between=(60 * KMH, 80 * KMH))
    assert single.result == pytest.approx(3.0)
    assert math.isnan(single.ci[0])
    assert "fewer than 3 passes at 60 km/h" in single.notes[0]
    one = curve_set(passes(speeds=(70,)), LIMITS, result="mean", between=(70 * KMH, 70 * KMH))
    assert one.result == pytest.approx(3.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_offset_of_a_y_and_what_its_delay_does_are_remarked(sign):
    columns = drive(sign=sign)
    columns["yaw_rate"] = sign * (80 * KMH / 100.0 - 0.1 / (80 * KMH)) * np.ones(T.size)
    (p,) = curve_passes(signals(columns), radius=100.0)
    assert p.valid, p.reasons
    assert p.off == pytest.approx(0.1)
    late = {**columns, "a_y": np.concatenate([np.full(3, columns["a_y"][0]), columns["a_y"][:-3]])}
    (q,) = curve_passes(signals(late), radius=100.0)
    assert q.a_y_mean - p.a_y_mean == pytest.approx(0.03 * p.per_delay, rel=0.15)
    found = curve_set([p, p], LIMITS, result="mean", between=(80 * KMH, 80 * KMH))
    assert any("+0.10 m/s² off v_x times yaw_rate" in n for n in found.notes)
    assert any("a filter of 30 ms in a_y would make means too large by up to 0.1" in n for n in found.notes)


@pytest.mark.parametrize(("apart", "low", "high", "free"), [(0.1, 3.0, 8.0, (4.9, 5.5)), (0.0, 0.5, 1.6, (20.0, 90.0))])
def test_passes_of_one_log_are_not_independent(apart, low, high, free):
    """Six logs with three passes at each speed: what a log has of its own is in all of its passes. Fifteen alike ones
    are sqrt(15) times as wide, times 1.31 for five degrees of freedom; logs that do not differ are not."""
    rng, made, logs = np.random.default_rng(8), [], []
    for log in range(6):
        own = rng.normal(0.0, 1.0) * apart
        for kmh in (60, 65, 70, 75, 80):
            for _ in range(3):
                a_y = 2.0 + own + rng.normal(0.0, 0.01)
                made.append(CurvePass(kmh * KMH, 5.0, a_y, a_y, 100.0))
                logs.append(f"log {log}")
    alone, together = (curve_set(made, LIMITS, result="mean", between=(60 * KMH, 80 * KMH), logs=x) for x in ([], logs))
    wide = (together.ci[1] - together.ci[0]) / (alone.ci[1] - alone.ci[0])
    assert low < wide < high
    assert free[0] < together.estimate.dof < free[1]
