"""One run of a campaign: its numbers, and its small page from the samples in the campaign's store."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.core.notation import WHEELS
from aqualog.core.records import Event, FloatArray
from aqualog.report.campaign.full_rate import dense_of
from aqualog.report.campaign.labels import key_title, value_text
from aqualog.report.drive.judged import EPISODE_HEADS, FOLDED, card_lines, episode_cells, folded_line, headline, level
from aqualog.report.drive.report import EVENT_HEADS, by_importance, detections_line, event_cells
from aqualog.report.page import report_page
from aqualog.report.reduce import LONG_S, Budget, Plan, make_plan, spans_of
from aqualog.report.sections import Cell, Code, Headline, Line, Lines, Para, Part, Report, Section, Stack, Table
from aqualog.report.theme import WHEEL_COLOURS, detector_colour
from aqualog.report.values import KMH, cut, number, place, upper_first
from aqualog.report.wording import detector_name

__all__ = ["BEHIND_S", "EventCount", "RunFacts", "command_of", "facts_of", "run_page"]

BEHIND_S = 1.0  # [s] after the water in which an event still counts as on water, as in `evaluate`
LEAST_S = 0.5  # [s] on the lane that count as a pass, as for the speed of full aquaplaning
_OFF, _ON, _UNKNOWN = "off", "on", "unknown"
POINTS = 240  # per line away from the events: means and extremes of several samples
_BUDGET = Budget(all_samples=POINTS, margin_s=5.0, detail_samples=500)
MOST_EVENTS = 80  # in the table and in the figure


def run_page(
    data: CampaignData,
    info: RunInfo,
    samples: RunSamples | None,
    facts: RunFacts | None,
    *,
    back: str,
    full: pl.DataFrame | None = None,
) -> str:
    """The page as HTML; the same text for the same results.

    Parameters
    ----------
    samples, facts : optional
        None for a run without results.
    back : str
        Address of the campaign's page.
    full : DataFrame, optional
        Samples at the log's own rate around the episodes, as `CampaignData.full` gives them.
    """
    configuration = [(key_title(k), value_text(k, v, is_alone=False)) for k, v in info.run.values.items()]
    has_load = any(info.run.values.get(f"load_{a}_kg", 0.0) for a in ("front", "rear"))
    more = f"and {len(info.events) - MOST_EVENTS} more events" if len(info.events) > MOST_EVENTS else ""
    rows = [_cells(_event(e)) for e in info.events[:MOST_EVENTS]]
    judgement = info.judgement
    main = [e for e in judgement.episodes if e.kind not in FOLDED]
    fold = "; ".join([*(folded_line(k, judgement.of(k)) for k in FOLDED if judgement.of(k)),
                      detections_line(judgement, len(info.events))])  # fmt: skip
    drawn, island = _over_time(info, samples, full) if samples is not None else ([], {})
    verdict = headline(judgement, doubted=bool(info.checks)) if info.is_done else "No results"
    sections = [
        Section("", [Headline(verdict, _answers(info))], "verdict",
                look=f"verdict events {level(judgement)}"),
        Section("Notes", [Lines(_problems(info), most=1000)], "quality", look="problems"),
        *drawn,
        Section("Episodes", [
            Table(EPISODE_HEADS, [episode_cells(e) for e in main[:MOST_EVENTS]], "episodes", (0, 3, 4, 10)),
        ], "episode-section"),
        Section("Events", [Table(EVENT_HEADS, rows, "events", (0, 1, 5, 8), wide=(8,)), Para(more)], "events-section",
                fold=fold),
        Section("The full page of this run", [
            Code(command_of(data, info)),
            Para("The vehicle file does not have this run's load; the campaign adds it to mass and centre of mass."
                 if has_load else ""),
        ], "full-page", "every signal at its own rate; run this command in the folder of the campaign file"),
    ]  # fmt: skip
    report = Report(
        f"run {info.index + 1} – {cut(data.name)}", f"run {info.index + 1} of {len(data.runs)}", sections,
        [*configuration, *_facts(info, facts)], footer="From the campaign's samples, ten a second"
        f"{', and the rate of the log around episodes' if full is not None else ''}.",
        islands={"run-data": island}, scripts=("loader.js", "run.js"),
    )  # fmt: skip
    return report_page(
        report, title=cut(info.name, 160), template="run.html.j2", plotly="../plotly.min.js", back=back,
        campaign=cut(data.name),
    )  # fmt: skip


def command_of(data: CampaignData, info: RunInfo) -> str:
    """The command that makes the full page of this run, for the folder of the campaign file."""
    base = data.configured.campaign.path.parent
    signals = data.configured.campaign.signals
    words = ["aqualog", "detect", *(_from(base, p) for p in info.run.logs), "--vehicle", _from(base, info.run.vehicle)]
    words += ["--signals", _from(base, signals)] if signals is not None else []
    for dbc in data.configured.dbc:
        words += ["--dbc", _from(base, dbc)]
    return " ".join([*(shlex.quote(cut(w, 1000)) for w in words), "-o", f"run_{info.index + 1:04d}"])


def _from(base: Path, path: Path) -> str:
    name = str(path.relative_to(base)) if path.is_relative_to(base) else str(path)
    return f"./{name}" if name.startswith("-") else name


def _answers(info: RunInfo) -> list[Line]:
    """What stands under the headline."""
    if not info.is_done:
        return [(f"{info.state}:", cut(info.reason, 600))] if info.reason else []
    return card_lines(info.judgement, float(info.about["duration_s"]))


def _facts(info: RunInfo, facts: RunFacts | None) -> list[tuple[str, str]]:
    if facts is None:
        return []
    about = info.about
    lane = f"{number(facts.lane_kmh, 0)} km/h over {number(facts.lane_s, 1)} s"
    return [
        ("Car", cut(str(about["vehicle"]))),
        ("Duration", f"{number(about['duration_s'], 1)} s at {number(about['sample_rate_hz'])} Hz"),
        ("On the lane", f"{lane} (known from: {info.water_from})" if info.water_from else "not known"),
        ("Off it", f"{number(facts.dry_km, 2)} km"),
        ("Slip against", cut(str(about["slip_against"]))),
        ("Traction from", cut(str(about["traction"]))),
    ]


def _problems(info: RunInfo) -> list[str]:
    if not info.is_done:
        return []
    q = info.about["quality"]
    found = ["the log is cut off or damaged: a part of it is missing"] if q["truncated"] else []
    found += [f"{q[n]} {n.replace('_', ' ')}" for n in q if n != "truncated" and q[n]]
    found += ["the position of the lane is not known: figures over speed skip this run"] if not info.water_from else []
    found += [f"{detector_name(d)} not judged (needs {', '.join(m)})" for d, m in info.about["unavailable"].items()]
    found += [f"{detector_name(d)} judged without {', '.join(m)}" for d, m in info.about["limited"].items() if m]
    return [cut(x, 300) for x in [*found, *info.about["notes"]]][:20]


def _event(e: Mapping[str, Any]) -> Event:
    peak, threshold = (math.nan if e[k] is None else float(e[k]) for k in ("peak", "threshold"))
    return Event(
        e["detector"], e["wheel"], e["side"], e["start_s"], e["end_s"], e["severity"], peak, threshold, e["evidence"]
    )  # fmt: skip


def _cells(event: Event) -> list[Cell]:
    cells = event_cells(event)
    return [*cells[:-1], Cell(cut(cells[-1].text, 300))]


# --- over time --------------------------------------------------------------------------------------------------------


def _over_time(info: RunInfo, samples: RunSamples, full: pl.DataFrame | None) -> tuple[list[Section], dict[str, Any]]:
    """The section that the page's script draws, and its data."""
    plan, dense = _plan(info, samples), None if full is None else dense_of(full, info.judgement)
    hint = "blue: on the lane; drag to zoom, double click to reset"
    note, drawn = _note(info, samples, plan), _plots(info, samples, plan)
    if dense is not None:
        note, drawn = f"{dense.sentence}{note[0].lower()}{note[1:]}", dense.into(drawn)
    parts: list[Part] = [Stack(), Para(note)]
    return [Section("Over time", parts, "plot-section", hint)] if info.is_done else [], drawn


