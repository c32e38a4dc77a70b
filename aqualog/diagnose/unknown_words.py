"""The unexplained remainder, in a sentence."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.unknown_proxy import Choice

__all__ = ["describe"]

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
    "kinematic": ("accelerometer against wheel acceleration", "m/s²"),
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
