"""Episodes on simulated drives: as many as there are lanes of water, with its edges, and none on dry roads.

python -m tests.detect.episode_study --passes 300 --first 1000
python -m tests.detect.episode_study --dry-hours 20 --first 1000
python -m tests.detect.episode_study --dry-hours 20 --first 1000 --others    # with snow, ice, gravel and damp roads
python -m tests.detect.episode_study --dry-hours 20 --first 1000 --without-torque
python -m tests.detect.episode_study --stops 100 --first 1000                # antilock braking into water, and elsewhere
python -m tests.detect.episode_study --controlled 60 --first 1000           # stability control in water, and on dry road
python -m tests.detect.episode_study --begins 200 --first 1000              # logs that begin on water
"""

from __future__ import annotations

import argparse
import zlib
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import polars.selectors as cs

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.detect.stream import detect_drive
from aqualog.evaluate.drives import labels_in
from aqualog.evaluate.labels import overlaps
from aqualog.model.drawing import KMH, SCORING_POOL, Drawing
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS, believed_vehicle, draw
from aqualog.model.situations_made import _lane, _water
from tests.detect import stability

DRY_GAP_S = (4.0, 12.0)  # between two lanes
SPEED_KMH = (-15.0, 10.0)  # against that of full aquaplaning


@dataclass(frozen=True, slots=True)
class Pass:
    """Lanes of water with aquaplaning [s], and what was found: episodes [s] and the time by which each edge is off."""

    note: str
    lanes: tuple[tuple[float, float], ...]
    found: tuple[tuple[float, float], ...]

    @property
    def is_counted(self) -> bool:
        return len(self.lanes) == len(self.found)

    @property
    def edges(self) -> list[tuple[float, float]]:
        """Late by so much, at begin and end of each lane. [s]"""
        if not self.is_counted:
            return []
        return [(b[0] - a[0], b[1] - a[1]) for a, b in zip(self.lanes, self.found, strict=True)]


def _drawn(name: str, seed: int, pool):
    """Random numbers, and a drawing with its depth of water [m] and speed of full aquaplaning. [m/s]"""
    rng = np.random.default_rng([seed + pool.seed_offset, zlib.crc32(name.encode())])
    vehicle = pool.vehicles[int(rng.integers(len(pool.vehicles)))]
    drawing = Drawing(rng, pool, vehicle, pool.tyres[0], pool.pressures[0], int(rng.integers(2**31)))
    return rng, *_water(drawing)


def scenario(seed: int, pool):
    """A drive at a constant speed over one to three lanes, as on a proving ground."""
    rng, k, depth, v_full = _drawn("lanes", seed, pool)
    v = v_full + k.between(*SPEED_KMH) * KMH
    t, lanes = k.between(10.0, 20.0), []
    for _ in range(k.one_of(1, 2, 3)):
        seconds = k.between(2.0, 8.0) if v < v_full - 10.0 * KMH else k.between(1.5, 3.5)
        lanes.append(_lane(k, v * t, v * seconds, depth))
        t += seconds + k.between(*DRY_GAP_S)
    drive = k.drive(t + 4.0, ((0.0, v),), lanes=tuple(lanes))
    note = f"{k.vehicle.name}, {k.tyre.name}, {depth * 1e3:.1f} mm, {v / KMH:.0f} of {v_full / KMH:.0f} km/h"
    return drive, believed_vehicle(drive, rng), f"{seed}: {note}"


def one_pass(seed: int, pool) -> Pass | None:
    """A pass, or None if no wheel floats on one of its lanes."""
    drive, believed, note = scenario(seed, pool)
    signals = as_signals(simulate(drive), vehicle=believed)
    labels = labels_in(signals)
    lanes = labels.of("water")
    if not all(overlaps(lane, labels.afloat) for lane in lanes) or len(lanes) != len(drive.lanes):
        return None
    found = detect_drive(signals, believed, samples=False).judgement.of("aquaplaning")
    return Pass(note, tuple(lanes), tuple((e.start_s, e.end_s) for e in found))


def dry(name: str, seed: int, pool, without_torque: bool = False):
    """Seconds, episodes of aquaplaning, and warnings of the margin of a dry drive."""
    drawn = draw(name, seed, pool)
    signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
    if without_torque:
        signals = replace(signals, frame=signals.frame.drop(cs.starts_with("torque_")))
    found = detect_drive(signals, drawn.believed, samples=False)
    warned = [e for e in found.events if e.detector == "margin"]
    return signals.duration_s, [(drawn.note, e) for e in found.judgement.of("aquaplaning")], warned


