"""Joint detectors: coarse velocities, joint against single ones over drawn situations, and the sum by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from aqualog.core.notation import WHEELS
from aqualog.core.records import Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect import joint_cusum
from aqualog.detect.joint_cusum import JointCusumParams
from aqualog.evaluate.drives import Drive, labels_in
from aqualog.evaluate.judge import judge as judge_drive
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.score import Coverage, Score, coverage, score, situation_scores
from aqualog.evaluate.sweep import JOINT
from aqualog.model.drawing import SCORING_POOL, Pool
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS, draw
from aqualog.thesis.claims import Check, Checks, judge, limit
from aqualog.thesis.evidence.seeds import PASS_SEEDS, Maker, Plan, estimate, spread_over

__all__ = ["CHECKS"]

SPEEDY = ("spin_down", "minor_spin_down", "spin_up", "joint_criteria", "joint_cusum")
SINGLE = ("spin_down", "minor_spin_down", "spin_up", "resistance", "slip_slope_drop", "tie_rod")
LATE_S = 0.2
HALF = 0.5  # of the partial aquaplaning, which a detector finds that is worth a comparison of its false alarms
RECALL = limit("recall", "C70.drives")  # by which a recall may change
MORE_ALARMS = limit("more_alarms", "C70.drives")  # false alarms on top, over all drives
OF_KIND = 20  # drives of each kind for C70
WET_DRIVES, DRY_DRIVES = 10, 5  # of each situation for C78

Change = Callable[[pl.DataFrame, Vehicle], pl.DataFrame]


def _scaled(factor: float) -> Change:
    return lambda frame, _: frame.with_columns(pl.col("v_x") * factor)


def _late(frame: pl.DataFrame, _: Vehicle) -> pl.DataFrame:
    """The whole signal 0.2 s late; at the start it is what it was first."""
    rows = round(LATE_S / (frame["t"][1] - frame["t"][0]))
    return frame.with_columns(pl.col("v_x").shift(rows).fill_null(strategy="backward"))


def _without(frame: pl.DataFrame, _: Vehicle) -> pl.DataFrame:
    return frame.drop("v_x")


def _mean_of_wheels(frame: pl.DataFrame, vehicle: Vehicle) -> pl.DataFrame:
    speeds = [pl.col(f"omega_{w}") * vehicle.r_e(w) for w in WHEELS]
    return frame.with_columns(pl.mean_horizontal(speeds).alias("v_x"))


VARIANTS: Mapping[str, Change] = {
    "as measured": _scaled(1.0),
    "2 % too fast": _scaled(1.02),
    "2 % too slow": _scaled(0.98),
    "0.2 s late": _late,
    "none (estimated from wheels and accelerometer)": _without,
    "mean of the four wheels": _mean_of_wheels,
}
AS_MEASURED = "as measured"
MEASURED = ("2 % too fast", "2 % too slow", "0.2 s late")  # coarse, but a measurement


@dataclass(frozen=True, slots=True)
class Row:
    """One detector with one velocity: found and all episodes of full and of partial aquaplaning; false alarms."""

    detector: str
    variant: str
    full: tuple[int, int]
    partial: tuple[int, int]
    false_alarms: int

    def is_like(self, base: Row) -> bool:
        """Whether recalls differ from another row's by at most 0.1, and false alarms are at most two more."""

        def rate(found: tuple[int, int]) -> float:
            return found[0] / found[1] if found[1] else 0.0

        pairs = ((self.full, base.full), (self.partial, base.partial))
        same = all(abs(rate(a) - rate(b)) <= RECALL for a, b in pairs)
        return same and self.false_alarms - base.false_alarms <= MORE_ALARMS


Item = tuple[str, int, Pool]  # situation, seed, what it is drawn from


def _drive(item: Item) -> Drive:
    name, seed, pool = item
    drawn = draw(name, seed, pool)
    signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
    labels = labels_in(signals)
    assert labels is not None  # a simulation holds its truth
    return Drive(f"{name} {seed}", signals, drawn.believed, labels, {"manoeuvre": name, "kind": drawn.kind})


