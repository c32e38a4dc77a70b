"""Labels files: CSV with `start_s,end_s,effect,wheel`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from aqualog.config.reader import Faults, Key, Row, read_csv, reads_as_number
from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.evaluate.labels import Label, joined

__all__ = ["LABEL_KEYS", "load_labels"]

LABEL_KEYS = (
    Key("", "start_s", "number", "s", "", "begin, from the log's first sample; must be given",
        -1e7, 1e7),
    Key("", "end_s", "number", "s", "", "end; what runs beyond the log is cut; must be given", -1e7, 1e7),
    Key("", "effect", "text", "", "", "full, partial, water, a detector's name, a surface or a situation; must be "
            "given"),
    Key("", "wheel", "text", "", "", "fl, fr, rl, rr; empty: the car"),
)  # fmt: skip
"""Columns of a labels file."""
_COLUMNS = tuple(k.name for k in LABEL_KEYS)
_EMPTY = dict.fromkeys(_COLUMNS, "")
_NUMBERS = {k.name: k for k in LABEL_KEYS if k.kind == "number"}


def load_labels(path: Path) -> tuple[Label, ...]:
    """Read and check a labels file.

    `start_s` and `end_s` [s] count from the log's first sample. `effect` is `full`, `partial`, `water`, the name of a
    single detector, or any other text (a surface, a situation), which only enters the confusion table. `wheel` is `fl`,
    `fr`, `rl`, `rr` or empty. A heading without lines means that there was no water. Full aquaplaning is partial
    aquaplaning too, as in the simulated truth: its stretches are added to those of `partial`.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    rows = read_csv(path, "labels file")
    faults = Faults(path)
    first = Row({}, faults, 1)
    heading = [name.strip() for name in rows[0]] if rows else []
    _check_form(rows[0] if rows else [], path)
    for name in dict.fromkeys(n for n in heading if heading.count(n) > 1):
        first.add("", f"column {name} stands twice")
    for name in dict.fromkeys(heading):
        if name not in _COLUMNS:
            first.unknown(name, _COLUMNS, what="column")
    for name in _COLUMNS[:3]:
        if name not in heading:
            first.add("", f"no column {name}; expected {','.join(_COLUMNS)}")
    faults.raise_if_any()
    labels: list[Label] = []
    for line, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        named = dict(zip(heading, (c.strip() for c in row), strict=False))
        cells = Row({**_EMPTY, **named}, faults, line)
        if len(row) > len(heading):
            cells.add("", f"{len(row)} cells, the heading has {len(heading)}")
            continue
        label = _label(cells)
        if label is not None:
            labels.append(label)
    faults.raise_if_any()
    return _merged(labels)


_SYNONYMS = {
    "full_aquaplaning": "full", "total_aquaplaning": "full", "full_hydroplaning": "full",
    "partial_aquaplaning": "partial", "partial_hydroplaning": "partial",
    # aquaplaning of unknown extent is at least partial
    "aquaplaning": "partial", "hydroplaning": "partial", "aquaplane": "partial",
    "wet": "water", "on_water": "water", "lane": "water",
}  # fmt: skip


def _check_form(first: list[str], path: Path) -> None:
    """Refuse a table of another form in one message: it would have a fault in every line."""
    line = ",".join(first)
    separator = next((s for s in (";", "\t") if s in line and "start_s" in line), None)
    expected = ",".join(_COLUMNS)
    if separator is not None or (";" in line and reads_as_number(line.split(";", maxsplit=1)[0].replace(",", "."))):
        told = "tabs" if separator == "\t" else "semicolons"
        raise ConfigError(
            f"labels file has {told} between its cells", where=f"{path}: line 1",
            expected=f"commas, and points in numbers: {expected}",
        )  # fmt: skip
    if first and reads_as_number(first[0]):
        raise ConfigError("labels file has no heading", where=f"{path}: line 1", expected=expected)


def _label(cells: Row) -> Label | None:
    start, end = (cells.number(n, k) for n, k in _NUMBERS.items())
    effect, wheel = cells.get("effect", ""), cells.get("wheel", "")
    if not effect.isprintable() or not effect:
        cells.add("", "no effect; expected full, partial, water, a detector or a surface")
    if wheel and wheel not in WHEELS:
        cells.add("", f'unknown wheel "{wheel[:60]}"; expected {", ".join(WHEELS)} or nothing')
    if start is None or end is None or not effect:
        return None
    if not end > start:
        cells.add("", f"end_s = {end:g} is not after start_s = {start:g}")
        return None
    if end <= 0.0:
        cells.add("", f"end_s = {end:g} is not after the log's first sample, from which labels count")
        return None
    return Label(max(start, 0.0), end, _SYNONYMS.get(effect.lower().replace(" ", "_"), effect), wheel or None)


def _merged(labels: list[Label]) -> tuple[Label, ...]:
    """Join overlapping stretches of the same effect on the same wheel, so that none counts twice.

    Full aquaplaning joins partial: of the car, or of wheels, as far as the file's own partial labels are such.
    """
    of_wheels = {x.wheel is not None for x in labels if x.effect == "partial"}
    full = [x for x in labels if x.effect == "full" and (not of_wheels or (x.wheel is not None) in of_wheels)]
    labels = [*labels, *(replace(x, effect="partial") for x in full)]
    keys = dict.fromkeys((x.effect, x.wheel) for x in labels)
    return tuple(
        Label(a, b, effect, wheel)
        for effect, wheel in keys
        for a, b in joined([(x.start_s, x.end_s) for x in labels if (x.effect, x.wheel) == (effect, wheel)], 0.0)
        if math.isfinite(b)
    )
