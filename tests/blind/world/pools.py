"""Sizes of hidden effects: moderate ones, either sign, several places; `scale=0.3` makes the weak ones of them."""

from __future__ import annotations

from itertools import combinations

from .effects import UNKNOWN, Hidden

__all__ = ["COMPOUNDS", "POOLS", "SUITED", "TRIPLES"]

_ANY = ("mixed", "motorway", "handling", "stop_and_go")
_LIVELY = ("mixed", "handling")


def _each(effect: str, *of: tuple[str | None, dict[str, float]]) -> tuple[Hidden, ...]:
    return tuple(Hidden(effect, where, values) for where, values in of)


_KNOWN = (
    _each("head_wind", (None, {"speed": 4.0}), (None, {"speed": -3.5}), (None, {"speed": 5.5})),
    _each("aero_drag", (None, {"delta_drag_area": 0.14}), (None, {"delta_drag_area": -0.10}),
          (None, {"delta_drag_area": 0.22})),
    _each("rolling_resistance", (None, {"delta_r_w": 0.004}), (None, {"delta_r_w": -0.003}), ("r", {"delta_r_w": 0.006}),
          ("fl", {"delta_r_w": 0.012})),
    _each("tyre_warmup", (None, {"extra": 0.6, "time_constant": 90.0}), (None, {"extra": 0.5, "time_constant": 150.0})),
    _each("water_drag", (None, {"gain": 1.7}), (None, {"gain": 0.5}), ("f", {"gain": 2.0})),
    _each("brake_drag", (None, {"torque": 12.0}), ("f", {"torque": 20.0}), ("rl", {"torque": 40.0}),
          ("fr", {"torque": 35.0})),
    _each("cornering_drag", (None, {"coefficient": 0.03}), (None, {"coefficient": 0.05})),
    _each("payload_mass", (None, {"delta_mass": 160.0}), (None, {"delta_mass": -120.0}), ("r", {"delta_mass": 200.0}),
          ("f", {"delta_mass": 130.0})),
    _each("torque_gain", (None, {"gain": 1.06}), (None, {"gain": 0.93}), (None, {"gain": 1.1})),
    _each("wheel_inertia", (None, {"delta_inertia": 1.5}), ("f", {"delta_inertia": 2.5}), ("r", {"delta_inertia": 2.5})),
    _each("road_grade", (None, {"grade": 0.015}), (None, {"grade": -0.02}), (None, {"grade": 0.03})),
    _each("accelerometer_bias", ("a_x", {"bias": 0.15}), ("a_x", {"bias": -0.12}), ("a_x", {"bias": 0.3})),
    _each("accelerometer_gain", ("a_x", {"gain": 1.05}), ("a_x", {"gain": 0.95}), ("a_x", {"gain": 1.08})),
    _each("accelerometer_drift", ("a_x", {"drift": 6e-4}), ("a_x", {"drift": -5e-4})),
    _each("accelerometer_position", ("a_x", {"ahead": 2.0}), ("a_x", {"ahead": -2.5})),
    _each("signal_delay", ("a_x", {"delay": 0.08}), ("v_x", {"delay": 0.2}), ("torque", {"delay": 0.1}),
          ("omega", {"delay": 0.08})),
    _each("tone_ring", ("fl", {"amplitude": 0.004}), ("rr", {"amplitude": 0.003}), ("f", {"amplitude": 0.003})),
    _each("velocity_scale", ("v_x", {"scale": 1.012}), ("v_x", {"scale": 0.985})),
    _each("slip_stiffness", (None, {"gain": 0.75}), (None, {"gain": 1.35}), ("f", {"gain": 0.7}), ("r", {"gain": 0.7}),
          ("rl", {"gain": 0.6}), ("fl", {"gain": 0.6})),
    _each("slip_stiffness_drift", (None, {"rate": -1.2e-3}), (None, {"rate": 1e-3})),
    _each("load_sensitivity", (None, {"delta": -0.8}), (None, {"delta": 0.7})),
    _each("tyre_radius", ("fl", {"delta": -0.01}), ("rr", {"delta": -0.008}), ("r", {"delta": 0.009}),
          ("f", {"delta": -0.008}), (None, {"delta": -0.012})),
    _each("tyre_radius_growth", (None, {"growth": 6e-6}), (None, {"growth": 4e-6})),
    _each("relaxation_length", (None, {"length": 1.2}), (None, {"length": 0.8})),
    _each("contact_loss", (None, {"gain": 1.7}), (None, {"gain": 0.4})),
    _each("track_clearing", (None, {"delta_film": 6e-4}), (None, {"delta_film": 1.2e-3})),
    _each("uneven_water", ("left", {"depth_gain": 0.5}), ("right", {"depth_gain": 0.6}),
          ("left", {"depth_gain": 1.6, "irregularity": 0.2})),
    _each("clock_skew", ("v_x", {"skew": 900.0}), ("a_x", {"skew": 700.0}), ("torque_fl", {"skew": -800.0})),
    _each("trailer", (None, {"mass": 600.0, "delta_drag_area": 0.6}), (None, {"mass": 900.0, "delta_drag_area": 1.2})),
    _each("pressure_loss", ("rl", {"radius": 0.01, "slope": 0.1, "start": 100.0, "duration": 60.0}),
          ("fr", {"radius": 0.008, "slope": 0.1, "start": 60.0, "duration": 90.0})),
)  # fmt: skip
_OTHER = (
    _each("speed_hump", (None, {"force": 160.0, "centre": 17.0, "width": 2.5}),
          (None, {"force": 200.0, "centre": 24.0, "width": 2.0})),
    _each("wet_hump", (None, {"force": 350.0, "centre": 0.030, "width": 0.008}),
          (None, {"force": 450.0, "centre": 0.040, "width": 0.008})),
    _each("slip_saddle", (None, {"depth": 0.55, "at": 0.009, "width": 0.003}),
          (None, {"depth": 0.5, "at": 0.006, "width": 0.002})),
    _each("drag_patch", (None, {"force": 300.0, "start": 600.0, "length": 250.0, "period": 1900.0}),
          (None, {"force": 260.0, "start": 900.0, "length": 350.0, "period": 2300.0})),
    _each("gear_loss", (None, {"coefficient": 3.5e-4}), (None, {"coefficient": 2.5e-4})),
    _each("accelerometer_speed", ("a_x", {"rate": 0.012}), ("a_x", {"rate": -0.01})),
    _each("hills", (None, {"rms": 0.02, "wavelength": 900.0}), (None, {"rms": 0.03, "wavelength": 600.0})),
)  # fmt: skip

