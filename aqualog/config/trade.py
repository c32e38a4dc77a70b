"""Read thresholds of the tyre tests, and coefficients of the wet grip index (TOML)."""

from __future__ import annotations

from pathlib import Path

from aqualog.config.reader import read
from aqualog.trade.grip import COEFFICIENT_KEYS, Coefficients
from aqualog.trade.limits import Limits, described

__all__ = ["load_coefficients", "load_limits"]


def load_limits(path: Path) -> Limits:
    """Read and check a file of thresholds: those of `aqualog/trade/limits.toml` that differ, such as

    `[straight]` and below it `yaw_rate = 0.08`.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    file = read(path, "limits file")
    tables = tuple(dict.fromkeys(d.table for d in described()))
    file.check_names(*tables)
    given: dict[str, float] = {}
    for name in tables:
        keys = {d.name: d for d in described() if d.table == name}
        given |= {f"{name}.{k}": v for k, v in file.table(name).numbers(keys).items()}
    for low, high in (("depth_low", "depth_high"), ("texture_low", "texture_high")):
        own = Limits.of(given).braking
        if getattr(own, low) > getattr(own, high):
            file.table("braking").add(low, f"braking.{low} is above braking.{high}")
    file.faults.raise_if_any()
    return Limits.of(given)


def load_coefficients(path: Path) -> Coefficients:
    """Read and check the coefficients of the wet grip index; all of `COEFFICIENT_KEYS` must be given.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    file = read(path, "coefficients file")
    found = file.numbers(COEFFICIENT_KEYS, "name")
    name = file.get("name", path.stem)
    if not isinstance(name, str) or not name.isprintable():
        file.add("name", "name is not one line of text")
    for key in COEFFICIENT_KEYS.values():
        if key.name not in file:
            file.add(key.name, f"{key.name} is missing: {key.meaning} [{key.unit}]")
    file.faults.raise_if_any()
    return Coefficients(str(name), **found)