def _plan(info: RunInfo, samples: RunSamples) -> Plan:
    """Where the page holds every sample of the store."""
    n = samples.t.size
    begin, step_s = (float(samples.t[0]), samples.step_s) if n > 1 else (0.0, 1.0)
    events = by_importance([_event(e) for e in info.events])
    return make_plan([replace(e, start_s=e.start_s - begin, end_s=e.end_s - begin) for e in events], n, step_s, _BUDGET)


def _starts(plan: Plan) -> NDArray[np.int64]:
    """First index of each part that is drawn as one point: a sample near events, several elsewhere."""
    step = _step(plan)
    near = [np.arange(a, b) for a, b in plan.windows]
    ends = [0, *plan.windows.ravel().tolist(), plan.n]
    away = [np.arange(a, b, step) for a, b in zip(ends[::2], ends[1::2], strict=True)]
    return np.sort(np.concatenate([*near, *away])).astype(np.int64)


def _step(plan: Plan) -> int:
    """Samples in one point away from the events."""
    inside = int((plan.windows[:, 1] - plan.windows[:, 0]).sum())
    return max(1, math.ceil((plan.n - inside) / POINTS))


def _note(info: RunInfo, samples: RunSamples, plan: Plan) -> str:
    """What a point of the figure stands for."""
    every = f"{samples.step_s:.2g} s" if samples.t.size > 1 else "sample"
    has_slips = any(np.isfinite(samples.array(f"slip_min_{w}")).any() for w in WHEELS)
    about = (
        f" Rim speeds and slips are extremes of every {every}, relative to the vehicle's speed." if has_slips else ""
    )
    if plan.is_complete or not plan.n:
        return f"One point every {every}.{about}"
    kind = "mean, and extremes of the slip" if has_slips else "mean"
    coarse = f"one point every {_step(plan) * samples.step_s:.2g} s ({kind})"
    events = len(info.events)
    if not events:
        return f"{upper_first(coarse)}.{about}"
    which = "the events" if plan.events_in_full == events else f"{plan.events_in_full} of {events} events"
    if any(e["end_s"] - e["start_s"] > LONG_S for e in info.events):
        which += f" (of those longer than {LONG_S:g} s: of their beginning and end)"
    return f"One point every {every} within {_BUDGET.margin_s:g} s of {which}; elsewhere {coarse}.{about}"


