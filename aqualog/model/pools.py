"""Cars, tyres and waters that situations are drawn from: two pools without common entries."""

from __future__ import annotations

from dataclasses import dataclass, replace

from aqualog.core.vehicle import Vehicle
from aqualog.model.tyre import TYRES, Tyre

__all__ = ["SCORING_POOL", "TUNING_POOL", "Pool"]

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Pool:
    """What a situation may draw, SI.

    `depths` [m] of water and `pressures` [Pa] of tyres are lists of values; `snow`, `ice`, `wet_ice` and `damp` ranges
    of a surface's friction [-]; `seed_offset` keeps the random numbers of two pools apart.
    """

    name: str
    vehicles: tuple[Vehicle, ...]
    tyres: tuple[Tyre, ...]
    depths: tuple[float, ...]
    pressures: tuple[float, ...]
    snow: Range
    ice: Range
    wet_ice: Range
    damp: Range
    seed_offset: int


_WORN, _NEW, _WINTER = TYRES["worn_summer"], TYRES["new_summer"], TYRES["new_winter"]

TUNING_POOL = Pool(
    "tuning",
    vehicles=(
        Vehicle(
            name="saloon rwd", drivetrain="rwd", torque_split_rear=1.0, mass=1640.0, l_f=1.34, l_r=1.47, h_cg=0.53,
            track=1.56, drag_area=0.64, rolling_resistance=0.0103, slip_slope_f=31.0, slip_slope_r=31.0,
        ),
        Vehicle(
            name="hatchback fwd", drivetrain="fwd", torque_split_rear=0.0, mass=1380.0, l_f=1.06, l_r=1.56, h_cg=0.55,
            track=1.53, drag_area=0.63, rolling_resistance=0.0100, slip_slope_f=29.0, slip_slope_r=29.0,
        ),
        Vehicle(
            name="off-roader awd", drivetrain="awd", torque_split_rear=0.6, mass=2010.0, l_f=1.41, l_r=1.43, h_cg=0.64,
            track=1.63, drag_area=0.92, rolling_resistance=0.0110, r_e_f=0.354, r_e_r=0.354, r_l_f=0.345, r_l_r=0.345,
            inertia_f=1.8, inertia_r=1.8, slip_slope_f=32.0, slip_slope_r=32.0,
        ),
    ),
    tyres=(
        _WORN,
        replace(_WORN, name="half_worn_summer", tread_depth=3.2e-3, slip_slope_factor=0.97),
        replace(_WINTER, name="worn_winter", tread_depth=3.0e-3, slip_slope_factor=0.85),
    ),
    depths=(0.8e-3, 1.3e-3, 1.8e-3),
    pressures=(1.9e5, 2.3e5),
    snow=(0.20, 0.40), ice=(0.09, 0.16), wet_ice=(0.04, 0.08), damp=(0.75, 0.92), seed_offset=0,
)  # fmt: skip
"""For choosing thresholds."""

SCORING_POOL = Pool(
    "scoring",
    vehicles=(
        Vehicle(
            name="estate rwd", drivetrain="rwd", torque_split_rear=1.0, mass=1790.0, l_f=1.42, l_r=1.48, h_cg=0.56,
            track=1.58, drag_area=0.68, rolling_resistance=0.0108, r_e_f=0.322, r_e_r=0.322, r_l_f=0.314, r_l_r=0.314,
            inertia_f=1.25, inertia_r=1.25, slip_slope_f=34.0, slip_slope_r=34.0,
        ),
        Vehicle(
            name="people carrier fwd", drivetrain="fwd", torque_split_rear=0.0, mass=1650.0, l_f=1.22, l_r=1.57,
            h_cg=0.61, track=1.56, drag_area=0.80, rolling_resistance=0.0112, r_e_f=0.326, r_e_r=0.326, r_l_f=0.318,
            r_l_r=0.318, inertia_f=1.2, inertia_r=1.2, slip_slope_f=30.0, slip_slope_r=30.0,
        ),
        Vehicle(
            name="saloon awd", drivetrain="awd", torque_split_rear=0.55, mass=1810.0, l_f=1.36, l_r=1.50, h_cg=0.54,
            track=1.59, drag_area=0.66, rolling_resistance=0.0104, r_e_f=0.334, r_e_r=0.334, r_l_f=0.326, r_l_r=0.326,
            inertia_f=1.4, inertia_r=1.4, slip_slope_f=28.0, slip_slope_r=28.0,
        ),
    ),
    tyres=(
        TYRES["very_worn_summer"],
        replace(_NEW, name="used_summer", tread_depth=4.0e-3, slip_slope_factor=0.94),
        replace(_WINTER, name="used_winter", tread_depth=4.5e-3, slip_slope_factor=0.80),
    ),
    depths=(0.6e-3, 1.1e-3, 1.6e-3, 2.2e-3),
    pressures=(2.1e5, 2.5e5),
    snow=(0.20, 0.40), ice=(0.08, 0.15), wet_ice=(0.04, 0.08), damp=(0.75, 0.92), seed_offset=1_000_000,
)  # fmt: skip
"""For reported figures only."""
