"""How well the distance to full aquaplaning holds: passes with a known distance, and dry drives.

python -m tests.margin.study --passes 4000 --first 20000
python -m tests.margin.study --passes 1000 --first 20000 --foreign     # tests.blind.multibody: other laws
python -m tests.margin.study --dry-hours 10 --first 20000              # false warnings of simulated dry drives
python -m tests.margin.study --dry-hours 4 --first 20000 --others      # of damp roads, snow, ice and gravel
"""

import argparse
from collections import Counter

import numpy as np

from aqualog.detect.margin.watch import MARGIN
from aqualog.detect.stream import DriveStream
from aqualog.model.drawing import SCORING_POOL
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import draw
from tests.detect.episode_study import DRY, NUISANCES
from tests.margin.learn import DRIVETRAINS
from tests.margin.passes import foreign_pass, own_pass

KMH = 3.6
OTHERS = tuple(n for n in NUISANCES if n not in DRY)
CELLS = ((-8, 5), (5, 15), (15, 25), (25, 35), (35, 45), (45, 55))  # [km/h]
ENDS = ("", "_low", "_high", "_q25", "_q75")


def outcome(p, after=2.0):
    """One pass, `after` seconds behind the edge of the water: true distance and `ENDS` [km/h], warned, warned early."""
    columns = {s: x for s, x in p.columns.items() if not s.startswith("true_")}
    piece = DriveStream(p.vehicle, round(p.dt * 1e9), columns, detectors=[MARGIN]).push(columns)
    f, active = piece.features, piece.tracks[0].active
    edge, k = int(p.wet[0] / p.dt), int((p.wet[0] + after) / p.dt)
    found = (f[f"aquaplaning_margin{end}"][k] for end in ENDS)
    warned, early = active[edge : edge + 200].any(), active[: edge - 20].any()
    return (*(KMH * x for x in (p.v_full - f["v_x_hat"][k], *found)), warned, early)


def lines(x, title):
    """A row for each cell of the true distance."""
    yield f"{title}: n {len(x)}, warned before the water {int(x[:, 7].sum())}"
    for low, high in CELLS:
        cell = x[(x[:, 0] >= low) & (x[:, 0] < high)]
        has = cell[np.isfinite(cell[:, 1])]
        true, away = has[:, 0], has[:, 1] - has[:, 0]
        in90, in50 = (np.mean((has[:, a] <= true) & (true <= has[:, a + 1])) for a in (2, 4))
        yield (
            f"  {low:3d} to {high:2d} km/h: n {len(cell):4d}, distance given {len(has) / len(cell):.2f}; median error "
            f"{np.median(np.abs(away)):4.1f}, bias {np.median(away):+5.1f}, 90 % holds {in90:.2f}, 50 % holds {in50:.2f}, "
            f"half width {0.5 * np.median(has[:, 3] - has[:, 2]):4.1f}; warned {cell[:, 6].mean():.2f}"
        )


def study(a):
    make, seeds = foreign_pass if a.foreign else own_pass, range(a.first, a.first + a.passes)
    x = np.array([outcome(make(seed, DRIVETRAINS[seed % 3])) for seed in seeds], dtype=float)
    print("\n".join(lines(x, "foreign" if a.foreign else "own")))


def dry(a):
    seconds, by, seed, names = 0.0, Counter(), a.first, OTHERS if a.others else DRY
    while seconds < 3600.0 * a.dry_hours:
        for name in names:
            drawn = draw(name, seed, SCORING_POOL)
            signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
            present = [s for s in signals.symbols if not s.startswith("true_") and np.isfinite(signals.array(s)).any()]
            stream = DriveStream(drawn.believed, signals.dt_ns, present, detectors=[MARGIN])
            events = (*stream.push({s: signals.array(s) for s in present}).events, *stream.finish())
            seconds, by[name] = seconds + signals.duration_s * len(stream.watches), by[name] + bool(events)
            for e in events:
                print(f"{name} {seed} {drawn.note}: {e.start_s:.1f}-{e.end_s:.1f} s, {e.peak:.2f}", flush=True)
        seed += 1
    print(f"{seconds / 3600.0:.2f} h dry, seeds {a.first} to {seed - 1}: {by.total()} warned falsely {+by}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("foreign", "others"):
        parser.add_argument(f"--{name}", action="store_true")
    for name, default in (("passes", 0), ("first", 20_000), ("dry-hours", 0)):
        parser.add_argument(f"--{name}", type=int, default=default)
    a = parser.parse_args()
    study(a) if a.passes else dry(a)


if __name__ == "__main__":
    main()
