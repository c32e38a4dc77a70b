"""Published figures of aquaplaning as data (`published.toml`), and what a tyre of the simulator gives for each.

A published speed is no speed of a vanished contact. A free wheel is no longer turned, or a driven one spins up, while
some contact is left. So each point names its criterion, and the simulator's value comes from the same balance of
torques as in the simulation, for an even road: `full_speed`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from math import inf, isfinite, nan, sqrt
from typing import Any

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model.plant import F_Z_HALF_LENGTH, P_HALF_LENGTH
from aqualog.model.tyre import Tyre
from aqualog.physics.contact import contact_half_length, contact_share, friction_ratio, load_shift
from aqualog.physics.hydroplaning import SPIN_UP_RATIO
from aqualog.physics.water import film_drag, skimming_share, wave_drag

__all__ = [
    "CRITERIA", "MARKS", "QUANTITIES", "V_MOST", "Compared", "Condition", "Point", "compared", "contact", "drag",
    "full_speed", "points", "read", "rms", "simulated", "tyre_of",
]  # fmt: skip

KMH = 1.0 / 3.6  # [m/s]
MASS = 1650.0  # [kg] of the car that a drag in m/s² belongs to; both front wheels are in the water
MARKS = {"L": "read in an abstract or excerpt", "V": "seen where it is quoted", "K": "from memory, not verified"}
CRITERIA = ("spin-down", "15 % slip", "contact")
ASPECT = 1.2  # [-] width over length of the contact of a car tyre, 168 mm of tread (K) over its 140 mm
DEMAND = 0.3  # traction of a driven wheel in full acceleration near 80 km/h, over its load (D)
_SLOWED = 1.0 - 0.1 * (1.0 - float(SPIN_UP_RATIO))  # v_full of a wheel at 10 % spin-down over that of a rolling one
V_MOST = 200.0  # [km/h] a tyre that does not float up to here counts as if it did there
_SPEEDS = np.arange(3.0, V_MOST * KMH, 0.05)  # [m/s]

QUANTITIES = {
    "full_speed": "km/h", "contact": "-", "fade": "km/h", "drag": "m/s²", "drag_ratio": "-", "drag_by_speed": "-",
    "drag_by_depth": "-", "drag_peak": "-",
}  # fmt: skip
"""Quantities with their units."""

_NUMBERS = {"depth": (0.0, 50.0), "tread": (0.0, 20.0), "pressure": (0.5, 10.0), "load": (500.0, 20000.0)}
_SOME = {"speed": (1.0, 400.0), "aspect": (0.2, 4.0)}
_TEXTS = ("id", "quantity", "path", "mark", "source", "where")


@dataclass(frozen=True, slots=True)
class Condition:
    """Water [mm], tread [mm], gauge pressure [bar], wheel load [N], and for some quantities a speed. [km/h]

    `aspect`: width over length of the contact at that load and pressure, if it is not a modern car tyre's. [-]
    """

    depth: float
    tread: float
    pressure: float
    load: float
    speed: float = nan
    aspect: float = nan


@dataclass(frozen=True, slots=True)
class Point:
    """One published figure: `low` to `high` in the unit of its quantity, equal where one number is published.

    `tolerance`: how far beyond them the simulator may be. `over`: condition of the denominator of a ratio. `assumed`:
    what of the condition the source does not state. `mark`: key of `MARKS`. `source`: key of `docs/sources.toml`.
    `reason`: why the simulator is elsewhere, where it is.
    """

    id: str
    quantity: str
    low: float
    high: float
    tolerance: float
    at: Condition
    path: str
    mark: str
    source: str
    where: str
    criterion: str = ""
    over: Condition | None = None
    assumed: tuple[str, ...] = ()
    reason: str = ""

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return QUANTITIES[self.quantity]

    def deviation(self, value: float) -> float:
        """How far a value is beyond the published range, in its unit; 0 within it."""
        return value - min(max(value, self.low), self.high)


@dataclass(frozen=True, slots=True)
class Compared:
    """A point with the simulator's value and its deviation from the published range, in the point's unit."""

    point: Point
    value: float
    deviation: float

    @property
    def is_inside(self) -> bool:
        """Whether the value is within the tolerance; a value that is not finite is not."""
        return abs(self.deviation) <= self.point.tolerance


@cache
def points() -> tuple[Point, ...]:
    """All published points, in the order of the file.

    Raises
    ------
    ConfigError
        If the file is not whole.
    """
    return read(tomllib.loads(files("aqualog.model").joinpath("published.toml").read_text(encoding="utf-8")))


def read(raw: Mapping[str, Any]) -> tuple[Point, ...]:
    """Points from the tables of a file.

    Raises
    ------
    ConfigError
        If a key is missing, unknown or out of its bounds, or a point stands twice; the message names the point.
    """
    found = tuple(_point(table, i) for i, table in enumerate(raw.get("point", ())))
    ids = [p.id for p in found]
    twice = sorted({i for i in ids if ids.count(i) > 1})
    if twice:
        raise ConfigError(f"points of the same id: {', '.join(twice)}", where="published.toml", expected="one each")
    return found


def _point(table: Mapping[str, Any], i: int) -> Point:
    where = f"published.toml, point {table.get('id', i + 1)}"

    def fail(what: str, expected: str) -> ConfigError:
        return ConfigError(what, where=where, expected=expected)

    known = {*_TEXTS, *_NUMBERS, *_SOME, "low", "high", "tolerance", "criterion", "over", "assumed", "reason"}
    if strange := sorted(set(table) - known):
        raise fail(f"unknown key {strange[0]}", ", ".join(sorted(known)))
    if missing := [k for k in (*_TEXTS, *_NUMBERS, "low", "high", "tolerance") if k not in table]:
        raise fail(f"{missing[0]} is missing", "every key of the head of the file")
    texts = {k: table[k] for k in _TEXTS}
    if odd := next((k for k, v in texts.items() if not isinstance(v, str) or not v), None):
        raise fail(f"{odd} is no text", "a text")
    for name, among in (("quantity", QUANTITIES), ("mark", MARKS), ("path", ("straight", "curve"))):
        if texts[name] not in among:
            raise fail(f'{name} = "{texts[name]}"', f"one of {', '.join(among)}")
    at = _condition(table, where)
    low, high, tolerance = (_number(table, k, -inf, inf, where) for k in ("low", "high", "tolerance"))
    if not low <= high or tolerance <= 0.0:
        raise fail(f"low {low:g}, high {high:g}, tolerance {tolerance:g}", "low <= high, tolerance > 0")
    criterion = table.get("criterion", "")
    if (texts["quantity"] == "full_speed") != (criterion in CRITERIA):
        raise fail(f'criterion "{criterion}"', f"one of {', '.join(CRITERIA)} for full_speed, else none")
    needs_speed = texts["quantity"] not in ("full_speed", "fade", "drag_peak")
    if needs_speed != isfinite(at.speed):
        raise fail("speed is missing" if needs_speed else "speed is given", "a speed for contact and drag alone")
    if ("over" in table) != (texts["quantity"] == "drag_ratio"):
        raise fail("over", "the other condition, for drag_ratio alone")
    over = _condition({**table, **table["over"]}, where) if "over" in table else None
    assumed = tuple(table.get("assumed", ()))
    if odd := next((k for k in assumed if k not in (*_NUMBERS, "aspect")), None):
        raise fail(f"assumed {odd}", ", ".join((*_NUMBERS, "aspect")))
    return Point(
        low=low, high=high, tolerance=tolerance, at=at, criterion=criterion, over=over, assumed=assumed,
        reason=table.get("reason", ""), **texts,
    )  # fmt: skip


def _condition(table: Mapping[str, Any], where: str) -> Condition:
    given = {k: bounds for k, bounds in (_NUMBERS | _SOME).items() if k in _NUMBERS or k in table}
    return Condition(**{k: _number(table, k, *bounds, where) for k, bounds in given.items()})


def _number(table: Mapping[str, Any], name: str, low: float, high: float, where: str) -> float:
    value = table[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise ConfigError(f"{name} = {value!r} is no number", where=where, expected="a number")
    if not low <= value <= high:
        raise ConfigError(f"{name} = {value:g} is out of bounds", where=where, expected=f"{low:g} to {high:g}")
    return float(value)


def tyre_of(at: Condition, base: Tyre | None = None) -> Tyre:
    """The tyre of a condition: `base` (worn summer) with that depth of tread, and a contact of that aspect and the same
    area."""
    tyre = replace(base or Tyre(), tread_depth=at.tread * 1e-3)
    if not isfinite(at.aspect):
        return tyre
    own = ASPECT * sqrt(F_Z_HALF_LENGTH / at.load * at.pressure * 1e5 / P_HALF_LENGTH)
    longer = sqrt(own / at.aspect)
    return replace(tyre, half_length=tyre.half_length * longer, width=tyre.width / longer)


def full_speed(tyre: Tyre, at: Condition, criterion: str = "contact") -> float:
    """Speed at which a tyre floats on an even road. [km/h]

    Parameters
    ----------
    tyre : Tyre
    at : Condition
    criterion : str
        `contact`: no contact is left. `spin-down`: a free wheel 10 % slower is no longer turned by its contact.
        `15 % slip`: the traction of a driven wheel, `DEMAND` of its load, exceeds contact and resistance together.

    Returns
    -------
    v : float
        `V_MOST` where the tyre does not float up to there.

    Limits: no criterion gives more than `contact`. The tyre slides as a whole at 15 % slip, so its friction is (2.1).

    Source: the balance of torques of `model/wheel.py`; (2.1) of [fichtinger2024].
    """
    v_full = float(tyre.full_speed(np.asarray(at.depth * 1e-3), np.asarray(at.load), p=at.pressure * 1e5))
    if criterion == "contact":
        return min(v_full / KMH, V_MOST)
    floats = _SLOWED if criterion == "spin-down" else 1.0
    grip = _car().mu_max * tyre.mu_factor * tyre.wet_friction * friction_ratio(contact(tyre, at, _SPEEDS / floats))
    resistance = _wheel_force(tyre, at, _SPEEDS / floats) / at.load + _car().rolling_resistance
    margin = grip - resistance if criterion == "spin-down" else grip + resistance - DEMAND
    return min(_crossing(0.0, margin), v_full / KMH, V_MOST)


def drag(tyre: Tyre, at: Condition, v: FloatArray) -> FloatArray:
    """Resistance that the water adds to a rolling car of `MASS` with both front wheels in it. [m/s²]

    `v` in m/s. Film on the tread, bow wave and the shift of the load, without what a rear wheel meets in the track.

    Source: `film_drag`, `wave_drag`, `load_shift`.
    """
    wave = wave_drag(np.asarray(at.depth * 1e-3), v, width=tyre.width, h_wave=tyre.h_wave) * _skims(tyre, at, v)
    force: FloatArray = 2.0 * (_wheel_force(tyre, at, v) + wave) / MASS
    return force


def _skims(tyre: Tyre, at: Condition, v: FloatArray) -> FloatArray:
    v_full = tyre.full_speed(np.asarray(at.depth * 1e-3), np.asarray(at.load), p=at.pressure * 1e5)
    return skimming_share(v, v_full)


def contact(tyre: Tyre, at: Condition, v: FloatArray) -> FloatArray:
    """Share of the contact that is left at speeds (n,) [m/s] on an even road. [-]"""
    v_full = tyre.full_speed(np.asarray(at.depth * 1e-3), np.asarray(at.load), p=at.pressure * 1e5)
    return contact_share(v, v_full, exponent=tyre.contact_exponent)


def _wheel_force(tyre: Tyre, at: Condition, v: FloatArray) -> FloatArray:
    """What the water takes from the rotation of a wheel, as a force at its rim. [N] Rolls at `v`."""
    p, F_z, h_w = at.pressure * 1e5, np.asarray(at.load), np.asarray(at.depth * 1e-3)
    a = contact_half_length(F_z, p=p, a_ref=tyre.half_length, F_z_ref=F_Z_HALF_LENGTH, p_ref=P_HALF_LENGTH)
    shift = load_shift(contact(tyre, at, v), a, arm=tyre.wedge_arm) * F_z / _car().r_e_f
    film = film_drag(
        h_w, v, v, width=tyre.width, tread_capacity=tyre.tread_capacity, h_film=tyre.h_film, relief=tyre.groove_relief
    )
    force: FloatArray = shift + film * _skims(tyre, at, v)
    return force


@cache
def _car() -> Vehicle:
    return Vehicle()


def _crossing(level: float, y: FloatArray) -> float:
    """First speed at which a falling course over `_SPEEDS` reaches a level, between its points. [km/h]"""
    below = np.flatnonzero(y <= level)
    if not below.size:
        return V_MOST
    i = int(below[0])
    v = np.interp(level, y[[i, max(i - 1, 0)]], _SPEEDS[[i, max(i - 1, 0)]])
    return float(v) / KMH


def _share(point: Point, tyre: Tyre) -> float:
    return float(contact(tyre, point.at, np.array([point.at.speed * KMH]))[0])


def _fade(point: Point, tyre: Tyre) -> float:
    ratio = friction_ratio(contact(tyre, point.at, _SPEEDS))
    return _crossing(0.1, ratio) - _crossing(0.9, ratio)


def _drag(point: Point, tyre: Tyre) -> float:
    return float(drag(tyre, point.at, np.array([point.at.speed * KMH]))[0])


def _drag_ratio(point: Point, tyre: Tyre) -> float:
    assert point.over is not None
    v = np.array([point.at.speed * KMH])
    below = float(drag(tyre_of(point.over, tyre), point.over, v)[0])
    return _drag(point, tyre) / below if below > 0.0 else inf


def _by_speed(point: Point, tyre: Tyre) -> float:
    v = point.at.speed * KMH * np.array([0.95, 1.05])
    return float(np.diff(np.log(drag(tyre, point.at, v)))[0] / np.diff(np.log(v))[0])


def _by_depth(point: Point, tyre: Tyre) -> float:
    v = np.array([point.at.speed * KMH])
    depths = point.at.depth * np.array([0.95, 1.05])
    forces = [float(drag(tyre, replace(point.at, depth=float(d)), v)[0]) for d in depths]
    return float(np.diff(np.log(forces))[0] / np.diff(np.log(depths))[0])


def _peak(point: Point, tyre: Tyre) -> float:
    largest = float(_SPEEDS[int(np.argmax(drag(tyre, point.at, _SPEEDS)))]) / KMH
    return largest / full_speed(tyre, point.at)


_OF: dict[str, Callable[[Point, Tyre], float]] = {
    "full_speed": lambda p, tyre: full_speed(tyre, p.at, p.criterion), "contact": _share, "fade": _fade,
    "drag": _drag, "drag_ratio": _drag_ratio, "drag_by_speed": _by_speed, "drag_by_depth": _by_depth,
    "drag_peak": _peak,
}  # fmt: skip


def simulated(point: Point, base: Tyre | None = None) -> float:
    """The simulator's value for a point, in the point's unit; `base` (worn summer) gives all but the depth of tread."""
    return _OF[point.quantity](point, tyre_of(point.at, base))


def compared(base: Tyre | None = None, among: Sequence[Point] | None = None) -> tuple[Compared, ...]:
    """All points (or `among`) with the simulator's values; `base` as in `simulated`."""
    made = ((p, simulated(p, base)) for p in (points() if among is None else among))
    return tuple(Compared(p, value, p.deviation(value)) for p, value in made)


def rms(rows: Iterable[Compared], *, scaled: bool = False) -> float:
    """Root mean square of the deviations, those of one unit; `scaled`: of any units, each over its tolerance."""
    scores = np.array([r.deviation / (r.point.tolerance if scaled else 1.0) for r in rows])
    return float(np.sqrt(np.mean(scores**2))) if scores.size else nan
