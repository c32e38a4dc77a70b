"""The small page of one run of a campaign, from the samples in the campaign's store."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aqualog.campaign.samples import CampaignData, RunInfo, RunSamples
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.detect.registry import DETECTORS
from aqualog.report import offline
from aqualog.report.campaign.labels import key_title, value_text
from aqualog.report.campaign.runs import RunFacts
from aqualog.report.theme import WHEEL_COLOURS, detector_colour
from aqualog.report.wording import cut, detector_name, evidence_parts, number, place

__all__ = ["command_of", "run_page"]

MOST_SAMPLES = 300  # per line; beyond, means and extremes of several samples
MOST_EVENTS = 80  # in the table and in the figure
_KMH = 3.6


def run_page(
    data: CampaignData, info: RunInfo, samples: RunSamples | None, facts: RunFacts | None, *, back: str
) -> str:
    """The page as HTML; the same text for the same results.

    Parameters
    ----------
    samples, facts : optional
        None for a run without results.
    back : str
        Address of the campaign's page.
    """
    return offline.render(
        "run.html.j2",
        css=("campaign.css",),
        scripts=("loader.js", "run.js"),
        islands={"run-data": _plots(info, samples) if samples is not None else {}},
        plotly="../plotly.min.js",
        title=cut(info.name, 160),
        kind=f"run {info.index + 1} – {cut(data.name)}",
        number=info.index + 1,
        total=len(data.runs),
        campaign=cut(data.name),
        back=back,
        state=info.state,
        reason=cut(info.reason, 600),
        headline=_headline(info),
        configuration=[(key_title(k), value_text(k, v, is_alone=False)) for k, v in info.run.values.items()],
        facts=_facts(info, facts),
        problems=_problems(info),
        events=[_event(e) for e in info.events[:MOST_EVENTS]],
        more_events=max(0, len(info.events) - MOST_EVENTS),
        command=command_of(data, info),
        has_load=any(info.run.values.get(f"load_{a}_kg", 0.0) for a in ("front", "rear")),
    )


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


def _headline(info: RunInfo) -> str:
    if not info.is_done:
        return "No results"
    found = [e["detector"] for e in info.events]
    told = [f"{detector_name(d)} {found.count(d)}×" for d in DETECTORS if d in found]
    full = sum(e["severity"] == "full" for e in info.events)
    return (", ".join(told) + (f" ({full} full)" if full else "")) or "No event"


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
    found = ["the log is cut off: its end is missing"] if q["truncated"] else []
    found += [f"{q[n]} {n.replace('_', ' ')}" for n in q if n != "truncated" and q[n]]
    found += ["the position of the lane is not known: figures over speed skip this run"] if not info.water_from else []
    found += [f"{detector_name(d)} not judged (needs {', '.join(m)})" for d, m in info.about["unavailable"].items()]
    found += [f"{detector_name(d)} judged without {', '.join(m)}" for d, m in info.about["limited"].items() if m]
    return [cut(x, 300) for x in [*found, *info.about["notes"]]][:20]


def _event(e: Mapping[str, Any]) -> list[str]:
    v = e["evidence"].get("v_x")
    words = "; ".join(evidence_parts(e["evidence"])) or "–"
    return [
        number(e["start_s"], 2), number(e["end_s"], 2), detector_name(e["detector"]),
        place(e["wheel"], e["side"]) or "vehicle", e["severity"],
        f"{number(_finite(e['peak']))} / {number(_finite(e['threshold']))}",
        number(_KMH * v, 0) if isinstance(v, float | int) else "–", cut(words, 300),
    ]  # fmt: skip


def _finite(x: float | None) -> float:
    return math.nan if x is None else float(x)


def _plots(info: RunInfo, samples: RunSamples) -> dict[str, Any]:
    """Lines on one grid of time, the lane, and events; numbers short, so that thousands of pages stay small."""
    n = samples.t.size
    step = max(1, math.ceil(n / MOST_SAMPLES))
    v = samples.array("v_x")
    lines: dict[str, list[list[Any]]] = {"speed": [["v_x", "", _mean(_KMH * v, step, 2)]]}
    low, high = ({w: samples.array(f"slip_{end}_{w}") for w in WHEELS} for end in ("min", "max"))
    # (3.13) is against the wheel's own speed and has no value where the wheel stops; the extremes are against the car
    rims = {w: _KMH * v * (1.0 + 0.5 * (low[w] + high[w])) for w in WHEELS}
    lines["speed"] += [[w.upper(), w, _mean(x, step, 2)] for w, x in rims.items()]
    lines["low"] = [[w.upper(), w, _low(100.0 * x, step)] for w, x in low.items()]
    lines["high"] = [[w.upper(), w, _high(100.0 * x, step)] for w, x in high.items()]
    lines["traction"] = [[w.upper(), w, _mean(samples.array(f"mu_{w}"), step, 4)] for w in WHEELS]
    lines["resistance"] = [["resistance", "", _mean(samples.array("delta_a_x"), step, 3)]]
    lines = {k: [x for x in own if any(y is not None for y in x[2])] for k, own in lines.items()}
    return {
        "t": _mean(samples.t, step, 3),
        "step_s": round(step * samples.step_s, 3) if n > 1 else 0.0,
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
    wet = np.concatenate([[False], samples.on_water == 1.0, [False]])
    edges = np.flatnonzero(wet[1:] != wet[:-1])
    half = 0.5 * samples.step_s if samples.t.size > 1 else 0.0
    spans = edges.reshape(-1, 2)[:40]
    return [[round(float(samples.t[a]) - half, 3), round(float(samples.t[b - 1]) + half, 3)] for a, b in spans]


def _mean(x: FloatArray, step: int, decimals: int) -> list[float | None]:
    parts = _parts(x, step)
    known = np.isfinite(parts).any(axis=1)
    mean = np.full(len(parts), np.nan)
    mean[known] = np.nanmean(parts[known], axis=1)
    return _short(mean, decimals)


def _low(x: FloatArray, step: int) -> list[float | None]:
    return _short(np.fmin.reduce(_parts(x, step), axis=1), 2)


def _high(x: FloatArray, step: int) -> list[float | None]:
    return _short(np.fmax.reduce(_parts(x, step), axis=1), 2)


def _parts(x: FloatArray, step: int) -> FloatArray:
    """Rows of `step` samples, the last one filled up with NaN."""
    rows = -(-x.size // step)
    padded = np.full(rows * step, np.nan)
    padded[: x.size] = x
    return padded.reshape(rows, step)


def _short(x: FloatArray, decimals: int) -> list[float | None]:
    return [round(v, decimals) if math.isfinite(v) else None for v in x.tolist()]
