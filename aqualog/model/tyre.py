"""Tyres on dry and wet road: parameters as data, each with its unit and where it comes from.

`V` read in the source named, `D` derived, `K` general knowledge, `A` the anchor: worn summer tyre, low pressure,
1.3 mm, full aquaplaning near 118 km/h. `v_anchor` alone was fitted, and to the anchor alone.
"""

from __future__ import annotations

from dataclasses import dataclass

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Key
from aqualog.physics.hydroplaning import Anchor, full_aquaplaning_speed

__all__ = ["P_REFERENCE", "TYRES", "TYRE_KEYS", "Tyre"]

P_REFERENCE = 1.9e5  # [Pa] pressure at which a vehicle file's slip slope holds, the thesis' "low"; default of scenarios

H_ANCHOR, P_ANCHOR, F_Z_ANCHOR = 1.3e-3, 1.9e5, 4000.0  # [m, Pa, N] reference of a tyre's v_anchor


def _key(name: str, unit: str, default: float, low: float, high: float, meaning: str, source: str) -> Key:
    return Key("tyre", name, unit, default, low, high, meaning, source)


_ALL = [
    _key("tread_depth", "m", 1.6e-3, 0.0, 0.03, "depth of the grooves", "worn: legal limit"),
    _key("void_ratio", "-", 0.25, 0.0, 0.6,
         "share of grooves in the tread, by volume",
         "0.25-0.35 (K); new 8 mm take 2 mm (V, [gengenbach1968])"),
    _key("slip_slope_factor", "-", 1.0, 0.1, 3.0, "slip slope over the vehicle file's", "worn = 1 by definition"),
    _key("mu_factor", "-", 1.0, 0.1, 2.0, "friction over the vehicle file's mu_max", "worn = 1 by definition"),
    _key("wet_friction", "-", 0.8, 0.1, 1.2, "friction of the dry contact on a wet road, over dry", "0.7-0.9 (K)"),
    _key("cornering_slope", "1/rad", 20.0, 3.0, 60.0, "cornering stiffness over load", "15-25 (K)"),
    _key("load_sensitivity", "-", 0.22, -1.0, 1.0,
         "relative change of slip slope per relative change of load", "MF6.1 205/60R15 (V, [besselink2010])"),
    _key("half_length", "m", 0.07, 0.02, 0.3,
         "half contact length at 4 kN and 2.2 bar", "QRA1, QRA2 (V, [besselink2010]): 0.066-0.074 (D)"),
    _key("width", "m", 0.205, 0.05, 0.6, "width of the contact", "205/55R16"),
    _key("v_anchor", "m/s", 125.0 / 3.6, 5.0, 100.0,
         "full aquaplaning of an even contact at 1.3 mm, 1.9 bar, 4 kN",
         "A: fluctuating and turning slower, 3 of 4 front wheels stop within 0.5 s at 118 km/h"),
    _key("h_bulk", "m", 2.0e-3, 1e-4, 0.05,
         "depth from which v_full falls as 1/sqrt(h)", "0.08 in: treaded tyres' limit (V, [gengenbach1968])"),
    _key("h_onset", "m", 0.15e-3, 1e-6, 0.01,
         "free water that completes the wedge", "a fraction of texture depth (K)"),
    _key("contact_exponent", "-", 4.0, 1.0, 12.0,
         "n of L = 1 - (v / v_full)^n", "4-6 (D): at full - 20 km/h 0.28-0.45 of the slip slope are left"),
    _key("wedge_peak", "-", 0.93, 0.5, 1.0,
         "where the water's force acts in the wedge", "a shift of 60 mm at full aquaplaning (D)"),
    _key("h_film", "m", 0.6e-3, 0.0, 0.01,
         "film that the tread throws", "least depth tested; saturates by thesis Fig. 2.11 (D)"),
    _key("groove_relief", "-", 0.7, 0.0, 1.0, "share of the film's drag that full drainage saves", "(K)"),
    _key("h_wave", "m", 1.3e-3, 0.0, 0.05,
         "depth from which water is pushed ahead", "resistance rises between 1.3 and 2 mm (D)"),
    _key("h_track", "m", 0.5e-3, 0.0, 0.01,
         "film that a front wheel leaves", "below the least depth tested, 0.6 mm (D)"),
    _key("contact_scatter", "-", 0.06, 0.0, 0.5,
         "rms of v_full along the road, relative", "wheel load and texture vary by 10 %, v ~ sqrt(pressure) (K)"),
    _key("scatter_length", "m", 2.5, 0.1, 50.0,
         "its correlation length", "a wheel hop of 10-12 Hz at 100 km/h (K)"),
]  # fmt: skip

TYRE_KEYS: dict[str, Key] = {k.name: k for k in _ALL}


@dataclass(frozen=True, slots=True)
class Tyre:
    """One tyre, SI. See `TYRE_KEYS` for meaning, bounds and source of each field."""

    name: str = "worn_summer"
    tread_depth: float = TYRE_KEYS["tread_depth"].default
    void_ratio: float = TYRE_KEYS["void_ratio"].default
    slip_slope_factor: float = TYRE_KEYS["slip_slope_factor"].default
    mu_factor: float = TYRE_KEYS["mu_factor"].default
    wet_friction: float = TYRE_KEYS["wet_friction"].default
    cornering_slope: float = TYRE_KEYS["cornering_slope"].default
    load_sensitivity: float = TYRE_KEYS["load_sensitivity"].default
    half_length: float = TYRE_KEYS["half_length"].default
    width: float = TYRE_KEYS["width"].default
    v_anchor: float = TYRE_KEYS["v_anchor"].default
    h_bulk: float = TYRE_KEYS["h_bulk"].default
    h_onset: float = TYRE_KEYS["h_onset"].default
    contact_exponent: float = TYRE_KEYS["contact_exponent"].default
    wedge_peak: float = TYRE_KEYS["wedge_peak"].default
    h_film: float = TYRE_KEYS["h_film"].default
    groove_relief: float = TYRE_KEYS["groove_relief"].default
    h_wave: float = TYRE_KEYS["h_wave"].default
    h_track: float = TYRE_KEYS["h_track"].default
    contact_scatter: float = TYRE_KEYS["contact_scatter"].default
    scatter_length: float = TYRE_KEYS["scatter_length"].default

    @property
    def tread_capacity(self) -> float:
        """Water that the grooves can take, as a depth. [m]"""
        return self.tread_depth * self.void_ratio

    def full_speed(self, h_w: FloatArray, F_z: FloatArray, *, p: float) -> FloatArray:
        """Return the speed of full aquaplaning in even water: depth [m], wheel load [N], pressure [Pa] to [m/s]."""
        return full_aquaplaning_speed(
            h_w, F_z, p=p, tread_capacity=self.tread_capacity,
            anchor=Anchor(self.v_anchor, H_ANCHOR, P_ANCHOR, F_Z_ANCHOR), h_bulk=self.h_bulk, h_onset=self.h_onset,
            exponent=self.contact_exponent,
        )  # fmt: skip


TYRES: dict[str, Tyre] = {
    t.name: t
    for t in (
        Tyre("very_worn_summer", tread_depth=1.0e-3, slip_slope_factor=1.03),
        Tyre("worn_summer"),
        Tyre("new_summer", tread_depth=7.8e-3, slip_slope_factor=0.90),  # deep blocks shear more (K: 15-50 in all)
        Tyre("new_winter", tread_depth=8.5e-3, void_ratio=0.32, slip_slope_factor=0.75, mu_factor=0.92),
    )
}
