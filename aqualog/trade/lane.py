"""Where in a drive the watered stretch is: from its signals, or from what the campaign says."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Signals

__all__ = ["Side", "Span", "depth_of", "mean_over", "no_lane", "spans_of", "tracks_of", "wet_side_of"]

Span = tuple[float, float]
"""Begin and end of a stretch from the log's first sample. [s]"""
Side = Literal["left", "right"]

NO_LANE = "no watered lane in the log: no on_water, no water depth, and no lane_start_s and lane_end_s in the campaign"
DEPTHS = ("water_depth", "water_depth_left", "water_depth_right")
JOINED_S = 0.5  # [s] a shorter gap in the label is a flicker of the gate, not the lane's end
LEAST_S = 0.2  # [s] a shorter stretch is no lane
SHARE = 0.1  # of the deeper track's water; with less the other track is dry
WET = 1e-4  # [m] less is a damp road


def spans_of(signals: Signals, given: Span | None = None, least: float = LEAST_S) -> tuple[Span, ...]:
    """Return the stretches on water that last at least so long [s], in order of time.

    `given` is the lane of the campaign; else `on_water` counts, else the depths in the log. Empty without any.
    """
    if given is not None:
        return (given,)
    t = signals.array("t")
    wet: BoolArray = signals.array("on_water") > 0.5
    if not wet.any():
        wet = np.any([signals.array(n) > WET for n in DEPTHS], axis=0)
    if not wet.any():
        return ()
    edges = np.diff(np.concatenate([[0], wet.astype(np.int8), [0]]))
    spans: list[Span] = []
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True):
        begin, end = float(t[first]), float(t[last])
        if spans and begin - spans[-1][1] < JOINED_S:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((begin, end))
    return tuple(s for s in spans if s[1] - s[0] >= least)


def no_lane(signals: Signals) -> str:
    """Return why a drive has no stretch on water: none at all, or one that is too short."""
    longest = max((b - a for a, b in spans_of(signals, least=0.0)), default=math.nan)
    label = signals.array("on_water")
    if not longest >= 0.0 and np.isfinite(label).any():
        return f"on_water is never 1 in the log, which ends at {float(signals.array('t')[-1]):.1f} s"
    return f"the water in the log lasts {longest:.2f} s, a lane at least {LEAST_S:g} s" if longest >= 0.0 else NO_LANE


def tracks_of(signals: Signals, span: Span, depths: tuple[float, float] | None = None) -> tuple[float, float] | None:
    """Return the water in the left and right track [m]: `depths` of the campaign, else the log's; None without both."""
    if depths is not None and all(math.isfinite(d) for d in depths):
        return depths
    t = signals.array("t")
    inside = (t >= span[0]) & (t <= span[1])
    columns = [signals.array(f"water_depth_{s}")[inside] for s in ("left", "right")]
    if not all(np.isfinite(c).any() for c in columns):
        return None
    return float(np.nanmedian(columns[0])), float(np.nanmedian(columns[1]))


def depth_of(signals: Signals, span: Span) -> float:
    """Return the deepest water that the log has over a stretch, median over time. [m] NaN where it has none."""
    t = signals.array("t")
    inside = (t >= span[0]) & (t <= span[1])
    seen = [signals.array(n)[inside] for n in DEPTHS]
    return max((float(np.nanmedian(x)) for x in seen if np.isfinite(x).any()), default=math.nan)


def wet_side_of(left: float, right: float) -> Side | None:
    """Return the side that is in water [m] while the other one is dry, or has at most a tenth of it; None: neither."""
    if max(left, right) <= WET or min(left, right) > SHARE * max(left, right):
        return None
    return "left" if left > right else "right"


def mean_over(x: FloatArray, seconds: float, dt: float) -> FloatArray:
    """Return the centred mean over an odd number of samples; NaN where one of them is NaN, and at the ends."""
    width = max(1, 2 * round(0.5 * (seconds / dt - 1.0)) + 1)
    if width == 1:
        return x
    if x.size < width:
        return np.full_like(x, np.nan)
    half = width // 2
    out = np.full(x.size, np.nan)
    out[half : x.size - half] = np.lib.stride_tricks.sliding_window_view(x, width).mean(axis=1)
    return out
