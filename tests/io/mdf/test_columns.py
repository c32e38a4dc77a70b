"""Samples straight from the blocks of an MDF file: those of the standard's words and of asammdf, to the bit."""

from dataclasses import replace
from pathlib import Path

import asammdf
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aqualog.core.records import FileFaults
from aqualog.io.mdf import columns
from aqualog.io.mdf.reader import MdfReader
from aqualog.io.reader import ReadOptions
from tests.io.mdf import mdf_bytes
from tests.io.mdf.mdf_bytes import FLOAT, FLOAT_BIG, SIGNED, SIGNED_BIG, UNSIGNED, UNSIGNED_BIG, Bits, Group, Layout

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
    """Times and values of all channels, and what was lost."""
    with MdfReader(Path(path), ReadOptions()) as r:
        return {c.info.path: (c.t_ns, c.values) for c in r.read(r.channels())}, r.faults


def by_asammdf(path):
    """The same through asammdf, scaled in double precision."""
    found = {}
    with asammdf.MDF(path) as log:
        for g, group in enumerate(log.groups):
            for i, channel in enumerate(group.channels):
                if i != log.masters_db.get(g) and not group.channel_dependencies[i]:
                    s = log.get(group=g, index=i, ignore_invalidation_bits=True, raw=True)
                    if s.samples.dtype.kind not in "uif":
                        continue
                    x = s.samples.astype(np.float64)
                    t_ns = np.round(s.timestamps.astype(np.float64) * 1e9).astype(np.int64)
                    found[f"group{g}.{channel.name}"] = t_ns, channel.conversion.convert(x) if channel.conversion else x
    return found


def same(a, b):
    assert a.keys() == b.keys()
    for name, (t, values) in a.items():
        np.testing.assert_array_equal(t - t[0], b[name][0] - b[name][0][0], err_msg=name)
        assert values.dtype == b[name][1].dtype
        np.testing.assert_array_equal(values, b[name][1], err_msg=name)


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_every_type_and_conversion(tmp_path, compression):
    rng = np.random.default_rng(compression)
    channels = [(d, CONVERSIONS[k % 4]) for k, d in enumerate(DTYPES)]
    path = written(tmp_path / "a.mf4", [(5000, channels), (1, channels[:2])], compression=compression, rng=rng)
    found, faults = read(path)
    same(found, by_asammdf(path))
    assert faults == FileFaults()


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
def test_any_layout(tmp_path, groups, compression, seed):
    path = written(tmp_path / "a.mf4", groups, compression=compression, rng=np.random.default_rng(seed))
    same(read(path)[0], by_asammdf(path))


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_many_blocks(tmp_path, monkeypatch, compression):
    monkeypatch.setenv("POLARS_MAX_THREADS", "2")
    rng = np.random.default_rng(0)
    path = written(
        tmp_path / "a.mf4", [(400_000, [("<f8", None), ("<i2", {"a": 0.5, "b": 1.0}), ("<u4", None)])],
        compression=compression, rng=rng,
    )  # fmt: skip
    same(read(path)[0], by_asammdf(path))


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
    monkeypatch.setattr(columns, "_PIECE", piece)
    if by_record and len(groups) == 1:
        cuts = tuple(c * groups[0].records.shape[1] for c in cuts)
    layout = Layout(cuts, packing, is_listed, has_header)
    path = mdf_bytes.written(tmp_path / "a.mf4", groups, layout, is_unsorted=is_unsorted)
    found, faults = read(path)
    for g, group in enumerate(groups):
        for k in range(len(group.channels)):
            (values,) = [v for name, (_, v) in found.items() if name.endswith(f".c{g}_{k}")]
            np.testing.assert_array_equal(values, mdf_bytes.expected(group, k), err_msg=str(group.channels[k]))
    assert faults == FileFaults()


def test_channels_beside_texts_arrays_and_structures(tmp_path):
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
    found, expected = read(tmp_path / "a.mf4")[0], by_asammdf(tmp_path / "a.mf4")
    same(
        {n: found[f"group0.{n}"] for n in ("number", "last")}, {n: expected[f"group0.{n}"] for n in ("number", "last")}
    )


