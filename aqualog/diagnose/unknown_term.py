"""A function that was found in a residual as a term that a model can carry."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.records import Remainder
from aqualog.model.empirical import EMPIRICAL
from aqualog.model.term import Term
from aqualog.physics.load import G

__all__ = ["as_term"]

# channel and coordinates that the plant or the road has a table for
_CARRIED: dict[tuple[str, tuple[str, ...]], str] = {
    ("force_balance", ("v_x",)): "unexplained_force",
    ("kinematic", ("position",)): "unexplained_grade",
}
TAPER = 0.08  # of the range: beyond the driven range, the function falls to zero over this share
ROUGH = 0.15  # of the band's half width: knots that change the function by less are left out
SHORT_HOLE = 4  # points; a longer stretch without data is nominal


def as_term(remainder: Remainder, *, mass: float, response: float | None = None) -> Term | None:
    """The term that takes a remainder into the model.

    Parameters
    ----------
    remainder : Remainder
        Measured minus simulated.
    mass : float
        Of the car in the model. [kg]
    response : float, optional
        Change of the channel by one unit of the term (1 N against the motion, 1 rad uphill). Without: -1 / mass for a
        force on the acceleration (Newton), g for a slope angle on an accelerometer.

    Returns
    -------
    term : Term or None
        The function within the driven range; outside it falls to zero over a short distance. None if
        the model has no table for this channel over these coordinates, or the function is beyond physical bounds.
    """
    name = _CARRIED.get((remainder.channel, remainder.depends_on))
    if name is None:
        return None
    effect = EMPIRICAL[name]
    table = effect.table
    assert table is not None
    per_unit = response if response is not None else (-1.0 / mass if name == "unexplained_force" else G)
    x = remainder.x[:, 0]
    values = remainder.f / per_unit
    tolerance = ROUGH * float(np.nanmedian(np.abs((remainder.high - remainder.low) / (2.0 * per_unit))))
    reach = TAPER * float(np.ptp(x))
    knots: dict[float, float] = {}
    runs = _runs(np.isfinite(values))
    for i, (a, b) in enumerate(runs):
        before = table.x_low if i == 0 else 0.5 * (x[runs[i - 1][1] - 1] + x[a])
        after = table.x_high if i == len(runs) - 1 else 0.5 * (x[b - 1] + x[runs[i + 1][0]])
        inside = [a + int(k) for k in _needed(x[a:b], _filled(values[a:b]), tolerance)]
        for at, value in (
            (max(float(x[a]) - reach, before), 0.0),
            (min(float(x[b - 1]) + reach, after), 0.0),
            *((float(x[k]), float(_filled(values[a:b])[k - a])) for k in inside),
        ):
            knots[at] = value
    pairs = tuple(sorted(knots.items()))
    return None if table.fault(pairs) is not None else Term(effect, knots=pairs)


def _runs(known: FloatArray) -> list[tuple[int, int]]:
    """First and one past last of stretches of points with a value, short holes bridged."""
    at = np.flatnonzero(known)
    if at.size == 0:
        return []
    cuts = np.flatnonzero(np.diff(at) > SHORT_HOLE)
    starts, ends = at[np.r_[0, cuts + 1]], at[np.r_[cuts, at.size - 1]]
    return [(int(a), int(b) + 1) for a, b in zip(starts, ends, strict=True)]


def _filled(values: FloatArray) -> FloatArray:
    at, good = np.arange(values.size), np.isfinite(values)
    return np.asarray(np.interp(at, at[good], values[good]), dtype=np.float64)


def _needed(x: FloatArray, f: FloatArray, tolerance: float) -> list[int]:
    """Points between which straight lines stay within the tolerance (Douglas and Peucker [douglas1973])."""
    kept = {0, x.size - 1}
    todo = [(0, x.size - 1)]
    while todo:
        a, b = todo.pop()
        if b - a < 2:
            continue
        off = np.abs(f[a : b + 1] - np.interp(x[a : b + 1], x[[a, b]], f[[a, b]]))
        worst = a + int(np.argmax(off))
        if off[worst - a] > tolerance:
            kept.add(worst)
            todo += [(a, worst), (worst, b)]
    return sorted(kept)
