"""Read settings of the detectors from a thresholds file: thresholds, and the terms of joint detector 2."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from aqualog.config.file_key import FileKey
from aqualog.config.thresholds import load_thresholds
from aqualog.config.toml_file import TableFaults, load_toml
from aqualog.detect.joint_cusum import TERMS
from aqualog.detect.settings import JointCusumParams, Settings

__all__ = ["JOINT_KEYS", "joint_text", "load_settings"]

_SWITCHES = ("with_slope", "gated")
_THIRD = ("resistance", "variance")
JOINT_KEYS = (
    FileKey("joint_cusum", "third", "text", "", "resistance", "third term of (2.11): resistance, or variance as "
            "printed (E6)"),
    FileKey("joint_cusum", "with_slope", "true or false", "", "true", "whether the lost slip slope is in the sum"),
    FileKey("joint_cusum", "gated", "true or false", "", "true", "whether the sum counts only while the resistance "
            "gate is open"),
    FileKey("joint_cusum", "weights", "table", "-", "built in", f"weight of each term, 0 to 100: {', '.join(TERMS)}"),
)  # fmt: skip
"""Keys of the table `[joint_cusum]`."""
_KEYS = tuple(k.name for k in JOINT_KEYS)


def load_settings(path: Path) -> Settings:
    """Read and check a thresholds file.

    Raises
    ------
    ConfigError
        With all faults of a table in one message.
    """
    thresholds, _ = load_thresholds(path)
    document, text = load_toml(path, what="thresholds file")
    faults = TableFaults(path, text)
    table = document.get("joint_cusum", {})
    params = JointCusumParams()
    if not isinstance(table, dict):
        faults.add("joint_cusum", "joint_cusum is not a table")
        table = {}
    with faults.inside("joint_cusum"):
        for name, value in table.items():
            if name not in _KEYS:
                faults.unknown(name, _KEYS)
            elif name == "third" and value not in _THIRD:
                faults.add(name, f'third = {value!r:.40} is not one of "resistance", "variance"')
            elif name in _SWITCHES and not isinstance(value, bool):
                faults.add(name, f"{name} = {value!r:.40} is not true or false")
            elif name == "weights":
                params = _weighted(params, value, faults)
            else:
                params = replace(params, **{name: value})
    faults.raise_if_any()
    return Settings(thresholds=thresholds, joint_cusum=params)


def joint_text(params: JointCusumParams) -> str:
    """Return the table `[joint_cusum]` as TOML, empty if all values are defaults; reading it gives the same values."""
    if params == JointCusumParams():
        return ""
    weights = ", ".join(f"{t} = {float(w)!r}" for t, w in zip(TERMS, params.weights, strict=True))
    switches = "".join(f"{name} = {str(getattr(params, name)).lower()}\n" for name in _SWITCHES)
    return f'\n[joint_cusum]\nthird = "{params.third}"\n{switches}weights = {{ {weights} }}\n'


def _weighted(params: JointCusumParams, value: Any, faults: TableFaults) -> JointCusumParams:
    """Return weights by the name of their term; those that are left out stay."""
    if not isinstance(value, dict):
        faults.add("weights", "weights is not a table such as { resistance = 1.0 }")
        return params
    weights = dict(zip(TERMS, params.weights, strict=True))
    for name in value:
        if name not in TERMS:
            faults.unknown(name, TERMS)
            continue
        number = faults.number(value, name, low=0.0, high=100.0, unit="")
        if number is not None:
            weights[name] = number
    return replace(params, weights=tuple(weights[t] for t in TERMS))
