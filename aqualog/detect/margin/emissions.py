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

VERSION = 2


@lru_cache(maxsize=1)
def _file() -> dict[str, Any]:
    kept = tomllib.loads(files("aqualog.detect.margin").joinpath("emissions.toml").read_text(encoding="utf-8"))
    if kept["version"] != VERSION:
        raise ValueError(f"emissions.toml has version {kept['version']}, this filter reads {VERSION}")
    return kept


def emissions_of(drivetrain: str) -> Emissions:
    """Return what is learnt of cars with this drivetrain: `rwd`, `fwd` or `awd`."""
    kept = _file()[drivetrain]
    t = Emissions(*(np.array(kept[name], dtype=np.float64) for name in Emissions._fields))
    road = t.road.astype(int)
    # four digits of each share: in hours of standing their sum would make probability, or lose it
    t.kind_prior[:] /= np.bincount(road, t.kind_prior)[road]
    return t
