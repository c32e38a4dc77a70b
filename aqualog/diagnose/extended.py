"""Applies the terms of a model to the detectors' inputs: the vehicle that they assume and the signals they read."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.model.plant import Plant, build_plant
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import ESC, Channel, Sensors, of_place
from aqualog.model.term import Model, Setup, Term
from aqualog.model.tyre import TYRES
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.resistance import air_drag, cornering_drag
from aqualog.physics.rolling import effective_radius, warm_up_factor

__all__ = ["Extended", "extended_inputs"]

# fields of the plant that reach a detector, through the vehicle or through a signal
_VEHICLE = frozenset({
    "mass", "l_f", "l_r", "drag_area", "inertia", "r_w", "brake_drag", "slip_slope", "r_e", "r_l",
})  # fmt: skip
_SIGNAL = frozenset({
    "torque_gain", "radius_growth", "leak_radius", "head_wind", "towed_mass", "cornering_drag", "warmup_extra",
    "drag_over_v",
})  # fmt: skip
# have no effect by themselves, or follow from the others
_SILENT = frozenset({"I_zz", "warmup_time", "leak_start", "leak_time"})
_FORCES = frozenset({"head_wind", "towed_mass", "cornering_drag", "warmup_extra", "drag_over_v"})


class Extended(NamedTuple):
    """Inputs of the detectors with a model's terms in them; `notes` list terms that could not be used, or only in
    part."""

    signals: Signals
    vehicle: Vehicle
    notes: tuple[str, ...]


def extended_inputs(signals: Signals, vehicle: Vehicle, model: Model) -> Extended:
    """Signals as loaded with `vehicle`, and vehicle, for the detectors, with the terms of a model taken into account;
    the given objects themselves without any, or with neutral ones only.

    Terms for which the vehicle file has a key change the vehicle; ConfigError if beyond its limits. Others change the
    signals: a sensor's error is removed, a wheel whose radius differs from its axle's is converted to that radius. A
    force that slows the car (wind, trailer, cold tyres, curves) is added to the accelerometer, which then shows the car
    without it.
    """
    # the simulation of the vehicle file, with perfect sensors on the buses of a series car
    worn = TYRES["worn_summer"]
    base = Setup(build_plant(vehicle, worn, worn), Sensors("believed", ESC.groups), Scenario(vehicle))
    terms = tuple(t for t in model.terms if not _is_neutral(t))
    setup = Model(terms).apply(base)
    own = {s: signals.array(s) for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height}
    measured = _Measured(signals.array("t"), signals.dt, dict(own))
    _undo_sensors(measured, setup.sensors)
    notes = [n for t in terms for n in _notes(t, base, measured)]
    car = _vehicle(vehicle, base.plant, setup.plant, notes)
    _undo_wheels(measured, base.plant, setup.plant)
    notes += _undo_forces(measured, base.plant, setup.plant)
    new = {s: x for s, x in measured.columns.items() if x is not own[s]}
    if new:
        import polars as pl

        changed = [pl.Series(s, x, nan_to_null=True) for s, x in new.items()]
        signals = replace(signals, frame=signals.frame.with_columns(changed))
    return Extended(signals, car, tuple(dict.fromkeys(notes)))


def _is_neutral(term: Term) -> bool:
    neutral = {p.name: p.neutral for p in term.effect.parameters}
    flat = all(value == 0.0 for _, value in term.knots)
    return flat and all(value == neutral[name] for name, value in term.values.items())


def _changed(before: Plant, after: Plant) -> set[str]:
    return {n for n in Plant._fields if not np.array_equal(getattr(before, n), getattr(after, n))}


class _Measured(NamedTuple):
    """The columns of a drive that have values, (n,) each, at the times `t` [s]; a changed one takes its place."""

    t: FloatArray
    dt: float
    columns: dict[str, FloatArray]


def _undo_sensors(measured: _Measured, sensors: Sensors) -> None:
    """Remove sensor errors from a signal: gain, bias and drift, then its delay and the drift of its clock, by whole
    samples: interpolated ones would have less noise than the detectors of wheel vibration expect."""
    t, columns = measured.t, measured.columns
    for name, c in sensors.channels.items():
        if c != Channel() and name in columns:
            at_place = c.ahead != 0.0 and "yaw_rate" in columns
            turned = of_place(name, np.nan_to_num(columns["yaw_rate"]), measured.dt) if at_place else 0.0
            columns[name] = (columns[name] - c.bias - c.drift * t) / c.gain - c.ahead * turned
    skew = {name: g.skew_ppm for g in sensors.groups for name in g.signals if g.skew_ppm != 0.0}
    late = {name: c.delay_s for name, c in sensors.channels.items() if c.delay_s != 0.0}
    for name in {**skew, **late}.keys() & columns.keys():
        seen = (t - t[0] + late.get(name, 0.0)) * (1.0 + skew.get(name, 0.0) * 1e-6) / measured.dt
        at, x = np.rint(seen), columns[name]
        inside = (at >= 0.0) & (at < x.size)
        columns[name] = np.where(inside, x[np.where(inside, at, 0.0).astype(np.intp)], np.nan)


def _notes(term: Term, base: Setup, measured: _Measured) -> list[str]:
    """Reason why a term has no effect, or only part of its effect, on the detectors."""
    name = f"model: {term.effect.name}" + (f" at {term.place}" if term.place else "")
    after = term.apply(base)
    changed = _changed(base.plant, after.plant)
    acts_on = {n for n, c in after.sensors.channels.items() if c != base.sensors.channels.get(n, Channel())}
    groups = zip(base.sensors.groups, after.sensors.groups, strict=True)
    acts_on |= {n for before, now in groups if now != before for n in now.signals}
    if acts_on:
        if "ahead" in term.values and "yaw_rate" not in measured.columns:
            return [f"{name}: the log has no yaw_rate; not used"]
        return [] if acts_on & measured.columns.keys() else [f"{name}: the log has no {term.place}; not used"]
    unused = changed - _VEHICLE - _SIGNAL - _SILENT
    if not changed & (_VEHICLE | _SIGNAL):
        return [f"{name}: no detector uses this quantity; not used"]
    return [f"{name}: used without {', '.join(sorted(unused))}"] if unused else []


def _vehicle(vehicle: Vehicle, before: Plant, after: Plant, notes: list[str]) -> Vehicle:
    changed = _changed(before, after)
    new: dict[str, float] = {n: float(getattr(after, n)) for n in ("mass", "l_f", "l_r", "drag_area") if n in changed}
    # the plant's slope is that of a tyre at its pressure, the file's is the car's: only their ratio is the model's
    for name, at_tyre in (("r_e", False), ("r_l", False), ("inertia", False), ("slip_slope", True)):
        if name not in changed:
            continue
        old, now = getattr(before, name), getattr(after, name)
        for axle, wheels in AXLES.items():
            i, j = (WHEELS.index(w) for w in wheels)
            if now[i] == old[i] and now[j] == old[j]:
                continue
            key = f"{name}_{axle}"
            mean = 0.5 * (now[i] + now[j]) if now[i] != now[j] else now[i]
            new[key] = float(getattr(vehicle, key) * (mean / old[i])) if at_tyre else float(mean)
            if now[i] != now[j] and name in ("inertia", "slip_slope"):
                where = "front" if axle == "f" else "rear"
                notes.append(f"model: {name} of the {where} axle is the mean of its wheels")
    if changed & {"r_w", "brake_drag"}:
        new["rolling_resistance"] = _rolling_resistance(after)
    for k in KEYS.values():
        if k.name in new and not k.low <= new[k.name] <= k.high:
            what = f"the model makes {k.path} = {new[k.name]:g} {k.unit}"
            raise ConfigError(what, expected=f"{k.low:g} ... {k.high:g}")
    return replace(vehicle, **new) if new else vehicle  # type: ignore[arg-type]


def _rolling_resistance(plant: Plant) -> float:
    """One rolling-resistance coefficient for all four tyres and dragging brakes. [-]"""
    loads = wheel_loads(
        np.zeros(1), np.zeros(1), mass=plant.mass, l_f=plant.l_f, l_r=plant.l_r, h_cg=plant.h_cg, track=plant.track
    )[:, 0]
    return float((plant.r_w * loads + plant.brake_drag / plant.r_e).sum() / loads.sum())


def _undo_wheels(measured: _Measured, before: Plant, after: Plant) -> None:
    """Wheel speeds and torques of a car whose wheels have the radius of their axle and report all of their torque."""
    changed = _changed(before, after)
    grows = changed & {"radius_growth", "leak_radius"}
    v = _speed(measured, after) if grows else np.zeros(0)
    # as the compiled simulation lets a tyre lose its air
    leak = np.clip((measured.t - after.leak_start) / after.leak_time, 0.0, 1.0)
    columns = measured.columns
    for i, w in enumerate(WHEELS):
        omega, torque = f"omega_{w}", f"torque_{w}"
        other = WHEELS.index(next(x for x in AXLES[w[0]] if x != w))
        factor = float(after.r_e[i] / (0.5 * (after.r_e[i] + after.r_e[other])))
        if factor != 1.0 and omega in columns:
            columns[omega] = factor * columns[omega]
        if grows and omega in columns and (after.radius_growth[i] != 0.0 or after.leak_radius[i] != 0.0):
            ratio = effective_radius(np.ones(1), v, growth=float(after.radius_growth[i]))
            columns[omega] = ratio * (1.0 - after.leak_radius[i] * leak) * columns[omega]
        gain = float(after.torque_gain[i]) / factor
        if gain != 1.0 and torque in columns:
            columns[torque] = gain * columns[torque]


def _undo_forces(measured: _Measured, before: Plant, after: Plant) -> list[str]:
    """Add forces that have no key in the vehicle file to the accelerometer, which then shows the car without them."""
    forces = _changed(before, after) & _FORCES
    columns = measured.columns
    if not forces or "a_x" not in columns:
        return [f"model: the log has no a_x; {', '.join(sorted(forces))} not used"] if forces else []
    v, a_x, notes = np.nan_to_num(_speed(measured, after)), columns["a_x"], []
    lost = np.zeros_like(v)
    air = {"drag_area": after.drag_area, "air_density": after.air_density}
    if "head_wind" in forces:
        lost += air_drag(v + after.head_wind, **air) - air_drag(v, **air)
    if "drag_over_v" in forces:
        lost += np.interp(v, after.drag_over_v[:, 0], after.drag_over_v[:, 1])
    if "warmup_extra" in forces:
        warm = warm_up_factor(measured.t, extra=after.warmup_extra, time_constant=after.warmup_time)
        lost += _rolling_resistance(after._replace(brake_drag=np.zeros(4))) * after.mass * G * (warm - 1.0)
    if "towed_mass" in forces:
        lost += after.towed_mass * (np.nan_to_num(a_x) + G * after.r_w[2])
    if "cornering_drag" in forces:
        if "a_y" in columns:
            a_y = np.nan_to_num(columns["a_y"])
            lost += cornering_drag(a_y, mass=after.mass, coefficient=after.cornering_drag)
        else:
            notes.append("model: the log has no a_y; cornering_drag not used")
    columns["a_x"] = a_x + lost / after.mass
    return notes


def _speed(measured: _Measured, plant: Plant) -> FloatArray:
    """Speed of the car (n,): the reference, or else the mean of the rims that are known. [m/s]"""
    columns = measured.columns
    rims = [plant.r_e[i] * columns[f"omega_{w}"] for i, w in enumerate(WHEELS) if f"omega_{w}" in columns]
    v = columns.get("v_x", np.full(measured.t.shape, np.nan))
    if not rims:
        return v
    known = np.array(rims)
    count = np.isfinite(known).sum(axis=0)
    mean = np.where(count > 0, np.nansum(known, axis=0) / np.maximum(count, 1), np.nan)
    return np.where(np.isfinite(v), v, mean)
