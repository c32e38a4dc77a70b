"""Parquet files whose pages are not those that their index tells of."""

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import LogError
from aqualog.io.reader import ReadOptions
from aqualog.io.tables import parquet
from aqualog.io.tables.parquet import ParquetReader
from aqualog.io.tables.parquet_pages import MalformedError, decode, page_fault, read_index

ROWS, PER_GROUP = 400, 100
T = np.arange(ROWS) * 0.01
V = np.random.default_rng(0).normal(20.0, 1.0, ROWS)
TABLE = {"t [s]": T, "v": V, "n": np.arange(ROWS)}


def written(path, compression="uncompressed", **options):
    pl.DataFrame(TABLE).write_parquet(path, compression=compression, row_group_size=PER_GROUP, **options)
    return path


def read(path):
    with ParquetReader(path, ReadOptions()) as reader:
        channels = {c.info.path: c for c in reader.read(reader.channels())}
        return channels, reader.faults


def read_in_pieces(path):
    with ParquetReader(path, ReadOptions()) as reader:
        (part,) = reader.parts(reader.channels())
        pieces = [{c.info.path: c for c in piece} for piece in part.pieces]
        return {k: np.concatenate([p[k].values for p in pieces]) for k in ("v", "n")}, reader.faults


def place(path, group, column):
    return read_index(path).groups[group].chunks[column]


def faults_of(path):
    index = read_index(path)
    return [page_fault(path, index, g, ["t [s]", "v", "n"]) for g in index.groups]


def varint(number):
    """Of 14 bits."""
    return bytes([number & 127 | 128, number >> 7])


def spoiled(path, at, new, *, instead_of=None):
    data = bytearray(path.read_bytes())
    data[at : at + (len(new) if instead_of is None else instead_of)] = new
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("compression", ["uncompressed", "zstd", "lz4", "snappy", "gzip", "brotli"])
def test_sound_files_are_sound(tmp_path, compression):
    path = written(tmp_path / "a.parquet", compression, data_page_size=256)
    assert faults_of(path) == [""] * 4
    assert read_index(path).unowned == 0
    channels, faults = read(path)
    assert (channels["v"].values == V).all()
    assert faults.notes == ()


@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize("dictionary", [True, False])
def test_files_of_pyarrow_are_sound_and_their_checksums_count(tmp_path, version, dictionary):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "a.parquet"
    pq.write_table(
        pa.table(TABLE), path, row_group_size=PER_GROUP, data_page_version=version, use_dictionary=dictionary,
        write_page_checksum=True, write_page_index=True, compression="none",
    )  # fmt: skip
    assert faults_of(path) == [""] * 4
    assert read_index(path).unowned == 0
    chunk = place(path, 1, "v")
    data = path.read_bytes()
    spoiled(path, chunk.at + chunk.size - 9, bytes([data[chunk.at + chunk.size - 9] ^ 1]))
    channels, faults = read(path)
    assert (channels["v"].values == np.delete(V, np.s_[100:200])).all()
    assert "does not fit to its checksum" in faults.notes[0]


