"""Reading logs: MF4 beside asammdf, CSV beside pandas."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from tests.bench.compare import Row
from tests.bench.scale import Scale

FLOATS, INTEGERS = (np.float64, np.float32), (np.int16, np.uint32)
LAYOUTS = {0: "not compressed", 1: "deflated", 2: "transposed and deflated"}


def made_mf4(path: Path, *, records: int, channels: int, compression: int) -> Path:
    """Noisy walks as floats and scaled integers, half each, at 100 Hz."""
    import asammdf

    rng = np.random.default_rng(channels)
    t = np.arange(records) * 0.01
    out = asammdf.MDF(version="4.10")
    signals = []
    for i in range(channels):
        walk = rng.standard_normal(records).cumsum()
        if i % 4 < 2:
            signals.append(asammdf.Signal(walk.astype(FLOATS[i % 4]), t, name=f"c{i}"))
        else:
            raw = (np.abs(walk) * 10.0).astype(INTEGERS[i % 4 - 2])
            signals.append(asammdf.Signal(raw, t, name=f"c{i}", conversion={"a": 0.01, "b": 1.0}))
    out.append(signals, common_timebase=True)
    out.save(path, compression=compression, overwrite=True)
    out.close()
    return path


def read_by_aqualog(path: Path, names: list[str], threads: int = 1) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time stamps and values of channels, by the reader of the package."""
    from aqualog.io.mdf.reader import MdfReader
    from aqualog.io.reader import ReadOptions

    with patch.dict(os.environ, POLARS_MAX_THREADS=str(threads)), MdfReader(path, ReadOptions()) as reader:
        wanted = {c.name: c for c in reader.channels()}
        return [(c.t_ns, c.values) for c in reader.read([wanted[n] for n in names])]


def read_by_asammdf(path: Path, names: list[str]) -> list[tuple[np.ndarray, np.ndarray]]:
    """The same by `select`."""
    import asammdf

    with asammdf.MDF(path) as file:
        return [(s.timestamps, s.samples) for s in file.select([(n, None, None) for n in names])]


