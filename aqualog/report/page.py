"""The page of one drive: one file that needs no network, to be mailed and opened anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from markupsafe import Markup

from aqualog import __version__
from aqualog.core.records import DriveResult
from aqualog.report import tables
from aqualog.report.event_columns import event_columns
from aqualog.report.figures.accelerations import accelerations
from aqualog.report.figures.lanes import lanes
from aqualog.report.figures.resistance import resistance
from aqualog.report.figures.row import VEHICLE, Row
from aqualog.report.figures.slip_slope import slip_slope
from aqualog.report.figures.speed_differences import speed_differences
from aqualog.report.figures.speeds import speeds
from aqualog.report.figures.stack import groups, stack
from aqualog.report.figures.statistics import statistics
from aqualog.report.figures.tie_rods import tie_rods
from aqualog.report.figures.water import water
from aqualog.report.offline import PLOTLY_HERE, TEMPLATES, content_policy, environment, json_island, with_plotly
from aqualog.report.reduce import DETAIL_SAMPLES, LONG_S, MARGIN_S, POINTS, Plan, make_plan
from aqualog.report.theme import WHEEL_COLOURS
from aqualog.report.verdict import by_importance, verdict

__all__ = ["drive_rows", "render_page", "write_page"]

MOST_ROWS = (
    500  # of events in the page's text; a browser lays a longer table out slowly, so the script fills it by pages
)
FIRST_EVENTS = 200  # in the text of a page with more, for a reader without scripts

_FIGURES = (speeds, lanes, speed_differences, accelerations, statistics, slip_slope, resistance, tie_rods, water)


def write_page(result: DriveResult, path: Path, *, title: str) -> None:
    """Write the page of one drive to exactly this path.

    Parameters
    ----------
    result : DriveResult
    path : Path
    title : str
        Names the drive; may hold anything, it is escaped.
    """
    path.write_bytes(render_page(result, title=title).encode("utf-8", "replace"))


def render_page(result: DriveResult, *, title: str) -> str:
    """The page of one drive as HTML; the same text for the same result.

    Parameters
    ----------
    result : DriveResult
    title : str
        Names the drive; may hold anything, it is escaped.
    """
    ranked = by_importance(result.events)
    plan = make_plan(ranked, result.signals.frame.height, result.signals.dt)
    rows = drive_rows(result)
    events = tables.event_rows(result)
    is_short = len(events) <= MOST_ROWS
    scripts = {"plotly": PLOTLY_HERE, "page": _text("page.js")}
    page = environment(TEMPLATES).get_template("page.html.j2").render(
        title=title,
        version=__version__,
        policy=content_policy(scripts.values()),
        # Markup only for the package's own files, plotly.js and data escaped by _data
        css=Markup(_text("page.css")),
        scripts={name: Markup(text) for name, text in scripts.items()},
        data=_data(result, rows, plan, events),
        has_plots=bool(rows) and plan.n > 0,
        toggles=_toggles(rows),
        note=_picture_note(result) or _reduction_note(plan, len(result.events)),
        has_water_label="on_water" in result.signals.frame.columns,
        verdict=verdict(result),
        facts=tables.head_facts(result),
        problems=tables.problems(result),
        events=events if is_short else events[:FIRST_EVENTS],
        events_left_out=0 if is_short else len(events) - FIRST_EVENTS,
        detectors=tables.detector_rows(result),
        slopes=tables.slope_rows(result),
        signals=tables.signal_rows(result),
        fault_columns=tables.fault_columns(),
        faults=tables.fault_rows(result),
    )  # fmt: skip
    return with_plotly(page)


def drive_rows(result: DriveResult) -> list[Row]:
    """The panels of a drive, from the top."""
    return [row for figure in _FIGURES for row in figure(result)]


def _text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _data(result: DriveResult, rows: list[Row], plan: Plan, events: list[dict[str, Any]]) -> Markup:
    """Everything that the script draws, as JSON that no HTML parser can leave."""
    spans = [[round(e.start_s, 6), round(e.end_s, 6), int(e.severity == "full")] for e in result.events]
    document: dict[str, Any] = {"events": spans}
    if len(events) > MOST_ROWS:
        document["table"] = event_columns(events)
    if rows and plan.n:
        document |= stack(rows, plan, result.signals.dt)
    return json_island(document)


def _toggles(rows: list[Row]) -> list[dict[str, str]]:
    return [
        {"group": g, "label": g if g == VEHICLE else g.upper(), "colour": WHEEL_COLOURS.get(g, "")}
        for g in groups(rows)
    ]


def _picture_note(result: DriveResult) -> str:
    """Note on the drawn data of a drive processed in windows, whose samples are not in the page."""
    if result.signals.full is None:
        return ""
    return (
        f"For this long drive the page holds the minimum and maximum of every {2.0 * result.signals.dt:g} s, so no "
        "outlier is lost. Use signals.parquet to look at events: it has every sample."
    )


def _reduction_note(plan: Plan, events: int) -> str:
    """Note on the samples that the page draws."""
    if plan.is_complete:
        return "Every sample is in this page; zoomed out, minima and maxima are drawn."
    text = f"The page holds about {POINTS} minima and maxima per line over the whole drive, so no outlier is lost."
    if not events:
        return text
    every = plan.events_in_full == events
    which = f"each of the {events} events" if every else f"{plan.events_in_full} of {events} events"
    if plan.events_in_full < events:
        which += f" (the most important ones; the page holds {DETAIL_SAMPLES} such samples per line)"
    return (
        f"{text} Every sample is kept from {MARGIN_S:g} s before to {MARGIN_S:g} s after {which}; "
        f"of events longer than {LONG_S:g} s, around beginning and end."
    )
