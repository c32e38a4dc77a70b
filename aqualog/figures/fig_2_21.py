"""Figure 2.21: tie-rod forces when the front right wheel of a straight drive spins down."""

from __future__ import annotations

import numpy as np

from aqualog.figures.record import Figure, Finding, Table, judged
from aqualog.figures.scene_panels import speed_panel, tie_rod_panels
from aqualog.figures.scene_study import (
    MANY,
    SOME,
    SceneRun,
    in_runs,
    residual,
    runs,
    scatter,
    share,
    spread,
    stretches,
)

__all__ = ["make"]

NUMBER = "2.21"
_DOWN = -0.05  # [-] slip of a wheel that spins down
_SERIES = 2  # spin-downs that make a series
_TIMES = 4.0  # dry scatters that a rise must exceed: the drift of the tie-rod detector (K)
_MATCH = 2.0  # times the dry scatter that the residual of a matching rod may have, or
_COARSE = 60.0  # [N] the scatter of a good model (K)


def _down(r: SceneRun) -> list[slice]:
    return stretches(r, (r.signal("true_slip_fr") < _DOWN) & r.on_lane())


def _rise(r: SceneRun) -> float:
    """Median of the right residual while the right wheel spins down; NaN without a spin-down. [N]"""
    x = [residual(r, "fr")[s] for s in _down(r)]
    return float(np.nanmedian(np.concatenate(x))) if x else float("nan")


def _left(r: SceneRun) -> float:
    """Root mean square of the left residual on the lane. [N]"""
    return float(np.sqrt(np.nanmean(residual(r, "fl")[r.on_lane()] ** 2)))


def _is_series(r: SceneRun) -> bool:
    return len(_down(r)) >= _SERIES


def _rises(r: SceneRun) -> bool:
    return _rise(r) > _TIMES * scatter(r, "fr")


def _matches(r: SceneRun) -> bool:
    return _left(r) < max(_MATCH * scatter(r, "fl"), _COARSE)


def _is_told_apart(r: SceneRun) -> bool:
    """An event of the right rod that begins on the lane, and none of the left one in the whole drive."""
    return any(r.entry <= t <= r.exit for t in r.events("tie_rod", "fr")) and not r.events("tie_rod", "fl")


def _c61(all_runs: tuple[SceneRun, ...]) -> tuple[Finding, Table]:
    parts = {n: share(all_runs, f) for n, f in (("series", _is_series), ("rise", _rises), ("match", _matches))}
    every = share(all_runs, lambda r: _is_series(r) and _rises(r) and _matches(r) and _is_told_apart(r))
    told = share(all_runs, _is_told_apart)
    finding = Finding(
        "C61",
        "All-wheel drive with almost no torque in front, straight on, slowing down: a series of spin-downs front "
        "right; the right measured force rises over the calculated one, the left ones match.",
        f"at least {_SERIES} spin-downs of the front right wheel; in them the right measured force is above the "
        f"calculated one by {_TIMES:g} times the dry scatter (median), the left one matches within {_MATCH:g} times "
        f"its dry scatter or {_COARSE:g} N (rms); the detector finds the right rod only: all in {MANY:.0%} of the "
        f"runs; in part: the last in {SOME:.0%}",
        f"all in {in_runs(every)} runs: series {in_runs(parts['series'])}, rise {in_runs(parts['rise'])} "
        f"({spread([_rise(r) for r in all_runs], 0)} N against a dry scatter of "
        f"{spread([scatter(r, 'fr') for r in all_runs], 0)} N), left {in_runs(parts['match'])} "
        f"({spread([_left(r) for r in all_runs], 0)} N), right rod only {in_runs(told)}",
        judged(whole=every >= MANY, part=told >= SOME),
        "" if every >= MANY else
        "In some runs the wheel goes once and stays down. Against the drag on the right the car is steered to the "
        "left, and the left tyre holds that side force alone; a model that splits it by the loads books half of it on "
        "the right rod.",
        every,
    )  # fmt: skip
    table = Table(
        "Front right wheel on the lane",
        ("seed", "spin-downs", "rise of its rod [N]", "left residual, rms [N]"),
        tuple(
            (str(r.seed), str(len(_down(r))), "–" if np.isnan(_rise(r)) else f"{_rise(r):.0f}", f"{_left(r):.0f}")
            for r in all_runs
        ),
    )
    return finding, table


def make() -> Figure:
    """Front wheel speeds and both tie rods of one run; C61 over all runs."""
    all_runs = runs(NUMBER)
    finding, table = _c61(all_runs)
    r = all_runs[0]
    return Figure(
        NUMBER,
        "tie-rod forces, the front right wheel aquaplanes",
        f"All-wheel drive with 2 % of the torque in front, straight on, slowing down slightly from 112 km/h, 1.3 mm "
        f"under the right wheels from {r.entry:g} s on. The polynomial is from a dry slalom of the same car. Drawn: "
        f"seed {r.seed}; judged over seeds {all_runs[0].seed} to {all_runs[-1].seed}, which differ in sensor noise and "
        f"in how the contact fluctuates along the lane.",
        (speed_panel(r, ("fl", "fr")), *tie_rod_panels(r)),
        (finding,),
        (table,),
    )
