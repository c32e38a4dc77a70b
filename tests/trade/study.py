"""How well `aqualog test straight` measures: simulated runs of 8 tyres whose speed of 15 % slip is known.

The truth of a run is the crossing of the simulator's own slip, without noise. The runs are measured from what the
series sensors report. `python -m tests.trade.study [--runs 150] [--first 50000] [--car hatch|saloon]`
prints one line for each question.
"""

from __future__ import annotations

import argparse
import math
import re
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from aqualog.core.vehicle import Vehicle
from aqualog.model.log import signals_of
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.simulate import simulate
from aqualog.model.tyre import TYRES
from aqualog.model.tyre_tests import DRY_S, HATCH, LANE_S, SALOON, straight_run
from aqualog.trade.entry import KMH, Entry
from aqualog.trade.evaluation import Options, evaluated
from aqualog.trade.lane import mean_over
from aqualog.trade.limits import defaults
from aqualog.trade.straight import StraightRun, crossing, straight_runs

TYRE_KMH = (110, 114, 118, 122, 126, 130, 134, 138)  # full aquaplaning at 1.3 mm of the 8 tyres
SET = 6
GIVEN = frozenset({"drivetrain", "wheels.r_e_f", "wheels.r_e_r"})
FAULTS = ("part throttle", "torque cut", "swerve", "shift", "lost samples", "entered too fast")


@dataclass(frozen=True)
class Made:
    """A run: its tyre, what was measured, and the true speed of 15 % slip [km/h]."""

    tyre: int
    found: StraightRun
    truth: float


def scenario_of(car: Vehicle, tyre: int, seed: int) -> Scenario:
    """A run of one of the 8 tyres."""
    own = replace(TYRES["worn_summer"], name=f"tyre {tyre}", v_anchor=TYRE_KMH[tyre] / 3.6)
    return replace(straight_run(car, "worn_summer", seed), tyre_front=own, tyre_rear=own)


def true_v_15(simulation, axle: str) -> float:
    """Speed at which the true slip of the wet (right) driven wheel over the dry one crosses 15 % [km/h]."""
    truth = simulation.truth
    c, dt = truth.columns, float(truth.t[1] - truth.t[0])
    slip = (1.0 + c[f"true_slip_{axle}r"]) / (1.0 + c[f"true_slip_{axle}l"]) - 1.0
    on = (truth.t >= DRY_S) & (truth.t <= DRY_S + LANE_S)
    k = crossing(mean_over(slip, 0.1, dt), on, 0.15, round(0.1 / dt))
    return float(np.interp(k, np.arange(truth.t.size), c["true_v_x"])) * 3.6 if math.isfinite(k) else math.nan


def measured(scenario: Scenario, tyre: int, change=None) -> Made:
    """Simulate and measure one run; `change` damages its signals."""
    car = replace(scenario.vehicle, given=GIVEN)
    made = simulate(scenario)
    signals = signals_of(made, car, "made.mf4")
    found = straight_runs(signals, car)[0]
    if change is not None:
        found = straight_runs(replace(signals, frame=change(signals.frame, found.t_15)), car)[0]
    return Made(tyre, found, true_v_15(made, car.drivetrain[0]))


def sound(car: Vehicle, runs: int, first: int = 50_000) -> list[Made]:
    return [
        measured(scenario_of(car, tyre, first + 1000 * tyre + k), tyre)
        for tyre in range(len(TYRE_KMH)) for k in range(runs)
    ]  # fmt: skip


