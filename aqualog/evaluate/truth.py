"""Derive labels from the simulated truth: the contact of each wheel and the water before it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.evaluate.labels import AQUAPLANING, Label, Labels, Span, joined

__all__ = ["CONTACT_FULL", "CONTACT_PARTIAL", "TRUTH_STEMS", "spans_of", "truth_labels"]

TRUTH_STEMS = ("true_contact", "true_film")
CONTACT_FULL = 0.05  # [-] share of the contact length that is left
CONTACT_PARTIAL = 0.7
FULL_S, FULL_GAP_S = 0.1, 0.3  # [s] least length; gaps below are closed
PARTIAL_S = 1.0  # [s] least length without a break
V_MIN = 5.0  # [m/s] below, no tyre floats


def truth_labels(t: FloatArray, columns: Mapping[str, FloatArray]) -> Labels | None:
    """Return labels of a simulated drive.

    Parameters
    ----------
    t : array (n,)
        Increasing. [s]
    columns : mapping name -> array (n,)
        `true_contact_fl` ... [-]; `true_film_fl` ... [m] and `on_water` as far as they are there; `true_v_x` or `v_x`
        [m/s]. NaN is no aquaplaning.

    Returns
    -------
    Labels, or None
        None without the contact of any wheel. `full` on a wheel: contact below 0.05 for 0.1 s, gaps below 0.3 s closed;
        `partial`: below 0.7 without a break for 1 s; both faster than 5 m/s. `water`: a film before any wheel, or
        `on_water`.
    """
    wheels = [w for w in WHEELS if f"true_contact_{w}" in columns]
    if not wheels:
        return None
    items: list[Label] = []
    v_x = columns.get("true_v_x", columns.get("v_x"))
    with np.errstate(invalid="ignore"):
        is_fast = np.ones(t.size, dtype=bool) if v_x is None else v_x > V_MIN
        for w in wheels:
            contact = columns[f"true_contact_{w}"]
            full = [s for s in spans_of(t, (contact < CONTACT_FULL) & is_fast) if s[1] - s[0] >= FULL_S - 1e-9]
            items += [Label(a, b, "full", w) for a, b in joined(full, FULL_GAP_S)]
            partial = spans_of(t, (contact < CONTACT_PARTIAL) & is_fast)
            items += [Label(a, b, "partial", w) for a, b in partial if b - a >= PARTIAL_S - 1e-9]
        wet = np.zeros(t.size, dtype=bool)
        for w in WHEELS:
            if f"true_film_{w}" in columns:
                wet |= columns[f"true_film_{w}"] > 0.0
        if "on_water" in columns:
            wet |= columns["on_water"] > 0.5
    items += [Label(a, b, "water") for a, b in spans_of(t, wet)]
    return Labels(tuple(items), frozenset(AQUAPLANING), "simulated truth")


def spans_of(t: FloatArray, bits: BoolArray) -> list[Span]:
    """Return stretches in which a bit is set; a sample lasts until the next one, the last as long as the one before."""
    if t.size == 0:
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bits, [False]]).astype(np.int8)))
    ends = np.append(t, 2.0 * t[-1] - t[-2] if t.size > 1 else t[-1])
    return [(float(t[a]), float(ends[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
