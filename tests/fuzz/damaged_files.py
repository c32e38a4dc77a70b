"""What may come of a file with any content: what was recorded, or an error that says what is wrong."""

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from aqualog.errors import AqualogError
from aqualog.io.base import ReadOptions
from aqualog.io.open_log import open_log
from aqualog.types import Channel

__all__ = ["T0_NS", "check_samples", "damaged", "read"]

T0_NS = 1_700_000_000 * 10**9
_LONGEST_S = 10.0


def read(data: bytes, name: str) -> list[Channel]:
    """All channels of a file with this content; none if it is refused. Fails on any other error, and on a hang."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(data)
        began = time.process_time()
        channels: list[Channel] = []
        refusal = ""
        try:
            with open_log(path, ReadOptions()) as reader:
                channels = list(reader.read(reader.channels()))
                assert isinstance(reader.faults.lost_samples, int)
                assert reader.faults.lost_samples >= 0
        except AqualogError as error:
            refusal = error.line()
        assert name in (refusal or name)
        assert "\n" not in refusal
        assert time.process_time() - began < _LONGEST_S
        assert path.read_bytes() == data
    for c in channels:
        assert c.t_ns.shape == c.values.shape
        assert (c.t_ns.dtype, c.values.dtype) == (np.int64, np.float64)
    return channels


def check_samples(channels: Sequence[Channel], time_of: Callable[[np.ndarray], np.ndarray]) -> None:
    """Values that are told are those that were recorded at that time."""
    for c in channels:
        told = np.isfinite(c.values)
        assert (c.values[told] == np.rint(c.values[told])).all()
        np.testing.assert_array_equal(c.t_ns[told], time_of(c.values[told].astype(np.int64)))


@st.composite
def damaged(draw: st.DrawFn, seeds: Sequence[bytes]) -> bytes:
    """A sound file that was cut, of which bits have flipped, or pieces were zeroed or have changed places."""
    data = bytearray(draw(st.sampled_from(seeds)))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        size = draw(st.sampled_from([1, 4, 8, 100, 4096]))
        kind = draw(st.sampled_from(["cut", "flip", "flip", "flip", "zero", "swap", "lie", "again"]))
        if kind == "cut":
            del data[at:]
        elif kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "zero":
            data[at : at + size] = bytes(len(data[at : at + size]))
        elif kind == "swap":
            a, b = bytes(data[at : at + size]), bytes(data[at + size : at + 2 * size])
            data[at : at + 2 * size] = b + a
        elif kind == "lie":
            data[at : at + 4] = draw(st.sampled_from([b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\1"]))
        else:
            data[at:at] = data[at : at + size]
    return bytes(data)
