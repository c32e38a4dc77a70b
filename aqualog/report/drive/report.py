"""A drive's result as sections: the verdict first, then episodes, events, signals over time, detectors, sources.

The order of `drive_report` is that of the page. A new kind of finding is a section there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from aqualog.core.errors import listed
from aqualog.core.judgement import Episode, Judgement
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, Event, SlopeSummary, TimeFaults
from aqualog.report.drive.judged import (
    EPISODE_HEADS,
    FOLDED,
    card_lines,
    episode_cells,
    folded_line,
    headline,
    judged_by,
    level,
    margin_lines,
)
from aqualog.report.drive.panels import drive_rows
from aqualog.report.drive.route import route_figure
from aqualog.report.drive.stack import VEHICLE, groups, stack
from aqualog.report.inputs import input_sections, without_remarks
from aqualog.report.page import report_page
from aqualog.report.reduce import DRIVE, LONG_S, POINTS, Plan, make_plan
from aqualog.report.sections import Cell, Figures, Headline, Line, Lines, Para, Part, Report, Section, Stack, Table
from aqualog.report.theme import WHEEL_COLOURS
from aqualog.report.values import counted, number, place, pretty_unit
from aqualog.report.wording import detector_name, evidence_parts, not_judged, speed_kmh

__all__ = ["EVENT_HEADS", "by_importance", "drive_page", "drive_report", "event_cells", "lacking"]

MOST_ROWS = 500  # of events in the page's text: a browser lays a longer table out slowly, so the script fills it
FIRST_EVENTS = 200  # in the text of a page with more, for a reader without scripts
MOST_TEXT = 20  # events that a terminal shows with those of folded episodes among them
EVENT_HEADS: Sequence[str | tuple[str, str]] = (
    "Detector", "Where", ("Start [s]", "from s"), ("End [s]", "to s"), ("Duration [s]", ""), "Severity",
    ("Peak / threshold", "peak / limit"), ("v_x [km/h]", "v km/h"), "Evidence",
)  # fmt: skip
_EPISODE_WORDS = (0, 3, 4, 10)
_ROUTE = (
    "Metres from the first position. A click on an episode zooms all plots to it. No map: the page needs no network."
)
_HINT = "click a row (or Enter) to zoom all plots to it; click a head to sort"
_SLOPES = (
    "Where", "At the end", "Dry", "Dry from", ("Compared [s]", ""), ("Estimated [s]", "estimated s"),
    ("Traction too even [s]", "too even s"), ("Blind [s]", "blind s"), ("Not active [s]", "not active s"),
    ("Changes", ""), ("Not active because", ""),
)  # fmt: skip
_SIGNALS = (
    "Symbol", "Meaning", "Channel", "File", "Unit in file", "Rate [Hz]", "Samples", "Missing [%]", "Bad samples",
)  # fmt: skip
_FAULTS = {
    "duplicates": "same time twice", "back_steps": "steps back", "resets": "clock resets", "wraps": "wrapped counters",
    "pauses": "pauses", "drifts": "clocks that drift", "strays": "stray stamps",
}  # fmt: skip
_BAD = {
    "not_finite": "not finite",
    "out_of_range": "out of range",
    "invalid_code": "marked invalid",
    "frozen": "frozen",
    "joined": "a filled gap",
}


def drive_page(result: DriveResult, *, title: str) -> str:
    """The page of one drive, one file that needs no network; `title` may hold anything, it is escaped."""
    return report_page(drive_report(result, is_drawn=True), title=title)


def drive_report(result: DriveResult, *, is_drawn: bool = False) -> Report:
    """The sections of a drive; with its signals over time if `is_drawn`."""
    judgement = result.judgement
    units = {t.detector: pretty_unit(t.unit) for t in result.tracks}
    events = [event_cells(e, units.get(e.detector, "")) for e in result.events]
    first = len(events) if len(events) <= MOST_ROWS else FIRST_EVENTS
    table = Table(
        EVENT_HEADS, events[:first], "events", (0, 1, 5, 8), wide=(8,), is_sortable=True, is_choice=True,
        more=events[first:],
    )  # fmt: skip
    drawn, island = _drawn(result, table) if is_drawn else ([], {})
    route = route_figure(result, _choices(judgement)) if is_drawn else None
    lacks = lacking(result)
    signals = result.signals
    answers: list[Line] = [
        *margin_lines(result.margin),
        *card_lines(judgement, signals.duration_s),
        *([("Not judged:", "; ".join(lacks))] if lacks else []),
    ]
    verdict = headline(judgement, doubted=bool(result.checks), margin=result.margin, duration_s=signals.duration_s)
    folded = {i for e in judgement.of(*FOLDED) for i in e.events} if len(events) > MOST_TEXT else set()
    sections = [
        Section("", [
            Headline(verdict, answers),
            Para(f"{' '.join(judged_by(judgement, signals.duration_s))}\n{result.vehicle_name}: "
                 f"{signals.duration_s:.1f} s at {1e9 / signals.step_ns:g} Hz, {len(signals.symbols)} signals",
                 where="text"),
        ], "verdict", look=f"verdict events {level(judgement, result.margin)}"),
        *input_sections(result.checks),
        Section("Problems of the data", [Lines(_problems(result), most=1000)], "problems", look="problems",
                where="page"),
        *_episodes(result, folded=bool(folded)),
        Section("Events", [
            replace(table, where="page"),
            Table(EVENT_HEADS, [c for i, c in enumerate(events) if i not in folded], "events", (0, 1, 5, 8), wide=(8,),
                  brief=(8,), where="text"),
        ], "event-section", _HINT, fold=detections_line(judgement, len(events))),
        *drawn,
        Section("The drive from above", [Figures(["route"] if route else []), Para(_ROUTE)] if route else [],
                "route-section", where="page"),
        *not_judged(*([(u.detector, u.missing) for u in some] for some in (result.unavailable, result.limited))),
        Section("Detectors", [_detectors(result)], "detector-section", where="page"),
        Section("Slip slope", [Table(_SLOPES, [_slope(s) for s in result.slopes], "slopes", (0, 3, 10), wide=(10,))],
                "slope-section", "a drop alone is not aquaplaning: snow, ice and gravel do the same"),
        Section("Signals", [
            Table(_SIGNALS, [_signal(result, s) for s in signals.symbols], "signals", (0, 1, 2, 3, 4, 8), wide=(1,),
                  is_sortable=True),
        ], "signal-section", where="page"),
        Section("Time stamps", [_faults(result)], "quality-section", where="page"),
    ]  # fmt: skip
    return Report(
        "", "aquaplaning in one drive", sections, _facts(result), {"route": route} if route else {},
        islands={"drive-data": island},
        scripts=(*(["figures.js"] if route else []), "paper.js", "samples.js", "panels.js", "filters.js", "drive.js"),
    )  # fmt: skip


# --- episodes --------------------------------------------------------------------------------------------------------


def _episodes(result: DriveResult, *, folded: bool) -> list[Section]:
    """The table of episodes; a terminal counts those of folded kinds where there are many."""
    of = result.judgement
    main, rest = _parted(of)
    few = main if folded else of.episodes
    counts = [folded_line(k, of.of(k)) for k in FOLDED if folded and of.of(k)]
    return [
        Section("Episodes", [
            _choice("episodes", main),
            Table(EPISODE_HEADS, [episode_cells(e) for e in few], "episodes", _EPISODE_WORDS, where="text"),
            Lines([f"{line}; --json lists them" for line in counts], where="text"),
        ], "episode-section", _HINT),
        Section("Lock-ups and single detectors", [_choice("more-episodes", rest)], "more-section", _HINT, where="page",
                fold="; ".join(folded_line(k, of.of(k)) for k in FOLDED if of.of(k))),
    ]  # fmt: skip


def _choice(id: str, found: Sequence[Episode]) -> Table:
    """Episodes as a table in which a row is picked."""
    rows = [episode_cells(e) for e in found]
    return Table(EPISODE_HEADS, rows, id, _EPISODE_WORDS, wide=(10,), is_sortable=True, is_choice=True, where="page")


def _parted(judgement: Judgement) -> tuple[Sequence[Episode], Sequence[Episode]]:
    """Episodes that may be an answer to the question for water, and the others."""
    rest = judgement.of(*FOLDED)
    return [e for e in judgement.episodes if e not in rest], rest


def _choices(judgement: Judgement) -> dict[str, Sequence[Episode]]:
    """Episodes by the table that has them as rows."""
    return dict(zip(("episodes", "more-episodes"), _parted(judgement), strict=True))


def lacking(result: DriveResult) -> list[str]:
    """Detectors that could not judge, with what each needs."""
    return [f"{detector_name(u.detector)} (needs {', '.join(u.missing)})" for u in result.unavailable]


# --- which events come first -----------------------------------------------------------------------------------------


def by_importance(events: Sequence[Event]) -> list[Event]:
    """Full before partial, events without braking first, joint detectors before single ones, then by time."""

    def rank(e: Event) -> tuple[Any, ...]:
        is_joint = e.detector.startswith("joint")
        is_braking = bool(e.evidence.get("braking_at_start"))
        return is_braking, e.severity != "full", not is_joint, e.start_s, e.detector, e.wheel or ""

    return sorted(events, key=rank)


# --- head ------------------------------------------------------------------------------------------------------------


def _facts(result: DriveResult) -> list[tuple[str, str]]:
    signals = result.signals
    facts = [
        ("Vehicle", result.vehicle_name), ("Duration", _duration(signals.duration_s)),
        ("Sample rate", f"{1e9 / signals.step_ns:g} Hz"), ("Signals", str(len(signals.symbols))),
    ]  # fmt: skip
    if signals.start_ns is not None:
        facts.append(("Start", _utc(signals.start_ns)))
    return [*facts, ("File" if len(signals.files) == 1 else "Files", ", ".join(signals.files) or "–")]


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.2f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    clock = f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
    return f"{clock} ({seconds:.0f} s)"


def _utc(start_ns: int) -> str:
    try:
        return f"{datetime.fromtimestamp(start_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError, OSError):
        return f"{start_ns} ns since 1970"


def _problems(result: DriveResult) -> list[str]:
    """Problems of the data that limit how far the page can be trusted."""
    signals, quality = result.signals, result.signals.quality
    found = ["The log is cut off or damaged: a part of it is missing."] if quality.truncated else []
    if quality.dropped_samples:
        lost = f", {quality.lost_in_files} of them lost in damaged files" if quality.lost_in_files else ""
        blank = {(o.file, o.channel): f"{o.symbol} {o.not_finite}" for o in signals.origins.values() if o.not_finite}
        told = f"; without a value: {listed(list(blank.values()), 4)}" if blank else ""
        found.append(f"{quality.dropped_samples} samples were not used{lost}{told}.")
    if quality.time_jumps:
        found.append(f"The time jumps {'once' if quality.time_jumps == 1 else f'{quality.time_jumps} times'}.")
    return list(dict.fromkeys([*found, *quality.notes, *without_remarks(result.notes, result.checks)]))


# --- tables ----------------------------------------------------------------------------------------------------------


def detections_line(judgement: Judgement, count: int) -> str:
    """How many detections follow one by one, and how many of them belong to no episode, such as the margin's."""
    alone = count - sum(len(e.events) for e in judgement.episodes)
    return f"{counted(count, 'detection')}, one by one{f', {alone} in no episode' if alone > 0 else ''}"


