"""Effect of an extended model for the user: false alarms on dry road, and latency on water."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.extended import extended_inputs
from aqualog.diagnose.records import Consequence
from aqualog.diagnose.threads import beside
from aqualog.evaluate.drives import Drive, labels_in
from aqualog.evaluate.judge import judge
from aqualog.evaluate.labels import Label, Labels
from aqualog.evaluate.records import RunRecord
from aqualog.model.drawing import KMH, TUNING_POOL, Drawing, full_speed
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane, Profile, Scenario
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS
from aqualog.model.term import Model
from aqualog.model.tyre import TYRES

__all__ = ["DETECTORS", "DRY", "PASSES", "consequences"]

DETECTORS = ("resistance", "joint_criteria", "joint_cusum")
DRY = (
    "hard_acceleration", "dry_cruise", "motorway", "hilly", "hard_acceleration", "gear_shifts", "cornering_limit",
    "stop_and_go", "hard_acceleration", "rough_asphalt",
)  # fmt: skip
"""Situations of the dry drives, 30 to 120 s each: together they show every error of a wrong vehicle file."""
PASSES = (0.76, 0.78, 0.80, 0.82, 0.84, 0.86, 0.88, 0.92, 0.96, 1.0)
"""Speed of each wet pass over that of full aquaplaning; every second one speeds up on the water."""

P_LOW = 1.9e5  # [Pa] worn tyres at the low pressure class of the thesis' runs
DEPTH = 1.3e-3  # [m]
V_MOST = 150.0 * KMH  # [m/s] upper limit, also for a car that would float only at a higher speed
APPROACH_S, ON_LANE_S, RUN_OUT_S = 15.0, 3.0, 5.0
A_ON_LANE = 0.8  # [m/s^2]


def consequences(vehicle: Vehicle, model: Model, *, seed: int = 1) -> tuple[Consequence, ...]:
    """Detectors on simulated drives of a model, without and with it: one for each of `DETECTORS` that could run.

    The car of the model makes the drives of `DRY` and passes the water of `PASSES`: 1.3 mm under worn tyres, after 15 s
    of dry road. A pass counts if a wheel floats, and as found if an event begins on its water no later than 2 s after
    that. The latencies are means over the passes found both times, None without any. An event outside of water and of
    the second after it is a false alarm; `distance_km` is the distance driven outside of them. `seed` >= 0. ConfigError
    if the car cannot drive with the terms of the model.
    """

    def one(scenario: Scenario) -> tuple[RunRecord, RunRecord]:
        # twice the usual step of a simulation: half the time, the same alarms
        signals = as_signals(simulate(scenario, model, dt=2e-3), vehicle=vehicle)
        extended, labels = extended_inputs(signals, vehicle, model), _of_one_pass(labels_in(signals))
        known = (signals, vehicle), (extended.signals, extended.vehicle)
        before, after = (judge(Drive("", s, v, labels), is_checked=False) for s, v in known)
        return before, after

    def drawing(number: int) -> Drawing:
        rng = np.random.default_rng([seed, number])
        return Drawing(rng, TUNING_POOL, vehicle, TYRES["worn_summer"], P_LOW, int(rng.integers(2**31)))

    scenarios = [SITUATIONS[name].make(drawing(i)).scenario for i, name in enumerate(DRY)]
    scenarios += [_pass(drawing(len(DRY) + i), x, A_ON_LANE if i % 2 else 0.0) for i, x in enumerate(PASSES)]
    seen = beside(one, scenarios)
    return tuple(_summed(d, own) for d in DETECTORS if (own := [p for p in seen if all(d in r.detectors for r in p)]))


def _of_one_pass(labels: Labels | None) -> Labels:
    """The labels with one episode from the first to the last wheel that floats, however many they are."""
    if labels is None:
        return Labels((), frozenset(), "")
    water = tuple(Label(a, b, "water") for a, b in labels.water)
    episode = (Label(labels.afloat[0][0], labels.afloat[-1][1], "partial"),) if labels.afloat else ()
    return replace(labels, items=water + episode)


def _summed(detector: str, pairs: Sequence[tuple[RunRecord, RunRecord]]) -> Consequence:
    runs = [tuple(r.detectors[detector] for r in p) for p in pairs]
    hits = [tuple(r.partial[0] for r in p) for p in runs if p[0].partial]
    latencies = np.array([[h.latency for h in p] for p in hits if all(h.found for h in p)])
    latency = latencies.mean(axis=0).tolist() if latencies.size else (None, None)
    found = [sum(p[i].found for p in hits) for i in range(2)]
    alarms = [sum(len(p[i].false_alarms) for p in runs) for i in range(2)]
    metres = sum(before.dry_m for before, _ in pairs)
    return Consequence(
        detector, alarms[0], alarms[1], metres / 1e3, latency[0], latency[1], found[0], found[1], len(hits)
    )  # fmt: skip


def _pass(k: Drawing, share: float, a: float) -> Scenario:
    v = min(share * full_speed(k, DEPTH), V_MOST)
    t = APPROACH_S + ON_LANE_S
    speed: Profile = ((0.0, v), (APPROACH_S, v), (t, v + a * ON_LANE_S), (t + RUN_OUT_S, v + a * ON_LANE_S))
    left, uneven = k.between(0.6, 1.0), k.between(0.05, 0.3)
    lane = Lane(APPROACH_S, t, depth_left=left * DEPTH, depth_right=DEPTH, irregularity_left=uneven)
    return k.drive(t + RUN_OUT_S, speed, lanes=(lane,))
