"""A campaign's runs as the few numbers that the diagnosis compares: slip and resistance on water against dry."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.campaign.definition import loads_of
from aqualog.campaign.means import dry_level
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.campaign.slip_slope import WIND_UP
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.campaign.expect import S_MAX, Driven, Response, respond
from aqualog.diagnose.hypotheses import Hypothesis, room_of, value_in, with_values
from aqualog.diagnose.tolerances import LANE_TOLERANCES
from aqualog.model.effects import EFFECTS
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import assemble
from aqualog.model.term import Model
from aqualog.model.tyre import TYRES

__all__ = ["RESISTANCE", "Passes", "Told", "doubted", "expected_values", "floats", "passes_of", "question_of", "steady"]

RESISTANCE = "resistance"
LOST_MAX = 0.01  # share of the fluctuation at which a wheel spins; beyond, no steady expectation holds
STEADY = 0.015  # relative error of the steady expectation against the simulation, measured on runs without effect
# of the file's depths; lost contact and drag have the tolerance of single drives, a factor of two
LABEL = 0.15
ALIKE = 0.05  # relative spread of depths and speeds of all runs, below which a law has no other form there
PART = 0.25  # of a tolerance, at which its column is computed
FRICTION = 0.2  # relative: "known to 10 or 20 %"; it also covers the shape of the curve
CONTACT_MIN = 0.3  # [-] of any wheel; below, the passage to full aquaplaning is not steady
LEAST_S = 1.0  # [s] of usable driving on the water, and off it
THINNED = 3  # samples between evaluations of the model: slip and traction are means over 0.3 s
Index = NDArray[np.int64]


class Question(NamedTuple):
    """Samples (n,) of all runs, evaluated in one call of the model, each with its `run` and `wet`."""

    run: NDArray[np.int64]
    wet: BoolArray
    driven: Driven


class Told(NamedTuple):
    """A run: configuration and driving state, and its mean observations by name. `late`, `grown`: slip added by one
    second of delay of v_x [1/s] and by radii that grow by 1e-3 s²/m² v², each as (on dry road, on water minus dry
    road); `seconds` of driving on water that were used."""

    info: RunInfo
    scenario: Scenario
    dry: Driven
    wet: Driven | None
    values: dict[str, float]
    late: tuple[float, float]
    grown: tuple[float, float]
    seconds: float


@dataclass(frozen=True, slots=True)
class Passes:
    """Observations of a campaign, one row per run `told` (g,): `values` (g, c) by `names` (c,), else NaN.

    For each driven wheel `slip_slope_<w>`: mean slip on water minus mean slip on dry road, and `dry_<w>`: mean slip on
    dry road [-]; `resistance`: mean resistance measure on water minus the run's dry level [m/s²]. `coordinates` by name
    (g,): `v_x`, `depth` [m], `load`, `pressure`; `nuisances` (g, c, k): columns whose size is free; `left_out`: runs,
    by reason.
    """

    names: tuple[str, ...]
    values: FloatArray
    told: tuple[Told, ...]
    coordinates: Mapping[str, FloatArray]
    nuisances: FloatArray
    seconds: FloatArray
    left_out: Mapping[str, int]
    question: Question


def question_of(told: Sequence[Told]) -> Question:
    """All samples of the runs together, so that one call of the model evaluates them."""
    parts = [(r, w, d) for r, t in enumerate(told) for w, d in ((False, t.dry), (True, t.wet)) if d is not None]
    parts = parts or [(0, False, Driven(np.zeros(0), np.zeros(0), np.zeros((4, 0))))]
    sizes = [d.v.size for _, _, d in parts]
    joined = Driven(*(np.concatenate(x, axis=-1) for x in zip(*(d for _, _, d in parts), strict=True)))
    return Question(np.repeat([r for r, _, _ in parts], sizes), np.repeat([w for _, w, _ in parts], sizes), joined)


def doubted(passes: Passes, base: Model) -> Passes:
    """The same runs with columns before the free ones, for what the expectation is off by in all runs alike
    (`refit.prior_of`).

    The steady expectation is accurate to `STEADY`, of slips and resistance each, friction to `FRICTION`, depths to
    `LABEL`. Lost contact and drag of an axle follow a law that is known as on single drives, or as well as the vehicle
    file was calibrated. All of these may change with depth and speed by what a lane may differ from the others.
    """
    expected = expected_values(passes, base)[0]
    columns = np.zeros((3, *expected.shape))
    columns[0, :, :-1] = np.nan_to_num(STEADY * expected[:, :-1])
    columns[1, :, -1] = np.nan_to_num(STEADY * expected[:, -1])
    columns[2] = np.nan_to_num(expected_values(passes, base, friction=1.0 + FRICTION)[0] - expected)
    columns[0, :, [n.startswith("dry_") for n in passes.names]] = 0.0
    apart = [_standardised(passes.coordinates[n]) for n in ("depth", "v_x")]
    laws = []
    for (name, where), lane in LANE_TOLERANCES.items():
        effect, sd = EFFECTS[name], lane.parameters[0].sigma
        p = effect.parameters[0]
        room = room_of(effect, where, passes.told[0].scenario.vehicle, wheels=True)
        h = Hypothesis(effect, where, (p.name,), room=room)
        off = with_values(base, [(h, {p.name: value_in(base, h, p.name) + PART * sd})])
        one = np.nan_to_num(expected_values(passes, off)[0] - expected) / PART
        shared = LABEL if effect.drive.tolerance is None else h.tolerance(p.name)
        laws += [one * shared / sd, *(math.sqrt(0.5) * one * x[:, None] for x in apart)]
    out = np.moveaxis(np.concatenate([columns, laws]), 0, -1)
    return replace(passes, nuisances=np.concatenate([out, passes.nuisances], axis=-1))


def _standardised(x: FloatArray) -> FloatArray:
    """The logarithm of a coordinate (g,) about its mean, over its deviation; 0 where all runs share it, or unknown."""
    known = np.log(np.maximum(x, 1e-6))
    spread = float(np.nanstd(known))
    return np.nan_to_num((known - np.nanmean(known)) / spread) if spread > ALIKE else np.zeros_like(known)


def _responses(passes: Passes, model: Model, friction: float = 1.0) -> Response:
    q, setups = passes.question, [assemble(t.scenario, model) for t in passes.told]
    setups = [s._replace(plant=s.plant._replace(mu=friction * s.plant.mu)) for s in setups]
    return respond(setups, q.run, q.wet, q.driven)


def floats(found: Response, here: BoolArray) -> bool:
    """Whether a wheel keeps too little contact in some samples (n,) for their steady expectation to hold."""
    lost, contact = found.lost.max(axis=0)[here], found.contact.min(axis=0)[here]
    return bool(lost.mean() > LOST_MAX or contact.mean() < CONTACT_MIN)


def steady(passes: Passes, model: Model) -> Passes:
    """Runs without values where a wheel keeps too little contact by a model for its steady expectation to hold."""
    q, found = passes.question, _responses(passes, model)
    wet = set(q.run[q.wet].tolist())
    gone = np.array([r in wet and floats(found, (q.run == r) & q.wet) for r in range(len(passes.told))])
    if not gone.any():
        return passes
    return replace(
        passes, values=np.where(gone[:, None], np.nan, passes.values), seconds=np.where(gone, 0.0, passes.seconds),
        left_out={**passes.left_out, "a wheel floats in the model that was found": int(gone.sum())},
    )  # fmt: skip


def expected_values(passes: Passes, model: Model, *, friction: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Expected observations of a model (g, c), and their variances (g, c) by the road's fluctuation; `friction`: factor
    on that of all wheels."""
    q, found = passes.question, _responses(passes, model, friction)
    values, variances = np.full((2, *passes.values.shape), np.nan)
    g = len(passes.told)

    def means(x: FloatArray, *, wet: bool) -> FloatArray:
        """Mean of each run; NaN where it has no such samples."""
        use = (q.wet == wet) & np.isfinite(x)
        count = np.bincount(q.run[use], minlength=g)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.bincount(q.run[use], x[use], g) / count)

    for c, name in enumerate(passes.names):
        if name == RESISTANCE:
            mean, variance = (means(x, wet=True) for x in (found.resistance, found.resistance_variance))
        else:
            i = WHEELS.index(name[-2:])
            mean, variance = means(found.slip[i], wet=False), np.zeros(g)
            if not name.startswith("dry_"):
                mean, variance = means(found.slip[i], wet=True) - mean, means(found.slip_variance[i], wet=True)
        values[:, c], variances[:, c] = mean, variance
    # of a run's mean relative to one point of its lane: correlation length over distance
    for r, told in enumerate(passes.told):
        way = float(np.mean(told.wet.v)) * float(passes.seconds[r]) if told.wet is not None else math.inf
        variances[r] *= min(2.0 * told.scenario.tyre_front.scatter_length / max(way, 1.0), 1.0)
    return values, variances


