"""MDF reading and writing: what asammdf gets wrong must not get through."""

from __future__ import annotations

import gc
import hashlib
import os
import struct
import subprocess
import sys
from pathlib import Path

import asammdf
import numpy as np
import pytest
from asammdf.blocks import mdf_v4
from asammdf.blocks.conversion_utils import from_dict

from aqualog.align.load import load_signals
from aqualog.align.mapping import Entry, SignalMap
from aqualog.core.errors import LogError, SignalError
from aqualog.core.records import Channel, FileFaults
from aqualog.core.vehicle import Vehicle
from aqualog.io.mdf.conversion import Formula
from aqualog.io.mdf.frames import _variable
from aqualog.io.mdf.reader import MdfReader
from aqualog.io.reader import ReadOptions
from aqualog.io.write_mdf import MdfGroup, write_mf4
from tests.can_log import CanFrames, CanMessage, frame_rows, write_can_mf4, write_frames_mf4

REAL = Path(__file__).parents[3].parent / "shared" / "real_logs"
START = 1_700_000_000_123_456_789
T = np.arange(200) * 0.01
NO_DBC = ReadOptions()
DBC = """VERSION ""

BU_: ECU

BO_ 256 ESP_19: 8 ECU
 SG_ Speed_FL : 0|16@1+ (0.01,0) [0|0] "km/h" ECU
 SG_ Tail : 48|16@1- (1,0) [0|0] "" ECU

BO_ 2566844672 Truck: 8 ECU
 SG_ TruckSpeed : 0|16@1+ (0.5,0) [0|0] "km/h" ECU

BO_ 300 Fast: 64 ECU
 SG_ Last : 496|16@1+ (1,0) [0|0] "" ECU
"""


def save(path: Path, *groups: list[asammdf.Signal], version: str = "4.10", compression: int = 0, **names) -> Path:
    mdf = asammdf.MDF(version=version)
    for signals in groups:
        mdf.append(signals, common_timebase=True, **names)
    if version < "4":
        mdf.save(path.with_suffix(".mdf"))
        path.with_suffix(".mdf").rename(path)
    else:
        with path.open("wb+") as file:
            mdf.save(file, compression=compression)
    mdf.close()
    return path


def signal(name: str, values, unit: str = "", **more) -> asammdf.Signal:
    values = np.asarray(values)
    return asammdf.Signal(values, T[: len(values)], name=name, unit=unit, **more)


def read_all(path: Path, options: ReadOptions = NO_DBC) -> tuple[dict[str, Channel], FileFaults]:
    with MdfReader(path, options) as reader:
        channels = {c.info.path: c for c in reader.read(reader.channels())}
        return channels, reader.faults


def attempt(path: Path) -> tuple[dict[str, Channel], FileFaults] | str:
    """What is read, or the error's line."""
    try:
        return read_all(path)
    except LogError as error:
        return error.line()


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("version", ["3.30", "4.10", "4.11"])
@pytest.mark.parametrize("compression", [0, 1, 2])
def test_versions_and_compressions(tmp_path: Path, version: str, compression: int):
    v = np.sin(T)
    group = [signal("v_x", v, "m/s"), signal("n", np.arange(200, dtype="<i2"), "1/min")]
    path = save(tmp_path / "a.mf4", group, version=version, compression=compression)
    before = digest(path), sorted(tmp_path.iterdir())
    channels, faults = read_all(path)
    assert list(channels) == ["group0.v_x", "group0.n"]
    np.testing.assert_array_equal(channels["group0.v_x"].values, v)
    np.testing.assert_array_equal(channels["group0.n"].values, np.arange(200.0))
    assert channels["group0.n"].values.dtype == np.float64
    assert channels["group0.v_x"].info.unit == "m/s"
    np.testing.assert_array_equal(np.diff(channels["group0.n"].t_ns), 10_000_000)
    assert not faults.truncated
    assert (digest(path), sorted(tmp_path.iterdir())) == before


