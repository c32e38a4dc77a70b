"""How well the free numbers of the law of water are known, and tyres that are drawn from it.

The values are those of `tyre.Tyre`. Their spread is that of a fit to the published points, `python -m
tests.model.water_fit`. What the points do not say has the spread of its source: `v_anchor` by the thesis' pass at 118
km/h (C16), `h_track` and `h_film` by the sources of their keys.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.tyre import TYRE_KEYS, Tyre

__all__ = ["CORRELATION", "NAMES", "SD", "covariance", "drawn_tyre"]

NAMES = (
    "v_anchor", "pressure_exponent", "thin_gain", "tread_gain", "contact_exponent", "h_track", "h_film",
    "aspect_exponent",
)  # fmt: skip
"""Keys of a tyre: speed of full aquaplaning over pressure, depth and tread; n; clearing of the track; drag."""

SD = (0.4, 0.051, 0.071, 7.0, 0.49, 0.15e-3, 0.2e-3, 0.055)
"""Standard deviations, in the units of `tyre.TYRE_KEYS`."""

CORRELATION = {
    ("v_anchor", "thin_gain"): 0.30, ("v_anchor", "contact_exponent"): -0.11, ("thin_gain", "tread_gain"): 0.45,
    ("thin_gain", "contact_exponent"): 0.35, ("contact_exponent", "h_film"): 0.08,
    ("thin_gain", "aspect_exponent"): 0.28, ("tread_gain", "aspect_exponent"): 0.18,
    ("pressure_exponent", "tread_gain"): -0.12, ("pressure_exponent", "aspect_exponent"): -0.40,
}  # fmt: skip
"""Correlations of the fit; of pairs that are not named below 0.05."""


def covariance() -> FloatArray:
    """Covariance (8, 8) of the numbers in the order of `NAMES`, in their units."""
    c = np.eye(len(NAMES))
    for (a, b), r in CORRELATION.items():
        i, j = NAMES.index(a), NAMES.index(b)
        c[i, j] = c[j, i] = r
    return c * np.outer(SD, SD)


def drawn_tyre(tyre: Tyre, seed: int) -> Tyre:
    """Return a tyre whose water law is drawn about that of `tyre`, within the bounds of its keys.

    The same seed gives the same draw for every tyre, so that tyres of one run differ as they would without it.

    Source: `covariance`.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 24]))
    off = np.linalg.cholesky(covariance()) @ rng.standard_normal(len(NAMES))
    keys = (TYRE_KEYS[n] for n in NAMES)
    values = (float(np.clip(getattr(tyre, k.name) + x, k.low, k.high)) for k, x in zip(keys, off.tolist(), strict=True))
    return replace(tyre, **dict(zip(NAMES, values, strict=True)))  # type: ignore[arg-type]