def faulty(car: Vehicle, kind: str, tyre: int, seed: int) -> Made:
    """A run with one fault before the crossing."""
    scenario = scenario_of(car, tyre, seed)
    rng = np.random.default_rng(seed)
    (_, v_0), (end, v_1) = scenario.speed
    if kind == "part throttle":
        a = (v_1 - v_0) / end * rng.uniform(0.6, 0.75)
        return measured(replace(scenario, speed=((0.0, v_0), (end, v_0 + a * end))), tyre)
    if kind == "entered too fast":
        v = TYRE_KMH[tyre] / 3.6 * 0.62
        return measured(replace(scenario, speed=((0.0, v), (end, v + 1.3 * end))), tyre)
    at = measured(scenario, tyre).found.t_15
    if kind == "torque cut":
        share = ((0.0, 1.0), (at - 0.9, 1.0), (at - 0.8, 0.2), (at - 0.4, 0.2), (at - 0.2, 1.0))
        return measured(replace(scenario, drive_share=share), tyre)
    if kind == "swerve":
        return measured(replace(scenario, steering=Steering(math.radians(rng.uniform(1.0, 2.0)), 2.0, at - 1.5)), tyre)

    def shift(frame, t_15):
        return frame.with_columns(
            pl.when(pl.col("t") > t_15 - rng.uniform(-0.25, 0.25)).then(4.0).otherwise(3.0).alias("gear")
        )

    def lose(frame, t_15):
        wheel = f"omega_{car.drivetrain[0]}{rng.choice(['l', 'r'])}"
        gap = (pl.col("t") > t_15 - 0.6) & (pl.col("t") < t_15 - rng.uniform(0.1, 0.4))
        return frame.with_columns(pl.when(gap).then(None).otherwise(pl.col(wheel)).alias(wheel))

    return measured(scenario, tyre, shift if kind == "shift" else lose)


def in_sets(runs: list[Made]) -> tuple[Entry, ...]:
    """Each run as it stands in its set (runs of a tyre)."""
    entries = [Entry(f"{i}", 1, float(i), (("tyre", str(m.tyre)),), str(m.tyre), m.found) for i, m in enumerate(runs)]
    return evaluated(entries, Options("straight", defaults(), ("tyre",))).entries


def judged(runs: list[Made]) -> list[bool]:
    """Whether each run counts."""
    return [e.valid for e in in_sets(runs)]


def bias(pool: list[Made]) -> str:
    kept = [(m, e) for m, e in zip(pool, in_sets(pool), strict=True) if e.valid and not e.is_censored]
    away = np.array([e.value - m.truth for m, e in kept])
    reasons = Counter(re.sub(r"[\d.]+", "#", r) for m in pool for r in m.found.reasons)
    return (
        f"bias {away.mean():+.3f} km/h, sd {away.std():.3f}, largest {np.abs(away).max():.2f}, of {away.size} valid runs "
        f"of {len(pool)} ({100 * len(kept) / len(pool):.1f} %); {dict(reasons.most_common(5))}"
    )


def coverage(pool: list[Made], draws: int = 400, *, lane_kmh: float = math.inf) -> str:
    """Share of 95 % intervals of sets of 6 that hold the tyre's true mean; `lane_kmh`: runs above it are censored."""
    rng = np.random.default_rng(7)
    inside = total = empty = 0
    for tyre in range(len(TYRE_KMH)):
        own = [m for m in pool if m.tyre == tyre]
        mean = float(np.nanmean([m.truth for m in own]))
        limit = mean + lane_kmh
        for _ in range(draws):
            drawn = [own[i] for i in rng.choice(len(own), SET, replace=False)]
            cut = [
                replace(m.found, v_bound=limit / KMH) if KMH * m.found.v > limit else m.found for m in drawn
            ]  # fmt: skip
            entries = [Entry(f"{i}", 1, float(i), (), "", f) for i, f in enumerate(cut)]
            found = evaluated(entries, Options("straight", defaults())).sets[0].summary
            if not math.isfinite(found.ci[0]):
                empty += 1
                continue
            total += 1
            inside += found.ci[0] <= mean <= found.ci[1]
    what = "" if math.isinf(lane_kmh) else f" with runs above mean + {lane_kmh:g} km/h censored"
    return f"coverage{what} {100 * inside / total:.1f} % of {total} sets of {SET} ({empty} without an interval)"


