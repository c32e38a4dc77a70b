"""A campaign's samples into observations: one row per run, and how each run was driven."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aqualog.campaign.definition import loads_of
from aqualog.campaign.means import dry_level
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.campaign.slip_slope import WIND_UP
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.campaign.expect import S_MAX, Driven, respond
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes, Told, floats, question_of
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import assemble
from aqualog.model.tyre import TYRES

__all__ = ["passes_of"]

LEAST_S = 1.0  # [s] of usable driving on the water, and off it
THINNED = 3  # samples between evaluations of the model: slip and traction are means over 0.3 s
Index = NDArray[np.int64]


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
