"""MDF that is cut, unfinished, damaged or made to do harm: what is there is read, the rest is told, nothing else happens."""

import shutil
import struct
import sys
import tempfile
import time
import zlib
from pathlib import Path

import asammdf
import charset_normalizer
import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.cli.main import app
from aqualog.core.errors import LogError
from aqualog.io.mdf import columns, groups, reader, walk4
from aqualog.io.mdf.reader import MdfReader
from aqualog.io.reader import ReadOptions
from tests.can_log import CanFrames, write_frames_mf4
from tests.mdf_by_hand import Blocks, describe, records, streamed, unsorted

K = np.arange(200)
X = (np.sin(K) + K) * 2 + 1
RECORD = 24


def read(path):
    with MdfReader(path, ReadOptions()) as r:
        return {c.info.path: c.values for c in r.read(r.channels())}, r.faults


def read_bytes(folder, data):
    (folder / "a.mf4").write_bytes(data)
    return read(folder / "a.mf4")


def refused(folder, data) -> str:
    with pytest.raises(LogError) as caught:
        read_bytes(folder, data)
    return caught.value.line()


def numbers_at(data, at, layout, *values):
    out = bytearray(data)
    struct.pack_into(layout, out, at, *values)
    return bytes(out)


def find(data, mark, which=0):
    """Address of the block number `which` of a kind."""
    found = [i for i in range(0, len(data), 8) if data[i : i + 4] == b"##" + mark]
    return found[which]


@pytest.mark.parametrize("flags", [1, 4, 1 | 4, 1 | 4 | 32])
@pytest.mark.parametrize("make", [streamed, unsorted])
def test_an_unfinished_file_is_read_without_a_copy_of_it(tmp_path, monkeypatch, make, flags):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    for copy in ("copy", "copyfile", "copy2"):
        monkeypatch.setattr(shutil, copy, None)
    data = make(unfinished=flags)
    found, faults = read_bytes(tmp_path, data)
    expected, _ = read_bytes(tmp_path, make())
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)
    assert "was not finalised" in faults.notes[0]
    assert not faults.truncated
    assert not list(scratch.iterdir())
    assert (tmp_path / "a.mf4").read_bytes() == make()


@pytest.mark.parametrize(
    ("tail", "left", "lost"),
    [(b"", 200, 0), (bytes(240), 200, 0), (bytes(10), 200, 0), (b"\1" * 7, 200, 1), (b"\1" * 12 + bytes(252), 200, 1)],
)
def test_what_an_unfinished_file_ends_in(tmp_path, tail, left, lost):
    """Room that the logger has reserved is no record, and a record that was begun is none yet."""
    found, faults = read_bytes(tmp_path, streamed(unfinished=5) + tail)
    np.testing.assert_array_equal(found["group0.x"], X[:left])
    assert faults.lost_samples == lost
    assert ("the last record of the group at byte" in " ".join(faults.notes)) == bool(lost)


@pytest.mark.parametrize(
    ("damaged", "left", "lost", "note"),
    [
        (lambda b: b + bytes(300), (100, 50), 0, ""),
        (lambda b: b[:-7], (100, 49), 1, "the last record is incomplete"),
        (
            lambda b: b[:-1000] + bytes(500) + b[-500:],
            (74, 36),
            40,
            "993 of 3750 bytes of records, about 40 records, are",
        ),
    ],
)
def test_records_of_several_kinds_that_an_unfinished_file_loses_are_told(tmp_path, damaged, left, lost, note):
    """asammdf sorts them up to one of no known kind, and drops the rest without a word."""
    found, faults = read_bytes(tmp_path, damaged(unsorted(unfinished=5)))
    assert (len(found["group0.x"]), len(found["group1.x"])) == left
    assert faults.lost_samples == lost
    assert note in " ".join(faults.notes)


def test_an_unfinished_list_of_blocks_is_completed(tmp_path):
    """Blocks that lie behind the list and are not in it yet."""
    b = Blocks(unfinished=1 | 16)
    b.header()
    describe(b, "a", 0)
    b.group("dg0", None, "acg", "dl")
    b.listed("dl", ["dz0"], size=50 * RECORD, slots=6)
    for k in range(4):
        b.deflated(f"dz{k}", records(50, 50 * k))
    found, faults = read_bytes(tmp_path, b.bytes())
    np.testing.assert_array_equal(found["group0.x"], X)
    assert not faults.truncated


