"""Figures of one drive from a campaign's own logs: the run that shows it best, all detectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import free_of
from aqualog.campaign.results import RunInfo
from aqualog.detect.joint_criteria import CRITERIA
from aqualog.detect.slip_slope.activation import CORNERING
from aqualog.thesis.catalogue import rows
from aqualog.thesis.evidence.campaign import KMH, DriveRun, Evidence
from aqualog.thesis.evidence.selection import FAMILIES, NotInCampaign, label, value_of
from aqualog.thesis.figures.joint import panels_2_25
from aqualog.thesis.figures.panels import FRONT, WHEEL_WORDS
from aqualog.thesis.figures.tie_rods import panels_2_23, rod_panels
from aqualog.thesis.figures.wheel_spins import panels_2_08, panels_2_09
from aqualog.thesis.record import Figure, Panel, RunsUsed, Table

__all__ = ["FIGURES"]

_TURNING = 0.1  # share of the samples on water that makes a drive a slalom, where the manoeuvre is not given
_SLALOM = ("slalom", "sine", "sinus")
_DRIVEN = 0.1  # share of the torque below which an axle of an all-wheel-drive car counts as not driven
_MOST_EVENTS = 40

Score = tuple[float, ...]
Shown = tuple[str, ...]
"""Wheels that a figure shows."""


@dataclass(frozen=True, slots=True)
class LogFigure:
    """`score` of a run (None: it does not show it) with the wheels that do; `panels` of a drive and these wheels."""

    score: Callable[[Evidence, RunInfo], tuple[Score, Shown] | None]
    panels: Callable[[DriveRun, Shown], tuple[Panel, ...]]


def _count(evidence: Evidence, info: RunInfo, detector: str, wheels: Sequence[str]) -> dict[str, int]:
    found = evidence.events(info, detector, wheels=wheels)
    return {w: n for w in wheels if (n := sum(e["wheel"] == w for e in found))}


def _most(count: dict[str, int], like: str = "") -> str:
    """Wheel with most events; of equal ones that on the same side."""
    return max(count, key=lambda w: (count[w], w[1:] == like, w))


def _down_and_up(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
    down = _count(evidence, info, "spin_down", free_of(info))
    up = _count(evidence, info, "spin_up", [w for w in info.vehicle.driven if w not in free_of(info)])
    if not down or not up:
        return None
    front = _most(down)
    return (float(min(sum(down.values()), sum(up.values()))), -evidence.of(info).v), (front, _most(up, front[1]))


def _minor(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
    minor = _count(evidence, info, "minor_spin_down", free_of(info))
    if not minor or info.vehicle.drivetrain == "awd":
        return None
    wheel = _most(minor)
    large = len(evidence.events(info, "spin_down"))
    return (float(minor[wheel]), -float(large)), (wheel,)


def _rods(info: RunInfo) -> bool:
    has = all(f"tie_rod_{w}" in info.about.get("signals", ()) for w in FRONT)
    return has and "tie_rod" not in info.about.get("unavailable", {})


def _is_slalom(evidence: Evidence, info: RunInfo) -> bool:
    """By the word that the campaign has for the manoeuvre, else by how much of the water it corners."""
    told = info.run.values.get("manoeuvre")
    if told is not None:
        return any(word in str(told).lower() for word in _SLALOM)
    samples, wet = evidence.wet(info)
    return float(np.mean(samples.bits_of("reason", CORNERING)[wet])) > _TURNING


def _front_is_driven(info: RunInfo) -> bool:
    car = info.vehicle
    return car.drivetrain == "fwd" or (car.drivetrain == "awd" and car.torque_split_rear < 1.0 - _DRIVEN)


def _rod_score(*, is_driven: bool, is_slalom: bool) -> Callable[[Evidence, RunInfo], tuple[Score, Shown] | None]:
    def score(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
        if not _rods(info) or _is_slalom(evidence, info) != is_slalom:
            return None
        if not is_slalom and _front_is_driven(info) != is_driven:
            return None
        kinds = ("spin_down", "minor_spin_down", "spin_up") if is_driven else ("spin_down", "minor_spin_down")
        spins = len(evidence.events(info, *kinds, wheels=FRONT))
        return ((float(spins),), FRONT) if spins else None

    return score


def _joint(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
    if not evidence.events(info, "joint_criteria", "joint_cusum"):
        return None
    kinds = len({e["detector"] for e in evidence.events(info, *CRITERIA)})
    full = any(e["severity"] == "full" for e in evidence.events(info, "spin_down"))
    return (float(not full), float(kinds), float(len(evidence.events(info, "minor_spin_down")))), ()


_HOW: dict[str, LogFigure] = {
    "2.8": LogFigure(_down_and_up, lambda r, w: panels_2_08(r, w[0], w[1])),
    "2.9": LogFigure(_minor, lambda r, w: panels_2_09(r, w[0][1])),
    "2.21": LogFigure(_rod_score(is_driven=False, is_slalom=False), lambda r, _: rod_panels(r)),
    "2.22": LogFigure(_rod_score(is_driven=True, is_slalom=False), lambda r, _: rod_panels(r)),
    "2.23": LogFigure(_rod_score(is_driven=False, is_slalom=True), lambda r, _: panels_2_23(r)),
    "2.25": LogFigure(_joint, lambda r, _: panels_2_25(r)),
}


def from_logs(number: str, evidence: Evidence) -> Figure:
    """Choose the run, read it again, and draw it.

    Raises
    ------
    NotInCampaign
        If no run shows it.
    """
    how, log = _HOW[number], rows()[number].log
    best: tuple[Score, int, RunInfo, Shown] | None = None
    among = 0
    for info in evidence.data.done:
        found = None if evidence.has_water(info) else how.score(evidence, info)
        if found is None:
            continue
        among += 1
        if best is None or found[0] > best[0]:
            best = found[0], info.index, info, found[1]
    total = len(evidence.data.runs)
    if best is None:
        raise NotInCampaign(f"needs {log['needs']}: none of {total} runs has it", where=f"figure {number}")
    _, _, info, wheels = best
    r = evidence.drive(info)
    words = ", ".join(label(f, value_of(info, f)) for f in FAMILIES)
    caption = (
        f"{info.name}: {words}, {evidence.of(info).v / KMH:.0f} km/h. Chosen: {log['rule']} ({among} runs show it). "
        "One run, so no claim is judged here."
    )
    left_out = (("not chosen", total - 1),) if total > 1 else ()
    return Figure(
        number, log["title"], caption, how.panels(r, wheels), (), (_events(evidence, info),),
        RunsUsed(evidence.name, ((info.name, "drawn"),), left_out),
    )  # fmt: skip


def _events(evidence: Evidence, info: RunInfo) -> Table:
    entry = evidence.of(info).entry
    shown = evidence.events(info, *{str(e["detector"]) for e in info.events})
    events = tuple(
        (str(e["detector"]).replace("_", " "), WHEEL_WORDS.get(str(e["wheel"]), "–"), str(e["severity"]),
         f"{_number(e['start_s']) - entry:.2f}", f"{_number(e['end_s']) - _number(e['start_s']):.2f}")
        for e in shown[:_MOST_EVENTS]
    )  # fmt: skip
    more = f", first {_MOST_EVENTS} of {len(shown)}" if len(shown) > _MOST_EVENTS else ""
    return Table(
        f"Events that begin on the water{more}", ("detector", "wheel", "severity", "after entry [s]", "lasts [s]"),
        events or (("none", "–", "–", "–", "–"),),
    )  # fmt: skip


def _number(x: object) -> float:
    return float(x) if isinstance(x, int | float) else float("nan")


FIGURES = dict.fromkeys(_HOW, from_logs)
