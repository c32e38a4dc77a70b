"""Problems of a campaign's runs that limit how far its numbers can be trusted, grouped and counted."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from aqualog.campaign.bins import Group, group_of
from aqualog.campaign.matrix import TOO_FEW
from aqualog.campaign.samples import CampaignData, RunInfo
from aqualog.report.campaign.labels import group_text
from aqualog.report.wording import cut, detector_name

__all__ = ["MOST_KINDS", "Problem", "problems_of"]

MOST_KINDS = 25  # of notes that have a line of their own
_LANE_SLACK_S = 1.0  # [s] clocks of a lane and of a log
_NUMBER = re.compile(r"\d+(?:[.,]\d+)*")


@dataclass(frozen=True, slots=True)
class Problem:
    """One kind of problem. `weight`: `loss` (data or runs are missing), `limit` (something cannot be judged) or `note`;
    `means` states the consequence; `runs` are (index, detail of this run).
    """

    weight: str
    title: str
    means: str
    runs: tuple[tuple[int, str], ...]


_Test = Callable[[RunInfo], str]


def problems_of(data: CampaignData, keys: Sequence[str]) -> tuple[Problem, ...]:
    """All kinds of problems that occur, losses first, then by number of runs."""
    found = [
        _all(data.runs, "loss", "without results", "not in any result", lambda r: "" if r.is_done else _why(r)),
        _of_done(data, "loss", "log cut off", "its end is missing", lambda r: "cut off" if _q(r, "truncated") else ""),
        _of_done(data, "loss", "samples lost in damaged files", "", lambda r: _count(r, "lost_in_files", "lost")),
        _of_done(data, "loss", "samples dropped", "not used", lambda r: _count(r, "dropped_samples", "dropped")),
        _of_done(data, "loss", "time jumps", "the log's clock is uneven", lambda r: _count(r, "time_jumps", "")),
        _of_done(data, "loss", "clock faults", "stamps twice, back, reset, wrapped, paused, drifting", _clock),
        _of_done(
            data, "limit", "lane not known", "no lane times, labels, on_water signal or dry run: excluded "
            "from figures over speed", lambda r: "" if r.water_from else "no lane",
        ),
        _of_done(data, "limit", "lane after the log's end", "used up to the end of the log", _lane_beyond),
        _of_done(data, "limit", "vehicle file without the drivetrain", "rear-wheel drive is assumed",
                 lambda r: "" if "drivetrain" in r.vehicle.given else r.run.vehicle.name),
        _of_done(data, "limit", "slip-slope drop without a dry slope", "a drop is found only relative to the dry slope "
                 "learnt in the drive; give tyre.slip_slope_f and tyre.slip_slope_r", _no_dry_slope),
        *_unavailable(data),
        *_few(data, keys),
        *_notes(data),
    ]  # fmt: skip
    order = ("loss", "limit", "note")
    return tuple(sorted((p for p in found if p.runs), key=lambda p: (order.index(p.weight), -len(p.runs))))


def _no_dry_slope(info: RunInfo) -> str:
    """Report a vehicle file without the dry slope of a driven axle; default values do not count."""
    axles = sorted({w[0] for w in info.vehicle.driven})
    if "slip_slope_drop" in info.about["unavailable"]:
        return ""
    return "" if any(f"tyre.slip_slope_{a}" in info.vehicle.given for a in axles) else info.run.vehicle.name


def _lane_beyond(info: RunInfo) -> str:
    """Report a lane that ends or begins after the log's end; it may belong to another log or another clock."""
    lane, end = info.run.lane, info.about["duration_s"]
    if lane is None or lane[1] <= end + _LANE_SLACK_S:
        return ""
    return f"lane from {lane[0]:g} to {lane[1]:g} s, the log ends at {end:.1f} s"


def _all(runs: Sequence[RunInfo], weight: str, title: str, means: str, test: _Test) -> Problem:
    hits = tuple((r.index, cut(text, 300)) for r in runs if (text := test(r)))
    return Problem(weight, title, means, hits)


def _of_done(data: CampaignData, weight: str, title: str, means: str, test: _Test) -> Problem:
    return _all(data.done, weight, title, means, test)


def _why(r: RunInfo) -> str:
    return r.reason or r.state


def _q(r: RunInfo, name: str) -> int:
    return int(r.about["quality"].get(name, 0))


def _count(r: RunInfo, name: str, word: str) -> str:
    n = _q(r, name)
    return f"{n} {word}".rstrip() if n else ""


def _clock(r: RunInfo) -> str:
    names = ("duplicates", "back_steps", "resets", "wraps", "pauses", "drifts", "strays")
    return ", ".join(f"{_q(r, n)} {n.replace('_', ' ')}" for n in names if _q(r, n))


def _unavailable(data: CampaignData) -> list[Problem]:
    """One problem per detector, with its missing signals."""
    found: dict[tuple[str, str, str], list[tuple[int, str]]] = {}
    for r in data.done:
        for state in ("unavailable", "limited"):
            for detector, missing in r.about[state].items():
                at = (state, detector, ", ".join(missing))
                found.setdefault(at, []).append((r.index, ""))
    out = []
    for (state, detector, missing), runs in found.items():
        title = f"{detector_name(detector)} {'not judged' if state == 'unavailable' else 'judged in part'}"
        out.append(Problem("limit", title, cut(f"needs {missing}" if missing else "", 200), tuple(runs)))
    return out


def _few(data: CampaignData, keys: Sequence[str]) -> list[Problem]:
    """Configurations on water whose runs are too few for an interval."""
    groups: dict[Group, list[RunInfo]] = {}
    for r in data.done:
        groups.setdefault(group_of(r, keys), []).append(r)
    hits = [
        (r.index, f"{group_text(g)}: {len(runs)} run{'s' if len(runs) > 1 else ''}")
        for g, runs in groups.items()
        if len(runs) < TOO_FEW and ("water_depth_mm", 0.0) not in g
        for r in runs
    ]
    title = f"configuration with fewer than {TOO_FEW} runs"
    return [Problem("limit", title, "its values, if any, have no interval", tuple(sorted(hits)))]


def _notes(data: CampaignData) -> list[Problem]:
    """Notes of the logs; notes that differ only in numbers count as one kind, and the rarest kinds are merged."""
    found: dict[str, list[tuple[int, str]]] = {}
    for r in data.done:
        for note in dict.fromkeys(map(str, r.about["notes"])):
            found.setdefault(_NUMBER.sub("…", note), []).append((r.index, note))
    kinds = sorted(found.values(), key=lambda hits: -len(hits))
    out = [_note(hits) for hits in kinds[:MOST_KINDS]]
    rest = [(i, cut(note, 200)) for hits in kinds[MOST_KINDS:] for i, note in hits]
    return [*out, Problem("note", "other notes", "", tuple(sorted(rest)))]


def _note(hits: Sequence[tuple[int, str]]) -> Problem:
    same = len({note for _, note in hits}) == 1
    title = hits[0][1] if same else _NUMBER.sub("…", hits[0][1])
    return Problem("note", cut(title, 240), "", tuple((i, "" if same else cut(note, 200)) for i, note in hits))
