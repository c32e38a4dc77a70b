"""How well the distance to full aquaplaning holds: passes with a known distance, and dry drives.

python -m tests.margin.study --passes 4000 --first 20000
python -m tests.margin.study --foreign --passes 1000 --first 20000     # tests.blind.multibody: other laws
python -m tests.margin.study --passes 300 --first 20000 --without v_x,torque_fl,torque_fr,torque_rl,torque_rr
python -m tests.margin.study --dry-hours 10 --first 20000              # false warnings of simulated dry drives
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.detect.margin.watch import MARGIN
from aqualog.detect.stream import DriveStream
from aqualog.model.drawing import SCORING_POOL
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import draw
from tests.detect.episode_study import DRY
from tests.margin.passes import Pass, foreign_pass, own_pass

KMH = 3.6
CELLS = ((-8, 5), (5, 15), (15, 25), (25, 35), (35, 45), (45, 55))  # [km/h]
DRIVETRAINS = ("rwd", "fwd", "awd")


@dataclass(frozen=True, slots=True)
class Outcome:
    """One pass, `after` seconds behind the edge of the water: distances in km/h."""

    drivetrain: str
    true: float
    median: float
    low: float
    high: float
    q25: float
    q75: float
    is_warned: bool
    is_early: bool


def watched(p: Pass, drop: Sequence[str] = ()):
    """Features and warning bits of a pass, with this detector alone."""
    columns = {s: x for s, x in p.columns.items() if s not in drop and not s.startswith("true_")}
    stream = DriveStream(p.vehicle, round(p.dt * 1e9), columns, detectors=[MARGIN])
    piece = stream.push(columns)
    return piece.features, piece.tracks[0].active


def outcome(p: Pass, after: float, drop: Sequence[str] = ()) -> Outcome:
    """Measure one pass."""
    f, active = watched(p, drop)
    edge, k = int(p.wet[0] / p.dt), int((p.wet[0] + after) / p.dt)
    names = ("aquaplaning_margin", *(f"aquaplaning_margin_{n}" for n in ("low", "high", "q25", "q75")))
    found = (float(f[n][k]) * KMH for n in names)
    warned, early = bool(active[edge : edge + 200].any()), bool(active[: edge - 20].any())
    return Outcome(p.drivetrain, float(p.v_full - f["v_x_hat"][k]) * KMH, *found, warned, early)


def lines(outcomes: Sequence[Outcome], title: str) -> Iterator[str]:
    """A row for each cell of the true distance."""
    yield f"{title}: n {len(outcomes)}, warned before the water {sum(o.is_early for o in outcomes)}"
    for low, high in CELLS:
        cell = [o for o in outcomes if low <= o.true < high]
        if not cell:
            continue
        x = np.array([(o.true, o.median, o.low, o.high, o.q25, o.q75) for o in cell])
        has = np.isfinite(x[:, 1])
        away = x[has, 1] - x[has, 0]
        in90 = np.mean((x[has, 2] <= x[has, 0]) & (x[has, 0] <= x[has, 3]))
        in50 = np.mean((x[has, 4] <= x[has, 0]) & (x[has, 0] <= x[has, 5]))
        yield (
            f"  {low:3d} to {high:2d} km/h: n {len(cell):4d}, distance given {has.mean():.2f}; median error "
            f"{np.median(np.abs(away)):4.1f}, bias {np.median(away):+5.1f}, 90 % holds {in90:.2f}, 50 % holds {in50:.2f}, "
            f"half width {0.5 * np.median(x[has, 3] - x[has, 2]):4.1f}; "
            f"warned {np.mean([o.is_warned for o in cell]):.2f}"
        )


def recall_to(outcomes: Sequence[Outcome]) -> float:
    """Distance [km/h] down to which 95 % of the passes are warned within 2 s."""
    ordered = sorted(outcomes, key=lambda o: o.true)
    best = float("nan")
    for low in np.arange(0.0, 50.0, 1.0):
        cell = [o.is_warned for o in ordered if low - 2.5 <= o.true < low + 2.5]
        if len(cell) < 8 or np.mean(cell) < 0.95:
            break
        best = float(low)
    return best


def study(a: argparse.Namespace) -> None:
    make, drop = foreign_pass if a.foreign else own_pass, tuple(a.without.split(",")) if a.without else ()
    outcomes: list[Outcome] = []
    for n in range(a.passes):
        outcomes.append(outcome(make(a.first + n, DRIVETRAINS[n % 3]), a.after, drop))
        if (n + 1) % 500 == 0:
            print(f"{n + 1} passes", flush=True)
    print("\n".join(lines(outcomes, "foreign" if a.foreign else "own")))
    for drivetrain in DRIVETRAINS:
        some = [o for o in outcomes if o.drivetrain == drivetrain]
        if a.by_drivetrain:
            print("\n".join(lines(some, drivetrain)))
        print(f"{drivetrain}: 95 % warned down to {recall_to(some):.0f} km/h")
    print(f"all: 95 % warned down to {recall_to(outcomes):.0f} km/h below full aquaplaning")


def warnings_in(signals, vehicle) -> list[tuple[float, float, float]]:
    """Begin, end [s] and greatest probability of each warning of a drive."""
    present = [s for s in signals.symbols if not s.startswith("true_") and np.isfinite(signals.array(s)).any()]
    stream = DriveStream(vehicle, signals.dt_ns, present, detectors=[MARGIN])
    if not stream.watches:
        return []
    piece = stream.push({s: signals.array(s) for s in present})
    return [(e.start_s, e.end_s, e.peak) for e in (*piece.events, *stream.finish())]


def dry(a: argparse.Namespace) -> None:
    seconds, found, seed = 0.0, 0, a.first
    names = a.situations.split(",") if a.situations else DRY
    by: dict[str, int] = {}
    while seconds < 3600.0 * a.dry_hours:
        for name in names:
            drawn = draw(name, seed, SCORING_POOL)
            signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
            warned = warnings_in(signals, drawn.believed)
            seconds, found = seconds + signals.duration_s, found + len(warned)
            for begin, end, peak in warned:
                by[name] = by.get(name, 0) + 1
                print(f"{name} {seed} {drawn.note}: {begin:.1f}-{end:.1f} s, {peak:.2f}", flush=True)
        seed += 1
    print(f"{seconds / 3600.0:.2f} h dry, seeds {a.first} to {seed - 1}: {found} false warnings {by}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=0)
    parser.add_argument("--first", type=int, default=20_000)
    parser.add_argument("--foreign", action="store_true")
    parser.add_argument("--after", type=float, default=2.0, help="seconds behind the edge of the water")
    parser.add_argument("--without", default="", help="signals that the logs lack")
    parser.add_argument("--by-drivetrain", action="store_true")
    parser.add_argument("--dry-hours", type=float, default=0.0)
    parser.add_argument("--situations", default="")
    a = parser.parse_args()
    if a.passes:
        study(a)
    if a.dry_hours:
        dry(a)


if __name__ == "__main__":
    main()