def stop_scenario(road: str, seed: int, pool):
    """A stop whose brake is asked for 3 to 10 m/s², into a lane of water, onto another road (`entry`), or on `road`."""
    rng, k, depth, v_full = _drawn(f"stop {road}", seed, pool)
    v = v_full + k.between(-15.0, 20.0) * KMH if road == "water" else k.between(70.0, 130.0) * KMH
    t, wish, low = k.between(9.0, 14.0), k.between(3.0, 10.0), 30.0 * KMH
    torque, end = wish * k.vehicle.mass * k.vehicle.r_e_f, t + (v - low) / min(wish, 8.0)
    begin = v * (t + k.between(-1.0, 0.5))
    if road == "water":
        lanes = (_lane(k, begin, v * k.between(0.8, 2.5), depth),)
    else:
        name = {"entry": k.one_of("snow", "ice", "gravel"), "split": "ice"}.get(road, road)
        surface = k.surface(name, {"snow": pool.snow, "ice": pool.ice, "damp": pool.damp}.get(name))
        other = k.surface("asphalt") if road == "split" else None
        lanes = (Lane(begin if road == "entry" else 0.0, 1e5, True, surface=surface, surface_right=other),)
    speed = ((0.0, v), (t, v), (end, low), (end + 8.0, low))
    brake = ((0.0, 0.0), (t, 0.0), (t + 0.2, torque), (end, torque), (end + 0.2, 0.0))
    drive = k.drive(end + 8.0, speed, lanes=lanes, brake_torque=brake, antilock=True)
    return (
        drive,
        believed_vehicle(drive, rng),
        f"{road} {seed}, {k.vehicle.name}, {v / KMH:.0f} of {v_full / KMH:.0f} km/h",
    )


def judged(signals, believed, note: str):
    """Delays of the first joint warning behind full and partial aquaplaning [s] (NaN: none), and false episodes."""
    labels, found = labels_in(signals), detect_drive(signals, believed, samples=False)
    joint = [e for e in found.events if e.detector.startswith("joint")]
    begun = [spans[0][0] if (spans := labels.of(effect)) else np.nan for effect in ("full", "partial")]
    delays = [min((e.start_s - t for e in joint if e.end_s > t), default=np.inf) if t == t else t for t in begun]
    wet, said = labels.water_widened, found.judgement.of("aquaplaning")
    false = [(note, e) for e in said if not overlaps((e.start_s, e.end_s), wet)]
    return delays, false, signals.duration_s


def stop(road: str, seed: int, pool):
    """What is said of a stop, see `judged`."""
    drive, believed, note = stop_scenario(road, seed, pool)
    return judged(as_signals(simulate(drive), vehicle=believed), believed, note)


def controlled(kind: str, seed: int, pool):
    """What is said of a drive with stability control, see `judged`; None where a wheel turns backwards."""
    road, kind, known = kind.split()
    rng, k, depth, v_full = _drawn(f"stability {road} {kind}", seed, pool)
    lane = (lambda k, start, length: _lane(k, start, length, depth)) if road == "water" else None
    drive = stability.steered_drive(kind, k, v_full, lane)
    believed = believed_vehicle(drive, rng)
    try:
        signals = stability.controlled(drive, believed, float(known))
    except ConfigError:
        return None
    if min(signals.array(f"omega_{w}").min() for w in WHEELS) < -2.0:
        return None
    return judged(signals, believed, f"{kind} {seed}, {k.vehicle.name}, full at {v_full / KMH:.0f} km/h")


def begin(_: str, seed: int, pool):
    """What is said of a log that begins on water, or up to a second before it, see `judged`."""
    rng, k, depth, v_full = _drawn("first second", seed, pool)
    v = max(v_full + k.between(-25.0, 10.0) * KMH, 50.0 * KMH)
    t, seconds = k.between(0.0, 1.0), k.between(3.0, 6.0) if v < v_full - 10.0 * KMH else k.between(2.0, 3.5)
    lane = _lane(k, v * t, v * seconds, depth)
    drive = k.drive(seconds + 6.0, ((0.0, v),), lanes=(lane if t > 0.3 else replace(lane, start=-5.0),))
    believed = believed_vehicle(drive, rng)
    return judged(as_signals(simulate(drive), vehicle=believed), believed, f"begin {seed}, {k.vehicle.name}")


