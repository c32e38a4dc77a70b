"""Claims on the order of the effects over speed and on the loss of contact, by passes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aqualog.evaluate.intervals import wilson
from aqualog.evaluate.truth import CONTACT_FULL
from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.passes import Pass
from aqualog.reproduce.tables import (
    SEEDS,
    Table,
    by_passes,
    cells_of,
    estimate,
    first_speed,
    mean,
    said,
    told,
)
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "GRID", "SEEDS", "SOON", "SOURCE"]

SOURCE = "truth of simulated passes over 1.3 mm, worn summer tyres, low pressure, rear-wheel drive"
GRID = tuple(range(78, 126, 4))  # [km/h]
DRY = Pass(80, h=0.0, wiggles=True)
FLOODED = Pass(150, even=True, scatter=0.0)
KICKED = tuple(Pass(v, kick=T) for T in (1000.0, 2000.0) for v in range(70, 140, 6))
SOON, RESISTANCE, SLOPE_LOSS = 0.5, 0.2, 0.2  # [s], [m/s^2], [-]
NO_FORCE, OVERLOAD_S, SPUN = 0.01, 0.05, 0.1  # [-], [s], [-]


def _c3(table: Table) -> Checks:
    plain, wiggling = [Pass(v) for v in GRID], [Pass(v, wiggles=True) for v in GRID]
    dry = mean(table[DRY].of("slope_rr"))
    slope = cells_of(table, wiggling, "slope_rr")
    reached = {
        "resistance": cells_of(table, plain, "delta_a") > RESISTANCE,
        "slope -20 %": slope < (1.0 - SLOPE_LOSS) * dry,
        "slope -50 %": slope < 0.5 * dry,
        "first dip": cells_of(table, plain, "dips") > 0,
        "full": cells_of(table, plain, "stop_s") < SOON,
    }
    n = slope.shape[1]
    at = {k: first_speed(GRID, met) for k, met in reached.items()}
    v = {k: f(np.arange(n)) for k, f in at.items()}
    early = max(v["resistance"], v["slope -20 %"])
    lead, ci = estimate(lambda r: at["first dip"](r) - max(at["resistance"](r), at["slope -20 %"](r)), n)
    whole = early < v["first dip"] < v["full"] < np.inf
    return (
        Check(
            "C3",
            "speeds reached by half of the passes: resistance 0.2 m/s² and slope -20 % < first dip < stop within 0.5 "
            "s; with a difference: all three below the last",
            "; ".join(f"{k} {said(f, n)}" for k, f in at.items()) + f" km/h; first dip after both by {told(lead, ci)} "
            "km/h",
            judged(whole=whole, part=max(early, v["first dip"]) < v["full"] < np.inf),
            value=lead, ci95=ci, unit="km/h",
            reason=("" if whole else "Resistance and the first dip come at about the same speed here. ")
            + "Tie-rod forces are judged where they are simulated (C60 to C62).",
            source=SOURCE,
        ),
    )  # fmt: skip


def _c4(table: Table) -> Checks:
    force = max(float(table[p].of("afloat_force").max()) for p in (FLOODED, Pass(118), Pass(122)))
    spun = cells_of(table, KICKED, "rear_spin").ravel() > SPUN
    partial = cells_of(table, KICKED, "rear_contact").ravel()[spun] > CONTACT_FULL
    overloaded = cells_of(table, KICKED, "overload_s").ravel() > OVERLOAD_S
    hit, spared = (float(x.mean()) if x.size else 0.0 for x in (overloaded[spun], ~overloaded[~spun]))
    balanced = 0.5 * (hit + spared)
    k, n = int(partial.sum()), int(partial.size)
    ok = n > 0 and k >= 0.8 * n
    return (
        Check(
            "C4", f"tangential force of a wheel without contact below {NO_FORCE:.0%} of its load, every sample",
            f"at most {force:.2e} of the load (118, 122 and 150 km/h)",
            judged(whole=force < NO_FORCE), part="full", value=force,
            reason="" if force < NO_FORCE else "A wheel without contact holds some force.", source=SOURCE,
        ),
        Check(
            "C4",
            "kicks of 1000 and 2000 N·m at 70 to 136 km/h: of the rear spin-ups (+10 %) 80 % begin with contact left "
            f"(beyond {CONTACT_FULL:g}); requested force beyond the residual friction for {OVERLOAD_S:g} s separates "
            "passes that spin up from the others, balanced accuracy 0.9; with a difference: the former",
            f"{k} of {n} begin with contact left; balanced accuracy {balanced:.3f} over {spun.size} passes, found "
            f"{hit:.3f}, spared {spared:.3f}",
            judged(whole=ok and balanced >= 0.9, part=ok),
            part="partial", value=k / n if n else None, ci95=wilson(k, n),
            reason="A wheel that spins up is judged, not the stability of the car."
            if ok and balanced >= 0.9
            else "Spin-up and requested force are not related that closely.",
            source=SOURCE,
        ),
    )  # fmt: skip


def _c5(table: Table) -> Checks:
    times = table[FLOODED].of("gone_still_s")
    stops, middle = int((times < 1.0).sum()), float(np.median(times))
    return (
        Check(
            "C5", "a free front wheel stands within 1 s of its loss of contact, every pass; with a difference: in half",
            f"{middle:.3f} s ({times.min():.3f} to {times.max():.3f}), {stops} of {times.size} within 1 s "
            "(150 km/h, even contact)",
            judged(whole=stops == times.size, part=2 * stops >= times.size),
            value=middle if np.isfinite(middle) else None, ci95=(float(times.min()), float(times.max())), unit="s",
            reason="" if stops == times.size else "The water's torque does not always stop it in that time.",
            source=SOURCE + "; interval: range over the seeds",
        ),
    )  # fmt: skip


def _c3_needs() -> Iterator[Pass]:
    yield DRY
    for v in GRID:
        yield from (Pass(v), Pass(v, wiggles=True))


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C3",), by_passes(_c3_needs, _c3)),
    (("C4",), by_passes(lambda: (FLOODED, Pass(118), Pass(122), *KICKED), _c4)),
    (("C5",), by_passes(lambda: (FLOODED,), _c5)),
)
