"""Unknown forms: the response of a mechanism to a constant deviation, times a smooth function of one or two coordinates
of the drive, a spline whose coefficients have a Gaussian-process prior. Responses follow within 0.1 s, so a modulation
needs no further simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.words import PLACES
from aqualog.model.effects import EFFECTS

__all__ = ["ALONG", "MECHANISMS", "Basis", "Mechanism", "Shape", "basis", "shapes"]

COLUMNS = 12  # of a coordinate: humps down to about a tenth of its range
COLUMNS_TIME = 24  # of time: a step of 75 s in 300 s
COLUMNS_PAIR = 6  # per coordinate
LENGTH, LENGTH_TIME = 0.15, 0.08  # of the range over which a function may change
FEW_VALUES = 8  # a coordinate with at most so many values gets one column for each
TRIM = 0.004  # share of the samples beyond either end, where a spline would hang on single samples
LEAST_FINITE = 0.8  # share of the samples that must bear a coordinate
POINTS, POINTS_PAIR = 60, 12  # of the reported function, per coordinate
SUPPORT_S = 2.0  # [s] of drive about a point of the function, least to speak of it
NUGGET = 1e-3


class Basis(NamedTuple):
    """Columns (n, K) of functions of one or two coordinates; `prior` (K, K) covariance of their coefficients; `points`
    (k, d) where the function is reported, `at_points` (k, K) the columns there, `supported` (k,) whether the drive was
    there long enough."""

    names: tuple[str, ...]
    columns: FloatArray
    prior: FloatArray
    points: FloatArray
    at_points: FloatArray
    supported: BoolArray


class _Axis(NamedTuple):
    knots: FloatArray
    degree: int
    length: float

    @property
    def prior(self) -> FloatArray:
        """Covariance of the coefficients by where they sit (Greville), scaled to the range. (K, K)"""
        k, p = self.knots, self.degree
        x = (np.array([k[i + 1 : i + p + 1].mean() for i in range(k.size - p - 1)]) - k[0]) / (k[-1] - k[0])
        return np.asarray(np.exp(-0.5 * ((x[:, None] - x) / self.length) ** 2) + NUGGET * np.eye(x.size))


def basis(names: tuple[str, ...], z: Sequence[FloatArray], mask: BoolArray, dt: float) -> Basis | None:
    """Functions of one or two coordinates (n,) [SI], zero where unknown (NaN); None where the drive does not vary them.
    `mask` (n,): samples that count, at the step `dt` [s]."""
    known = mask & np.isfinite(np.sum(z, axis=0))
    if np.count_nonzero(known) < max(LEAST_FINITE * np.count_nonzero(mask), 2):
        return None
    if any(np.ptp(x[known]) <= 0.0 for x in z):
        return None
    along = names[0] in ("t", "position")
    size = COLUMNS_TIME if along else COLUMNS if len(z) == 1 else COLUMNS_PAIR
    length = LENGTH_TIME if along else LENGTH if len(z) == 1 else 0.25
    axes = [_axis(x[known], size, length) for x in z]
    count = POINTS if len(z) == 1 else POINTS_PAIR
    points = [
        np.unique(x[known]) if a.degree == 1 else np.linspace(a.knots[0], a.knots[-1], count)
        for a, x in zip(axes, z, strict=True)
    ]
    if any(p.size < 2 for p in points):
        return None
    at = [_splines(a, x[known]) for a, x in zip(axes, z, strict=True)]
    at_points = [_splines(a, p) for a, p in zip(axes, points, strict=True)]
    if len(z) == 1:
        columns, on_grid, prior, grid = at[0], at_points[0], axes[0].prior, points[0][:, None]
    else:
        columns = np.einsum("ni,nj->nij", at[0], at[1]).reshape(at[0].shape[0], -1)
        on_grid = np.asarray(np.kron(at_points[0], at_points[1]), dtype=np.float64)
        prior = np.asarray(np.kron(axes[0].prior, axes[1].prior), dtype=np.float64)
        grid = np.stack([g.ravel() for g in np.meshgrid(*points, indexing="ij")], axis=1)
    visited = columns.sum(axis=0) > 1e-9 * columns.shape[0]
    if visited.sum() < 2:
        return None
    placed = np.zeros((known.size, int(visited.sum())))
    placed[known] = columns[:, visited]
    # samples within one and a half grid steps of each point
    reach = [1.5 * np.diff(p).min() for p in points]
    near = np.all([np.abs(grid[:, d : d + 1] - x[known]) <= reach[d] for d, x in enumerate(z)], axis=0)
    supported = near.sum(axis=1) * dt >= SUPPORT_S
    return Basis(names, placed, prior[np.ix_(visited, visited)], grid, on_grid[:, visited], supported)


def _axis(x: FloatArray, size: int, length: float) -> _Axis:
    """Cubic splines with knots half by the visits and half evenly, or a hat at each of a few values."""
    values = np.unique(x)
    if values.size <= FEW_VALUES:
        return _Axis(np.concatenate([values[:1], values, values[-1:]]), 1, length)
    low, high = (float(q) for q in np.quantile(x, [TRIM, 1.0 - TRIM]))
    if not high > low:
        low, high = float(values[0]), float(values[-1])
    even: FloatArray = np.linspace(low, high, 257)
    share: FloatArray = 0.5 * np.searchsorted(np.sort(x), even) / x.size + 0.5 * (even - low) / (high - low)
    share = (share - share[0]) / (share[-1] - share[0])
    inner = np.interp(np.linspace(0.0, 1.0, size - 2), share, even)
    return _Axis(np.concatenate([[low] * 3, inner, [high] * 3]), 3, length)


def _splines(axis: _Axis, x: FloatArray) -> FloatArray:
    """B-splines (n, K) at points by the recursion of Cox and de Boor (K); an empty span counts as zero, and beyond the
    knots they are as at the last one."""
    knots = axis.knots
    x = np.clip(x, knots[0], knots[-1])
    last = np.flatnonzero(knots < knots[-1])[-1]  # the last span holds its right end
    span = np.minimum(np.searchsorted(knots, x, side="right") - 1, last)
    out = np.zeros((x.size, knots.size - 1))
    out[np.arange(x.size), span] = 1.0
    for k in range(1, axis.degree + 1):
        width = knots[k:] - knots[:-k]
        share = np.where(width > 0.0, (x[:, None] - knots[:-k]) / np.where(width > 0.0, width, 1.0), 0.0)
        falls = np.where(width[1:] > 0.0, 1.0 - share[:, 1:], 0.0)
        out = share[:, :-1] * out[:, :-1] + falls * out[:, 1:]
    return out


@dataclass(frozen=True, slots=True)
class Mechanism:
    """`source`: effect and place whose signature is the response, in `unit`; `usual` size of a deviation, and the one
    by which a car and its simulation differ anyway; `family`: whether there is a form is asked of all of these; `over`:
    coordinates of its functions, alone or in pairs; `scales`: the signal that it multiplies, on which what it does
    depends as well."""

    name: str
    title: str
    source: str
    unit: str
    usual: float
    allowed: float
    over: tuple[tuple[str, ...], ...]
    is_road: bool = False  # every road has it: no unknown form
    is_fast: bool = False  # it multiplies a fast signal: over time and place a smooth function is more than slow noise
    scales: str = ""
    family: str = ""
    recurs: bool = True  # several intervals and patches may be of it, as gusts are of a drag

    @property
    def is_whole(self) -> bool:
        """Whether it is of all axles at once, beside mechanisms of one axle each."""
        return self.name == f"{self.family}_all"

    def change(self, size: FloatArray) -> FloatArray:
        """Change of the effect's value that acts as this size of the response does; NaN where no value does. They are
        the same, but for what acts as one over its value, whose response is that to a step from the file's value."""
        effect = EFFECTS.get(self.source.partition("@")[0])
        if effect is None or not effect.drive.divides:
            return size
        first = effect.parameters[0]
        left = 1.0 - size / (1.0 + first.step / first.neutral)
        return 1.0 / np.where(left > 0.0, left, np.nan) - 1.0


