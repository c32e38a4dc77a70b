"""Read and write thresholds files: TOML with the tables `[thresholds]`, `[rivals]` and `[joint_cusum]`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from aqualog.config.toml_file import TableFaults, load_toml
from aqualog.core.errors import ConfigError
from aqualog.detect.registry import BY_NAME, DETECTORS, RIVALS
from aqualog.detect.thresholds import Thresholds

__all__ = ["load_thresholds", "thresholds_text"]

_TABLES = ("thresholds", "rivals", "joint_cusum")  # the last is read by config.settings
_HIGHEST = 1e6


def load_thresholds(path: Path) -> tuple[Thresholds, dict[str, float]]:
    """Read and check a thresholds file.

    Returns
    -------
    thresholds : Thresholds
        Those that are left out keep their default.
    rivals : dict name -> float
        Only those that are given.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    document, text = load_toml(path, what="thresholds file")
    faults = TableFaults(path, text)
    for name in document:
        if name not in _TABLES:
            faults.unknown(name, _TABLES)
    own = _numbers(document, "thresholds", list(DETECTORS), faults)
    rivals = _numbers(document, "rivals", list(RIVALS), faults)
    for name, value in own.items():
        try:
            Thresholds(**{name: value})
        except ConfigError as error:
            with faults.inside("thresholds"):
                faults.add(name, error.line())
    faults.raise_if_any()
    return Thresholds(**own), rivals


def thresholds_text(
    thresholds: Thresholds, rivals: Mapping[str, float] | None = None, *, comments: Iterable[str] = ()
) -> str:
    """Return the TOML text of thresholds, with their units and meanings; reading it again gives the same values."""
    lines = [f"# {''.join(c if c.isprintable() else ' ' for c in text)}" for text in comments]
    lines.append("[thresholds]")
    lines += [_line(name, value, BY_NAME[name].meaning) for name, value in thresholds.items()]
    if rivals:
        lines += ["", "[rivals]", *(_line(name, value, RIVALS[name].title) for name, value in rivals.items())]
    return "\n".join(lines) + "\n"


def _line(name: str, value: float, words: str) -> str:
    unit = BY_NAME[name].unit
    return f"{name} = {float(value)!r}  # {words}" + ("" if unit == "-" else f" [{unit}]")


def _numbers(document: Mapping[str, Any], table: str, known: list[str], faults: TableFaults) -> dict[str, float]:
    values = document.get(table, {})
    if not isinstance(values, dict):
        faults.add(table, f"{table} is not a table")
        return {}
    found: dict[str, float] = {}
    with faults.inside(table):
        for name in values:
            if name not in known:
                faults.unknown(name, known)
                continue
            value = faults.number(values, name, low=0.0, high=_HIGHEST, unit="")
            if value == 0.0:
                faults.add(name, f"{name} = 0 is not above 0")
            elif value is not None:
                found[name] = value
    return found
