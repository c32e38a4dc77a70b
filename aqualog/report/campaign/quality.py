"""Problems of a campaign's runs that limit how far its numbers can be trusted, grouped and counted."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from aqualog.campaign.bins import Group, group_of
from aqualog.campaign.driven import proposed_drivetrain
from aqualog.campaign.matrix import TOO_FEW
from aqualog.campaign.results import CampaignData, RunInfo
from aqualog.core.records import TimeFaults
from aqualog.report.campaign.labels import group_text
from aqualog.report.values import counted, cut
from aqualog.report.wording import detector_name

__all__ = ["MOST_KINDS", "Problem", "problems_of"]

MOST_KINDS = 25  # of notes that have a line of their own
WHOLE = 2000  # characters: no sentence is so long, only what a damaged file says of itself
_LANE_SLACK_S = 1.0  # [s] clocks of a lane and of a log
_NO_VALUE = re.compile(r": no value for (\d+) % of the drive")  # as `missing_notes` has it
_NUMBER = re.compile(r"(?<![\w.,])[-+−]?\d+(?:[.,]\d+)*|\d+(?:[.,]\d+)*")


@dataclass(frozen=True, slots=True)
class Problem:
    """One kind of problem. `weight`: `loss` (data or runs are missing), `limit` (something cannot be judged) or `note`;
    `means` states the consequence; `runs` are (index, detail of this run); `worst` is the largest share of a run that
    is missing, 0 where it is not known.
    """

    weight: str
    title: str
    means: str
    runs: tuple[tuple[int, str], ...]
    worst: float = 0.0


_Test = Callable[[RunInfo], str]


def problems_of(data: CampaignData, keys: Sequence[str]) -> tuple[Problem, ...]:
    """All kinds of problems that occur: losses first, there the worst run first, then by number of runs."""
    found = [
        replace(_problem(data.runs, "loss", "without results", "not in any result",
                         lambda r: "" if r.is_done else r.reason or r.state), worst=1.0),
        _without_value(data),
        *(_problem(data.done, weight, title, means, test) for weight, title, means, test in _KINDS),
        *_unavailable(data),
        _few(data, keys),
        *_notes(data),
    ]  # fmt: skip
    order = ("loss", "limit", "note")
    return tuple(sorted((p for p in found if p.runs), key=lambda p: (order.index(p.weight), -p.worst, -len(p.runs))))


def _problem(runs: Sequence[RunInfo], weight: str, title: str, means: str, test: _Test) -> Problem:
    hits = tuple((r.index, cut(text, WHOLE)) for r in runs if (text := test(r)))
    return Problem(weight, title, means, hits)


def _q(r: RunInfo, name: str) -> int:
    return int(r.about["quality"].get(name, 0))


def _times(name: str, word: str) -> _Test:
    return lambda r: f"{_q(r, name)} {word}".rstrip() if _q(r, name) else ""


def _clock(r: RunInfo) -> str:
    return ", ".join(f"{_q(r, n)} {n.replace('_', ' ')}" for n in TimeFaults.KINDS if _q(r, n))


def _no_dry_slope(info: RunInfo) -> str:
    """Report a vehicle file without the dry slope of a driven axle; default values do not count."""
    if "slip_slope_drop" in info.about["unavailable"]:
        return ""
    is_given = any(f"tyre.slip_slope_{w[0]}" in info.vehicle.given for w in info.vehicle.driven)
    return "" if is_given else info.run.vehicle.name


def _no_drivetrain(info: RunInfo) -> str:
    """Report a vehicle file without the driven axle, and what the torques of the log propose."""
    if info.vehicle.knows_drivetrain:
        return ""
    return "; ".join(x for x in (info.run.vehicle.name, proposed_drivetrain(info)) if x)


def _lane_beyond(info: RunInfo) -> str:
    """Report a lane that ends or begins after the log's end; it may belong to another log or another clock."""
    lane, end = info.run.lane, info.about["duration_s"]
    if lane is None or lane[1] <= end + _LANE_SLACK_S:
        return ""
    return f"lane from {lane[0]:g} to {lane[1]:g} s, the log ends at {end:.1f} s"


_KINDS: tuple[tuple[str, str, str, _Test], ...] = (
    ("loss", "log cut off or damaged", "a part is missing", lambda r: "incomplete" if _q(r, "truncated") else ""),
    ("loss", "samples lost in damaged files", "", _times("lost_in_files", "lost")),
    ("loss", "samples dropped", "not used", _times("dropped_samples", "dropped")),
    ("loss", "time jumps", "the log's clock is uneven", _times("time_jumps", "")),
    ("loss", "clock faults", "stamps twice, back, reset, wrapped, paused, drifting", _clock),
    ("limit", "lane not known", "no lane times, labels, on_water signal or dry run: excluded from figures over speed",
     lambda r: "" if r.water_from else "no lane"),
    ("limit", "lane after the log's end", "used up to the end of the log", _lane_beyond),
    ("limit", "lane times beside the log's on_water", "the lane times count, and water beside them is no dry road",
     lambda r: r.dispute),
    ("limit", "vehicle file without the drivetrain", "minor spin-downs, spin-ups, resistance and the joint "
     "detectors are not judged; slip slopes and speeds of full aquaplaning are not estimated", _no_drivetrain),
    ("limit", "slip-slope drop without a dry slope", "a drop is found only relative to the dry slope learnt in the "
     "drive; give tyre.slip_slope_f and tyre.slip_slope_r", _no_dry_slope),
)  # fmt: skip
"""Problems of runs with results: weight, title, consequence, and what is wrong with a run (empty: nothing)."""


