"""Figures 2.8 and 2.9: large and minor spin-downs and spin-ups over time, as their detectors see them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.minor_spin_down import MinorParams
from aqualog.model.programme import scene
from aqualog.model.scenario import SURFACES, Lane
from aqualog.report.theme import MUTED, THRESHOLD, wheel_colour
from aqualog.thesis.claims import Check, judge, limit
from aqualog.thesis.evidence.campaign import DriveRun
from aqualog.thesis.evidence.scenes import (
    MANY,
    SEEDS,
    SOME,
    SceneRun,
    dry_and_wet,
    in_runs,
    known,
    run_of,
    runs,
    share,
    spread,
    stretches,
)
from aqualog.thesis.figures.panels import WHEEL_WORDS, bit_panel, by_seed, drawn_lines, panel, scene_figure, speed_panel
from aqualog.thesis.record import Axis, Figure, Panel, Table, seconds

__all__ = ["FIGURES", "panels_2_08", "panels_2_09"]

_AFTER_EXIT = 0.5  # [s] the contact comes back
_ACCELERATION = Axis("acceleration difference", "m/s^2")


def _first(r: SceneRun, detector: str, wheel: str) -> float:
    """First event on the lane, after the entry; NaN without one. [s]"""
    on = [t for t in r.events(detector, wheel) if r.entry <= t <= r.exit + _AFTER_EXIT]
    return min(on) - r.entry if on else float("nan")


def _is_early(r: SceneRun) -> bool:
    """Whether a spin-down or spin-up of any wheel is reported on the dry road before the entry."""
    return any(t < r.entry for d in ("spin_down", "spin_up") for t in r.events(d))


def _c28(all_runs: tuple[SceneRun, ...]) -> tuple[Check, Table]:
    down = [_first(r, "spin_down", "fr") for r in all_runs]
    up = [_first(r, "spin_up", "rr") for r in all_runs]
    has_down, has_up = (float(np.mean(np.isfinite(x))) for x in (down, up))
    both = float(np.mean(np.isfinite(down) & np.isfinite(up)))
    early = share(all_runs, _is_early)
    outcome = (
        f"both in {in_runs(both)} runs (spin-down front right {in_runs(has_down)}, after {spread(down)} s; spin-up "
        f"rear right {in_runs(has_up)}, after {spread(up)} s); alarms before the entry in {in_runs(early)}"
    )
    whole, part = both >= MANY and early == 0.0, both >= SOME or has_down >= MANY
    finding = judge("C28.figure", outcome, whole=whole, part=part, value=both)
    columns = {"spin-down front right": [*map(seconds, down)], "spin-up rear right": [*map(seconds, up)]}
    return finding, by_seed("First detection after the entry [s]", all_runs, columns)


def panels_2_08(r: DriveRun, front: str = "fr", rear: str = "rr") -> tuple[Panel, ...]:
    """Speeds, acceleration differences of a front and a rear wheel, and the detection bits of both."""
    words = {w: WHEEL_WORDS[w] for w in (front, rear)}
    differences = {n: (r.feature(f"a_w_delta_{w}"), wheel_colour(w), "solid") for w, n in words.items()}
    bits = {
        f"spin-down {words[front]}": (2.0, r.active("spin_down", front), wheel_colour(front)),
        f"spin-up {words[rear]}": (1.0, r.active("spin_up", rear), wheel_colour(rear)),
    }
    return (
        speed_panel(r),
        panel(r, "Acceleration differences", _ACCELERATION, drawn_lines(r, differences)),
        bit_panel(r, "Detection bits", "detection", bits),
    )


def figure_2_08() -> Figure:
    """Speeds, acceleration differences front and rear right, detection bits of one run; C28 over all runs."""
    finding, table = _c28(runs("2.8"))
    return scene_figure("2.8", panels_2_08, (finding,), (table,))


_DIP, _LARGE = -0.015, -0.10  # [-] slip of a minor spin-down: beyond the first, not beyond the second
_LATE = limit("late", "C29.figure")  # [s] after a dip in which its detection still belongs to it
_SOON = limit("soon")  # [s] "shortly after entering"
_RATIO = limit("ratio", "C33.figure")  # of the variance that the difference keeps
_REAR = limit("rear", "C33.figure")  # [-] "only slightly more slip"
_GROUND_S, _GROUND_RUNS = (10.0, 20.0), 4
_VARIANCE = Axis("variance", "(m/s^2)^2")
_LIMITS = MinorParams.make(0.01)


def _difference(r: SceneRun) -> FloatArray:
    return r.feature("variance_fr") - r.feature("variance_rr")


def _ratio(r: SceneRun) -> float:
    """Median of difference over variance where the latter is beyond its limit on the lane; NaN if it never is. [-]"""
    var = r.feature("variance_fr")
    high = r.on_lane() & (var > _LIMITS.var_min)
    return float(np.median(_difference(r)[high] / var[high])) if high.any() else float("nan")


def _c33(all_runs: tuple[SceneRun, ...]) -> tuple[Check, Table]:
    rises = [r.after_entry(r.feature("variance_fr") > _LIMITS.var_min) for r in all_runs]
    ratios = [_ratio(r) for r in all_runs]
    rear = [dry_and_wet(r, "true_slip_rr") for r in all_runs]
    soon = [t <= _SOON for t in rises]
    follows = [x > _RATIO for x in ratios]
    slight = [dry < wet < _REAR for dry, wet in rear]
    every = float(np.mean([a and b and c for a, b, c in zip(soon, follows, slight, strict=True)]))
    outcome = (
        f"all in {in_runs(every)} runs: rise within {_SOON:g} s {in_runs(float(np.mean(soon)))}, after {spread(rises)} "
        f"s; difference over variance {spread(ratios)}; rear slip "
        f"{spread([100.0 * a for a, _ in rear])} % before and {spread([100.0 * b for _, b in rear])} % on the lane"
    )
    finding = judge("C33.figure", outcome, whole=every >= MANY, part=float(np.mean(follows)) >= MANY, value=every)
    columns = {
        "variance beyond its limit after [s]": [*map(seconds, rises)],
        "difference over variance [-]": [*map(seconds, ratios)],
    }
    return finding, by_seed("Front right wheel on the lane", all_runs, columns)


def dips(r: SceneRun) -> list[slice]:
    """Minor spin-downs of the front right wheel on the lane."""
    slip = r.signal("true_slip_fr")
    return [s for s in stretches(r, (slip < _DIP) & r.on_lane()) if np.nanmin(slip[s]) > _LARGE]


def _found(r: SceneRun, detector: str) -> list[bool]:
    """Of each dip, whether the detector's bit is set in it or shortly after."""
    bits, late = r.active(detector, "fr"), round(_LATE / r.result.signals.dt)
    return [bool(bits[s.start : s.stop + late].any()) for s in dips(r)]


