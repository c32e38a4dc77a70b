"""Logs that nobody should have to read: files that are bad by themselves, and names at which a reader misbehaves.

A reader that crashes, hangs or takes without end is made by a hook, since faults that are known are mended: a folder
with a `sitecustomize` on PYTHONPATH, so that it is in every process that the batch starts, workers of dask included.
"""

from __future__ import annotations

import io
import os
import random
import struct
import zlib
from pathlib import Path

import polars as pl
from mcap.writer import CompressionType, Writer

from tests.damaged.logs import mf4

HOOK = '''
"""Readers that misbehave at logs named poison_KIND."""

import collections, ctypes, importlib.util, itertools, os, sys, tempfile, time, types

NAME = "aqualog.io.open_log"


def write(path):
    with tempfile.NamedTemporaryFile() as file:
        while True:
            file.write(bytes(1_000_000))


def crash(path):
    tempfile.mkstemp()
    ctypes.string_at(0)


ACTS = {
    "crash": crash,
    "leave": lambda p: os._exit(0),
    "hang": lambda p: collections.deque(itertools.repeat(0), maxlen=0),  # in C, with the interpreter's lock held
    "sleep": lambda p: time.sleep(3600),
    "memory": lambda p: [bytearray(50_000_000) for _ in range(10**6)],
    "write": write,
}


def mistreat(opening):
    real = opening.import_module

    def import_module(module):
        def misbehaving(name):
            def reads(path, options):
                kind = path.stem.partition("poison_")[2].partition(".")[0]
                if kind in ACTS:
                    ACTS[kind](path)
                return getattr(real(module), name)(path, options)

            return reads

        names = [name for where, name, _ in opening._READERS.values() if where == module]
        return types.SimpleNamespace(**{name: misbehaving(name) for name in names})

    opening.import_module = import_module


class Finder:
    def find_spec(self, name, path=None, target=None):
        if name != NAME:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        real = spec.loader.exec_module

        def exec_module(module):
            real(module)
            mistreat(module)

        spec.loader.exec_module = exec_module
        return spec


sys.meta_path.insert(0, Finder())
'''


def hooked(folder: Path, **limits: float) -> dict[str, str]:
    """Environment in which readers misbehave, with limits (`S`, `CPU_S`, `MB`, `FILE_MB`); the hook lies in `folder`."""
    (folder / "hook").mkdir(parents=True, exist_ok=True)
    (folder / "hook" / "sitecustomize.py").write_text(HOOK)
    paths = [str(folder / "hook"), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    given = {f"AQUALOG_LIMIT_{k}": str(v) for k, v in limits.items()}
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), **given}


HOOKED = (
    "crash.csv",
    "crash.mf4",
    "crash.parquet",
    "leave.csv",
    "leave.mcap",
    "hang.csv",
    "sleep.mf4",
    "memory.csv",
    "write.csv",
)
HOSTILE_NAMES = (
    "=cmd|' C'!A0.csv",
    "<img src=x onerror=alert(1)>.mf4",
    "$(touch owned) %00.parquet",
    "-rf.csv",
    "a'b\"c.mcap",
)
"""Names of good logs that drive spreadsheets, pages, terminals and shells."""


def real_poison(logs: Path, good: dict[str, Path], *, are_bombs: bool = True) -> list[Path]:
    """Files in the folder `logs` that are no logs, made from `good` ones by suffix; six, and five that are huge inside."""
    made = {
        "cut.mf4": good[".mf4"].read_bytes()[: good[".mf4"].stat().st_size // 2],
        "cut.mcap": good[".mcap"].read_bytes()[: good[".mcap"].stat().st_size // 2],
        "garbage.mf4": b"MDF     4.10    " + random.Random(1).randbytes(50_000),
        "empty.csv": b"",
    }
    for name, data in made.items():
        (logs / name).write_bytes(data)
    (logs / "unreadable.csv").symlink_to("unreadable.csv")  # permissions do not bind every user
    (logs / "folder").mkdir()
    (logs / "folder" / "metadata.yaml").write_bytes(b"rosbag2_bagfile_information: \xff{[")
    names = [*made, "unreadable.csv", "folder"]
    return [logs / n for n in (*names, *(_bombs(logs, good) if are_bombs else ()))]


def _bombs(logs: Path, good: dict[str, Path]) -> list[str]:
    (logs / "bomb.mf4").write_bytes(_mf4_bomb(logs))
    (logs / "bomb.mcap").write_bytes(_mcap_bomb())
    zeros = pl.select(pl.zeros(20_000_000).alias("t"))
    zeros.with_columns(**{n: pl.col("t") for n in ("v_x", "a_x")}).write_parquet(logs / "bomb.parquet")
    for name, head in (("endless.csv", b"t [s],v_x [m/s]\n0,1\n"), ("endless.mf4", good[".mf4"].read_bytes()[:64])):
        with (logs / name).open("wb") as file:  # sparse: it takes no room, and is zeros to whoever reads it
            file.write(head)
            file.truncate(2_000_000_000)
    return ["bomb.mf4", "bomb.mcap", "bomb.parquet", "endless.csv", "endless.mf4"]


def _mf4_bomb(folder: Path) -> bytes:
    """A data block of 300 MB of zeros in 300 kB, in place of the one that a log has."""
    path = mf4(folder, 1)
    raw = path.read_bytes()
    path.unlink()
    packed = zlib.compress(bytes(300_000_000))
    bomb = struct.pack("<4s4xQQ2sBxIQQ", b"##DZ", 48 + len(packed), 0, b"DT", 0, 0, 300_000_000, len(packed)) + packed
    old = raw.index(b"##DZ")
    # behind the end, and links to the old one lead there
    at = len(raw) + -len(raw) % 8
    return raw.ljust(at, b"\0").replace(struct.pack("<Q", old), struct.pack("<Q", at)) + bomb


def _mcap_bomb() -> bytes:
    """A chunk of a message of 500 MB of spaces."""
    file = io.BytesIO()
    out = Writer(file, compression=CompressionType.ZSTD)
    out.start()
    schema = out.register_schema("car", "jsonschema", b'{"type": "object"}')
    channel = out.register_channel("/car", "json", schema)
    out.add_message(channel, 1, b'{"v_x": 1}' + b" " * 500_000_000, 1)
    out.finish()
    return file.getvalue()
