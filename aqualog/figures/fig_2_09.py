"""Figure 2.9: variances of the acceleration differences under minor spin-downs, and on rough road."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.detect.minor_spin_down import MinorParams
from aqualog.figures.drive import DriveRun
from aqualog.figures.record import Axis, Figure, Finding, Panel, Table, judged, seconds
from aqualog.figures.scene_panels import feature_lines, panel, speed_panel
from aqualog.figures.scene_study import (
    MANY,
    SEEDS,
    SOME,
    SceneRun,
    in_runs,
    known,
    run_of,
    runs,
    share,
    spread,
    stretches,
)
from aqualog.model.scenario import Lane
from aqualog.model.surface import SURFACES
from aqualog.model.thesis_scenes import scene
from aqualog.report.theme import MUTED, THRESHOLD, wheel_colour

__all__ = ["make", "panels"]

NUMBER = "2.9"
_DIP, _LARGE = -0.015, -0.10  # [-] slip of a minor spin-down: beyond the first, not beyond the second
_LATE = 0.3  # [s] after a dip in which its detection still belongs to it
_SOON = 0.5  # [s] "shortly after entering"
_RATIO = 0.8  # of the variance that the difference keeps
_REAR = 0.01  # [-] "only slightly more slip"
_ROUGH_RATIO = 0.3
_ROUGH_S = (10.0, 20.0)
_ROUGH_RUNS = 8
_VARIANCE = Axis("variance", "(m/s^2)^2")
_LIMITS = MinorParams.make(0.01)


def _difference(r: SceneRun) -> FloatArray:
    return r.feature("variance_fr") - r.feature("variance_rr")


def _ratio(r: SceneRun) -> float:
    """Median of difference over variance where the latter is beyond its limit on the lane; NaN if it never is. [-]"""
    var = r.feature("variance_fr")
    high = r.on_lane() & (var > _LIMITS.var_min)
    return float(np.median(_difference(r)[high] / var[high])) if high.any() else float("nan")


def _rear_slip(r: SceneRun) -> tuple[float, float]:
    """Median slip of the rear right wheel before and on the lane. [-]"""
    slip = r.signal("true_slip_rr")
    return float(np.nanmedian(slip[r.within(10.0, r.entry)])), float(np.nanmedian(slip[r.on_lane()]))


def _c33(all_runs: tuple[SceneRun, ...]) -> tuple[Finding, Table]:
    rises = [r.after_entry(r.feature("variance_fr") > _LIMITS.var_min) for r in all_runs]
    ratios = [_ratio(r) for r in all_runs]
    rear = [_rear_slip(r) for r in all_runs]
    soon = [t <= _SOON for t in rises]
    follows = [x > _RATIO for x in ratios]
    slight = [dry < wet < _REAR for dry, wet in rear]
    every = float(np.mean([a and b and c for a, b, c in zip(soon, follows, slight, strict=True)]))
    finding = Finding(
        "C33",
        "At the entry a series of spin-downs of the front right wheel begins at once, the rear one slips only slightly "
        "more; the front variance rises strongly shortly after, the difference follows it.",
        f"front variance beyond {_LIMITS.var_min:g} (m/s²)² within {_SOON:g} s, difference over it beyond "
        f"{_RATIO:g} (median where it is), rear slip above dry and below {_REAR:.0%}, all in {MANY:.0%} of the runs; "
        f"in part: the difference follows in {MANY:.0%}",
        f"all in {in_runs(every)} runs: rise within {_SOON:g} s {in_runs(float(np.mean(soon)))}, after {spread(rises)} "
        f"s; difference over variance {spread(ratios)}; rear slip "
        f"{spread([100.0 * a for a, _ in rear])} % before and {spread([100.0 * b for _, b in rear])} % on the lane",
        judged(whole=every >= MANY, part=float(np.mean(follows)) >= MANY),
        "" if every >= MANY else
        "Where the contact is worst is another place of the lane in every run, and the first dip comes with it.",
        every,
    )  # fmt: skip
    table = Table(
        "Front right wheel on the lane",
        ("seed", "variance beyond its limit after [s]", "difference over variance [-]"),
        tuple((str(r.seed), seconds(a), seconds(b)) for r, a, b in zip(all_runs, rises, ratios, strict=True)),
    )
    return finding, table


def dips(r: SceneRun) -> list[slice]:
    """Minor spin-downs of the front right wheel on the lane."""
    slip = r.signal("true_slip_fr")
    return [s for s in stretches(r, (slip < _DIP) & r.on_lane()) if np.nanmin(slip[s]) > _LARGE]


def _found(r: SceneRun, detector: str) -> list[bool]:
    """Of each dip, whether the detector's bit is set in it or shortly after."""
    bits, late = r.active(detector, "fr"), round(_LATE / r.result.signals.dt)
    return [bool(bits[s.start : s.stop + late].any()) for s in dips(r)]


