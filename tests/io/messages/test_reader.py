"""Recorded messages read piece by piece give the samples and the faults that they give in one."""

import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from aqualog.io.messages import batches
from aqualog.io.messages import reader as messages
from aqualog.io.open_log import open_log
from aqualog.io.reader import ReadOptions
from tests.mcap_log import writing

LANE = Path(__file__).parents[3] / "sample_logs" / "lane_drive.mcap"
SCHEMA = b"std_msgs/Header header\nfloat64 x\nfloat32[3] y\n" + b"=" * 80 + (
    b"\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + b"=" * 80
    + b"\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)  # fmt: skip


def cdr(t_ns, x, frame="car"):
    text = frame.encode() + b"\0"
    data = struct.pack("<iII", t_ns // 10**9, t_ns % 10**9, len(text)) + text
    data += b"\0" * (-len(data) % 8) + struct.pack("<dfff", x, x, 2 * x, -x)
    return b"\0\1\0\0" + data


def made(path, n=3000, *, wrong=(), unstamped=(), long_frames=(), empty_log_time=False):
    with writing(path, chunk_size=4000, compression=CompressionType.ZSTD) as writer:
        schema = writer.register_schema("car/msg/State", "ros2msg", SCHEMA)
        topics = [writer.register_channel(f"/{k}", "cdr", schema) for k in "ab"]
        for i in range(n):
            t = 1_780_000_000 * 10**9 + i * 10_000_000
            data = cdr(0 if i in unstamped else t, float(i), "a longer frame" if i in long_frames else "car")
            data = data[:20] if i in wrong else data
            writer.add_message(topics[i % 5 == 0], 0 if empty_log_time else t + 1000, data, t)
    return path


CASES = {
    "plain": {},
    "damaged messages": {"wrong": (40, 41, 1500, 2999)},
    "without stamps": {"unstamped": range(100, 300)},
    "texts of two lengths": {"long_frames": range(0, 3000, 7)},
    "no log times": {"empty_log_time": True},
}


@pytest.mark.parametrize("size", [50, 700])
@pytest.mark.parametrize("case", [*CASES, "sample", "damaged chunk", "cut"])
def test_pieces_are_the_whole(case, size, tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    if case in CASES:
        made(path, **CASES[case])
    else:
        data = bytearray(LANE.read_bytes() if case == "sample" else made(path).read_bytes())
        if case == "damaged chunk":
            data[len(data) // 2] ^= 0xFF
        path.write_bytes(data[: len(data) * 2 // 3] if case == "cut" else data)
    with open_log(path, ReadOptions()) as reader:
        infos = reader.channels()
        whole, faults = reader.read(infos), reader.faults
    monkeypatch.setattr(messages, "_PIECE", size)
    monkeypatch.setattr(batches, "_ENOUGH", 3000)
    with open_log(path, ReadOptions()) as reader:
        (part,) = reader.parts(reader.channels())
        pieces = list(part.pieces)
        assert reader.faults == faults
    assert len(pieces) > 2
    for i, channel in enumerate(whole):
        np.testing.assert_array_equal(np.concatenate([p[i].t_ns for p in pieces]), channel.t_ns)
        np.testing.assert_array_equal(np.concatenate([p[i].values for p in pieces]), channel.values)
        assert {p[i].absolute for p in pieces if p[i].t_ns.size} == {channel.absolute}
        assert max(p[i].t_ns.size for p in pieces) < channel.t_ns.size
