"""A gap that a logger filled with a straight line is found and left out; nothing that a sensor made is."""

import numpy as np
import pytest

from aqualog.align.freezes import within
from aqualog.align.lines import line_watch_of
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.table import build_signals
from aqualog.core.records import Channel, ChannelInfo
from aqualog.core.vehicle import Vehicle
from tests.align.test_windows import channel, same
from tests.checks.made import DT, made
from tests.checks.made import signals as as_drive

S = 1_000_000_000


def moving(seconds=200.0, rate=10.0, step=0.01, noise=0.05, seed=1):
    """A speed as a logger has it, in whole steps [km/h]."""
    t = np.arange(round(seconds * rate)) / rate
    v = 60.0 + 20.0 * np.sin(0.2 * t) + np.random.default_rng(seed).standard_normal(t.size) * noise
    return np.round(t * S).astype(np.int64), np.round(v / step) * step if step else v


def filled(t, x, start_s, end_s, step=0.01):
    """The same with a line from one second to another."""
    own = (t >= start_s * S) & (t <= end_s * S)
    y = x.copy()
    y[own] = np.interp(t[own], [t[own][0], t[own][-1]], [x[own][0], x[own][0] + 8.0])
    return t, np.round(y / step) * step if step else y


def found(t, x, name="v_x", pieces=1):
    watch = line_watch_of(name)
    for part in np.array_split(np.arange(t.size), pieces):
        watch.push(t[part], x[part])
    return watch.finish()


@pytest.mark.parametrize("pieces", [1, 2, 13, 1000])
@pytest.mark.parametrize(("rate", "step"), [(10.0, 0.01), (100.0, 0.01), (50.0, 0.0)])
@pytest.mark.parametrize("name", ["v_x", "torque_r", "a_x", "omega_fl"])
def test_a_filled_gap(name, rate, step, pieces):
    t, x = filled(*moving(rate=rate, step=step), 40.0, 99.5, step)
    assert found(t, x, name, pieces) == ((40 * S, 99 * S),)
    out = within(t, found(t, x, name, pieces), has_end=False)
    assert t[out][0] > 40 * S
    assert t[out][-1] < 99 * S


@pytest.mark.parametrize(
    "case",
    {
        "as it is": moving(),
        "four seconds": filled(*moving(), 40.0, 44.5),
        "one speed": (moving()[0], np.where((moving()[0] > 40 * S) & (moving()[0] < 90 * S), 60.0, moving()[1])),
        "no noise anywhere": filled(*moving(noise=0.0), 40.0, 99.5),
        "no noise, not rounded": filled(*moving(noise=0.0, step=0.0), 40.0, 99.5, 0.0),
        "one speed, not rounded": (moving()[0], 60.0 + 1e-14 * np.random.default_rng(1).standard_normal(2000)),
        "rounding alone, then a ramp": filled(moving()[0], 60 + 1e-14 * moving()[1], 40.0, 99.5, 0.0),
        "coarse": filled(*moving(step=1.0, noise=0.3), 40.0, 99.5, 1.0),
        "two seconds known": (moving()[0][500:520], np.linspace(0.0, 9.0, 20)),
        "little else": filled(*moving(seconds=40.0), 5.0, 39.0),
        "once a second": filled(*moving(rate=1.0, seconds=900.0), 40.0, 99.5),
    }.items(),
    ids=lambda c: c[0],
)
def test_what_no_logger_filled(case):
    assert found(*case[1]) == ()


def test_a_slow_signal_that_a_logger_joins_from_second_to_second():
    t, x = moving(noise=0.3)
    knots = t[::10]
    assert found(t, np.round(np.interp(t, knots, x[::10]), 2)) == ()


def test_heights_and_temperatures_may_run_straight():
    assert line_watch_of("altitude") is None
    assert line_watch_of("ambient_temperature") is None


def test_a_pause_within_ends_a_line():
    t, x = filled(*moving(), 40.0, 99.5)
    own = (t < 60 * S) | (t > 70 * S)
    spans = found(t[own], x[own])
    assert [(a // S, b // S) for a, b in spans] == [(40, 59), (70, 99)]


def test_what_was_filled_is_missing_and_counted():
    t, x = filled(*moving(), 40.0, 99.5)
    mapped = {
        n: (Entry(n, (n,)), Channel(ChannelInfo(n, n, "km/h", t.size, "a.mf4"), t, y, False))
        for n, y in {"v_x": x, "omega_fl": moving()[1]}.items()
    }
    signals = build_signals(mapped, signal_map=SignalMap(), vehicle=Vehicle())
    lost = np.isnan(signals.array("v_x"))
    assert lost[405:990].all()
    assert not lost[:400].any()
    assert not lost[990:].any()
    assert not np.isnan(signals.array("omega_fl")).any()
    assert signals.origins["v_x"].joined == 589
    assert signals.origins["v_x"].missing_fraction == pytest.approx(0.295, abs=0.005)
    assert signals.quality.dropped_samples == 589
    (note,) = [n for n in signals.quality.notes if "straight line" in n]
    assert note.startswith("a.mf4:v_x: 589 samples (40.0 to 99.0 s)")


@pytest.mark.parametrize("size", [7, 300])
def test_in_windows_as_in_one_go(size):
    t, x = filled(*moving(rate=100.0), 40.0, 99.5)
    u, y = filled(*moving(rate=20.0, seed=2), 63.0, 120.0)
    whole = same([channel("omega_fl", t / S, x, "km/h"), channel("a_x", u / S, y / 40.0, "m/s^2"),
                  channel("torque_r", t / S, 5.0 * x, "N*m")], rows=900, size=size)  # fmt: skip
    assert {n: o.joined > 0 for n, o in whole.origins.items()} == {
        "a_x": True, "omega_fl": True, "torque_rl": True, "torque_rr": True,
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_sound_drives_have_no_line(seed):
    drive = as_drive(made(seed=seed, seconds=400.0, stops=seed))
    t = np.round(np.arange(drive.rows) * DT * S).astype(np.int64)
    for name in drive.symbols:
        watch = line_watch_of(name)
        if watch is not None:
            watch.push(t, drive.array(name))
            assert watch.finish() == (), name