def _c29(all_runs: tuple[SceneRun, ...]) -> Check:
    large = [x for r in all_runs for x in _found(r, "spin_down")]
    minor = [x for r in all_runs for x in _found(r, "minor_spin_down")]
    n = len(minor)
    a, b = (float(np.mean(x)) if n else 0.0 for x in (large, minor))
    outcome = f"of {n} dips over all runs {a:.0%} are found by the CUSUM, {b:.0%} by the variance"
    return judge("C29.figure", outcome, whole=a < b and b >= SOME, part=a < b, value=b)


@lru_cache(maxsize=1)
def _grounds() -> dict[str, list[tuple[float, float]]]:
    """Median front variance without water [(m/s²)²] and the difference over it, by ground; car and speed as in 2.9."""
    found: dict[str, list[tuple[float, float]]] = {"asphalt": []}
    for name in ("rough", "gravel", "deep_snow"):
        lanes = (Lane(*_GROUND_S, surface=SURFACES[name]),)
        dry = replace(scene("2.9"), lanes=lanes, duration_s=_GROUND_S[1] + 3.0)
        all_runs = [run_of(replace(dry, seed=s), known("2.9")) for s in SEEDS[:_GROUND_RUNS]]
        found["asphalt"] += [_of_ground(r, r.within(5.0, r.entry)) for r in all_runs]
        found[name.replace("_", " ")] = [_of_ground(r, r.on_lane()) for r in all_runs]
    return found


def _of_ground(r: SceneRun, span: BoolArray) -> tuple[float, float]:
    level = float(np.median(r.feature("variance_fr")[span]))
    return level, float(np.median(np.abs(_difference(r)[span]))) / level


def _c32(all_runs: tuple[SceneRun, ...]) -> Check:
    level = {n: float(np.median([x for x, _ in rows])) for n, rows in _grounds().items()}
    left = {n: float(np.median([x for _, x in rows])) for n, rows in _grounds().items()}
    alone = [float(np.nanmin(r.signal("true_slip_rr")[s])) > _DIP for r in all_runs for s in dips(r)]
    in_dips = float(np.nanmedian([_ratio(r) for r in all_runs]))
    one_axle = float(np.mean(alone)) if alone else 0.0
    varies = max(level.values()) >= 2.0 * min(level.values())
    is_selective = one_axle >= MANY and max(left.values()) < in_dips
    outcome = (
        f"front variance {', '.join(f'{n} {x:.2f}' for n, x in level.items())} (m/s²)²; difference over it "
        f"{', '.join(f'{n} {x:.2f}' for n, x in left.items())}, in minor spin-downs {in_dips:.2f}; only the front "
        f"wheel in {one_axle:.0%} of {len(alone)} minor spin-downs"
    )
    return judge("C32.figure", outcome, whole=varies and is_selective, part=is_selective, value=max(left.values()))


def panels_2_09(r: DriveRun, side: str = "r") -> tuple[Panel, ...]:
    """Speeds of a side's wheels, and their variances with the difference."""
    front, rear = f"f{side}", f"r{side}"
    lines = {
        "difference": (r.feature(f"variance_{front}") - r.feature(f"variance_{rear}"), THRESHOLD, "solid"),
        "front": (r.feature(f"variance_{front}"), wheel_colour(front), "dashdot"),
        "rear": (r.feature(f"variance_{rear}"), wheel_colour(rear), "dashdot"),
        "limit of the difference": (np.full(r.t.size, _LIMITS.delta_min), MUTED, "dot"),
    }
    word = "right" if side == "r" else "left"
    return speed_panel(r, (front, rear)), panel(r, f"Variances, {word}", _VARIANCE, drawn_lines(r, lines))


def figure_2_09() -> Figure:
    """Speeds of the right wheels, variances front and rear and their difference of one run; claims over all runs."""
    all_runs = runs("2.9")
    c33, table = _c33(all_runs)
    return scene_figure("2.9", panels_2_09, (c33, _c29(all_runs), _c32(all_runs)), (table,))


FIGURES = {"2.8": figure_2_08, "2.9": figure_2_09}