def _plots(info: RunInfo, samples: RunSamples, plan: Plan) -> dict[str, Any]:
    """Lines on one grid of time, the lane, and events; numbers short, so that thousands of pages stay small."""
    starts = _starts(plan)
    v = samples.array("v_x")
    lines: dict[str, list[list[Any]]] = {"speed": [["v_x", "", _mean(KMH * v, starts, 2)]]}
    low, high = ({w: samples.array(f"slip_{end}_{w}") for w in WHEELS} for end in ("min", "max"))
    # (3.13) is against the wheel's own speed and has no value where the wheel stops; the extremes are against the car
    rims = {w: KMH * v * (1.0 + 0.5 * (low[w] + high[w])) for w in WHEELS}
    lines["speed"] += [[w.upper(), w, _mean(x, starts, 2)] for w, x in rims.items()]
    for name, slips, extreme in (("low", low, np.fmin), ("high", high, np.fmax)):
        parts = {w: extreme.reduceat(100.0 * x, starts) if starts.size else x for w, x in slips.items()}
        lines[name] = [[w.upper(), w, _short(x, 2)] for w, x in parts.items()]
    lines["traction"] = [[w.upper(), w, _mean(samples.array(f"mu_{w}"), starts, 4)] for w in WHEELS]
    lines["resistance"] = [["resistance", "", _mean(samples.array("delta_a_x"), starts, 3)]]
    lines = {k: [x for x in own if any(y is not None for y in x[2])] for k, own in lines.items()}
    return {
        "t": _mean(samples.t, starts, 3),
        "lines": lines,
        "colours": dict(WHEEL_COLOURS),
        "lane": _lane(info, samples),
        "events": [
            [round(e["start_s"], 3), round(e["end_s"], 3),
             f"{detector_name(e['detector'])} {place(e['wheel'], e['side'])}".rstrip(),
             detector_colour(e["detector"], e["wheel"]), e["severity"]]
            for e in info.events[:MOST_EVENTS]
        ],
    }  # fmt: skip


