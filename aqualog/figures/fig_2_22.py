"""Figure 2.22: tie-rod forces when driven front wheels spin down and up."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.figures.record import Figure, Finding, Table, judged
from aqualog.figures.scene_panels import speed_panel, tie_rod_panels
from aqualog.figures.scene_study import (
    MANY,
    SEEDS,
    SOME,
    SceneRun,
    in_runs,
    known,
    residual,
    run_of,
    runs,
    scatter,
    share,
    spread,
)
from aqualog.model.sketch import KMH
from aqualog.model.thesis_scenes import scene

__all__ = ["make"]

NUMBER = "2.22"
_FRONT = ("fl", "fr")
_SPUN = 0.05  # [-] slip beyond which a wheel spins down or up
_SLIGHT = 0.02  # [-] of the slight ones
_TIMES = 4.0  # dry scatters that a rise must exceed: the drift of the tie-rod detector (K)
_BEFORE = 0.3  # [s] in which the wheel must have spun before its rod is reported
_AFLOAT = 0.9  # share of the contact below which a wheel aquaplanes in part
_EARLY = 85 * KMH  # [m/s]
_EARLY_RUNS = 10
_RARE = 0.05  # share of that time in which the bit may be set without a spin


class Course(NamedTuple):
    """A moment that the text describes: from, to [s], sign of the slip."""

    name: str
    start: float
    end: float
    sign: float


_COURSE = (
    Course("spin-down at 18 s", 17.5, 18.7, -1.0),
    Course("short spin-up at 19 s", 18.5, 19.7, 1.0),
    Course("spin-down at 21 to 22 s", 20.7, 22.3, -1.0),
    Course("strong spin-up at 23 to 24.5 s", 22.7, 24.7, 1.0),
)


def _extreme(r: SceneRun, c: Course) -> float:
    """Largest slip of the front left wheel in a moment, in its sign. [-]"""
    return float(np.nanmax(c.sign * r.signal("true_slip_fl")[r.within(c.start, c.end)]))


def _rise(r: SceneRun, sign: float) -> float:
    """Median residual of the rods of wheels that spin, in dry scatters; NaN if none does. [-]"""
    x = [
        residual(r, w)[(sign * r.signal(f"true_slip_{w}") > _SPUN) & r.on_lane()] / scatter(r, w) for w in _FRONT
    ]  # fmt: skip
    values = np.concatenate(x)
    return float(np.nanmedian(values)) if values.size else float("nan")


def _c62_force(all_runs: tuple[SceneRun, ...]) -> Finding:
    down, up = ([_rise(r, sign) for r in all_runs] for sign in (-1.0, 1.0))
    has_down, has_up = (float(np.mean([x > _TIMES for x in v])) for v in (down, up))
    both = float(np.mean([a > _TIMES and b > _TIMES for a, b in zip(down, up, strict=True)]))
    return Finding(
        "C62",
        "Spin-downs and spin-ups both raise the measured tie-rod force well over the calculated one.",
        f"median of measured less calculated force beyond {_TIMES:g} dry scatters, in slips below {-_SPUN:.0%} and in "
        f"slips above {_SPUN:.0%} of the front wheels, both in {MANY:.0%} of the runs; in part: both in {SOME:.0%}, or "
        f"one of them in {MANY:.0%}",
        f"both in {in_runs(both)} runs; in spin-downs {spread(down, 1)} scatters, in spin-ups {spread(up, 1)}",
        judged(whole=both >= MANY, part=both >= SOME or max(has_down, has_up) >= MANY),
        "" if both >= MANY else "In some runs no front wheel goes that far in one of both directions.",
        both,
    )


def _is_course(r: SceneRun) -> bool:
    slips = [_extreme(r, c) for c in _COURSE]
    return min(slips) > _SLIGHT and slips[3] > slips[1]


def _c62_course(all_runs: tuple[SceneRun, ...]) -> Finding:
    every = share(all_runs, _is_course)
    each = {c.name: share(all_runs, lambda r, c=c: _extreme(r, c) > _SLIGHT) for c in _COURSE}  # type: ignore[misc]
    return Finding(
        "C62 (course)",
        "Front left: slight spin-down at 18 s, short spin-up at 19 s, small spin-down at 21 to 22 s, strong spin-up at "
        "23 to 24.5 s.",
        f"slip beyond {_SLIGHT:.0%} in the sign of each, within 0.5 s of the given times, the last spin-up beyond the "
        f"first, in {MANY:.0%} of the runs; in part: in {SOME:.0%}",
        f"all in {in_runs(every)} runs; " + ", ".join(f"{n} {in_runs(x)}" for n, x in each.items()),
        judged(whole=every >= MANY, part=every >= SOME),
        "" if every >= MANY else
        "The driver pushes at the given times; the contact's fluctuation decides whether the wheel spins in each.",
        every,
    )  # fmt: skip


def _before(r: SceneRun, t: float, wheel: str) -> bool:
    """Whether a wheel has spun shortly before a time."""
    span = r.within(t - _BEFORE, t + 1e-6)
    return bool((np.abs(r.signal(f"true_slip_{wheel}")[span]) > _SLIGHT).any())


def _calm(r: SceneRun, wheel: str) -> tuple[FloatArray, BoolArray]:
    """Contact and detection bit of the samples afloat in part without a spin nearby, arrays (m,)."""
    spun = np.abs(r.signal(f"true_slip_{wheel}")) > _SLIGHT
    near = np.convolve(spun, np.ones(round(_BEFORE / r.result.signals.dt) * 2 + 1), mode="same") > 0
    contact = r.signal(f"true_contact_{wheel}")
    calm = (contact < _AFLOAT) & ~near
    return contact[calm], r.active("tie_rod", wheel)[calm]


def _c60(all_runs: tuple[SceneRun, ...]) -> Finding:
    begun = [_before(r, t, w) for r in all_runs for w in _FRONT for t in r.events("tie_rod", w)]
    calm = [_calm(r, w) for r in all_runs for w in _FRONT]
    contact, bits = np.concatenate([c for c, _ in calm]), np.concatenate([b for _, b in calm])
    rate = float(np.mean(bits)) if bits.size else 0.0
    reported = share(all_runs, lambda r: bool(r.events("tie_rod")))
    spun = float(np.mean(begun)) if begun else 0.0
    return Finding(
        "C60",
        "The small forces of early partial aquaplaning are not reliable; with spin-downs and spin-ups even a coarse "
        "model is enough.",
        f"events of the tie rods in at least {MANY:.0%} of the runs, 95 % of them within {_BEFORE:g} s of a slip of "
        f"their wheel beyond {_SLIGHT:.0%}; with less than {_AFLOAT:.0%} of the contact and no such slip the bit is "
        f"set in less than {_RARE:.0%} of the time; in part: one of the latter two",
        f"there are {len(begun)} events in {in_runs(reported)} runs, {spun:.0%} of them with a spin; set in "
        f"{rate:.1%} of {0.01 * bits.size:.0f} s of partial aquaplaning without",
        judged(
            whole=spun >= 0.95 and rate < _RARE and reported >= MANY,
            part=spun >= 0.95 or rate < _RARE,
        ),
        "" if spun >= 0.95 and rate < _RARE else
        f"At this speed even wheels that do not spin have lost a good part of the road (median contact in that time "
        f"{np.median(contact):.0%}), and their rods show the water's drag and the lost aligning moment. The simulated "
        f"axle has no friction, play or wear: its dry scatter of {spread([scatter(r, 'fl') for r in all_runs], 0)} N "
        "is smaller than that of a car.",
        spun,
    )  # fmt: skip


@lru_cache(maxsize=1)
def _early() -> tuple[SceneRun, ...]:
    """The same car on the same lane, slower and at constant speed."""
    wet = replace(scene(NUMBER), speed=((0.0, _EARLY),), duration_s=26.0)
    return tuple(run_of(replace(wet, seed=s), known(NUMBER)) for s in SEEDS[:_EARLY_RUNS])


def _c60_early(early: tuple[SceneRun, ...]) -> Finding:
    hit = share(early, lambda r: bool(r.events("tie_rod")))
    calm = share(early, lambda r: all(np.nanmax(np.abs(r.signal(f"true_slip_{w}"))) < _SLIGHT for w in _FRONT))
    contact = [float(np.nanmedian(r.signal("true_contact_fl")[r.on_lane()])) for r in early]
    peak = [float(np.nanmax(np.abs(residual(r, "fl")[r.on_lane()]))) for r in early]
    return Finding(
        "C60 (early)",
        "The small forces of early partial aquaplaning are not reliable.",
        f"at {_EARLY * 3.6:.0f} km/h on the same lane the tie rods are reported in less than {SOME:.0%} of the runs; "
        f"in part: in less than {MANY:.0%}",
        f"reported in {round(hit * len(early))} of {len(early)} runs; contact {spread(contact)} (median on the lane), "
        f"no slip beyond {_SLIGHT:.0%} in {round(calm * len(early))}; largest residual {spread(peak, 0)} N",
        judged(whole=hit < SOME, part=hit < MANY),
        "" if hit < SOME else "The simulated axle has no friction, play or wear, so that small forces show.",
        hit,
    )


def make() -> Figure:
    """Front wheel speeds and both tie rods of one run; C62 and C60 over all runs."""
    all_runs = runs(NUMBER)
    r = all_runs[0]
    table = Table(
        "Largest slip of the front left wheel [%]",
        ("seed", *(c.name for c in _COURSE)),
        tuple((str(x.seed), *(f"{100 * c.sign * _extreme(x, c):.1f}" for c in _COURSE)) for x in all_runs),
    )
    return Figure(
        NUMBER,
        "tie-rod forces, driven front wheels spin down and up",
        f"All-wheel drive with 60 % of the torque in front, straight on, with pushes before 19 s and from 22.7 s on, "
        f"1.3 mm from {r.entry:g} s on. The polynomial is from a dry slalom of the same car. Drawn: seed {r.seed}; "
        f"judged over seeds {all_runs[0].seed} to {all_runs[-1].seed}, which differ in sensor noise and in how the "
        f"contact fluctuates along the lane.",
        (speed_panel(r, _FRONT), *tie_rod_panels(r)),
        (_c62_force(all_runs), _c62_course(all_runs), _c60(all_runs), _c60_early(_early())),
        (table,),
    )
