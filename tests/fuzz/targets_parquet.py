"""Parquet: its checksums are not looked at by the library; a file is read or refused.

A few lengths make the library end the process, which those who call aqualog are kept from by a process of its own.
"""

from functools import cache
from io import BytesIO

import numpy as np
import polars as pl

from tests.fuzz.readers import outcome
from tests.fuzz.registry import Target, add


@cache
def seeds() -> dict[str, bytes]:
    """Small sound files: each compression, times of several kinds."""
    t = np.arange(100) * 0.01
    frames = {
        "zstd": pl.DataFrame({"t": t, "omega_fl [rad/s]": t * 3, "on_water": t > 0.5}),
        "snappy": pl.DataFrame({"time": pl.Series(np.arange(100) * 10).cast(pl.Datetime("ms")), "v_x": t * 3}),
        "uncompressed": pl.DataFrame({"t": np.arange(100), "v_x": [None, 1.5] * 50, "note": ["wet", "dry"] * 50}),
        "lz4": pl.DataFrame({"t": t, "v": t * 2, "w": [[x, 2 * x] for x in t], "s": [{"a": x, "b": 1} for x in t]}),
    }
    return {name: _written(frame, name) for name, frame in frames.items()}


def _written(frame: pl.DataFrame, compression: str) -> bytes:
    file = BytesIO()
    frame.write_parquet(file, compression=compression, row_group_size=40)
    return file.getvalue()


def one(data: bytes) -> None:
    """Read a file with this content."""
    for c in outcome(data, "a.parquet").channels:
        assert not np.isinf(c.values).any(), f"{c.info.path} is infinite"


add("parquet", Target("Parquet", seeds, one, may_end=True))
