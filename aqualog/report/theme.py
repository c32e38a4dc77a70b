"""Colours: the same wheel and the same detector look the same in every row, table and lane."""

from __future__ import annotations

from typing import Any

__all__ = [
    "EVENT_SHADE", "FULL_SHADE", "GRID", "INK", "LIGHT", "MUTED", "OTHER_SHADE", "THRESHOLD", "WATER",
    "WATER_SHADE", "WHEEL_COLOURS", "detector_colour", "in_light", "wheel_colour",
]  # fmt: skip

# Okabe and Ito's palette [okabe2008]: distinguishable with any common colour blindness, on white and on dark ground,
# and in grey print.
WHEEL_COLOURS = {"fl": "#0072B2", "fr": "#D55E00", "rl": "#009E73", "rr": "#CC79A7"}
_DETECTOR_COLOURS = {"resistance": "#E69F00", "tie_rod": "#7F6BB3", "slip_slope_drop": "#8C6D31"}

# Placeholders that the page's script replaces by the text colours of the light or the dark scheme.
INK = "@ink"
MUTED = "@muted"
LIGHT = {INK: "#1f2933", MUTED: "#5b6671", "@paper": "#ffffff"}
"""The placeholders in the light scheme of the pages."""

GRID = "rgba(128,128,128,0.22)"
THRESHOLD = "#B2182B"
WATER = "#3A9BDC"
WATER_SHADE = "rgba(58,155,220,0.65)"
EVENT_SHADE = "rgba(230,159,0,0.13)"
FULL_SHADE = "rgba(178,24,43,0.13)"
OTHER_SHADE = "rgba(128,128,128,0.16)"


def wheel_colour(wheel: str | None) -> str:
    """Colour of a wheel; the text colour for what belongs to no wheel."""
    return WHEEL_COLOURS.get(wheel or "", INK)


def detector_colour(detector: str, wheel: str | None) -> str:
    """Colour of a detector's line or lane: that of its wheel where it watches one."""
    return wheel_colour(wheel) if wheel in WHEEL_COLOURS else _DETECTOR_COLOURS.get(detector, INK)


def in_light(figure: Any) -> Any:
    """Return a figure, or part of one, with the colours of the light scheme in place of the placeholders."""
    if isinstance(figure, dict):
        return {k: in_light(v) for k, v in figure.items()}
    if isinstance(figure, list):
        return [in_light(v) for v in figure]
    return LIGHT.get(figure, figure) if isinstance(figure, str) else figure
