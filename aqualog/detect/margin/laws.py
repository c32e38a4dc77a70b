"""What water does to a car at a distance from full aquaplaning: tables over speed, by the laws of the simulator.

The tyre, its tread and pressure are not known, so each entry is a mean over tyres with their spread. Full aquaplaning
is where a free wheel stops: the friction that is left no longer turns it against the water.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.physics import contact, water
from aqualog.physics.hydroplaning import WaterLaw, full_aquaplaning_speed, gallaway_speed, usf_speed
from aqualog.physics.load import G

__all__ = ["COLUMNS", "DEPTHS", "FULL_SPEEDS", "SHIFTS", "SPEED_STEP", "Tables", "tables_of"]

KMH = 1.0 / 3.6  # [m/s]
# detectors do not import the simulator: a test holds these numbers to those of `model.tyre`
# [m/s] cells of the speed of full aquaplaning, 40 to 206 km/h
FULL_SPEEDS: FloatArray = 40.0 * KMH * np.exp(np.log(1.048) * np.arange(36, dtype=np.float64))
DEPTHS = np.array([0.7e-3, 1.7e-3, 4.0e-3, 0.7e-3, 1.7e-3, 4.0e-3])  # [m] cells of the water's depth
SHIFTS = np.array([0.05, 0.05, 0.05, 1.0, 1.0, 1.0])  # [-] tyres differ in how far the load moves forward, over the law
SPEED_STEP = 5.0 * KMH  # [m/s] of the tables, from 0 on
SPEEDS: FloatArray = SPEED_STEP * np.arange(45, dtype=np.float64)
L_LEAST = 0.03  # [-] of a contact: less is a wheel that floats
TYRES = 16
LAW = WaterLaw(120.5 * KMH, 0.3, 0.58, 2.0e-3, 0.15e-3, 33.5, 3.5)  # as fitted to published figures
LAW_SD = 0.20  # [-] log of a tyre's full speed about it
TEXTURE = 0.8e-3  # [m] mean texture depth of asphalt
STOPS_AT = 0.93  # a free wheel stops at about this share of the speed at which its contact ends
RELIEF, H_FILM, H_WAVE = 0.7, 0.5e-3, 1.3e-3  # [-, m, m]


class Tables(NamedTuple):
    """Means over tyres, and how these differ.

    `x` (speeds, full speeds, waters, `COLUMNS`). `prior` (full speeds, waters) sums to 1. A water is a
    depth and a share of the load's shift.
    """

    x: FloatArray
    prior: FloatArray


COLUMNS = ("R", "R_sd", "w_f", "w_r", "w_sd", "K_f", "K_r", "K_sd", "f_f", "f_r", "L")
"""`R` resistance over mass [m/s²]; by axle `w` water's torque over radius and load [-], `K` dry over left slip
stiffness, `K_sd` of its log [-], `f` friction that is left [-]; `L` contact share of the front axle [-]. `_sd` differs
from tyre to tyre."""


class _Tyres(NamedTuple):
    """Numbers of tyres that a car may have, (tyres, 1, 1, 1)."""

    exponent: FloatArray
    arm: FloatArray
    width: FloatArray
    tread: FloatArray
    friction: FloatArray
    track_film: FloatArray
    drag: FloatArray
    p: FloatArray

    @property
    def capacity(self) -> FloatArray:
        """Water that the grooves take, a quarter of their depth. [m]"""
        return 0.25 * self.tread

    def full(self, h: FloatArray) -> FloatArray:
        """Speed at which the contact ends in a film [m] by the fitted law. [m/s]"""
        return full_aquaplaning_speed(
            h, np.array(4000.0), p=self.p, tread_depth=self.tread, tread_capacity=self.capacity, texture=1.0,  # type: ignore[arg-type]
            law=LAW,
        )  # fmt: skip


def _drawn() -> _Tyres:
    """Draw the tyres once and for all, each number evenly over what is usual."""
    ends = (
        (2.0, 6.0), (0.25, 0.8), (0.185, 0.235), (1.0e-3, 8.0e-3), (0.65, 0.9), (0.2e-3, 0.8e-3), (0.6, 1.6),
        (1.8e5, 2.9e5),
    )  # fmt: skip
    even = (np.arange(TYRES) + 0.5) / TYRES
    u = np.random.default_rng(25).permuted(np.tile(even, (len(ends), 1)), axis=1)
    return _Tyres(*((low * (high / low) ** x)[:, None, None, None] for x, (low, high) in zip(u, ends, strict=True)))


class _Wheel(NamedTuple):
    """Contact share, water's torque over radius and load, wave's force over load. [-]"""

    L: FloatArray
    w: FloatArray
    wave: FloatArray


def _wheel(tyre: _Tyres, v: FloatArray, v_full: FloatArray, h: FloatArray, F_z: float, r: float) -> _Wheel:
    """What the water does to a rolling wheel at the speed v, of full speed v_full [m/s] and film h [m]."""
    L = contact.contact_share(v, v_full, exponent=tyre.exponent)  # type: ignore[arg-type]
    half = contact.contact_half_length(np.array(F_z), p=2.2e5, a_ref=0.07, F_z_ref=4000.0, p_ref=2.2e5)
    shift = SHIFTS * contact.load_shift(L, half, arm=tyre.arm) / r  # type: ignore[arg-type]
    film = water.film_drag(
        h, v, v, width=tyre.width, tread_capacity=tyre.capacity, h_film=H_FILM, relief=RELIEF  # type: ignore[arg-type]
    )  # fmt: skip
    wave = water.wave_drag(h, v, width=tyre.width, h_wave=H_WAVE)  # type: ignore[arg-type]
    gain = tyre.drag * water.skimming_share(v, v_full) / F_z
    return _Wheel(L, gain * film + shift, gain * wave)


def _end_of_contact(tyre: _Tyres, stop: FloatArray, h: FloatArray, F_z: float, r: float, mu: float) -> FloatArray:
    """Speed at which the contact ends of tyres whose free wheel stops at the speed `stop`. [m/s]"""
    low = np.ones(np.broadcast_shapes(stop.shape, tyre.exponent.shape, h.shape))
    high = 6.0 * low
    for _ in range(20):
        middle = 0.5 * (low + high)
        at = _wheel(tyre, stop, stop * middle, h, F_z, r)
        stops = mu * tyre.friction * contact.friction_ratio(at.L) < at.w + 0.011
        low, high = np.where(stops, middle, low), np.where(stops, high, middle)
    end: FloatArray = stop * 0.5 * (low + high)
    return end


def _prior(tyre: _Tyres) -> FloatArray:
    """How likely each full speed and water is before any evidence, (full speeds, waters).

    Of tyres and pressures that a car may have, by three laws that disagree: the
    simulator's, that of [gallaway1979], and `usf_speed`.
    """
    laws = (
        STOPS_AT * tyre.full(DEPTHS),
        gallaway_speed(DEPTHS, tyre.p, tread_depth=tyre.tread, texture_depth=TEXTURE),  # type: ignore[arg-type]
        usf_speed(DEPTHS, tyre.p, np.array(4000.0)),
    )  # (tyres, 1, 1, waters) each
    away = np.log(FULL_SPEEDS[:, None] / np.stack(laws)) / LAW_SD
    prior: FloatArray = np.exp(-0.5 * away * away).mean(axis=(0, 1, 2))
    prior /= prior.sum()
    return prior


def tables_of(vehicle: Vehicle) -> Tables:
    """Return the tables of a car; its mass, axles, radii and friction count."""
    front = vehicle.mass * G * vehicle.l_r / vehicle.wheelbase
    return _tables(
        0.5 * front, 0.5 * (vehicle.mass * G - front), vehicle.r_e_f, vehicle.r_e_r, vehicle.mu_max, vehicle.mass
    )


@lru_cache(maxsize=8)
def _tables(F_f: float, F_r: float, r_f: float, r_r: float, mu: float, mass: float) -> Tables:
    tyre = _drawn()
    v, stop, h = SPEEDS[None, :, None, None], FULL_SPEEDS[None, None, :, None], DEPTHS[None, None, None, :]
    end = _end_of_contact(tyre, stop, h, F_f, r_f, mu)
    front = _wheel(tyre, v, end, h, F_f, r_f)
    h_rear = water.residual_film(h, front.L, h_track=tyre.track_film)  # type: ignore[arg-type]
    later = np.clip(tyre.full(h_rear) / tyre.full(h), 1.0, 10.0)
    rear = _wheel(tyre, v, end * later, h_rear, F_r, r_r)
    R = 2.0 * ((front.w + front.wave) * F_f + (rear.w + rear.wave) * F_r) / mass
    M_f, M_r = (-2.0 * np.log(np.maximum(y.L, L_LEAST)) for y in (front, rear))
    f_f, f_r = (mu * tyre.friction * contact.friction_ratio(y.L) for y in (front, rear))
    columns = (
        R.mean(axis=0), R.std(axis=0), front.w.mean(axis=0), rear.w.mean(axis=0), front.w.std(axis=0),
        np.exp(M_f.mean(axis=0)), np.exp(M_r.mean(axis=0)), M_f.std(axis=0), f_f.mean(axis=0), f_r.mean(axis=0),
        front.L.mean(axis=0),
    )  # fmt: skip
    return Tables(np.ascontiguousarray(np.stack(np.broadcast_arrays(*columns), axis=-1)), _prior(tyre))