POOLS: dict[str, tuple[Hidden, ...]] = {of[0].effect: of for of in (*_KNOWN, *_OTHER)}
"""Moderate sizes by effect, the contract's first, then those that no library has."""

_SHOWN_BY = {
    "head_wind": ("mixed", "motorway"), "aero_drag": ("mixed", "motorway"), "rolling_resistance": _ANY,
    "water_drag": ("wet",), "contact_loss": ("wet",), "track_clearing": ("wet",), "uneven_water": ("wet",),
    "wet_hump": ("wet",), "wheel_inertia": ("handling", "stop_and_go"), "accelerometer_gain": _LIVELY,
    "signal_delay": ("mixed", "handling", "stop_and_go"), "slip_stiffness": _LIVELY, "slip_stiffness_drift": _LIVELY,
    "load_sensitivity": ("handling",), "relaxation_length": ("handling", "stop_and_go"), "cornering_drag": _LIVELY,
    "tyre_radius_growth": ("mixed", "motorway"), "clock_skew": _LIVELY, "torque_gain": _LIVELY,
    "payload_mass": _LIVELY, "slip_saddle": _LIVELY, "gear_loss": _LIVELY, "accelerometer_speed": _LIVELY,
    "speed_hump": ("mixed",), "drag_patch": ("mixed",), "hills": ("mixed",), "trailer": ("mixed", "motorway"),
    "pressure_loss": ("mixed", "motorway", "handling"), "accelerometer_position": ("handling",),
}  # fmt: skip
SUITED: dict[str, tuple[str, ...]] = {name: _SHOWN_BY.get(name, _ANY) for name in POOLS}
"""Programmes that excite an effect; elsewhere `cannot_tell` or `no_effect` may be the right answer."""

_PARTNERS = ("aero_drag", "payload_mass", "accelerometer_bias", "signal_delay", "tyre_radius", "slip_stiffness",
             "brake_drag", "velocity_scale", "torque_gain", "accelerometer_gain", "road_grade")  # fmt: skip
_SAME = {frozenset(p) for p in (
    ("payload_mass", "torque_gain"), ("tyre_radius", "velocity_scale"), ("accelerometer_bias", "road_grade"),
)}  # fmt: skip

COMPOUNDS: tuple[tuple[Hidden, Hidden], ...] = tuple(
    (POOLS[a][i % len(POOLS[a])], POOLS[b][(i + 1) % len(POOLS[b])])
    for i, (a, b) in enumerate(combinations(_PARTNERS, 2))
    if frozenset((a, b)) not in _SAME
)
"""Pairs that are not each other's twins, for the programmes `mixed` and `handling`."""

TRIPLES: tuple[tuple[Hidden, Hidden, Hidden], ...] = tuple(
    (POOLS[a][0], POOLS[b][0], POOLS[c][0])
    for a, b, c in (
        ("aero_drag", "signal_delay", "tyre_radius"), ("payload_mass", "accelerometer_bias", "slip_stiffness"),
        ("brake_drag", "velocity_scale", "accelerometer_gain"), ("torque_gain", "road_grade", "slip_stiffness"),
        ("aero_drag", "payload_mass", "accelerometer_gain"),
    )
)  # fmt: skip

assert set(UNKNOWN) <= set(POOLS)