def test_unknown_places_of_values_are_no_guess(tmp_path):
    assert "places of values of variable length are not known" in refused(tmp_path, streamed(unfinished=1 | 64))


def test_the_temporary_folder_is_private_and_goes_with_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    modes = []

    def failing(_path, _groups, into):
        modes.append(Path(into.name).parent.stat().st_mode & 0o777)
        raise KeyError("block")

    with monkeypatch.context() as m:
        m.setattr(groups, "sorted_groups", failing)
        assert "cannot be read as MDF" in refused(tmp_path, unsorted(unfinished=5))
    assert modes == [0o700]
    assert [p.name for p in tmp_path.iterdir()] == ["a.mf4"]
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10, 10, 100))
    assert "no space to sort them; expected 3.75 kB" in refused(tmp_path, unsorted())
    assert read_bytes(tmp_path, streamed())  # needs none
    assert [p.name for p in tmp_path.iterdir()] == ["a.mf4"]


@pytest.mark.parametrize("cut", [1, 23, 24, 100, 2400, 4799])
def test_what_precedes_a_cut_is_kept_where_descriptions_come_first(tmp_path, cut):
    found, faults = read_bytes(tmp_path, streamed()[:-cut])
    left = 200 - -(-cut // RECORD)
    np.testing.assert_array_equal(found.get("group0.x", np.zeros(0)), X[:left])
    assert faults.truncated
    assert faults.lost_samples == 200 - left
    at = find(streamed(), b"DT")
    assert f"its DT block at byte {at} is incomplete" in faults.notes[0]


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_deflated_blocks_before_a_cut_are_kept(tmp_path, lost):
    data = streamed(compressed=True)
    found, faults = read_bytes(tmp_path, data[: find(data, b"DZ", 4 - lost) + 60])
    np.testing.assert_array_equal(found["group0.x"], X[: 200 - 50 * lost])
    assert faults.truncated
    assert faults.lost_samples == 50 * lost
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        assert r.faults.truncated  # also where nothing is read
    assert "DZ block" in faults.notes[0]


@pytest.mark.parametrize("pieces", [False, True])
@pytest.mark.parametrize("which", [0, 1, 2, 3])
def test_what_precedes_a_damaged_block_is_kept(tmp_path, monkeypatch, which, pieces):
    data = bytearray(streamed(compressed=True))
    at = find(data, b"DZ", which)
    data[at + 48 + 100] ^= 4
    if which == 0:  # nothing is left
        assert "a compressed block is damaged" in refused(tmp_path, bytes(data))
        return
    (tmp_path / "a.mf4").write_bytes(data)
    if not pieces:
        found, faults = read(tmp_path / "a.mf4")
        x = found["group0.x"]
    else:
        monkeypatch.setattr(reader, "_PIECE", 25)
        with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
            (part,) = r.parts([c for c in r.channels() if c.path == "group0.x"])
            x = np.concatenate([c.values for piece in part.pieces for c in piece])
            faults = r.faults
    np.testing.assert_array_equal(x, X[: 50 * which])
    assert faults.truncated
    assert faults.lost_samples == 200 - 50 * which
    assert f"its DZ block at byte {at} is damaged" in " ".join(faults.notes)


def test_frames_that_precede_a_damaged_block_are_kept(tmp_path):
    """Their ids are read when the file is opened."""
    n = 200_000
    frames = CanFrames(
        np.arange(1, n + 1) * 10**6, np.arange(n) % 3 + 256, np.zeros(n, bool), [b"12345678"] * n, np.ones(n)
    )
    write_frames_mf4(tmp_path / "f.mf4", frames, 1_700_000_000 * 10**9, "")
    data = bytearray((tmp_path / "f.mf4").read_bytes())
    blocks = [i for i in range(len(data) - 4) if data[i : i + 4] == b"##DZ"]
    assert len(blocks) > 2
    data[blocks[1] + 48 + 20] ^= 1
    (tmp_path / "f.mf4").write_bytes(data)
    (tmp_path / "a.dbc").write_bytes(b'VERSION ""\n\nBU_: E\n\nBO_ 256 M: 8 E\n SG_ S : 0|8@1+ (1,0) [0|0] "" E\n')
    with MdfReader(tmp_path / "f.mf4", ReadOptions(dbc=(tmp_path / "a.dbc",))) as r:
        (channel,) = r.read(r.channels())
        left = n - r.faults.lost_samples
        assert 0 < left < n
        assert channel.t_ns.size == -(-left // 3)
        assert set(channel.values) == {ord("1")}
        assert "is cut" in " ".join(r.faults.notes)


def test_a_cut_through_records_of_several_kinds(tmp_path):
    found, faults = read_bytes(tmp_path, unsorted()[:-1000])
    whole, _ = read_bytes(tmp_path, unsorted())
    assert faults.truncated
    for name, values in found.items():
        assert 0 < len(values) < len(whole[name])
        np.testing.assert_array_equal(values, whole[name][: len(values)])


def test_a_cut_file_is_read_with_exit_code_3(tmp_path):
    (tmp_path / "a.mf4").write_bytes(streamed()[:-1000])
    result = CliRunner().invoke(app, ["inspect", str(tmp_path / "a.mf4"), "--json"])
    assert result.exit_code == 3
    assert "its DT block at byte" in result.stdout
    (tmp_path / "a.mf4").write_bytes(streamed())
    assert CliRunner().invoke(app, ["inspect", str(tmp_path / "a.mf4"), "--json"]).exit_code == 0


def saved(path, groups, version="4.10", compression=0):
    mdf = asammdf.MDF(version=version)
    for k in range(groups):
        mdf.append([asammdf.Signal(X + k, K * 0.01, name=f"x{k}")], common_timebase=True)
    mdf.save(path.with_suffix(".mdf" if version < "4" else ".mf4"), compression=compression, overwrite=True)
    mdf.close()
    return path.with_suffix(".mdf" if version < "4" else ".mf4").read_bytes()


@pytest.mark.parametrize("cut", [1, 16, 1000])
def test_a_cut_through_the_records_of_mdf_3(tmp_path, cut):
    data = bytearray(saved(tmp_path / "w", 1, "3.30"))
    group = struct.unpack_from("<I", data, 68)[0]
    begin = struct.unpack_from("<I", data, group + 16)[0]
    struct.pack_into("<I", data, group + 16, len(data))
    data += data[begin : begin + 200 * 16]
    (tmp_path / "a.mf4").write_bytes(data[:-cut])
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        assert r.faults.truncated
        assert f"the file ends at byte {len(data) - cut}" in r.faults.notes[0]
        (x,) = r.read(r.channels())
        left = 200 - -(-cut // 16)
        np.testing.assert_array_equal(x.values, X[:left])
        assert r.faults.lost_samples == 200 - left


@pytest.mark.parametrize("declared", [201, 300, 2**28])
def test_records_of_mdf_3_end_where_the_next_block_begins(tmp_path, declared):
    """Blocks behind them would be read as numbers."""
    data = saved(tmp_path / "w", 2, "3.30")
    group = struct.unpack_from("<I", data, struct.unpack_from("<I", data, 68)[0] + 8)[0]
    found, faults = read_bytes(tmp_path, numbers_at(data, group + 22, "<I", declared))
    for k in range(2):
        np.testing.assert_array_equal(found[f"group{k}.x{k}"], X + k)
    assert faults.lost_samples == declared - 200
    assert "another block begins at byte" in faults.notes[0]


@pytest.mark.parametrize("version", ["4.10", "3.30"])
@pytest.mark.parametrize(("groups", "cut", "left"), [(1, 3, 1), (2, 3, 2), (3, 150, 2), (3, 700, 1)])
def test_a_cut_where_descriptions_come_last(tmp_path, version, groups, cut, left):
    """All groups whose description is left; of the last one a part of it may be enough."""
    found, faults = read_bytes(tmp_path, saved(tmp_path / "w", groups, version)[:-cut])
    assert list(found) == [f"group{k}.x{k}" for k in range(left)]
    for k in range(left):
        np.testing.assert_array_equal(found[f"group{k}.x{k}"], X + k)
    assert faults.truncated
    assert "CG block at byte" in faults.notes[0]


def test_records_that_are_told_from_channels_must_have_a_time_that_goes_up(tmp_path):
    """A record that is longer than its channels: 192 records of 17 bytes are 204 of 16."""
    b = Blocks()
    rows = np.zeros(192, dtype=[("t", "<f8"), ("x", "<f8"), ("more", "u1")])
    rows["t"], rows["x"], rows["more"] = np.arange(192) * 0.01, np.arange(192), 3
    b.header()
    b.add("data", "DT", [], rows.tobytes())
    b.group("dg0", None, "cg", "data")
    b.text("t_name", "t")
    b.text("x_name", "x")
    b.channel("t", "x", 0, text="t_name", kind=2, sync=1)
    b.channel("x", None, 8, text="x_name")
    b.channel_group("cg", "t", 192, 17)
    found, _ = read_bytes(tmp_path, b.bytes())
    np.testing.assert_array_equal(found["group0.x"], np.arange(192))
    found, faults = read_bytes(tmp_path, b.bytes()[:-30])
    assert not found
    assert faults.truncated
    assert "time does not go up" in " ".join(faults.notes)


@pytest.mark.parametrize(("mark", "at"), [(b"HD", 70), (b"DG", None), (b"CG", None)])
def test_where_nothing_is_left_the_missing_block_is_named(tmp_path, mark, at):
    data = saved(tmp_path / "w", 1)
    begin = find(data, mark)
    line = refused(tmp_path, data[: at or begin + 20])
    assert "file is cut" in line
    assert f"{mark.decode()} block at byte {begin}" in line
    assert f"the file ends at byte {at or begin + 20}" in line
    assert "Try" in line


KINDS = {"DG": 24, "CG": 24, "CN": 24, "DL": 24}


@pytest.mark.parametrize("kind", KINDS)
def test_a_link_to_itself_ends(tmp_path, kind):
    """asammdf would follow it for ever."""
    data = streamed(compressed=True)
    at = find(data, kind.encode())
    begin = time.monotonic()
    found, faults = read_bytes(tmp_path, numbers_at(data, at + 24, "<Q", at))
    assert time.monotonic() - begin < 5
    why = "is a second kind of records, which have no ids" if kind == "CG" else "is linked twice"
    assert f"{kind} block at byte {at} {why}" in " ".join(faults.notes)
    assert faults.truncated
    if kind != "CN":  # its first channel is the time
        np.testing.assert_array_equal(found["group0.x"], X)


def test_parts_that_are_linked_twice_each_are_not_followed_without_end(tmp_path):
    """Forty channels, each with the next one as its part and behind it: 2^40 of them."""
    b = Blocks()
    b.header()
    b.group("dg0", None, "cg", "data")
    b.text("name", "n")
    for k in range(40):
        following = f"c{k + 1}" if k < 39 else None
        b.channel(f"c{k}", following, 0, text="name", part=following)
    b.channel_group("cg", "c0", 10, 8)
    b.add("data", "DT", [], bytes(80))
    begin = time.monotonic()
    _, faults = read_bytes(tmp_path, b.bytes())
    assert time.monotonic() - begin < 5
    assert "is linked twice" in " ".join(faults.notes)


def conversions(depth, width):
    """Channel x with tables of tables."""
    b = Blocks()
    b.header()
    b.group("dg0", None, "cg", "data")
    b.text("t", "t")
    b.text("x", "x")
    b.channel("ct", "cx", 0, text="t", kind=2, sync=1)
    b.channel("cx", None, 8, text="x", conversion="cc0")
    b.channel_group("cg", "ct", 200, RECORD)
    for k in range(depth):
        last = k == depth - 1
        b.conversion(
            f"cc{k}", 1 if last else 7, () if last else [f"cc{k + 1}"] * width, (0.0, 2.0)[: 2 if last else width - 1]
        )
    b.add("data", "DT", [], records(200))
    return b.bytes()


def test_conversions_in_conversions_have_an_end(tmp_path):
    assert list(read_bytes(tmp_path, conversions(3, 3))[0]) == ["group0.x"]
    found, faults = read_bytes(tmp_path, conversions(14, 3))  # 3^13 of them
    assert not found
    assert "without end" in " ".join(faults.notes)
    data = conversions(2, 3)
    at = find(data, b"CC")
    found, faults = read_bytes(tmp_path, numbers_at(data, at + 24 + 32, "<Q", at))
    assert not found
    assert "its conversion cannot be read" in " ".join(faults.notes)


def test_ranges_that_cannot_be_sorted_cost_their_channel(tmp_path):
    b = Blocks()
    b.header()
    describe(b, "a", 200)
    b.conversion("in", 1, numbers=(1.0, 2.0))
    b.conversion("acc", 8, ["in", "in", "in"], [0.0, 9.0, 0.0, 9.0])
    b.group("dg0", None, "acg", "data")
    b.add("data", "DT", [], records(200))
    found, faults = read_bytes(tmp_path, b.bytes())
    assert list(found) == ["group0.y"]
    assert "has a range twice" in " ".join(faults.notes)


@pytest.mark.parametrize(
    ("data_type", "bit", "bits"),
    [(4, 0, 2**32 - 1), (4, 255, 64), (4, 0, 24), (4, 0, 0), (15, 0, 8), (0, 7, 64), (0, 255, 16), (2, 0, 0)],
)
def test_a_number_of_no_layout_costs_its_channel(tmp_path, data_type, bit, bits):
    """asammdf gave up the whole file for it, or read 24 bits as they came."""
    data = streamed()
    at = find(data, b"CN", 1) + 24 + 64
    found, faults = read_bytes(tmp_path, numbers_at(data, at + 2, "<BBII", data_type, bit, 8, bits))
    assert list(found) == ["group0.y"]
    assert found["group0.y"].tolist() == (np.arange(200) % 251).tolist()
    assert f"group0.x is left out: it is damaged, values of type {data_type} with {bits} bits" in " ".join(faults.notes)
    assert faults.lost_samples == 200


@pytest.mark.parametrize(("bit", "kept"), [(0, True), (3, True), (8, False), (2**29, False)])
def test_an_invalidation_bit_outside_of_the_record_costs_its_channel(tmp_path, bit, kept):
    """asammdf takes it from whatever lies in memory: other samples are missing with each reading."""
    mdf = asammdf.MDF(version="4.10")
    mdf.append([asammdf.Signal(X, K * 0.01, name="x", invalidation_bits=K % 9 == 0)], common_timebase=True)
    mdf.save(tmp_path / "b.mf4", overwrite=True)
    mdf.close()
    data = (tmp_path / "b.mf4").read_bytes()
    at = next(a for k in range(2) if data[(a := find(data, b"CN", k)) + 24 + 64 + 12] & 2)
    found, faults = read_bytes(tmp_path, numbers_at(data, at + 24 + 64 + 16, "<I", bit))
    assert list(found) == (["group0.x"] if kept else [])
    assert faults.lost_samples == (0 if kept else 200)
    if not kept:
        assert f"its invalidation bit {bit} is not among the 8 of its records" in faults.notes[0]


def test_an_invalidation_bit_where_records_have_none_is_told(tmp_path):
    data = streamed()
    found, faults = read_bytes(tmp_path, numbers_at(data, find(data, b"CN", 1) + 24 + 64 + 12, "<I", 2))
    np.testing.assert_array_equal(found["group0.x"], X)
    assert "declares an invalidation bit, and its records have none" in faults.notes[0]


def test_frames_that_were_never_written_are_counted_and_are_no_frames(tmp_path):
    n = 60
    frames = CanFrames(
        np.arange(1, n + 1) * 10**7, [256 + k % 3 for k in range(n)], [False] * n, [bytes([k] * 8) for k in range(n)],
        [1] * n,
    )  # fmt: skip
    write_frames_mf4(tmp_path / "packed.mf4", frames, 1_700_000_000 * 10**9, "")
    with asammdf.MDF(tmp_path / "packed.mf4") as packed:
        packed.save(tmp_path / "f.mf4", compression=0)
    (tmp_path / "a.dbc").write_bytes(
        b'VERSION ""\n\nBU_: E\n\nBO_ 256 M: 8 E\n SG_ S : 0|8@1+ (1,0) [0|0] "m/s" E\n\nBO_ 0 Z: 8 E\n SG_ T : 0|8@1+ (1,0) [0|0] "" E\n'
    )
    options = ReadOptions(dbc=(tmp_path / "a.dbc",))
    with MdfReader(tmp_path / "f.mf4", options) as r:
        sound = r.read(r.channels())[0]
        (group,) = r._groups
        size = group.size
    data = bytearray((tmp_path / "f.mf4").read_bytes())
    at = find(data, b"DT") + 24
    data[at + 20 * size : at + 35 * size] = bytes(15 * size)
    (tmp_path / "g.mf4").write_bytes(data)
    with MdfReader(tmp_path / "g.mf4", options) as r:
        assert [c.path for c in r.channels()] == ["M.S"]
        (left,) = r.read(r.channels())
        assert r.faults.lost_samples == 15
        assert "15 records are empty (zeros in place of a frame)" in " ".join(r.faults.notes)
    whole = [k for k in range(n) if k % 3 == 0]
    np.testing.assert_array_equal(sound.values, whole)
    np.testing.assert_array_equal(left.values, [k for k in whole if not 20 <= k < 35])


def test_frames_of_which_none_has_a_time_are_no_samples(tmp_path):
    frames = CanFrames(np.arange(1, 5) * 10**7, [256] * 4, [False] * 4, [bytes(8)] * 4, [1] * 4)
    write_frames_mf4(tmp_path / "packed.mf4", frames, 1_700_000_000 * 10**9, "")
    with asammdf.MDF(tmp_path / "packed.mf4") as packed:
        size = int(packed.groups[0].channel_group.samples_byte_nr)
        at = int(packed.groups[0].channels[packed.masters_db[0]].byte_offset)
        packed.save(tmp_path / "f.mf4", compression=0)
    data = (tmp_path / "f.mf4").read_bytes()
    begin = find(data, b"DT") + 24 + at
    for k in range(4):
        data = numbers_at(data, begin + k * size, "<d", np.nan)
    (tmp_path / "f.mf4").write_bytes(data)
    (tmp_path / "a.dbc").write_bytes(b'VERSION ""\n\nBU_: E\n\nBO_ 256 M: 8 E\n SG_ S : 0|8@1+ (1,0) [0|0] "" E\n')
    with MdfReader(tmp_path / "f.mf4", ReadOptions(dbc=(tmp_path / "a.dbc",))) as r:
        (channel,) = r.read(r.channels())
        assert channel.t_ns.size == channel.values.size == 0
        assert r.faults.lost_samples == 4


def test_a_data_block_listed_again_and_again_is_read_once(tmp_path):
    b = Blocks()
    b.header()
    describe(b, "a", 50 * 1000)
    b.group("dg0", None, "acg", "dl")
    b.listed("dl", ["dz"] * 1000, size=24 * 50)
    b.deflated("dz", records(50))
    found, faults = read_bytes(tmp_path, b.bytes())
    assert len(found["group0.y"]) == 50
    assert "is linked twice" in " ".join(faults.notes)


@pytest.mark.parametrize("damage", ["no block", "behind the end", "size", "type"])
def test_a_conversion_that_cannot_be_read_leaves_no_raw_numbers(tmp_path, damage):
    """asammdf gives the raw samples without a word."""
    data = streamed()
    at, cn = find(data, b"CC"), find(data, b"CN", 1)
    data = {
        "no block": lambda: numbers_at(data, at, "<4s", b"##XX"),
        "behind the end": lambda: numbers_at(data, cn + 24 + 32, "<Q", 10**9),
        "size": lambda: numbers_at(data, at + 24 + 32 + 6, "<H", 1),
        "type": lambda: numbers_at(data, at + 24 + 32, "<B", 77),
    }[damage]()
    found, faults = read_bytes(tmp_path, data)
    assert list(found) == ["group0.y"]
    assert "channel group0.x is left out: its conversion cannot be read" in " ".join(faults.notes)


def test_a_time_without_its_conversion_is_no_time(tmp_path):
    data = streamed()
    clock = find(data, b"CN", 0)
    found, faults = read_bytes(tmp_path, numbers_at(data, clock + 24 + 32, "<Q", 9))
    assert not found
    assert "its time channel cannot be read" in " ".join(faults.notes)


def deflated(raw, *, size=None, invalidation=0, kind=0):
    b = Blocks()
    b.header()
    describe(b, "a", 200, size=RECORD - invalidation)
    b.group("dg0", None, "acg", "dz")
    b.deflated("dz", raw, size=size, kind=kind, width=RECORD)
    data = b.bytes()
    return numbers_at(data, find(data, b"CG") + 24 + 48 + 28, "<I", invalidation)


@pytest.mark.parametrize("size", [2**40, walk4.LARGEST_BLOCK + 1])
def test_a_block_of_no_sensible_size_is_refused_before_it_is_inflated(tmp_path, monkeypatch, size):
    monkeypatch.setattr(columns, "_inflated", None)
    line = refused(tmp_path, deflated(records(200), size=size))
    assert "a data block of it declares" in line
    assert ("1.1e+03 GB" if size == 2**40 else "268 MB") in line
    assert "Try" in line


@pytest.mark.parametrize("library", ["libdeflate", "zlib"])
@pytest.mark.parametrize("invalidation", [0, 1])
@pytest.mark.parametrize("kind", [0, 1])
def test_inflating_ends_at_the_size_that_is_told(tmp_path, monkeypatch, library, invalidation, kind):
    """8 MB in a block that tells of 4800 bytes, by the short cut and through asammdf."""
    if library == "zlib":
        monkeypatch.setattr(columns, "_libdeflate", None)
    taken = []
    original = columns._inflated

    def watched(data, size):
        out = original(data, size)
        taken.append(len(out))
        return out

    monkeypatch.setattr(columns, "_inflated", watched)
    monkeypatch.setattr(zlib, "decompress", None)
    line = refused(tmp_path, deflated(bytes(1 << 23), size=200 * RECORD, invalidation=invalidation, kind=kind))
    assert "cannot be decoded" in line
    assert max(taken, default=0) <= 200 * RECORD


def test_a_constant_channel_is_no_bomb(tmp_path):
    """850 to 1 and more is honest."""
    n = 20_000
    rows = np.zeros(n, dtype="V24")
    b = Blocks()
    b.header()
    describe(b, "a", n)
    b.group("dg0", None, "acg", "dz")
    b.deflated("dz", rows.tobytes())
    data = b.bytes()
    assert n * RECORD > 100 * len(data)
    found, faults = read_bytes(tmp_path, data)
    assert len(found["group0.x"]) == n
    assert not faults.truncated


def test_what_does_not_fit_into_memory_is_refused_by_its_size(tmp_path, monkeypatch):
    (tmp_path / "a.mf4").write_bytes(streamed())
    monkeypatch.setattr(groups, "free_memory", lambda: 10_000)
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        with pytest.raises(LogError, match=r"have 200 samples each and would take 14.4 kB; expected at most 10 kB"):
            r.read(r.channels())
        assert len(r.read(r.channels()[:1])) == 1
        pieces = [c for part in r.parts(r.channels()) for piece in part.pieces for c in piece]
    np.testing.assert_array_equal(pieces[0].values, X)


def test_records_that_are_told_of_and_not_there_take_nothing(tmp_path):
    data = streamed()
    at = find(data, b"CG") + 24 + 48
    found, faults = read_bytes(tmp_path, numbers_at(data, at + 8, "<Q", 2**62))
    np.testing.assert_array_equal(found["group0.x"], X)
    assert faults.truncated
    assert "declares 4.6e+18 records" in faults.notes[0]
    found, faults = read_bytes(tmp_path, numbers_at(data, at + 24, "<I", 1 << 29))
    assert not found
    assert faults.lost_samples == 200


def test_groups_that_asammdf_decodes_are_read_in_pieces_too(tmp_path):
    (tmp_path / "a.mf4").write_bytes(unsorted())
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        whole = {c.info.path: c.values for c in r.read(r.channels())}
        for part in r.parts(r.channels()):
            for channels in zip(*part.pieces, strict=True):
                values = np.concatenate([c.values for c in channels])
                np.testing.assert_array_equal(values, whole[channels[0].info.path])


LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9))
    + "]><CNcomment><TX>&j;</TX></CNcomment>"
)


