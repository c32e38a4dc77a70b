"""How often the intervals of `aqualog calibrate --wet` hold the truth: simulated passes whose tyre is known.

`python -m tests.trade.water_study [--sets 60] [--first 1]` prints coverage, bias and width of each number.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.model.log import as_signals
from aqualog.model.published import Condition, full_speed
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import simulate
from aqualog.model.tyre import Tyre
from aqualog.trade.water_law import FITTED, fit_water
from aqualog.trade.wet_passes import Told, passes_of

GIVEN = frozenset({"drivetrain", "mass", "l_f", "l_r", "wheels.r_e_f", "wheels.r_e_r"})
CARS = {
    "rwd": Vehicle(name="rear", drivetrain="rwd", given=GIVEN),
    "fwd": Vehicle(name="front", drivetrain="fwd", torque_split_rear=0.0, given=GIVEN),
}


def drawn(seed):
    """A car, a tyre with its pressure [Pa], and the water [m] of a test day."""
    rng = np.random.default_rng([seed, 24])
    base = Tyre()
    tyre = replace(
        base,
        name="drawn",
        v_anchor=base.v_anchor * np.exp(0.06 * rng.normal()),
        contact_exponent=base.contact_exponent * np.exp(0.25 * rng.normal()),
    )
    return (
        CARS["rwd" if seed % 2 else "fwd"],
        tyre,
        float(rng.uniform(1.8e5, 2.5e5)),
        float(rng.uniform(1.0e-3, 3.0e-3)),
    )


def logs(seed, count=8):
    """Signals of passes at speeds from partial aquaplaning to beyond full, with the series' sensors."""
    car, tyre, p, depth = drawn(seed)
    load = 0.5 * car.mass * 9.81 * car.l_r / car.wheelbase
    top = full_speed(tyre, Condition(depth * 1e3, tyre.tread_depth * 1e3, p * 1e-5, load), "spin-down") / 3.6
    rng = np.random.default_rng([seed, 25])
    found = []
    for k in range(count):
        v = top * (0.72 + 0.36 * (k + rng.uniform(-0.3, 0.3)) / (count - 1))
        speed = ((0.0, v), (4.0, v), (12.0, v * (1.0 + 0.08 * (k % 2))))
        lane = Lane(4.0, 10.0, depth_left=depth, depth_right=depth)
        scenario = Scenario(
            car, tyre_front=tyre, tyre_rear=tyre, p_front=p, p_rear=p, duration_s=12.0, seed=1000 * seed + k, speed=speed,
            lanes=(lane,),
        )  # fmt: skip
        found.append(as_signals(simulate(scenario), vehicle=car, truth=False))
    return found


def fitted(seed, count=8):
    """Truth and fit of a test day."""
    car, tyre, p, depth = drawn(seed)
    told = Told(depth, tyre.tread_depth, p)
    passes = [w for k, s in enumerate(logs(seed, count)) for w in passes_of(s, car, f"pass {k + 1}", told)]
    return tyre, fit_water(passes, car, replace(Tyre(), tread_depth=tyre.tread_depth), p=p)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=60)
    parser.add_argument("--first", type=int, default=1)
    args = parser.parse_args()
    rows = {name: [] for name in FITTED}
    for seed in range(args.first, args.first + args.sets):
        tyre, fit = fitted(seed)
        for q in fit.parameters:
            true = getattr(tyre, q.name)
            rows[q.name].append((true, q.value, *q.ci95, q.identified, seed % 2))
    for name, found in rows.items():
        x = np.array(found, dtype=float)
        for what, own in (
            ("all", x),
            ("identified", x[x[:, 4] > 0]),
            ("rwd", x[x[:, 5] > 0]),
            ("fwd", x[x[:, 5] == 0]),
        ):
            if not len(own):
                continue
            inside = (own[:, 2] <= own[:, 0]) & (own[:, 0] <= own[:, 3])
            error = np.log(own[:, 1] / own[:, 0])
            half = 0.5 * np.log(own[:, 3] / own[:, 2])
            print(f"{name:17s} {what:11s} {inside.sum():3d} of {len(own):3d} hold; bias {100 * error.mean():+.1f} %, "
                  f"rms {100 * np.sqrt((error**2).mean()):.1f} %, half width {100 * np.median(half):.1f} %")  # fmt: skip


if __name__ == "__main__":
    main()
