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


def test_bits_that_are_no_bytes_and_invalidation_bits_are_left_to_asammdf(tmp_path, monkeypatch):
    t = np.arange(100) * 0.01
    mdf = asammdf.MDF(version="4.10")
    mdf.append([asammdf.Signal((np.arange(100) % 8).astype("u1"), t, name="three_bits", bit_count=3)])
    mdf.append(
        [asammdf.Signal(np.arange(100.0), t, name="gaps", invalidation_bits=np.arange(100) % 7 == 0)]
    )  # fmt: skip
    mdf.save(tmp_path / "a.mf4", overwrite=True)
    mdf.close()
    found, _, fast = read(tmp_path / "a.mf4")
    same(found, plainly(tmp_path / "a.mf4", monkeypatch)[0])
    assert fast == [False, False]
    assert np.isnan(found[next(n for n in found if n.endswith("gaps"))][1]).sum() == 15


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
        assert len(raw_columns(path, inner, 0, [1])[1]) == 3000
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
