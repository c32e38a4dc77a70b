"""Figure 2.8: a front wheel that stops and a rear wheel that spins up, found by their acceleration differences."""

from __future__ import annotations

import numpy as np

from aqualog.figures.drive import DriveRun
from aqualog.figures.record import Axis, Figure, Finding, Panel, Table, judged, seconds
from aqualog.figures.scene_panels import WHEEL_WORDS, bit_panel, feature_lines, panel, speed_panel
from aqualog.figures.scene_study import MANY, SOME, SceneRun, in_runs, runs, share, spread
from aqualog.report.theme import wheel_colour

__all__ = ["make", "panels"]

NUMBER = "2.8"
_AFTER_EXIT = 0.5  # [s] the contact comes back
_ACCELERATION = Axis("acceleration difference", "m/s^2")


def _first(r: SceneRun, detector: str, wheel: str) -> float:
    """First event on the lane, after the entry; NaN without one. [s]"""
    on = [t for t in r.events(detector, wheel) if r.entry <= t <= r.exit + _AFTER_EXIT]
    return min(on) - r.entry if on else float("nan")


def _is_early(r: SceneRun) -> bool:
    """Whether a spin-down or spin-up of any wheel is reported on the dry road before the entry."""
    return any(t < r.entry for d in ("spin_down", "spin_up") for t in r.events(d))


def _c28(all_runs: tuple[SceneRun, ...]) -> tuple[Finding, Table]:
    down = [_first(r, "spin_down", "fr") for r in all_runs]
    up = [_first(r, "spin_up", "rr") for r in all_runs]
    has_down, has_up = (float(np.mean(np.isfinite(x))) for x in (down, up))
    both = float(np.mean(np.isfinite(down) & np.isfinite(up)))
    early = share(all_runs, _is_early)
    finding = Finding(
        "C28",
        "Worn summer tyres with low pressure in 0.8 mm: spin-down of the front right and spin-up of the rear right "
        "wheel, found by the CUSUM of the acceleration difference.",
        f"both found on the lane in {MANY:.0%} of the runs and none before the entry in any; in part: both in "
        f"{SOME:.0%}, or the spin-down in {MANY:.0%}",
        f"both in {in_runs(both)} runs (spin-down front right {in_runs(has_down)}, after {spread(down)} s; spin-up "
        f"rear right {in_runs(has_up)}, after {spread(up)} s); alarms before the entry in {in_runs(early)}",
        judged(whole=both >= MANY and early == 0.0, part=both >= SOME or has_down >= MANY),
        "" if both >= MANY and early == 0.0 else
        "Which of both wheels goes, and when, is decided by the contact's fluctuation along the lane, which differs "
        "from run to run.",
        both,
    )  # fmt: skip
    table = Table(
        "First detection after the entry [s]",
        ("seed", "spin-down front right", "spin-up rear right"),
        tuple((str(r.seed), seconds(a), seconds(b)) for r, a, b in zip(all_runs, down, up, strict=True)),
    )
    return finding, table


def panels(r: DriveRun, front: str = "fr", rear: str = "rr") -> tuple[Panel, ...]:
    """Speeds, acceleration differences of a front and a rear wheel, and the detection bits of both."""
    words = {w: WHEEL_WORDS[w] for w in (front, rear)}
    differences = {n: (r.feature(f"a_w_delta_{w}"), wheel_colour(w), "solid") for w, n in words.items()}
    bits = {
        f"spin-down {words[front]}": (2.0, r.active("spin_down", front), wheel_colour(front)),
        f"spin-up {words[rear]}": (1.0, r.active("spin_up", rear), wheel_colour(rear)),
    }
    return (
        speed_panel(r),
        panel(r, "Acceleration differences", _ACCELERATION, feature_lines(r, differences)),
        bit_panel(r, "Detection bits", "detection", bits),
    )


def make() -> Figure:
    """Speeds, acceleration differences front and rear right, detection bits of one run; C28 over all runs."""
    all_runs = runs(NUMBER)
    finding, table = _c28(all_runs)
    r = all_runs[0]
    return Figure(
        NUMBER,
        "spin-down of a front and spin-up of a rear wheel, with detection",
        f"Rear-wheel drive, worn summer tyres, low pressure, 0.8 mm right and less left, 118 km/h with 0.5 m/s² from "
        f"the entry at {r.entry:g} s on. Drawn: seed {r.seed}; judged over seeds {all_runs[0].seed} to "
        f"{all_runs[-1].seed}, which differ in sensor noise and in how the contact fluctuates along the lane.",
        panels(r),
        (finding,),
        (table,),
    )
