"""Effect of an extended model for the user: false alarms on dry road, and latency on water."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import DriveResult, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import detect_drive
from aqualog.diagnose.extended import extended_inputs
from aqualog.diagnose.records import Consequence
from aqualog.diagnose.threads import beside
from aqualog.evaluate.drives import labels_in
from aqualog.evaluate.judge import LIMITS_S, beginning_in, hits
from aqualog.evaluate.labels import Labels, Span, joined, without
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


class _Seen(NamedTuple):
    """One detector on one drive: false alarms, and the latency of its pass: NaN if not found; None without a pass."""

    false_alarms: int
    latency_s: float | None


def consequences(
    vehicle: Vehicle, model: Model, *, seed: int = 1, progress: Callable[[str], None] = lambda _: None
) -> tuple[Consequence, ...]:
    """Detectors on simulated drives of the extended model, without and with it.

    The car of the model makes the drives of `DRY` and passes the water of `PASSES`: 1.3 mm under worn tyres, after 15 s
    of dry road. Each drive is judged with the vehicle file alone and with the model in it.

    Parameters
    ----------
    vehicle : Vehicle
    model : Model
        Terms of the simulated car, which the second judgement also knows.
    seed : int
        Of roads, weather, drivers and sensors, >= 0.
    progress : callable
        Called with the name of each step.

    Returns
    -------
    tuple of Consequence
        One per detector of `DETECTORS` that could run. A pass counts if a wheel floats, and as found if an event begins
        on its water no later than 2 s after that; the latencies are means over the passes found both times, None
        without any. An event outside of water and of the second after it is a false alarm; `distance_km` is the
        distance driven outside of them.

    Raises
    ------
    ConfigError
        If the car cannot drive with the terms of the model.
    """

    def one(numbered: tuple[int, Scenario]) -> _Pair:
        number, scenario = numbered
        progress(f"drive {number} of {len(DRY) + len(PASSES)} with the extended model")
        # twice the usual step of a simulation: half the time, the same alarms
        signals = as_signals(simulate(scenario, model, dt=2e-3), vehicle=vehicle)
        return _both(signals, vehicle, model, labels_in(signals))

    return _summed(beside(one, enumerate(_scenarios(vehicle, seed), 1)))


class _Pair(NamedTuple):
    """Both judgements of one drive, by detector that ran in both, and the dry distance [m]."""

    before: dict[str, _Seen]
    after: dict[str, _Seen]
    metres: float


def _both(signals: Signals, vehicle: Vehicle, model: Model, labels: Labels | None) -> _Pair:
    extended = extended_inputs(signals, vehicle, model)
    plain = detect_drive(signals, vehicle)
    informed = detect_drive(extended.signals, extended.vehicle)
    t = signals.array("t")
    water = labels.water_widened if labels is not None else []
    dry = without([(float(t[0]), float(t[-1]) + signals.dt)], water)
    return _Pair(_look(plain, labels, dry), _look(informed, labels, dry), _metres(plain, dry))


def _look(result: DriveResult, labels: Labels | None, dry: Sequence[Span]) -> dict[str, _Seen]:
    off = {u.detector for u in result.unavailable}
    floating = labels.afloat if labels is not None else []
    out = {}
    for detector in DETECTORS:
        if detector in off:
            continue
        events = joined(((e.start_s, e.end_s) for e in result.events if e.detector == detector), 0.0)
        latency = None
        if labels is not None and floating:
            episode = (floating[0][0], floating[-1][1])
            hit = hits([episode], events, limit=LIMITS_S["partial"], water=labels.water)[0]
            latency = hit.latency if hit.found else float("nan")
        out[detector] = _Seen(len(beginning_in(events, dry)), latency)
    return out


def _metres(result: DriveResult, dry: Sequence[Span]) -> float:
    t = result.signals.array("t")
    v = result.features["v_x_hat"].to_numpy() if "v_x_hat" in result.features.columns else np.zeros(t.size)
    is_dry = np.any([(t >= a) & (t < b) for a, b in dry], axis=0) if dry else np.zeros(t.size, dtype=bool)
    return float(np.nansum(v[is_dry]) * result.signals.dt)


def _summed(seen: Sequence[_Pair]) -> tuple[Consequence, ...]:
    out = []
    for detector in DETECTORS:
        pairs = [(s.before[detector], s.after[detector], s.metres) for s in seen if detector in s.before]
        if not pairs:
            continue
        passes = [
            (b.latency_s, a.latency_s) for b, a, _ in pairs if b.latency_s is not None and a.latency_s is not None
        ]
        both = np.array([x for x in passes if np.isfinite(x).all()])
        found = np.isfinite(np.array(passes)).sum(axis=0) if passes else (0, 0)
        latency = both.mean(axis=0) if both.size else None
        out.append(
            Consequence(
                detector=detector,
                false_alarms_before=sum(b.false_alarms for b, _, _ in pairs),
                false_alarms_after=sum(a.false_alarms for _, a, _ in pairs),
                distance_km=sum(m for _, _, m in pairs) / 1e3,
                latency_before_s=None if latency is None else float(latency[0]),
                latency_after_s=None if latency is None else float(latency[1]),
                found_before=int(found[0]),
                found_after=int(found[1]),
                passes=len(passes),
            )
        )
    return tuple(out)


def _scenarios(vehicle: Vehicle, seed: int) -> Iterable[Scenario]:
    for i, name in enumerate(DRY):
        yield SITUATIONS[name].make(_drawing(vehicle, seed, i)).scenario
    for i, share in enumerate(PASSES):
        yield _pass(_drawing(vehicle, seed, len(DRY) + i), share, A_ON_LANE if i % 2 else 0.0)


def _drawing(vehicle: Vehicle, seed: int, number: int) -> Drawing:
    rng = np.random.default_rng([seed, number])
    return Drawing(rng, TUNING_POOL, vehicle, TYRES["worn_summer"], P_LOW, int(rng.integers(2**31)))


def _pass(k: Drawing, share: float, a: float) -> Scenario:
    v = min(share * full_speed(k, DEPTH), V_MOST)
    t = APPROACH_S + ON_LANE_S
    speed: Profile = ((0.0, v), (APPROACH_S, v), (t, v + a * ON_LANE_S), (t + RUN_OUT_S, v + a * ON_LANE_S))
    left, uneven = k.between(0.6, 1.0), k.between(0.05, 0.3)
    lane = Lane(APPROACH_S, t, depth_left=left * DEPTH, depth_right=DEPTH, irregularity_left=uneven)
    return k.drive(t + RUN_OUT_S, speed, lanes=(lane,))
