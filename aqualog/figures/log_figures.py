"""Figures 2.8, 2.9, 2.21 to 2.23 and 2.25 from a campaign's own logs: the run that shows it best, all detectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.samples import RunInfo
from aqualog.detect.joint import CRITERIA
from aqualog.detect.slip_slope.activation import CORNERING
from aqualog.figures import fig_2_08, fig_2_09, fig_2_23, fig_2_25
from aqualog.figures.drive import DriveRun
from aqualog.figures.evidence import KMH, Evidence, free_wheels
from aqualog.figures.record import Figure, Panel, RunsUsed, Table
from aqualog.figures.scene_panels import WHEEL_WORDS, speed_panel, tie_rod_panels
from aqualog.figures.selection import FAMILIES, NotInCampaign, label, value_of

__all__ = ["OF_LOGS", "make_from_logs"]

_FRONT = ("fl", "fr")
_TURNING = 0.1  # share of the samples on water that makes a drive a slalom, where the manoeuvre is not given
_SLALOM = ("slalom", "sine", "sinus")
_DRIVEN = 0.1  # share of the torque below which an axle of an all-wheel-drive car counts as not driven
_MOST_EVENTS = 40

Score = tuple[float, ...]
Shown = tuple[str, ...]
"""Wheels that a figure shows."""


@dataclass(frozen=True, slots=True)
class LogFigure:
    """How a figure is made from one log: `rule` in words, `score` of a run (None: it does not show it) with the wheels
    that do, `panels` of a drive and these wheels.
    """

    title: str
    rule: str
    needs: str
    score: Callable[[Evidence, RunInfo], tuple[Score, Shown] | None]
    panels: Callable[[DriveRun, Shown], tuple[Panel, ...]]


def _count(evidence: Evidence, info: RunInfo, detector: str, wheels: Sequence[str]) -> dict[str, int]:
    found = evidence.events(info, detector, wheels=wheels)
    return {w: n for w in wheels if (n := sum(e["wheel"] == w for e in found))}


def _most(count: dict[str, int], like: str = "") -> str:
    """Wheel with most events; of equal ones that on the same side."""
    return max(count, key=lambda w: (count[w], w[1:] == like, w))


def _down_and_up(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
    down = _count(evidence, info, "spin_down", free_wheels(info))
    up = _count(evidence, info, "spin_up", [w for w in info.vehicle.driven if w not in free_wheels(info)])
    if not down or not up:
        return None
    front = _most(down)
    return (float(min(sum(down.values()), sum(up.values()))), -evidence.of(info).v), (front, _most(up, front[1]))


def _minor(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
    minor = _count(evidence, info, "minor_spin_down", free_wheels(info))
    if not minor or info.vehicle.drivetrain == "awd":
        return None
    wheel = _most(minor)
    large = len(evidence.events(info, "spin_down"))
    return (float(minor[wheel]), -float(large)), (wheel,)


def _rods(info: RunInfo) -> bool:
    has = all(f"tie_rod_{w}" in info.about.get("signals", ()) for w in _FRONT)
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
        spins = len(evidence.events(info, *kinds, wheels=_FRONT))
        return ((float(spins),), _FRONT) if spins else None

    return score


def _joint(evidence: Evidence, info: RunInfo) -> tuple[Score, Shown] | None:
    if not evidence.events(info, "joint_criteria", "joint_cusum"):
        return None
    kinds = len({e["detector"] for e in evidence.events(info, *CRITERIA)})
    full = any(e["severity"] == "full" for e in evidence.events(info, "spin_down"))
    return (float(not full), float(kinds), float(len(evidence.events(info, "minor_spin_down")))), ()


_ROD_NEEDS = "tie-rod forces, a vehicle file with [tie_rod] (aqualog calibrate)"
OF_LOGS: dict[str, LogFigure] = {
    "2.8": LogFigure(
        "spin-down of a free and spin-up of a driven wheel, with detection",
        "the run with most spin-downs of free wheels and spin-ups of driven ones on water, at least one of each",
        "a run over water with a large spin-down of a free and a spin-up of a driven wheel",
        _down_and_up, lambda r, w: fig_2_08.panels(r, w[0], w[1]),
    ),
    "2.9": LogFigure(
        "variances of the acceleration differences under minor spin-downs",
        "the run with most minor spin-downs of one free wheel on water, of equal ones the one with fewest large "
        "spin-downs",
        "a run over water with minor spin-downs of a car with one driven axle",
        _minor, lambda r, w: fig_2_09.panels(r, w[0][1]),
    ),
    "2.21": LogFigure(
        "tie-rod forces, front wheels that are not driven aquaplane",
        "the straight run with most spin-downs of front wheels on water, front axle not driven",
        f"a straight run over water with spin-downs of front wheels that are not driven, {_ROD_NEEDS}",
        _rod_score(is_driven=False, is_slalom=False), lambda r, _: (speed_panel(r, _FRONT), *tie_rod_panels(r)),
    ),
    "2.22": LogFigure(
        "tie-rod forces, driven front wheels spin down and up",
        "the straight run with most spin-downs and spin-ups of front wheels on water, front axle driven",
        f"a straight run over water with spin-ups or spin-downs of driven front wheels, {_ROD_NEEDS}",
        _rod_score(is_driven=True, is_slalom=False), lambda r, _: (speed_panel(r, _FRONT), *tie_rod_panels(r)),
    ),
    "2.23": LogFigure(
        "tie-rod forces in a slalom",
        "the slalom with most spin-downs of front wheels on water",
        f"a slalom over water with spin-downs of front wheels, {_ROD_NEEDS}",
        _rod_score(is_driven=False, is_slalom=True), lambda r, _: fig_2_23.panels(r),
    ),
    "2.25": LogFigure(
        "both joint detectors, criterion by criterion",
        "of the runs in which a joint detector warns on water, first without a full spin-down, the one that meets most "
        "criteria, then with most minor spin-downs",
        "a run over water in which a joint detector warns",
        _joint, lambda r, _: fig_2_25.panels(r),
    ),
}  # fmt: skip


def make_from_logs(number: str, evidence: Evidence) -> Figure:
    """Choose the run, read it again, and draw it.

    Raises
    ------
    NotInCampaign
        If no run shows it.
    """
    how = OF_LOGS[number]
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
        raise NotInCampaign(f"needs {how.needs}: none of {total} runs has it", where=f"figure {number}")
    _, _, info, wheels = best
    r = evidence.drive(info)
    words = ", ".join(label(f, value_of(info, f)) for f in FAMILIES)
    return Figure(
        number,
        how.title,
        f"{info.name}: {words}, {evidence.of(info).v / KMH:.0f} km/h. Chosen: {how.rule} ({among} runs show it). One "
        "run, so "
        f"no claim is judged here.",
        how.panels(r, wheels),
        (),
        (_events(evidence, info),),
        RunsUsed(evidence.name, ((info.name, "drawn"),), (("not chosen", total - 1),) if total > 1 else ()),
    )


def _events(evidence: Evidence, info: RunInfo) -> Table:
    entry = evidence.of(info).entry
    shown = evidence.events(info, *{str(e["detector"]) for e in info.events})
    rows = tuple(
        (str(e["detector"]).replace("_", " "), WHEEL_WORDS.get(str(e["wheel"]), "–"), str(e["severity"]),
         f"{_number(e['start_s']) - entry:.2f}", f"{_number(e['end_s']) - _number(e['start_s']):.2f}")
        for e in shown[:_MOST_EVENTS]
    )  # fmt: skip
    more = f", first {_MOST_EVENTS} of {len(shown)}" if len(shown) > _MOST_EVENTS else ""
    return Table(
        f"Events that begin on the water{more}", ("detector", "wheel", "severity", "after entry [s]", "lasts [s]"),
        rows or (("none", "–", "–", "–", "–"),),
    )  # fmt: skip


def _number(x: object) -> float:
    return float(x) if isinstance(x, int | float) else float("nan")