def _lane(info: RunInfo, samples: RunSamples) -> list[list[float]]:
    """Spans on the water, with the ends where wheels settle."""
    if info.run.lane is not None:
        return [[round(x, 3) for x in info.run.lane]]
    half = 0.5 * samples.step_s if samples.t.size > 1 else 0.0
    spans = spans_of(samples.on_water == 1.0)[:40]
    return [[round(float(samples.t[a]) - half, 3), round(float(samples.t[b - 1]) + half, 3)] for a, b in spans]


def _mean(x: FloatArray, starts: NDArray[np.int64], decimals: int) -> list[float | None]:
    """Mean of what is known in each part."""
    if not starts.size:
        return []
    known = np.isfinite(x)
    count = np.add.reduceat(known.astype(np.int64), starts)
    total = np.add.reduceat(np.where(known, x, 0.0), starts)
    return _short(np.where(count > 0, total / np.maximum(count, 1), np.nan), decimals)


def _short(x: FloatArray, decimals: int) -> list[float | None]:
    return [round(v, decimals) if math.isfinite(v) else None for v in x.tolist()]


# --- facts of a run ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class EventCount:
    """Events of a detector at a place (wheel, side; empty: the car): on water, off water, and unknown."""

    detector: str
    place: str
    on: int
    off: int
    unknown: int


@dataclass(frozen=True, slots=True)
class RunFacts:
    """`lane_kmh` mean speed on the lane, NaN without a pass; `lane_s` time on it; `dry_km` driven off it, NaN where the
    lane is not known; `full` events that were full.
    """

    lane_kmh: float
    lane_s: float
    dry_km: float
    events: tuple[EventCount, ...]
    full: int


def facts_of(info: RunInfo, samples: RunSamples) -> RunFacts:
    """The numbers of one run."""
    v = samples.array("v_x")
    step = samples.step_s
    wet = (samples.on_water == 1.0) & np.isfinite(v)
    dry = (samples.on_water == 0.0) & np.isfinite(v)
    seconds = float(np.count_nonzero(wet)) * step if wet.any() else 0.0
    is_known = bool(np.isfinite(samples.on_water).any())
    counts: dict[tuple[str, str], dict[str, int]] = {}
    for event in info.events:
        at = (str(event["detector"]), str(event["wheel"] or event["side"] or ""))
        of = counts.setdefault(at, {_ON: 0, _OFF: 0, _UNKNOWN: 0})
        of[_where(event, samples.t, samples.on_water, is_known=is_known)] += 1
    return RunFacts(
        lane_kmh=KMH * float(v[wet].mean()) if seconds >= LEAST_S else math.nan,
        lane_s=seconds,
        dry_km=float(v[dry].sum()) * step / 1e3 if is_known and dry.any() else 0.0 if is_known else math.nan,
        events=tuple(EventCount(d, p, n[_ON], n[_OFF], n[_UNKNOWN]) for (d, p), n in sorted(counts.items())),
        full=sum(e["severity"] == "full" for e in info.events),
    )


def _where(event: Mapping[str, Any], t: FloatArray, on_water: FloatArray, *, is_known: bool) -> str:
    """Whether an event begins on water or within a second after it; the ends where wheels settle count as water."""
    if not is_known:
        return _UNKNOWN
    start = float(event["start_s"])
    near = on_water[(t >= start - BEHIND_S) & (t <= start + 0.5 * float(t[1] - t[0] if t.size > 1 else 1.0))]
    return _OFF if near.size == 0 or bool(np.all(near == 0.0)) else _ON
