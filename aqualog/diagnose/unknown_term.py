"""A function that was found in a residual: as a term that a model can carry, and in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import CHANNELS
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.shapes import MECHANISMS, Mechanism, Shape
from aqualog.diagnose.words import listed, name_of, quantity
from aqualog.model.effects import EMPIRICAL
from aqualog.model.term import Term

__all__ = ["COORDINATES", "as_term", "describe", "form_of", "short_form"]

_CARRIED = ("force", ("v_x",))  # mechanism and coordinate that the plant has a table for
TAPER = 0.08  # of the range: beyond the driven range, the function falls to zero over this share
SHORT_HOLE = 4  # points; a longer stretch without data is nominal


def as_term(remainder: Remainder) -> Term | None:
    """The term that takes a remainder into the model: the function within the driven range, zero a little outside; None
    if the model has no table for it, or beyond physical bounds."""
    x, at = remainder.x[:, 0], np.flatnonzero(np.isfinite(remainder.f))
    if (remainder.mechanism, remainder.depends_on) != _CARRIED or not at.size:
        return None
    effect = EMPIRICAL["unexplained_force"]
    table = effect.table
    assert table is not None
    cuts = np.flatnonzero(np.diff(at) > SHORT_HOLE)
    first, last = x[at[np.r_[0, cuts + 1]]], x[at[np.r_[cuts, at.size - 1]]]
    middle, reach = 0.5 * (last[:-1] + first[1:]), TAPER * float(np.ptp(x))
    zero = [
        *np.maximum(first - reach, np.r_[table.x_low, middle]),
        *np.minimum(last + reach, np.r_[middle, table.x_high]),
    ]
    known = dict(zip(x[at].tolist(), remainder.f[at].tolist(), strict=True))
    pairs = tuple(sorted((dict.fromkeys(map(float, zero), 0.0) | known).items()))
    return None if table.fault(pairs) is not None else Term(effect, knots=pairs)


class Coordinate(NamedTuple):
    """Title and unit of a coordinate in sentences; its unit on pages, and factor and offset to that."""

    title: str
    unit: str
    page_unit: str
    factor: float = 1.0
    offset: float = 0.0


COORDINATES = {
    "v_x": Coordinate("speed", "m/s", "km/h", 3.6),
    "torque": Coordinate("torque", "N·m", "N·m"),
    "a_x": Coordinate("acceleration", "m/s²", "m/s²"),
    "a_y": Coordinate("lateral acceleration", "m/s²", "m/s²"),
    "position": Coordinate("place on the road", "m", "m"),
    "t": Coordinate("time", "s", "s"),
    "water_depth": Coordinate("water depth", "m", "mm", 1e3),
    "ambient_temperature": Coordinate("air temperature", "K", "°C", 1.0, -273.15),
    "steer_angle": Coordinate("steer angle", "rad", "rad"),
    "yaw_rate": Coordinate("yaw rate", "rad/s", "rad/s"),
    "since_braking": Coordinate("time since braking", "s", "s"),
    "angle": Coordinate("angle of the wheel", "rad", "turns", 0.5 / math.pi),
    "depth": Coordinate("water depth", "m", "mm", 1e3),  # of a campaign's runs, like the next ones
    "pressure": Coordinate("gauge pressure", "Pa", "bar", 1e-5),
    "load": Coordinate("load", "kg", "kg"),
}
_CHANNELS = {
    "kinematic": "accelerometer against the change of speed", "lateral": "lateral acceleration",
    "axle_slip": "slip between the axles", "side_slip_f": "slip between the front wheels",
    "side_slip_r": "slip between the rear wheels",
}  # fmt: skip
ALIKE = 0.9  # cosine from which a known effect looks nearly the same
LEAST_ALIKE = 0.5  # and from which it is named at all


def describe(mechanism: Mechanism, r: Remainder, instead: Sequence[Mechanism] = ()) -> str:
    """Sentences: mechanism and coordinate, its surest value, coordinates and mechanisms that explain it as well,
    similar effects."""
    title = _CHANNELS.get(r.channel) or (CHANNELS[r.channel].title if r.channel in CHANNELS else r.channel)
    title = f"{title[:1].lower()}{title[1:]}"
    how = r.manner or f"goes with {_over(r.depends_on, mechanism.name)}"
    text = f"Unexplained: {mechanism.title} {how} (probability {r.probability:.2f}"
    text += f"; {r.share:.0%} of the variance of the {title}"
    sure = np.isfinite(r.high) & ((r.low > 0.0) | (r.high < 0.0))  # a band without an end says no size
    if sure.any():
        # the largest one may stand at an end, where hardly anybody drove
        rank = np.where(sure, np.abs(r.f) / (r.high - r.low), -1.0)
        # of an interval all values are as sure, those on its slopes too
        at = int(np.argmax(np.where(rank > 0.999 * rank.max(), np.abs(r.f), -1.0)))
        near = [_place(v, x) for v, x in zip(r.x[at].tolist(), r.x.T, strict=True)]
        there = ", ".join(f"{v} {COORDINATES[n].unit}" for n, v in zip(r.depends_on, near, strict=True))
        text += f"; {_size(mechanism, float(r.f[at]))} at {there}"
    text += ")."
    for alike in ([m.title for m in instead], [f"one that goes with {_over([n])}" for n in r.proxies]):
        text += f" It cannot be distinguished from {listed(alike)} here." if alike else ""
    # what comes again at equal ways does not at equal times, unless the speed never changes: then both are likely
    if {"t", "position"} & set(r.depends_on) and not r.manner.startswith(("in waves", "for ")):
        text += " Without a second pass, a place on the road and a moment in time cannot be distinguished."
    if r.nearest is not None and r.cosine >= LEAST_ALIKE:
        same = "looks nearly the same" if r.cosine >= ALIKE else "is nearest"
        known, _, where = r.nearest.partition("@")
        text += f" Of known effects, {name_of(known, where or None)} {same} (similarity {r.cosine:.2f} of 1)."
    return text


def _place(value: float, points: FloatArray) -> str:
    """A coordinate with the digits that the distance of its points has."""
    step = float(np.diff(np.unique(points)).min(initial=math.inf))
    digits = math.floor(math.log10(step)) if 0.0 < step < math.inf else -3
    return f"{round(value, -digits) + 0.0:.{max(0, -digits)}f}"


def _size(mechanism: Mechanism, f: float) -> str:
    """`-6.2%` of what it is, `501 N against the motion`."""
    if mechanism.name == "force":
        return f"{quantity(abs(f), mechanism.unit)} {'against' if f > 0.0 else 'with'} the motion"
    return f"{100.0 * f:+.3g}%" if mechanism.unit == "-" else quantity(f, mechanism.unit, change=True)


def short_form(remainder: Remainder) -> str:
    """`a force on the car that goes with speed`, `a force on the car from 66 s to 145 s`."""
    elsewhere = "" if remainder.manner else remainder.channel
    title = next((m.title for m in MECHANISMS if m.name == remainder.mechanism), elsewhere)
    return _short(title, remainder.manner, remainder.depends_on, remainder.mechanism)


def form_of(shape: Shape) -> str:
    """The same of a shape."""
    return _short(shape.mechanism.title, shape.manner, shape.coordinates, shape.mechanism.name)


def _short(title: str, manner: str, names: Sequence[str], mechanism: str | None) -> str:
    return f"{title} {manner or f'that goes with {_over(names, mechanism)}'}".strip()


def _over(names: Sequence[str], mechanism: str | None = "") -> str:
    return " and ".join("its own size" if n == mechanism else COORDINATES[n].title for n in names)
