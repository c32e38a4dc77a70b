"""Tyres on dry and wet road: parameters as data, each with its unit and where it comes from.

`V` read in the source named, `D` derived, `K` general knowledge, `A` the anchor: worn summer tyre, low pressure,
1.3 mm, full aquaplaning near 118 km/h. What is fitted says so; `water_numbers` has intervals.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from typing import Any

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Key, Vehicle
from aqualog.physics.hydroplaning import WaterLaw, full_aquaplaning_speed

__all__ = ["P_REFERENCE", "TYRES", "TYRE_KEYS", "Tyre"]

P_REFERENCE = 1.9e5  # [Pa] pressure at which a vehicle file's slip slope holds, the thesis' "low"; default of scenarios


def _of(unit: str, default: float, low: float, high: float, meaning: str, source: str) -> Any:
    """Return a field of a tyre, with what a file may give for it."""
    return field(default=default, metadata={"key": (unit, default, low, high, meaning, source)})


@dataclass(frozen=True, slots=True)
class Tyre:
    """One tyre, SI. See `TYRE_KEYS` for meaning, bounds and source of each field."""

    name: str = "worn_summer"
    tread_depth: float = _of("m", 1.6e-3, 0.0, 0.03, "depth of the grooves", "worn: legal limit")
    void_ratio: float = _of(
        "-", 0.25, 0.0, 0.6, "share of grooves in the tread, by volume",
        "0.25-0.35 (K); new 8 mm take 2 mm (V, [gengenbach1968])",
    )  # fmt: skip
    slip_slope_factor: float = _of("-", 1.0, 0.1, 3.0, "slip slope over the vehicle file's", "worn = 1 by definition")
    mu_factor: float = _of("-", 1.0, 0.1, 2.0, "friction over the vehicle file's mu_max", "worn = 1 by definition")
    wet_friction: float = _of("-", 0.8, 0.1, 1.2, "friction of the dry contact on a wet road, over dry", "0.7-0.9 (K)")
    cornering_slope: float = _of("1/rad", 20.0, 3.0, 60.0, "cornering stiffness over load", "15-25 (K)")
    load_sensitivity: float = _of(
        "-", 0.22, -1.0, 1.0, "relative change of slip slope per relative change of load",
        "MF6.1 205/60R15 (V, [besselink2010])",
    )  # fmt: skip
    half_length: float = _of(
        "m", 0.07, 0.02, 0.3, "half contact length at 4 kN and 2.2 bar",
        "QRA1, QRA2 (V, [besselink2010]): 0.066-0.074 (D)",
    )  # fmt: skip
    width: float = _of(
        "m", 0.205, 0.05, 0.6, "section width, taken for the width of the contact",
        "205/55R16; its tread is 0.82 of that (K)",
    )  # fmt: skip
    v_anchor: float = _of(
        "m/s", 120.5 / 3.6, 5.0, 100.0, "full aquaplaning of an even contact at 1.3 mm, 1.9 bar, 4 kN, 1.6 mm of tread",
        "A: of a fluctuating contact 3 of 4 front wheels turn half as fast within 0.5 s at 118 km/h",
    )  # fmt: skip
    pressure_exponent: float = _of(
        "-", 0.3, 0.0, 1.0, "m of v_full ~ p^m", "fitted; 0.5 - k / 2 by [horne1963], 0.3 [gallaway1979] (K)"
    )
    aspect_exponent: float = _of(
        "-", 0.4, 0.0, 1.0, "k of v_full ~ (length over width of the contact)^k, so ~ load^(k / 2)",
        "fitted; 0.5 [horne1986], 0.4 by the load in [gunaratne2012] (K)",
    )  # fmt: skip
    thin_gain: float = _of("-", 0.63, 0.0, 3.0, "v_full of thin films over that of bulk water, less 1", "fitted")
    h_bulk: float = _of(
        "m", 2.0e-3, 1e-4, 0.05, "depth at which bulk water begins to rule",
        "0.08 in: treaded tyres' limit (V, [gengenbach1968])",
    )  # fmt: skip
    h_onset: float = _of(
        "m", 0.15e-3, 1e-6, 0.01, "free water that completes two thirds of the wedge", "a fraction of texture depth (K)"
    )  # fmt: skip
    tread_gain: float = _of("1/m", 33.5, 0.0, 200.0, "v_full ~ 1 + gain times the depth of the grooves", "fitted")
    contact_exponent: float = _of("-", 3.5, 1.0, 12.0, "n of L = 1 - (v / v_full)^n", "fitted")
    wedge_arm: float = _of(
        "-", 0.45, 0.0, 1.5, "shift of the load at full aquaplaning over the half length",
        "34 mm: from a rolling wheel it takes 0.6 to 2.3 times the momentum of the water where that floats (D)",
    )  # fmt: skip
    h_film: float = _of(
        "m", 0.5e-3, 0.0, 0.01, "film that the tread throws",
        "C_D near 0.7 of a tyre that skids in 1.3 mm (K, [horne1960]); saturates by thesis Fig. 2.11",
    )  # fmt: skip
    groove_relief: float = _of("-", 0.7, 0.0, 1.0, "share of the film's drag that full drainage saves", "(K)")
    h_wave: float = _of(
        "m", 1.3e-3, 0.0, 0.05, "depth from which water is pushed ahead", "resistance rises between 1.3 and 2 mm (D)"
    )  # fmt: skip
    h_track: float = _of(
        "m", 0.5e-3, 1e-6, 0.01, "film that a front wheel leaves of deep water",
        "below the least depth tested, 0.6 mm (D)",
    )  # fmt: skip
    track_irregularity: float = _of(
        "-", 0.3, 0.0, 2.0, "rms of that film along the road, relative", "splash and tread pattern (K)"
    )  # fmt: skip
    contact_scatter: float = _of(
        "-", 0.06, 0.0, 0.5, "rms of v_full along the road, relative", "wheel load and texture (K)"
    )  # fmt: skip
    scatter_length: float = _of(
        "m", 0.4, 0.1, 50.0, "its correlation length", "v / (2 pi f) of a wheel hop of 10-12 Hz at 100 km/h (D)"
    )  # fmt: skip

    torsion_frequency: float = _of(
        "Hz", 0.0, 0.0, 60.0, "at which the rim swings on a belt that the road holds; 0: it does not",
        "30-45 (K); wheel speeds show such a mode (V, [persson2002])",
    )  # fmt: skip
    torsion_damping: float = _of("-", 0.06, 0.0, 0.3, "damping of that swing over the critical one", "0.05-0.1 (K)")
    belt_share: float = _of(
        "-", 0.55, 0.1, 0.9, "belt's share of the wheel's inertia; without the swing all turns as one", "(K)"
    )  # fmt: skip

    @property
    def tread_capacity(self) -> float:
        """Water that the grooves can take, as a depth. [m]"""
        return self.tread_depth * self.void_ratio

    @property
    def water_law(self) -> WaterLaw:
        """The numbers of `physics.hydroplaning.full_aquaplaning_speed`."""
        return WaterLaw(
            self.v_anchor, self.pressure_exponent, self.thin_gain, self.h_bulk, self.h_onset, self.tread_gain,
            self.contact_exponent, self.aspect_exponent,
        )  # fmt: skip

    def as_fitted(self, car: Vehicle, given: Iterable[str] = ()) -> Tyre:
        """The tyre with what the vehicle file knows of how it floats, but for the keys that are `given`."""
        return replace(self, **{n: w.value for n, w in car.water.items() if n not in given})  # type: ignore[arg-type]

    def full_speed(self, h_w: FloatArray, F_z: FloatArray, *, p: float) -> FloatArray:
        """Return the speed of full aquaplaning in even water: depth [m], wheel load [N], pressure [Pa] to [m/s]."""
        return full_aquaplaning_speed(
            h_w, F_z, p=p, tread_depth=self.tread_depth, tread_capacity=self.tread_capacity, texture=1.0,
            aspect=0.5 * self.width / self.half_length, law=self.water_law,
        )  # fmt: skip


TYRE_KEYS: dict[str, Key] = {f.name: Key("tyre", f.name, *f.metadata["key"]) for f in fields(Tyre) if f.metadata}

TYRES: dict[str, Tyre] = {
    t.name: t
    for t in (
        Tyre("very_worn_summer", tread_depth=1.0e-3, slip_slope_factor=1.03),
        Tyre("worn_summer"),
        Tyre("new_summer", tread_depth=7.8e-3, slip_slope_factor=0.90),  # deep blocks shear more (K: 15-50 in all)
        Tyre("new_winter", tread_depth=8.5e-3, void_ratio=0.32, slip_slope_factor=0.75, mu_factor=0.92),
    )
}