def invalid(car: Vehicle, pool: list[Made], each: int) -> str:
    told = []
    found_all = total = 0
    for n, kind in enumerate(FAULTS):
        hits = 0
        for k in range(each):
            tyre = k % len(TYRE_KMH)
            bad = faulty(car, kind, tyre, 90_000 + 1000 * n + k)
            others = [m for m in pool if m.tyre == tyre][SET * (k // 8) : SET * (k // 8) + SET - 1]
            hits += not judged([*others, bad])[-1]
        told.append(f"{kind} {hits}/{each}")
        found_all, total = found_all + hits, total + each
    return f"invalid runs found {100 * found_all / total:.1f} % ({', '.join(told)})"


def drift(pool: list[Made], sessions: int = 200, change: float = -0.05) -> str:
    """Sessions C A C B C ... of three control runs and six others; all tyres drift by `change` from first to last."""
    rng = np.random.default_rng(11)
    control, others = 3, (0, 2, 4, 6, 7)
    means = [float(np.nanmean([m.truth for m in pool if m.tyre == t])) for t in range(len(TYRE_KMH))]
    away: list[list[float]] = [[] for _ in others]
    plain: list[list[float]] = [[] for _ in others]
    inside = total = 0
    for _ in range(sessions):
        plan = [control] * 3
        for tyre in others:
            plan += [tyre] * SET + [control] * 3
        entries = []
        for i, tyre in enumerate(plan):
            own = [m for m in pool if m.tyre == tyre]
            f = own[rng.integers(len(own))].found
            scale = 1.0 + change * i / (len(plan) - 1)
            own, other = ({n: v * scale for n, v in x.items()} for x in (f.speeds, f.speeds_other))
            f = replace(f, speeds=own, speeds_other=other, v_bound=f.v_bound * scale)
            entries.append(Entry(f"{i}", 1, float(i), (("tyre", str(tyre)),), str(tyre), f))
        test = evaluated(entries, Options("straight", defaults(), ("tyre",), str(control)))
        base = next(s for s in test.sets if s.is_control).summary.mean
        for k, tyre in enumerate(others):
            row = next(s for s in test.sets if dict(s.group)["tyre"] == str(tyre))
            if row.index is None:
                continue
            true = 100.0 * means[tyre] / means[control]
            away[k].append(row.index.value - true)
            plain[k].append(100.0 * row.summary.mean / base - true)
            total += 1
            inside += row.index.ci[0] <= true <= row.index.ci[1]
    own, without = ([float(np.nanmean(a)) for a in x] for x in (away, plain))
    return (
        f"index, control drifting by {100 * change:+.0f} %: bias of each tyre {', '.join(f'{b:+.2f}' for b in own)} points "
        f"(without the run order {', '.join(f'{b:+.2f}' for b in without)}); sd of one session {np.nanstd(away[0]):.2f}; "
        f"intervals hold the truth {100 * inside / total:.1f} %"
    )


def order(pool: list[Made]) -> str:
    def ranking(values: list[float]) -> list[int]:
        return sorted(range(len(values)), key=lambda t: values[t])

    runs = 25
    own = [[m for m in pool if m.tyre == t] for t in range(len(TYRE_KMH))]
    true = ranking([float(np.nanmean([m.truth for m in o])) for o in own])
    seen = [
        float(np.nanmean([KMH * m.found.v for m, ok in zip(o[:runs], judged(o[:runs]), strict=True) if ok]))
        for o in own
    ]
    return (
        f"order of the 8 tyres from {8 * runs} runs: {'that of the truth' if ranking(seen) == true else 'another one'}"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=150)
    parser.add_argument("--first", type=int, default=50_000, help="first seed")
    parser.add_argument("--faults", type=int, default=16)
    parser.add_argument("--car", choices=("hatch", "saloon"), default="hatch")
    given = parser.parse_args()
    car = HATCH if given.car == "hatch" else SALOON
    pool = sound(car, given.runs, given.first)
    print(f"{car.name}, {len(pool)} runs of {len(TYRE_KMH)} tyres")
    for work in (
        lambda: bias(pool), lambda: coverage(pool), lambda: coverage(pool, 100, lane_kmh=1.0), lambda: order(pool),
        lambda: drift(pool), lambda: invalid(car, pool, given.faults),
    ):  # fmt: skip
        print(work(), flush=True)


if __name__ == "__main__":
    main()
