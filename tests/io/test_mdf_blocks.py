"""Samples straight from the blocks of an MDF file: the same as through asammdf, to the bit, or left to it."""

from pathlib import Path

import asammdf
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import aqualog.io.mdf as reader
from aqualog.io import mdf_blocks
from aqualog.io.base import ReadOptions
from aqualog.io.mdf import MdfReader
from aqualog.io.mdf_blocks import raw_columns
from tests.io import mdf_bytes
from tests.io.mdf_bytes import FLOAT, FLOAT_BIG, SIGNED, SIGNED_BIG, UNSIGNED, UNSIGNED_BIG, Bits, Group, Layout

DTYPES = ("u1", "i1", "<u2", ">u2", "<i2", ">i2", "<u4", ">i4", "<u8", "<i8", ">u8", "<f4", ">f4", "<f8", ">f8")
CONVERSIONS = (None, {"a": 0.01, "b": -40.0}, {"a": 1.0, "b": 0.0}, {"formula": "X*2+1"})


def samples(dtype, n, rng):
    kind = np.dtype(dtype)
    if kind.kind == "f":
        return rng.standard_normal(n).cumsum().astype(kind)
    info = np.iinfo(kind)
    return rng.integers(info.min, info.max, n, dtype=kind.newbyteorder("="), endpoint=True).astype(kind)


def written(path, groups, *, compression, rng):
    """A file of groups: [(records, [(dtype, conversion)])]."""
    mdf = asammdf.MDF(version="4.10")
    for g, (n, channels) in enumerate(groups):
        t = np.arange(n) * 0.01 + g
        mdf.append(
            [
                asammdf.Signal(samples(d, n, rng), t, name=f"c{g}_{i}", conversion=c)
                for i, (d, c) in enumerate(channels)
            ],
            common_timebase=True,
        )
    mdf.save(path, compression=compression, overwrite=True)
    mdf.close()
    return path


def read(path):
    """All channels, and how many groups came straight from the blocks."""
    fast = []

    def counted(*args):
        found = raw_columns(*args)
        fast.append(found is not None)
        return found

    reader.raw_columns = counted
    try:
        with MdfReader(Path(path), ReadOptions()) as r:
            found = r.read(r.channels())
            return {c.info.path: (c.t_ns, c.values) for c in found}, r.faults, fast
    finally:
        reader.raw_columns = raw_columns


def plainly(path, monkeypatch):
    with monkeypatch.context() as m:
        m.setattr(reader, "raw_columns", lambda *_: None)
        with MdfReader(Path(path), ReadOptions()) as r:
            return {c.info.path: (c.t_ns, c.values) for c in r.read(r.channels())}, r.faults


def same(a, b):
    assert a.keys() == b.keys()
    for name, (t, values) in a.items():
        np.testing.assert_array_equal(t, b[name][0], err_msg=name)
        assert values.dtype == b[name][1].dtype
        np.testing.assert_array_equal(values, b[name][1], err_msg=name)


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_every_type_and_conversion(tmp_path, monkeypatch, compression):
    rng = np.random.default_rng(compression)
    channels = [(d, CONVERSIONS[k % 4]) for k, d in enumerate(DTYPES)]
    path = written(tmp_path / "a.mf4", [(5000, channels), (1, channels[:2])], compression=compression, rng=rng)
    found, faults, fast = read(path)
    expected, plain_faults = plainly(path, monkeypatch)
    same(found, expected)
    assert faults == plain_faults
    assert fast == [True, True]


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    groups=st.lists(
        st.tuples(
            st.integers(1, 300),
            st.lists(st.tuples(st.sampled_from(DTYPES), st.sampled_from(CONVERSIONS)), min_size=1, max_size=6),
        ),
        min_size=1, max_size=3,
    ),
    compression=st.integers(0, 2), seed=st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_any_layout(tmp_path, monkeypatch, groups, compression, seed):
    path = written(tmp_path / "a.mf4", groups, compression=compression, rng=np.random.default_rng(seed))
    found, _, fast = read(path)
    same(found, plainly(path, monkeypatch)[0])
    assert all(fast)


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_many_blocks(tmp_path, monkeypatch, compression):
    monkeypatch.setenv("POLARS_MAX_THREADS", "2")
    rng = np.random.default_rng(0)
    path = written(
        tmp_path / "a.mf4", [(400_000, [("<f8", None), ("<i2", {"a": 0.5, "b": 1.0}), ("<u4", None)])],
        compression=compression, rng=rng,
    )  # fmt: skip
    found, _, fast = read(path)
    same(found, plainly(path, monkeypatch)[0])
    assert fast == [True]


