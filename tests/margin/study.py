"""How well the distance to full aquaplaning holds: passes with a known distance.

python -m tests.margin.study --passes 4000 --first 20000
python -m tests.margin.study --passes 1000 --first 20000 --foreign     # tests.blind.multibody: other laws
python -m tests.margin.study --passes 1000 --first 20000 --any-law     # the same, with laws drawn from published forms
python -m tests.margin.study --snow 120 --first 1620000                # drives on snow under one side: which warn
python -m tests.margin.study --passes 360 --first 1750000 --without torque    # of logs without signals that begin so
python -m tests.margin.study --campaigns 100 --first 70000             # of 8 runs, the fastest 15 km/h below it
"""

import argparse
from functools import partial

import numpy as np

from aqualog.campaign import full_speed
from aqualog.campaign.spin_downs import SETTLED_S, Pass, _foretold
from aqualog.detect.margin.watch import MARGIN
from aqualog.detect.stream import DriveStream, detect_drive
from tests.margin.learn import DRIVETRAINS, other_drive
from tests.margin.passes import AGAIN, foreign_pass, own_pass

KMH = 3.6
CELLS = ((-8, 5), (5, 15), (15, 25), (25, 35), (35, 45), (45, 55))  # [km/h]
ENDS = ("", "_low", "_high", "_q25", "_q75")


def outcome(p, after=2.0, without=()):
    """One pass, its signals that begin with one of `without` taken away, `after` seconds behind the edge of the water: true distance and `ENDS` [km/h], warned, warned early."""
    columns = {s: x for s, x in p.columns.items() if not s.startswith(("true_", *without))}
    piece = DriveStream(p.vehicle, round(p.dt * 1e9), columns, detectors=[MARGIN]).push(columns)
    f, active = piece.features, piece.tracks[0].active
    edge, k = int(p.wet[0] / p.dt), int((p.wet[0] + after) / p.dt)
    found = (f[f"aquaplaning_margin{end}"][k] for end in ENDS)
    warned, early = active[edge : edge + 200].any(), active[: edge - 20].any()
    return (*(KMH * x for x in (p.v_full - f["v_x_hat"][k], *found)), warned, early)


def foretold(make, seed, runs=8, without=()):
    """A campaign of passes that never reach it: true speed of full aquaplaning and the foretold one, with its ends."""
    found = []
    for run in range(runs):
        p = make(seed, DRIVETRAINS[seed % 3], distance=AGAIN[:1] * 2, run=run)
        columns = {s: x for s, x in p.columns.items() if not s.startswith(("true_", *without))}
        f = DriveStream(p.vehicle, round(p.dt * 1e9), columns, detectors=[MARGIN]).push(columns).features
        lane = slice(int((p.wet[0] + SETTLED_S) / p.dt), int(p.wet[1] / p.dt))
        v, low, high = (f[n][lane] for n in ("v_x_hat", "aquaplaning_margin_low", "aquaplaning_margin_high"))
        told = _foretold(f["full_speed_expected"][lane], v + low, v + high)
        found.append(Pass(None, p.dt, v, {}, {}, {}, told))
    speed = full_speed._foretold((), found)
    return tuple(KMH * x for x in (p.v_full, speed.v, *speed.ci))


def lines(x, title):
    """A row for each cell of the true distance."""
    yield f"{title}: n {len(x)}, warned before the water {int(x[:, 7].sum())}"
    for low, high in CELLS:
        cell = x[(x[:, 0] >= low) & (x[:, 0] < high)]
        has = cell[np.isfinite(cell[:, 1])]
        true, away = has[:, 0], has[:, 1] - has[:, 0]
        in90, in50 = (np.mean((has[:, a] <= true) & (true <= has[:, a + 1])) for a in (2, 4))
        yield (
            f"  {low:3d} to {high:2d} km/h: n {len(cell):4d}, distance given {len(has) / max(len(cell), 1):.2f}; median error "
            f"{np.median(np.abs(away)):4.1f}, bias {np.median(away):+5.1f}, 90 % holds {in90:.2f}, 50 % holds {in50:.2f}, "
            f"half width {0.5 * np.median(has[:, 3] - has[:, 2]):4.1f}; warned {cell[:, 6].mean():.2f}"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--foreign", action="store_true")
    parser.add_argument("--any-law", action="store_true")
    parser.add_argument("--without", nargs="*", default=[])
    parser.add_argument("--passes", type=int, default=600)
    parser.add_argument("--first", type=int, default=20_000)
    for name in ("campaigns", "snow"):
        parser.add_argument(f"--{name}", type=int, default=0)
    a = parser.parse_args()
    other = partial(foreign_pass, any_law=a.any_law)
    make, seeds = other if a.foreign or a.any_law else own_pass, range(a.first, a.first + a.passes)
    if a.snow:
        drives = [other_drive(a.first + n, DRIVETRAINS[n % 3], one_side=True)[:2] for n in range(a.snow)]
        warned = [any(e.detector == "margin" for e in detect_drive(*drive).events) for drive in drives]
        print(f"{a.snow} drives, warned {sum(warned)}, by {DRIVETRAINS}: {[sum(warned[i::3]) for i in range(3)]}")
        return
    if a.campaigns:
        x = np.array([foretold(make, seed, without=a.without) for seed in range(a.first, a.first + a.campaigns)])
        true, v, low, high = x[np.isfinite(x[:, 1])].T
        away, held = v - true, np.mean((low <= true) & (true <= high))
        print(f"{len(x)} campaigns, speed given in {v.size}; median error {np.median(np.abs(away)):.1f}, bias "
              f"{np.median(away):+.1f}, 95 % holds {held:.2f}, half width {0.5 * np.median(high - low):.1f} km/h")  # fmt: skip
        return
    x = np.array([outcome(make(seed, DRIVETRAINS[seed % 3]), without=a.without) for seed in seeds], dtype=float)
    print("\n".join(lines(x, "any law" if a.any_law else "foreign" if a.foreign else "own")))
    for i, drivetrain in enumerate(DRIVETRAINS):
        print("\n".join(lines(x[np.array(seeds) % 3 == i], drivetrain)))


if __name__ == "__main__":
    main()
