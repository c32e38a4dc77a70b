"""Windows of a long drive are bit for bit those of the whole table, whatever is wrong with the channels."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.table import build_signals
from aqualog.align.windows import NotInPiecesError, long_drive
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.records import Channel, ChannelInfo
from aqualog.core.vehicle import Vehicle
from aqualog.io.reader import part_of

CAR = Vehicle()
S = 1_000_000_000


def channel(name, t, x, unit="", file="a.mf4"):
    t_ns = np.round(np.asarray(t) * S).astype(np.int64)
    return Channel(ChannelInfo(name, name, unit, len(t), file), t_ns, np.asarray(x, dtype=float), False)


def pieces(channels, size, rng):
    """Each channel in a part of its own, in pieces of changing size, some empty."""

    def of(c):
        at = 0
        while at < len(c.t_ns):
            n = int(rng.integers(0, 2 * size + 1))
            yield [replace(c, t_ns=c.t_ns[at : at + n], values=c.values[at : at + n])]
            at += n

    return [part_of([c.info], of(c)) for c in channels]


def both(channels, *, rows=700, size=300, seed=0, entries=None, rate_hz=None):
    given = entries or {}
    entries = {c.info.name: given.get(c.info.name, Entry(c.info.name, c.info.name)) for c in channels}
    mapped = {c.info.name: (entries[c.info.name], c) for c in channels}
    signal_map = SignalMap(entries=given)
    whole = build_signals(mapped, signal_map=signal_map, vehicle=CAR, rate_hz=rate_hz)
    rng = np.random.default_rng(seed)
    drive = long_drive(
        {n: (e, c.info) for n, (e, c) in mapped.items()}, lambda: pieces(channels, size, rng),
        signal_map=signal_map, vehicle=CAR, rate_hz=rate_hz,
    )  # fmt: skip
    windows = list(drive.windows(rows))
    bridged = frozenset(s for _, gaps in windows for s, b in gaps.items() if b)
    missing = {n: sum(w.frame[n].null_count() for w, _ in windows) for n in drive.plan.symbols}
    return whole, pl.concat([w.frame for w, _ in windows]), drive.plan.facts(missing, bridged, ())


def same(channels, **kw):
    whole, frame, facts = both(channels, **kw)
    assert frame.equals(whole.frame)
    assert frame.schema == whole.frame.schema
    assert facts.origins == whole.origins
    assert list(facts.origins) == list(whole.origins)
    assert facts.quality == whole.quality
    assert (facts.dt_ns, facts.start_ns, facts.files) == (whole.dt_ns, whole.start_ns, whole.files)
    return whole


def wheels(n=5000, dt=0.01, **kw):
    t = np.arange(n) * dt
    return [channel(f"omega_{w}", t, 60.0 + np.sin(0.1 * t + i), "rad/s", **kw) for i, w in enumerate(("fl", "fr"))]


def test_a_plain_drive_with_signals_of_other_rates():
    rng = np.random.default_rng(1)
    fast = np.arange(25_000) * 0.002 + 0.0003
    slow = np.arange(0.05, 50.0, 0.1)
    same([
        *wheels(),
        channel("a_x", fast, rng.standard_normal(fast.size), "m/s^2"),
        channel("v_x", slow, 20.0 + rng.standard_normal(slow.size), "km/h", file="b.mf4"),
        channel("on_water", [3.0, 17.0, 18.5, 44.0], [0, 1, 0, 1], "", file="c.mf4"),
        channel("torque_r", slow, 100.0 * rng.standard_normal(slow.size), "N*m"),
        channel("steering_wheel_angle", np.sort(rng.uniform(0, 50, 2000)), rng.standard_normal(2000), "deg"),
    ])  # fmt: skip


@pytest.mark.parametrize("slower", [4, 10])
def test_a_rate_that_falls(slower):
    """Steps of more than five sample times are gaps: half of a drive that nothing else would tell of."""
    t = np.concatenate([np.arange(3000), np.arange(3000, 6000, slower)]) * 0.01
    whole = same([channel(f"omega_{w}", t, 60.0 + np.sin(0.1 * t), "rad/s") for w in ("fl", "fr")])
    told = [n for n in whole.quality.notes if "no value for" in n]
    if slower == 4:
        assert told == []
    else:
        (note,) = told
        assert note.startswith("a.mf4: omega_fl, omega_fr: no value for 45 % of the drive")
        assert "further apart than 50 ms" in note


def test_a_signal_that_ends_early_is_told_where_much_is_missing():
    t = np.arange(5000) * 0.01
    for last, is_told in ((4200, False), (3900, True)):
        whole = same([*wheels(), channel("a_x", t[:last], np.sin(t[:last]), "m/s^2", file="b.mf4")])
        assert any(n.startswith("b.mf4: a_x: no value for 22 %") for n in whole.quality.notes) == is_told


@pytest.mark.parametrize("seed", range(12))
def test_channels_with_faults(seed):
    """Gaps, jitter, doubled stamps, values that are none or cannot be, dropouts of a wheel, dead wheels."""
    rng = np.random.default_rng(seed)
    size = int(rng.choice([1, 7, 90, 800]))
    n = 2000 if size == 1 else 6000
    channels = []
    for name, unit in (("omega_fl", "rad/s"), ("omega_rr", "km/h"), ("a_x", "g"), ("v_x", "m/s")):
        t = np.arange(n) * 0.01 + rng.uniform(0, 0.002, n) * (seed % 2)
        keep = np.ones(t.size, dtype=bool)
        for _ in range(rng.integers(0, 4)):
            a = rng.integers(0, t.size)
            keep[a : a + rng.integers(1, 300)] = False
        t = np.round(t[keep], 6)
        if rng.random() < 0.5:
            again = rng.integers(1, t.size, 5)
            t[again] = t[again - 1]
            t = np.sort(t)
        x = 40.0 + np.cumsum(rng.standard_normal(t.size)) * 0.01
        if name == "a_x":
            x = 0.01 * x
        x[rng.integers(0, x.size, 8)] = [np.nan, np.inf, 1e9, -1e9, 0.0, 300.0, np.nan, 5e4]
        for _ in range(3):
            a = rng.integers(0, x.size)
            x[a : a + rng.choice([1, 2, 30, 99, 101, 400])] = rng.choice([0.0, 0.0, 200.0])
        if rng.random() < 0.3:
            x[rng.integers(x.size // 2, x.size) :] = 0.0
        channels.append(channel(name, t, x, unit))
    same(channels, size=size, rows=int(rng.choice([13, 500, 5000])), seed=seed)


@pytest.mark.parametrize("seed", range(6))
def test_many_short_dropouts_of_a_wheel(seed):
    """Pieces end in dropouts, at their ends and within a second of them."""
    rng = np.random.default_rng(seed)
    x = 40.0 + 0.001 * np.arange(3000)
    for a in np.cumsum(rng.integers(5, 130, 60)):
        x[a : a + rng.integers(1, 60)] = rng.choice([0.0, 90.0, 41.0])
    same([channel("omega_fl", np.arange(3000) * 0.01, x, "rad/s")], size=int(rng.choice([1, 5, 40])), seed=seed)


@pytest.mark.parametrize("seed", range(6))
def test_bursts_of_stamps_while_a_wheel_locks(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(3000) * 0.01
    x = 80.0 - np.abs((np.arange(3000) % 40) - 20) * rng.uniform(1.0, 4.0) + rng.normal(0, 0.01, 3000)
    for k in np.cumsum(rng.integers(15, 60, 60)):
        m = int(rng.integers(2, 14))
        if rng.random() < 0.5:
            t[k : k + m] = t[k + m] - 1e-4 * np.arange(m, 0, -1)
        else:
            t[k : k + m] = t[k]
        if rng.random() < 0.2:
            x[k + 2 : k + 2 + m] = rng.choice([0.0, 300.0, 20.0])
    same([channel("omega_fl", t, x, "rad/s")], size=int(rng.choice([1, 5, 40])), seed=seed)


@pytest.mark.parametrize("seed", range(4))
def test_a_speed_that_is_lost_and_spikes_of_yaw_rate_and_steering(seed):
    rng = np.random.default_rng(seed)
    n, t = 3000, np.arange(3000) * 0.01
    v = 25.0 + np.sin(0.2 * t) + 0.02 * rng.standard_normal(n)
    yaw, steer = (k * np.sin(t) + 0.001 * rng.standard_normal(n) for k in (0.3, 0.05))
    for a in rng.integers(0, n, 12):
        v[a : a + rng.choice([1, 3, 90, 300])] = 0.0
        yaw[a : a + rng.integers(1, 20)] += rng.choice([0.5, 2.0, -3.0])
        steer[a : a + rng.integers(1, 20)] += rng.choice([0.12, 0.3, -0.5])
    if seed == 3:
        v[rng.integers(n // 2, n) :] = 0.0
    signals = [
        *wheels(n), channel("v_x", t, v, "m/s"), channel("yaw_rate", t, yaw, "rad/s"),
        channel("steer_angle", t, steer, "rad"),
    ]  # fmt: skip
    whole = same(signals, size=int(rng.choice([1, 5, 40])), rows=int(rng.choice([13, 500])), seed=seed)
    assert whole.origins["v_x"].out_of_range == (v == 0.0).sum()
    assert len([note for note in whole.quality.notes if "as no car" in note]) == 3


@pytest.mark.parametrize("seed", range(3))
def test_many_spikes_of_an_acceleration(seed):
    rng = np.random.default_rng(seed)
    x = rng.normal(0.0, 1.0, 3000)
    for a in np.cumsum(rng.integers(3, 60, 80)):
        x[a : a + rng.integers(1, 20)] += rng.choice([14.0, -17.0, 25.0])
    signals = [*wheels(3000), channel("a_x", np.arange(3000) * 0.01, x, "m/s^2")]
    whole = same(signals, size=int(rng.choice([1, 5, 40])), seed=seed)
    assert len([n for n in whole.quality.notes if "a_x" in n]) >= 2


@pytest.mark.parametrize("seed", range(8))
def test_codes_that_stand_for_seconds_and_wheels_that_wake_up_late(seed):
    rng = np.random.default_rng(seed)
    signals = wheels()
    for c in signals:
        for a in np.cumsum(rng.integers(50, 900, 8)):
            c.values[a : a + rng.choice([5, 99, 100, 101, 250])] = rng.choice([0.0, 590.0, 300.0])
        if rng.random() < 0.7:
            c.values[: rng.integers(2, 900)] = rng.choice([0.0, 590.0])
    whole = same(signals, size=int(rng.choice([1, 40, 300])), seed=seed)
    assert whole.quality.dropped_samples > 100


@pytest.mark.parametrize("size", [40, 300, 6000])
def test_a_signal_that_is_frozen_for_a_while(size):
    rng = np.random.default_rng(3)
    signals = [
        replace(c, values=np.round(c.values + 0.05 * rng.standard_normal(c.values.size), 2)) for c in wheels(12_000)
    ]
    for k, (start, end) in enumerate([(1000, 1700), (4000, 11_999)]):
        signals[k].values[start:end] = signals[k].values[start]
    signals[0].values[5000:5003] = 0.0  # a dropout of the sensor, too
    whole = same(signals, size=size)
    assert whole.quality.frozen_samples > 690 + 7990
    assert [o.frozen > 690 for o in whole.origins.values()] == [True, True]
    assert len([n for n in whole.quality.notes if "frozen" in n]) == 2


def test_codes_and_scales_of_the_map_and_an_own_rate():
    entries = {"omega_fr": Entry("omega_fr", "omega_fr", invalid=(60.5,), scale=2.0, offset=0.1)}
    left, right = wheels(3000)
    same([left, replace(right, values=np.round(right.values, 1))], entries=entries)
    same(wheels(), rate_hz=33.0)


def test_a_pause_of_the_whole_log_and_one_signal_that_ends_early():
    left, right = wheels(4000)
    keep = np.r_[0:1000, 1900:4000]
    left = replace(left, t_ns=left.t_ns[keep], values=left.values[keep])
    assert same([left, replace(right, t_ns=right.t_ns[:500], values=right.values[:500])]).quality.faults.pauses == 1


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_the_shortest_drives(rows):
    same([channel("omega_fl", np.arange(4) * 0.01, [1.0, 2.0, 0.0, 0.0], "rad/s")], rows=rows, size=1)


@pytest.mark.parametrize(
    ("at", "by", "match"),
    [(1, -15_000_000, "out of order"), (2500, -15_000_000, "out of order"), (1, 10**5 * S, "leap"),
     (4990, 10**5 * S, "leap")],
)  # fmt: skip
def test_stamps_that_step_back_or_leap_by_a_day_need_the_whole_log(at, by, match):
    left, right = wheels()
    left.t_ns[at:] += by
    with pytest.raises(NotInPiecesError, match=match):
        both([left, replace(right, t_ns=left.t_ns) if by > 0 else right])


def test_a_unit_that_is_none_of_the_signal_leaves_it_out():
    left, right = wheels()
    found = same([left, replace(right, info=replace(right.info, unit="V"))])
    assert any("left out" in n for n in found.quality.notes)
    assert "omega_fr" not in found.symbols


def test_no_usable_signal_is_an_error():
    c = replace(wheels(10)[0], values=np.full(10, np.nan))
    found = {"omega_fl": (Entry("omega_fl", "omega_fl"), c.info)}
    with pytest.raises(SignalError, match="no usable signal"):
        long_drive(found, lambda: pieces([c], 3, np.random.default_rng(0)), signal_map=SignalMap(), vehicle=CAR)


def test_a_rate_with_which_the_rows_grow_too_many_is_the_users():
    with pytest.raises(ConfigError, match=r"a rate of 100000 Hz makes \d+ rows of 5000 samples"):
        both(wheels(), rate_hz=1e5)
