"""Roads that yield: a layer in series with the tread."""

from __future__ import annotations

from aqualog.core.records import FloatArray

__all__ = ["series_slope"]


def series_slope(slope: FloatArray, *, compliance: float) -> FloatArray:
    """Slip slope of a tyre on a road that yields, 1 / C = 1 / C_t + 1 / C_ground.

    Parameters
    ----------
    slope : array
        Slip slope of the tyre on rigid road, C_s / F_z. [-]
    compliance : float
        Inverse slip slope of the layer (snow, ice, gravel), >= 0. [-]

    Returns
    -------
    slope : array
        [-] Limits: compliance 0 (asphalt) leaves the tyre's own to the last bit; a soft layer rules alone.

    Thesis [fichtinger2024]: section 3.1 (C82).
    """
    return slope / (1.0 + slope * compliance)
