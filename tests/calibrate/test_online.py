"""The slow offset of the resistance measure: learnt on dry road, not in the wet, the same however a drive is cut."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aqualog.calibrate import online
from aqualog.core.vehicle import Vehicle
from aqualog.detect import cusum, resistance
from aqualog.features.stream import INPUTS, FeatureStream
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import ESC
from aqualog.model.simulate import simulate

DT = 0.01
P = online.OnlineParams.make(DT)
CAR = Vehicle(name="sedan", mass=1680.0, l_f=1.32, l_r=1.48, given=frozenset({"drivetrain", "mass"}))


def offset(x, v=25.0, frozen=False, p=P):
    x = np.asarray(x, dtype=np.float64)
    out, state = online.scan(
        p, online.initial_state(), x, np.broadcast_to(v, x.shape).astype(float), np.broadcast_to(frozen, x.shape)
    )
    return out, state


def seconds(s):
    return np.zeros(round(s / DT))


def test_constant_from_the_first_sample():
    out, _ = offset(seconds(30.0) + 0.23)
    np.testing.assert_allclose(out, 0.23, atol=1e-12)


def test_slow_drift_is_followed_within_the_guard():
    t = np.arange(0.0, 300.0, DT)
    out, _ = offset(1e-3 * t)
    assert np.max(np.abs(1e-3 * t - out)) < 0.065  # tau times the drift


@pytest.mark.parametrize("ramp", [2.5e-3, 0.01, 0.05])
def test_water_that_comes_slowly_is_not_learnt(ramp):
    """0.3 m/s^2 within 6 to 120 s after a minute of dry road: half of the threshold and more is left to see."""
    t = np.arange(0.0, 240.0, DT)
    x = np.clip(ramp * (t - 60.0), 0.0, 0.3)
    out, _ = offset(x)
    reached = (x >= 0.3) & (t < 60.0 + 0.3 / ramp + 20.0)
    assert np.min((x - out)[reached]) > 0.12
    assert np.min((x - out)[reached]) > 0.27 or ramp < 0.02


def test_step_is_not_learnt_for_three_minutes_then_it_is():
    x = np.concatenate([seconds(60.0), seconds(600.0) + 0.2])
    out, _ = offset(x)
    t = np.arange(x.size) * DT
    assert out[t < 239.0].max() < 0.01
    assert out[-1] > 0.19


def test_less_than_the_dry_resistance_shows_a_wrong_offset():
    """A log that begins on water hides it; where the water ends, the offset is learnt anew within seconds."""
    x = np.concatenate([seconds(10.0) + 0.3, seconds(30.0)])
    out, _ = offset(x)
    t = np.arange(x.size) * DT
    assert out[t < 9.0].min() > 0.29
    assert np.abs(out[t > 22.0]).max() < 0.02


@pytest.mark.parametrize(("lee", "again"), [(8.0, 0.0), (15.0, 4.0), (60.0, 4.0)])
def test_a_wind_that_pauses_is_known_when_it_returns(lee, again):
    """A short lee teaches nothing; after a long one the old level is back within `again` seconds."""
    x = np.concatenate([seconds(120.0) + 0.2, seconds(lee), seconds(30.0) + 0.2])
    out, _ = offset(x)
    t = np.arange(x.size) * DT
    assert out[t > 120.0 + lee + again].min() > 0.15
    # a step of another height is no return
    y = np.concatenate([seconds(120.0) + 0.2, seconds(lee), seconds(30.0) + 0.4])
    out, _ = offset(y)
    assert out[-1] < 0.21


def test_standstill_begins_anew():
    x = np.concatenate([seconds(60.0), np.full(500, np.nan), seconds(5.0) + 0.3])
    v = np.concatenate([seconds(60.0) + 20.0, np.zeros(500), seconds(5.0) + 20.0])
    assert offset(x, v)[0][-1] == pytest.approx(0.3)
    assert offset(x, 20.0)[0][-1] < 0.05


def test_frozen_and_missing_samples_teach_nothing():
    x = np.concatenate([seconds(20.0), seconds(20.0) + 0.08])
    late = np.arange(x.size) >= 2000
    assert offset(x, frozen=late)[0][-1] == 0.0
    assert offset(np.where(late, np.nan, x))[0][-1] == 0.0
    assert offset(x)[0][-1] > 0.01


def test_bounded():
    assert offset(seconds(10.0) + 5.0)[0].max() == P.bound
    assert offset(seconds(10.0) - 5.0)[0].min() == -P.bound


def noisy(n, seed):
    rng = np.random.default_rng(seed)
    x = 0.2 * np.cumsum(rng.normal(0.0, 0.02, n)) + rng.normal(0.0, 0.1, n)
    x[rng.random(n) < 0.1] = np.nan
    v = np.abs(8.0 + np.cumsum(rng.normal(0.0, 0.3, n)))
    v[rng.random(n) < 0.05] = np.nan
    return x, v, rng.random(n) < 0.2


@pytest.mark.parametrize("seed", range(5))
def test_any_cut_gives_the_same_bits(seed):
    x, v, frozen = noisy(3000, seed)
    whole, last = online.scan(P, online.initial_state(), x, v, frozen)
    cuts = np.sort(np.random.default_rng(seed + 50).integers(0, x.size, 7))
    state, parts = online.initial_state(), []
    for part in np.split(np.arange(x.size), cuts):
        out, state = online.scan(P, state, x[part], v[part], frozen[part])
        parts.append(out)
    assert np.concatenate(parts).tobytes() == whole.tobytes()
    assert np.array(state).tobytes() == np.array(last).tobytes()


def test_recursion_against_plain_python():
    x, v, frozen = noisy(4000, 9)
    out, _ = online.scan(P, online.initial_state(), x, v, frozen)
    b, age, fast, above, beneath, rest, before, back = 0.0, 0.0, math.nan, 0.0, 0.0, 0.0, math.nan, 0.0
    for i in range(x.size):
        if not math.isnan(v[i]):
            rest = rest + DT if v[i] < 0.5 else 0.0
        if rest > 2.0:
            age, fast, above, beneath, before = 0.0, math.nan, 0.0, 0.0, math.nan
        if not (math.isnan(x[i]) or frozen[i]):
            fast = x[i] if math.isnan(fast) else fast + (1.0 - math.exp(-DT)) * (x[i] - fast)
            known = age > 1.0
            above = above + DT if known and fast - b > 0.1 else 0.0
            beneath = beneath + DT if known and fast - b < -0.1 else 0.0
            if beneath > 10.0:
                age, beneath, before, b = 0.0, 0.0, b, fast
            back = back + DT if above > 0.0 and abs(fast - before) < 0.05 else 0.0
            if back > 2.0:
                b, age, above, before = before, 1.0, 0.0, math.nan
            if (above == 0.0 or above > 180.0) and beneath == 0.0:
                age = min(age + DT, 60.0)
                b = min(max(b + DT / age * ((fast if known else x[i]) - b), -0.6), 0.6)
        assert out[i] == pytest.approx(b, abs=1e-9)


@pytest.mark.parametrize("dt", [0.002, 0.01, 0.1])
def test_sample_rate_does_not_matter(dt):
    t = np.arange(0.0, 120.0, dt)
    out, _ = offset(5e-4 * t + 0.1, p=online.OnlineParams.make(dt))
    assert out[-1] == pytest.approx(0.16 - 60.0 * 5e-4 * (1.0 - math.exp(-1.0)), abs=0.008)


def sensors(bias, drift):
    return ESC.with_channel(
        "a_x", replace(ESC.channels["a_x"], bias=bias, drift=drift, offset_spread=0.0, drift_spread=0.0)
    )


def alarms(scenario, car=CAR):
    """Time, label of water, and the resistance alarm without and with the offset taken off."""
    signals = as_signals(simulate(scenario))
    columns = {s: signals.array(s) for s in signals.symbols if s in INPUTS}
    f = FeatureStream(car, signals.dt, columns).push(columns)
    braking = np.nan_to_num(columns["brake_pressure"]) > 0.5e5
    usable = (f["v_x_hat"] > 5.0) & ~braking
    x = np.where(usable, np.clip(f["delta_a_x"], -0.8, 0.8), np.nan)
    b, _ = online.scan(
        online.OnlineParams.make(signals.dt), online.initial_state(), x, f["v_x_hat"], np.zeros(x.size, dtype=bool)
    )
    bits = []
    for taken_off in (0.0, b):
        y = resistance.trusted_measure(f["delta_a_x"] - taken_off, f["v_x_hat"], f["a_y_slow"], braking)
        bits.append(cusum.scan(resistance.alarm_params(signals.dt), cusum.initial_state(), y)[1])
    wet = signals.array("on_water") > 0.0 if "on_water" in signals.symbols else np.zeros(x.size, dtype=bool)
    return np.arange(x.size) * signals.dt, wet, bits


SPEEDS = ((0.0, 14.0), (15.0, 26.0), (60.0, 30.0), (100.0, 24.0), (120.0, 28.0))


@pytest.mark.parametrize(("bias", "drift", "wind"), [(-0.2, 0.0, 0.0), (0.0, 0.0, 10.0), (-0.2, -1e-3, 10.0)])
def test_dry_drive_with_an_offset_alarms_without_it_only(bias, drift, wind):
    scenario = Scenario(
        CAR, duration_s=120.0, seed=5, speed=SPEEDS, head_wind=wind, sensors=sensors(bias, drift)
    )  # fmt: skip
    _, _, (without, with_offset) = alarms(scenario)
    assert without.mean() > 0.7
    assert not with_offset.any()


@pytest.mark.parametrize(("start", "end"), [(3.0, 13.0), (30.0, 90.0), (6.0, 16.0)])
def test_a_lane_is_found_in_spite_of_drift_and_wind(start, end):
    lane = Lane(start, end, depth_left=1.3e-3, depth_right=1.3e-3)
    scenario = Scenario(
        CAR, duration_s=end + 5.0, seed=6, speed=((0.0, 26.4),), head_wind=10.0, p_front=1.9e5, p_rear=1.9e5,
        lanes=(lane,), sensors=sensors(-0.2, -1e-3),
    )  # fmt: skip
    t, wet, (_, found) = alarms(scenario)
    assert not found[t < start].any()
    first = t[found & wet][0]
    assert first - start < 2.0
    assert found[(t > first) & (t < end)].mean() > 0.9