def passes_of(data: CampaignData) -> Passes:
    """Observations of all runs that are done and whose configuration the model knows, each the means of its samples. A
    run is left out where a wheel of the base model loses nearly all of its contact: the measurement plays no part in
    the choice."""
    left_out: Counter[str] = Counter()
    rows: list[Told] = []
    for info in data.done:
        found = _row(data, info)
        if isinstance(found, str):
            left_out[found] += 1
        else:
            rows.append(found)
    wheels = [w for w in WHEELS if any(w in r.info.vehicle.driven for r in rows)]
    names = (*(f"slip_slope_{w}" for w in wheels), *(f"dry_{w}" for w in wheels), RESISTANCE)
    values = np.array([[r.values.get(n, np.nan) for n in names] for r in rows]).reshape(len(rows), len(names))
    return Passes(
        names, values, tuple(rows), _coordinates(rows), _nuisances(rows, names), np.array([r.seconds for r in rows]),
        dict(left_out), question_of(rows),
    )  # fmt: skip


def _row(data: CampaignData, info: RunInfo) -> Told | str:
    scenario = _scenario(data, info)
    if isinstance(scenario, str):
        return scenario
    samples = data.samples(info)
    car = info.vehicle
    columns = {w: (samples.array(f"slip_{w}"), samples.array(f"mu_{w}")) for w in car.driven}
    good = samples.is_usable & np.isfinite(samples.array("v_x"))
    for slip, mu in columns.values():
        good &= np.isfinite(slip + mu) & (np.abs(slip) < S_MAX) & (np.abs(mu) < WIND_UP)
    if not good.any():
        return "no straight driving with slip and traction of the driven wheels"
    dry, wet = (np.flatnonzero(good & (samples.on_water == x)) for x in (0.0, 1.0))
    least = LEAST_S / samples.step_s
    if dry.size < least:
        return f"less than {LEAST_S:g} s of dry driving"
    values = {f"dry_{w}": float(np.mean(slip[dry])) for w, (slip, _) in columns.items()}
    asked = None
    if scenario.lanes and wet.size >= least:
        asked = _driven(samples, car, wet)
        every = np.ones(asked.v.size, dtype=np.bool_)
        if floats(respond([assemble(scenario)], np.zeros(every.size, int), every, asked), every):
            return "the model lets a wheel float nearly or fully: no steady slip"
        values |= {f"slip_slope_{w}": float(np.mean(s[wet])) - values[f"dry_{w}"] for w, (s, _) in columns.items()}
        delta = samples.array("delta_a_x")
        level = dry_level(samples, delta)
        if level is not None and np.isfinite(delta[wet]).any():
            values[RESISTANCE] = float(np.nanmean(delta[wet])) - level
    elif scenario.lanes:
        return f"less than {LEAST_S:g} s of steady driving on the water"
    late, grown = (_change(x, dry, wet) for x in (samples.array("a_over_v"), 1e-3 * samples.array("v_x") ** 2))
    driven = _driven(samples, car, dry)
    return Told(info, scenario, driven, asked, values, late, grown, float(wet.size * samples.step_s))


