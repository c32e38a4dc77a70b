"""Damaged MDF: the right values, or a clear error; never a traceback, a hang, or much memory.

How values are judged. MDF has no checksums but those of deflated blocks, so a flipped bit in a plain record, an offset
or a factor is another measurement, and nobody can tell. What must hold then is the form: as many times as values. Where
a file was only cut, or only bytes inside of deflated blocks were changed, every sample that is given must be that of the
whole file, in its place, and what is missing must be told.
"""

import re
import tempfile
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import asammdf
import numpy as np
from asammdf.blocks.conversion_utils import from_dict

from tests import mdf_by_hand
from tests.can_log import CanFrames, write_frames_mf4
from tests.fuzz.readers import Outcome, outcome
from tests.fuzz.registry import Target, add

T = np.arange(120) * 0.01


def _written(folder: Path, version: str, compression: int) -> bytes:
    mdf = asammdf.MDF(version=version)
    mdf.start_time = datetime(2023, 11, 14, tzinfo=UTC)
    raw = (np.arange(120) % 4).astype("u1")
    state = from_dict({"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default_addr": b"?"})
    more = {} if version < "4" else {"invalidation_bits": np.arange(120) % 9 == 0}
    groups = [
        [("v", np.sin(T), {"a": 0.5, "b": 1.0}, {}), ("state", raw, state, {}), ("f", T, {"formula": "X*2"}, {})],
        [("w", np.arange(120, dtype="<i2"), None, more), ("table", raw, {"raw_0": 0.0, "phys_0": 1.0, "raw_1": 3.0, "phys_1": 9.0, "interpolation": True}, {})],
    ]  # fmt: skip
    for group in groups:
        mdf.append(
            [
                asammdf.Signal(
                    v, T, name=n, unit="m", comment="c", conversion=from_dict(c) if isinstance(c, dict) else c, **k
                )
                for n, v, c, k in group
            ],
            common_timebase=True,
        )
    path = folder / ("a.mdf" if version < "4" else "a.mf4")
    mdf.save(path, compression=compression, overwrite=True)
    mdf.close()
    return path.read_bytes()


def _frames(folder: Path) -> bytes:
    n = 60
    frames = CanFrames(
        np.arange(n) * 10**7, [256 + k % 3 for k in range(n)], [False] * n, [bytes([k] * (k % 9)) for k in range(n)],
        [1] * n,
    )  # fmt: skip
    write_frames_mf4(folder / "f.mf4", frames, 1_700_000_000 * 10**9, "")
    return (folder / "f.mf4").read_bytes()


DBC = b'VERSION ""\n\nBU_: E\n\nBO_ 256 M: 8 E\n SG_ S : 0|16@1+ (0.1,0) [0|0] "m/s" E\n'

VERSION_4 = {
    "plain": lambda p: _written(p, "4.10", 0),
    "deflated": lambda p: _written(p, "4.10", 1),
    "transposed": lambda p: _written(p, "4.11", 2),
    "frames": _frames,
    "streamed": lambda _: mdf_by_hand.streamed(),
    "streamed_deflated": lambda _: mdf_by_hand.streamed(compressed=True),
    "unsorted": lambda _: mdf_by_hand.unsorted(),
    "unfinished": lambda _: mdf_by_hand.streamed(unfinished=1 | 4),
    "unfinished_unsorted": lambda _: mdf_by_hand.unsorted(unfinished=1 | 4),
}
VERSION_3 = {"version3": lambda p: _written(p, "3.30", 0), "version310": lambda p: _written(p, "3.10", 0)}


@cache
def version_4() -> dict[str, bytes]:
    """Small sound files of the layouts that loggers and libraries write."""
    return _made(VERSION_4)


@cache
def version_3() -> dict[str, bytes]:
    """Small sound files of version 3."""
    return _made(VERSION_3)


def _made(makers) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        return {name: make(Path(folder)) for name, make in makers.items()}


def _deflated(data: bytes) -> list[range]:
    """Where the bytes of deflated blocks are."""
    out = []
    for match in re.finditer(b"##DZ\0\0\0\0", data):
        stored = int.from_bytes(data[match.start() + 40 : match.start() + 48], "little")
        out.append(range(match.start() + 48, match.start() + 48 + stored))
    return out


def _is_checked(data: bytes, damages: tuple) -> bool:
    """Whether all damages are such that no wrong value may come through."""
    blocks = _deflated(data)
    size = len(data)
    for kind, *how in damages:
        if kind == "cut":
            continue
        if kind not in ("flip", "zero", "number", "copy") or len(damages) > 1:
            return False
        at = how[1] if kind == "copy" else how[0]
        width = {"flip": 1, "zero": how[1], "number": how[1], "copy": 8}[kind]
        if not any(at % size in b and min(at % size + width, size) - 1 in b for b in blocks):
            return False
    return True


@cache
def _whole(seed: str) -> Outcome:
    return outcome({**version_4(), **version_3()}[seed], _name(seed), dbc=DBC)


def _name(seed: str) -> str:
    return "a.mdf" if seed in VERSION_3 else "a.mf4"


def one(data: bytes) -> None:
    """Read a file with this content."""
    outcome(data, "a.mf4", dbc=DBC)


def known(seed: str, damages: tuple, data: bytes) -> None:
    """Read a file of the seeds with these damages."""
    found = outcome(data, _name(seed), dbc=DBC)
    if not found.refusal and _is_checked({**version_4(), **version_3()}[seed], damages):
        check_recorded(_whole(seed), found)


def check_recorded(whole: Outcome, found: Outcome) -> None:
    """What was found is of the whole file, and what is missing is told."""
    expected = {c.info.path: c for c in whole.channels}
    for c in found.channels:
        assert c.info.path in expected, f"{c.info.path} has come from nowhere"
        of = expected[c.info.path]
        rows = np.searchsorted(of.t_ns, c.t_ns)
        assert (rows < len(of.t_ns)).all(), f"{c.info.path} has times that were not measured"
        assert np.array_equal(of.t_ns[rows], c.t_ns), f"{c.info.path} has times that were not measured"
        assert np.array_equal(of.values[rows], c.values, equal_nan=True), f"{c.info.path} has values of another time"
    lengths = {c.info.path: len(c.t_ns) for c in found.channels}
    is_less = any(lengths.get(path, -1) < len(c.t_ns) for path, c in expected.items())
    # a recording that its logger did not finish has no end that could be missed
    is_open = any("not finalised" in n for n in found.faults.notes)
    told = found.faults.truncated or found.faults.lost_samples or is_open
    assert told or not is_less, "something is missing and nothing is told"


add("mdf", Target("MDF 4", version_4, one, known))
add("mdf3", Target("MDF 3", version_3, one, known))
