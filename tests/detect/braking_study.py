"""Braking into water with an antilock system, and on snow, ice, gravel and dry roads: what the verdict says.

python -m tests.detect.braking_study --drives 100 --first 1
"""

import argparse
import zlib

import numpy as np

from aqualog.detect.stream import detect_drive
from aqualog.evaluate.drives import labels_in
from aqualog.model.drawing import KMH, SCORING_POOL, Drawing
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane
from aqualog.model.simulate import simulate
from aqualog.model.situations import believed_vehicle
from aqualog.model.situations_made import _lane, _water
from aqualog.physics.load import G

ROADS = ("water", "asphalt", "damp", "snow", "ice", "gravel", "split", "entry")
AHEAD_S = (-1.0, 0.5)  # the brake against the begin of the water
LOW = 30.0 * KMH


def scenario(road, seed, drivetrain=None):
    """One stop, whose brake is asked for 3 to 10 m/s²: over a lane of water, or all the way on another road."""
    rng = np.random.default_rng([seed, zlib.crc32(f"braking {road}".encode())])
    pool = SCORING_POOL
    cars = [c for c in pool.vehicles if drivetrain in (None, c.drivetrain)]
    k = Drawing(
        rng, pool, cars[int(rng.integers(len(cars)))], pool.tyres[0], pool.pressures[0], int(rng.integers(2**31))
    )
    k, depth, v_full = _water(k)
    v = v_full + k.between(-15.0, 20.0) * KMH if road == "water" else k.between(70.0, 130.0) * KMH
    start, wish = k.between(9.0, 14.0), k.between(3.0, 10.0)
    torque, stop = wish * k.vehicle.mass * k.vehicle.r_e_f, (v - LOW) / min(wish, 8.0)
    speed = ((0.0, v), (start, v), (start + stop, LOW), (start + stop + 8.0, LOW))
    brake = ((0.0, 0.0), (start, 0.0), (start + 0.2, torque), (start + stop, torque), (start + stop + 0.2, 0.0))
    if road == "water":
        lanes = (_lane(k, v * (start + k.between(*AHEAD_S)), v * k.between(0.8, 2.5), depth),)
    elif road == "split":
        low, dry = k.surface("ice", pool.ice), k.surface("asphalt")
        lanes = (Lane(0.0, 1e5, in_metres=True, surface=low, surface_right=dry),)
    elif road == "asphalt":
        lanes = ()
    else:
        name = k.one_of("snow", "ice", "gravel") if road == "entry" else road
        begin = v * (start + k.between(*AHEAD_S)) if road == "entry" else 0.0
        friction = {"snow": pool.snow, "ice": pool.ice, "damp": pool.damp}.get(name)
        lanes = (Lane(begin, 1e5, in_metres=True, surface=k.surface(name, friction)),)
    drive = k.drive(start + stop + 8.0, speed, lanes=lanes, brake_torque=brake, antilock=True)
    about = f"{k.vehicle.name}, {v / KMH:.0f} of {v_full / KMH:.0f} km/h, {depth * 1e3:.1f} mm, {wish / G:.2f} g"
    return drive, believed_vehicle(drive, rng), f"{road} {seed}: {about}"


def one(road, seed):
    """Delays of the first joint warning after full and partial aquaplaning began [s], false episodes, and the drive."""
    drive, believed, about = scenario(road, seed)
    signals = as_signals(simulate(drive), vehicle=believed)
    labels, found = labels_in(signals), detect_drive(signals, believed, samples=False)
    begins = np.array([e.start_s for e in found.events if e.detector.startswith("joint")])
    delays = {}
    for effect in ("full", "partial"):
        spans = labels.of(effect)
        after = begins[begins > spans[0][0] - 0.5] - spans[0][0] if spans else begins[:0]
        delays[effect] = (after.min() if after.size else np.inf) if spans else np.nan
    wet = labels.water_widened
    false = [e for e in found.judgement.of("aquaplaning") if not any(a < e.end_s and e.start_s < b for a, b in wet)]
    return delays, false, about, signals.duration_s, found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=100)
    parser.add_argument("--first", type=int, default=1)
    a = parser.parse_args()
    for road in ROADS:
        drives = [one(road, seed) for seed in range(a.first, a.first + a.drives)]
        text = [f"{road}: {sum(d[3] for d in drives) / 3600.0:.2f} h, false {sum(len(d[1]) for d in drives)}"]
        for effect, limit in (("full", 0.5), ("partial", 2.0)):
            delay = np.array([d[0][effect] for d in drives])
            delay = delay[~np.isnan(delay)]
            text.append(f"{effect} {np.sum(delay <= limit)}/{delay.size} in {limit:g} s, {np.sum(delay < 9.0)} at all")
        print("; ".join(text), flush=True)
        for _, false, about, *_ in drives:
            for e in false:
                print(f"  {about}: {e.start_s:.1f}-{e.end_s:.1f} s, {', '.join(e.decided_by)}")


if __name__ == "__main__":
    main()