CONTROLLED = tuple(
    f"{road} {kind} {known}" for road in ("water", "dry") for kind in ("curve", "lane_change") for known in (1.0, 0.75)
)
ROADS = ("water", "asphalt", "damp", "snow", "ice", "gravel", "split", "entry")
NUISANCES = tuple(n for n, s in SITUATIONS.items() if s.kind == "nuisance")
_OTHER_ROADS = ("damp", "snow", "ice", "gravel", "split")
DRY = tuple(n for n in NUISANCES if not any(road in n for road in _OTHER_ROADS))


def alarms(hours: float, first: int, pool, names=DRY, without_torque: bool = False):
    """Seconds of dry drives, their episodes of aquaplaning, and drives in which the margin warned by situation."""
    seconds, found, by, seed = 0.0, [], Counter(), first
    while seconds < 3600.0 * hours:
        for name in names:
            t, wrong, warned = dry(name, seed, pool, without_torque)
            seconds, found, by[name] = seconds + t, found + wrong, by[name] + bool(warned)
            for note, e in wrong:
                print(name, seed, note, f"{e.start_s:.1f}-{e.end_s:.1f}", e.decided_by, flush=True)
        seed += 1
    return seconds, found, by


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=0)
    parser.add_argument("--dry-hours", type=float, default=0.0)
    parser.add_argument("--others", action="store_true")
    parser.add_argument("--without-torque", action="store_true")
    parser.add_argument("--stops", type=int, default=0)
    parser.add_argument("--controlled", type=int, default=0)
    parser.add_argument("--begins", type=int, default=0)
    parser.add_argument("--first", type=int, default=1)
    a = parser.parse_args()
    pool, seed, done = SCORING_POOL, a.first, []
    while len(done) < a.passes:
        if (one := one_pass(seed, pool)) is not None:
            done.append(one)
            late = [f"{b:+.2f} {e:+.2f}" for b, e in one.edges]
            if not one.is_counted or any(max(abs(b), abs(e)) > 1.0 for b, e in one.edges):
                print(one.note, "|", *(f"{x:.1f}-{y:.1f}" for x, y in one.lanes), "|",
                      *(f"{x:.1f}-{y:.1f}" for x, y in one.found), "|", *late, flush=True)  # fmt: skip
        seed += 1
    if done:
        edges = np.array([x for one in done for x in one.edges])
        inside = np.abs(edges) <= 1.0
        print(f"{len(done)} passes, {sum(len(x.lanes) for x in done)} lanes, seeds {a.first} to {seed - 1}: "
              f"number right in {np.mean([x.is_counted for x in done]):.1%}; "
              f"begin within 1 s {inside[:, 0].mean():.1%}, median {np.median(edges[:, 0]):+.2f} s; "
              f"end {inside[:, 1].mean():.1%}, median {np.median(edges[:, 1]):+.2f} s")  # fmt: skip
    kinds = (ROADS, a.stops, stop), (CONTROLLED, a.controlled, controlled), (("begin",), a.begins, begin)
    for names, count, make in kinds:
        for name in names if count else ():
            found = [x for seed in range(a.first, a.first + count) if (x := make(name, seed, pool)) is not None]
            full, partial = np.array([x for x, _, _ in found]).T
            print(f"{name}: {len(found)} drives, {sum(s for *_, s in found) / 3600.0:.2f} h, full found in 0.5 s "
                  f"{np.sum(full <= 0.5)} of {np.sum(~np.isnan(full))}, partial in 2 s {np.sum(partial <= 2.0)} of "
                  f"{np.sum(~np.isnan(partial))}; false: ",
                  [(note, e.start_s, e.decided_by) for _, false, _ in found for note, e in false], flush=True)  # fmt: skip
    if a.dry_hours:
        seconds, found, by = alarms(a.dry_hours, a.first, pool, NUISANCES if a.others else DRY, a.without_torque)
        print(f"{seconds / 3600.0:.1f} h dry, seeds from {a.first}: {len(found)} episodes of aquaplaning; "
              f"the margin warned in {by.total()} drives {+by}")  # fmt: skip


if __name__ == "__main__":
    main()