def _change(x: FloatArray, dry: Index, wet: Index) -> tuple[float, float]:
    """Mean of a column on dry road, and on water minus dry road; 0 where it is not known."""
    if not np.isfinite(x[dry]).any():
        return 0.0, 0.0
    level = float(np.nanmean(x[dry]))
    return level, float(np.nanmean(x[wet])) - level if wet.size and np.isfinite(x[wet]).any() else 0.0


def _scenario(data: CampaignData, info: RunInfo) -> Scenario | str:
    """The run as a scenario of the simulation: car, tyres, pressures, loads and an endless lane."""
    told = info.run.values
    tyre = TYRES.get(str(told.get("tyre", "")))
    if tyre is None:
        return f"tyre not known to the model: {told.get('tyre', 'not given')}, it knows {', '.join(TYRES)}"
    front, rear = (told.get(f"pressure_{axle}_bar") for axle in ("front", "rear"))
    if not isinstance(front, float) or not isinstance(rear, float):
        return "the tyre pressures are not given"
    depth = told.get("water_depth_mm")
    if not isinstance(depth, float):
        return "the water depth is not given"
    left = told.get("water_depth_left_mm", depth)
    car = data.configured.vehicles[info.run.vehicle]
    loads = loads_of(info.run)
    lanes = (Lane(0.0, 1e9, depth_left=float(left) * 1e-3, depth_right=depth * 1e-3),) if depth > 0.0 else ()
    return Scenario(car, tyre, tyre, front * 1e5, rear * 1e5, loads[0], loads[1], lanes=lanes)


