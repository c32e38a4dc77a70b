"""What the motion of a drive says about a proposed channel: its unit, its sign, whether it is that signal at all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from aqualog.align.guess_units import CHOICES, Choice, UnitGuess, by_acceleration, by_factor, by_range, top_of
from aqualog.align.mapping import Entry
from aqualog.align.motion import Fit, Motion, derivative, fit, on_grid, smooth
from aqualog.core.records import Channel, FloatArray
from aqualog.core.units import is_unit, parse_unit

__all__ = [
    "CHECKS", "Known", "Proposal", "quantity_of", "settle_by_range", "speed_unit", "to_si", "with_unit",
]  # fmt: skip

_SURE = 0.7  # correlation from which a turned sign is proposed, not only said
_AS_WELL = 0.05  # correlations that differ by less are alike
_CLEAR = 0.9  # correlation from which an accelerometer shows the unit of a speed: no hill is in it
_FOLLOWS = 0.5  # below, a channel does not follow what it is compared with
_AXIS_SPREAD = 0.6  # of factors of accelerations and angles: grades, offsets, steering ratios, delays
_TURNS = 0.03  # scatter of the lateral acceleration from which the car turns at all [m/s^2]
_NOISE = 0.3  # of an acceleration: vibration, road, and what the wheels' difference does not show [m/s^2]
_WANDERS = 1.5  # of what a steering wheel would give that holds the car against wind, camber and water [m/s^2]
_EVEN = 0.15  # scatter of the derivative of a speed that hardly changes [m/s^2]
_BRAKES = 2.0  # deceleration from which the brakes are most of it [m/s^2]
_GRIP = 25.0  # lateral acceleration that no car on tyres holds for long [m/s^2]
_STEERS = 60.0  # steering ratio times wheelbase, at most [m]
_RADIUS = 0.32  # usual rolling radius [m]


@dataclass(frozen=True, slots=True)
class Proposal:
    """A channel proposed for a symbol, and why; `doubt` are other units that it may have."""

    entry: Entry
    reason: str
    score: float
    doubt: tuple[str, ...] = ()

    @property
    def remark(self) -> str:
        """The reason, with what is to be checked."""
        return f"{self.reason}; CHECK THE UNIT: it may be {' or '.join(self.doubt)}" if self.doubt else self.reason


_QUANTITIES = {
    "v_x": "speed", "a_x": "acceleration", "a_y": "acceleration", "yaw_rate": "yaw_rate",
    "steering_wheel_angle": "steering", "brake_pressure": "brake", "ambient_temperature": "temperature",
    "omega": "wheel", "torque": "torque", "pressure": "tyre_pressure", "tie_rod": "tie_rod",
}  # fmt: skip


def quantity_of(symbol: str) -> str:
    """Return the quantity among `CHOICES` of a symbol; empty if units of it are not guessed."""
    return _QUANTITIES.get(symbol) or _QUANTITIES.get(symbol.rpartition("_")[0], "")


def with_unit(p: Proposal, guess: UnitGuess | None) -> Proposal:
    """Return a proposal with a guessed unit; without one it is withdrawn."""
    if guess is None:
        return replace(p, score=-1.0)
    return replace(
        p, entry=replace(p.entry, unit=guess.unit), doubt=guess.doubt,
        reason=f"{p.reason}; the file gives no unit: {guess.unit} {guess.reason}",
    )  # fmt: skip


def settle_by_range(p: Proposal, channel: Channel) -> Proposal:
    """Return a proposal without a unit with that which its range suggests."""
    quantity = quantity_of(p.entry.symbol)
    if p.entry.unit or channel.info.unit or not quantity:
        return p
    return with_unit(p, by_range(channel.values, CHOICES[quantity]))


def to_si(p: Proposal, channel: Channel, raw: FloatArray) -> tuple[FloatArray, str]:
    """Return raw values (n,) in SI and their dimension; of a turning wheel the speed by a usual radius. [m/s]"""
    unit = p.entry.unit or channel.info.unit
    if not unit or not is_unit(unit):
        dimension = "angular_speed" if p.entry.symbol.startswith("omega_") else ""
        return raw * p.entry.scale * (_RADIUS if dimension else 1.0), dimension
    known = parse_unit(unit)
    x = (raw * known.factor + known.offset) * p.entry.scale
    is_turning = known.dimension == "angular_speed" and p.entry.symbol.startswith("omega_")
    return (x * _RADIUS if is_turning else x), known.dimension


# --- speeds ----------------------------------------------------------------------------------------------------------


class Known(NamedTuple):
    """A speed (n,) [m/s] whose unit is known, and its relative uncertainty."""

    name: str
    v: FloatArray
    spread: float


def speed_unit(
    raw: FloatArray, *, is_wheel: bool, known: Known | None, accelerometer: tuple[FloatArray, str] | None
) -> UnitGuess | None:
    """Guess the unit of a speed by its values (n,) on the grid.

    `accelerometer`: values (n,) and unit (empty if not known) of one along x.
    """
    choices = CHOICES["wheel" if is_wheel else "speed"]
    if known is not None:
        name, v, spread = known.name, known.v, known.spread
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = v / np.abs(raw)
        moves = (v > 3.0) & np.isfinite(ratio)
        if moves.sum() >= 20:
            factor = float(np.median(ratio[moves]))
            unit = by_factor(factor, choices, spread=spread)
            return None if unit is None else UnitGuess(unit, f"fits {name} (factor {factor:.4g} to m/s)")
    top = top_of(raw)
    allowed = [c for c in choices if c.least <= top <= c.most]
    if accelerometer is not None and allowed:
        a, unit = accelerometer
        follows = fit(derivative(raw), smooth(a))
        if abs(follows.r) >= _CLEAR:
            units = CHOICES["acceleration"]
            named = [c for c in units if unit and parse_unit(unit).factor == parse_unit(c.unit).factor]
            tall = top_of(a)
            guess = by_acceleration(
                follows.factor, allowed, named or [c for c in units if c.least <= tall <= c.most]
            )  # fmt: skip
            if guess is not None:
                return guess
    return by_range(raw, choices)


# --- what follows from the speed -------------------------------------------------------------------------------------


class _Size(NamedTuple):
    """How large a channel is in its own unit, and between what it must lie in SI."""

    raw: float
    least: float
    most: float

    def allows(self, choice: Choice) -> bool:
        """Whether the channel may have this unit; also where its size is not known."""
        si = self.raw * parse_unit(choice.unit).factor
        return not (si < self.least or si > self.most)


def _unit_by(
    p: Proposal, channel: Channel, found: Fit, spread: float, *, name: str = "", sizes: Sequence[_Size] = ()
) -> Proposal:
    """Return a proposal without a unit with the one in which it is as large as what it follows; else by its range.

    Units in which it would not have all of the `sizes` are ruled out, unless that leaves none.
    """
    if p.entry.unit or channel.info.unit:
        return p
    choices = CHOICES[quantity_of(p.entry.symbol)]
    choices = tuple(c for c in choices if all(size.allows(c) for size in sizes)) or choices
    unit = by_factor(found.factor, choices, spread=spread) if abs(found.r) >= _SURE else None
    if unit is not None:
        return with_unit(p, UnitGuess(unit, f"fits{name and f' {name}'}"))
    return with_unit(p, by_range(channel.values, choices))


def _scatter(x: FloatArray) -> float:
    return float(np.nanstd(x)) if np.isfinite(x).any() else np.nan


def _cornering(motion: Motion, lateral: FloatArray, noise: float = _NOISE) -> list[_Size]:
    """Bound the lateral acceleration (n,) that a channel means in SI: by the tyres, and by what the turning shows."""
    v = smooth(motion.v)
    seen = max((s for _, turn in motion.turns if np.isfinite(s := _scatter(v * turn))), default=np.nan)
    return [_Size(top_of(lateral), 0.0, _GRIP), _Size(_scatter(lateral), 0.0, 2.0 * seen + noise)]


def _turned(p: Proposal) -> Proposal:
    return replace(p, reason=f"{p.reason}: sign turned", entry=replace(p.entry, scale=-abs(p.entry.scale)))


def _acceleration(p: Proposal, channel: Channel, motion: Motion) -> Proposal:
    raw = smooth(on_grid(channel, motion.grid))
    _, found = _best(raw, [("", change) for change in motion.changes])
    changes = max(_scatter(change) for change in motion.changes)
    size = _Size(_scatter(raw), 0.3 * changes, 2.0 * changes + _NOISE)
    p = _unit_by(p, channel, found, _AXIS_SPREAD, sizes=[size])
    if np.isnan(found.r) or p.score < 0.0:
        return p
    p = replace(p, reason=f"{p.reason}; correlation {found.r:+.2f} with the derivative of the speed")
    if abs(found.r) < _FOLLOWS and changes < _EVEN:
        return replace(p, reason=f"{p.reason}: the speed changes too little to check it")
    if abs(found.r) < _FOLLOWS:
        return replace(p, reason=f"{p.reason}: not the car's a_x", score=-1.0)
    if found.r < 0:
        # a wrong sign is a guess too far for the map: said, and ranked behind any channel that needs none
        return replace(_turned(p), score=p.score - 1.0 - found.r)
    return replace(p, score=p.score + 2.0 * found.r)


def _best(raw: FloatArray, expected: Iterable[tuple[str, FloatArray]]) -> tuple[str, Fit]:
    """Return the first of what raw samples (n,) may follow that they follow about as well as any of it."""
    fits = [(name, fit(raw, x)) for name, x in expected]
    most = max((abs(f.r) for _, f in fits if np.isfinite(f.r)), default=np.nan)
    return next(((n, f) for n, f in fits if abs(f.r) >= most - _AS_WELL), ("", Fit(np.nan, np.nan)))


def _yaw(p: Proposal, channel: Channel, motion: Motion) -> Proposal:
    raw = smooth(on_grid(channel, motion.grid))
    name, found = _best(raw, motion.turns)
    p = _unit_by(p, channel, found, 3.0, sizes=_cornering(motion, smooth(motion.v) * raw))
    if np.isnan(found.r) or p.score < 0.0:
        return p
    if abs(found.r) < _FOLLOWS:
        return replace(p, reason=f"{p.reason}; the car turns too little to check its sign")
    p = replace(p, reason=f"{p.reason}; correlation {found.r:+.2f} with {name}")
    return _turned(p) if found.r < 0 else replace(p, score=p.score + found.r)


def _lateral(p: Proposal, channel: Channel, motion: Motion) -> Proposal:
    """The lateral acceleration follows v times yaw rate."""
    v = smooth(motion.v)
    expected = [(f"the speed times {name}", v * turn) for name, turn in motion.turns]
    turning = [(name, x) for name, x in expected if np.isfinite(x).any() and float(np.nanstd(x)) > _TURNS]
    raw = smooth(on_grid(channel, motion.grid))
    return _signed(p, channel, *_best(raw, turning), _AXIS_SPREAD, _cornering(motion, raw))


def _steering(p: Proposal, channel: Channel, motion: Motion) -> Proposal:
    """The steering wheel follows the yaw rate over the speed."""
    v = smooth(motion.v)
    with np.errstate(divide="ignore", invalid="ignore"):
        bends = [(f"{name} over the speed", np.where(v > 8.0, turn / v, np.nan)) for name, turn in motion.turns]
    raw = smooth(on_grid(channel, motion.grid))
    return _signed(p, channel, *_best(raw, bends), 1.0, _cornering(motion, v * v * raw / _STEERS, _WANDERS))


def _signed(p: Proposal, channel: Channel, name: str, found: Fit, spread: float, sizes: Sequence[_Size]) -> Proposal:
    """Return a proposal with its unit, and turned only where the correlation leaves no doubt."""
    p = _unit_by(p, channel, found, spread, sizes=sizes)
    if np.isnan(found.r) or p.score < 0.0:
        return p
    p = replace(p, reason=f"{p.reason}; correlation {found.r:+.2f} with {name}")
    return _turned(p) if found.r < -_SURE else replace(p, score=p.score + abs(found.r))


def _brake(p: Proposal, channel: Channel, motion: Motion) -> Proposal:
    raw = on_grid(channel, motion.grid)
    is_pressed = raw > 0.05 * top_of(channel.values)
    slows = -motion.changes[0]
    found = fit(np.where(is_pressed, smooth(raw), np.nan), slows)
    if not np.nanmax(slows, initial=0.0) > _BRAKES:  # drag and engine slow the car as much
        found = Fit(np.nan, np.nan)
    return _unit_by(p, channel, found, _AXIS_SPREAD, name="the deceleration")


CHECKS: Mapping[str, Callable[[Proposal, Channel, Motion], Proposal]] = {
    "a_x": _acceleration,
    "yaw_rate": _yaw,
    "a_y": _lateral,
    "steering_wheel_angle": _steering,
    "brake_pressure": _brake,
}
"""How a proposal of a signal is compared with the motion; it comes back with its unit and sign, or withdrawn."""
