"""Remarks on what a drive does not show of the slip slope, and on what does not look like a road."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.core.records import SlopeSummary

__all__ = ["remarks"]

LEAST = 10.0  # [s] of driving before anything is said
MOST = 0.5  # share of it
RESTLESS = 12.0  # changes in ten minutes: roads change less often
TOO_STIFF = 0.1  # share of the driving
ALWAYS = 0.9  # share of the drive below half of the dry slope


def remarks(slopes: Sequence[SlopeSummary]) -> tuple[str, ...]:
    """Return notes for places where the estimator saw little; one sentence for places alike.

    Thesis: section 3.2 on equal slips (C95) and 3.3 on constant driving (C96); E10.
    """
    said: dict[str, list[str]] = {}
    for slope in slopes:
        for text in (_sentence(slope), _restless(slope), _always(slope), _stiff(slope), _own(slope)):
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
            "axle forces would show it"
        )
    if seconds["blind"] > MOST * judged:
        return "blind for most of the drive: hardly any traction on the driven wheels"
    if seconds["estimating"] < (1.0 - MOST) * judged:
        return (
            "traction too even for most of the drive to distinguish slope from radius; only sudden changes under a "
            "traction of 0.03 and more are found"
        )
    return ""


def _restless(slope: SlopeSummary) -> str:
    """Report more changes than a road has: something else is in the slip or in the torque."""
    driven = sum(slope.seconds[k] for k in ("estimating", "slope_frozen"))
    if slope.alarms < 4 or driven < 60.0 or slope.alarms * 600.0 <= RESTLESS * driven:
        return ""
    return (
        f"{slope.alarms} changes in {driven / 60.0:.0f} min of driving, more than a road has: brake torque that is "
        "not in the log, late or wrongly shared torque, wheel speeds that are noisy or swapped?"
    )


def _stiff(slope: SlopeSummary) -> str:
    """Report slip that hardly grows with the traction: then no drop can be found either."""
    if slope.stiff_s < max(LEAST, TOO_STIFF * (slope.seconds["estimating"] + slope.seconds["slope_frozen"])):
        return ""
    return (
        f"stiffer than any tyre for {slope.stiff_s:.0f} s, so that no drop can be found there: braking that neither "
        "torque nor brake_pressure shows, a wrong drivetrain, or swapped wheels?"
    )


def _always(slope: SlopeSummary) -> str:
    """Report a slope that is low from end to end: then the reference is in doubt, not the road."""
    if slope.judged_s < 2.0 * LEAST or slope.dropped_s < ALWAYS * slope.judged_s:
        return ""
    return (
        f"below half of the dry slope of {slope.reference:.0f} for {slope.dropped_s / slope.judged_s:.0%} of the time "
        "judged: is this the tyre that the vehicle file or the history means?"
    )


def _own(slope: SlopeSummary) -> str:
    """Report a drive that is its own reference: it cannot know what it began on."""
    if slope.reference_from != "this drive" or slope.judged_s < LEAST:
        return ""
    return (
        f"the dry slope of {slope.reference:.0f} is this drive's own: if it began on a slippery road, nothing shows. "
        "Give tyre.slip_slope_f and slip_slope_r in the vehicle file, or a --history"
    )
