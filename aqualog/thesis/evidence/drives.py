"""Drawn situations under the detectors, with and without the gate, and how an alarm scores on them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

import numpy as np

from aqualog.core.errors import SignalError
from aqualog.core.intervals import poisson, wilson
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, DriveResult, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import hold_on
from aqualog.detect.joint_criteria import CRITERIA, GATED
from aqualog.detect.stream import Settings, detect_drive
from aqualog.evaluate.drives import labels_in
from aqualog.evaluate.judge import LIMITS_S, beginning_in, hits
from aqualog.evaluate.labels import Labels, Span, joined, spans_of, without
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import simulate
from aqualog.model.situations import SCORING_POOL, SITUATIONS, draw
from aqualog.model.term import Model
from aqualog.thesis.evidence.seeds import Plan, spread_over

__all__ = [
    "NUISANCE", "WATER", "Score", "Taken", "bits_of", "detected", "drives", "made", "score", "scored", "threshold_for",
    "variants",
]  # fmt: skip

WATER = tuple(n for n, s in SITUATIONS.items() if s.kind == "aquaplaning")
NUISANCE = tuple(n for n, s in SITUATIONS.items() if s.kind == "nuisance")
T = TypeVar("T")
_GAP_S = 1.0  # alarms closer than that are one


@dataclass(frozen=True, slots=True)
class Taken:
    """One drive as detectors see it, with the truth for the judgement.

    `signals` has no truth; `truth` the true slip and contact of each wheel, `slip_fl`, `contact_fl`, arrays (n,) [-];
    `t` (n,) [s]; `dry` the stretches outside water and the second after it.
    """

    name: str
    seed: int
    vehicle: Vehicle
    signals: Signals
    labels: Labels
    truth: Mapping[str, FloatArray]
    t: FloatArray
    dry: tuple[Span, ...]


def made(name: str, seed: int, scenario: Scenario, believed: Vehicle, model: Model | None = None) -> Taken:
    """Drive a scenario; `believed` is the car as the vehicle file has it."""
    signals = as_signals(simulate(scenario, model or Model()), vehicle=believed)
    labels = labels_in(signals)
    if labels is None:
        raise SignalError("a simulated drive without its truth", where=name)
    truth = {f"{what}_{w}": signals.array(f"true_{what}_{w}") for what in ("slip", "contact") for w in WHEELS}
    seen = [c for c in signals.frame.columns if not c.startswith("true_")]
    dry = tuple(without([(0.0, signals.frame.height * signals.dt)], labels.water_widened))
    return Taken(
        name, seed, believed, replace(signals, frame=signals.frame.select(seen)), labels, truth, signals.array("t"), dry
    )


_TAKEN: dict[tuple[str, int], Taken] = {}


def taken(name: str, seed: int) -> Taken:
    """A drive of a situation, of the pool that is for reported figures only; made once in a process."""
    if (name, seed) not in _TAKEN:
        _TAKEN[name, seed] = _take((name, seed))
    return _TAKEN[name, seed]


def _take(item: tuple[str, int]) -> Taken:
    d = draw(*item, SCORING_POOL)
    return made(*item, d.scenario, d.believed, d.model)


def drives(names: Iterable[str], plan: Plan, n: int) -> list[Taken]:
    """Every situation at the first n seeds of a plan, by as many processes as it allows."""
    wanted = [(name, seed) for name in names for seed in plan.first(n)]
    todo = [item for item in wanted if item not in _TAKEN]
    _TAKEN.update(zip(todo, spread_over(_take, todo, plan, "drives"), strict=True))
    return [_TAKEN[item] for item in wanted]


def detected(d: Taken, settings: Settings | None = None) -> DriveResult:
    """The drive under all detectors."""
    return detect_drive(d.signals, d.vehicle, settings=settings)


def starts(bits: BoolArray) -> list[int]:
    """Samples at which a bit goes on."""
    return [int(k) for k in np.flatnonzero(np.diff(np.concatenate([[False], bits]).astype(np.int8)) > 0)]


@dataclass(frozen=True, slots=True)
class Score:
    """Episodes and those found in time; alarms begun outside water, and over which time [s]."""

    found: int
    episodes: int
    false: int
    dry_s: float

    @property
    def recall(self) -> float:
        """Share of the episodes found; 0 without any."""
        return self.found / self.episodes if self.episodes else 0.0

    def in_words(self) -> str:
        """Recall and false alarms with their intervals."""
        low, high = wilson(self.found, self.episodes)
        few, many = poisson(self.false)
        return (
            f"{self.found} of {self.episodes} found ({100 * low:.0f} to {100 * high:.0f} %), {self.false} false "
            f"alarms in {self.dry_s / 3600:.1f} h ({few:.0f} to {many:.0f})"
        )


def score(
    water: Sequence[tuple[Taken, BoolArray]], other: Sequence[tuple[Taken, BoolArray]], effect: str = "full"
) -> Score:
    """Score an alarm bit of drives on water (episodes of `effect`, "full" or "partial") and of all others.

    False alarms are those of the others: a car that has spun on water says little about a dry road.
    """
    found = episodes = false = 0
    seconds = 0.0
    for d, bits in water:
        spans = spans_of(d.t, bits)
        all_hits = hits(d.labels.of(effect), spans, limit=LIMITS_S[effect], water=d.labels.water_widened)
        found += sum(h.found for h in all_hits)
        episodes += len(all_hits)
    for d, bits in other:
        alarms = joined(spans_of(d.t, bits), _GAP_S)
        false += len(beginning_in(alarms, d.dry))
        seconds += sum(b - a for a, b in d.dry)
    return Score(found, episodes, false, seconds)


def scored(
    water: Sequence[tuple[Taken, T]], other: Sequence[tuple[Taken, T]], bits: Callable[[Taken, T, float], BoolArray],
    effect: str = "full",
) -> Callable[[float], Score]:  # fmt: skip
    """`score` over a threshold; `bits` of a drive, of what is known of it, and of the threshold."""
    return lambda x: score([(d, bits(d, k, x)) for d, k in water], [(d, bits(d, k, x)) for d, k in other], effect)


def threshold_for(recall: float, values: Sequence[float], of: Callable[[float], Score]) -> tuple[float, Score]:
    """The largest threshold whose recall is at least that, and its score; where none has it, the one of largest recall.

    A small threshold may find less than a larger one: an alarm that is on before the water does not count.
    """
    scores = [(value, of(value)) for value in sorted(values)]
    enough = [x for x in scores if x[1].recall >= recall]
    return enough[-1] if enough else max(scores, key=lambda x: x[1].recall)


_HOLD_S = 0.5  # [s] as long as a joint warning outlasts its criteria


@lru_cache(maxsize=320)
def variants(name: str, seed: int) -> Mapping[str, BoolArray]:
    """Bits (n,) of a drawn drive by the name of a variant.

    `joint_criteria`, `ungated` (criteria 1 to 4 without the gate), `gate`, `resistance`, `criterion_1` to
    `criterion_5`, `spin_up`, `spin_down` (criterion 1 under braking forces too) and `slope`.
    """
    return bits_of(taken(name, seed))


def bits_of(d: Taken) -> Mapping[str, BoolArray]:
    """As `variants`, of any drive."""
    result = detected(d)
    none = np.zeros(d.t.size, dtype=np.bool_)

    def feature(name: str) -> BoolArray:
        return result.features[name].to_numpy() > 0.0 if name in result.features.columns else none

    out = {f"criterion_{k}": feature(f"criterion_{k}") for k in CRITERIA.values()} | {"gate": feature("joint_gate")}
    for name in ("joint_criteria", "joint_cusum", "resistance", "spin_down", "spin_up", "slip_slope_drop"):
        out[name] = np.any([none, *(t.active for t in result.tracks if t.detector == name)], axis=0)
    out["slope"] = out.pop("slip_slope_drop")
    met = np.any([out[f"criterion_{k}"] for k in GATED], axis=0)
    out["ungated"], _ = hold_on(met, 0, seconds=_HOLD_S, dt=d.signals.dt)
    return out
