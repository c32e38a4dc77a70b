"""Labels files: CSV with `start_s,end_s,effect,wheel`."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from aqualog.config.table_faults import LineFaults
from aqualog.errors import ConfigError
from aqualog.evaluate.labels import Label, joined
from aqualog.notation import WHEELS

__all__ = ["load_labels"]

_COLUMNS = ("start_s", "end_s", "effect", "wheel")
_LARGEST = 64 * 2**20  # [byte]


def load_labels(path: Path) -> tuple[Label, ...]:
    """Read and check a labels file.

    `start_s` and `end_s` [s] count from the log's first sample; `effect` is `full`, `partial`, `water`, the name of a
    single detector, or any other text (a surface, a situation), which serves the confusion table only; `wheel` is
    `fl`, `fr`, `rl`, `rr` or empty. A heading without lines says that there was no water.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    rows = read_csv(path, what="labels file")
    faults = LineFaults(path)
    heading = [name.strip() for name in rows[0]] if rows else []
    for name in heading:
        if name not in _COLUMNS:
            faults.unknown(1, "column", name, _COLUMNS)
    for name in _COLUMNS[:3]:
        if name not in heading:
            faults.add(1, f"no column {name}; expected {','.join(_COLUMNS)}")
    faults.raise_if_any()
    labels: list[Label] = []
    for line, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) > len(heading):
            faults.add(line, f"{len(row)} cells, the heading has {len(heading)}")
            continue
        label = _label(dict(zip(heading, (c.strip() for c in row), strict=False)), line, faults)
        if label is not None:
            labels.append(label)
    faults.raise_if_any()
    return _merged(labels)


def read_csv(path: Path, *, what: str) -> list[list[str]]:
    """Rows of a small CSV file.

    Raises
    ------
    ConfigError
        If it cannot be read.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise ConfigError(f"{what} is larger than {_LARGEST // 2**20} MiB", where=str(path))
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise ConfigError(f"{what} not found", where=str(path), hint="check the path") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{what} is not UTF-8 text", where=str(path), expected="a CSV file") from error
    except OSError as error:
        raise ConfigError(f"{what} cannot be read: {error.strerror}", where=str(path)) from error
    try:
        return list(csv.reader(io.StringIO(text), strict=True))
    except csv.Error as error:
        raise ConfigError(f"{what} is not CSV: {error}", where=str(path)) from error


def _label(cells: dict[str, str], line: int, faults: LineFaults) -> Label | None:
    start = faults.number(line, "start_s", cells.get("start_s", ""), low=-1e7, high=1e7, unit="s")
    end = faults.number(line, "end_s", cells.get("end_s", ""), low=-1e7, high=1e7, unit="s")
    effect, wheel = cells.get("effect", ""), cells.get("wheel", "")
    if not effect.isprintable() or not effect:
        faults.add(line, "no effect; expected full, partial, water, a detector or a surface")
    if wheel and wheel not in WHEELS:
        faults.unknown(line, "wheel", wheel, WHEELS)
    if start is None or end is None or not effect:
        return None
    if not end > start:
        faults.add(line, f"end_s = {end:g} is not after start_s = {start:g}")
        return None
    return Label(max(start, 0.0), end, effect, wheel or None)


def _merged(labels: list[Label]) -> tuple[Label, ...]:
    """Overlapping stretches of the same effect on the same wheel become one, so that none is counted twice."""
    keys = dict.fromkeys((x.effect, x.wheel) for x in labels)
    return tuple(
        Label(a, b, effect, wheel)
        for effect, wheel in keys
        for a, b in joined([(x.start_s, x.end_s) for x in labels if (x.effect, x.wheel) == (effect, wheel)], 0.0)
        if math.isfinite(b)
    )
