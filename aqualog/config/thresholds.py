"""Read and write thresholds files: TOML with the tables `[thresholds]`, `[rivals]` and `[joint_cusum]`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from aqualog.config.reader import Key, Table, read
from aqualog.core.errors import ConfigError
from aqualog.detect.detector import JointCusumParams, Settings
from aqualog.detect.joint_cusum import TERMS
from aqualog.detect.registry import BY_NAME, DETECTORS, RIVALS
from aqualog.detect.thresholds import Thresholds

__all__ = ["JOINT_KEYS", "joint_text", "load_settings", "load_thresholds", "thresholds_text"]

_TABLES = ("thresholds", "rivals", "joint_cusum")
_VALUE = Key("", "", "number", "", "", "a threshold, above 0", 0.0, 1e6)
_WEIGHT = Key("", "", "number", "", "", "a weight", 0.0, 100.0)
_SWITCHES = ("with_slope", "gated")
_THIRD = ("resistance", "variance")
JOINT_KEYS = (
    Key("joint_cusum", "third", "text", "", "resistance", "third term of (2.11): resistance, or variance as "
            "printed (E6)"),
    Key("joint_cusum", "with_slope", "true or false", "", "true", "whether the lost slip slope is in the sum"),
    Key("joint_cusum", "gated", "true or false", "", "true", "whether the sum counts only while the resistance "
            "gate is open"),
    Key("joint_cusum", "weights", "table", "-", "built in", f"weight of each term, 0 to 100: {', '.join(TERMS)}"),
)  # fmt: skip
"""Keys of the table `[joint_cusum]`."""
_KEYS = tuple(k.name for k in JOINT_KEYS)


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
    file = read(path, "thresholds file")
    file.check_names(*_TABLES)
    own = _numbers(file.table("thresholds"), DETECTORS)
    rivals = _numbers(file.table("rivals"), RIVALS)
    for name, value in own.items():
        try:
            Thresholds(**{name: value})
        except ConfigError as error:
            file.table("thresholds").add(name, error.line())
    file.faults.raise_if_any()
    return Thresholds(**own), rivals


def load_settings(path: Path) -> Settings:
    """Read and check a thresholds file: thresholds, and the terms of joint detector 2.

    Raises
    ------
    ConfigError
        With all faults of a table in one message.
    """
    thresholds, _ = load_thresholds(path)
    file = read(path, "thresholds file")
    table = file.table("joint_cusum")
    params = JointCusumParams()
    table.check_names(*_KEYS)
    if "third" in table:
        third: Any = table.choice("third", _THIRD, params.third)
        params = replace(params, third=third)
    switches: dict[str, Any] = {}
    for name in (n for n in _SWITCHES if n in table):
        value = table.get(name)
        if isinstance(value, bool):
            switches[name] = value
        else:
            table.add(name, f"{name} = {value!r:.40} is not true or false")
    weights = dict(zip(TERMS, params.weights, strict=True))
    weights |= table.table("weights").numbers(dict.fromkeys(TERMS, _WEIGHT))
    file.faults.raise_if_any()
    return Settings(
        thresholds=thresholds, joint_cusum=replace(params, **switches, weights=tuple(weights[t] for t in TERMS))
    )


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


def _numbers(table: Table, known: Iterable[str]) -> dict[str, float]:
    found = table.numbers(dict.fromkeys(known, _VALUE))
    for name, value in found.items():
        if value == 0.0:
            table.add(name, f"{name} = 0 is not above 0")
    return {name: value for name, value in found.items() if value}


def joint_text(params: JointCusumParams) -> str:
    """Return the table `[joint_cusum]` as TOML, empty if all values are defaults; reading it gives the same values."""
    if params == JointCusumParams():
        return ""
    weights = ", ".join(f"{t} = {float(w)!r}" for t, w in zip(TERMS, params.weights, strict=True))
    switches = "".join(f"{name} = {str(getattr(params, name)).lower()}\n" for name in _SWITCHES)
    return f'\n[joint_cusum]\nthird = "{params.third}"\n{switches}weights = {{ {weights} }}\n'
