"""The page of one drive: one file that needs no network, to be mailed and opened anywhere."""

from __future__ import annotations

from typing import Any

from aqualog.core.records import DriveResult
from aqualog.report import offline
from aqualog.report.drive import tables
from aqualog.report.drive.panels import drive_rows
from aqualog.report.drive.words import by_importance, verdict
from aqualog.report.reduce import DETAIL_SAMPLES, LONG_S, MARGIN_S, POINTS, Plan, make_plan
from aqualog.report.row import VEHICLE, Row
from aqualog.report.stack import groups, stack
from aqualog.report.theme import WHEEL_COLOURS

__all__ = ["drive_page"]

MOST_ROWS = (
    500  # of events in the page's text; a browser lays a longer table out slowly, so the script fills it by pages
)
FIRST_EVENTS = 200  # in the text of a page with more, for a reader without scripts


def drive_page(result: DriveResult, *, title: str) -> str:
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
    has_plots = bool(rows) and plan.n > 0
    return offline.render(
        "drive.html.j2",
        scripts=("drive.js",),
        islands={"drive-data": _data(result, rows, plan, events)},
        plotly="inside" if has_plots else "",
        title=title,
        kind="",
        about="aquaplaning in one drive",
        has_plots=has_plots,
        toggles=_toggles(rows),
        note=_long_note(result) or _reduction_note(plan, len(result.events)),
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
    )


def _data(result: DriveResult, rows: list[Row], plan: Plan, events: list[dict[str, Any]]) -> dict[str, Any]:
    """Everything that the script draws."""
    spans = [[round(e.start_s, 6), round(e.end_s, 6), int(e.severity == "full")] for e in result.events]
    document: dict[str, Any] = {"events": spans}
    if len(events) > MOST_ROWS:
        document["table"] = tables.event_columns(events)
    if rows and plan.n:
        document |= stack(rows, plan, result.signals.dt)
    return document


def _toggles(rows: list[Row]) -> list[dict[str, str]]:
    return [
        {"group": g, "label": g if g == VEHICLE else g.upper(), "colour": WHEEL_COLOURS.get(g, "")}
        for g in groups(rows)
    ]


def _long_note(result: DriveResult) -> str:
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