def test_linear_and_text_conversions(tmp_path: Path):
    raw = np.array([0, 1, 2, 3] * 50, dtype="u1")
    state = from_dict({"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default_addr": b"?"})
    mixed = from_dict({"val_0": 3, "text_0": b"error", "default_addr": from_dict({"a": 10.0, "b": 1.0})})
    path = save(
        tmp_path / "a.mf4",
        [
            signal("linear", raw, conversion=from_dict({"a": 0.1, "b": -5.0})),
            signal("single", raw.astype("<f4"), conversion=from_dict({"a": 0.1, "b": 0.0})),
            signal("state", raw, conversion=state),
            signal("mixed", raw, conversion=mixed),
            signal("word", np.array([b"abc"] * 200), encoding="utf-8"),
        ],
    )
    channels, _ = read_all(path)
    assert "group0.word" not in channels
    np.testing.assert_array_equal(channels["group0.linear"].values, raw * 0.1 - 5.0)
    np.testing.assert_array_equal(channels["group0.single"].values, raw * 0.1)  # scaled in double precision
    np.testing.assert_array_equal(channels["group0.state"].values, raw.astype(float))
    np.testing.assert_array_equal(channels["group0.mixed"].values[:4], [1.0, 11.0, 21.0, np.nan])


def test_all_texts_of_a_mixed_table_are_missing(tmp_path: Path):
    mixed = from_dict({"val_0": 3, "text_0": b"error", "default_addr": from_dict({"a": 10.0, "b": 1.0})})
    path = save(tmp_path / "a.mf4", [signal("x", np.full(200, 3, dtype="u1"), conversion=mixed)])
    assert np.isnan(read_all(path)[0]["group0.x"].values).all()


@pytest.mark.parametrize("kind", ["u1", "<i4", "<f8"])
def test_tables_of_ranges(tmp_path: Path, kind: str):
    """Expected by the standard: whole numbers belong to both ends of a range, others to the lower one."""
    ranges = {"lower_0": 0.0, "upper_0": 9.0, "phys_0": 1.5, "lower_1": 10.0, "upper_1": 20.0, "phys_1": 2.5}
    table = from_dict({**ranges, "default": -1.0})
    raw = np.array([0, 5, 9, 10, 15, 20, 21, 100] * 25, dtype=kind)
    values = read_all(save(tmp_path / "a.mf4", [signal("x", raw, conversion=table)]))[0]["group0.x"].values
    ends = [-1.0, 2.5, 2.5, -1.0] if kind == "<f8" else [1.5, 2.5, 2.5, 2.5]
    np.testing.assert_array_equal(values[:8], [1.5, 1.5, *ends, -1.0, -1.0])


def test_a_table_of_ranges_within_a_table_of_texts_is_refused(tmp_path: Path):
    inner = from_dict({"lower_0": 0.0, "upper_0": 9.0, "phys_0": 1.5, "default": -1.0})
    mixed = from_dict({"val_0": 3, "text_0": b"error", "default_addr": inner})
    path = save(tmp_path / "a.mf4", [signal("x", np.arange(200, dtype="u1"), conversion=mixed), signal("y", T)])
    channels, faults = read_all(path)
    assert list(channels) == ["group0.y"]
    assert any("table of ranges" in n for n in faults.notes)


def test_invalid_samples_are_nan_and_the_rest_keeps_its_time(tmp_path: Path):
    bad = np.zeros(200, dtype=bool)
    bad[[3, 50]] = True
    x = signal("x", np.arange(200.0), invalidation_bits=bad)
    path = save(tmp_path / "a.mf4", [x, signal("y", np.arange(200.0))])
    channels, _ = read_all(path)
    assert np.flatnonzero(np.isnan(channels["group0.x"].values)).tolist() == [3, 50]
    assert not np.isnan(channels["group0.y"].values).any()
    np.testing.assert_array_equal(channels["group0.x"].t_ns, channels["group0.y"].t_ns)


def test_same_name_in_several_groups(tmp_path: Path):
    groups = [[signal("v", np.full(200, float(k)))] for k in range(3)]
    path = save(tmp_path / "a.mf4", *groups)
    channels, _ = read_all(path)
    assert [(p, c.values[0]) for p, c in channels.items()] == [("group0.v", 0), ("group1.v", 1), ("group2.v", 2)]
    path = save(tmp_path / "b.mf4", *groups, acq_name="10ms")
    channels, _ = read_all(path)
    assert [(p, c.values[0]) for p, c in channels.items()] == [("10ms.v", 0), ("10ms.v#2", 1), ("10ms.v#3", 2)]
    named = [[signal(n, np.full(200, float(k)))] for k, n in enumerate(("v", "v#2", "v", "v#2", "v"))]
    channels, _ = read_all(save(tmp_path / "c.mf4", *named, acq_name="g"))
    assert [(p, c.values[0]) for p, c in channels.items()] == [
        ("g.v", 0), ("g.v#2", 1), ("g.v#3", 2), ("g.v#2#2", 3), ("g.v#4", 4),
    ]  # fmt: skip


