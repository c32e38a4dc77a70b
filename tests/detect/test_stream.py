"""A drive fed in pieces gives the same features, statistics and events as in one go, bit for bit."""

import itertools
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.detect import stream
from aqualog.detect.stream import DriveStream, detect_drive
from tests.drives import AWD, CAR, FWD, drive, lane

DRIVES = {
    "rwd": (CAR, {"lanes": (lane(),), "speed_kmh": ((0.0, 104.0),)}),
    "fwd": (FWD, {"lanes": (lane(),), "speed_kmh": ((0.0, 104.0),)}),
    "awd in a curve": (
        AWD,
        {"lanes": (lane(),), "speed_kmh": ((0.0, 100.0),), "yaw_rate": ((0, 0), (5, 0.1), (20, -0.1))},
    ),
}


def run(vehicle, columns, symbols, edges):
    stream = DriveStream(vehicle, 10_000_000, symbols)
    features, tracks, events = [], [], []
    for a, b in itertools.pairwise(edges):
        piece = stream.push({s: columns[s][a:b] for s in symbols})
        features.append(piece.features)
        tracks.append(piece.tracks)
        events += piece.events
    events += stream.finish()
    joined = {name: np.concatenate([f[name] for f in features]) for name in features[0]}
    statistics = {
        (t.detector, t.wheel): (
            np.concatenate([p[i].statistic for p in tracks]),
            np.concatenate([p[i].active for p in tracks]),
        )
        for i, t in enumerate(tracks[0])
    }
    return joined, statistics, sorted(events, key=lambda e: (e.start_s, e.detector, e.wheel or ""))


def prepared(name, drop=()):
    vehicle, kw = DRIVES[name]
    signals, _ = drive(vehicle, duration_s=16.0, **kw)
    symbols = [s for s in signals.symbols if s not in drop]
    columns = {s: signals.array(s).copy() for s in symbols}
    rng = np.random.default_rng(0)
    for s in symbols:  # holes anywhere must not matter
        at = rng.integers(100, 1500)
        columns[s][at : at + 7] = np.nan
    return vehicle, columns, symbols


def assert_same(one, two):
    for name in one[0]:
        assert one[0][name].tobytes() == two[0][name].tobytes(), name
    for key in one[1]:
        assert one[1][key][0].tobytes() == two[1][key][0].tobytes(), key
        assert (one[1][key][1] == two[1][key][1]).all(), key
    assert one[2] == two[2]


@pytest.mark.parametrize("name", list(DRIVES))
@pytest.mark.parametrize("drop", [(), ("v_x",), ("v_x", "a_x"), ("yaw_rate",), ("steer_angle",)])
def test_twenty_cuts(name, drop):
    vehicle, columns, symbols = prepared(name, drop)
    n = columns["omega_fl"].size
    whole = run(vehicle, columns, symbols, [0, n])
    assert whole[2], "the drive must hold events, or the test shows nothing"
    for seed in range(3):
        cuts = np.sort(np.random.default_rng(seed).choice(np.arange(1, n), 20, replace=False))
        assert_same(whole, run(vehicle, columns, symbols, [0, *cuts.tolist(), n]))


def test_sample_by_sample():
    vehicle, columns, symbols = prepared("rwd")
    n = 800  # two seconds of the lane
    columns = {s: x[:n] for s, x in columns.items()}
    assert_same(run(vehicle, columns, symbols, [0, n]), run(vehicle, columns, symbols, list(range(n + 1))))


def test_a_drive_in_pieces_is_the_drive_in_one(monkeypatch):
    signals, _ = drive(CAR, duration_s=16.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),))
    assert signals.frame.height < stream.ROWS
    whole = detect_drive(signals, CAR)
    assert whole.events
    monkeypatch.setattr(stream, "ROWS", 333)
    pieces, bare = detect_drive(signals, CAR), detect_drive(signals, CAR, samples=False)
    assert pieces.features.equals(whole.features)
    for one, other in zip(whole.tracks, pieces.tracks, strict=True):
        assert one.statistic.tobytes() == other.statistic.tobytes(), one.detector
        assert (one.active == other.active).all()
        assert other.active.size == signals.frame.height
    for result in (pieces, bare):
        assert (result.events, result.notes) == (whole.events, whole.notes)
        assert repr(result.slopes) == repr(whole.slopes)
        assert [(t.detector, t.wheel) for t in result.tracks] == [(t.detector, t.wheel) for t in whole.tracks]
    assert bare.features.is_empty()
    assert not any(t.statistic.size or t.active.size for t in bare.tracks)


@pytest.mark.parametrize("lost", ["", "torque_", "a_x"])
@pytest.mark.parametrize(("first", "end"), [(2.0, 6.6), (5.5, 7.0), (8.0, 9.5)])
def test_no_episode_of_water_begins_or_ends_within_a_gap(lost, first, end):
    """The lane is from 6 to 14 s; the resistance reaches back by up to two seconds."""
    signals, _ = drive(CAR, duration_s=18.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),))
    t = pl.col("t")
    gone = [pl.when((t >= first) & (t < end)).then(None).otherwise(pl.col(s)).alias(s)
            for s in signals.symbols if s.startswith(lost)]  # fmt: skip
    found = detect_drive(replace(signals, frame=signals.frame.with_columns(gone)), CAR, samples=False)
    (*_, last) = found.judgement.of("aquaplaning")
    assert last.end_s > 13.0
    known = [e for e in found.events if e.detector == "resistance"]
    for begin, until in [e.cause_s for e in known] + [
        (e.start_s, e.end_s) for e in found.judgement.episodes if not lost
    ]:
        assert not first < begin < end
        assert not first < until < end
