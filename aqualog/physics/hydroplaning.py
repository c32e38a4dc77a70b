"""Speed of full aquaplaning: published formulas under their names, and the one that the simulator uses.

The published ones are given in their authors' units inside and in SI outside. Those marked "as commonly quoted" were
not checked against the original report. Sources in square brackets are keys of `docs/sources.toml`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.physics.water import drained_share

__all__ = [
    "ASPECT_ANCHOR", "CAPACITY_ANCHOR", "F_Z_ANCHOR", "H_ANCHOR", "P_ANCHOR", "SPIN_UP_RATIO", "TREAD_ANCHOR",
    "WaterLaw", "depth_factor", "full_aquaplaning_speed", "gallaway_speed", "horne_speed", "pavdrn_speed", "usf_speed",
]  # fmt: skip

KMH = 1.0 / 3.6  # [m/s]
KNOT = 1852.0 / 3600.0  # [m/s]
MPH = 0.44704  # [m/s]
PSI = 6894.757  # [Pa]
INCH = 0.0254  # [m]

H_ANCHOR, P_ANCHOR, F_Z_ANCHOR = 1.3e-3, 1.9e5, 4000.0  # [m, Pa, N] reference of `WaterLaw.v_anchor`
TREAD_ANCHOR, CAPACITY_ANCHOR = 1.6e-3, 0.4e-3  # [m] its worn tyre: depth of the grooves, and water that they take
ASPECT_ANCHOR = 0.205 / 0.14  # [-] width over length of its contact, both as a `Tyre` has them

SPIN_UP_RATIO = 7.7 / 9.0  # spin-up over spin-down speed: a wheel that has stopped floats down to a lower speed


def horne_speed(p: FloatArray) -> FloatArray:
    """Spin-down speed of a rotating wheel on a flooded road, v = 9 sqrt(p) kn with p in psi. [m/s]

    `p` gauge pressure, > 0 [Pa]. 180, 200, 220, 240 kPa give 85, 90, 94, 98 km/h. Valid for flooded roads, water
    deeper than the grooves, and tyres of aircraft. By the aspect of the contact, width over length, it is 7.95
    sqrt(p / FAR) mph: the same at 0.59. A longer contact floats later.

    Source: Horne and Dreher, NASA TN D-2056, 1963 [horne1963]; repeated by T. J. Yager, NASA TM-85652, 1983 (K)
    [yager1983]. The aspect: (K) [horne1986]; Maleska et al. [maleska2021] apply it to passenger-car tyres.
    """
    return 9.0 * np.sqrt(p / PSI) * KNOT


def pavdrn_speed(h_w: FloatArray) -> FloatArray:
    """Hydroplaning speed of the PAVDRN model for thin films, v = 26.04 h^-0.259 mph with h in inch. [m/s]

    `h_w` water film, 0 ... 2.4 mm [m]. For the ASTM E524 tyre [astm_e524_1988] at 165 kPa and 4800 N. 0.6, 1.3, 2.0 mm
    give 111, 91, 81 km/h.

    Source: as commonly quoted (K) from [anderson1998].
    """
    return 26.04 * (h_w / INCH) ** -0.259 * MPH


def gallaway_speed(
    h_w: FloatArray, p: FloatArray, *, tread_depth: float, texture_depth: float, spin_down: float = 10.0
) -> FloatArray:
    """Hydroplaning speed after Gallaway: v = SD^0.04 P^0.3 (TD + 1)^0.06 A mph. [m/s]

    `h_w` water film, > 0 [m]; `p` gauge pressure [Pa]; `tread_depth`, `texture_depth` mean of the road's [m];
    `spin_down` criterion, loss of wheel speed [%].

    P in psi, TD in 1/32 inch, A = max(10.409 / h^0.06 + 3.507, (28.952 / h^0.06 - 7.817) MTD^0.14), inch. 220 kPa,
    1.6 mm of tread and 0.78 mm of texture give 93 to 85 km/h for 0.6 to 2 mm.

    Source: as commonly quoted (K) from [gallaway1979].
    """
    film = (h_w / INCH) ** 0.06
    A = np.maximum(10.409 / film + 3.507, (28.952 / film - 7.817) * (texture_depth / INCH) ** 0.14)
    v: FloatArray = spin_down**0.04 * (p / PSI) ** 0.3 * (tread_depth / INCH * 32.0 + 1.0) ** 0.06 * A * MPH
    return v


def usf_speed(h_w: FloatArray, p: FloatArray, F_z: FloatArray) -> FloatArray:
    """Hydroplaning speed of the USF regression, v = W^0.2 p^0.5 (0.82 / h^0.06 + 0.49) km/h. [m/s]

    `h_w` water film, > 0 [m]; `p` gauge pressure [Pa]; `F_z` wheel load [N]. W in N, p in kPa, h in mm.

    Source: as commonly quoted (K) from [gunaratne2012].
    """
    return F_z**0.2 * np.sqrt(p * 1e-3) * (0.82 / (h_w * 1e3) ** 0.06 + 0.49) * KMH


def depth_factor(h_w: FloatArray | float, *, thin_gain: FloatArray | float, h_bulk: float) -> FloatArray | float:
    """How full aquaplaning comes later in thinner water, (0.82 / h^0.06 + 0.49) (1 + g / (1 + (h / h_bulk)^4)).

    `h_w` water film, > 0 [m]; `thin_gain` g: how much later a film floats that the road's texture and the tread's edges
    break [-]; `h_bulk`: depth at which bulk water begins to rule [m]. Bulk water gives the factor of `usf_speed`, h in
    mm, nearly flat; thin films 1 + g times as much, nearly flat too. [-]

    Full aquaplaning near 118 km/h at 1.3 mm and 120 at 0.8 mm (thesis) and near 75 km/h at 5 to 8 mm (tyre tests) are
    two regimes: no power of the depth joins them and keeps either.

    Source: derived. Bulk water: [gunaratne2012]; the depth between both: 0.08 in, [gengenbach1968] as [gallaway1979]
    quotes it; the fourth power is an assumption.
    """
    ratio = h_w / h_bulk
    ratio = ratio * ratio
    return (0.82 / (h_w * 1e3) ** 0.06 + 0.49) * (1.0 + thin_gain / (1.0 + ratio * ratio))


class WaterLaw(NamedTuple):
    """Numbers of the law of full aquaplaning.

    `v_anchor` [m/s]: a tyre with `TREAD_ANCHOR` on asphalt in `H_ANCHOR` at `P_ANCHOR` and `F_Z_ANCHOR`;
    `pressure_exponent` [-]: v ~ p^m; `thin_gain` [-] and `h_bulk` [m] of `depth_factor`; `h_onset` [m]: free water that
    completes two thirds of the wedge; `tread_gain` [1/m]: v ~ 1 + gain times the depth of the grooves; `exponent` [-]:
    n of `lost_contact`; `aspect_exponent` [-]: v ~ (length over width of the contact)^k.
    """

    v_anchor: float
    pressure_exponent: float
    thin_gain: float
    h_bulk: float
    h_onset: float
    tread_gain: float
    exponent: float
    aspect_exponent: float


def _wedge(h_w: FloatArray | float, tread_capacity: FloatArray | float, h_onset: FloatArray | float) -> FloatArray:
    """Share of a complete wedge of water, by what finds no room in the grooves. [-]"""
    free = h_w * (1.0 - drained_share(h_w, tread_capacity=tread_capacity))
    wedge: FloatArray = 1.0 - np.exp(-free / h_onset)
    return wedge


def full_aquaplaning_speed(
    h_w: FloatArray,
    F_z: FloatArray,
    *,
    p: float,
    tread_depth: float,
    tread_capacity: float,
    texture: float,
    aspect: float,
    law: WaterLaw,
) -> FloatArray:
    """Speed at which the dry contact of a tyre vanishes.

    Parameters
    ----------
    h_w : array
        Water in front of the wheel, >= 0. [m]
    F_z : array
        Wheel load, > 0. [N]
    p : float
        Inflation pressure. [Pa]
    tread_depth : float
        Depth of the grooves. [m]
    tread_capacity : float
        Water that the grooves can take, as a depth. [m]
    texture : float
        How much of what asphalt does to thin films the road does: 1 asphalt, 0 glass. [-]
    aspect : float
        Width over length of the contact at the load and pressure of its half length. [-]
    law : WaterLaw

    Returns
    -------
    v_full : array
        At most 1e6 m/s. [m/s]

    v_anchor (p / p_anchor)^m (F_z / F_z_anchor)^(k/2) (aspect / aspect_anchor)^-k times the ratios to the anchor of
    `depth_factor`, of 1 + gain TD and of chi^(-1/n). chi = 1 - exp(-h_free / h_onset) is the share of a complete wedge,
    and lifts that share of what a complete one would. h_free = h (1 - `drained_share`) finds no room in the grooves.
    A contact is longer with load and shorter with pressure, l ~ sqrt(F_z / p): this is p^(m + k/2) (l / width)^k. Water
    leaves a long, narrow contact before the wedge has reached its end. At one aspect Horne's root of the pressure is
    left, m + k/2 = 0.5.
    Limits: v_anchor at the anchor; grows with p, F_z and tread, falls with h; no water, no wedge; in deep water the
    grooves are full, and tread helps by its channels, 1 + gain TD.

    Source: derived. m + k/2 is 0.5 by [horne1963]; k is 0.5 by [horne1986], for car tyres too [maleska2021], and 0.4 by
    the load in [gunaratne2012]; [gallaway1979] has m = 0.3. The anchor is a pass of [fichtinger2024], C16. The numbers
    are fitted (`model/water_numbers.py`).
    """
    wedge = _wedge(h_w, tread_capacity, law.h_onset) / _wedge(H_ANCHOR, CAPACITY_ANCHOR, law.h_onset)
    gain = texture * law.thin_gain
    depth = depth_factor(np.maximum(h_w, 1e-9), thin_gain=gain, h_bulk=law.h_bulk)
    depth = depth / depth_factor(H_ANCHOR, thin_gain=law.thin_gain, h_bulk=law.h_bulk)
    channels = (1.0 + law.tread_gain * tread_depth) / (1.0 + law.tread_gain * TREAD_ANCHOR)
    v = law.v_anchor * (p / P_ANCHOR) ** law.pressure_exponent
    v = v * (np.sqrt(np.maximum(F_z, 1.0) / F_Z_ANCHOR) * ASPECT_ANCHOR / aspect) ** law.aspect_exponent
    v_full: FloatArray = np.minimum(v * depth * channels / np.maximum(wedge, 1e-30) ** (1.0 / law.exponent), 1e6)
    return v_full