def placed_on_one_clock(found: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """Channels in the middle between the first one's time stamps, as the package puts them on a grid."""
    from aqualog.align.grid import linear, median_period_ns, placed
    from aqualog.align.timebase import OfLast

    first = found[0][0]
    clock, period = first[:-1] + np.diff(first) // 2, median_period_ns(first)
    place = OfLast(lambda t: placed(t, clock, period))  # even points, as those of a grid
    room = np.empty((len(found), clock.size))  # one for all, as the package has it
    return [
        linear(t, x, clock, gap_ns=5 * period, period_ns=period, at=place(t), out=y)[0]
        for (t, x), y in zip(found, room, strict=True)
    ]


def on_one_clock(found: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """The same by NumPy."""
    first = found[0][0]
    clock = first[:-1] + 0.5 * np.diff(first)
    return [np.interp(clock, t, x) for t, x in found]


def inflated(path: Path) -> int:
    """Reading and inflating alone: every data block of the file."""
    import asammdf
    from deflate import zlib_decompress

    total = 0
    with asammdf.MDF(path) as file, path.open("rb", buffering=0) as handle:
        for group in file._mdf.groups:
            blocks = list(group.data_blocks)
            room = memoryview(bytearray(max(b.compressed_size for b in blocks)))
            for block in blocks:
                handle.seek(block.address)
                data = room[: handle.readinto(room[: block.compressed_size])]
                total += len(zlib_decompress(data, block.original_size) if block.block_type else data)
    return total


def unlike(a: list[np.ndarray], b: list[np.ndarray]) -> str:
    """Empty if all columns agree to 1e-9 of their size."""
    off = max(float(np.abs(x - y).max() / max(np.abs(y).max(), 1.0)) for x, y in zip(a, b, strict=True))
    return "" if off < 1e-9 and len(a) == len(b) else f"columns differ by {off:.1e}"


def mf4_rows(folder: Path, scale: Scale) -> list[Row]:
    """A wide file of 400 channels, 15 of them wanted, in three layouts; one thread and two, and a shorter file."""
    records, channels = scale.mf4
    wide = [f"c{i}" for i in range(0, channels, -(-channels // 15))]
    rows = []
    for compression, layout in LAYOUTS.items():
        path = made_mf4(folder / f"wide{compression}.mf4", records=records, channels=channels, compression=compression)
        rows += _wide_rows(path, wide, channels, layout)
        # below 200 MB asammdf takes another way
        path = made_mf4(
            folder / f"less{compression}.mf4", records=records // 3, channels=channels, compression=compression
        )
        rows.append(_wide_row(path, wide, f"same, {layout}, a third as long"))
    return [replace(row, is_once=True) for row in rows]  # a log is read once


def _wide_row(path: Path, wide: list[str], name: str) -> Row:
    return Row(
        name, "asammdf select + interp", 2.5, lambda: placed_on_one_clock(read_by_aqualog(path, wide)),
        lambda: on_one_clock(read_by_asammdf(path, wide)), unlike, conditions=f"{_size(path)}, warm, one thread",
    )  # fmt: skip


def _wide_rows(path: Path, wide: list[str], channels: int, layout: str) -> list[Row]:
    def ours(count: int = 1) -> list[np.ndarray]:
        return placed_on_one_clock(read_by_aqualog(path, wide, count))

    def peer() -> list[np.ndarray]:
        return on_one_clock(read_by_asammdf(path, wide))

    alone = "inflating (reading) alone"
    one, limit = f"{_size(path)}, warm, one thread", f"{_size(path)}, warm, one thread: the limit"
    return [
        _wide_row(path, wide, f"MF4, {len(wide)} of {channels} channels, {layout}"),
        Row(
            f"same, {layout}, without interpolation", "asammdf select", 2.5, lambda: read_by_aqualog(path, wide),
            lambda: read_by_asammdf(path, wide), lambda a, b: unlike([x for _, x in a], [x for _, x in b]),
            conditions=one,
        ),
        Row(
            f"same, {layout}, two threads", "asammdf select + interp", 4.0, lambda: ours(2), peer, unlike,
            clock="wall", conditions=f"{_size(path)}, warm",
        ),
        Row(f"same, {layout}", alone, 1.0 / 1.3, ours, lambda: inflated(path), conditions=limit, needs=("deflate",)),
        Row(
            f"{alone}, {layout}: the most that can be gained", "asammdf select + interp", 2.5, lambda: inflated(path),
            peer, conditions=limit, needs=("deflate",),
        ),
    ]  # fmt: skip


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.0f} MB"


def csv_rows(folder: Path, scale: Scale) -> list[Row]:
    """An hour of 15 signals as CSV."""
    rng = np.random.default_rng(0)
    path = folder / "hour.csv"
    n, names = round(100.0 * scale.hour_s), [f"c{i}" for i in range(15)]
    columns = np.column_stack([np.arange(n) * 0.01, *(rng.standard_normal(n).cumsum() for _ in names)])
    np.savetxt(path, columns, delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.6f")

    def ours() -> list[np.ndarray]:
        from aqualog.io.reader import ReadOptions
        from aqualog.io.tables.csv import CsvReader

        with CsvReader(path, ReadOptions()) as reader:
            found = {c.info.name: c.values for c in reader.read(reader.channels())}
        return [found[n] for n in names]

    def peer() -> list[np.ndarray]:
        import pandas as pd

        frame = pd.read_csv(path)
        return [frame[n].to_numpy() for n in names]

    def alone() -> list[np.ndarray]:
        import polars as pl

        frame = pl.read_csv(path.read_bytes())
        return [frame[n].to_numpy() for n in names]

    conditions = f"{path.stat().st_size / 1e6:.0f} MB, warm"
    return [
        Row("CSV, 1 h", "pandas read_csv", 1.8, ours, peer, unlike, "wall", conditions, needs=("pandas",)),
        Row("same", "polars read_csv alone", 1.0 / 1.3, ours, alone, unlike, "wall", f"{conditions}: the limit"),
    ]
