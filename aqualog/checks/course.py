"""Turning by latitude and longitude: a witness that no signal map turns by mistake."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["turning_by_course"]

_REACH_S = 1.0  # [s] of a chord: GNSS of 1 Hz, joined by straight lines, has no curve within
_LEAST = 2.0  # [m] of a chord: shorter ones have the direction of the noise
_RADIUS = 6_371_000.0  # [m] of the earth; a share of it is the same for both chords


def turning_by_course(latitude: FloatArray, longitude: FloatArray, v: FloatArray, step_s: float) -> FloatArray:
    """Return speed times rate of the course (n,), left positive, NaN where it is not known. [m/s²]

    Parameters
    ----------
    latitude, longitude : array (n,)
        [deg]
    v : array (n,)
        [m/s]
    step_s : float
        [s]

    The rate is the turn from the straight line that leads to a place to the one that leaves it.
    """
    reach = max(1, round(_REACH_S / step_s))
    out = np.full(v.size, np.nan)
    if v.size <= 2 * reach:
        return out
    east = np.radians((np.diff(longitude) + 180.0) % 360.0 - 180.0) * np.cos(np.radians(latitude[1:])) * _RADIUS
    north = np.radians(np.diff(latitude)) * _RADIUS
    chord = _sums(east, reach) + 1j * _sums(north, reach)
    chord = np.where(np.abs(chord) >= _LEAST, chord, np.nan)
    turn = np.angle(chord[reach:] * np.conj(chord[:-reach]))
    out[reach:-reach] = v[reach:-reach] * turn / (reach * step_s)
    return out


def _sums(x: FloatArray, k: int) -> FloatArray:
    """Return the sums of k neighbours, NaN where one is not known. Shape (n - k + 1,)."""
    return np.asarray(np.lib.stride_tricks.sliding_window_view(x, k).sum(axis=1))