def event_cells(event: Event, unit: str = "") -> list[Cell]:
    """Cells of an event under `EVENT_HEADS`; `unit` is that of peak and threshold."""
    speed, duration = speed_kmh(event), event.end_s - event.start_s
    ratio = event.peak / event.threshold if event.threshold else event.peak
    return [
        Cell(detector_name(event.detector)),
        Cell(place(event.wheel, event.side) or "vehicle", WHEEL_COLOURS.get(event.wheel or "", "")),
        *(_number(x, 2) for x in (event.start_s, event.end_s, duration)),
        Cell(event.severity, tag="full" if event.severity == "full" else "partial"),
        Cell(f"{number(event.peak)} / {number(event.threshold)} {unit}".rstrip(" –"),
             key=ratio if abs(ratio) < math.inf else -1.0),
        _number(speed, 0),
        Cell("; ".join(evidence_parts(event.evidence)) or "–"),
    ]  # fmt: skip


def _number(x: float, decimals: int | None = None) -> Cell:
    """A cell that sorts as a number, first where it has no value."""
    return Cell(number(x, decimals), key=x if math.isfinite(x) else -1.0)


def _detectors(result: DriveResult) -> Table:
    """Each detector with its state and number of events."""
    limited = {u.detector: u.missing for u in result.limited}
    rows: list[tuple[str | Cell, ...]] = []
    for name in dict.fromkeys([*(t.detector for t in result.tracks), *limited]):
        places = dict.fromkeys(place(t.wheel, t.side) for t in result.tracks if t.detector == name)
        state = "limited" if name in limited else "ran"
        rows.append((
            detector_name(name), Cell(state, tag=state), ", ".join(p for p in places if p) or "vehicle",
            str(sum(e.detector == name for e in result.events)),
            f"judged without {', '.join(limited[name])}" if name in limited else "",
        ))  # fmt: skip
    rows += [
        (detector_name(u.detector), Cell("unavailable", tag="unavailable"), "–", "–",
         f"needs {', '.join(u.missing)}" if u.missing else "")
        for u in result.unavailable
    ]  # fmt: skip
    return Table(("Detector", "State", "Where", "Events", "Missing"), rows, "detectors", (0, 1, 2, 4), wide=(4,))


