"""The page of `slip-slope`: one file that needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from markupsafe import Markup

from aqualog import __version__
from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope
from aqualog.report.figures.slip_scatter import slip_scatter
from aqualog.report.figures.slope_session import recursive_estimate, slope_over_session
from aqualog.report.figures.time_share import time_share
from aqualog.report.offline import TEMPLATES, content_policy, environment, json_island, plotly_js
from aqualog.report.slope_document import delay_sentence, way_sentence
from aqualog.report.theme import WHEEL_COLOURS
from aqualog.report.wording import number

__all__ = ["render_slope_page", "slope_plots", "write_slope_page"]


def write_slope_page(result: DirectResult, path: Path, *, title: str, notes: tuple[str, ...] = ()) -> None:
    """Write the page to exactly this path; arguments as `render_slope_page`."""
    path.write_bytes(render_slope_page(result, title=title, notes=notes).encode("utf-8", "replace"))


def render_slope_page(result: DirectResult, *, title: str, notes: tuple[str, ...] = ()) -> str:
    """The page as HTML; the same text for the same result.

    Parameters
    ----------
    result : DirectResult
    title : str
        Names the drive; may hold anything, it is escaped.
    notes : tuple of str
        On the files, beside those of the result; escaped too.
    """
    plots = slope_plots(result)
    scripts = {"plotly": plotly_js(), "page": _text("figures.js")}
    return environment(TEMPLATES).get_template("slope.html.j2").render(
        title=title,
        version=__version__,
        policy=content_policy(scripts.values()),
        # Markup only for the package's own files, plotly.js and what json_island has escaped
        css=Markup(_text("page.css") + _text("slope.css")),
        scripts={name: Markup(text) for name, text in scripts.items()},
        data=json_island(plots),
        plots=list(plots),
        facts=_facts(result),
        places=[_row(p) for p in result.places],
        recursions=[(r.place, number(r.slope, 1), number(r.slope_sd, 1), str(r.alarms)) for r in result.recursions],
        stability=[(p.place, p.stability.verdict, p.stability.sentence) for p in result.places],
        notes=[*notes, *result.notes],
    )  # fmt: skip


def _text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def slope_plots(result: DirectResult) -> dict[str, Any]:
    """Return the page's figures by name; those without content are left out."""
    plots: dict[str, Any] = {f"scatter-{i}": figure for i, figure in enumerate(slip_scatter(result))}
    plots |= {
        "session": slope_over_session(result),
        "recursive": recursive_estimate(result),
        "share": time_share(result),
    }
    return {name: figure for name, figure in plots.items() if figure is not None}


def _facts(result: DirectResult) -> list[tuple[str, str]]:
    return [
        ("vehicle", result.vehicle_name),
        ("duration", f"{number(result.duration_s / 60.0, 1)} min at {number(result.rate_hz)} Hz"),
        ("way", way_sentence(result)),
        ("traction up to", number(result.mu_max, 2)),
    ]


def _row(p: PlaceSlope) -> dict[str, Any]:
    line, end = p.line, p.recursion
    low, high = line.slope_ci
    return {
        "place": p.place.upper() if p.wheel else p.place,
        "colour": WHEEL_COLOURS.get(p.wheel or "", ""),
        "cells": [
            number(line.slope, 1),
            f"{number(low, 1)} … {number(high, 1)}" if line.told else "–",
            number(100.0 * line.offset, 2) if line.told else "–",
            str(line.samples),
            number(p.seconds, 1),
            f"{number(p.mu_range[0], 3)} … {number(p.mu_range[1], 3)}",
            number(100.0 * line.scatter, 3),
            f"{number(100.0 * line.attenuation, 1)}{' (corrected)' if line.is_corrected else ''}",
            f"{number(end.slope, 1)} ± {number(end.slope_sd, 1)}",
        ],
        "reason": f"not estimated: {line.reason}" if line.reason else delay_sentence(line),
    }
