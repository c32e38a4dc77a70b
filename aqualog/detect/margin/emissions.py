"""What water and dry roads show at a distance from full aquaplaning: read, and learnt, from windows of drives.

`python -m tests.margin.learn` makes `emissions.toml` from simulated drives. Tyres, water and sensors of those are drawn
far wider than any one law has them, so that a car of other laws lies within the scatter.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.detect.margin.state import COVARIATES, FEATURES, NODES, Emissions, FilterParams

__all__ = ["emissions_of", "kinds_of", "laws_of", "text_of"]

VERSION = 1
BANDWIDTH = 0.06  # [-] of the log ratio
KINDS = 8  # of dry road, as many of wet, and of other surfaces
LEAST = 1e-3  # [-] of a variance
_N = len(FEATURES)
_TAIL = FilterParams._field_defaults["tail"]


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


def laws_of(x: FloatArray, z: FloatArray, where: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean by covariates and covariance at each node: local regression by Student's law.

    Parameters
    ----------
    x : array (n, features)
    z : array (n, covariates)
    where : array (n,)
        Log of the speed of full aquaplaning over the car's. [-]

    Returns
    -------
    mean : array (nodes, features, covariates)
    scatter : array (nodes, features, features)
    """
    mean, scatter = np.empty((NODES.size, _N, COVARIATES)), np.empty((NODES.size, _N, _N))
    for k, node in enumerate(NODES):
        away = where - node
        near = np.exp(-0.5 * (away / BANDWIDTH) ** 2)
        form = np.column_stack([z, away])
        w = near
        for _ in range(6):
            fit = np.linalg.solve(
                form.T @ (w[:, None] * form) + LEAST * np.eye(COVARIATES + 1), form.T @ (w[:, None] * x)
            )
            left = x - form @ fit
            S = left.T @ (w[:, None] * left) / near.sum() + LEAST * np.eye(_N)
            w = near * (_TAIL + _N) / (_TAIL + np.einsum("ni,ij,nj->n", left, np.linalg.inv(S), left))
        mean[k], scatter[k] = fit[:COVARIATES].T, S
    return mean, scatter


def kinds_of(x: FloatArray, z: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means, covariances and shares of `KINDS` kinds of windows (n, features): a mixture of Student's laws.

    The means depend on covariates z (n, 1 or more), the first of which is 1.
    """
    mean = np.zeros((KINDS, _N, COVARIATES))
    mean[:, :, 0] = x[rng.choice(len(x), KINDS, replace=False)]
    used = z.shape[1]
    S = np.tile(np.cov(x.T), (KINDS, 1, 1))
    share = np.full(KINDS, 1.0 / KINDS)
    for _ in range(150):
        left = x - z @ mean[:, :, :used].transpose(0, 2, 1)
        square = np.einsum("kni,kij,knj->kn", left, np.linalg.inv(S), left)
        logs = np.log(share)[:, None] - 0.5 * np.linalg.slogdet(S)[1][:, None]
        logs = logs - 0.5 * (_TAIL + _N) * np.log1p(square / _TAIL)
        r = np.exp(logs - logs.max(axis=0))
        r /= r.sum(axis=0)
        w = r * (_TAIL + _N) / (_TAIL + square)
        share = r.mean(axis=1)
        for k, form in enumerate(w[:, :, None] * z):
            mean[k, :, :used] = np.linalg.solve(form.T @ z + LEAST * np.eye(used), form.T @ x).T
        left = x - z @ mean[:, :, :used].transpose(0, 2, 1)
        S = np.einsum("kn,kni,knj->kij", w, left, left) / r.sum(axis=1)[:, None, None] + LEAST * np.eye(_N)
    return mean, S, share


def _text(x: Any) -> str:
    return f"{float(x):.4g}" if np.ndim(x) == 0 else "[" + ", ".join(_text(y) for y in x) + "]"


def text_of(found: Mapping[str, Emissions], note: str) -> Iterator[str]:
    """Lines of the file of emissions, by drivetrain."""
    yield f"# {note}"
    yield f"version = {VERSION}"
    for drivetrain, tables in found.items():
        yield f"\n[{drivetrain}]"
        for name, x in tables._asdict().items():
            yield f"{name} = {_text(x)}"
