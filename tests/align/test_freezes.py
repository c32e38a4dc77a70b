"""A frozen signal is left out where it only repeats itself, and told; no detector takes it for the car."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from aqualog.align.freezes import FreezeWatch, StandWatch, is_standing, watch_of, within
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.table import build_signals
from aqualog.config.vehicle import load_vehicle
from aqualog.core.records import Channel, ChannelInfo
from aqualog.detect.stream import detect_drive
from aqualog.report.drive.document import document
from tests.align.test_windows import channel, same

SAMPLES = Path(__file__).parents[2] / "sample_logs"
S = 1_000_000_000
WHEELS = ("fl", "fr", "rl", "rr")


def moving(seconds=60.0, rate=100.0, step=0.01, noise=0.02, seed=1):
    """A speed as a control unit gives it, in whole steps."""
    t = np.arange(round(seconds * rate)) / rate
    v = 20.0 + 5.0 * np.sin(0.2 * t) + noise * np.random.default_rng(seed).standard_normal(t.size)
    return np.round(t * S).astype(np.int64), np.round(v / step) * step


def found(t, x, name="v_x", pieces=1):
    watch = watch_of(name, 0.3)
    for part in np.array_split(np.arange(t.size), pieces):
        watch.push(t[part], x[part])
    return watch.finish()


def frozen(t, x, start, end):
    x = x.copy()
    x[start : end + 1] = x[start]
    for beside in {max(start - 1, 0), min(end + 1, x.size - 1)} - {start, end}:
        x[beside] += 1.0 * (x[beside] == x[start])  # where it begins and ends is to be seen
    return t, x


@pytest.mark.parametrize("pieces", [1, 2, 7, 1000])
@pytest.mark.parametrize("spans", [[], [(100, 301)], [(0, 400), (1000, 1400)], [(5500, 5999)], [(200, 5700)]])
def test_a_sensor_that_repeats_itself(pieces, spans):
    t, x = moving()
    for start, end in spans:
        t, x = frozen(t, x, start, end)
    assert found(t, x, pieces=pieces) == tuple((t[a], t[b]) for a, b in spans)
    assert np.flatnonzero(within(t, found(t, x), has_end=True)).tolist() == [
        k for a, b in spans for k in range(a + 1, b + 1)
    ]


def held(rate):
    """A value of 10 Hz, repeated until the next one comes."""
    t, x = moving(rate=rate)
    return t, x[np.arange(t.size) // round(rate / 10) * round(rate / 10)]


def test_a_slow_signal_on_a_fast_bus():
    t, x = held(100.0)
    assert found(t, x) == ()
    assert found(*frozen(t, x, 1000, 3000))[0][1] >= t[3000]


@pytest.mark.parametrize(
    "case",
    {
        "a short stretch": frozen(*moving(), 100, 299),
        "standing": frozen(moving()[0], np.where(np.arange(6000) < 2000, 1.0, moving()[1]), 0, 1999),
        "coarse": frozen(*moving(step=0.28, noise=0.2), 1000, 2000),
        "calculated": (moving()[0], np.clip(moving(noise=0.0, step=1e-9)[1], 18.0, 22.0)),
        "constant": (moving()[0], np.full(6000, 20.0)),
        "a pause": (np.where(np.arange(6000) < 3000, 0, 60 * S) + moving()[0], frozen(*moving(), 2900, 3100)[1]),
    }.items(),
    ids=lambda c: c[0],
)
def test_what_is_not_frozen(case):
    assert found(*case[1]) == ()


def test_torque_may_stay_for_a_minute_and_at_zero():
    t, x = moving(200.0)
    x = np.round(30.0 * (x - 20.0))
    assert found(*frozen(t, x, 1000, 6000), "torque_r") == ()
    assert found(*frozen(t, x, 1000, 8000), "torque_r") == ((t[1000], t[8000]),)
    x[1000:18000] = 0.0
    assert found(t, x, "torque_r") == ()
    assert watch_of("steering", None) is None


@pytest.mark.parametrize("value", [0.0, 0.4])
@pytest.mark.parametrize("name", ["a_x", "a_y", "yaw_rate"])
def test_a_sensor_of_the_body_that_stands_still_is_dead_at_zero_too(name, value):
    t, x = moving(100.0)
    x = np.round(x - 20.0, 2)
    x[2000:2900] = value
    assert found(t, x, name) == ()
    x[2000:4001] = value
    assert found(t, x, name) == ((t[2000], t[4000]),)
    assert found(t, np.round(x, 0), name) == ()  # too coarse to be judged


@pytest.mark.parametrize("pieces", [1, 7, 1000])
@pytest.mark.parametrize(("name", "step"), [("v_x", 0.1 / 3.6), ("a_y", 0.05), ("yaw_rate", 0.004)])
def test_a_coarse_signal_stands_by_itself_in_even_driving(name, step, pieces):
    """At constant speed on a straight road or a test bench its noise is smaller than its step, elsewhere it is not."""
    t = moving(seconds=180.0)[0]
    uneven = np.interp(t / S, [0, 50, 70, 110, 130, 180], [1, 1, 0, 0, 1, 1])
    noise = (0.05 + uneven) * step * np.random.default_rng(2).standard_normal(t.size)
    x = np.round((20.0 * (name == "v_x") + noise) / step) * step
    assert found(t, x, name, pieces) == ()
    x[1000:3001] = x[9000] + 30.0 * step  # now it is dead: it comes and goes by more
    assert found(t, x, name, pieces) == ((t[1000], t[3000]),)


def test_a_single_sample_and_none():
    watch = FreezeWatch(3.0, 2.0, 0.03)
    assert watch.finish() == ()
    watch.push(np.zeros(1, dtype=np.int64), np.ones(1))
    assert watch.finish() == ()


def lane_and_braking():
    """The sample drive over its wet lane; then the same car brakes by itself for 10 s."""
    sample = pl.read_parquet(SAMPLES / "lane_drive.parquet")
    car = load_vehicle(SAMPLES / "vehicle.toml")
    rng = np.random.default_rng(5)
    t = np.arange(2500) * 0.01 + 24.01
    v = np.interp(t, [24.0, 29.0, 39.0, 49.1], [28.0, 28.0, 10.0, 10.0])
    later = {"a_x": np.gradient(v, 0.01) + 0.05 * rng.standard_normal(t.size), "v_x": v}
    later |= {
        f"omega_{w}": np.round((v / car.r_e(w) + 0.05 * rng.standard_normal(t.size)) / 0.006572) * 0.006572
        for w in WHEELS
    }
    later["v_x"] = later["v_x"] + 0.01 * rng.standard_normal(t.size)
    own = np.round(sample["t"].to_numpy() * S).astype(np.int64)
    channels = {}
    for name, values in later.items():
        before = sample[name].cast(pl.Float64).fill_null(np.nan).to_numpy()
        has = np.isfinite(before)
        channels[name] = np.append(own[has], np.round(t * S).astype(np.int64)), np.append(before[has], values)
    return channels, car


def detected(channels, car):
    mapped = {
        n: (Entry(n, (n,)), Channel(ChannelInfo(n, n, "", t.size, "a.mf4"), t, x, False))
        for n, (t, x) in channels.items()
    }
    signals = build_signals(mapped, signal_map=SignalMap(), vehicle=car)
    return detect_drive(signals, car)


@pytest.fixture(scope="module")
def sound():
    return detected(*lane_and_braking())


@pytest.mark.parametrize("name", ["omega_fr", "v_x"])
def test_no_detector_alarms_on_a_frozen_signal(name, sound):
    channels, car = lane_and_braking()
    assert sound.events
    assert max(e.end_s for e in sound.events) < 24.0
    t, x = channels[name]
    start = int(np.searchsorted(t, 30 * S))
    channels[name] = frozen(t, x, start, int(np.searchsorted(t, 36 * S)))
    result = detected(channels, car)
    key = [(e.detector, e.wheel, e.start_s, e.severity) for e in result.events]
    assert key == [(e.detector, e.wheel, e.start_s, e.severity) for e in sound.events]
    told = document(result, log="a.mf4")
    assert 590 < told["quality"]["frozen_samples"] == told["signals"][name]["frozen"] < 610
    assert told["quality"]["dropped_samples"] >= told["quality"]["frozen_samples"]
    assert any(name in note and "6.0 s; the signal is frozen" in note for note in told["quality"]["notes"])


@pytest.mark.parametrize("value", [0.0, 587.0])
def test_no_detector_alarms_on_wheels_that_wake_up_late(value, sound):
    channels, car = lane_and_braking()
    for w in WHEELS:
        t, x = channels[f"omega_{w}"]
        channels[f"omega_{w}"] = t, np.where(t < t[0] + 2 * S, value, x)
    result = detected(channels, car)
    assert [(e.detector, e.wheel) for e in result.events] == [(e.detector, e.wheel) for e in sound.events]
    assert min(e.start_s for e in result.events) > 8.0
    assert [result.signals.origins[f"omega_{w}"].frozen for w in WHEELS] == [200] * 4
    assert all(result.signals.frame[f"omega_{w}"][:200].is_null().all() for w in WHEELS)


@pytest.mark.parametrize("pieces", [1, 7, 1000])
def test_a_wheel_that_starts_by_itself_was_awake(pieces):
    t, x = moving(seconds=20.0)
    x[:500] = 0.0
    assert found(t, x, "omega_fl", pieces) == ((t[0] - 1, t[499]),)
    x[500:600] *= np.linspace(0.0, 1.0, 100)
    assert found(t, x, "omega_fl", pieces) == ()


def rolling(speed, zeros, dt=0.01, seconds=20.0, hold=1, first_rise=1):
    """Four wheels and `v_x` of a car at even speed, `zeros` samples of which come before the first message."""
    rng = np.random.default_rng(3)
    t = np.arange(round(seconds / dt)) * dt
    signals = []
    for name in ("omega_fl", "omega_fr", "omega_rl", "omega_rr", "v_x", "a_y", "torque_fl"):
        x = {"v_x": speed, "a_y": 0.01, "torque_fl": 150.0}.get(name, speed / 0.3) + 0.02 * rng.standard_normal(t.size)
        x = x[np.arange(t.size) // hold * hold]
        n = zeros.get(name, 0)
        x[:n] = 0.0
        x[n : n + first_rise] *= np.arange(1, first_rise + 1) / first_rise
        unit = {"v_x": "m/s", "a_y": "m/s^2", "torque_fl": "N*m"}.get(name, "rad/s")
        signals.append(channel(name, t, x, unit))
    return signals


def silent_at_first(signals):
    """Samples by signal that count as missing because no message had come, by the notes of the whole and the pieces."""
    whole = same(signals, size=300)
    said = [n for n in whole.quality.notes if "no message had come yet" in n]
    frozen = {n: o.frozen for n, o in whole.origins.items() if o.frozen}
    assert len(said) == len(frozen)
    for name, count in frozen.items():
        first = "first sample reads 0" if count == 1 else f"first {count} samples read 0"
        assert any(f"{name}: the {first} while the car rolls" in n for n in said)
        assert whole.frame[name].null_count() >= count
    return frozen


@pytest.mark.parametrize("speed", [3.0, 8.0, 30.0])
@pytest.mark.parametrize("zeros", [{"omega_fl": 1}, {f"omega_{w}": 2 for w in WHEELS}, {"v_x": 20, "torque_fl": 20}])
def test_zeros_before_the_first_message_are_missing(speed, zeros):
    assert silent_at_first(rolling(speed, zeros)) == zeros


def test_standing_cars_locked_wheels_and_held_signals_keep_their_zeros():
    every = {f"omega_{w}": 20 for w in WHEELS} | {"v_x": 20}
    assert silent_at_first(rolling(8.0, every, first_rise=300)) == {}  # the car starts
    assert silent_at_first(rolling(1.8, every)) == {}  # a sensor that reads zero below walking speed
    assert silent_at_first(rolling(3.0, {"omega_fl": 80})) == {}  # locked for 0.8 s
    assert silent_at_first(rolling(8.0, {"omega_fl": 20}, first_rise=8)) == {}  # locked, and turns up in 80 ms
    assert silent_at_first(rolling(3.5, {"v_x": 20}, hold=20)) == {}  # 5 Hz on a grid of 100 Hz: 17 m/s² at least
    assert silent_at_first(rolling(3.0, {"torque_fl": 20})) == {}  # a torque may be zero, and step


@pytest.mark.parametrize(("height", "samples"), [(20.0, 9), (-40.0, 5), (30.0, 20)])
def test_no_detector_alarms_on_spikes_of_the_accelerometer(height, samples, sound):
    channels, car = lane_and_braking()
    t, x = channels["a_x"]
    x = x.copy()
    for at_s in (4, 26):
        start = int(np.searchsorted(t, t[0] + at_s * S))
        x[start : start + samples] += height
    channels["a_x"] = t, x
    result = detected(channels, car)
    key = [(e.detector, e.wheel, e.severity) for e in result.events]
    assert key == [(e.detector, e.wheel, e.severity) for e in sound.events]
    assert result.signals.origins["a_x"].out_of_range == 2 * samples
    assert any("a_x" in n and "(first" in n and "left out" in n for n in result.signals.quality.notes)


def stop_and_go(name, is_standing, steady="torque_r"):
    """Two minutes at a light at which a signal stays the same; or that signal alone stays. Slow wheels show nothing."""
    rng = np.random.default_rng(7)
    t = np.arange(40_000) * 0.01
    v = 20.0 * (np.interp(t, [0, 90, 100, 220, 230, 400], [1, 1, 0, 0, 1, 1]) if is_standing else np.ones(t.size))
    t_ns = np.round(t * S).astype(np.int64)
    noisy = np.where(v > 1.8, v + 0.02 * rng.standard_normal(t.size), 0.0)
    torque = np.where((t > 101) & (t < 219), 14.5, np.round(100.0 + 30.0 * rng.standard_normal(t.size), 1))
    return {
        name: (t_ns, noisy / (1.0 if name == "v_x" else 0.3)),
        "omega_rr": (t_ns, 66.0 + 0.1 * rng.standard_normal(t.size)),  # told by nothing but itself
        steady: (t_ns, torque if steady == "torque_r" else torque / 100.0),
    }


def in_both_ways(signals):
    """As a whole and in pieces."""
    units = {"torque_r": "N*m", "v_x": "m/s", "a_x": "m/s^2"}
    return same([channel(n, t * 1e-9, x, units.get(n, "rad/s")) for n, (t, x) in signals.items()], size=3000, rows=9000)


@pytest.mark.parametrize("is_standing", [True, False])
@pytest.mark.parametrize("name", ["v_x", "omega_fl"])
@pytest.mark.parametrize("steady", ["torque_r", "a_x"])
def test_a_signal_that_stays_while_the_car_stands(steady, name, is_standing):
    assert (in_both_ways(stop_and_go(name, is_standing, steady)).quality.frozen_samples == 0) is is_standing


@pytest.mark.parametrize("is_parked", [True, False])
def test_a_speed_that_is_always_zero_is_no_car_that_stands(is_parked):
    """Unless no speed moves at all."""
    signals = stop_and_go("v_x", False)
    for dead in ("v_x", "omega_rr") if is_parked else ("v_x",):
        signals[dead] = signals[dead][0], np.zeros(signals[dead][0].size)
    assert (in_both_ways(signals).quality.frozen_samples == 0) is is_parked


@pytest.mark.parametrize("pieces", [1, 3, 500])
def test_when_a_car_stands(pieces):
    t = (np.arange(1000) * S // 10).astype(np.int64)
    v = np.interp(np.arange(1000), [0, 100, 110, 300, 310, 950, 960, 999], [0, 0, 9, 9, 0, 0, 9, 9]).astype(float)
    v[500:600] = 30.0  # no car does that: neither what is before nor what is behind it is believed
    t[350:] += 5 * S
    watch = StandWatch()
    for part in np.array_split(np.arange(t.size), pieces):
        watch.push(t[part], v[part])
    assert watch.finish() == ((t[0], t[100]), (t[310], t[349]))
    assert is_standing(t, watch.finish()).sum() == 100 + 39
    assert not is_standing(t[:1], watch.finish()).size
    assert StandWatch().finish() == ()


@pytest.mark.parametrize(
    ("value", "sway", "until", "is_dead"),
    [(0.0, 0.0, 60.0, True), (0.0, 0.0, 40.0, False), (66.0, 5.0, 60.0, True), (66.0, 0.0, 60.0, False)],
)
def test_a_speed_that_never_changes_was_not_measured(value, sway, until, is_dead):
    """Unless the drive may be even, or goes on behind the signal's end."""
    t = np.arange(6000) * 0.01
    others = np.round(66.0 + sway * np.sin(0.2 * t) + 0.1 * np.random.default_rng(3).standard_normal(t.size), 2)
    signals = {f"omega_{w}": (np.round(t * S).astype(np.int64), others) for w in WHEELS}
    end = np.searchsorted(t, until)
    signals["omega_rl"] = signals["omega_rl"][0][:end], np.full(end, value)
    whole = in_both_ways(signals)
    assert ("omega_rl" not in whole.symbols) is is_dead
    assert any("omega_rl" in n and "is frozen there" in n for n in whole.quality.notes) is is_dead


@pytest.mark.parametrize("is_calculated", [True, False])
@pytest.mark.parametrize("value", [0.0, -1.2])
def test_an_acceleration_that_never_changes_was_not_measured(value, is_calculated):
    """Unless nothing in the log has noise."""
    t, v = moving(noise=0.02 * (not is_calculated))
    whole = in_both_ways({"v_x": (t, v), "omega_fl": (t, v / 0.3), "a_x": (t, np.full(t.size, value))})
    assert ("a_x" in whole.symbols) is is_calculated
