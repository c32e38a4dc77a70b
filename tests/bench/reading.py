"""Reading logs: MF4 beside asammdf, CSV beside pandas."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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


def with_aqualog(path: Path, names: list[str]) -> list[np.ndarray]:
    """Channels on the first one's time stamps, by the reader of the package."""
    from aqualog.io.base import ReadOptions
    from aqualog.io.mdf import MdfReader

    with MdfReader(path, ReadOptions()) as reader:
        wanted = {c.name: c for c in reader.channels()}
        found = reader.read([wanted[n] for n in names])
    grid = found[0].t_ns
    return [np.interp(grid, c.t_ns, c.values) for c in found]


def with_asammdf(path: Path, names: list[str]) -> list[np.ndarray]:
    """The same by `select` and `np.interp`."""
    import asammdf

    with asammdf.MDF(path) as file:
        found = file.select([(n, None, None) for n in names])
        grid = found[0].timestamps
        return [np.interp(grid, s.timestamps, s.samples) for s in found]


def inflated(path: Path) -> int:
    """Reading and inflating alone: every data block of the file."""
    import asammdf
    from deflate import zlib_decompress

    total = 0
    with asammdf.MDF(path) as file, path.open("rb") as handle:
        for group in file._mdf.groups:
            for block in list(group.data_blocks):
                handle.seek(block.address)
                data = handle.read(block.compressed_size)
                total += len(zlib_decompress(data, block.original_size) if block.block_type else data)
    return total


def unlike(a: list[np.ndarray], b: list[np.ndarray]) -> str:
    """Empty if all columns agree to 1e-9 of their size."""
    off = max(float(np.abs(x - y).max() / max(np.abs(y).max(), 1.0)) for x, y in zip(a, b, strict=True))
    return "" if off < 1e-9 and len(a) == len(b) else f"columns differ by {off:.1e}"


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Threads that the reader takes, within."""
    before = os.environ.get("POLARS_MAX_THREADS")
    os.environ["POLARS_MAX_THREADS"] = str(count)
    try:
        yield
    finally:
        if before is None:
            del os.environ["POLARS_MAX_THREADS"]
        else:
            os.environ["POLARS_MAX_THREADS"] = before


def mf4_rows(folder: Path, scale: Scale) -> list[Row]:
    """A wide file of 400 channels, 15 of them wanted, in three layouts; one thread and two."""
    records, channels = scale.mf4
    wide = [f"c{i}" for i in range(0, channels, -(-channels // 15))]
    rows = []
    for compression, layout in LAYOUTS.items():
        path = made_mf4(folder / f"wide{compression}.mf4", records=records, channels=channels, compression=compression)
        size = f"{path.stat().st_size / 1e6:.0f} MB {layout}"

        def ours(path: Path = path, count: int = 1) -> list[np.ndarray]:
            with threads(count):
                return with_aqualog(path, wide)

        def peer(path: Path = path) -> list[np.ndarray]:
            return with_asammdf(path, wide)

        rows.append(Row(
            f"MF4, {len(wide)} of {channels} channels, {layout}", "asammdf select + interp", 2.5, ours, peer, unlike,
            conditions=f"{size}, warm, one thread",
        ))  # fmt: skip
        rows.append(Row(
            f"same, {layout}, two threads", "asammdf select + interp", 4.0, lambda ours=ours: ours(count=2), peer,
            unlike, clock="wall", conditions=f"{size}, warm",
        ))  # fmt: skip
        rows.append(Row(
            f"same, {layout}", "inflating (reading) alone", 1.0 / 1.3, ours, lambda path=path: inflated(path),
            conditions=f"{size}, warm, one thread: the limit", needs=("deflate",),
        ))  # fmt: skip
    return rows


def csv_rows(folder: Path, scale: Scale) -> list[Row]:
    """An hour of 15 signals as CSV."""
    rng = np.random.default_rng(0)
    path = folder / "hour.csv"
    n, names = round(100.0 * scale.hour_s), [f"c{i}" for i in range(15)]
    columns = np.column_stack([np.arange(n) * 0.01, *(rng.standard_normal(n).cumsum() for _ in names)])
    np.savetxt(path, columns, delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.6f")

    def ours() -> list[np.ndarray]:
        from aqualog.io.base import ReadOptions
        from aqualog.io.csv import CsvReader

        with CsvReader(path, ReadOptions()) as reader:
            found = {c.info.name: c.values for c in reader.read(reader.channels())}
        return [found[n] for n in names]

    def peer() -> list[np.ndarray]:
        import pandas as pd

        frame = pd.read_csv(path)
        return [frame[n].to_numpy() for n in names]

    return [Row(
        "CSV, 1 h", "pandas read_csv", 1.8, ours, peer, unlike, clock="wall", needs=("pandas",),
        conditions=f"{path.stat().st_size / 1e6:.0f} MB, warm",
    )]  # fmt: skip
