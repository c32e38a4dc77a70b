"""Parquet: our own files back, and those of others."""

import datetime as dt

import numpy as np
import polars as pl
import pytest

from aqualog.errors import LogError
from aqualog.io.arrow_schema import field_metadata
from aqualog.io.base import ReadOptions
from aqualog.io.parquet import ParquetReader
from aqualog.io.write_table import TableColumn, write_parquet

START = 1_772_366_400_000_000_000


@pytest.fixture
def stored(tmp_path):
    def write(columns, metadata=None):
        path = tmp_path / "log.parquet"
        pl.DataFrame(columns).write_parquet(path, metadata=metadata)
        return path

    return write


def read(path, **options):
    with ParquetReader(path, ReadOptions(**options)) as reader:
        infos = reader.channels()
        return {c.info.path: c for c in reader.read(infos)}, reader.faults


def test_round_trip(tmp_path):
    path = tmp_path / "a.parquet"
    t = np.arange(5) * 0.01
    v = np.array([1.0, np.nan, 1e-300, -0.1, 5e307])
    write_parquet(path, [TableColumn("t", "s", t), TableColumn("v_x", "km/h", v)], start_ns=START)
    assert pl.read_parquet_schema(path).names() == ["t", "v_x"]
    channels, faults = read(path)
    assert channels["v_x"].info.unit == "km/h"
    assert channels["v_x"].values.tolist() == v[[0, 2, 3, 4]].tolist()
    assert channels["v_x"].t_ns.tolist() == [START + k * 10**7 for k in (0, 2, 3, 4)]
    assert channels["v_x"].absolute
    assert faults.notes == ()
    write_parquet(path, [TableColumn("t", "s", t), TableColumn("v_x", "km/h", v)])
    assert not read(path)[0]["v_x"].absolute


def test_null_is_no_sample_and_nan_is_bad(stored):
    channels, faults = read(stored({"t": [0.0, 0.1, 0.2], "v": [1.0, None, float("nan")]}))
    assert channels["v"].t_ns.tolist() == [0, 2 * 10**8]
    assert channels["v"].values[0] == 1.0
    assert np.isnan(channels["v"].values[1])
    assert faults.lost_samples == 0


def test_names_with_units(stored):
    channels, _ = read(stored({"Time [ms]": [10, 20], "v (km/h)": [1, 2], "v [m/s]": [True, False], "s": ["a", "b"]}))
    assert {k: c.info.unit for k, c in channels.items()} == {"v": "km/h", "v#2": "m/s"}
    assert channels["v"].t_ns.tolist() == [10**7, 2 * 10**7]
    assert channels["v#2"].values.tolist() == [1.0, 0.0]


def test_units_of_fields(tmp_path):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    fields = [
        pa.field("time", pa.float64(), metadata={"unit": "ms"}),
        pa.field("Öl", pa.float32(), metadata={"x": "y", "Unit": "°C"}),
        pa.field("plain", pa.int16()),
    ]
    table = pa.table({"time": [0.0, 10.0], "Öl": [80.5, 81.5], "plain": [1, 2]}, schema=pa.schema(fields))
    path = tmp_path / "a.parquet"
    pq.write_table(table, path)
    channels, _ = read(path)
    assert {k: c.info.unit for k, c in channels.items()} == {"Öl": "°C", "plain": ""}
    assert channels["Öl"].t_ns.tolist() == [0, 10**7]


@pytest.mark.parametrize("text", ["", "%%%", "AAAA", "/////7gAAAA", "/////////////////w==", "AAAAAAAAAAAAAAAAAAAA"])
def test_a_schema_that_is_garbage_has_no_units(text):
    assert field_metadata(text, "unit") == {}


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Berlin"])
def test_datetimes(stored, unit, zone):
    t = pl.Series([START, START + 10**7, None]).cast(pl.Datetime("ns")).dt.cast_time_unit(unit)
    t = t.dt.replace_time_zone("UTC").dt.convert_time_zone(zone) if zone else t
    channels, faults = read(stored({"timestamp": t, "v": [1, 2, 3]}))
    assert channels["v"].t_ns.tolist() == [START, START + 10**7]
    assert channels["v"].absolute
    assert faults.lost_samples == 1
    assert "row 3" in faults.notes[0]


def test_durations(stored):
    t = [dt.timedelta(milliseconds=5), dt.timedelta(milliseconds=15)]
    channels, _ = read(stored({"t": t, "v": [1, 2]}))
    assert channels["v"].t_ns.tolist() == [5 * 10**6, 15 * 10**6]
    assert not channels["v"].absolute


def test_date_and_time(stored):
    day, clock = dt.date(2026, 3, 1), dt.time(12, 0, 0, 10_000)
    channels, _ = read(stored({"date": [day], "time": [clock], "v": [1]}))
    assert channels["v"].t_ns.tolist() == [START + 10**7]


def test_text_stamps(stored):
    channels, _ = read(stored({"time": ["2026-03-01T12:00:00Z", "2026-03-01T12:00:00.5Z"], "v": [1, 2]}))
    assert channels["v"].t_ns.tolist() == [START, START + 5 * 10**8]


def test_whole_nanoseconds_are_exact(stored):
    t = [START + 1, START + 3, None]
    channels, _ = read(stored({"timestamp_ns": t, "v": [1, 2, 3]}))
    assert channels["v"].t_ns.tolist() == t[:2]


def test_projection(stored, monkeypatch):
    path = stored({"t": [0.0, 1.0], "a": [1, 2], "b": [3, 4], "c": [5, 6]})
    asked = []
    select = pl.LazyFrame.select
    monkeypatch.setattr(pl.LazyFrame, "select", lambda self, *a, **k: (asked.append(a[0]), select(self, *a, **k))[1])
    with ParquetReader(path, ReadOptions()) as reader:
        c, a = reader.channels()[2], reader.channels()[0]
        found = reader.read([c, a])
    assert asked[-1] == ["t", "c", "a"]
    assert [f.values.tolist() for f in found] == [[5, 6], [1, 2]]
    assert [c.count, c.file] == [2, "log.parquet"]


def test_the_users_time(stored):
    path = stored({"clock": [100, 200], "v": [1, 2]})
    with pytest.raises(LogError, match=r"no time column among: clock, v.*\[time\] channel"):
        read(path)
    assert read(path, time_channel="clock", time_unit="ms")[0]["v"].t_ns.tolist() == [10**8, 2 * 10**8]


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9, 0.999])
def test_damage_is_a_log_error(stored, keep):
    path = stored({"t": np.arange(1000.0), "v": np.random.default_rng(0).normal(size=1000)})
    raw = path.read_bytes()
    path.write_bytes(raw[: int(len(raw) * keep)])
    with pytest.raises(LogError, match=r"log\.parquet.*cannot be read"):
        read(path)


def test_flipped_bytes_are_read_or_refused(stored):
    path = stored({"t": np.arange(1000.0), "v": np.random.default_rng(0).normal(size=1000)})
    raw, rng = path.read_bytes(), np.random.default_rng(1)
    for _ in range(60):
        damaged = bytearray(raw)
        for at in rng.integers(4, len(raw), size=3):
            damaged[at] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            read(path)
        except LogError:
            continue


def test_metadata_of_others(stored):
    for text in ("not json", "[1]", '{"units": 3, "start_ns": "x"}'):
        channels, _ = read(stored({"t": [0.0], "v [bar]": [1.0]}, metadata={"aqualog": text}))
        assert channels["v"].info.unit == "bar"
