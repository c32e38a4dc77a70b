"""Joint detector 2: one sum of the scaled statistics of all effects (thesis 2.11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Track

__all__ = ["TERMS", "JointCusumParams", "terms"]

TERMS = ("spin_up", "spin_down", "resistance", "minor_spin_down", "slip_slope_drop")


@dataclass(frozen=True, slots=True)
class JointCusumParams:
    """Scales of the terms; each reaches 1 at its scale and no more.

    `third` is the third term of (2.11): `resistance`, as the text has it, or `variance`, a CUSUM of the variance
    difference, as its printed index says (E6). `with_slope` adds the lost share of the slip slope, an option in the
    thesis. `gated`: the sum warns only while the resistance gate is open. A wheel that is braked or spun on ice, or a
    bus that loses messages, fills several terms at once, and the thesis calls resistance necessary.
    """

    g_up: float = 1.5  # [m/s]
    g_down: float = 1.5  # [m/s]
    g_resistance: float = 0.3  # [m/s]
    var_low: float = 0.5  # [(m/s^2)^2] what tooth noise and rough asphalt leave of the difference
    var_high: float = 4.0
    g_variance: float = 1.0  # [(m/s^2)^2 s]
    loss_low: float = 0.25  # [-] what load, grip and noise of the estimate cost on dry road
    loss_high: float = 0.75
    third: Literal["resistance", "variance"] = "resistance"
    with_slope: bool = True
    gated: bool = True
    weights: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0, 1.0)


def terms(
    p: JointCusumParams, tracks: Sequence[tuple[Track, BoolArray]], g_variance: FloatArray, n: int
) -> Mapping[str, FloatArray]:
    """Return the weighted terms of the sum, each by the wheel or side where it is largest.

    Parameters
    ----------
    p : JointCusumParams
    tracks : sequence of (Track, bool array (n,))
        Statistic of each single detector, and where it may count (no braking force on its wheel).
    g_variance : array (n,)
        CUSUM of the variance difference, used with `third = "variance"`. [(m/s²)^2 s]
    n : int
        Samples.

    Returns
    -------
    mapping
        Name in `TERMS` -> array (n,) within 0 and its weight; zero where a statistic is missing. With
        `third = "variance"` the term `resistance` holds that CUSUM.

    Thesis: Eq. (2.11). Departures (E6): the third term is g_RR / g_RR,max by default; the variance term is clamped at
    both ends, since as printed it is negative below its lower bound; sides and wheels enter by their largest value.
    """
    span = {
        "spin_up": (0.0, p.g_up),
        "spin_down": (0.0, p.g_down),
        "resistance": (0.0, p.g_resistance),
        "minor_spin_down": (p.var_low, p.var_high),
        "slip_slope_drop": (p.loss_low, p.loss_high),
    }
    out = {name: np.zeros(n) for name in TERMS}
    for track, counts in tracks:
        if track.detector not in out or (track.detector == "slip_slope_drop" and not p.with_slope):
            continue
        if track.detector == "resistance" and p.third == "variance":
            continue
        low, high = span[track.detector]
        scaled = np.clip((np.nan_to_num(track.statistic) - low) / (high - low), 0.0, 1.0)
        out[track.detector] = np.maximum(out[track.detector], np.where(counts, scaled, 0.0))
    if p.third == "variance":
        out["resistance"] = np.clip(np.nan_to_num(g_variance) / p.g_variance, 0.0, 1.0)
    return {name: weight * out[name] for name, weight in zip(TERMS, p.weights, strict=True)}
