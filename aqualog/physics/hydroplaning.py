"""Speed of full aquaplaning: published formulas under their names, and the one that the simulator uses.

The published ones are given in their authors' units inside and in SI outside. Those marked "as commonly quoted" were
not checked against the original report. Sources in square brackets are keys of `docs/sources.toml`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "SPIN_UP_RATIO",
    "Anchor",
    "depth_factor",
    "full_aquaplaning_speed",
    "gallaway_speed",
    "gengenbach_speed",
    "horne_speed",
    "horne_spin_up_speed",
    "pavdrn_speed",
    "usf_speed",
]

KMH = 1.0 / 3.6  # [m/s]
KNOT = 1852.0 / 3600.0  # [m/s]
MPH = 0.44704  # [m/s]
PSI = 6894.757  # [Pa]
INCH = 0.0254  # [m]

SPIN_UP_RATIO = 7.7 / 9.0  # spin-up over spin-down speed: a wheel that has stopped floats down to a lower speed


def horne_speed(p: FloatArray) -> FloatArray:
    """Spin-down speed of a rotating wheel on a flooded road, v = 9 sqrt(p) kn with p in psi.

    Parameters
    ----------
    p : array
        Inflation pressure, > 0. [Pa]

    Returns
    -------
    v : array
        [m/s]

    180, 200, 220, 240 kPa give 85, 90, 94, 99 km/h. Valid for flooded roads, water deeper than the grooves.

    Source: Horne and Dreher, NASA TN D-2056, 1963 [horne1963]; repeated by T. J. Yager, NASA TM-85652, 1983 (K)
    [yager1983]. Maleska et al. 2021 [maleska2021] do not confirm this equation. They apply Horne's equation for truck
    tyres to passenger-car tyres. That one holds the aspect ratio of the footprint too, v = 7.95 sqrt(p / FAR) mph with
    p in psi and FAR = width / length (K) [horne1986].
    """
    return 9.0 * np.sqrt(p / PSI) * KNOT


def horne_spin_up_speed(p: FloatArray) -> FloatArray:
    """Speed below which a wheel that stands still spins up again on a flooded road, v = 7.7 sqrt(p) kn, p in psi.

    As `horne_speed`; the ratio of both, `SPIN_UP_RATIO`, is the hysteresis of the recovery.

    Source: [yager1983].
    """
    return 7.7 * np.sqrt(p / PSI) * KNOT


def pavdrn_speed(h_w: FloatArray) -> FloatArray:
    """Hydroplaning speed of the PAVDRN model for thin films, v = 26.04 h^-0.259 mph with h in inch.

    Parameters
    ----------
    h_w : array
        Water film, 0 ... 2.4 mm. [m]

    Returns
    -------
    v : array
        [m/s]

    For the ASTM E524 tyre [astm_e524_1988] at 165 kPa and 4800 N. 0.6, 1.3, 2.0 mm give 111, 91, 81 km/h.

    Source: as commonly quoted (K) from [anderson1998].
    """
    return 26.04 * (h_w / INCH) ** -0.259 * MPH


def gallaway_speed(
    h_w: FloatArray, p: FloatArray, *, tread_depth: float, texture_depth: float, spin_down: float = 10.0
) -> FloatArray:
    """Hydroplaning speed after Gallaway: v = SD^0.04 P^0.3 (TD + 1)^0.06 A mph.

    Parameters
    ----------
    h_w : array
        Water film, > 0. [m]
    p : array
        Inflation pressure. [Pa]
    tread_depth : float
        [m]
    texture_depth : float
        Mean texture depth of the road. [m]
    spin_down : float
        Criterion: loss of wheel speed. [%]

    Returns
    -------
    v : array
        [m/s]

    P in psi, TD in 1/32 inch, A = max(10.409 / h^0.06 + 3.507, (28.952 / h^0.06 - 7.817) MTD^0.14), inch. 220 kPa,
    1.6 mm of tread and 0.78 mm of texture give 93 to 85 km/h for 0.6 to 2 mm.

    Source: as commonly quoted (K) from [gallaway1979].
    """
    film = (h_w / INCH) ** 0.06
    A = np.maximum(10.409 / film + 3.507, (28.952 / film - 7.817) * (texture_depth / INCH) ** 0.14)
    v: FloatArray = spin_down**0.04 * (p / PSI) ** 0.3 * (tread_depth / INCH * 32.0 + 1.0) ** 0.06 * A * MPH
    return v


def usf_speed(h_w: FloatArray, p: FloatArray, F_z: FloatArray) -> FloatArray:
    """Hydroplaning speed of the USF regression, v = W^0.2 p^0.5 (0.82 / h^0.06 + 0.49) km/h.

    Parameters
    ----------
    h_w : array
        Water film, > 0. [m]
    p : array
        Inflation pressure. [Pa]
    F_z : array
        Wheel load. [N]

    Returns
    -------
    v : array
        [m/s]

    W in N, p in kPa, h in mm. The exponent of load in `full_aquaplaning_speed` comes from here.

    Source: as commonly quoted (K) from [gunaratne2012].
    """
    return F_z**0.2 * np.sqrt(p * 1e-3) * (0.82 / (h_w * 1e3) ** 0.06 + 0.49) * KMH


def gengenbach_speed(h_w: FloatArray, F_z: FloatArray, *, width: float, lift_coefficient: float) -> FloatArray:
    """Hydroplaning speed after Gengenbach, v = 508 sqrt(Q / (B h C_L)) km/h, with Q in kp, B and h in mm.

    Parameters
    ----------
    h_w : array
        Water film, > 0. [m]
    F_z : array
        Wheel load. [N]
    width : float
        Width of the contact. [m]
    lift_coefficient : float
        C_L of the tyre, by experiment. [-]

    Returns
    -------
    v : array
        [m/s]

    A momentum balance: v ~ 1 / sqrt(h).

    Source: as commonly quoted (K) from [gengenbach1968].
    """
    return 508.0 * np.sqrt(F_z / 9.80665 / (width * 1e3 * h_w * 1e3 * lift_coefficient)) * KMH


def depth_factor(h_w: FloatArray | float, *, h_bulk: float) -> FloatArray | float:
    """How full aquaplaning comes sooner in deeper water, (1 + (h / h_bulk)^2)^(-1/4).

    Parameters
    ----------
    h_w : array
        Water film, >= 0. [m]
    h_bulk : float
        Depth at which bulk water begins to rule. [m]

    Returns
    -------
    factor : array
        1 for thin films, which the road's texture and the tread's edges break; ~ h^(-1/2) for deep water
        (`gengenbach_speed`, a momentum balance). Between 0.6 and 2 mm with h_bulk = 2 mm it falls by 14 %,
        Gallaway's by 9 %, PAVDRN's by 27 %. [-]

    Source: derived, between [gallaway1979] and [anderson1998] for thin films; the limit for deep water is that of
    [gengenbach1968].
    """
    ratio = h_w / h_bulk
    return (1.0 + ratio * ratio) ** -0.25


class Anchor(NamedTuple):
    """One measured point of full aquaplaning: speed [m/s], water [m], inflation pressure [Pa], wheel load [N]."""

    v: float
    h_w: float
    p: float
    F_z: float


def full_aquaplaning_speed(
    h_w: FloatArray,
    F_z: FloatArray,
    *,
    p: float,
    tread_capacity: float,
    anchor: Anchor,
    h_bulk: float,
    h_onset: float,
    exponent: float,
) -> FloatArray:
    """Speed at which the dry contact of a tyre vanishes, from one measured anchor.

    Parameters
    ----------
    h_w : array
        Water in front of the wheel, >= 0. [m]
    F_z : array
        Wheel load, > 0. [N]
    p : float
        Inflation pressure. [Pa]
    tread_capacity : float
        Water that the tread's grooves can take, as a depth. [m]
    anchor : Anchor
        Full aquaplaning of a tyre whose grooves take none of the anchor's water.
    h_bulk : float
        See `depth_factor`. [m]
    h_onset : float
        Free water beyond the tread's capacity at which the wedge is complete. [m]
    exponent : float
        n of `lost_contact`.

    Returns
    -------
    v_full : array
        1e6 m/s where the tread takes all the water: no wedge. [m/s]

    v_anchor sqrt(p / p_anchor) (Horne) (F_z / F_z_anchor)^0.2 (USF) depth_factor(h) / depth_factor(h_anchor)
    chi^(-1/n), where chi = (h - capacity) / h_onset within 0 ... 1 is the share of a complete wedge. Limits: v_anchor
    at the anchor; grows with p and F_z, falls with h; h <= capacity, no aquaplaning (Gengenbach: treaded tyres none
    below 2 mm).

    Source: derived. The exponent of pressure is that of [horne1963], that of load that of [gunaratne2012]; the anchor
    is a pass of [fichtinger2024], C16; treaded tyres below 2 mm: [gengenbach1968], as [gallaway1979] quotes it.
    """
    wedge = np.minimum(np.maximum((h_w - tread_capacity) / h_onset, 0.0), 1.0)
    depth = depth_factor(h_w, h_bulk=h_bulk) / depth_factor(anchor.h_w, h_bulk=h_bulk)
    v = anchor.v * np.sqrt(p / anchor.p) * (np.maximum(F_z, 1.0) / anchor.F_z) ** 0.2 * depth
    v_full: FloatArray = np.minimum(v / np.maximum(wedge, 1e-30) ** (1.0 / exponent), 1e6)
    return v_full
