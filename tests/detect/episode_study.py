"""Episodes on simulated drives: as many as there are lanes of water, with its edges, and none on dry roads.

python -m tests.detect.episode_study --passes 300 --first 1000
python -m tests.detect.episode_study --dry-hours 20 --first 1000
python -m tests.detect.episode_study --dry-hours 20 --first 1000 --others    # with snow, ice, gravel and damp roads
"""

from __future__ import annotations

import argparse
import zlib
from dataclasses import dataclass

import numpy as np

from aqualog.detect.stream import detect_drive
from aqualog.evaluate.drives import labels_in
from aqualog.evaluate.labels import overlaps
from aqualog.model.drawing import KMH, SCORING_POOL, TUNING_POOL, Drawing
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS, believed_vehicle, draw
from aqualog.model.situations_made import _lane, _water

POOLS = {"tuning": TUNING_POOL, "scoring": SCORING_POOL}
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


def scenario(seed: int, pool):
    """A drive at a constant speed over one to three lanes, as on a proving ground."""
    rng = np.random.default_rng([seed + pool.seed_offset, zlib.crc32(b"lanes")])
    vehicle = pool.vehicles[int(rng.integers(len(pool.vehicles)))]
    drawing = Drawing(rng, pool, vehicle, pool.tyres[0], pool.pressures[0], int(rng.integers(2**31)))
    k, depth, v_full = _water(drawing)
    v = v_full + k.between(*SPEED_KMH) * KMH
    t, lanes = k.between(10.0, 20.0), []
    for _ in range(k.one_of(1, 2, 3)):
        seconds = k.between(2.0, 8.0) if v < v_full - 10.0 * KMH else k.between(1.5, 3.5)
        lanes.append(_lane(k, v * t, v * seconds, depth))
        t += seconds + k.between(*DRY_GAP_S)
    drive = k.drive(t + 4.0, ((0.0, v),), lanes=tuple(lanes))
    note = f"{vehicle.name}, {k.tyre.name}, {depth * 1e3:.1f} mm, {v / KMH:.0f} of {v_full / KMH:.0f} km/h"
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


def dry(name: str, seed: int, pool):
    """Seconds and episodes of aquaplaning of a dry drive."""
    drawn = draw(name, seed, pool)
    signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
    judgement = detect_drive(signals, drawn.believed, samples=False).judgement
    return signals.duration_s, [(drawn.note, e) for e in judgement.of("aquaplaning")]


NUISANCES = tuple(n for n, s in SITUATIONS.items() if s.kind == "nuisance")
_OTHER_ROADS = ("damp", "snow", "ice", "gravel", "split")
DRY = tuple(n for n in NUISANCES if not any(road in n for road in _OTHER_ROADS))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=0)
    parser.add_argument("--dry-hours", type=float, default=0.0)
    parser.add_argument("--others", action="store_true")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--pool", choices=tuple(POOLS), default="scoring")
    a = parser.parse_args()
    pool, seed, done = POOLS[a.pool], a.first, []
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
    seconds, alarms = 0.0, 0
    while seconds < 3600.0 * a.dry_hours:
        for name in NUISANCES if a.others else DRY:
            t, found = dry(name, seed, pool)
            seconds, alarms = seconds + t, alarms + len(found)
            for note, e in found:
                print(name, seed, note, f"{e.start_s:.1f}-{e.end_s:.1f}", e.decided_by, flush=True)
        seed += 1
    if seconds:
        print(f"{seconds / 3600.0:.1f} h dry, seeds from {a.first}: {alarms} episodes of aquaplaning")


if __name__ == "__main__":
    main()
