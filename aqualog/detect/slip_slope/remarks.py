"""Sentences on what a drive could not tell about the slip slope."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.types import SlopeSummary

__all__ = ["blindness"]

LEAST = 10.0  # [s] of driving before anything is said
MOST = 0.5  # share of it


def blindness(slopes: Sequence[SlopeSummary]) -> tuple[str, ...]:
    """Notes for places where the estimator saw little; one sentence for places alike.

    Thesis: section 3.2 on equal slips (C95) and 3.3 on constant driving (C96); E10.
    """
    said: dict[str, list[str]] = {}
    for slope in slopes:
        text = _sentence(slope)
        if text:
            said.setdefault(text, []).append(slope.place)
    return tuple(f"slip slope ({', '.join(places)}): {text}" for text, places in said.items())


def _sentence(slope: SlopeSummary) -> str:
    seconds = slope.seconds
    judged = seconds["estimating"] + seconds["slope_frozen"] + seconds["blind"]
    if judged < LEAST:
        return ""
    if seconds["blind"] > MOST * judged and slope.beta is not None:
        return (
            "blind for most of the drive, both axles slip alike: another torque split or an active excitation of the "
            "axle forces would tell it"
        )
    if seconds["blind"] > MOST * judged:
        return "blind for most of the drive: hardly any traction on the driven wheels"
    if seconds["estimating"] < (1.0 - MOST) * judged:
        return "traction too even for most of the drive to tell slope from radius; sudden changes are still found"
    return ""