def _slope(s: SlopeSummary) -> list[str]:
    """Estimate, reference, and seconds in each state."""
    at_end = f"{number(s.slope, 1)} ± {number(s.slope_sd, 1)}" if math.isfinite(s.slope) else "–"
    states = (("estimating",), ("slope_frozen",), ("blind",), ("traction_too_large", "spinning", "inactive"))
    why = sorted(((v, k) for k, v in s.inactive.items() if v >= 0.05), reverse=True)
    return [
        place(s.wheel, s.place), at_end, number(s.reference, 1), s.reference_from or "–", number(s.judged_s, 1),
        *(number(sum(s.seconds.get(x, 0.0) for x in state), 1) for state in states), str(s.alarms),
        ", ".join(f"{name} {number(v, 1)} s" for v, name in why) or "–",
    ]  # fmt: skip


def _signal(result: DriveResult, name: str) -> list[str | Cell]:
    """Source and bad samples of a signal."""
    meaning = SYMBOLS[name].meaning if name in SYMBOLS else ""
    origin = result.signals.origins.get(name)
    if origin is None:
        return [name, meaning, *["–"] * 3, *[_number(math.nan)] * 3, ""]
    bad = ", ".join(f"{n} {what}" for field, what in _BAD.items() if (n := getattr(origin, field)))
    missing = Cell(f"{100 * origin.missing_fraction:.2f}", key=origin.missing_fraction)
    return [
        name, meaning, origin.channel, origin.file, origin.unit or "–", _number(origin.rate_hz),
        _number(origin.samples, 0), missing, bad,
    ]  # fmt: skip