def _c29(all_runs: tuple[SceneRun, ...]) -> Finding:
    large = [x for r in all_runs for x in _found(r, "spin_down")]
    minor = [x for r in all_runs for x in _found(r, "minor_spin_down")]
    n = len(minor)
    a, b = (float(np.mean(x)) if n else 0.0 for x in (large, minor))
    return Finding(
        "C29",
        "The CUSUM of large spin-downs misses minor ones; the variance finds them.",
        f"share of the minor spin-downs (slip beyond {-_DIP:.1%}, below {-_LARGE:.0%}) with a detection in them or "
        f"{_LATE:g} s after: large below minor, and minor at least {SOME:.0%}; in part: large below minor",
        f"of {n} dips over all runs {a:.0%} are found by the CUSUM, {b:.0%} by the variance",
        judged(whole=a < b and b >= SOME, part=a < b),
        "" if a < b and b >= SOME else "Most dips are too small for either.",
        b,
    )


@lru_cache(maxsize=1)
def _rough() -> tuple[SceneRun, ...]:
    """The same car and speed without water, over broken asphalt."""
    lanes = (Lane(*_ROUGH_S, surface=SURFACES["rough"]),)
    wet = scene(NUMBER)
    dry = [replace(wet, lanes=lanes, duration_s=_ROUGH_S[1] + 3.0, seed=s) for s in SEEDS[:_ROUGH_RUNS]]
    return tuple(run_of(s, known(NUMBER)) for s in dry)


def _c32(rough: tuple[SceneRun, ...]) -> Finding:
    level = [float(np.median(r.feature("variance_fr")[r.on_lane()])) for r in rough]
    ratio = [
        float(np.median(np.abs(_difference(r)[r.on_lane()])) / v) for r, v in zip(rough, level, strict=True)
    ]  # fmt: skip
    quiet = share(rough, lambda r: not r.events("minor_spin_down"))
    high = all(v > _LIMITS.var_min for v in level)
    small = all(x < _ROUGH_RATIO for x in ratio)
    return Finding(
        "C32",
        "The absolute variance depends on the ground (gravel, rough snow); minor spin-downs come on one axle, so the "
        "difference is selective.",
        f"broken asphalt at the same speed: front variance beyond its limit of {_LIMITS.var_min:g} (m/s²)², "
        f"difference below {_ROUGH_RATIO:g} of it (medians), in every run, and no minor spin-down in any; in part: no "
        "minor spin-down in any",
        f"in {len(rough)} runs: front variance {spread(level)} (m/s²)², difference over it {spread(ratio)}; without "
        f"an alarm {round(quiet * len(rough))} of {len(rough)}",
        judged(whole=high and small and quiet == 1.0, part=quiet == 1.0),
        "" if high and small and quiet == 1.0 else
        "The default broken asphalt stays below the limit of the front variance itself at this speed, so the "
        "difference was not needed; over half a second both wheels' variances agree in the mean, not at each moment.",
        float(np.median(ratio)),
    )  # fmt: skip


def panels(r: DriveRun, side: str = "r") -> tuple[Panel, ...]:
    """Speeds of a side's wheels, and their variances with the difference."""
    front, rear = f"f{side}", f"r{side}"
    lines = {
        "difference": (r.feature(f"variance_{front}") - r.feature(f"variance_{rear}"), THRESHOLD, "solid"),
        "front": (r.feature(f"variance_{front}"), wheel_colour(front), "dashdot"),
        "rear": (r.feature(f"variance_{rear}"), wheel_colour(rear), "dashdot"),
        "limit of the difference": (np.full(r.t.size, _LIMITS.delta_min), MUTED, "dot"),
    }
    word = "right" if side == "r" else "left"
    return speed_panel(r, (front, rear)), panel(r, f"Variances, {word}", _VARIANCE, feature_lines(r, lines))


def make() -> Figure:
    """Speeds of the right wheels, variances front and rear and their difference of one run; claims over all runs."""
    all_runs = runs(NUMBER)
    c33, table = _c33(all_runs)
    r = all_runs[0]
    return Figure(
        NUMBER,
        "variances of the acceleration differences under minor spin-downs",
        f"Rear-wheel drive, worn summer tyres, low pressure, 0.8 mm right and less left, 104 km/h, entry at "
        f"{r.entry:g} s. Drawn: seed {r.seed}; judged over seeds {all_runs[0].seed} to {all_runs[-1].seed}, which "
        f"differ in sensor noise and in how the contact fluctuates along the lane.",
        panels(r),
        (c33, _c29(all_runs), _c32(_rough())),
        (table,),
    )