def _without_value(data: CampaignData) -> Problem:
    """Runs in which signals have no value for much of the drive, the worst first."""
    hits = []
    for r in data.done:
        notes = [(int(m[1]), note) for note in map(str, r.about["notes"]) if (m := _NO_VALUE.search(note))]
        if notes:
            hits.append(
                (max(n for n, _ in notes), r.index, cut("; ".join(note for _, note in sorted(notes)[::-1]), WHOLE))
            )
    hits.sort(key=lambda hit: (-hit[0], hit[1]))
    worst = hits[0][0] if hits else 0
    title = f"signals without a value for {'up to ' if len(hits) > 1 else ''}{worst} % of the drive"
    return Problem("loss", title, "nothing is judged there", tuple((i, text) for _, i, text in hits), 0.01 * worst)


def _unavailable(data: CampaignData) -> list[Problem]:
    """One problem for all detectors that lack the same signals in the same runs."""
    found: dict[tuple[str, str, str], list[int]] = {}
    for r in data.done:
        for state in ("unavailable", "limited"):
            for detector, missing in r.about[state].items():
                found.setdefault((state, detector, ", ".join(missing)), []).append(r.index)
    alike: dict[tuple[str, str, tuple[int, ...]], list[str]] = {}
    for (state, detector, missing), runs in found.items():
        alike.setdefault((state, missing, tuple(runs)), []).append(detector_name(detector))
    out = []
    for (state, missing, indices), names in alike.items():
        title = f"{', '.join(names)} {'not judged' if state == 'unavailable' else 'judged in part'}"
        means = cut(f"needs {missing}" if missing else "", WHOLE)
        out.append(Problem("limit", title, means, tuple((i, "") for i in indices)))
    return out


def _few(data: CampaignData, keys: Sequence[str]) -> Problem:
    """Configurations on water whose runs are too few for an interval."""
    groups: dict[Group, list[RunInfo]] = {}
    for r in data.done:
        groups.setdefault(group_of(r.run, keys), []).append(r)
    hits = [
        (r.index, f"{group_text(g)}: {counted(len(runs), 'run')}")
        for g, runs in groups.items()
        if len(runs) < TOO_FEW and ("water_depth_mm", 0.0) not in g
        for r in runs
    ]
    title = f"configuration with fewer than {TOO_FEW} runs"
    return Problem("limit", title, "its values, if any, have no interval", tuple(sorted(hits)))


def _notes(data: CampaignData) -> list[Problem]:
    """Notes of the logs; notes that differ only in numbers count as one kind, and the rarest kinds are merged."""
    found: dict[str, list[tuple[int, str]]] = {}
    for r in data.done:
        for note in dict.fromkeys(map(str, r.about["notes"])):
            if _NO_VALUE.search(note):  # a kind of its own
                continue
            found.setdefault(_NUMBER.sub("…", note), []).append((r.index, note))
    kinds = sorted(found.values(), key=lambda hits: -len(hits))
    out = [_note(hits) for hits in kinds[:MOST_KINDS]]
    rest = [(i, cut(note, WHOLE)) for hits in kinds[MOST_KINDS:] for i, note in hits]
    return [*out, Problem("note", "other notes", "", tuple(sorted(rest)))]


def _with_ranges(notes: Sequence[str]) -> str:
    """The sentence of notes that differ in numbers alone, with the range of each number: `0.8 … 1.2`.

    Numbers that are part of a name have none: `log…`.
    """
    columns = zip(*(_NUMBER.findall(n) for n in notes), strict=True)
    ranges = iter([" … ".join(dict.fromkeys((min(c, key=_value), max(c, key=_value)))) for c in columns])

    def shown(found: re.Match[str]) -> str:
        text = next(ranges)
        is_name = found.start() > 0 and (notes[0][found.start() - 1].isalpha() or notes[0][found.start() - 1] == "_")
        return "…" if is_name and " … " in text else text

    return _NUMBER.sub(shown, notes[0])


def _value(number: str) -> float:
    """For the order alone: a number with several commas or points is taken without them."""
    text = number.replace("−", "-").replace(",", ".")
    return float(text if text.count(".") < 2 else text.replace(".", ""))


def _note(hits: Sequence[tuple[int, str]]) -> Problem:
    same = len({note for _, note in hits}) == 1
    title = hits[0][1] if same else _with_ranges([note for _, note in hits])
    return Problem("note", cut(title, WHOLE), "", tuple((i, "" if same else cut(note, WHOLE)) for i, note in hits))