def commented(text, kind="MD", *, of="cx"):
    b = Blocks()
    b.header(comment="comment" if of == "hd" else None)
    b.text("comment", text, kind)
    b.group("dg0", None, "cg", "data")
    b.text("t", "t")
    b.text("x", "x")
    b.channel("ct", "cx", 0, text="t", kind=2, sync=1)
    b.channel("cx", None, 8, text="comment" if of == "name" else "x", comment="comment" if of == "cx" else None)
    b.channel_group("cg", "ct", 200, RECORD)
    b.add("data", "DT", [], records(200))
    return b.bytes()


@pytest.mark.parametrize("of", ["cx", "hd"])
@pytest.mark.parametrize("text", [LAUGHS, "<CNcomment><TX>" * 20_000, "<HDcomment><TX>a</HDcomment>", "<" * 3_000_000, b"\xff\xfe<\0a\0>\0"])  # fmt: skip
def test_comments_that_are_no_comments(tmp_path, capfd, of, text):
    begin = time.monotonic()
    (tmp_path / "a.mf4").write_bytes(commented(text, of=of))
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        (x,) = r.channels()
        assert "haha" not in x.comment
        assert len(x.comment) <= 120
    assert time.monotonic() - begin < 5
    assert capfd.readouterr() == ("", "")


