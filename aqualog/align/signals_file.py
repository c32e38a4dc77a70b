"""Write signals as the bytes of one Parquet file, and read them back, the same to the bit."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import polars as pl

from aqualog.core.records import Origin, Quality, Signals, TimeFaults

__all__ = ["files_of", "from_parquet", "to_parquet"]

_METADATA_KEY = "aqualog_signals"
_DAMAGED = (ValueError, KeyError, TypeError, OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException)


def to_parquet(signals: Signals) -> io.BytesIO:
    """Return the frame as Parquet; the rest of the record stands as JSON in its metadata."""
    records = {
        "dt_ns": signals.dt_ns,
        "start_ns": signals.start_ns,
        "files": signals.files,
        "origins": [asdict(o) for o in signals.origins.values()],
        "quality": asdict(signals.quality),
    }
    buffer = io.BytesIO()
    metadata = {_METADATA_KEY: json.dumps(records, default=lambda x: x.item())}  # numpy's numbers as Python's own
    # lz4: half the bytes of plain numbers, and both ways quicker than reading, writing and checking those
    signals.frame.write_parquet(buffer, compression="lz4", statistics=False, metadata=metadata)
    return buffer


def from_parquet(data: bytes) -> Signals:
    """Read signals from such bytes.

    Raises
    ------
    ValueError
        If the bytes hold no signals.
    """
    try:
        records = _records(io.BytesIO(data))
        frame = pl.read_parquet(io.BytesIO(data), hive_partitioning=False)
        origins = {o["symbol"]: Origin(**{**o, "faults": TimeFaults(**o["faults"])}) for o in records["origins"]}
        q = records["quality"]
        quality = Quality(**{**q, "faults": TimeFaults(**q["faults"]), "notes": tuple(q["notes"])})
        return Signals(frame, records["dt_ns"], records["start_ns"], origins, quality, tuple(records["files"]))
    except _DAMAGED as error:
        raise ValueError(f"no signals ({error})") from error


def files_of(path: Path) -> tuple[str, ...]:
    """Return the names of the files that the signals in a Parquet file come from.

    Raises
    ------
    ValueError
        If the file holds no signals.
    """
    try:
        return tuple(str(n) for n in _records(path)["files"])
    except _DAMAGED as error:
        raise ValueError(f"no signals ({error})") from error


def _records(source: Path | io.BytesIO) -> Any:
    return json.loads(pl.read_parquet_metadata(source)[_METADATA_KEY])