@pytest.mark.parametrize("group", range(4))
def test_missing_bytes_cost_their_row_group_and_those_behind(tmp_path, group):
    """Of plain numbers shifted by 100 bytes each would be a number, too."""
    path = written(tmp_path / "a.parquet")
    chunk = place(path, group, "n")
    spoiled(path, chunk.at + chunk.size // 2, b"", instead_of=100)
    if group == 0:
        with pytest.raises(LogError, match=r'column "n"'):
            read(path)
        return
    channels, faults = read(path)
    assert (channels["v"].values == V[: group * PER_GROUP]).all()
    assert faults.lost_samples == ROWS - group * PER_GROUP
    assert len(faults.notes) == 4 - group
    assert f"row group {group + 1} of 4 (rows {100 * group + 1} to {100 * group + 100}) is left out" in faults.notes[0]
    assert read_in_pieces(path)[1] == faults


def test_bytes_before_the_index_that_nothing_owns_are_told(tmp_path):
    path = written(tmp_path / "a.parquet")
    at = read_index(path).end
    spoiled(path, at - 16, bytes(40), instead_of=0)
    assert any("40 bytes before the index" in n for n in read(path)[1].notes)


def test_a_packed_page_that_cannot_be_unpacked_costs_its_row_group(tmp_path, monkeypatch):
    path = written(tmp_path / "a.parquet", "zstd")
    chunk = place(path, 2, "v")
    spoiled(path, chunk.at + chunk.size - 60, bytes(40))
    monkeypatch.setattr(parquet, "_PIECE", 450)
    for channels, faults in (read(path), read_in_pieces(path)):
        v = channels["v"].values if hasattr(channels["v"], "values") else channels["v"]
        assert (v == np.delete(V, np.s_[200:300])).all()
        assert faults.lost_samples == 100
        assert "row group 3 of 4 (rows 201 to 300) is left out" in faults.notes[0]


def test_a_column_asked_for_later_has_the_same_times(tmp_path):
    path = written(tmp_path / "a.parquet")
    chunk = place(path, 2, "n")
    spoiled(path, chunk.at, bytes(8))
    with ParquetReader(path, ReadOptions()) as reader:
        v, n = reader.channels()
        assert reader.read([v])[0].values.size == ROWS
        (n_read,) = reader.read([n])
        assert (n_read.values * 10**7 == n_read.t_ns).all()
        assert n_read.values.size == ROWS - PER_GROUP
        assert reader.faults.lost_samples == PER_GROUP


def test_values_beyond_the_bounds_of_their_row_group_are_left_out(tmp_path):
    path = written(tmp_path / "a.parquet")
    chunk = place(path, 1, "v")
    spoiled(path, chunk.at + chunk.size - 16, np.array([999.0]).tobytes())
    chunk = place(path, 3, "t [s]")
    spoiled(path, chunk.at + chunk.size - 8, np.array([2.0]).tobytes())  # before the row group's first
    for channels, faults in (read(path), read_in_pieces(path)):
        v = channels["v"].values if hasattr(channels["v"], "values") else channels["v"]
        assert (v == np.delete(V, [198, 399])).all()
        assert any('column "v": 1 value (first at row 199) beyond the least and greatest' in n for n in faults.notes)
        assert any("(first at row 400)" in n for n in faults.notes)


@pytest.mark.parametrize("dtype", [pl.Int8, pl.UInt8, pl.Int32, pl.UInt32, pl.Int64, pl.UInt64, pl.Float32, pl.Float64])
def test_sound_bounds_of_every_type_leave_nothing_out(tmp_path, dtype):
    lowest = -100 if dtype in (pl.Int8, pl.Int32, pl.Int64) else 0
    x = pl.Series("x", [lowest, 127, None, 3] * 50).cast(dtype)
    if dtype.is_float():
        x = pl.select(pl.when(x == 3).then(float("nan")).otherwise(x * 1.1)).to_series()
    if dtype == pl.UInt64:
        x = x + 2**63
    path = tmp_path / "a.parquet"
    pl.DataFrame({"t [s]": T[:200], "x": x}).write_parquet(path, row_group_size=64)
    channels, faults = read(path)
    assert faults == type(faults)()
    assert channels["x"].values.size == 150


def test_page_bombs_are_told_before_they_are_unpacked(tmp_path):
    """A header that tells of 2 GB, and of a file that ends where it did."""
    path = written(tmp_path / "a.parquet", "zstd")
    chunk = place(path, 0, "v")
    header, body = decode(path.read_bytes()[: chunk.at + 100], chunk.at)
    new = b"\x15\x00\x15\xfe\xff\xff\xff\x0f\x15" + varint(2 * (header[3] - 3))  # kind, unpacked, packed
    old = b"\x15\x00\x15" + varint(2 * header[2]) + b"\x15" + varint(2 * header[3])
    assert path.read_bytes()[chunk.at :].startswith(old)
    spoiled(path, body, b"", instead_of=len(new) - len(old))
    spoiled(path, chunk.at, new, instead_of=len(old))
    assert faults_of(path)[0].endswith("would unpack to 2147483647 bytes, more than 100 values need")
    assert faults_of(path)[1:] == [""] * 3


def test_what_would_not_fit_into_memory_is_refused(tmp_path, monkeypatch):
    path = written(tmp_path / "a.parquet")
    monkeypatch.setattr(parquet, "free_memory", lambda: 1000)
    with pytest.raises(LogError, match="3 columns of 400 rows would take"):
        read(path)


@pytest.mark.parametrize(
    "data", [b"\x15", b"\x19\xfc\xff\xff\xff\xff\x0f", b"\x1c" * 30, b"\x18\xff\xff\x7f", b"\x1e\x00"]
)
def test_bytes_that_are_no_structure(data):
    with pytest.raises(MalformedError):
        decode(data)