def _faults(result: DriveResult) -> Table | Lines:
    """Time faults of the whole drive and of each signal with faults."""
    signals = result.signals
    rows = [("all sources", _counts(signals.quality.faults))]
    rows += [(name, _counts(o.faults)) for name, o in signals.origins.items()]
    found = [(name, *map(str, counts)) for i, (name, counts) in enumerate(rows) if i == 0 or any(counts)]
    if not any(any(counts) for _, counts in rows):
        return Lines(["No fault of the time stamps was found."])
    return Table(("Source", *_FAULTS.values()), found, "faults")


def _counts(faults: TimeFaults) -> list[int]:
    return [getattr(faults, name) for name in _FAULTS]


# --- signals over time -----------------------------------------------------------------------------------------------


def _drawn(result: DriveResult, events: Table) -> tuple[list[Section], dict[str, Any]]:
    """The section that the page's script draws, if there is anything to draw, and all that the script needs."""
    rows = drive_rows(result)
    plan = make_plan(by_importance(result.events), result.signals.frame.height, result.signals.dt)
    episodes = result.judgement.of("aquaplaning")
    wet = {i: e for e in episodes for i in e.events}
    # a warning is no evidence of an episode, but of its water
    warned = [(i, w) for i, w in enumerate(result.events) if w.detector == "margin"]
    wet |= {i: e for i, w in warned for e in episodes if e.start_s < w.end_s and w.start_s < e.end_s}
    levels = [(1 + (e.severity == "full")) * (i in wet) for i, e in enumerate(result.events)]
    spans = [[round(e.start_s, 6), round(e.end_s, 6), n] for e, n in zip(result.events, levels, strict=True)]
    # what is shaded is the water, not how long a detector holds its alarm
    causes = [wet.get(i, e) for i, e in enumerate(result.events)]
    shaded = [[round(c.start_s, 6), round(c.end_s, 6)] for c in causes]
    tables = _choices(result.judgement)
    chosen = {id: [[round(e.start_s, 6), round(e.end_s, 6)] for e in found] for id, found in tables.items()}
    island: dict[str, Any] = {"events": spans, "shaded": shaded, "episodes": chosen}
    if events.more:
        island["table"] = event_columns([*events.rows, *events.more])
    if not rows or not plan.n:
        return [], island
    names = (("other", "other event"), ("partial", "aquaplaning"), ("full", "full aquaplaning"))
    shades = [names[n] for n in sorted(set(levels))]
    shades += [("water", "on water")] if "on_water" in result.signals.frame.columns else []
    toggles = [(g, g if g == VEHICLE else g.upper(), WHEEL_COLOURS.get(g, "")) for g in groups(rows)]
    note = _note(result, plan) + " Drag to zoom, double click to show all; on an axis, drag to pan."
    drawn: list[Part] = [Stack(toggles, shades, bool(spans)), Para(note)]
    section = Section("Signals and detectors over time", drawn, "plot-section", where="page")
    return [section], island | stack(rows, plan, result.signals.dt)


