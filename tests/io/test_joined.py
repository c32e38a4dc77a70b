"""Parts of one recording, which a logger splits by size or time, are one drive; drives of their own are not."""

import numpy as np
import pytest

import aqualog as aq
from aqualog.align.load import LoadedLong, load_drive, load_signals
from aqualog.align.mapping import SignalMap, SourceClock
from aqualog.core.errors import SignalError
from aqualog.core.vehicle import Vehicle
from aqualog.io.write_log import LogGroup, write_log
from aqualog.io.write_mdf import MdfGroup, write_mf4

START_NS = 1_748_000_000 * 10**9
WHEELS = ("omega_fl", "omega_fr", "omega_rl", "omega_rr")


def mf4(path, first_s, last_s, *, extra=False):
    """Two time bases, 100 and 10 Hz, of a car whose speed tells the time."""
    fast, slow = (np.arange(round(first_s * hz), round(last_s * hz)) / hz for hz in (100, 10))
    wheels = dict.fromkeys(WHEELS, ("rad/s", "", 50.0 + 0.1 * fast))
    rest = {"v_x": ("m/s", "", 15.0 + 0.03 * slow)} | ({"altitude": ("m", "", slow)} if extra else {})
    groups = [MdfGroup("wheels", fast - first_s, wheels), MdfGroup("gnss", slow - first_s, rest)]
    write_mf4(path, groups, START_NS + round(first_s * 1e9), "")
    return path


def csv(path, first_s, last_s, *, begins_s=None):
    """By date if `begins_s` is not given; else stamps from there on."""
    t = np.arange(round(first_s * 100), round(last_s * 100)) / 100
    if begins_s is None:
        stamps = [str(np.datetime64(START_NS + round(x * 1e9), "ns")) for x in t]
    else:
        stamps = [f"{x - first_s + begins_s:.2f}" for x in t]
    rows = [f"{s},{','.join([f'{50 + 0.1 * x:.4f}'] * 4)},{15 + 0.03 * x:.4f}" for s, x in zip(stamps, t, strict=True)]
    path.write_text(
        "\n".join(
            [",".join(["t" if begins_s is None else "t [s]", *(f"{w} [rad/s]" for w in WHEELS), "v_x [m/s]"]), *rows]
        )
    )
    return path


def load(*paths, signal_map=None):
    return load_signals(paths, vehicle=Vehicle(), signal_map=signal_map)


@pytest.mark.parametrize("make", [mf4, csv])
def test_parts_are_the_whole(make, tmp_path):
    suffix = "mf4" if make is mf4 else "csv"
    whole = load(make(tmp_path / f"whole.{suffix}", 0.0, 60.0))
    cuts = (0.0, 20.0, 40.0, 60.0)
    parts = [make(tmp_path / f"p{k}.{suffix}", *cuts[k : k + 2]) for k in range(3)]
    joined = load(*reversed(parts))  # whatever the order in which they are named
    assert joined.frame.equals(whole.frame)
    assert joined.start_ns == whole.start_ns == START_NS
    assert [n for n in joined.quality.notes if f"goes on in p1.{suffix}, p2.{suffix}; joined" in n]
    assert not [n for n in joined.quality.notes if "none of the signals" in n]


def test_in_windows_as_in_one_go(tmp_path):
    parts = [mf4(tmp_path / "b.mf4", 30.0, 60.0), mf4(tmp_path / "a.mf4", 0.0, 30.0, extra=True)]
    whole = load(*parts)
    opened = load_drive(parts, vehicle=Vehicle(), least=1)
    assert isinstance(opened, LoadedLong)
    with opened.opened:
        pieces = [s.frame for s, _ in opened.drive.windows(1000)]
    assert sum(p.height for p in pieces) == whole.frame.height == 6000
    for name in (*WHEELS, "v_x", "altitude"):  # which only the first part has
        there = np.concatenate([p[name].to_numpy() for p in pieces])
        assert np.array_equal(there, whole.frame[name].to_numpy(), equal_nan=True)


def test_beside_another_logger(tmp_path):
    parts = [mf4(tmp_path / f"can{k}.mf4", 10.0 * k, 10.0 * k + 10) for k in (1, 2)]
    t = np.arange(0, 2000, dtype=np.int64) * 10_000_000
    imu = tmp_path / "imu.mf4"
    write_log(
        imu, t, [LogGroup("imu", {"a_x": ("m/s²", "", np.sin(t * 1e-9))})], suffix=".mf4", start_ns=START_NS + 10**10
    )
    assert {"a_x", *WHEELS} <= set(load(imu, *parts).symbols)


def test_a_pause_of_a_second_and_a_longer_one(tmp_path):
    first = mf4(tmp_path / "a.mf4", 0.0, 20.0)
    assert load(first, mf4(tmp_path / "b.mf4", 20.9, 40.0)).duration_s == pytest.approx(40.0)
    with pytest.raises(
        SignalError, match=r"separate drives \(c.mf4 begins 62\.\d s after a.mf4 ends, .* at most 1 s; each"
    ):
        load(first, mf4(tmp_path / "c.mf4", 82.0, 99.0))
    with pytest.raises(SignalError, match=r"d.mf4 begins 10\.0 s before a.mf4 ends"):
        load(first, mf4(tmp_path / "d.mf4", 10.0, 30.0))


def test_without_a_date(tmp_path):
    first = csv(tmp_path / "a.csv", 0.0, 20.0, begins_s=0.0)
    on, anew = csv(tmp_path / "b.csv", 20.0, 40.0, begins_s=20.0), csv(tmp_path / "c.csv", 20.0, 40.0, begins_s=0.0)
    assert load(first, on).duration_s == pytest.approx(40.0)
    with pytest.raises(
        SignalError, match=r"have no date and do not go on .* Export them with date and time, or as one"
    ):
        load(first, anew)


def test_a_file_with_a_clock_of_its_own_in_the_map_is_no_part(tmp_path):
    parts = [mf4(tmp_path / f"{n}.mf4", at, at + 20.0) for n, at in (("a", 0.0), ("b", 20.0))]
    with pytest.raises(SignalError, match=r"the signal map gives b\.mf4 a clock of its own"):
        load(*parts, signal_map=SignalMap(clocks={"b": SourceClock(offset_s=3.0)}))
    for pattern in ("*.mf4", "a"):  # that of the first part holds for all
        joined = load(*reversed(parts), signal_map=SignalMap(clocks={pattern: SourceClock(offset_s=3.0)}))
        assert joined.duration_s == pytest.approx(40.0)
        assert joined.start_ns == START_NS - 3 * 10**9


def test_inspect_shows_the_recording_once(tmp_path):
    parts = [mf4(tmp_path / f"{n}.mf4", at, at + 20.0) for n, at in (("a", 0.0), ("b", 20.0))]
    found = aq.inspect(parts)
    assert {o.file for o in found.overviews} == {"a.mf4"}
    assert "b.mf4: MDF, goes on with a.mf4" in found.text()


def test_align_takes_a_recording_as_one_source(tmp_path):
    parts = [mf4(tmp_path / f"{n}.mf4", at, at + 20.0) for n, at in (("a", 0.0), ("b", 20.0))]
    with pytest.raises(SignalError, match="parts of one recording, on one clock"):
        aq.align(parts)
