"""Cars of the blind world; their vehicle files are true, all keys given."""

from __future__ import annotations

from aqualog.core.vehicle import KEYS, Vehicle

__all__ = ["CARS"]

_GIVEN = frozenset({"name", "drivetrain", *KEYS})


def _car(name: str, drivetrain: str, split: float, **keys: float) -> Vehicle:
    return Vehicle(name=name, drivetrain=drivetrain, torque_split_rear=split, given=_GIVEN, **keys)  # type: ignore[arg-type]


CARS: dict[str, Vehicle] = {
    "sedan_rwd": _car(
        "sedan RWD", "rwd", 1.0, mass=1680.0, l_f=1.33, l_r=1.47, h_cg=0.54, track=1.55, drag_area=0.64,
        rolling_resistance=0.0108, r_e_f=0.317, r_e_r=0.317, r_l_f=0.309, r_l_r=0.309, inertia_f=1.1, inertia_r=1.3,
        slip_slope_f=31.0, slip_slope_r=31.0,
    ),
    "roadster_rwd": _car(
        "roadster RWD", "rwd", 1.0, mass=1240.0, l_f=1.22, l_r=1.13, h_cg=0.46, track=1.48, drag_area=0.60,
        rolling_resistance=0.0115, r_e_f=0.308, r_e_r=0.312, r_l_f=0.300, r_l_r=0.304, inertia_f=0.95, inertia_r=1.2,
        slip_slope_f=33.0, slip_slope_r=36.0,
    ),
    "compact_fwd": _car(
        "compact FWD", "fwd", 0.0, mass=1290.0, l_f=1.05, l_r=1.55, h_cg=0.53, track=1.50, drag_area=0.62,
        rolling_resistance=0.0098, r_e_f=0.306, r_e_r=0.306, r_l_f=0.298, r_l_r=0.298, inertia_f=1.15, inertia_r=0.9,
        slip_slope_f=27.0, slip_slope_r=27.0,
    ),
    "estate_fwd": _car(
        "estate FWD", "fwd", 0.0, mass=1560.0, l_f=1.12, l_r=1.60, h_cg=0.56, track=1.55, drag_area=0.69,
        rolling_resistance=0.0102, r_e_f=0.317, r_e_r=0.317, r_l_f=0.309, r_l_r=0.309, inertia_f=1.35, inertia_r=1.0,
        slip_slope_f=29.0, slip_slope_r=28.0,
    ),
    "suv_awd": _car(
        "SUV AWD", "awd", 0.6, mass=2140.0, l_f=1.42, l_r=1.46, h_cg=0.64, track=1.63, drag_area=0.88,
        rolling_resistance=0.0105, r_e_f=0.355, r_e_r=0.355, r_l_f=0.346, r_l_r=0.346, inertia_f=1.8, inertia_r=1.8,
        slip_slope_f=30.0, slip_slope_r=30.0,
    ),
    "electric_awd": _car(
        "electric AWD", "awd", 0.55, mass=2300.0, l_f=1.45, l_r=1.47, h_cg=0.50, track=1.64, drag_area=0.58,
        rolling_resistance=0.0092, r_e_f=0.345, r_e_r=0.345, r_l_f=0.337, r_l_r=0.337, inertia_f=2.2, inertia_r=2.4,
        slip_slope_f=26.0, slip_slope_r=27.0,
    ),
}  # fmt: skip
"""By name; a car with a combustion engine (not `electric`) shifts gears."""