def test_source_tells_equal_paths_apart(tmp_path: Path):
    groups = [
        [signal("v\\XCP:1", np.full(200, float(k)), source=asammdf.Source(f"CAN{k}", "", "", 1, 0))] for k in (1, 2)
    ]
    path = save(tmp_path / "a.mf4", *groups, acq_name="ESP_19")
    channels, _ = read_all(path)
    assert [(p, c.values[0]) for p, c in channels.items()] == [("CAN1.ESP_19.v", 1), ("CAN2.ESP_19.v", 2)]
    assert {c.info.name for c in channels.values()} == {"v"}


def test_only_the_wanted_channels_in_the_order_asked_for(tmp_path: Path):
    path = save(tmp_path / "a.mf4", [signal(n, np.full(200, i)) for i, n in enumerate("abc")])
    with MdfReader(path, NO_DBC) as reader:
        a, _, c = reader.channels()
        assert [x.info.name for x in reader.read([c, a])] == ["c", "a"]


def test_group_without_time_is_left_out_with_a_note(tmp_path: Path):
    path = save(tmp_path / "a.mf4", [signal("x", np.zeros(200))])
    data = bytearray(path.read_bytes())
    master = next(i for i in range(0, len(data), 8) if data[i : i + 4] == b"##CN" and is_master(data, i))
    links = struct.unpack_from("<Q", data, master + 16)[0]
    data[master + 24 + links * 8 + 1] = 2  # sync type: angle
    path.write_bytes(data)
    channels, faults = read_all(path)
    assert not channels
    assert "over angle" in faults.notes[0]


def is_master(data: bytearray, at: int) -> bool:
    links = struct.unpack_from("<Q", data, at + 16)[0]
    return data[at + 24 + links * 8] == 2


