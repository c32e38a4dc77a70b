"""An accelerometer that is not one is exposed; one that is only off, late or tilted is not."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.checks.follows import passed_from
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.run import accelerometer_defect, diagnose
from tests.diagnose.test_drive import CAR, changed, plain, signals, term


def judged(change):
    log = plain()
    x = change(log.array("a_x"))
    return accelerometer_defect(prepare(changed(log, log.frame.with_columns(pl.Series("a_x", x))), CAR, "a"))


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a,
        lambda a: a + 0.5,
        lambda a: 1.1 * a,
        lambda a: np.roll(a, 40),
        lambda a: a + 0.3 * np.sin(2.0 * np.pi * np.arange(a.size) / 6000.0),  # hills
        lambda a: a + np.random.default_rng(1).normal(0.0, 0.1, a.size),
    ],
    ids=["true", "bias", "gain", "late", "hills", "noise"],
)
def test_a_true_accelerometer_passes(change):
    assert judged(change) is None


def test_the_opposite_sign_is_a_defect():
    d = judged(lambda a: -a)
    assert d.correlation < -0.95
    assert d.gain == pytest.approx(-1.0, abs=0.1)


@pytest.mark.parametrize("by", [0.3, 2.0])
def test_the_wrong_unit_is_a_defect_with_its_size(by):
    d = judged(lambda a: by * a)
    assert d.gain == pytest.approx(by, rel=0.1)
    assert d.correlation > 0.95


def test_another_channel_is_a_defect():
    d = judged(lambda a: np.random.default_rng(2).normal(0.0, 0.5, a.size).cumsum() * 0.02)
    assert abs(d.correlation) < 0.5


def test_a_lag_is_found():
    d = judged(lambda a: -np.roll(a, 50))
    assert d.lag_s == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("own", ["v_x", "omega_"])
def test_noise_of_one_speed_alone_is_no_defect_of_the_accelerometer(own):
    """As a velocity from satellites has among houses, or wheels that spin on gravel."""
    log, rng = plain(), np.random.default_rng(3)
    noise = np.convolve(rng.normal(size=log.frame.height + 99), np.hanning(100), "valid")
    noise *= 1.5 / noise.std()
    scale = 1.0 if own == "v_x" else 1.0 / CAR.r_e("fl")
    noisy = changed(log, log.frame.with_columns(
        pl.Series(c, log.array(c) + scale * noise) for c in log.frame.columns if c.startswith(own)
    ))  # fmt: skip
    assert accelerometer_defect(prepare(noisy, CAR, "a")) is None
    wrong = changed(noisy, noisy.frame.with_columns(-pl.col("a_x")))
    assert accelerometer_defect(prepare(wrong, CAR, "a")) is not None


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_velocity_of_wheels_that_float_is_no_defect_of_the_accelerometer(sign):
    """Two wheels give the velocity, spin down on water and recover, several times; the car hardly slows down."""
    log = plain()
    t = log.array("t")
    wet = (t % 30.0 > 5.0) & (t % 30.0 < 11.0)
    # to a tenth of the speed within a second, and back
    left = 1.0 - 0.9 * np.clip(np.minimum(t % 30.0 - 6.0, 10.0 - t % 30.0), 0.0, 1.0)
    own = {c: log.array(c) * left for c in ("v_x", "omega_rl", "omega_rr")}
    own |= {f"water_depth_{s}": 2e-3 * wet for s in ("left", "right")} | {"a_x": sign * log.array("a_x")}
    d = prepare(changed(log, log.frame.with_columns(pl.Series(c, x) for c, x in own.items())), CAR, "a")
    assert (accelerometer_defect(d) is None) == (sign > 0.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_stretches_that_the_torque_does_not_explain_count_too(sign):
    log = plain()
    d = prepare(changed(log, log.frame.with_columns(pl.col("a_x") * sign)), CAR, "a")
    found = accelerometer_defect(replace(d, mask=np.zeros_like(d.mask)))
    assert (found is None) == (sign > 0.0)


def test_a_drive_at_one_speed_tells_nothing():
    d = prepare(signals(speed=((0.0, 20.0),)), CAR, "a")
    assert accelerometer_defect(d) is None


STAIRS = tuple((4.0 * i, 10.0 + 8.0 * (i % 2)) for i in range(23))


@pytest.mark.parametrize("hidden", [term("road_grade", grade=0.05), term("trailer", mass=700.0)])
def test_a_grade_or_a_trailer_is_no_defect(hidden):
    assert accelerometer_defect(prepare(signals(hidden, speed=STAIRS), CAR, "a")) is None


def forgetting(a, corner_s, dt=0.01):
    mean, out = 0.0, np.empty_like(a)
    for i, x in enumerate(a):
        mean += dt / corner_s * (x - mean)
        out[i] = x - mean
    return out


def test_an_accelerometer_that_forgets_what_lasts_is_no_accelerometer():
    """Fast changes are right: the correlation of its changes over 2 s is 0.9 and more."""
    log = plain()
    x = forgetting(log.array("a_x"), 6.0)
    d = diagnose([("a", changed(log, log.frame.with_columns(pl.Series("a_x", x))))], CAR)
    assert d.verdict == "not_testable"
    assert "a_x of a forgets what lasts" in d.sentence


@pytest.mark.parametrize("change", [lambda a: a, lambda a: 1.1 * a + 0.5, lambda a: np.roll(a, 40)])
def test_a_true_accelerometer_forgets_nothing(change):
    log = plain()
    drive = prepare(changed(log, log.frame.with_columns(pl.Series("a_x", change(log.array("a_x"))))), CAR, "a")
    used = np.isfinite(drive.speed)
    assert passed_from(drive.columns["a_x"], drive.speed, used, drive.dt) is None