def drives(count: int, first_seed: int, pool: Pool) -> list[Item]:
    """As many drives of both kinds, taking turns through the situations, a seed for each."""
    found: list[Item] = []
    for kind in ("aquaplaning", "nuisance"):
        names = [n for n, s in SITUATIONS.items() if s.kind == kind]
        found += [(names[i % len(names)], first_seed + i, pool) for i in range(count)]
    return found


def with_velocity(d: Drive, change: Change) -> Drive:
    """The same drive with another velocity signal."""
    return replace(d, signals=replace(d.signals, frame=change(d.signals.frame, d.vehicle)))


def variants_of(item: Item) -> dict[str, RunRecord]:
    """A drive with each velocity, judged."""
    d = _drive(item)
    return {name: judge_drive(with_velocity(d, change)) for name, change in VARIANTS.items()}


def rows_of(records: Sequence[Mapping[str, RunRecord]]) -> dict[tuple[str, str], Row]:
    """Row of each detector and velocity."""
    rows = {}
    for variant in VARIANTS:
        some = [r[variant] for r in records]
        for detector in SPEEDY:
            s = score(some, detector)
            rows[detector, variant] = Row(
                detector, variant, (s.full.found, s.full.episodes), (s.partial.found, s.partial.episodes),
                s.false_alarms.count,
            )  # fmt: skip
    return rows


def _likeness(rows: Mapping[tuple[str, str], Row]) -> dict[tuple[str, str], bool]:
    return {key: row.is_like(rows[row.detector, AS_MEASURED]) for key, row in rows.items()}


def _alike(records: Sequence[Mapping[str, RunRecord]]) -> float:
    """Share of the combinations that are alike."""
    return float(np.mean(list(_likeness(rows_of(records)).values())))


def c70(plan: Plan, pool: Pool = SCORING_POOL, count: int = OF_KIND) -> Check:
    """Metrics of the detectors that use differences of speed, with coarse velocities."""
    records = spread_over(variants_of, drives(count, plan.seeds[0], pool), plan, "drives")
    rows = rows_of(records)
    like = _likeness(rows)
    of_detector = [all(like[d, v] for v in VARIANTS) for d in SPEEDY]
    part = all(like[d, v] for d in SPEEDY for v in MEASURED) or sum(of_detector) >= len(SPEEDY) - 1
    other = [f"{d} with {v}: {_told(rows[d, v])}" for (d, v), same in like.items() if not same]
    base = "; ".join(f"{d} {_told(rows[d, AS_MEASURED])}" for d in SPEEDY)
    share, ci = estimate(lambda r: _alike([records[i] for i in r]), len(records))
    outcome = (
        f"{sum(like.values())} of {len(like)} combinations alike over {count} drives with aquaplaning and {count} "
        f"others. As measured: {base}. Not alike: {'; '.join(other) or 'none'}"
    )
    return judge(
        "C70.drives", outcome, whole=all(like.values()), part=part, value=share, ci95=ci, fields={"pool": pool.name}
    )


def _told(row: Row) -> str:
    full, partial = (f"{a} of {b}" for a, b in (row.full, row.partial))
    return f"full {full}, partial {partial}, false alarms {row.false_alarms}"


def _judged(item: Item) -> RunRecord:
    return judge_drive(_drive(item))


def c78(plan: Plan, pool: Pool = SCORING_POOL, wet: int = WET_DRIVES, dry: int = DRY_DRIVES) -> Checks:
    """Each joint detector against every single one over all situations."""
    items = [
        (name, s, pool) for name, x in SITUATIONS.items() for s in plan.first(wet if x.kind == "aquaplaning" else dry)
    ]
    records = spread_over(_judged, items, plan, "drives")
    return compared(records, pool.name)


def compared(records: Sequence[RunRecord], pool: str) -> Checks:
    """Judge C78 from drives of situations (their `manoeuvre`) drawn from a pool."""
    covered = coverage(situation_scores(records))
    scores = {d: score(records, d) for d in (*SINGLE, *JOINT)}
    singles = {d: scores[d] for d in SINGLE if scores[d].runs}
    return tuple(_joint_check(d, scores[d], covered, singles, len(records), pool) for d in JOINT)