def _note(result: DriveResult, plan: Plan) -> str:
    """Which samples the page holds."""
    if result.signals.full is not None:  # a drive processed in windows
        return (
            f"For this long drive the page holds the minimum and maximum of every {2.0 * result.signals.dt:g} s, so no "
            "outlier is lost. Use signals.parquet to look at events: it has every sample."
        )
    if plan.is_complete:
        return "Every sample is in this page; zoomed out, minima and maxima are drawn."
    text = f"The page holds about {POINTS} minima and maxima per line over the whole drive, so no outlier is lost."
    events = len(result.events)
    if not events:
        return text
    which = f"each of the {events} events" if plan.events_in_full == events else (
        f"{plan.events_in_full} of {events} events (the most important ones; the page holds {DRIVE.detail_samples} "
        "such samples per line)"
    )  # fmt: skip
    return (
        f"{text} Every sample is kept from {DRIVE.margin_s:g} s before to {DRIVE.margin_s:g} s after {which}; "
        f"of events longer than {LONG_S:g} s, around beginning and end."
    )


def event_columns(rows: Sequence[Sequence[Any]]) -> dict[str, list[Any]]:
    """Columns of the table of events, but for the times, which the script has in any case.

    Returns
    -------
    dict
        `detectors`, `places` (with the colour of the wheel) and `severities`, into which `detector`, `place` and
        `severity` are indices; `peak` and `evidence` as text, `ratio` the sort key of the peak; `speed` in km/h, -1
        where it is unknown.
    """
    detector, where, _, _, _, severity, peak, speed, evidence = zip(*rows, strict=True)
    out: dict[str, list[Any]] = {
        "peak": [c.text for c in peak],
        "ratio": [float(f"{c.key:.6g}") for c in peak],
        "speed": [round(c.key, 3) for c in speed],
        "evidence": [c.text for c in evidence],
    }
    for one, many, values in (
        ("detector", "detectors", [c.text for c in detector]),
        ("place", "places", [(c.text, c.dot) for c in where]),
        ("severity", "severities", [c.text for c in severity]),
    ):
        known: Mapping[Any, int] = {v: i for i, v in enumerate(dict.fromkeys(values))}
        out |= {one: [known[v] for v in values], many: list(known)}
    return out
