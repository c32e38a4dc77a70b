"""Parquet: its checksums are not looked at by the library; a file is read or refused."""

from functools import cache
from io import BytesIO

import numpy as np
import polars as pl

from tests.fuzz.damaged_files import read

__all__ = ["one", "seeds"]


@cache
def seeds() -> tuple[bytes, ...]:
    """Small sound files: each compression, times of several kinds."""
    t = np.arange(100) * 0.01
    frames = {
        "zstd": pl.DataFrame({"t": t, "omega_fl [rad/s]": t * 3, "on_water": t > 0.5}),
        "snappy": pl.DataFrame({"time": pl.Series(np.arange(100) * 10).cast(pl.Datetime("ms")), "v_x": t * 3}),
        "uncompressed": pl.DataFrame({"t": np.arange(100), "v_x": [None, 1.5] * 50, "note": ["wet", "dry"] * 50}),
    }
    return tuple(_written(frame, compression) for compression, frame in frames.items())


def _written(frame: pl.DataFrame, compression: str) -> bytes:
    file = BytesIO()
    frame.write_parquet(file, compression=compression)
    return file.getvalue()


def one(data: bytes) -> None:
    """Read a file with this content."""
    for c in read(data, "a.parquet"):
        assert not np.isinf(c.values).any()
