"""Sensors: what each figure of a channel does to a signal, and that it does nothing to any other."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import SYMBOLS, WHEELS
from aqualog.model.pickup import reported_speed
from aqualog.model.sensors import ESC, IDEAL, SENSORS, Channel, Group, Sensors, Truth, measure

DT = 1e-3
R_E = 0.317


def drive(duration=10.0, **columns):
    """Truth on the simulator's grid; a column is a function of time."""
    t = np.arange(round(duration / DT) + 1) * DT
    return Truth(t, {n: np.asarray(f(t)) for n, f in columns.items()})


def rolling(speed, duration=20.0):
    """Four wheels at one constant speed [m/s]."""
    omega = speed / R_E
    columns = {f"omega_{w}": lambda t: omega + 0.0 * t for w in WHEELS}
    return drive(duration, **columns, **{f"angle_{w}": lambda t: omega * t for w in WHEELS})


def one(signal, channel=None, rate_hz=None, **kwargs):
    """A single signal through a single channel."""
    return Sensors("one", (Group("g", (signal,), rate_hz),), {signal: channel or Channel()}, **kwargs)


def seen(truth, sensors, rate_hz=100.0, seed=1):
    """All signals by name: (t, values)."""
    return {n: (g.t, x) for g in measure(truth, sensors, rate_hz=rate_hz, seed=seed) for n, x in g.columns.items()}


def ramp(t):
    return 3.0 + 2.0 * t


def wave(t):
    return np.sin(7.3 * t) / 3.0


@pytest.mark.parametrize("rate_hz", [1000.0, 500.0, 100.0, 50.0])
def test_ideal_is_the_truth_bit_for_bit(rate_hz):
    # an awkward column: negative zero, and neighbours that would spoil a sum even at share 0
    truth = drive(a_x=lambda t: np.where(t == 0.0, -0.0, wave(t)), omega_fl=lambda t: 80.0 + wave(t), true_slip=wave)
    spoilt = truth.columns["a_x"].copy()
    step = round(1.0 / (rate_hz * DT))
    if step > 1:
        spoilt[1::step] = np.nan
    out = seen(Truth(truth.t, {**truth.columns, "a_x": spoilt}), IDEAL, rate_hz)
    for name in truth.columns:
        t, x = out[name]
        expected = truth.columns[name][:-1:step]
        assert t.size == expected.size == 10.0 * rate_hz
        np.testing.assert_allclose(t, truth.t[:-1:step], rtol=0.0, atol=1e-12)
        assert x.tobytes() == expected.tobytes()