@st.composite
def bit_channels(draw, octets, invalidation):
    """A channel somewhere in so many bytes; those of others may overlap."""
    kind = draw(st.sampled_from((UNSIGNED, UNSIGNED, SIGNED, SIGNED, UNSIGNED_BIG, SIGNED_BIG, FLOAT, FLOAT_BIG)))
    shift = draw(st.integers(0, 7)) if kind in (UNSIGNED, SIGNED) else 0
    if kind in (UNSIGNED, SIGNED):
        bits = draw(st.one_of(st.integers(1, 64 - shift), st.sampled_from((8, 16, 32))))
    else:
        bits = draw(st.sampled_from((32, 64) if kind in (FLOAT, FLOAT_BIG) else (8, 16, 32, 64)))
    needed = (shift + bits + 7) // 8
    invalid = draw(st.one_of(st.none(), st.integers(0, 8 * invalidation - 1))) if invalidation else None
    return Bits(kind, draw(st.integers(0, octets - needed)), shift, bits, invalid)


@st.composite
def bit_groups(draw):
    octets, invalidation = draw(st.integers(9, 24)), draw(st.integers(0, 2))
    channels = tuple(draw(st.lists(bit_channels(octets, invalidation), min_size=1, max_size=5)))
    n = draw(st.integers(1, 120))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    records = rng.integers(0, 256, (n, 8 + octets + invalidation), dtype=np.uint8)
    records[:, :8] = (np.arange(n) * 0.01).view(np.uint8).reshape(n, 8)
    return Group(channels, records, invalidation)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    groups=st.lists(bit_groups(), min_size=1, max_size=2),
    cuts=st.lists(st.integers(1, 4000), max_size=5).map(tuple), by_record=st.booleans(),
    packing=st.lists(st.sampled_from((None, None, "deflate", "transpose")), min_size=1, max_size=3).map(tuple),
    is_listed=st.booleans(), has_header=st.booleans(), is_unsorted=st.booleans(), piece=st.sampled_from((1, 100, 1 << 20)),
)  # fmt: skip
def test_any_bits_in_any_blocks(
    tmp_path, monkeypatch, groups, cuts, by_record, packing, is_listed, has_header, is_unsorted, piece
):
    monkeypatch.setattr(mdf_blocks, "_PIECE", piece)
    if by_record and len(groups) == 1:
        cuts = tuple(c * groups[0].records.shape[1] for c in cuts)
    layout = Layout(cuts, packing, is_listed, has_header)
    path = mdf_bytes.written(tmp_path / "a.mf4", groups, layout, is_unsorted=is_unsorted)
    found, faults, fast = read(path)
    for g, group in enumerate(groups):
        for k in range(len(group.channels)):
            (values,) = [v for name, (_, v) in found.items() if name.endswith(f".c{g}_{k}")]
            np.testing.assert_array_equal(values, mdf_bytes.expected(group, k), err_msg=str(group.channels[k]))
    plain, plain_faults = plainly(path, monkeypatch)
    same(found, plain)
    assert faults == plain_faults
    if is_unsorted:
        assert not any(fast)
    elif not cuts or set(packing) == {None} or (by_record and len(groups) == 1):
        assert all(fast)


def test_channels_beside_texts_arrays_and_structures(tmp_path, monkeypatch):
    rng = np.random.default_rng(4)
    t = np.arange(300) * 0.01
    mdf = asammdf.MDF(version="4.10")
    mdf.append(
        [
            asammdf.Signal(np.array([f"text {i}" for i in range(300)], dtype="S"), t, name="text", encoding="utf-8"),
            asammdf.Signal(rng.standard_normal(300), t, name="number"),
            asammdf.Signal(np.rec.fromarrays([rng.integers(0, 9, (300, 3))], names=["a"]), t, name="a"),
            asammdf.Signal(rng.integers(0, 9, 300).astype("u1"), t, name="last"),
        ]
    )
    mdf.save(tmp_path / "a.mf4", compression=2, overwrite=True)
    mdf.close()
    found, _, fast = read(tmp_path / "a.mf4")
    same(found, plainly(tmp_path / "a.mf4", monkeypatch)[0])
    assert {"number", "last"} <= {name.rpartition(".")[2] for name in found}
    assert fast == [True]


def test_mdf_3_is_left_to_asammdf(tmp_path, monkeypatch):
    mdf = asammdf.MDF(version="3.30")
    mdf.append([asammdf.Signal(np.arange(100.0), np.arange(100) * 0.01, name="x")])
    mdf.save(tmp_path / "a.mdf", overwrite=True)
    mdf.close()
    found, _, fast = read(tmp_path / "a.mdf")
    same(found, plainly(tmp_path / "a.mdf", monkeypatch)[0])
    assert fast == []