def test_reading_loads_no_other_reader(tmp_path: Path):
    """Least of all one that hands the text of a formula to `eval`, as asammdf does by way of sympy."""
    paths = [save(tmp_path / f"{v}.mf4", [signal("x", T)], version=v) for v in ("4.10", "3.30")]
    code = f"""
import pathlib, sys
from aqualog.io.mdf.reader import MdfReader, ReadOptions
for path in {[str(p) for p in paths]!r}:
    with MdfReader(pathlib.Path(path), ReadOptions()) as reader:
        assert len(reader.read(reader.channels())[0].values) == 200
assert not {{"asammdf", "sympy", "pandas"}} & set(sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, check=True)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_formulas(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str):
    monkeypatch.chdir(tmp_path)
    formulas = {
        "good": "2*X1 + 1",
        "power": "pow(X1,2) + X1^2",
        "root": "-sqrt(X1)*exp(0)",
        "angle": "atan(tan(X1/1000)) + 0*tanh(X1)",
        "hostile": "__import__('os').system('touch HACKED') or X1",
        "attribute": "X1.__class__",
        "branch": "X1>1?5:7",
        "open": "sin(X1",
    }
    x = np.arange(200.0)
    if version < "4":  # asammdf's writer puts the 1 behind every X
        formulas = {n: f.replace("X1", "X") for n, f in formulas.items()}
    group = [signal(n, x, conversion=from_dict({"formula": f})) for n, f in formulas.items()]
    path = save(tmp_path / "a.mf4", group, version=version)
    channels, faults = read_all(path)
    assert [c.info.name for c in channels.values()] == ["good", "power", "root", "angle"]
    np.testing.assert_array_equal(channels["group0.good"].values, 2 * x + 1)
    np.testing.assert_array_equal(channels["group0.power"].values, 2 * x**2)
    np.testing.assert_array_equal(channels["group0.root"].values, -np.sqrt(x))
    np.testing.assert_allclose(channels["group0.angle"].values, x / 1000)
    for name in ("hostile", "attribute", "branch", "open"):
        assert any(f"channel group0.{name} is left out" in n for n in faults.notes)
    assert not (tmp_path / "HACKED").exists()


@pytest.mark.parametrize("text", ["", "X; X", "lambda: X", "f'{X}'", "X if X else 1", "Y", "max(X,1)", "'a'*9**9",
                                  "[X]", "X@X", "pow(X)", "True", "(" * 400, "-" * 499 + "X" * 2])  # fmt: skip
def test_whatever_is_not_arithmetic_is_refused(text: str):
    with pytest.raises(LogError, match="conversion formula"):
        Formula(text)


def test_a_tower_of_powers_costs_nothing():
    assert np.isinf(Formula("X + 9**9**9**9**9")(np.zeros(1)))[0]
    assert np.isinf(Formula("X + 1" + "0" * 400)(np.zeros(1)))[0]


def test_start_time_to_the_nanosecond_and_one_raster_for_all_groups(tmp_path: Path):
    path = tmp_path / "log.part"
    group = {"x": ("m/s", "speed", T)}
    write_mf4(path, [MdfGroup("a", T, group), MdfGroup("b", T, group)], START, "c")
    channels, _ = read_all(path)
    assert channels["a.x"].absolute
    assert channels["a.x"].t_ns[0] == START
    np.testing.assert_array_equal(channels["a.x"].t_ns, channels["b.x"].t_ns)
    np.testing.assert_array_equal(np.diff(channels["a.x"].t_ns), 10_000_000)


@pytest.mark.parametrize("start", [None, 0, 315_964_800 * 10**9])
def test_a_logger_without_a_clock_has_relative_time(tmp_path: Path, start: int | None):
    write_mf4(tmp_path / "a.mf4", [MdfGroup("a", T, {"x": ("", "", T)})], start, "")
    x = read_all(tmp_path / "a.mf4")[0]["a.x"]
    assert not x.absolute
    assert x.t_ns[:2].tolist() == [0, 10_000_000]


def test_samples_without_a_time_stamp_are_counted(tmp_path: Path):
    t = T.copy()
    t[7] = np.nan
    write_mf4(tmp_path / "a.mf4", [MdfGroup("a", t, {"x": ("", "", np.arange(200.0))})], START, "")
    channels, faults = read_all(tmp_path / "a.mf4")
    assert 7.0 not in channels["a.x"].values
    assert len(channels["a.x"].t_ns) == 199
    assert faults.lost_samples == 1


def test_unfinalised_file_is_read_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = save(tmp_path / "a.mf4", [signal("x", np.arange(200.0))])
    data = bytearray(path.read_bytes())
    data[:8] = b"UnFinMF "
    struct.pack_into("<H", data, 60, 1 | 4)  # cycle counters and length of the last DT block are not up to date
    path.write_bytes(data)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    before = digest(path)
    channels, faults = read_all(path)
    assert len(channels["group0.x"].values) == 200
    assert "file was not finalised by the logger" in faults.notes[0]
    assert digest(path) == before
    assert not list(scratch.iterdir())


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 0.99])
@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_cut_file(tmp_path: Path, capfd: pytest.CaptureFixture[str], share: float, version: str):
    """Either an error that says so, or what is there, flagged; never noise and never invented samples."""
    groups = [[signal("x", np.arange(200.0))], [signal("y", np.arange(200.0))]]
    path = save(tmp_path / "a.mf4", *groups, version=version)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    result = attempt(path)
    if isinstance(result, str):
        assert "file is cut" in result
        assert "Try" in result
    else:
        channels, faults = result
        assert faults.truncated or len(channels) == 2
        for c in channels.values():
            np.testing.assert_array_equal(c.values, np.arange(200.0)[: len(c.values)])
    gc.collect()
    assert capfd.readouterr() == ("", "")


def with_data_last(path: Path) -> None:
    """Move the record block behind everything else, where loggers put it that write the descriptions first."""
    data = bytearray(path.read_bytes())
    group = struct.unpack_from("<Q", data, 64 + 24)[0]
    block = struct.unpack_from("<Q", data, group + 40)[0]
    length = struct.unpack_from("<Q", data, block + 8)[0]
    data += bytes(-len(data) % 8)
    struct.pack_into("<Q", data, group + 40, len(data))
    path.write_bytes(data + data[block : block + length])


@pytest.mark.parametrize("cut", [0, 100, 3000])
def test_cut_through_the_records(tmp_path: Path, cut: int):
    path = save(tmp_path / "a.mf4", [signal("x", np.arange(200.0))])
    with_data_last(path)
    path.write_bytes(path.read_bytes()[: -cut or None])
    result = attempt(path)
    assert not isinstance(result, str), result
    x, faults = result[0]["group0.x"].values, result[1]
    np.testing.assert_array_equal(x, np.arange(200.0)[: len(x)])
    assert len(x) == 200 - -(-cut // 16)  # a record has 16 bytes; every complete one is kept
    assert faults.truncated is (cut > 0)
    assert faults.lost_samples == 200 - len(x)


def test_cut_through_the_frames(tmp_path: Path, dbc: Path):
    path = tmp_path / "a.mf4"
    write_can_mf4(path, dbc, [CanMessage("ESP_19", T, {})], START, "", compression=0)
    with_data_last(path)
    path.write_bytes(path.read_bytes()[:-50])
    result = attempt(path)
    assert not isinstance(result, str), result
    assert result[1].truncated
    assert result[1].lost_samples == 1
    assert "199 raw CAN frames" in " ".join(result[1].notes)


def test_garbage_is_a_log_error(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    path = tmp_path / "a.mf4"
    path.write_bytes(b"MDF     4.10    " + bytes(range(256)) * 40)
    with pytest.raises(LogError):
        MdfReader(path, NO_DBC)
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_flipped_bytes_never_raise_anything_else(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    path = save(tmp_path / "a.mf4", [signal("x", np.arange(200.0)), signal("y", np.arange(200, dtype="u1"))])
    good = path.read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(60):
        data = bytearray(good)
        data[int(rng.integers(64, len(data)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        attempt(path)
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_attachments_are_never_opened(tmp_path: Path, dbc: Path, monkeypatch: pytest.MonkeyPatch):
    """asammdf opens any path that the file names, and decodes frames by an attached DBC while it opens the file."""
    opened: list[object] = []
    monkeypatch.setattr(mdf_v4.MDF4, "_extract_attachment", lambda *a, **k: opened.append(a) or (b"", Path(), b""))
    attached = (dbc.read_bytes(), Path("car.dbc"), hashlib.md5(dbc.read_bytes()).digest())
    frames = CanFrames(np.array([0]), [256], [False], [bytes(8)], [1])
    bus = asammdf.Source("CAN", "CAN", "", 2, 2)
    raw = asammdf.Signal(frame_rows(frames), T[:1], name="CAN_DataFrame", source=bus, attachment=attached)
    path = save(tmp_path / "a.mf4", [raw], [signal("x", T, attachment=attached)])
    opened.clear()
    channels, faults = read_all(path)
    assert list(channels) == ["group1.x"]
    assert "holds 1 raw CAN frames" in faults.notes[0]
    assert not opened


def test_channel_outside_its_record_is_left_out(tmp_path: Path):
    """asammdf's C code would read foreign memory, or end the process."""
    path = save(tmp_path / "a.mf4", [signal("x", np.zeros(200)), signal("y", np.ones(200))])
    data = bytearray(path.read_bytes())
    at = next(i for i in range(0, len(data), 8) if data[i : i + 4] == b"##CN" and not is_master(data, i))
    links = struct.unpack_from("<Q", data, at + 16)[0]
    struct.pack_into("<I", data, at + 24 + links * 8 + 4, 0x7FFFFFF0)  # byte offset
    path.write_bytes(data)
    channels, faults = read_all(path)
    assert list(channels) == ["group0.y"]
    assert "channel group0.x is left out: it lies outside the record" in faults.notes


