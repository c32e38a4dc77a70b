"""Hidden effects: each changes the world. Names, parameters and units are the contract's; the last ones are in no library."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from .world import CAR, TYRE, WHEELS, Errors, World

__all__ = ["EFFECTS", "GROUPS", "NEUTRAL", "PLACE_FIXED", "UNKNOWN", "Hidden", "apply", "scaled"]

Values = Mapping[str, float]

_PLACES = {
    None: (0, 1, 2, 3), "f": (0, 1), "r": (2, 3), "left": (0, 2), "right": (1, 3), "fl": (0,), "fr": (1,), "rl": (2,),
    "rr": (3,),
}  # fmt: skip
GROUPS = {
    "omega": tuple(f"omega_{w}" for w in WHEELS),
    "torque": tuple(f"torque_{w}" for w in WHEELS),
    "esc": ("a_x", "a_y", "yaw_rate"),
}
"""Signals that come from one box and share its clock."""

UNKNOWN = ("speed_hump", "wet_hump", "slip_saddle", "drag_patch", "gear_loss", "accelerometer_speed", "hills")
"""Effects that are in no library."""

PLACE_FIXED = ("drag_patch", "hills")
"""Effects of the road: all drives of a case, the held-out ones too, run on the same one."""

NEUTRAL = {"gain": 1.0, "scale": 1.0, "depth_gain": 1.0}
"""Neutral values of parameters that multiply; of all others 0."""
_SHAPE = frozenset((
    "time_constant", "start", "duration", "centre", "width", "length", "period", "wavelength", "at",
))  # fmt: skip


@dataclass(frozen=True, slots=True)
class Hidden:
    """One hidden effect: name, place (wheel, axle, side, signal; None: the whole car), values by parameter."""

    effect: str
    where: str | None = None
    values: Values = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.effect not in EFFECTS:
            raise KeyError(f"no hidden effect {self.effect!r}; there are {', '.join(EFFECTS)}")
        object.__setattr__(self, "values", MappingProxyType(dict(self.values)))

    def __reduce__(self) -> tuple[object, ...]:
        return Hidden, (self.effect, self.where, dict(self.values))

    def __hash__(self) -> int:
        return hash((self.effect, self.where, tuple(sorted(self.values.items()))))

    @property
    def key(self) -> str:
        """`tyre_radius@fl`, or the bare name for the whole car."""
        return self.effect if self.where is None else f"{self.effect}@{self.where}"

    @property
    def in_library(self) -> bool:
        return self.effect not in UNKNOWN


def scaled(hidden: Hidden, scale: float) -> Hidden:
    """The same with its deviation from neutral `scale` times as large; times, places and widths stay."""
    length_is_size = hidden.effect == "relaxation_length"
    values = {
        n: x
        if n in _SHAPE and not (n == "length" and length_is_size)
        else NEUTRAL.get(n, 0.0) * (1 - scale) + scale * x
        for n, x in hidden.values.items()
    }
    return Hidden(hidden.effect, hidden.where, values)


def apply(world: World, hidden: tuple[Hidden, ...]) -> World:
    """The world with all of them in it."""
    for h in hidden:
        world = EFFECTS[h.effect](world, h.values, h.where)
    return world


def _car(world: World, **add: float) -> World:
    car = world.car.copy()
    for name, x in add.items():
        car[CAR[name]] += x
    return replace(world, car=car)


def _set(world: World, **values: float) -> World:
    car = world.car.copy()
    for name, x in values.items():
        car[CAR[name]] = x
    return replace(world, car=car)


def _tyre(world: World, where: str | None, *, factor: Values | None = None, add: Values | None = None) -> World:
    tyre = world.tyre.copy()
    rows = list(_PLACES[where])
    for name, x in (factor or {}).items():
        tyre[rows, TYRE[name]] *= x
    for name, x in (add or {}).items():
        tyre[rows, TYRE[name]] += x
    return replace(world, tyre=tyre)


def _signal(world: World, signals: tuple[str, ...], change: Callable[[Errors], Errors]) -> World:
    errors = dict(world.errors)
    for s in signals:
        errors[s] = change(errors.get(s, Errors()))
    return replace(world, errors=errors)


def _signals_of(where: str | None, default: str) -> tuple[str, ...]:
    name = where or default
    return GROUPS.get(name, (name,))


def _box_of(where: str | None) -> tuple[str, ...]:
    """All signals of the box that a signal comes from."""
    name = where or "v_x"
    return next((g for key, g in GROUPS.items() if name == key or name in g), (name,))


def _payload(world: World, v: Values, where: str | None) -> World:
    m, l_f, l_r = (world.car[CAR[n]] for n in ("mass", "l_f", "l_r"))
    x = {"f": 0.0, "r": l_f + l_r}.get(where or "", l_f)
    total = m + v["delta_mass"]
    shift = v["delta_mass"] * (x - l_f) / total
    inertia = world.car[CAR["I_zz"]] + m * shift**2 + v["delta_mass"] * (x - l_f - shift) ** 2
    return _set(world, mass=total, l_f=l_f + shift, l_r=l_r - shift, I_zz=inertia)


def _trailer(world: World, v: Values, _: str | None) -> World:
    return _car(world, towed_mass=v["mass"], drag_area=v.get("delta_drag_area", 0.0))


def _pressure(world: World, v: Values, where: str | None) -> World:
    world = _set(world, leak_start=v.get("start", 30.0), leak_time=v.get("duration", 30.0))
    return _tyre(world, where, add={"leak_radius": v["radius"], "leak_slope": v.get("slope", 0.0)})


def _uneven(world: World, v: Values, where: str | None) -> World:
    side = 1 if where == "right" else 0
    gains, rough = list(world.depth_gain), list(world.irregularity)
    gains[side] *= v.get("depth_gain", 1.0)
    rough[side] = float(np.hypot(rough[side], v.get("irregularity", 0.0)))
    return replace(world, depth_gain=(gains[0], gains[1]), irregularity=(rough[0], rough[1]))


def _of_signal(
    default: str, change: Callable[[Errors, Values], Errors]
) -> Callable[[World, Values, str | None], World]:
    return lambda w, v, where: _signal(w, _signals_of(where, default), lambda e: change(e, v))


def _of_tyre(name: str, parameter: str, *, factor: bool) -> Callable[[World, Values, str | None], World]:
    def change(w: World, v: Values, where: str | None) -> World:
        change_by = {name: v[parameter]}
        return _tyre(w, where, factor=change_by) if factor else _tyre(w, where, add=change_by)

    return change


EFFECTS: dict[str, Callable[[World, Values, str | None], World]] = {
    "road_grade": lambda w, v, _: replace(w, grade=w.grade + v["grade"]),
    "head_wind": lambda w, v, _: _car(w, head_wind=v["speed"]),
    "aero_drag": lambda w, v, _: _car(w, drag_area=v["delta_drag_area"]),
    "rolling_resistance": _of_tyre("r_w", "delta_r_w", factor=False),
    "tyre_warmup": lambda w, v, _: _set(w, warm_extra=v["extra"], warm_time=v.get("time_constant", 600.0)),
    "water_drag": _of_tyre("water_gain", "gain", factor=True),
    "brake_drag": _of_tyre("brake_drag", "torque", factor=False),
    "cornering_drag": lambda w, v, _: _car(w, cornering_drag=v["coefficient"]),
    "payload_mass": _payload,
    "torque_gain": lambda w, v, _: _set(w, torque_gain=w.car[CAR["torque_gain"]] * v["gain"]),
    "trailer": _trailer,
    "wheel_inertia": _of_tyre("inertia", "delta_inertia", factor=False),
    "accelerometer_bias": _of_signal("a_x", lambda e, v: replace(e, bias=e.bias + v["bias"])),
    "accelerometer_gain": _of_signal("a_x", lambda e, v: replace(e, gain=e.gain * v["gain"])),
    "accelerometer_drift": _of_signal("a_x", lambda e, v: replace(e, drift=e.drift + v["drift"])),
    "accelerometer_position": _of_signal("a_x", lambda e, v: replace(e, ahead=e.ahead + v["ahead"])),
    "signal_delay": _of_signal("v_x", lambda e, v: replace(e, delay=e.delay + v["delay"])),
    "tone_ring": lambda w, v, where: _signal(
        w, tuple(GROUPS["omega"][i] for i in _PLACES[where]), lambda e: replace(e, ring=e.ring + v["amplitude"])
    ),
    "velocity_scale": _of_signal("v_x", lambda e, v: replace(e, gain=e.gain * v["scale"])),
    "slip_stiffness": _of_tyre("slope", "gain", factor=True),
    "slip_stiffness_drift": _of_tyre("slope_drift", "rate", factor=False),
    "load_sensitivity": _of_tyre("load_delta", "delta", factor=False),
    "tyre_radius": lambda w, v, where: _tyre(w, where, factor={"r_e": 1.0 + v["delta"]}),
    "pressure_loss": _pressure,
    "tyre_radius_growth": _of_tyre("growth", "growth", factor=False),
    "relaxation_length": _of_tyre("relaxation", "length", factor=False),
    "contact_loss": _of_tyre("contact_gain", "gain", factor=True),
    "track_clearing": lambda w, v, _: _set(w, track_film=max(w.car[CAR["track_film"]] + v["delta_film"], 0.0)),
    "uneven_water": _uneven,
    "clock_skew": lambda w, v, where: _signal(
        w, _box_of(where), lambda e: replace(e, skew_ppm=e.skew_ppm + v["skew"])
    ),
    # in no library
    "speed_hump": lambda w, v, _: _set(w, hump_force=v["force"], hump_v=v["centre"], hump_width=v["width"]),
    "wet_hump": lambda w, v, _: _set(w, wet_force=v["force"], wet_vh=v["centre"], wet_width=v["width"]),
    "slip_saddle": lambda w, v, _: _set(w, saddle_depth=v["depth"], saddle_at=v["at"], saddle_width=v["width"]),
    "drag_patch": lambda w, v, _: replace(
        w, patch_force=v["force"], patch_start=v["start"], patch_length=v["length"], patch_period=v.get("period", 0.0)
    ),
    "gear_loss": lambda w, v, _: _car(w, gear_loss=v["coefficient"]),
    "accelerometer_speed": _of_signal("a_x", lambda e, v: replace(e, speed_gain=e.speed_gain + v["rate"])),
    "hills": lambda w, v, _: replace(w, hills_rms=v["rms"], hills_length=v["wavelength"]),
}  # fmt: skip
"""By name: (world, values, where) -> world."""