def test_a_comment_as_long_as_a_book_is_left_out(tmp_path):
    found, faults = read_bytes(tmp_path, commented("a" * ((1 << 24) + 10)))
    assert list(found) == ["group0.x"]
    assert "the comment of the channel" in faults.notes[0]
    assert "has 16.8 MB of text" in faults.notes[0]


def test_one_long_comment_of_very_many_channels_is_not_read_that_often(tmp_path):
    b = Blocks()
    b.header()
    b.text("comment", "a" * (1 << 20))
    b.group("dg0", None, "cg", None)
    for k in range(300):
        b.channel(f"c{k}", f"c{k + 1}" if k < 299 else None, 0, text="comment")
    b.channel_group("cg", "c0", 0, 8)
    assert "names and comments take more than 268 MB" in refused(tmp_path, b.bytes())


@pytest.mark.parametrize(
    ("text", "name"),
    [("Räder".encode(), "Räder"), ("Drehzahl_Räder_größer".encode("latin-1"), None), (bytes(range(128, 256)), None),
     (b"\xff\xff\xff", None), (b"a\0b", "a"), ("\N{SNOWMAN}\x1b[31m".encode(), None)],
)  # fmt: skip
def test_names_in_any_encoding(tmp_path, text, name):
    found, _ = read_bytes(tmp_path, commented(text, "TX", of="name"))
    (path,) = found
    assert path.startswith("group0.")
    assert name is None or path == f"group0.{name}"
    path.encode()  # no halves of characters