ALONG = ("t", "position")
_STATE = (
    "v_x", "torque", "a_x", "a_y", "yaw_rate", "steer_angle", "since_braking", "water_depth", "ambient_temperature",
)  # fmt: skip


def _over(*more: str | tuple[str, str], without: str = "") -> tuple[tuple[str, ...], ...]:
    """Each coordinate of the driving state alone, without some, and others. No mechanism has both torque and
    acceleration: their difference is the residual of the balance, with its noise."""
    state = tuple((n,) for n in _STATE if n not in without.split())
    return (*state, *((n,) if isinstance(n, str) else n for n in more))


_SLIP = _over("t", without="steer_angle ambient_temperature a_x")
_RADIUS = _over("t", without="steer_angle yaw_rate a_x water_depth")
MECHANISMS: tuple[Mechanism, ...] = (
    Mechanism(
        "force", "a force on the car", "unit_force", "N", 150.0, 7.5,
        _over("position", "t", ("v_x", "torque"), ("v_x", "water_depth"), without="a_x"),
    ),
    Mechanism(
        "force_drag", "a drag with the square of speed", "aero_drag", "m^2", 0.15, 0.02,
        (("t",), ("position",)), family="force", recurs=False,
    ),
    Mechanism(
        "accelerometer", "an offset of the accelerometer", "accelerometer_bias@a_x", "m/s^2", 0.15, 0.005,
        _over("t", without="torque steer_angle yaw_rate water_depth"),
    ),
    Mechanism(
        "accelerometer_gain", "the gain of the accelerometer", "accelerometer_gain@a_x", "-", 0.05, 0.005,
        _over("t", without="torque steer_angle yaw_rate water_depth since_braking"), is_fast=True, scales="a_x",
    ),
    Mechanism(
        "torque", "the torque at the wheels", "torque_gain", "-", 0.08, 0.01,
        _over("t", without="a_x steer_angle yaw_rate water_depth"), is_fast=True,
    ),
    Mechanism("slip_f", "the slip slope of the front axle", "slip_stiffness@f", "-", 0.3, 0.035, _SLIP,
              is_fast=True, family="slip"),
    Mechanism("slip_r", "the slip slope of the rear axle", "slip_stiffness@r", "-", 0.3, 0.035, _SLIP,
              is_fast=True, family="slip"),
    Mechanism(
        "slip_all", "the slip slope of all driven wheels", "slip_stiffness", "-", 0.3, 0.035,
        _over(without="steer_angle ambient_temperature a_x water_depth"), family="slip",
    ),
    Mechanism("radius_f", "the radius of the front wheels", "tyre_radius@f", "-", 0.005, 0.00035, _RADIUS),
    Mechanism("radius_r", "the radius of the rear wheels", "tyre_radius@r", "-", 0.005, 0.00035, _RADIUS),
    *(
        Mechanism(f"radius_{w}", f"the radius of the {PLACES[w]}", f"tyre_radius@{w}", "-", 0.01, 0.0005,
                  (("v_x",), ("a_y",), ("t",)), family="radius")
        for w in WHEELS
    ),
    Mechanism(
        "velocity", "the scale of the reference velocity", "velocity_scale@v_x", "-", 0.01, 0.0005,
        _over("position", "t", without="torque steer_angle yaw_rate since_braking water_depth"),
    ),
    Mechanism(
        "lateral", "the lateral acceleration", "accelerometer_bias@a_y", "m/s^2", 0.3, 0.05,
        _over(without="a_x yaw_rate steer_angle water_depth since_braking"),
    ),
    Mechanism(
        "bank", "the bank of the road", "accelerometer_bias@a_y", "m/s^2", 0.2, 0.0, (("position",), ("t",)),
        is_road=True,
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Shape:
    """A mechanism over coordinates: `basis` (n, K) with the covariance of its coefficients at a usual size of one;
    `manner`: in words, where it is no smooth function."""

    mechanism: Mechanism
    coordinates: tuple[str, ...]
    basis: Basis
    manner: str = ""

    @property
    def key(self) -> str:
        """`force(v_x)`."""
        return f"{self.mechanism.name}({', '.join(self.coordinates)})"


def shapes(coordinates: Mapping[str, FloatArray], mask: BoolArray, dt: float, has: Sequence[str]) -> tuple[Shape, ...]:
    """All shapes that a drive can show; `has`: the sources for which there are responses."""
    made: dict[tuple[str, ...], Basis | None] = {}
    out = []
    for m in MECHANISMS:
        if m.source not in has:
            continue
        for names in m.over:
            # else a smooth function over time and place is no other than slow noise: see `elements`
            may_drift = m.is_road or m.is_fast
            if not all(n in coordinates for n in names) or (not may_drift and set(names) & set(ALONG)):
                continue
            if names not in made:
                made[names] = basis(names, [coordinates[n] for n in names], mask, dt)
            if (found := made[names]) is not None:
                out.append(Shape(m, names, found))
    return tuple(out)
