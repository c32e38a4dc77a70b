"""A function that was found in a residual: as a term that a model can carry, and in words."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.unknown_proxy import Choice
from aqualog.model.effects import EMPIRICAL
from aqualog.model.term import Term
from aqualog.physics.load import G

__all__ = ["as_term", "describe"]

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


_COORDINATES: dict[str, tuple[str, str]] = {
    "v_x": ("speed", "m/s"),
    "torque": ("torque", "N·m"),
    "a_x": ("acceleration", "m/s²"),
    "a_y": ("lateral acceleration", "m/s²"),
    "position": ("place on the road", "m"),
    "t": ("time", "s"),
    "water_depth": ("water depth", "m"),
    "ambient_temperature": ("air temperature", "K"),
    "slip": ("slip", "-"),
    "drive_sign": ("driving or braking", "-"),
    "steer_angle": ("steer angle", "rad"),
    "yaw_rate": ("yaw rate", "rad/s"),
}
_CHANNELS: dict[str, tuple[str, str]] = {
    "force_balance": ("force balance", "m/s²"),
    "kinematic": ("accelerometer against the change of speed", "m/s²"),
    "lateral": ("lateral acceleration", "m/s²"),
    "axle_slip": ("slip between the axles", "m/s"),
    "side_slip_f": ("slip between the front wheels", "m/s"),
    "side_slip_r": ("slip between the rear wheels", "m/s"),
    **{f"slip_{w}": (f"slip {w}", "m/s") for w in ("fl", "fr", "rl", "rr")},
    **{f"tie_rod_{w}": (f"tie rod {w}", "N") for w in ("fl", "fr")},
}
ALIKE = 0.9  # cosine from which a known effect looks nearly the same


def describe(
    channel: str, choice: Choice, x: FloatArray, f: FloatArray, low: FloatArray, high: FloatArray, share: float,
    nearest: str | None, cosine: float,
) -> str:  # fmt: skip
    """Sentences: the coordinate that the remainder depends on, its largest value, other explanations, similar effects.

    `x` (k, d), `f`, `low`, `high` (k,) as in a `Remainder`: NaN where the drive was not.
    """
    title, unit = _CHANNELS.get(channel, (channel, "?"))
    of = " and ".join(_word(n) for n in choice.names)
    text = f"The unexplained part of the {title} depends on {of} ({share:.0%} of the variance"
    sure = np.isfinite(f) & ((low > 0.0) | (high < 0.0))
    if sure.any():
        at = int(np.argmax(np.where(sure, np.abs(f), -1.0)))
        there = ", ".join(f"{v:.4g} {_unit(n)}".removesuffix(" -") for n, v in zip(choice.names, x[at], strict=True))
        text += f"; {f[at]:+.3g} {unit}".removesuffix(" -") + f" at {there}"
    text += ")."
    if choice.proxies:
        is_, are = ("is", "a proxy") if len(choice.proxies) == 1 else ("are", "proxies")
        text += f" {_list(choice.proxies).capitalize()} {is_} only {are}."
    plain = [e for e in choice.equals if not choice.along or e not in ("t", "position")]
    if plain:
        text += f" This drive cannot distinguish it from {_list(plain)}."
    if choice.along:
        text += " Without a second pass, a place on the road and a moment in time cannot be distinguished."
    if nearest is not None:
        alike = "looks nearly the same" if cosine >= ALIKE else "is the nearest known effect"
        text += f" {nearest} {alike} (similarity {cosine:.2f} of 1)."
    return text


def _word(name: str) -> str:
    return _COORDINATES.get(name, (name, ""))[0]


def _unit(name: str) -> str:
    return _COORDINATES.get(name, ("", "-"))[1]


def _list(names: tuple[str, ...] | list[str]) -> str:
    words = [_word(n) for n in names]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]