def test_an_encoding_is_guessed_from_the_beginning(tmp_path, monkeypatch):
    seen = []
    guess = charset_normalizer.from_bytes
    monkeypatch.setattr(charset_normalizer, "from_bytes", lambda text: seen.append(len(text)) or guess(text))
    read_bytes(tmp_path, commented(bytes([200, 201, 32, 230] * 400_000), "TX"))
    assert seen == [512]


def test_definitions_in_a_comment_are_not_followed(tmp_path):
    text = '<!DOCTYPE l [<!ENTITY a "haha">]><CNcomment><TX>&a;</TX></CNcomment>'
    (tmp_path / "a.mf4").write_bytes(commented(text))
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        assert r.channels()[0].comment == ""
    (tmp_path / "a.mf4").write_bytes(commented("<CNcomment><TX>speed<!-- of what --></TX></CNcomment>"))
    with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
        assert r.channels()[0].comment == "speed"


OPENED: list[str] = []
WATCHED = [False]
sys.addaudithook(lambda event, args: OPENED.append(str(args[0])) if WATCHED[0] and event == "open" else None)


def test_an_external_attachment_is_listed_and_never_opened(tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_text("secret")
    b = Blocks()
    b.header(attachment="attached")
    b.text("path", str(secret))
    b.add("attached", "AT", [None, "path", None, None], struct.pack("<HHI16sQQ", 0, 0, 0, b"", 6, 0))
    describe(b, "a", 200)
    b.group("dg0", None, "acg", "data")
    b.add("data", "DT", [], records(200))
    (tmp_path / "a.mf4").write_bytes(b.bytes())
    WATCHED[0] = True
    try:
        with MdfReader(tmp_path / "a.mf4", ReadOptions()) as r:
            r.read(r.channels())
            faults = r.faults
    finally:
        WATCHED[0] = False
    assert any("a.mf4" in name for name in OPENED)
    assert not any("secret" in name for name in OPENED)
    assert f"1 attachments are never opened: '{secret}'" in " ".join(faults.notes)


@pytest.mark.parametrize(("kind", "at"), [(b"DG", 4), (b"CN", 4)])
def test_a_link_to_itself_ends_in_mdf_3(tmp_path, kind, at):
    data = saved(tmp_path / "w", 1, "3.30")
    begin = struct.unpack_from("<I", data, 68)[0]
    if kind == b"CN":
        begin = struct.unpack_from("<I", data, struct.unpack_from("<I", data, begin + 8)[0] + 8)[0]
    assert data[begin : begin + 2] == kind
    _, faults = read_bytes(tmp_path, numbers_at(data, begin + at, "<I", begin))
    assert f"{kind.decode()} block at byte {begin} is linked twice" in faults.notes[0]
