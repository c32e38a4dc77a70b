"""Damaged MDF: the right values, or a clear error; never a traceback, a hang, or much memory.

How values are judged. MDF has no checksums but those of deflated blocks, so a flipped bit in a plain record, an offset
or a factor is another measurement, and nobody can tell. What must hold then is the form: as many times as values. Where
a file was only cut, or only bytes inside of deflated blocks were changed, every sample that is given must be that of the
whole file, in its place, and what is missing must be told.
"""

import functools
import re
from datetime import UTC, datetime
from pathlib import Path

import asammdf
import mdf_by_hand
import numpy as np
from asammdf.blocks.conversion_utils import from_dict

from aqualog.errors import LogError
from aqualog.io.base import ReadOptions
from aqualog.io.mdf import MdfReader
from aqualog.io.write_mdf import CanFrames, write_frames_mf4
from tests.fuzz.registry import Target, target

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


DBC = 'VERSION ""\n\nBU_: E\n\nBO_ 256 M: 8 E\n SG_ S : 0|16@1+ (0.1,0) [0|0] "m/s" E\n'

MAKERS = {
    "plain": lambda p: _written(p, "4.10", 0),
    "deflated": lambda p: _written(p, "4.10", 1),
    "transposed": lambda p: _written(p, "4.11", 2),
    "version3": lambda p: _written(p, "3.30", 0),
    "frames": _frames,
    "streamed": lambda _: mdf_by_hand.streamed(),
    "streamed_deflated": lambda _: mdf_by_hand.streamed(compressed=True),
    "unsorted": lambda _: mdf_by_hand.unsorted(),
    "unfinished": lambda _: mdf_by_hand.streamed(unfinished=1 | 4),
    "unfinished_unsorted": lambda _: mdf_by_hand.unsorted(unfinished=1 | 4),
}


def read(path: Path):
    """Channels by path and what was lost, with every piece of the other way to read as well."""
    dbc = path.with_name("fuzz.dbc")
    if not dbc.exists():
        dbc.write_text(DBC)
    with MdfReader(path, ReadOptions(dbc=(dbc,))) as reader:
        found = {c.info.path: (c.t_ns, c.values) for c in reader.read(reader.channels())}
        faults = reader.faults
    with MdfReader(path, ReadOptions()) as reader:
        for part in reader.parts(reader.channels()):
            for piece in part.pieces:
                assert all(len(c.t_ns) == len(c.values) for c in piece)
    return found, faults


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
        at = how[-2] if kind == "copy" else how[0]
        if kind == "copy":
            at = how[1]
        if kind in ("swap",) or len(damages) > 1:
            return False
        width = {"flip": 1, "zero": how[1], "number": how[1], "copy": 8}[kind]
        if not any(at % size in b and min(at % size + width, size) - 1 in b for b in blocks):
            return False
    return True


@functools.cache
def _whole(name: str, folder: Path):
    data = MAKERS[name](folder)
    path = folder / f"whole_{name}.mf4"
    path.write_bytes(data)
    return data, read(path)[0]


def judge(name: str, damages: tuple, path: Path) -> str | None:
    """What is wrong with the outcome, or None."""
    data, expected = _whole(name, path.parent)
    try:
        found, faults = read(path)
    except LogError as error:
        return None if len(error.line()) < 2000 and "\n" not in error.line() else "a long error"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    for channel, (t, values) in found.items():
        if t.shape != values.shape:
            return f"{channel}: {t.shape} times and {values.shape} values"
    if not _is_checked(data, damages):
        return None
    for channel, (t, values) in found.items():
        if channel not in expected:
            return f"{channel} has come from nowhere"
        whole_t, whole = expected[channel]
        rows = np.searchsorted(whole_t, t)
        if (rows >= len(whole_t)).any() or not np.array_equal(whole_t[rows], t):
            return f"{channel} has times that were not measured"
        if not np.array_equal(whole[rows], values, equal_nan=True):
            return f"{channel} has values that were not measured"
    is_less = any(c not in found or len(found[c][0]) < len(e[0]) for c, e in expected.items())
    # a recording that its logger did not finish has no end that could be missed
    is_open = any("not finalised" in n for n in faults.notes)
    if is_less and not (faults.truncated or faults.lost_samples or is_open):
        return "something is missing and nothing is told"
    return None


@target("mdf")
def mdf() -> Target:
    return Target(MAKERS, judge, ".mf4")