def test_ideal_holds_on_grids_whose_step_is_no_binary_number():
    for n, rate_hz in ((3001, 300.0), (3001, 100.0), (7001, 70.0)):
        t = np.linspace(0.0, 10.0, n)
        x = seen(Truth(t, {"a_x": wave(t)}), IDEAL, rate_hz)["a_x"][1]
        assert np.array_equal(x, wave(t)[: n - 1 : (n - 1) // round(10.0 * rate_hz)])


def test_ideal_knows_every_canonical_signal_and_no_wheel_angle():
    truth = drive(1.0, **dict.fromkeys(SYMBOLS, wave), angle_fl=wave, true_grade=wave)
    groups = measure(truth, IDEAL, rate_hz=100.0, seed=1)
    assert [g.name for g in groups] == ["signals", "truth"]
    assert set(groups[0].columns) == set(SYMBOLS)
    assert set(groups[1].columns) == {"true_grade"}


def test_a_stamp_on_the_grid_is_exact_among_others_that_are_not():
    truth = drive(a_x=wave)
    gappy = np.where(np.arange(truth.t.size) % 10 == 0, truth.columns["a_x"], np.nan)
    _, x = seen(Truth(truth.t, {"a_x": gappy}), IDEAL, 300.0)["a_x"]
    assert np.array_equal(x[::3], truth.columns["a_x"][:-1:10])
    assert np.isnan(x[1::3]).all()


def test_truth_is_passed_on_at_the_rate_that_was_asked_for_without_noise():
    truth = drive(v_x=ramp, true_slip=wave)
    t, x = seen(truth, ESC, 100.0)["true_slip"]
    assert t.size == 1000
    assert np.array_equal(x, truth.columns["true_slip"][:-1:10])


def test_between_grid_points_the_truth_is_linear():
    truth = drive(a_x=wave)
    t, x = seen(truth, IDEAL, 333.0)["a_x"]
    np.testing.assert_allclose(x, np.interp(t, truth.t, truth.columns["a_x"]), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("channel", "shift"),
    [(Channel(latency_s=0.03), 0.03), (Channel(delay_s=0.05), 0.05), (Channel(latency_s=0.0123, delay_s=0.05), 0.0623)],
)
def test_latency_and_delay_shift_a_ramp(channel, shift):
    t, x = seen(drive(a_x=ramp), one("a_x", channel))["a_x"]
    np.testing.assert_allclose(x, np.maximum(ramp(t - shift), ramp(0.0)), rtol=0.0, atol=1e-12)


def test_an_antenna_moves_with_the_pitching_body():
    _, x = seen(drive(a_x=lambda t: 0.5 * t, v_x=lambda t: 0.0 * t), one("v_x", Channel(pitching=0.01)))["v_x"]
    assert x == pytest.approx(0.005, abs=1e-12)


def test_an_accelerometer_ahead_of_the_centre_of_gravity_is_turned_with_the_car():
    own = drive(a_x=lambda t: 0.0 * t, a_y=lambda t: 0.0 * t, yaw_rate=lambda t: 0.1 * t)
    t, x = seen(own, one("a_x", Channel(ahead=0.5)))["a_x"]
    assert x == pytest.approx(-0.5 * (0.1 * t) ** 2, abs=1e-12)  # towards the middle of the curve, behind it
    _, y = seen(own, one("a_y", Channel(ahead=0.5)))["a_y"]
    assert y == pytest.approx(0.05, abs=1e-9)  # to the left, where the car begins to turn left


def test_lag_of_a_ramp_and_of_a_step():
    tau = 0.02
    t, x = seen(drive(a_x=ramp), one("a_x", Channel(lag_s=tau)))["a_x"]
    np.testing.assert_allclose(x, ramp(t) - 2.0 * tau * (1.0 - np.exp(-t / tau)), rtol=0.0, atol=1e-12)
    t, x = seen(drive(a_x=lambda t: (t > 5.0) * 1.0), one("a_x", Channel(lag_s=tau)))["a_x"]
    after = t > 5.005
    # the grid's step is a ramp of 1 ms
    np.testing.assert_allclose(x[after], 1.0 - np.exp(-(t[after] - 5.0005) / tau), rtol=0.0, atol=1e-4)
    assert not x[t < 4.995].any()


def test_gain_bias_and_drift():
    t, x = seen(drive(a_x=ramp), one("a_x", Channel(gain=1.1, bias=0.3, drift=-0.02)))["a_x"]
    np.testing.assert_allclose(x, 1.1 * ramp(t) + 0.3 - 0.02 * t, rtol=0.0, atol=1e-12)


def test_drawn_gain_offset_and_drift_have_their_spread_and_do_not_depend_on_the_samples():
    spread = Channel(gain_spread=0.02, offset_spread=0.05, drift_spread=3e-3)
    fits = []
    for seed in range(300):
        t, x = seen(drive(2.0, a_x=lambda t: 5.0 * np.sin(20.0 * t)), one("a_x", spread), seed=seed)["a_x"]
        basis = np.stack([5.0 * np.sin(20.0 * t), np.ones_like(t), t], axis=1)
        fits.append(np.linalg.lstsq(basis, x, rcond=None)[0])
    gain, offset, drift = np.array(fits).T
    # 300 draws: 4 % rms on a standard deviation
    assert np.std(gain) == pytest.approx(0.02, rel=0.15)
    assert np.std(offset) == pytest.approx(0.05, rel=0.15)
    assert np.std(drift) == pytest.approx(3e-3, rel=0.15)
    assert np.mean(gain) == pytest.approx(1.0, abs=0.005)
    assert np.abs(np.corrcoef(np.array(fits).T) - np.eye(3)).max() < 0.2

    short = seen(drive(2.0, a_x=wave), one("a_x", spread), 50.0)["a_x"][1]
    long = seen(drive(9.0, a_x=wave), one("a_x", spread), 100.0)["a_x"][1]
    np.testing.assert_array_equal(short, long[:200:2])


def test_noise_has_its_size_and_is_white():
    _, x = seen(drive(100.0, a_x=lambda t: 0.0 * t), one("a_x", Channel(noise=0.06)))["a_x"]
    assert np.std(x) == pytest.approx(0.06, rel=0.03)
    assert abs(np.corrcoef(x[1:], x[:-1])[0, 1]) < 0.05


def test_resolution():
    truth = drive(a_x=wave)
    t, x = seen(truth, one("a_x", Channel(resolution=0.03125)))["a_x"]
    assert np.array_equal(x / 0.03125, np.rint(x / 0.03125))
    assert np.abs(x - np.interp(t, truth.t, truth.columns["a_x"])).max() <= 0.03125 / 2
    assert len(set(x)) > 10


def test_states_are_not_interpolated_and_not_noisy():
    def flicker(t):
        return np.rint(t / DT) % 2.0

    truth = drive(on_water=lambda t: flicker(t) > 0.0, gear=flicker, true_sliding=lambda t: flicker(t) > 0.0)
    noisy = Channel(noise=1.0, lag_s=0.1, gain=2.0, latency_s=0.0105)
    sensors = Sensors("s", (Group("g", ("on_water", "gear")),), {"on_water": noisy, "gear": noisy})
    out = seen(truth, sensors, 370.0)
    for name, latency in (("on_water", 0.0105), ("gear", 0.0105), ("true_sliding", 0.0)):
        t, x = out[name]
        i = np.maximum(np.floor((t - latency) / DT + 1e-6), 0.0)
        assert np.array_equal(x, i % 2.0)
        assert 0.3 < np.mean(x) < 0.7


def test_skew_stretches_the_stamps_of_its_group_alone():
    truth = drive(a_x=ramp, v_x=ramp)
    sensors = Sensors("s", (Group("fast", ("a_x",), skew_ppm=200.0), Group("true", ("v_x",))))
    out = seen(truth, sensors)
    assert out["a_x"][0][-1] == pytest.approx(9.99 * 1.0002, abs=1e-9)
    assert out["v_x"][0][-1] == 9.99
    assert np.array_equal(out["a_x"][1], out["v_x"][1])


def test_rates_of_groups():
    truth = drive(a_x=ramp, v_x=ramp, steer_angle=ramp, tie_rod_fl=ramp)
    out = seen(truth, ESC, 250.0)
    assert {n: t.size for n, (t, _) in out.items()} == {"tie_rod_fl": 2500, "a_x": 500, "v_x": 200, "steer_angle": 1000}
    assert all(t[0] == 0.0 and 9.9 < t[-1] < 10.0 for t, _ in out.values())


def test_signals_that_the_truth_lacks_are_left_out():
    groups = measure(drive(yaw_rate=wave), ESC, rate_hz=100.0, seed=1)
    assert [(g.name, set(g.columns)) for g in groups] == [("esc", {"yaw_rate"})]


def everything(duration=5.0):
    columns = dict.fromkeys(SYMBOLS, wave)
    columns |= {f"omega_{w}": lambda t: 80.0 + wave(t) for w in WHEELS}
    return drive(duration, **columns)


def test_a_seed_gives_the_same_drive_and_another_seed_another():
    truth = everything()
    first, again, other = (seen(truth, ESC, seed=s) for s in (5, 5, 6))
    for name, (_, x) in first.items():
        assert np.array_equal(x, again[name][1])
        perfect = SYMBOLS[name].kind == "state" or name.startswith(("water", "brake"))
        assert np.array_equal(x, other[name][1]) == perfect, name


def test_the_same_seed_gives_the_same_noise_in_another_process():
    code = (
        "import numpy as np; from aqualog.model.sensors import *; t = np.arange(1001) * 1e-3;"
        "print(measure(Truth(t, {'a_x': 0.0 * t}), ESC, rate_hz=100.0, seed=3)[0].columns['a_x'].tobytes().hex())"
    )
    outs = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": h},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for h in ("1", "2")
    }
    assert len(outs) == 1


@pytest.mark.parametrize(
    ("signal", "change"),
    [("a_x", {"noise": 0.5}), ("a_x", {"noise": 0.0, "offset_spread": 0.0, "drift_spread": 0.0}),
     ("a_x", {"bias": 0.3, "delay_s": 0.04, "gain": 1.1}),
     ("omega_fl", {"noise": 0.1, "delay_s": 0.04, "lag_s": 0.02}), ("torque_rl", {"gain_spread": 0.2})],
)  # fmt: skip
def test_a_change_at_one_signal_leaves_all_others_to_the_bit(signal, change):
    truth = everything()
    before = seen(truth, ESC)
    after = seen(truth, ESC.with_channel(signal, replace(ESC.channels[signal], **change)))
    assert {n for n in before if not np.array_equal(before[n][1], after[n][1])} == {signal}


def test_a_changed_truth_of_one_signal_or_a_missing_one_leaves_all_others():
    truth = everything()
    before = seen(truth, ESC)
    columns = {n: x for n, x in truth.columns.items() if n != "a_x"} | {"omega_fl": truth.columns["omega_fl"] * 1.01}
    after = seen(Truth(truth.t, columns), ESC)
    assert {n for n in after if not np.array_equal(before[n][1], after[n][1])} == {"omega_fl"}


def test_signals_have_different_noise():
    out = seen(drive(**dict.fromkeys(("a_x", "a_y"), lambda t: 0.0 * t)), ESC)
    a_x, a_y = (out[n][1] - np.mean(out[n][1]) for n in ("a_x", "a_y"))
    assert abs(np.corrcoef(a_x, a_y)[0, 1]) < 0.15


def test_signals_have_offsets_of_their_own():
    truth = drive(1.0, **dict.fromkeys(("a_x", "a_y"), lambda t: 0.0 * t))
    offsets = [[np.mean(seen(truth, ESC, seed=s)[n][1]) for n in ("a_x", "a_y")] for s in range(200)]
    assert abs(np.corrcoef(np.transpose(offsets))[0, 1]) < 0.25


def test_wheels_have_jitter_of_their_own():
    # the rings sit anywhere: a stream in common would show at some shift within a turn
    out = seen(rolling(25.0), replace(ESC, tooth_pattern=0.0))
    fl, *others = (out[f"omega_{w}"][1] - 25.0 / R_E for w in WHEELS)
    for x in others:
        shifted = [np.corrcoef(fl[20:-20], np.roll(x, k)[20:-20])[0, 1] for k in range(-12, 13)]
        assert np.abs(shifted).max() < 0.15


def test_the_delay_of_a_wheel_speed_shifts_its_noise_and_draws_no_other():
    truth = rolling(25.0)
    here = seen(truth, one("omega_fl", teeth=48, tooth_jitter=1e-3))["omega_fl"][1]
    late = seen(truth, one("omega_fl", Channel(delay_s=0.05), teeth=48, tooth_jitter=1e-3))["omega_fl"][1]
    np.testing.assert_allclose(late[10:], here[5:-5], rtol=0.0, atol=1e-9)
    assert np.std(here) > 0.005


def test_the_torques_share_one_gain_error_but_not_their_noise():
    truth = drive(20.0, **{f"torque_{w}": lambda t: 1000.0 + 0.0 * t for w in WHEELS})
    gains, noises = [], []
    for seed in range(100):
        out = seen(truth, ESC, seed=seed)
        gains.append([np.mean(out[f"torque_{w}"][1]) / 1000.0 for w in WHEELS])
        noises.append(np.corrcoef([out[f"torque_{w}"][1] for w in WHEELS]) - np.eye(4))
    assert np.std(gains, axis=0) == pytest.approx(0.02, rel=0.3)
    assert np.ptp(gains, axis=1).max() < 5e-4  # noise and rounding alone
    assert np.abs(np.mean(noises, axis=0)).max() < 0.05


def test_clean_teeth_show_the_speed_of_a_steady_wheel_from_the_first_sample_on():
    truth = rolling(25.0)
    for channel in (Channel(), Channel(latency_s=0.005, delay_s=0.1)):
        _, x = seen(truth, one("omega_fl", channel, teeth=48))["omega_fl"]
        np.testing.assert_allclose(x, 25.0 / R_E, rtol=1e-9)


def test_the_report_is_late_by_about_half_a_window():
    rate = 20.0  # [rad/s^2]
    truth = drive(20.0, omega_fl=lambda t: 40.0 + rate * t, angle_fl=lambda t: 40.0 * t + rate * t * t / 2.0)
    t, x = seen(truth, one("omega_fl", teeth=48))["omega_fl"]
    late = (40.0 + rate * t - x)[100:] / rate
    assert np.mean(late) == pytest.approx(0.005, abs=0.001)


def test_without_the_angle_the_speed_is_integrated():
    def omega(t):
        return 70.0 + 20.0 * np.sin(t)

    def angle(t):
        return 70.0 * t + 20.0 * (1.0 - np.cos(t))

    with_angle = seen(drive(omega_fl=omega, angle_fl=angle), ESC)["omega_fl"][1]
    without = seen(drive(omega_fl=omega), ESC)["omega_fl"][1]
    np.testing.assert_allclose(without, with_angle, rtol=0.0, atol=1.5 * ESC.channels["omega_fl"].resolution)


@pytest.mark.parametrize("teeth", [48, 0])
@pytest.mark.parametrize("wheel", ["fl", "rr"])
def test_the_tone_ring_modulates_the_speed_once_per_turn(teeth, wheel):
    amplitude, omega = 0.004, 10.0 * np.pi  # 5 turns per second, 20 samples each
    rings = tuple(amplitude if w == wheel else 0.0 for w in WHEELS)
    truth = rolling(omega * R_E)
    sensors = Sensors("s", (Group("g", tuple(f"omega_{w}" for w in WHEELS)),), teeth=teeth, tone_ring=rings)
    for name, (t, x) in seen(truth, sensors).items():
        shape = 2.0 * np.mean((x[1:] / omega - 1.0) * np.exp(-1j * omega * t[1:]))
        # the mean over a window flattens it by 0.4 %
        assert abs(shape) == pytest.approx(amplitude if name.endswith(wheel) else 0.0, rel=0.02, abs=1e-6)
        residual = x[1:] / omega - 1.0 - (shape * np.exp(1j * omega * t[1:])).real
        assert np.abs(residual).max() < 0.05 * amplitude  # a sine, no more
        assert np.mean(x) == pytest.approx(omega, rel=1e-4)


def test_the_tone_ring_sits_as_it_does_with_teeth_and_anywhere_by_the_seed():
    truth = rolling(10.0 * np.pi * R_E)
    ring = {"rate_hz": 500.0, "tone_ring": (0.004, 0.0, 0.0, 0.0)}
    plain = [seen(truth, one("omega_fl", **ring), seed=s)["omega_fl"][1] for s in range(100)]
    for seed in range(5):
        edges = seen(truth, one("omega_fl", teeth=48, **ring), seed=seed)["omega_fl"][1]
        assert np.corrcoef(edges, plain[seed])[0, 1] > 0.98
    t = np.arange(plain[0].size) / 500.0
    places = [np.mean((x - np.mean(x)) * np.exp(-10j * np.pi * t)) for x in plain]
    # places that are spread evenly over the turn: the mean unit vector of 100 is 0.1 long
    assert abs(np.mean(places / np.abs(places))) < 0.3


def test_the_pattern_comes_again_every_turn_and_the_jitter_does_not():
    truth = rolling(10.0 * np.pi * R_E)
    turn = 20  # samples
    pattern = seen(truth, one("omega_fl", teeth=48, tooth_pattern=1e-3))["omega_fl"][1][1:]
    jitter = seen(truth, one("omega_fl", teeth=48, tooth_jitter=1e-3))["omega_fl"][1][1:]
    assert np.std(pattern) > 0.005
    np.testing.assert_allclose(pattern[turn:], pattern[:-turn], rtol=0.0, atol=1e-9)
    assert abs(np.corrcoef(jitter[turn:], jitter[:-turn])[0, 1]) < 0.1


def test_jitter_per_cog_is_that_of_the_measured_wheel():
    # numbers.md (h): 6.8e-4 relative per cog at 66 rad/s; a window of one cog
    omega = 66.0
    truth = rolling(omega * R_E)
    _, x = seen(truth, one("omega_fl", rate_hz=omega * 48 / (2.0 * np.pi), teeth=48, tooth_jitter=ESC.tooth_jitter))[
        "omega_fl"
    ]
    assert np.std(x) / omega == pytest.approx(6.8e-4, rel=0.1)


@pytest.mark.parametrize("speed", [20.6, 25.0, 27.8])
def test_noise_of_a_differentiated_wheel_speed_is_that_of_a_real_car(speed):
    # numbers.md (h): 1.0 m/s^2 at 20.6 m/s, 1.3 at 100 km/h, differences of 10 ms samples
    truth = rolling(speed)
    rms = [
        np.std(np.diff(x) * 100.0 * R_E)
        for seed in range(5)
        for n, (_, x) in seen(truth, ESC, seed=seed).items()
        if n.startswith("omega")
    ]
    assert 1.0 <= np.mean(rms) <= 1.3
    assert 0.7 <= min(rms) <= max(rms) <= 1.7
    assert len(set(rms)) == len(rms)


def test_a_stopping_wheel_reaches_zero_and_recovers():
    def omega(t):
        return np.interp(t, [0.0, 2.0, 2.5, 6.0, 6.5, 10.0], [80.0, 80.0, 0.0, 0.0, 80.0, 80.0])

    t, x = seen(drive(omega_rl=omega), ESC)["omega_rl"]
    assert np.all(x >= 0.0)
    assert not x[(t > 2.6) & (t < 6.0)].any()
    np.testing.assert_allclose(x[(t < 2.0) | (t > 6.55)], 80.0, rtol=0.01)
    moving = (t > 6.1) & (t < 6.5)
    np.testing.assert_allclose(x[moving], omega(t[moving] - 0.012), rtol=0.0, atol=1.5)
    falling = (t > 2.05) & (t < 2.6)
    assert np.all(np.diff(x[falling]) <= 0.05)


def test_a_wheel_that_locks_at_once_is_not_held_at_its_last_speed():
    t, x = seen(drive(omega_rl=lambda t: 80.0 * (t < 5.0)), one("omega_rl", teeth=48))["omega_rl"]
    after = t - 5.0
    late = after > 0.0125
    assert np.all(x[late] <= 2.0 * np.pi / 48 / (after[late] - 0.002))
    assert x[late][0] > 0.0  # it cannot know at once
    assert not x[after > 0.1].any()


def test_slow_wheels_are_held_between_edges_and_reported_as_standing_below_the_threshold():
    # 3 rad/s: an edge each 44 ms, so that most windows see none
    for omega, shown in ((3.0, 3.0), (1.6, 1.6), (1.4, 0.0)):
        _, x = seen(drive(omega_fl=lambda t, o=omega: o + 0.0 * t), one("omega_fl", teeth=48))["omega_fl"]
        np.testing.assert_allclose(x[50:], shown, rtol=1e-6)


def test_a_standing_wheel_and_tiny_backward_steps():
    standing = seen(drive(omega_fl=lambda t: 0.0 * t, angle_fl=lambda t: 1e-9 * np.sin(1e3 * t)), ESC)["omega_fl"][1]
    assert not standing.any()
    truth = drive(omega_fl=lambda t: 80.0 + 0.0 * t, angle_fl=lambda t: 80.0 * t)
    shaken = truth.columns["angle_fl"].copy()
    shaken[21::50] = shaken[20:-1:50] - 1e-9
    x = seen(Truth(truth.t, {**truth.columns, "angle_fl": shaken}), one("omega_fl", teeth=48))["omega_fl"][1]
    np.testing.assert_allclose(x, 80.0, rtol=0.15)  # a lost millisecond of ten
    assert np.median(x) == pytest.approx(80.0, rel=1e-3)


def test_a_wheel_that_rolls_back_counts_as_standing_until_it_is_back():
    def angle(t):
        return np.interp(t, [0.0, 3.0, 5.5, 6.0, 10.0], [0.0, 120.0, 100.0, 120.0, 280.0])

    for duration in (10.0, 5.0):  # the second ends with the wheel rolled back
        truth = drive(duration, omega_fl=lambda t: 40.0 + 0.0 * t, angle_fl=angle)
        t, x = seen(truth, one("omega_fl", teeth=48))["omega_fl"]
        np.testing.assert_allclose(x[(t < 3.0) | (t > 6.03)], 40.0, rtol=1e-6)
        assert not x[(t > 3.1) & (t < 6.0)].any()


def test_the_report_reads_no_edge_of_the_future():
    edges = np.arange(1, 200) * 0.002
    at = np.arange(-5, 40) * 0.01
    whole = reported_speed(edges, at, window=0.01, teeth=48)
    assert not whole[:6].any()
    assert whole[6] > 0.0
    for k in (3, 10, 25):
        part = reported_speed(edges[edges <= at[k]], at[: k + 1], window=0.01, teeth=48)
        assert np.array_equal(part, whole[: k + 1])


def test_lag_of_a_wheel_speed_with_teeth():
    truth = drive(omega_fl=lambda t: np.where(t < 5.0, 60.0, 80.0))
    t, x = seen(truth, one("omega_fl", Channel(lag_s=0.1), teeth=48))["omega_fl"]
    assert np.interp(5.1 + 0.006, t, x) == pytest.approx(80.0 - 20.0 * np.exp(-1.0), abs=0.6)


def test_table_of_sensors():
    assert SENSORS["esc"] is ESC
    assert SENSORS["ideal"] is IDEAL
    for sensors in SENSORS.values():
        signals = [s for g in sensors.groups for s in g.signals]
        assert len(signals) == len(set(signals))
        assert set(signals) <= set(SYMBOLS)
        assert set(sensors.channels) <= set(signals)