def test_mdf_3_as_asammdf_reads_it(tmp_path):
    rng = np.random.default_rng(3)
    mdf = asammdf.MDF(version="3.30")
    t = np.arange(100) * 0.01
    names = [f"c{k}" for k in range(len(DTYPES))]
    mdf.append([asammdf.Signal(samples(d, 100, rng), t, name=n) for n, d in zip(names, DTYPES, strict=True)])
    mdf.save(tmp_path / "a.mdf", overwrite=True)
    mdf.close()
    same(read(tmp_path / "a.mdf")[0], by_asammdf(tmp_path / "a.mdf"))


def test_pieces_are_the_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(columns, "_PIECE", 500)
    rng = np.random.default_rng(9)
    records = rng.integers(0, 256, (1000, 21), dtype=np.uint8)
    records[:, :8] = (np.arange(1000) * 0.01).view(np.uint8).reshape(1000, 8)
    group = Group((Bits(SIGNED, 3, 5, 23, 2), Bits(UNSIGNED_BIG, 8, 0, 32)), records, 1)
    path = mdf_bytes.written(
        tmp_path / "a.mf4", [group], Layout((4200, 4201, 6300, 12600), (None, None, None, "deflate"))
    )
    with MdfReader(path, ReadOptions()) as r:
        pieces = list(columns.raw_pieces(path, r._groups[0], [1, 2], 100, {1}))
        (whole,) = columns.raw_pieces(path, r._groups[0], [1, 2], 1 << 62)
    assert len(pieces) > 5
    assert {p.samples[1].dtype for p in pieces} == {np.dtype(np.float64)}
    for i in (1, 2):
        np.testing.assert_array_equal(np.concatenate([p.samples[i] for p in pieces]), whole.samples[i])
    np.testing.assert_array_equal(np.concatenate([p.invalid[1] for p in pieces]), whole.invalid[1])
    assert list(whole.invalid) == [1]


def test_a_channel_is_scaled_once_however_often_it_is_asked_for(tmp_path):
    path = written(tmp_path / "a.mf4", [(50, [("<f8", CONVERSIONS[1])])], compression=0, rng=np.random.default_rng(1))
    with MdfReader(path, ReadOptions()) as r:
        once, twice = (r.read([*r.channels()] * k) for k in (1, 2))
    assert [c.values.tolist() for c in twice] == [c.values.tolist() for c in once] * 2


@pytest.mark.parametrize("library", ["libdeflate", "zlib"])
@pytest.mark.parametrize("more", [-16, 16])
def test_a_block_that_inflates_to_another_size_than_it_tells_is_refused(tmp_path, monkeypatch, library, more):
    if library == "zlib":
        monkeypatch.setattr(columns, "_libdeflate", None)
    rng = np.random.default_rng(7)
    path = written(tmp_path / "a.mf4", [(3000, [("<f8", None)])], compression=1, rng=rng)
    with MdfReader(path, ReadOptions()) as r:
        (group,) = r._groups
        (block,) = group.data
        assert len(next(columns.raw_pieces(path, group, [1], 1 << 62)).samples[1]) == 3000
        lying = replace(group, cycles=group.cycles + more // 16, data=(replace(block, unpacked=block.unpacked + more),))
        with pytest.raises(Exception):  # noqa: B017, PT011 - each library has an error of its own
            next(columns.raw_pieces(path, lying, [1], 1 << 62))


def test_a_flipped_bit_is_found_by_either_library(tmp_path, monkeypatch):
    rng = np.random.default_rng(8)
    path = written(tmp_path / "a.mf4", [(3000, [("<f8", None)])], compression=1, rng=rng)
    with MdfReader(path, ReadOptions()) as r:
        (block,) = r._groups[0].data
        octets = bytearray(path.read_bytes())
        octets[block.address + block.size // 2] ^= 1
        (tmp_path / "b.mf4").write_bytes(octets)
        for library in (columns._libdeflate, None):
            monkeypatch.setattr(columns, "_libdeflate", library)
            with pytest.raises(Exception):  # noqa: B017, PT011 - each library has an error of its own
                next(columns.raw_pieces(tmp_path / "b.mf4", r._groups[0], [1], 1 << 62))


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
        assert maps == kilobytes == 0
        assert len(r.read(r.channels())[0].values) == 200_000