def _driven(samples: RunSamples, car: Vehicle, index: Index) -> Driven:
    few = index[:: THINNED if index.size >= 4 * THINNED else 1]
    v, a = samples.array("v_x")[few], samples.array("a_x")[few]
    rolling = -car.rolling_resistance
    mu = np.stack([samples.array(f"mu_{w}")[few] if w in car.driven else np.full(few.size, rolling) for w in WHEELS])
    return Driven(v, np.nan_to_num(a), mu)


def _coordinates(rows: Sequence[Told]) -> dict[str, FloatArray]:
    def of(key: str) -> FloatArray:
        return np.array([float(r.info.run.values.get(key, 0.0)) for r in rows])

    speed = [float(np.mean((r.wet or r.dry).v)) for r in rows]
    return {
        "v_x": np.array(speed), "depth": 1e-3 * of("water_depth_mm"), "pressure": 1e5 * of("pressure_rear_bar"),
        "load": of("load_front_kg") + of("load_rear_kg"),
    }  # fmt: skip


def _nuisances(rows: Sequence[Told], names: Sequence[str]) -> FloatArray:
    """Free sizes: a radius error of each wheel in each configuration, growth of the radii, and delay of v_x."""
    keys = ("tyre", "pressure_front_bar", "pressure_rear_bar", "load_front_kg", "load_rear_kg")
    groups = [(r.info.run.vehicle.stem, *(str(r.info.run.values.get(k)) for k in keys)) for r in rows]
    known = list(dict.fromkeys(groups))
    dry = [i for i, n in enumerate(names) if n.startswith("dry_")]
    width = len(known) * len(dry) + 2
    out = np.zeros((len(rows), len(names), width))
    for r, row in enumerate(rows):
        for k, c in enumerate(dry):
            out[r, c, known.index(groups[r]) * len(dry) + k] = 1.0
            wet = c - len(dry)
            out[r, c, -2:] = row.grown[0], row.late[0]
            out[r, wet, -2:] = row.grown[1], row.late[1]
    return out
