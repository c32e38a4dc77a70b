"""What water and dry roads show at a distance from full aquaplaning: means and scatter, learnt from simulated drives.

`python -m tests.margin.learn` makes `emissions.toml`. Tyres, water and sensors of those drives are drawn far wider than
any one law has them, so that a car of other laws lies within the scatter.
"""

from __future__ import annotations

import tomllib
from functools import lru_cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["FEATURES", "FULL_SPEEDS", "LOG_STEP", "NODES", "Emissions", "emissions_of"]

KMH = 1.0 / 3.6  # [m/s]
LOG_STEP = 0.05
FULL_SPEEDS: FloatArray = 40.0 * KMH * np.exp(LOG_STEP * np.arange(34, dtype=np.float64))
"""Cells of the speed of full aquaplaning, 40 to 208 km/h. [m/s]"""
NODES: FloatArray = LOG_STEP * np.arange(-5.0, 17.0)
"""Log of the speed of full aquaplaning over the car's, for which the emissions are known. [-]"""
FEATURES = ("resistance", "slip_more", "slip_less", "shake_more", "shake_less")
"""Of 0.6 s, less what the same car showed on dry road: resistance, slip of the front axle less that of the rear on the
side that deviates more and on the other one, log variance of both. [-]"""
COVARIATES = 3  # 1, log of the speed, traction
VERSION = 1


class Emissions(NamedTuple):
    """Mean by covariates (nodes, features, covariates) and covariance (nodes, features, features) at each distance.

    `contact` (nodes,) [-] of the front axle; `prior` (full speeds,). `kind_` the same of kinds of road, dry and wet:
    their shares sum to 1 among the dry and among the wet; `is_wet` 0 or 1.
    """

    mean: FloatArray
    scatter: FloatArray
    contact: FloatArray
    prior: FloatArray
    kind_mean: FloatArray
    kind_scatter: FloatArray
    kind_prior: FloatArray
    is_wet: FloatArray


@lru_cache(maxsize=1)
def _file() -> dict[str, Any]:
    kept = tomllib.loads(files("aqualog.detect.margin").joinpath("emissions.toml").read_text(encoding="utf-8"))
    if kept["version"] != VERSION:
        raise ValueError(f"emissions.toml has version {kept['version']}, this filter reads {VERSION}")
    return kept


def emissions_of(drivetrain: str) -> Emissions:
    """Return what is learnt of cars with this drivetrain: `rwd`, `fwd` or `awd`."""
    kept = _file()[drivetrain]
    return Emissions(*(np.array(kept[name], dtype=np.float64) for name in Emissions._fields))
