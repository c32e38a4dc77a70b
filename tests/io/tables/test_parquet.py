"""Parquet: our own files back, and those of others."""

import datetime as dt

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import LogError
from aqualog.io.reader import ReadOptions
from aqualog.io.tables import parquet
from aqualog.io.tables.parquet import ParquetReader, field_metadata
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


def test_the_last_row_of_a_time_without_unit_does_not_cost_a_decoding_for_each_row(stored, monkeypatch):
    calls = []
    scan = pl.scan_parquet
    monkeypatch.setattr(pl, "scan_parquet", lambda *a, **k: calls.append(a) or scan(*a, **k))
    channels, _ = read(stored({"t": np.arange(500) * 0.01, "v": np.arange(500.0)}))
    assert channels["v"].values.size == 500
    assert len(calls) < 20


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


def test_numbers_as_text_are_told(stored):
    channels, faults = read(
        stored({"t [s]": [0.0, 0.1], "v": [1, 2], "omega_fl": ["88.5", "1.088,5"], "gear": ["D", "2"]})
    )
    assert list(channels) == ["v"]
    assert [n for n in faults.notes if "as text" in n] == [
        'log.parquet: column "omega_fl" holds numbers as text and is left out: write it as numbers'
    ]


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


def in_pieces(path, size, monkeypatch, **options):
    monkeypatch.setattr(parquet, "_PIECE", size)
    with ParquetReader(path, ReadOptions(**options)) as reader:
        infos = reader.channels()
        (part,) = reader.parts(infos)
        pieces = list(part.pieces)
        assert part.channels == {(i.file, i.path) for i in infos}
        return pieces, reader.faults


N = 200
SECONDS = [None if k == 77 else k * 0.01 for k in range(N)]
TIMES = {
    "seconds": {"t [s]": SECONDS},
    "no unit": {"t": SECONDS},
    "whole numbers without a unit": {"timestamp": [10**9 * (k if k < N - 1 else 30_000) for k in range(N)]},
    "epoch": {"time [ns]": [None if k in (3, *range(20, 40)) else START + k * 10**7 for k in range(N)]},
    "datetime": {"time": [None if k == 9 else dt.datetime(2026, 3, 1, 23) + k * dt.timedelta(minutes=1) for k in range(N)]},
    "duration": {"t": [k * dt.timedelta(milliseconds=10) for k in range(N)]},
    "day and clock": {"date": [dt.date(2026, 3, 1)] * N, "time": [dt.time(1, k // 60, k % 60, 500) for k in range(N)]},
    "text": {"time": [f"01/{2 if k < 150 else 14}/2026 01:{k // 60:02}:{k % 60:02}" for k in range(N)]},
}  # fmt: skip


@pytest.mark.parametrize("size", [30, 10**6])
@pytest.mark.parametrize("time", TIMES)
def test_pieces_are_those_of_the_whole(stored, monkeypatch, time, size):
    values = [None if k % 7 == 0 else float("nan") if k % 11 == 0 else k / 3 for k in range(N)]
    path = stored(TIMES[time] | {"v [m/s]": values, "gear": [k // 50 for k in range(N)]})
    whole, faults = read(path)
    pieces, own_faults = in_pieces(path, size, monkeypatch)
    assert len(pieces) == (1 if time == "text" or size == 10**6 else -(-N // max(1, size // (2 + len(TIMES[time])))))
    assert own_faults == faults
    for k, name in enumerate(["v", "gear"]):
        channels = [p[k] for p in pieces]
        assert {(c.info, c.absolute) for c in channels} == {(whole[name].info, whole[name].absolute)}
        assert np.concatenate([c.t_ns for c in channels]).tolist() == whole[name].t_ns.tolist()
        assert np.concatenate([c.values for c in channels]).tobytes() == whole[name].values.tobytes()


def test_pieces_of_our_own_file_begin_when_it_does(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    t = np.r_[[np.nan] * 30, np.arange(70) * 0.01]
    write_parquet(path, [TableColumn("t", "s", t), TableColumn("v_x", "m/s", t)], start_ns=START)
    pieces, faults = in_pieces(path, 20, monkeypatch)
    assert [len(c.t_ns) for (c,) in pieces] == [0] * 3 + [10] * 7
    assert pieces[3][0].t_ns[0] == START
    assert all(c.absolute for (c,) in pieces[3:])
    assert faults.lost_samples == 30
    assert "30 rows without a time are left out (first at row 1)" in faults.notes[0]


@pytest.mark.parametrize(
    ("column", "t_ns"),
    [(pl.Series([2**63, 5, 6], dtype=pl.UInt64), [5 * 10**9, 6 * 10**9]),
     (pl.Series([2**62, 5, 6], dtype=pl.Int64).cast(pl.Datetime("ms")), [5 * 10**6, 6 * 10**6]),
     (pl.Series([-(2**62), 5, 6], dtype=pl.Int64).cast(pl.Duration("us")), [5000, 6000])],
)  # fmt: skip
def test_times_beyond_what_nanoseconds_hold_cost_their_row(tmp_path, column, t_ns):
    path = tmp_path / "a.parquet"
    name = "t [s]" if column.dtype == pl.UInt64 else "t"
    pl.DataFrame({name: column, "v": [1.0, 2.0, 3.0]}).write_parquet(path)
    with ParquetReader(path, ReadOptions()) as reader:
        (v,) = reader.read(reader.channels())
        assert (v.t_ns.tolist(), v.values.tolist()) == (t_ns, [2.0, 3.0])
        assert reader.faults.lost_samples == 1


def test_more_rows_than_the_file_can_hold_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(parquet, "_MOST_ROWS", 1000)
    path = tmp_path / "a.parquet"
    pl.select(t=pl.repeat(0.0, 1_000_000), v=pl.repeat(1.0, 1_000_000)).write_parquet(path)
    with pytest.raises(LogError, match=r"declares 1000000 rows in \d+ bytes"):
        ParquetReader(path, ReadOptions())
    pl.DataFrame({"t": np.arange(2000.0), "v": np.arange(2000.0)}).write_parquet(path)
    with ParquetReader(path, ReadOptions()) as reader:
        assert reader.channels()[0].count == 2000


@pytest.mark.parametrize("rows", [99, 101])
def test_an_index_that_declares_other_rows_than_there_are(rows, tmp_path, monkeypatch):
    """The library counts the rows of the file by its index, and of a column by its pages."""
    path = tmp_path / "a.parquet"
    pl.DataFrame({"t [s]": np.arange(100) * 0.01, "v_x": np.arange(100.0)}).write_parquet(path)
    counted = pl.DataFrame({"len": [rows]})
    collect = pl.LazyFrame.collect
    monkeypatch.setattr(
        pl.LazyFrame, "collect", lambda self, *a, **k: counted if self.collect_schema().names() == ["len"] else collect(self, *a, **k)
    )  # fmt: skip
    with pytest.raises(LogError, match=rf"declares other rows than its row groups hold \({rows} and 100\)"):
        ParquetReader(path, ReadOptions())
