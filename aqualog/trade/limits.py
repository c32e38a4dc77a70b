"""Thresholds of the tyre tests as records. The numbers, with units and sources, stand in `limits.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

__all__ = ["BrakingLimits", "CurveLimits", "Limit", "Limits", "SetLimits", "StraightLimits", "defaults", "described"]


@dataclass(frozen=True, slots=True)
class Limit:
    """One threshold as `limits.toml` describes it: its default with unit, bounds, meaning and source."""

    table: str
    name: str
    value: float
    unit: str
    low: float
    high: float
    meaning: str
    source: str

    @property
    def path(self) -> str:
        """`straight.slip`."""
        return f"{self.table}.{self.name}"


@dataclass(frozen=True, slots=True)
class StraightLimits:
    """Thresholds of the straight test; units and meanings: table `straight` of `limits.toml`."""

    slip: float
    slip_mean: float
    slip_lasts: float
    dry: float
    dry_gap: float
    entry: float
    a_x_window: float
    a_x_share: float
    yaw_rate: float
    shift: float
    torque_cut: float
    a_x_least: float
    lost: float
    v_x_share: float

    @property
    def level(self) -> str:
        """`15 %`: the slip as people say it."""
        return f"{100.0 * self.slip:g} %"

    @property
    def speed_name(self) -> str:
        """`v_15`: name of the speed at that slip."""
        return f"v_{100.0 * self.slip:02g}"


@dataclass(frozen=True, slots=True)
class CurveLimits:
    """Thresholds of the curve test; units and meanings: table `curve` of `limits.toml`."""

    dry: float
    a_y_mean: float
    steer: float
    v_change: float
    a_y_share: float
    least_time: float
    a_y_zero: float
    passes: float
    speed_step: float


@dataclass(frozen=True, slots=True)
class BrakingLimits:
    """Thresholds of the braking test; units and meanings: table `braking` of `limits.toml`."""

    decel_least: float
    dip: float
    dip_lasts: float
    yaw_rate: float
    lost: float
    bfc_share: float
    bfc_most: float
    locked: float
    depth_low: float
    depth_high: float
    temperature: float
    temperature_reference: float
    texture_low: float
    texture_high: float
    runs: float
    cv: float


@dataclass(frozen=True, slots=True)
class SetLimits:
    """What is asked of a set; units and meanings: table `set` of `limits.toml`."""

    cv: float
    runs: float
    depth_share: float


@dataclass(frozen=True, slots=True)
class Limits:
    """All thresholds; `changed` names those that a file of the user has set, such as `straight.slip`."""

    straight: StraightLimits
    curve: CurveLimits
    braking: BrakingLimits
    set: SetLimits
    changed: frozenset[str] = frozenset()

    @staticmethod
    def of(values: Mapping[str, float] | None = None) -> Limits:
        """Return the defaults, with `values` by path (`straight.slip`) in their place."""
        given = dict(values or {})
        own = {d.path: given.get(d.path, d.value) for d in described()}

        def table(name: str) -> dict[str, float]:
            return {d.name: own[d.path] for d in described() if d.table == name}

        return Limits(
            StraightLimits(**table("straight")), CurveLimits(**table("curve")), BrakingLimits(**table("braking")),
            SetLimits(**table("set")), frozenset(given),
        )  # fmt: skip

    def value(self, limit: Limit) -> float:
        """Return the value in use of a threshold."""
        return float(getattr(getattr(self, limit.table), limit.name))


@cache
def described() -> tuple[Limit, ...]:
    """Return all thresholds in the order of `limits.toml`."""
    text = files("aqualog.trade").joinpath("limits.toml").read_text(encoding="utf-8")
    return tuple(Limit(t, n, **given) for t, table in tomllib.loads(text).items() for n, given in table.items())


@cache
def defaults() -> Limits:
    """Return the thresholds of `limits.toml`."""
    return Limits.of()