def _joint_check(
    name: str, own: Score, covered: Mapping[str, Coverage], singles: Mapping[str, Score], n: int, pool: str
) -> Check:
    def total(d: str) -> int:
        return covered[d].found + covered[d].quiet

    more = all(total(name) > total(d) for d in singles)
    keen = all(own.partial.share >= s.partial.share for s in singles.values())
    # a detector without any detection is quiet as well
    calm = all(
        own.false_alarms.count <= s.false_alarms.count for s in singles.values() if s.partial.share >= HALF
    )  # fmt: skip
    whole = more and keen and calm
    text = "; ".join(f"{d} {_scored(covered[d], s)}" for d, s in {name: own, **singles}.items())
    lacks = [w for ok, w in ((more, "situations"), (keen, "recall"), (calm, "false alarms")) if not ok]
    outcome = f"{n} drives in {len(SITUATIONS)} situations. {text}"
    part = more and (keen or calm)
    fields = {"name": name.replace("_", " "), "pool": pool, "lacks": ", ".join(lacks)}
    return judge(
        "C78.drives", outcome, whole=whole, part=part, value=own.partial.share, ci95=own.partial.ci95, fields=fields
    )


def _scored(c: Coverage, s: Score) -> str:
    low, high = s.partial.ci95
    a, b = s.false_alarms.per_hour_ci95
    return (
        f"found in {c.found} of {c.of_aquaplaning} situations, quiet in {c.quiet} of {c.of_dry}, partial "
        f"{s.partial.found} of {s.partial.episodes} ({low:.2f} to {high:.2f}), full {s.full.found} of "
        f"{s.full.episodes}, false alarms {s.false_alarms.count} ({a:.1f} to {b:.1f} per h)"
    )


def _track(detector: str, wheel: str | None, statistic: float) -> Track:
    return Track(detector, wheel, None, "-", np.array([statistic]), 1.0, np.zeros(1, dtype=np.bool_))


def _sum(plan: Plan) -> Check:
    """C71: the sum of 2.11 by hand."""
    rng = np.random.default_rng(plan.seeds[0])
    p = JointCusumParams(with_slope=False)
    worst, n, least = 0.0, 2000, math.inf
    for _ in range(n):
        up, down, rr, variance = (
            rng.uniform(0.0, 4.0, 2),
            rng.uniform(0.0, 4.0, 4),
            rng.uniform(0.0, 1.0),
            rng.uniform(-3.0, 9.0, 2),
        )
        tracks = [
            *(_track("spin_up", w, x) for w, x in zip(("rl", "rr"), up, strict=True)),
            *(_track("spin_down", w, x) for w, x in zip(("fl", "fr", "rl", "rr"), down, strict=True)),
            _track("resistance", None, rr),
            *(_track("minor_spin_down", w, x) for w, x in zip(("fl", "fr"), variance, strict=True)),
        ]
        everywhere = np.ones(1, dtype=np.bool_)
        terms = joint_cusum.terms(p, [(t, everywhere) for t in tracks], np.zeros(1), 1)
        ours = math.fsum(float(x[0]) for x in terms.values())
        printed = (min(max(variance), p.var_high) - p.var_low) / (p.var_high - p.var_low)
        least = min(least, printed)
        by_hand = (
            min(max(up) / p.g_up, 1.0)
            + min(max(down) / p.g_down, 1.0)
            + min(rr / p.g_resistance, 1.0)
            + max(printed, 0.0)
        )
        worst = max(worst, abs(ours - by_hand))
    exact = worst < 1e-12
    outcome = f"{worst:.1e} over {n} random states; the printed variance term would fall to {least:.2f} in them"
    return judge("C71.theory", outcome, part=exact, value=worst)


CHECKS = (
    Maker(("C71",), _sum),
    Maker(("C70",), c70, PASS_SEEDS, spreads=True),
    Maker(("C78",), c78, PASS_SEEDS, spreads=True),
)
