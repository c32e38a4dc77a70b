"""How often the 95 % interval of a slope holds the truth: made data, a table.

`python tests/campaign/slope_coverage.py [seed] [repeats]`. Never tuned on seed 29000.

Runs of unequal length, each with its own offset of the slip (as another v_x scale gives), its own slope about the mean
one, slip noise that hangs together over 0.3 s, and noise of the traction that a mean over 0.3 s has smoothed. Seeds
below 200 were used while the method was made; the table that is told is of seed 29000.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.moments import Design
from aqualog.core.regression import NOISE_MAX, estimate


@dataclass(frozen=True)
class World:
    """Sizes of what is made; slopes in 1, slips in 1, lengths in samples of 0.1 s."""

    runs: int = 5
    slope: float = 30.0
    slope_scatter: float = 0.05  # relative, run to run
    offset_scatter: float = 0.001
    slip_noise: float = 0.001
    slip_memory: float = 0.7  # per sample, AR(1)
    mu_noise: float = 0.006  # after smoothing
    mu_run: float = 0.05  # of the runs' mean tractions
    mu_within: float = 0.03
    shortest: int = 12
    longest: int = 60
    outliers: float = 0.0  # share of slips that are off by ten times their noise


WORLDS = {
    "base": World(),
    "slopes scatter 15 %": World(slope_scatter=0.15),
    "offsets scatter 0.3 %": World(offset_scatter=0.003),
    "constant speed, traction varies little": World(mu_run=0.01, mu_within=0.01, mu_noise=0.003, slip_noise=0.002),
    "noise of the traction 0.015": World(mu_noise=0.015),
    "no noise of the traction": World(mu_noise=0.0),
    "lengths 8 to 200": World(shortest=8, longest=200),
    "slip noise twice, slope 10": World(slope=10.0, slip_noise=0.002),
    "outliers 3 %": World(outliers=0.03),
}


def _ar1(rng, n, sd, rho):
    x = rng.normal(0.0, 1.0, n)
    out = np.empty(n)
    out[0] = x[0]
    for i in range(1, n):
        out[i] = rho * out[i - 1] + np.sqrt(1.0 - rho * rho) * x[i]
    return sd * out


def made(world, rng):
    """One experiment as a design."""
    mus, slips, runs, steps = [], [], [], []
    for g in range(world.runs):
        n = int(np.exp(rng.uniform(np.log(world.shortest), np.log(world.longest + 1))))
        mu = 0.05 + rng.normal(0.0, world.mu_run) + _ar1(rng, n, world.mu_within, 0.95)
        k = (1.0 / world.slope) * (1.0 + world.slope_scatter * rng.normal())
        slip = k * mu + rng.normal(0.0, world.offset_scatter) + _ar1(rng, n, world.slip_noise, world.slip_memory)
        slip += np.where(rng.random(n) < world.outliers, 10.0 * world.slip_noise * rng.choice([-1.0, 1.0], n), 0.0)
        white = rng.normal(0.0, world.mu_noise * np.sqrt(3.0), n + 2)
        mus.append(mu + (white[2:] + white[1:-1] + white[:-2]) / 3.0)
        slips.append(slip)
        runs.append(np.full(n, g))
        steps.append(np.arange(n))
    mu = np.concatenate(mus)
    return Design(
        np.stack([mu, np.ones_like(mu)]), np.concatenate(slips), np.concatenate(runs), np.concatenate(steps),
        (True, True), (True, False),
    )  # fmt: skip


def study(world, repeats, seed, *, robust=False):
    """Coverage of k; of those that are told; share told; mean error of k, relative; its standard error; median half
    width, relative; median attenuation.
    """
    rng = np.random.default_rng(seed)
    truth = 1.0 / world.slope
    held, told, value, half, lost = [], [], [], [], []
    for _ in range(repeats):
        e = estimate(made(world, rng), robust=robust)
        low, high = e.interval(0)
        held.append(low <= truth <= high)
        told.append(low > 0.0 and e.attenuation <= NOISE_MAX)
        value.append(float(e.value[0]) / truth - 1.0)
        half.append(float(e.half[0]) / truth)
        lost.append(e.attenuation)
    held, told, value = np.array(held), np.array(told), np.array(value)
    return (
        float(held.mean()), float(held[told].mean()) if told.any() else float("nan"), float(told.mean()),
        float(value.mean()), float(value.std() / np.sqrt(repeats)), float(np.median(half)),
        float(np.median(lost)),
    )  # fmt: skip


def main(seed=29000, repeats=1000):
    """Print the table."""
    print(f"{'world':42s} runs robust coverage %  of told %  told %    error of k %  half width %  attenuation %")
    for number, (name, world) in enumerate(WORLDS.items()):
        for runs in (3, 5, 8, 15):
            for robust in (False, True) if name in ("base", "outliers 3 %") else (False,):
                held, sure, told, bias, error, half, lost = study(
                    replace(world, runs=runs), repeats, seed + 10 * number + runs, robust=robust
                )
                print(
                    f"{name:42s} {runs:4d} {'yes' if robust else 'no':6s} {100 * held:10.1f} {100 * sure:10.1f} {100 * told:7.1f}   "
                    f"{100 * bias:+5.2f} +-{100 * error:5.2f} {100 * half:10.1f} {100 * lost:13.1f}",
                    flush=True,
                )


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
