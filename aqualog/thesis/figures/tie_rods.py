"""Figures 2.21 to 2.23: tie-rod forces on water, straight on and in a slalom."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.model.drawing import KMH
from aqualog.model.programme import scene
from aqualog.report.theme import INK, MUTED
from aqualog.thesis.claims import Check, judge, limit
from aqualog.thesis.evidence import scenes
from aqualog.thesis.evidence.campaign import DriveRun
from aqualog.thesis.figures.panels import FRONT, by_seed, drawn_lines, panel, rod_forces, scene_figure, speed_panel
from aqualog.thesis.record import Axis, Figure, Panel, Table

__all__ = ["FIGURES", "panels_2_23", "rod_panels"]

_DOWN = -0.05  # [-] slip of a wheel that spins down
_SERIES = limit("series", "C61.figure")  # spin-downs that make a series
_SCATTERS = limit("dry_scatters")  # dry scatters that a rise must exceed: the drift of the tie-rod detector (K)
_MATCH = limit("match", "C61.figure")  # times the dry scatter that the residual of a matching rod may have, or
_COARSE = limit("coarse", "C61.figure")  # [N] the scatter of a good model (K)


def _down(r: scenes.SceneRun) -> list[slice]:
    return scenes.stretches(r, (r.signal("true_slip_fr") < _DOWN) & r.on_lane())


def _rise(r: scenes.SceneRun) -> float:
    """Median of the right residual while the right wheel spins down; NaN without a spin-down. [N]"""
    x = [scenes.residual(r, "fr")[s] for s in _down(r)]
    return float(np.nanmedian(np.concatenate(x))) if x else float("nan")


def _left(r: scenes.SceneRun) -> float:
    """Root mean square of the left residual on the lane. [N]"""
    return float(np.sqrt(np.nanmean(scenes.residual(r, "fl")[r.on_lane()] ** 2)))


def _is_series(r: scenes.SceneRun) -> bool:
    return len(_down(r)) >= _SERIES


def _rises(r: scenes.SceneRun) -> bool:
    return _rise(r) > _SCATTERS * scenes.scatter(r, "fr")


def _matches(r: scenes.SceneRun) -> bool:
    return _left(r) < max(_MATCH * scenes.scatter(r, "fl"), _COARSE)


def _is_told_apart(r: scenes.SceneRun) -> bool:
    """An event of the right rod that begins on the lane, and none of the left one in the whole drive."""
    return any(r.entry <= t <= r.exit for t in r.events("tie_rod", "fr")) and not r.events("tie_rod", "fl")


def _c61(all_runs: tuple[scenes.SceneRun, ...]) -> tuple[Check, Table]:
    parts = {n: scenes.share(all_runs, f) for n, f in (("series", _is_series), ("rise", _rises), ("match", _matches))}
    every = scenes.share(all_runs, lambda r: _is_series(r) and _rises(r) and _matches(r) and _is_told_apart(r))
    told = scenes.share(all_runs, _is_told_apart)
    outcome = (
        f"all in {scenes.in_runs(every)} runs: series {scenes.in_runs(parts['series'])}, "
        f"rise {scenes.in_runs(parts['rise'])} "
        f"({scenes.spread([_rise(r) for r in all_runs], 0)} N against a dry scatter of "
        f"{scenes.spread([scenes.scatter(r, 'fr') for r in all_runs], 0)} N), left {scenes.in_runs(parts['match'])} "
        f"({scenes.spread([_left(r) for r in all_runs], 0)} N), right rod only {scenes.in_runs(told)}"
    )
    finding = judge("C61.figure", outcome, whole=every >= scenes.MANY, part=told >= scenes.SOME, value=every)
    columns = {
        "spin-downs": [str(len(_down(r))) for r in all_runs],
        "rise of its rod [N]": ["–" if np.isnan(x) else f"{x:.0f}" for x in map(_rise, all_runs)],
        "left residual, rms [N]": [f"{_left(r):.0f}" for r in all_runs],
    }
    return finding, by_seed("Front right wheel on the lane", all_runs, columns)


def rod_panels(r: DriveRun) -> tuple[Panel, ...]:
    """Front wheel speeds, and the forces of both tie rods."""
    return (speed_panel(r, FRONT), *rod_forces(r))


def figure_2_21() -> Figure:
    """Front wheel speeds and both tie rods of one run; C61 over all runs."""
    finding, table = _c61(scenes.runs("2.21"))
    return scene_figure("2.21", rod_panels, (finding,), (table,))


_SPUN = limit("spun", "C62.figure")  # [-] slip beyond which a wheel spins down or up
_SLIGHT = limit("slight")  # [-] of the slight ones
_BEFORE = limit("before", "C60.figure")  # [s] in which the wheel must have spun before its rod is reported
_AFLOAT = limit("afloat", "C60.figure")  # share of the contact below which a wheel aquaplanes in part
_EARLY = 85 * KMH  # [m/s]
_EARLY_RUNS = 10
_RARE = limit("rare", "C60.figure")  # share of that time in which the bit may be set without a spin


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


def _extreme(r: scenes.SceneRun, c: Course) -> float:
    """Largest slip of the front left wheel in a moment, in its sign. [-]"""
    return float(np.nanmax(c.sign * r.signal("true_slip_fl")[r.within(c.start, c.end)]))


def _rise_in_scatters(r: scenes.SceneRun, sign: float) -> float:
    """Median residual of the rods of wheels that spin, in dry scatters; NaN if none does. [-]"""
    spins = {w: (sign * r.signal(f"true_slip_{w}") > _SPUN) & r.on_lane() for w in FRONT}
    values = np.concatenate([scenes.residual(r, w)[bits] / scenes.scatter(r, w) for w, bits in spins.items()])
    return float(np.nanmedian(values)) if values.size else float("nan")


def _c62_force(all_runs: tuple[scenes.SceneRun, ...]) -> Check:
    down, up = ([_rise_in_scatters(r, sign) for r in all_runs] for sign in (-1.0, 1.0))
    has_down, has_up = (float(np.mean([x > _SCATTERS for x in v])) for v in (down, up))
    both = float(np.mean([a > _SCATTERS and b > _SCATTERS for a, b in zip(down, up, strict=True)]))
    told = f"in spin-downs {scenes.spread(down, 1)} scatters, in spin-ups {scenes.spread(up, 1)}"
    outcome = f"both in {scenes.in_runs(both)} runs; {told}"
    part = both >= scenes.SOME or max(has_down, has_up) >= scenes.MANY
    return judge("C62.figure", outcome, whole=both >= scenes.MANY, part=part, value=both)


def _is_course(r: scenes.SceneRun) -> bool:
    slips = [_extreme(r, c) for c in _COURSE]
    return min(slips) > _SLIGHT and slips[3] > slips[1]


def _c62_course(all_runs: tuple[scenes.SceneRun, ...]) -> Check:
    every = scenes.share(all_runs, _is_course)
    each = {c.name: scenes.share(all_runs, lambda r, c=c: _extreme(r, c) > _SLIGHT) for c in _COURSE}  # type: ignore[misc]
    outcome = f"all in {scenes.in_runs(every)} runs; " + ", ".join(f"{n} {scenes.in_runs(x)}" for n, x in each.items())
    return judge("C62.figure_course", outcome, whole=every >= scenes.MANY, part=every >= scenes.SOME, value=every)


def _before(r: scenes.SceneRun, t: float, wheel: str) -> bool:
    """Whether a wheel has spun shortly before a time."""
    span = r.within(t - _BEFORE, t + 1e-6)
    return bool((np.abs(r.signal(f"true_slip_{wheel}")[span]) > _SLIGHT).any())


def _calm(r: scenes.SceneRun, wheel: str) -> tuple[FloatArray, BoolArray]:
    """Contact and detection bit of the samples afloat in part without a spin nearby, arrays (m,)."""
    spun = np.abs(r.signal(f"true_slip_{wheel}")) > _SLIGHT
    near = np.convolve(spun, np.ones(round(_BEFORE / r.result.signals.dt) * 2 + 1), mode="same") > 0
    contact = r.signal(f"true_contact_{wheel}")
    calm = (contact < _AFLOAT) & ~near
    return contact[calm], r.active("tie_rod", wheel)[calm]


def _c60(all_runs: tuple[scenes.SceneRun, ...]) -> Check:
    begun = [_before(r, t, w) for r in all_runs for w in FRONT for t in r.events("tie_rod", w)]
    calm = [_calm(r, w) for r in all_runs for w in FRONT]
    contact, bits = np.concatenate([c for c, _ in calm]), np.concatenate([b for _, b in calm])
    rate = float(np.mean(bits)) if bits.size else 0.0
    reported = scenes.share(all_runs, lambda r: bool(r.events("tie_rod")))
    spun = float(np.mean(begun)) if begun else 0.0
    outcome = (
        f"there are {len(begun)} events in {scenes.in_runs(reported)} runs, {spun:.0%} of them with a spin; set in "
        f"{rate:.1%} of {0.01 * bits.size:.0f} s of partial aquaplaning without"
    )
    whole = spun >= 0.95 and rate < _RARE and reported >= scenes.MANY
    fields = {"contact": np.median(contact), "scatter": scenes.spread([scenes.scatter(r, "fl") for r in all_runs], 0)}
    return judge("C60.figure", outcome, whole=whole, part=spun >= 0.95 or rate < _RARE, value=spun, fields=fields)


@lru_cache(maxsize=1)
def _early() -> tuple[scenes.SceneRun, ...]:
    """The same car on the same lane, slower and at constant speed."""
    wet = replace(scene("2.22"), speed=((0.0, _EARLY),), duration_s=26.0)
    return tuple(scenes.run_of(replace(wet, seed=s), scenes.known("2.22")) for s in scenes.SEEDS[:_EARLY_RUNS])


def _c60_early(early: tuple[scenes.SceneRun, ...]) -> Check:
    hit = scenes.share(early, lambda r: bool(r.events("tie_rod")))
    calm = scenes.share(early, lambda r: all(np.nanmax(np.abs(r.signal(f"true_slip_{w}"))) < _SLIGHT for w in FRONT))
    contact = [float(np.nanmedian(r.signal("true_contact_fl")[r.on_lane()])) for r in early]
    peak = [float(np.nanmax(np.abs(scenes.residual(r, "fl")[r.on_lane()]))) for r in early]
    outcome = (
        f"reported in {round(hit * len(early))} of {len(early)} runs; "
        f"contact {scenes.spread(contact)} (median on the lane), no slip beyond {_SLIGHT:.0%} in "
        f"{round(calm * len(early))}; largest residual {scenes.spread(peak, 0)} N"
    )
    return judge("C60.figure_early", outcome, whole=hit < scenes.SOME, part=hit < scenes.MANY, value=hit)


def figure_2_22() -> Figure:
    """Front wheel speeds and both tie rods of one run; C62 and C60 over all runs."""
    all_runs = scenes.runs("2.22")
    columns = {c.name: [f"{100 * c.sign * _extreme(x, c):.1f}" for x in all_runs] for c in _COURSE}
    table = by_seed("Largest slip of the front left wheel [%]", all_runs, columns)
    checks = (_c62_force(all_runs), _c62_course(all_runs), _c60(all_runs), _c60_early(_early()))
    return scene_figure("2.22", rod_panels, checks, (table,))


_DRY = (8.0, 22.5)  # [s] slalom before the water
_SHORT, _LEFT, _BOTH = (22.9, 23.8), (26.0, 27.1), (27.1, 29.0)  # [s] as the text has it: 23, 26, shortly after 27
_LIGHT_DOWN = -0.02  # [-] slip of a light spin-down
_STEADY = limit("steady", "C63.figure")  # of the speed that it may change: "almost constant"
_STOP = -0.9  # [-] of a wheel that stands
_A_Y = limit("a_y", "C63.figure")  # [m/s^2] "up to 2"
_FALL = limit("fall", "C63.figure")  # of the slalom's amplitude that is left at most when control is lost
_EXPLAINED = limit("explained")  # of the variance of the rods
_STEER = Axis("road-wheel angle in deg; lateral acceleration", "m/s^2")


def _explained(r: scenes.SceneRun) -> float:
    """Share of the variance of both measured rods that the calculation explains in the dry slalom. [-]"""
    dry = r.within(*_DRY)
    left = float(np.nansum([scenes.residual(r, w)[dry] ** 2 for w in ("fl", "fr")]))
    measured = np.array([r.feature(f"tie_rod_meas_{w}")[dry] for w in ("fl", "fr")])
    return 1.0 - left / float(np.nansum((measured - np.nanmean(measured)) ** 2))


def _peak(r: scenes.SceneRun, wheel: str, span: tuple[float, float]) -> float:
    """Largest residual in a moment, in dry scatters. [-]"""
    return float(np.nanmax(scenes.residual(r, wheel)[r.within(*span)])) / scenes.scatter(r, wheel)


def _went(r: scenes.SceneRun, wheel: str, span: tuple[float, float], slip: float = _LIGHT_DOWN) -> bool:
    return bool((r.signal(f"true_slip_{wheel}")[r.within(*span)] < slip).any())


def _amplitude(r: scenes.SceneRun, span: tuple[float, float]) -> float:
    return float(np.nanmax(np.abs(r.feature("a_y_slow")[r.within(*span)])))


def _parts(r: scenes.SceneRun) -> dict[str, bool]:
    left, right = (_peak(r, w, _SHORT) for w in ("fl", "fr"))
    v = r.velocity[r.within(_DRY[0], _BOTH[0])]  # until control is lost
    is_steady = float(np.ptp(v)) < _STEADY * float(np.mean(v))
    fall = _amplitude(r, (_BOTH[0] + 0.3, _BOTH[1])) / _amplitude(r, _DRY)
    return {
        "match in the dry slalom": _explained(r) >= _EXPLAINED and _amplitude(r, _DRY) <= _A_Y and is_steady,
        "both at 23 s": min(left, right) > _SCATTERS and all(_went(r, w, _SHORT) for w in ("fl", "fr")),
        "right more": right > left,
        "left from 26 s": _peak(r, "fl", _LEFT) > _SCATTERS and _went(r, "fl", _LEFT),
        "both after 27 s": all(_peak(r, w, _BOTH) > _SCATTERS and _went(r, w, _BOTH) for w in ("fl", "fr")),
        "lateral acceleration falls": fall < _FALL,
    }


def _c63(all_runs: tuple[scenes.SceneRun, ...]) -> tuple[Check, Table]:
    found = [_parts(r) for r in all_runs]
    each = {name: float(np.mean([f[name] for f in found])) for name in found[0]}
    every = float(np.mean([all(f.values()) for f in found]))
    rest = float(np.mean([all(v for n, v in f.items() if n != "right more") for f in found]))
    stops = scenes.share(all_runs, lambda r: _went(r, "fl", _LEFT, _STOP))
    outcome = (
        f"all in {scenes.in_runs(every)} runs, all but the right one more in {scenes.in_runs(rest)}; "
        + ", ".join(f"{n} {scenes.in_runs(x)}" for n, x in each.items())
        + f"; the left wheel stops altogether in {scenes.in_runs(stops)}"
    )
    finding = judge("C63.figure", outcome, whole=every >= scenes.MANY, part=rest >= scenes.SOME, value=rest)
    spans = (("at 23 s", _SHORT), ("from 26 s on", _LEFT), ("after 27 s", _BOTH))
    columns = {
        f"{w} {n}": [f"{_peak(r, f'f{w[0]}', s):.1f}" for r in all_runs] for n, s in spans for w in ("left", "right")
    }
    return finding, by_seed("Largest residual [dry scatters]", all_runs, columns)


def _c59(all_runs: tuple[scenes.SceneRun, ...]) -> Check:
    found = scenes.known("2.23").explained
    other = [_explained(r) for r in all_runs]
    whole = found >= _EXPLAINED and min(other) >= _EXPLAINED
    others = scenes.spread([100.0 * x for x in other], 1)
    outcome = f"explained {found:.1%} in its own slalom, {others} % in the dry part of the others"
    return judge("C59.figure", outcome, whole=whole, part=found >= _EXPLAINED, value=min(other))


def panels_2_23(r: DriveRun) -> tuple[Panel, ...]:
    """Steering and lateral acceleration, front wheel speeds, tie rods."""
    steering = {
        "road-wheel angle in deg": (np.degrees(r.signal("steer_angle")), MUTED, "solid"),
        "lateral acceleration": (r.feature("a_y_slow"), INK, "solid"),
    }
    return (panel(r, "Steering and lateral acceleration", _STEER, drawn_lines(r, steering)), *rod_panels(r))


def figure_2_23() -> Figure:
    """Steering, front wheel speeds and both tie rods of one run; C63 and C59 over all runs."""
    all_runs = scenes.runs("2.23")
    c63, table = _c63(all_runs)
    return scene_figure("2.23", panels_2_23, (c63, _c59(all_runs)), (table,))


FIGURES = {"2.21": figure_2_21, "2.22": figure_2_22, "2.23": figure_2_23}