def test_archive_suffix_is_refused_and_the_file_survives(tmp_path: Path):
    """asammdf deletes a file with such a suffix when it closes it."""
    path = save(tmp_path / "a.bz2", [signal("x", np.zeros(200))])
    with pytest.raises(LogError, match="archive"):
        MdfReader(path, NO_DBC)
    assert path.exists()


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC, encoding="cp1252")
    return path


def test_can_round_trip_with_measured_channels(tmp_path: Path, dbc: Path):
    speed = np.round(50 + 10 * np.sin(T), 2)
    path = tmp_path / "log.part"
    measured = MdfGroup("gps", T, {"v": ("m/s", "", T)})
    truck = CanMessage("Truck", T[::2], {"TruckSpeed": np.full(100, 20.5)})
    write_can_mf4(path, dbc, [CanMessage("ESP_19", T, {"Speed_FL": speed}), truck], START, "", groups=[measured])
    before = digest(path)
    channels, faults = read_all(path, ReadOptions(dbc=(dbc,)))
    assert set(channels) == {"gps.v", "ESP_19.Speed_FL", "ESP_19.Tail", "Truck.TruckSpeed"}
    np.testing.assert_allclose(channels["ESP_19.Speed_FL"].values, speed, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(channels["ESP_19.Speed_FL"].t_ns, channels["gps.v"].t_ns)
    assert channels["ESP_19.Speed_FL"].info.unit == "km/h"
    assert channels["Truck.TruckSpeed"].info.count == 100
    assert (channels["Truck.TruckSpeed"].values == 20.5).all()
    assert "300 raw CAN frames with 2 ids on bus 0: 2 ids (300 frames) are in car.dbc" in faults.notes[0]
    assert digest(path) == before


def test_without_a_dbc_the_frames_are_announced(tmp_path: Path, dbc: Path):
    write_can_mf4(tmp_path / "a.mf4", dbc, [CanMessage("ESP_19", T, {})], START, "")
    channels, faults = read_all(tmp_path / "a.mf4")
    assert not channels
    assert faults.notes == ("holds 200 raw CAN frames with 1 ids on bus 0; give --dbc FILE to decode them",)
    for entries in ({}, {"v_x": Entry("v_x", ("ESP_19.Speed_FL",))}):
        with pytest.raises(SignalError, match=r"holds no channel .*200 raw CAN frames") as caught:
            load_signals([tmp_path / "a.mf4"], vehicle=Vehicle(), signal_map=SignalMap(entries))
        assert caught.value.hint.startswith("--dbc FILE")


def test_bus_stands_in_front_only_where_needed(tmp_path: Path, dbc: Path):
    messages = [CanMessage("ESP_19", T, {"Speed_FL": np.full(200, 10.0 * b)}, bus=b) for b in (1, 2)]
    write_can_mf4(tmp_path / "a.mf4", dbc, [*messages, CanMessage("Truck", T, {}, bus=2)], START, "")
    channels, faults = read_all(tmp_path / "a.mf4", ReadOptions(dbc=(dbc,)))
    assert {p for p in channels if "Speed" in p} == {"CAN1.ESP_19.Speed_FL", "CAN2.ESP_19.Speed_FL", "Truck.TruckSpeed"}
    assert channels["CAN2.ESP_19.Speed_FL"].values[0] == 20.0
    assert "on buses 1, 2" in faults.notes[0]


def test_short_foreign_and_fd_frames(tmp_path: Path, dbc: Path):
    frames = CanFrames(
        np.arange(6) * 10**7,
        ids=[256, 256, 300, 0x18FEF125, 256, 77],
        extended=[False, False, False, True, True, False],
        payloads=[b"\1\0\0\0\0\0\2\0", b"\3\0\0", bytes(62) + b"\5\0", bytes(8), bytes(8), b""],
        bus=[0] * 6,
    )
    write_frames_mf4(tmp_path / "a.mf4", frames, START, "")
    channels, faults = read_all(tmp_path / "a.mf4", ReadOptions(dbc=(dbc,)))
    assert channels["ESP_19.Speed_FL"].values.tolist() == [0.01, 0.03]  # the 29-bit 256 is another message
    assert channels["ESP_19.Tail"].values.tolist() == [2.0]
    assert channels["Fast.Last"].values.tolist() == [5.0]
    assert faults.lost_samples == 1
    notes = " | ".join(faults.notes)
    assert "ESP_19.Tail: 1 frames are shorter than the 8 bytes it needs" in notes
    assert "same J1939 parameter group but another sender or priority, not decoded: 0x18FEF125x (Truck)" in notes
    assert "other id length: 0x100x" in notes


@pytest.mark.parametrize("compression", [0, 2])
def test_writer_writes_exactly_its_path(tmp_path: Path, compression):
    path = tmp_path / "log.tmp123"
    gaps = np.where(T > 1, np.nan, T)
    group = MdfGroup("esp", T, {"x": ("km/h", "a speed", gaps)})
    write_mf4(path, [group], START, "note", compression=compression)
    assert list(tmp_path.iterdir()) == [path]
    x = read_all(path)[0]["esp.x"]
    assert (x.info.unit, x.info.comment) == ("km/h", "a speed")
    np.testing.assert_array_equal(x.values, gaps)


def test_payload_behind_a_cut_has_no_length():
    """What the frame says was sent is no value where the file does not hold it."""
    whole = b"".join(n.to_bytes(4, "little") + bytes(range(1, n + 1)) for n in (3, 2, 4))
    data, stored = _variable(np.frombuffer(whole[:-2], dtype=np.uint8), np.array([0, 7, 13, 21]))
    assert data.tolist() == [[1, 2, 3, 0], [1, 2, 0, 0], [1, 2, 0, 0], [0, 0, 0, 0]]
    assert stored.tolist() == [3, 2, 2, 0]


@pytest.mark.real
@pytest.mark.skipif(not REAL.exists(), reason=f"no measured drives at {REAL}")
class TestRealDrives:
    def test_toyota(self):
        path = REAL / "toyota_rav4" / "can_bus.mf4"
        before = digest(path)
        channels, faults = read_all(path, ReadOptions(dbc=(REAL / "toyota_rav4" / "toyota_2017.dbc",)))
        assert digest(path) == before
        assert len(channels["WHEEL_SPEEDS.WHEEL_SPEED_FL"].values) == 4974
        assert any(n.startswith("53800 raw CAN frames") for n in faults.notes)

    @pytest.mark.parametrize("name", ["00000001-60FE3F04.MF4", "00000002-60FE415D.MF4"])
    def test_variable_length_payload(self, name: str):
        channels, faults = read_all(REAL / "canedge" / name, ReadOptions(dbc=(REAL / "canedge" / "canmod-gps.dbc",)))
        assert len(channels) == 39
        assert 9.0 < np.median(channels["gnss_imu.AccelerationX"].values) < 10.0  # gravity: mounted on its side
        assert 55.9 < np.median(channels["gnss_pos.Latitude"].values) < 56.3
        assert not faults.truncated

    def test_variable_length_payload_has_the_bytes_that_asammdf_reads(self):
        path = REAL / "canedge" / "00000001-60FE3F04.MF4"
        with asammdf.MDF(path) as mdf:
            expected = mdf.get("CAN_DataFrame.DataBytes", group=0).samples
        with MdfReader(path, ReadOptions(dbc=(REAL / "canedge" / "canmod-gps.dbc",))) as reader:
            group = reader._frames[0]
            _, (_, data, _) = reader._frame_rows(group, np.unique(group.codes))
        np.testing.assert_array_equal(data, expected)

    def test_cut_in_the_payloads(self, tmp_path: Path):
        """Frames stand before their payloads: a cut there leaves frames of full length without a byte."""
        options = ReadOptions(dbc=(REAL / "canedge" / "canmod-gps.dbc",))
        sound, _ = read_all(REAL / "canedge" / "00000002-60FE415D.MF4", options)
        cut = tmp_path / "cut.mf4"
        cut.write_bytes((REAL / "canedge" / "00000002-60FE415D.MF4").read_bytes()[:1_674_198])
        channels, faults = read_all(cut, options)
        for name, channel in channels.items():
            n = len(channel.values)
            assert 0 < n < 0.05 * len(sound[name].values)
            np.testing.assert_array_equal(channel.values, sound[name].values[:n])
        assert len([n for n in faults.notes if "shorter than" in n]) == len({n.split(".")[0] for n in channels})
        lost: dict[str, int] = {}
        for name, channel in sound.items():  # frames, whatever the number of signals in them
            missing = len(channel.values) - len(channels[name].values)
            lost[name.split(".")[0]] = max(missing, lost.get(name.split(".")[0], 0))
        assert faults.lost_samples == sum(lost.values())

    def test_many_groups(self):
        path = REAL / "canedge" / "00000001-63BEF5CD.MF4"
        before = digest(path)
        channels, faults = read_all(path)
        assert not channels
        assert any("4024 raw CAN frames with 15 ids on buses 1, 2" in n for n in faults.notes)
        assert digest(path) == before