def test_pieces_are_the_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(mdf_blocks, "_PIECE", 500)
    rng = np.random.default_rng(9)
    records = rng.integers(0, 256, (1000, 21), dtype=np.uint8)
    records[:, :8] = (np.arange(1000) * 0.01).view(np.uint8).reshape(1000, 8)
    group = Group((Bits(SIGNED, 3, 5, 23, 2), Bits(UNSIGNED_BIG, 8, 0, 32)), records, 1)
    path = mdf_bytes.written(
        tmp_path / "a.mf4", [group], Layout((4200, 4201, 6300, 12600), (None, None, None, "deflate"))
    )
    with MdfReader(path, ReadOptions()) as r:
        pieces = list(mdf_blocks.raw_pieces(path, r._inner, 0, [1, 2], 100))
        whole = raw_columns(path, r._inner, 0, [1, 2])
    assert len(pieces) > 5
    for i in (1, 2):
        np.testing.assert_array_equal(np.concatenate([p.samples[i] for p in pieces]), whole.samples[i])
    np.testing.assert_array_equal(np.concatenate([p.invalid[1] for p in pieces]), whole.invalid[1])
    assert list(whole.invalid) == [1]


@pytest.mark.parametrize("compression", [0, 1, 2])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_damaged_block_is_what_it_is_without_the_short_cut(tmp_path, monkeypatch, compression, share):
    rng = np.random.default_rng(5)
    path = written(tmp_path / "a.mf4", [(3000, [("<f8", None), ("<i2", None)])], compression=compression, rng=rng)
    octets = bytearray(path.read_bytes())
    at = int(share * len(octets))
    octets[at : at + 8] = b"\xff" * 8
    path.write_bytes(octets)

    def outcome(how):
        try:
            return how()
        except Exception as error:
            return type(error).__name__

    found, expected = outcome(lambda: read(path)[0]), outcome(lambda: plainly(path, monkeypatch)[0])
    if isinstance(expected, str):
        assert found == expected
    else:
        same(found, expected)


@pytest.mark.parametrize("cut", [0.5, 0.8, 0.97])
@pytest.mark.parametrize("compression", [0, 1])
def test_a_cut_file(tmp_path, monkeypatch, cut, compression):
    rng = np.random.default_rng(6)
    path = written(tmp_path / "a.mf4", [(30_000, [("<f8", None)])], compression=compression, rng=rng)
    octets = path.read_bytes()
    path.write_bytes(octets[: int(cut * len(octets))])

    def outcome(how):
        try:
            return how()
        except Exception as error:
            return str(error)

    found, expected = outcome(lambda: read(path)[0]), outcome(lambda: plainly(path, monkeypatch)[0])
    if isinstance(expected, str):
        assert found == expected
    else:
        same(found, expected)


@pytest.mark.parametrize("library", ["libdeflate", "zlib"])
@pytest.mark.parametrize("more", [-16, 16])
def test_a_block_that_inflates_to_another_size_than_it_tells_is_refused(tmp_path, monkeypatch, library, more):
    if library == "zlib":
        monkeypatch.setattr(mdf_blocks, "_libdeflate", None)
    rng = np.random.default_rng(7)
    path = written(tmp_path / "a.mf4", [(3000, [("<f8", None)])], compression=1, rng=rng)
    with MdfReader(path, ReadOptions()) as r:
        inner = r._inner
        (block,) = list(inner.groups[0].data_blocks)
        assert len(raw_columns(path, inner, 0, [1]).samples[1]) == 3000
        block.original_size += more
        inner.groups[0].channel_group.cycles_nr += more // 16
        with pytest.raises(Exception):  # noqa: B017, PT011 - each library has an error of its own
            raw_columns(path, inner, 0, [1])


def test_a_flipped_bit_is_found_by_either_library(tmp_path, monkeypatch):
    rng = np.random.default_rng(8)
    path = written(tmp_path / "a.mf4", [(3000, [("<f8", None)])], compression=1, rng=rng)
    with MdfReader(path, ReadOptions()) as r:
        (block,) = list(r._inner.groups[0].data_blocks)
        octets = bytearray(path.read_bytes())
        octets[block.address + block.compressed_size // 2] ^= 1
        (tmp_path / "b.mf4").write_bytes(octets)
        for library in (mdf_blocks._libdeflate, None):
            monkeypatch.setattr(mdf_blocks, "_libdeflate", library)
            with pytest.raises(Exception):  # noqa: B017, PT011 - each library has an error of its own
                raw_columns(tmp_path / "b.mf4", r._inner, 0, [1])


def mapped(path):
    """Memory of this process that shows a file. [kB]"""
    lines = Path("/proc/self/smaps").read_text().splitlines()
    at = [k for k, line in enumerate(lines) if line.endswith(str(path))]
    return sum(int(next(x for x in lines[k:] if x.startswith("Rss:")).split()[1]) for k in at), len(at)


@pytest.mark.skipif(not Path("/proc/self/smaps").exists(), reason="Linux tells what is mapped")
def test_looking_for_the_blocks_leaves_nothing_of_the_file_in_memory(tmp_path):
    path = written(tmp_path / "a.mf4", [(200_000, [("<f8", None)])], compression=0, rng=np.random.default_rng(0))
    with MdfReader(path, ReadOptions()) as r:
        kilobytes, maps = mapped(path)
        assert maps == 1
        assert kilobytes == 0
        assert len(r.read(r.channels())[0].values) == 200_000
