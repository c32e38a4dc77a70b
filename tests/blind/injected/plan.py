"""Which effects a measured drive can show, and how large they are made: one to four times the stated limit of detection."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from tests.blind.injected.drives import Drive
from tests.blind.injected.physics import UNKNOWN, position, speed
from tests.blind.judging.answers import Answer, twins_of
from tests.blind.metrics.rows import key_of

__all__ = ["ASKS", "STEPS", "Z_AT_LIMIT", "Ask", "Planned", "planned"]

STEPS = (1.0, 1.5, 2.0, 3.0, 4.0)
Z_AT_LIMIT = 5.5
"""Whitened size of an effect at the limit: found in 90 of 100 drives (1.28) above a threshold of about 4.2 sigma (D); what the
vehicle file's spreads and the engine's tolerances forgive is forgiven in it, as it is in the limit."""


class Ask(NamedTuple):
    """An effect at a place. `needs`: signals, any of those with a bar; `most`: largest deviation from neutral that is made;
    `otherwise`: size where no limit is stated for it; `both`: either sign."""

    effect: str
    where: str | None
    parameter: str
    needs: tuple[str, ...]
    most: float
    neutral: float = 0.0
    otherwise: float = math.nan
    both: bool = True


_ANY_WHEEL = ("omega_fl",)
_PULL = ("torque_r|torque_f",)
ASKS: tuple[Ask, ...] = (
    Ask("payload_mass", None, "delta_mass", _PULL, 600.0, both=False),
    Ask("aero_drag", None, "delta_drag_area", _PULL, 0.6),
    Ask("head_wind", None, "speed", _PULL, 12.0),
    Ask("rolling_resistance", None, "delta_r_w", _PULL, 0.02),
    Ask("brake_drag", None, "torque", _PULL, 120.0, both=False),
    Ask("brake_drag", "rl", "torque", (*_PULL, *_ANY_WHEEL), 200.0, both=False),
    Ask("road_grade", None, "grade", ("a_x",), 0.08),
    Ask("road_grade", None, "rms", ("a_x", *_PULL), 0.04, otherwise=0.01, both=False),
    Ask("torque_gain", None, "gain", _PULL, 0.3, 1.0),
    Ask("signal_delay", "torque", "delay", _PULL, 0.6, both=False),
    Ask("signal_delay", "a_x", "delay", ("a_x",), 0.6, both=False),
    Ask("signal_delay", "v_x", "delay", ("v_x",), 0.8, both=False),
    Ask("signal_delay", "omega", "delay", _ANY_WHEEL, 0.6, both=False),
    Ask("accelerometer_bias", "a_x", "bias", ("a_x",), 1.0),
    Ask("accelerometer_gain", "a_x", "gain", ("a_x",), 0.3, 1.0),
    Ask("accelerometer_drift", "a_x", "drift", ("a_x",), 0.01),
    Ask("accelerometer_position", "a_x", "ahead", ("a_x", "yaw_rate"), 4.0),
    Ask("velocity_scale", "v_x", "scale", ("v_x", *_ANY_WHEEL), 0.1, 1.0),
    Ask("tyre_radius", "fl", "delta", _ANY_WHEEL, 0.05),
    Ask("tyre_radius", "rr", "delta", _ANY_WHEEL, 0.05),
    Ask("slip_stiffness", None, "gain", _ANY_WHEEL, 0.6, 1.0),
    Ask("tone_ring", "fl", "amplitude", _ANY_WHEEL, 0.02, otherwise=0.002, both=False),
)


class Planned(NamedTuple):
    """What goes into one case: (effect, place, values, whitened size) each, or one form with its values."""

    kind: str
    effects: tuple[tuple[str, str | None, dict[str, float], float | None], ...] = ()
    form: tuple[str, dict[str, float]] | None = None


def planned(drive: Drive, clean: Answer, kind: str, index: int, rng: np.random.Generator) -> Planned:
    """Case `index` of a kind: effects in turn, sizes in turn, signs and places drawn."""
    if kind == "null":
        return Planned(kind)
    if kind == "unknown":
        # a force shows in a torque: without one a form of it would be hidden from everybody
        names = [n for n, how in UNKNOWN.items() if how.mechanism != "force" or _has(drive, _PULL)]
        name = names[index % len(names)]
        return Planned(kind, form=(name, _form(name, drive, clean, STEPS[2 + index // len(names) % 3], rng)))
    asks = [a for a in ASKS if _has(drive, a.needs) and math.isfinite(_limit(a, clean))]
    asks = [a for a in asks if _limit(a, clean) <= a.most]
    if not asks:
        raise ValueError(f"{drive.car} {drive.trip}: no effect has a limit of detection in this drive: take another")
    first = asks[index % len(asks)]
    if kind == "known":
        return Planned(kind, (_sized(first, clean, STEPS[(index + index // len(asks)) % len(STEPS)], rng),))
    apart = [a for a in asks if a.effect != first.effect and a.effect not in twins_of(first.effect)]
    second = apart[int(rng.integers(len(apart)))]
    return Planned(kind, tuple(_sized(a, clean, STEPS[2 + int(rng.integers(3))], rng) for a in (first, second)))


def _has(drive: Drive, needs: Sequence[str]) -> bool:
    return all(any(n in drive.columns for n in need.split("|")) for need in needs)


def _limit(ask: Ask, clean: Answer) -> float:
    if ask.parameter == "rms":  # the limit is that of a constant slope
        return ask.otherwise
    return clean.limits.get(key_of(ask.effect, ask.where), ask.otherwise)


def _sized(ask: Ask, clean: Answer, step: float, rng: np.random.Generator) -> Any:
    limit = _limit(ask, clean)
    size = min(step * limit, ask.most)
    sign = float(rng.choice([-1.0, 1.0])) if ask.both else 1.0
    values = {ask.parameter: ask.neutral + sign * size}
    if ask.parameter == "rms":
        values |= {"wavelength": float(rng.uniform(500.0, 1200.0)), "phase": float(rng.random())}
    is_stated = key_of(ask.effect, ask.where) in clean.limits and ask.parameter != "rms"
    return ask.effect, ask.where, values, Z_AT_LIMIT * size / limit if is_stated else None


def _form(name: str, drive: Drive, clean: Answer, step: float, rng: np.random.Generator) -> dict[str, float]:
    """Values of a form: forces in units of the limit of rolling resistance, which is taken as 40 to 80 N.

    A file with a wide spread has a limit far above that, since a constant force is forgiven; a form is not.
    """
    v, t = speed(drive), drive.columns["t"]
    limits: Mapping[str, float] = clean.limits
    force = limits.get("rolling_resistance", math.nan) * drive.vehicle.mass * 9.80665
    force = float(np.clip(force, 40.0, 80.0)) if math.isfinite(force) else 60.0
    if name == "force_hump":
        low, high = np.quantile(v[v > 5.0], [0.3, 0.8])
        return {"force": 1.5 * step * force, "centre": float(rng.uniform(low, high)), "width": 2.5}
    if name == "force_step":
        length = min(75.0, 0.4 * float(t[-1]))
        return {
            "force": 1.5 * step * force,
            "start": float(rng.uniform(0.2, 0.9) * (t[-1] - length)),
            "duration": length,
        }
    if name == "accelerometer_speed":
        gain = limits.get("accelerometer_gain@a_x", 0.05)
        return {"rate": float(rng.choice([-1.0, 1.0])) * step * gain / max(float(np.std(v)), 2.0)}
    return {"force": 1.5 * step * force, "wavelength": float(np.clip(position(drive)[-1] / 12.0, 60.0, 700.0))}
