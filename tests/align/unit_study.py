"""How often a unit that a log does not give is guessed right: situations of the simulator, with units drawn at random.

`python tests/align/unit_study.py --seeds 2` prints the share of right, wrong and missing guesses by signal, of those
that are said to be sure and of those in doubt.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from aqualog.align.propose import propose_map
from aqualog.core.records import Channel, ChannelInfo
from aqualog.core.units import parse_unit
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS, TUNING_POOL, draw

NAMES = {
    "v_x": ("GPS Speed", ("m/s", "km/h", "mph")),
    "a_x": ("InlineAcc", ("m/s^2", "g")),
    "a_y": ("LateralAcc", ("m/s^2", "g")),
    "yaw_rate": ("YawRate", ("rad/s", "deg/s")),
    "steering_wheel_angle": ("STEER_POS", ("rad", "deg")),
    "brake_pressure": ("BRK_PRESS", ("bar", "MPa", "kPa", "Pa")),
    **{f"omega_{w}": (f"WHEEL_{w.upper()}", ("rad/s", "km/h", "m/s", "rpm", "mph")) for w in ("fl", "fr", "rl", "rr")},
}


def bare(symbol, x, t_ns, unit, radius):
    """A channel in a unit that it does not name."""
    known = parse_unit(unit)
    si = x * radius if symbol.startswith("omega_") and known.dimension == "speed" else x
    info = ChannelInfo(NAMES[symbol][0], NAMES[symbol][0], "", x.size, "a.csv")
    return Channel(info, t_ns, si / known.factor, False)


def judged(situation, seed, *, without=()):
    """Of each signal of one drive: right, wrong or missing, and whether it was said to be in doubt."""
    rng = np.random.default_rng([seed, *situation.encode()])
    drawn = draw(situation, seed, TUNING_POOL)
    signals = as_signals(simulate(drawn.scenario), truth=False)
    t_ns = np.rint(signals.array("t") * 1e9).astype(np.int64)
    car = drawn.scenario.vehicle
    units = {s: str(rng.choice(u)) for s, (_, u) in NAMES.items()}
    units |= {f"omega_{w}": units["omega_fl"] for w in ("fr", "rl", "rr")} | {"a_y": units["a_x"]}  # of one sensor
    channels = []
    for symbol, unit in units.items():
        source = "steer_angle" if symbol.startswith("steering") else symbol
        x = signals.array(source) * (car.steering_ratio if source == "steer_angle" else 1.0)
        if np.isfinite(x).sum() > 100 and np.nanstd(x) > 0.0 and symbol not in without:
            channels.append(bare(symbol, x, t_ns, unit, car.r_e(symbol[-2:]) if symbol.startswith("omega") else 1.0))
    found = propose_map(channels)
    for symbol in units:
        if any(c.info.name == NAMES[symbol][0] for c in channels):
            p = found.get(symbol)
            unit = p and p.entry.unit
            is_same = unit is not None and parse_unit(unit) == parse_unit(units[symbol])
            state = "missing" if p is None else "right" if is_same else "wrong"
            yield "omega" if symbol.startswith("omega") else symbol, state, bool(p and p.doubt), units[symbol]


def main():
    """Print the table."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--seeds", type=int, default=1)
    arguments.add_argument("--first", type=int, default=0)
    arguments.add_argument("--without", default="", help="signals that the logs lack, with commas")
    given = arguments.parse_args()
    counts: Counter[tuple[str, str, bool]] = Counter()
    for name in SITUATIONS:
        for seed in range(given.first, given.first + given.seeds):
            for symbol, state, doubt, unit in judged(name, seed, without=given.without.split(",")):
                counts[symbol, state, doubt] += 1
                if state != "right" and not doubt:
                    print(f"  {name} {seed}: {symbol} [{unit}] {state}")
    for symbol in dict.fromkeys(s for s, _, _ in counts):
        own = {(state, doubt): n for (s, state, doubt), n in counts.items() if s == symbol}
        print(symbol, {f"{state}{' in doubt' if doubt else ''}": n for (state, doubt), n in sorted(own.items())})


if __name__ == "__main__":
    main()
