"""What water and dry roads show at a distance from full aquaplaning, as learnt from windows of drives.

`python -m tests.margin.learn` makes `emissions.toml` from simulated drives. Tyres, water and sensors of those are drawn
far wider than any one law has them, so that a car of other laws lies within the scatter.
"""

from __future__ import annotations

import tomllib
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from aqualog.detect.margin.state import Emissions

__all__ = ["emissions_of"]

VERSION = 4


@lru_cache(maxsize=3)
def _part(drivetrain: str) -> Any:
    text = files("aqualog.detect.margin").joinpath("emissions.toml").read_text(encoding="utf-8")
    head, *parts = text.split("\n[")  # a process reads one of three: the whole would take longer than a short log
    kept = tomllib.loads("\n[".join([head, *(p for p in parts if p.startswith(f"{drivetrain}]"))]))
    if kept["version"] != VERSION:
        raise ValueError(f"emissions.toml has version {kept['version']}, this filter reads {VERSION}")
    return kept[drivetrain]


def emissions_of(drivetrain: str) -> Emissions:
    """Return what is learnt of cars with this drivetrain: `rwd`, `fwd` or `awd`."""
    t = Emissions(*(np.array(_part(drivetrain)[name], dtype=np.float64) for name in Emissions._fields))
    road = t.road.astype(int)
    # four digits of each share: in hours of standing their sum would make probability, or lose it
    t.kind_prior[:] /= np.bincount(road, t.kind_prior)[road]
    return t
