"""How often 95 % intervals cover the truth: PYTHONPATH=tests python tests/calibrate/coverage_study.py --seeds 200 --first N."""

import argparse
from dataclasses import replace

import numpy as np

from aqualog.calibrate.run import calibrate
from tests.calibrate.dry_drives import believed, campaign, truth

CASES = {
    "one drive, altitude": (1, True, ()),
    "one drive": (1, False, ()),
    "one drive, weighed": (1, True, ("mass",)),
    "four drives, altitude": (4, True, ()),
    "four drives": (4, False, ()),
    "four drives, weighed": (4, True, ("mass",)),
}


def one(seed, drives, seconds):
    """Rows (case, parameter, error over half width, half width over value, identified)."""
    signals, true, gain = campaign(seed, drives, seconds=seconds)
    # rods and steering are not the matter here
    signals = [
        replace(s, frame=s.frame.select(c for c in s.frame.columns if not c.startswith(("tie_rod", "steering_torque"))))
        for s in signals
    ]
    plain = [replace(s, frame=s.frame.drop("altitude")) for s in signals]
    known = truth(true, gain, signals[0])
    rows = []
    for name, (n, altitude, weighed) in CASES.items():
        if n > drives:
            continue
        logs = (signals if altitude else plain)[:n]
        fixed = {k: known[k] for k in weighed}
        result = calibrate(logs, [f"drive {i}" for i in range(n)], believed(true), fixed)
        for p in result.parameters:
            if p.name not in known or p.name in fixed or not np.isfinite(p.ci95[0]):
                continue
            half = 0.5 * (p.ci95[1] - p.ci95[0])
            error = known[p.name] - 0.5 * (p.ci95[0] + p.ci95[1])
            rows.append((name, p.name, error / half, half / abs(known[p.name]), p.identified))
    return rows


def summary(rows):
    """Coverage with counts, median half width and bias of each parameter and case."""
    lines = []
    for case, name in dict.fromkeys((r[0], r[1]) for r in rows):
        z = np.array([r[2] for r in rows if (r[0], r[1]) == (case, name)])
        half = np.array([r[3] for r in rows if (r[0], r[1]) == (case, name)])
        told = np.array([r[4] for r in rows if (r[0], r[1]) == (case, name)])
        inside = np.abs(z) <= 1.0
        lines.append(
            f"{case:24s} {name:20s} covered {inside.mean():6.1%} of {z.size:4d}, when told {inside[told].mean() if told.any() else np.nan:6.1%}"
            f" of {told.sum():4d}; half width {np.median(half):7.3%}, mean error {np.mean(z * half):+.4%}"
        )
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--drives", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=400.0)
    a = parser.parse_args()
    rows = []
    for seed in range(a.first, a.first + a.seeds):
        rows += one(seed, a.drives, a.seconds)
    print(summary(rows))


if __name__ == "__main__":
    main()
