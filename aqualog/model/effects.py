"""Table of the effects that a model may have on top of the base simulation.

Each entry names its target, its parameters with unit, prior and bounds, a source, and how a diagnosis searches for it:
a new effect is one entry. Neutral values leave a drive unchanged to the last bit. Sizes follow published figures where
available: V read in a source, D derived, K general knowledge.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model.checks import JACKED, ROLLED, STANDSTILL, WEIGHED
from aqualog.model.plant import Plant, with_mass_at
from aqualog.model.sensors import Channel
from aqualog.model.term import CampaignSearch, DayToDay, DriveSearch, Effect, Knots, Need, Parameter, Setup, Table
from aqualog.physics.load import G

__all__ = ["EFFECTS", "EMPIRICAL", "wheels_at"]

Values = Mapping[str, float]

_WHEEL_PLACES = (*WHEELS, *AXLES, *SIDES)
_SIGNALS = (
    "v_x", "a_x", "a_y", "yaw_rate", "steer_angle", *(f"omega_{w}" for w in WHEELS), *(f"torque_{w}" for w in WHEELS),
    "omega", "torque",
)  # fmt: skip


def wheels_at(where: str | None) -> tuple[int, ...]:
    """Return the wheel indices of a place: a wheel, an axle, a side, or all."""
    names = WHEELS if where is None else AXLES.get(where) or SIDES.get(where) or (where,)
    return tuple(WHEELS.index(w) for w in names)


def _changed(x: FloatArray, where: str | None, change: np.ufunc, by: float) -> Any:  # for `_replace`
    out, at = x.copy(), list(wheels_at(where))
    out[at] = change(out[at], by)
    return out


Apply = Callable[[Setup, Values, str | None], Setup]


def _on_plant(change: Callable[[Plant, Values, str | None], Plant]) -> Apply:
    return lambda setup, v, where: setup._replace(plant=change(setup.plant, v, where))


def _plus(**quantities: str) -> Apply:
    """Add parameters to quantities of the plant, each by its name: of the car, or of the wheels at the place."""

    def change(p: Plant, v: Values, where: str | None) -> Plant:
        of = {field: (getattr(p, field), v[name]) for field, name in quantities.items()}
        return p._replace(**{f: _changed(x, where, np.add, by) if np.ndim(x) else x + by for f, (x, by) in of.items()})

    return _on_plant(change)


def _times(**quantities: str) -> Apply:
    """Multiply quantities of the wheels at the place with parameters, each by its name."""
    return _on_plant(
        lambda p, v, w: p._replace(
            **{field: _changed(getattr(p, field), w, np.multiply, v[name]) for field, name in quantities.items()}
        )
    )


def _signals_at(where: str | None) -> tuple[str, ...]:
    """Return the signal of that name, or all four wheels' for `omega` and `torque`."""
    return tuple(f"{where}_{w}" for w in WHEELS) if where in ("omega", "torque") else (str(where),)


def _on_channels(change: Callable[[Channel, Values], Channel]) -> Apply:
    """Change the channel of a signal, or of all four wheels' for `omega` and `torque`."""

    def apply(setup: Setup, v: Values, where: str | None) -> Setup:
        sensors = setup.sensors
        for signal in _signals_at(where):
            sensors = sensors.with_channel(signal, change(sensors.channels.get(signal, Channel()), v))
        return setup._replace(sensors=sensors)

    return apply


def _road_grade(setup: Setup, v: Values, _: str | None) -> Setup:
    scenario = setup.scenario
    if scenario.grade:
        grade = tuple((s, theta + v["grade"]) for s, theta in scenario.grade)
    else:
        grade = ((0.0, v["grade"]),) if v["grade"] != 0.0 else ()
    return setup._replace(scenario=replace(scenario, grade=grade))


def _tone_ring(setup: Setup, v: Values, where: str | None) -> Setup:
    ring = list(setup.sensors.tone_ring)
    for i in wheels_at(where):
        ring[i] += v["amplitude"]
    return setup._replace(sensors=replace(setup.sensors, tone_ring=(ring[0], ring[1], ring[2], ring[3])))


def _clock_skew(setup: Setup, v: Values, where: str | None) -> Setup:
    # a bus has one clock: all its signals drift together
    shared = set(_signals_at(where))
    groups = tuple(
        replace(g, skew_ppm=g.skew_ppm + v["skew"]) if shared & set(g.signals) else g for g in setup.sensors.groups
    )
    return setup._replace(sensors=replace(setup.sensors, groups=groups))


def _uneven_water(setup: Setup, v: Values, where: str | None) -> Setup:
    side = where or "left"
    lanes = tuple(
        replace(
            lane,
            **{
                f"depth_{side}": getattr(lane, f"depth_{side}") * v["depth_gain"],
                f"irregularity_{side}": getattr(lane, f"irregularity_{side}") + v["irregularity"],
            },
        )
        for lane in setup.scenario.lanes
    )
    return setup._replace(scenario=replace(setup.scenario, lanes=lanes))


def _payload(p: Plant, v: Values, where: str | None) -> Plant:
    x = {"f": 0.0, "r": p.l_f + p.l_r}.get(where or "", p.l_f)
    return with_mass_at(p, v["delta_mass"], x)


def _axles(where: str | None) -> tuple[str, ...]:
    return ("f", "r") if where is None else (where[0],)


def _as_mass(share: float, car: Vehicle, _: str | None, _v: float) -> float:
    return share * car.mass


def _as_inertia(share: float, car: Vehicle, where: str | None, _: float) -> float:
    return share * (car.mass / sum([2.0 / car.arm(axle) ** 2 for axle in _axles(where)]))


def _as_wind(sd: float, car: Vehicle, _: str | None, v: float) -> float:
    # (v + w)^2 = v^2 (1 + 2 w / v) to first order
    return 0.5 * v * sd / car.drag_area if car.drag_area > 0.0 else sd


def _as_rolling(sd: float, car: Vehicle, where: str | None, _: float) -> float:
    front = car.l_r / car.wheelbase
    return sd * {"f": 1.0 / front, "r": 1.0 / (1.0 - front)}.get(where or "", 1.0)


def _as_brake(sd: float, car: Vehicle, where: str | None, _: float) -> float:
    wheels = 1 if where in WHEELS else 2 * len(_axles(where))
    return sd * (car.mass * G * car.arm(_axles(where)[0]) / wheels)


def _leaks(length: float) -> tuple[dict[str, float], ...]:
    """Moments at which a tyre may begin to lose its air."""
    return tuple({"start": length * (i + 0.5) / 5, "duration": 10.0} for i in range(5))


_SPAN = "(95 %: {0.low:.2f} ... {0.high:.2f})"
# where the friction peaks at one slip whatever the slope, 0.3 of it shows 77 % of 40 % more slope; a brush shows all of
# it. No log says which of the two a tyre is like: they are two standard deviations apart (D)
_CURVE = 0.12
# a replaced torque comes from the file's own mass and drag, so a force is judged against a measured one only; slip and
# radius show in wheel speeds only
_WATER: Need = "water depth"
_TORQUE: Need = "wheel torque"
_SPEEDS: Need = "wheel speeds"
_PAIR = ("a_x", "a_y")
# relations (D): an offset b of the accelerometer is a slope b / g and a force -m b against the motion, but for its slip
_LIKE_AN_OFFSET = (("road_grade", "rolling_resistance"), ("road_grade", "brake_drag"))
# the side slip's part of a_y, (l_r - m l_f v^2 / (c_r l)) times the yaw acceleration, looks like a delay against the
# gyro: a cornering stiffness that is off by a third moves it by 0.05 s at 40 m/s (D)
_SIDE_SLIP = {"a_y": 0.05}
# Tolerances are given where a vehicle file or a simulator errs by more than a third of the smallest size: slip slopes
# change by 5 % with a few degrees, the driveline turns with the wheels, a filter and half a sample, 10 ms, lie
# between two buses, scrub and crowned roads differ, tyres follow their load by other laws, warm up and grow a little
# on every drive (K). Tyres of one size differ by 1 % in radius, wheels by a third in inertia, slopes of the slip from
# 25 to 40 (K). Every tyre builds up its forces over some decimetres.
_ALL = [
    Effect(
        "road_grade", "slope angle of the road [rad]", "The road [climbs|falls] by {grade:.1%}.",
        "motorways to 3-4 % (V, DMRB [dmrb2020])",
        (Parameter("grade", "rad", 0.0, 0.02, -0.2, 0.2, 0.002, "slope angle, uphill positive"),), _road_grade,
        twins=("accelerometer_bias",), drive=DriveSearch(("a_x or wheel torque",), turns=True), belongs="drive",
    ),
    Effect(
        "head_wind", "speed through the air [m/s]", "A [head|tail] wind of {speed:.1f} m/s blew.", "±5 m/s (K)",
        (Parameter("speed", "m/s", 0.0, 4.0, -25.0, 25.0, 0.5, "against the car positive",
            DayToDay("drag", _as_wind)),),
        _plus(head_wind="speed"), twins=("aero_drag",), drive=DriveSearch((_TORQUE,), turns=True), belongs="drive",
    ),
    Effect(
        "aero_drag", "drag area c_w A [m²]",
        "The drag area is {delta_drag_area:.2f} m² [larger|smaller] than the vehicle file says.", "roof box +0.2 (K)",
        (Parameter("delta_drag_area", "m^2", 0.0, 0.1, -0.5, 2.0, 0.02, "on top of the vehicle file's",
            DayToDay("drag", lambda sd, *_: sd, "drag_area")),),
        _plus(drag_area="delta_drag_area"), twins=("head_wind",), drive=DriveSearch((_TORQUE,)),
    ),
    Effect(
        "rolling_resistance", "rolling resistance coefficient [-]",
        "The rolling resistance coefficient{at} is {delta_r_w:.4f} [higher|lower] than the vehicle file says.",
        "0.007-0.017 (V, TRB [trb2006])",
        (Parameter("delta_r_w", "-", 0.0, 0.002, -0.01, 0.05, 0.0005, "on top of the vehicle file's",
            DayToDay("rolling", _as_rolling, "rolling_resistance")),),
        _plus(r_w="delta_r_w"), _WHEEL_PLACES, twins=("brake_drag",), drive=DriveSearch((_TORQUE,)), belongs="drive",
    ),
    Effect(
        "tyre_warmup", "rolling resistance over time", "Cold tyres rolled {extra:.0%} [harder|easier] at the start.",
        "8 % per 10 degC (V, R117 [unece_r117_2011]); cold up to +40 % (V)",
        (
            Parameter("extra", "-", 0.0, 0.2, -0.3, 1.0, 0.03, "relative, at the start"),
            Parameter("time_constant", "s", 600.0, 300.0, 30.0, 5000.0, 60.0, "of the warm-up"),
        ),
        _on_plant(lambda p, v, _: p._replace(warmup_extra=p.warmup_extra + v["extra"], warmup_time=v["time_constant"])),
        drive=DriveSearch(
            (_TORQUE,), variants=lambda _: ({"time_constant": 150.0}, {"time_constant": 600.0}), tolerance=0.1),
        belongs="drive",
    ),
    Effect(
        "water_drag", "drag of film and bow wave on the wheels", "Film and bow wave{at} drag {gain:.2f} times as much.",
        "momentum estimate within a factor of two (D)",
        (Parameter("gain", "-", 1.0, 0.4, 0.0, 5.0, 0.3, "on film and wave"),),
        _times(water_drag_gain="gain"), _WHEEL_PLACES, twins=("track_clearing", "contact_loss"),
        drive=DriveSearch((_WATER, _TORQUE), tolerance=0.4),  # of each axle
        campaign=CampaignSearch(2, (None, "f", "r"),
            "Film and bow wave drag {0.value:.2f} times as much on {place} " + _SPAN + " as in the model.",
        ), belongs="tyre",
    ),
    Effect(
        "brake_drag", "torque against a wheel [N·m]", "The brake{at} drags with {torque:.0f} N·m per wheel.",
        "a few N·m a wheel (K)",
        (Parameter("torque", "N*m", 0.0, 10.0, -5.0, 300.0, 2.0, "per wheel", DayToDay("rolling", _as_brake)),),
        _plus(brake_drag="torque"), _WHEEL_PLACES, twins=("rolling_resistance",),
        drive=DriveSearch((_TORQUE,), by_wheel=True, check=JACKED),
    ),
    Effect(
        "cornering_drag", "resistance in curves [s^2/m]",
        "At 4 m/s² of lateral acceleration, curves slow the car by {coefficient:.2f} m/s² [more|less] than modelled.",
        "scrub, toe (K)",
        (Parameter("coefficient", "s^2/m", 0.0, 0.005, -0.02, 0.1, 0.001, "F = coefficient m a_y^2"),),
        _plus(cornering_drag="coefficient"), drive=DriveSearch((_TORQUE,), tolerance=0.003), shown=(16.0, "m/s^2"),
    ),
    Effect(
        "payload_mass", "mass [kg]", "The car weighed {delta_mass:.0f} kg [more|less] than the vehicle file says.",
        "passengers and load (K)",
        (Parameter("delta_mass", "kg", 0.0, 100.0, -500.0, 3000.0, 20.0, "at the place",
            DayToDay("inertia", _as_mass, "mass")),), _on_plant(_payload),
        ("f", "r"), twins=("torque_gain",),
        drive=DriveSearch((_TORQUE,), places=(None, "f", "r"), is_single=True, check=WEIGHED), belongs="drive",
    ),
    Effect(
        "torque_gain", "torque at the wheels over the reported one [-]",
        "The wheels{at} get {gain:.3f} times the torque in the log.", "axle efficiency 95-97 % (V)",
        (Parameter("gain", "-", 1.0, 0.05, 0.3, 2.0, 0.01, "true over reported",
            DayToDay("inertia", lambda share, *_: share, "torque_gain")),),
        _times(torque_gain="gain"), ("f", "r"), twins=("payload_mass",),
        drive=DriveSearch((_TORQUE,), places=(None, "f", "r"), of_motors=True),
    ),
    Effect(
        "trailer", "mass and air drag of a trailer", "A trailer of {mass:.0f} kg was towed.", "caravans 0.5-1.5 t (K)",
        (
            Parameter("mass", "kg", 0.0, 500.0, 0.0, 4000.0, 50.0, "on its own wheels",
                DayToDay("inertia", _as_mass)),
            Parameter("delta_drag_area", "m^2", 0.0, 0.5, 0.0, 5.0, 0.05, "on top of the car's",
                DayToDay("drag", lambda sd, *_: sd)),
        ),
        _plus(towed_mass="mass", drag_area="delta_drag_area"), twins=("payload_mass", "aero_drag"),
        drive=DriveSearch((_TORQUE,), count=2, tolerance=0.0), belongs="drive",
    ),
    Effect(
        "wheel_inertia", "inertia of the wheels [kg·m²]",
        "The inertia per wheel{at} is {delta_inertia:.2f} kg·m² [larger|smaller] than the vehicle file says.",
        "1.0-1.8 with the driveline (K)",
        (Parameter("delta_inertia", "kg*m^2", 0.0, 0.5, -0.9, 20.0, 0.1, "per wheel",
            DayToDay("inertia", _as_inertia)),),
        _on_plant(lambda p, v, w: p._replace(
            inertia=np.maximum(_changed(p.inertia, w, np.add, v["delta_inertia"]), 0.05))),
        _WHEEL_PLACES, twins=("payload_mass",),
        drive=DriveSearch((_TORQUE,), tolerance=0.15, axle_key="wheels.inertia_", most_free=1.5),  # a second wheel (K)
    ),
    Effect(
        "accelerometer_bias", "accelerometer [m/s²]", "The accelerometer{at} reads {bias:.2f} m/s² too [much|little].",
        "ESC sensors ±50-100 mg, 20 mg short term (V)",
        (Parameter("bias", "m/s^2", 0.0, 0.2, -2.0, 2.0, 0.03, "added"),),
        _on_channels(lambda c, v: replace(c, bias=c.bias + v["bias"])), ("a_x", "a_y"), "a_x", twins=("road_grade",),
        drive=DriveSearch(places=_PAIR, tolerance_at={"a_y": 0.1}, equals=_LIKE_AN_OFFSET, check=STANDSTILL),
    ),
    Effect(
        "accelerometer_gain", "accelerometer [-]",
        "The accelerometer{at} reads {gain:.3f} times the truth, by its gain or the tilt of the body.", "1-3 % (K)",
        (Parameter("gain", "-", 1.0, 0.02, 0.5, 1.5, 0.01, "on the true value"),),
        _on_channels(lambda c, v: replace(c, gain=c.gain * v["gain"])), ("a_x", "a_y"), "a_x",
        drive=DriveSearch(places=_PAIR, tolerance_at={"a_x": 0.02, "a_y": 0.03}),  # pitch of 0.12 degrees per m/s² (K)
    ),
    Effect(
        "accelerometer_drift", "accelerometer [m/s³]", "The accelerometer{at} drifts by {drift:+.3f} m/s² a minute.",
        "20 mg short term (V)",
        (Parameter("drift", "m/s^3", 0.0, 5e-4, -0.02, 0.02, 1e-4, "from the start"),),
        _on_channels(lambda c, v: replace(c, drift=c.drift + v["drift"])), ("a_x", "a_y"), "a_x",
        drive=DriveSearch(places=_PAIR), belongs="drive", shown=(60.0, "m/s^2"),
    ),
    Effect(
        "accelerometer_position", "place of the accelerometer [m]",
        "The accelerometer{at} sits {ahead:.2f} m [ahead of|behind] the centre of gravity.",
        "on the tunnel -0.3 to +0.5 m, a logger in the boot -2 m (K)",
        (Parameter("ahead", "m", 0.0, 0.7, -5.0, 5.0, 0.3, "ahead of the centre of gravity positive"),),
        _on_channels(lambda c, v: replace(c, ahead=c.ahead + v["ahead"])), ("a_x", "a_y"), "a_x",
        # a car that is simulated without side slip has its a_y 1.0 to 1.6 m further back than one with it (D)
        twins=("signal_delay",), drive=DriveSearch(places=_PAIR, tolerance=0.2, tolerance_at={"a_y": 1.5}),
    ),
    Effect(
        "signal_delay", "delay of a signal [s]", "The signal{at} comes {delay:.3f} s [late|early].",
        "GNSS up to 0.5 s (V)",
        (Parameter("delay", "s", 0.0, 0.1, -1.0, 2.0, 0.01, "late positive"),),
        _on_channels(lambda c, v: replace(c, delay_s=c.delay_s + v["delay"])), _SIGNALS, "v_x", twins=("clock_skew",),
        drive=DriveSearch(
            places=("v_x", "a_x", "omega", "torque", "a_y", "yaw_rate"), tolerance=0.01, tolerance_at=_SIDE_SLIP,
            is_shift=True, is_relative=True),
    ),
    Effect(
        "tone_ring", "wheel-speed pick-up [-]", "The tone ring{at} is uneven by {amplitude:.2%}.",
        "6.8e-4 per tooth (V, Gustafsson [gustafsson2000])",
        (Parameter("amplitude", "-", 0.0, 0.002, 0.0, 0.05, 0.002, "once per turn, relative"),), _tone_ring,
        _WHEEL_PLACES, drive=DriveSearch(at_full_rate=True),
    ),
    Effect(
        "velocity_scale", "reference velocity [-]", "The reference velocity reads {scale:.4f} times the truth.",
        "mounting, Doppler optics: 1 % (K)",
        (Parameter("scale", "-", 1.0, 0.01, 0.8, 1.2, 0.002, "on the true value"),),
        _on_channels(lambda c, v: replace(c, gain=c.gain * v["scale"])), ("v_x",), "v_x",
        twins=("tyre_radius",), drive=DriveSearch(places=("v_x",)),
    ),
    Effect(
        "slip_stiffness", "slip slope C_s / F_z [-]", "The slip slope{at} is {gain:.2f} times the vehicle file's.",
        "15-50 over tyres (K); temperature, wear (V, Carlson and Gerdes [carlson2005])",
        (Parameter("gain", "-", 1.0, 0.2, 0.2, 2.5, 0.05, "on the dry slope; 50 over 20"),),
        _times(slip_slope="gain"), _WHEEL_PLACES,
        drive=DriveSearch((_SPEEDS,), by_wheel=True, tolerance=0.05, doubt=_CURVE, axle_key="tyre.slip_slope_",
            divides=True),
        campaign=CampaignSearch(5, ("f", "r"),
            "The slip slope of {place} is {0.value:.2f} times the vehicle file's " + _SPAN + ".", driven=True,
        ), belongs="tyre",
    ),
    Effect(
        "slip_stiffness_drift", "slip slope over time [1/s]", "The slip slope{at} changes by {rate:+.1%} a minute.",
        "-0.4 to -1 %/K (K)",
        (Parameter("rate", "1/s", 0.0, 2e-4, -0.01, 0.01, 5e-5, "relative, exp(rate t)"),),
        _plus(slip_slope_drift="rate"), _WHEEL_PLACES,
        drive=DriveSearch((_SPEEDS,), doubt=_CURVE), belongs="drive", shown=(60.0, "-"),
    ),
    Effect(
        "load_sensitivity", "slip slope over load [-]",
        "The slip slope{at} follows the load by {delta:.2f} [more|less] than the tyre model says.",
        "0.22 in MF6.1 (V, [besselink2010])",
        (Parameter("delta", "-", 0.0, 0.2, -2.0, 2.0, 0.1, "on top of the tyre's, of slope over load"),),
        _plus(load_sensitivity="delta"), _WHEEL_PLACES,
        drive=DriveSearch((_TORQUE, _SPEEDS), tolerance=0.25, doubt=_CURVE),
        campaign=CampaignSearch(4, (None,),
            "The load sensitivity of the slip slope differs by {0.value:+.2f} from the tyre model's " + _SPAN + ".",
        ), belongs="tyre",
    ),
    Effect(
        "tyre_radius", "rolling radius [-]",
        "The effective tyre radius{at} is {delta:.2%} [larger|smaller] than the vehicle file says.",
        "±0.3 % (D), wear 1 % (K)",
        (Parameter("delta", "-", 0.0, 0.005, -0.1, 0.1, 0.001, "relative, effective and loaded"),),
        _on_plant(lambda p, v, w: p._replace(
            **{n: _changed(getattr(p, n), w, np.multiply, 1.0 + v["delta"]) for n in ("r_e", "r_l")})),
        _WHEEL_PLACES, twins=("velocity_scale",),
        drive=DriveSearch((_SPEEDS,), by_wheel=True, axle_key="wheels.r_e_", check=ROLLED), belongs="tyre",
    ),
    Effect(
        "pressure_loss", "radius and slip slope of a tyre that loses its air",
        "The tyre{at} loses air from {start:.0f} s on, and {radius:.2%} of its radius.",
        "-20 % of the pressure: -1.5 % of the loaded radius, the rolling radius less (V)",
        (
            Parameter("radius", "-", 0.0, 0.008, 0.0, 0.1, 0.001, "share of the radius that is lost in the end"),
            Parameter("slope", "-", 0.0, 0.1, -0.9, 1.0, 0.02, "relative change of the slip slope in the end"),
            Parameter("start", "s", 0.0, 30.0, 0.0, 86400.0, 1.0, "begin"),
            Parameter("duration", "s", 30.0, 20.0, 0.1, 86400.0, 1.0, "until the end state; of the last such term"),
        ),
        _on_plant(lambda p, v, w: p._replace(
            leak_radius=_changed(p.leak_radius, w, np.add, v["radius"]),
            leak_slope=_changed(p.leak_slope, w, np.add, v["slope"]), leak_start=v["start"], leak_time=v["duration"])),
        _WHEEL_PLACES, twins=("tyre_radius",),
        drive=DriveSearch((_SPEEDS,), by_wheel=True, variants=_leaks, begins_like="tyre_radius"), belongs="moment",
    ),
    Effect(
        "tyre_radius_growth", "rolling radius over speed [s^2/m^2]",
        "The tyre radius{at} [grows|shrinks] by {growth:.2%} up to 130 km/h.",
        "2.9e-6 in MF6.1 (V, D, [besselink2010])",
        (Parameter("growth", "s^2/m^2", 0.0, 2e-6, -1e-5, 3e-5, 1e-6, "r_e (1 + growth v^2)"),),
        _plus(radius_growth="growth"), _WHEEL_PLACES, drive=DriveSearch((_SPEEDS,)), shown=((130.0 / 3.6) ** 2, "-"),
    ),
    Effect(
        "relaxation_length", "build-up of tyre forces [m]", "Tyre forces{at} build up over {length:.2f} m.",
        "0.12-0.45 m (V)",
        (Parameter("length", "m", 0.0, 0.3, 0.0, 3.0, 0.05, "longitudinal and lateral"),),
        _plus(relaxation_length="length"), _WHEEL_PLACES, twins=("signal_delay",),
        drive=DriveSearch((_SPEEDS, _TORQUE), tolerance=0.3, is_quick=True), belongs="tyre",
    ),
    Effect(
        "contact_loss", "lost contact on water [-]", "The water lifts {gain:.2f} times as much of the contact{at}.",
        "shape assumed (D)",
        (Parameter("gain", "-", 1.0, 0.3, 0.0, 5.0, 0.3, "on the lost share"),),
        _times(contact_gain="gain"), _WHEEL_PLACES, twins=("water_drag", "uneven_water"),
        drive=DriveSearch((_WATER,), tolerance=0.4),
        campaign=CampaignSearch(1, (None, "f", "r"),
            "The water lifts {0.value:.2f} times as much of the contact of {place} " + _SPAN + " as in the model.",
        ), belongs="tyre",
    ),
    Effect(
        "track_clearing", "film in the track of the front wheels [m]",
        "The front wheels leave {delta_film:.2f} mm [more|less] film than the tyre model says.", "below 0.6 mm (D)",
        (Parameter("delta_film", "m", 0.0, 6e-4, -5e-4, 5e-3, 2e-4, "on the tyre's own"),),
        _on_plant(lambda p, v, _: p._replace(h_track=np.maximum(p.h_track + v["delta_film"], 0.0))),
        twins=("water_drag",), drive=DriveSearch((_WATER,), tolerance=1.5e-4),
        campaign=CampaignSearch(0, (None,),
            "The film that the front wheels leave to the rear ones differs by {0.value:+.2f} mm "
            "(95 %: {0.low:+.2f} ... {0.high:+.2f} mm) from the tyre model's.", scale=1e3,
        ), belongs="tyre", shown=(1e3, "mm"),
    ),
    Effect(
        "uneven_water", "water of one side", "The {where} track has {depth_gain:.2f} of the water.",
        "thesis 2.1 (C23): left lower and more irregular",
        (
            Parameter("depth_gain", "-", 1.0, 0.3, 0.0, 5.0, 0.2, "on the depth of that side"),
            Parameter("irregularity", "-", 0.0, 0.2, 0.0, 2.0, 0.05, "added rms, relative to the depth"),
        ),
        _uneven_water, ("left", "right"), "left", twins=("contact_loss", "water_drag"),
        drive=DriveSearch((_WATER,), places=("left", "right")),
        campaign=CampaignSearch(3, ("left", "right"),
            "{Place} has {0.value:.2f} times the depth of the table of runs " + _SPAN + ", and its irregularity is "
            "larger by {1.value:.2f} of the depth (95 %: {1.low:.2f} ... {1.high:.2f}).",
        ), belongs="drive",
    ),
    Effect(
        "clock_skew", "clock of a bus [ppm]", "The clock of the signal{at} runs {skew:.0f} ppm too [fast|slow].",
        "quartz 20-100 ppm (K)",
        (Parameter("skew", "ppm", 0.0, 100.0, -1e5, 1e5, 100.0, "fast positive"),), _clock_skew, _SIGNALS, "v_x",
        twins=("signal_delay",), drive=DriveSearch(places=("v_x", "a_x", "torque_fl"), is_shift=True), belongs="drive",
    ),
]  # fmt: skip

EFFECTS: dict[str, Effect] = {e.name: e for e in _ALL}


def _sum(a: Knots, b: Knots) -> Knots:
    """Sum of two piecewise linear functions that are constant beyond their ends."""
    x = np.unique([k[0] for k in (*a, *b)])
    total = sum(np.interp(x, [k[0] for k in knots], [k[1] for k in knots]) for knots in (a, b))
    return tuple(zip(x.tolist(), np.asarray(total).tolist(), strict=True))


def _force(setup: Setup, knots: Knots, _: str | None) -> Setup:
    now = tuple((float(v), float(force)) for v, force in setup.plant.drag_over_v)
    return setup._replace(plant=setup.plant._replace(drag_over_v=np.array(_sum(now, knots))))


def _grade(setup: Setup, knots: Knots, _: str | None) -> Setup:
    now = setup.scenario.grade or ((0.0, 0.0),)
    return setup._replace(scenario=replace(setup.scenario, grade=_sum(now, knots)))


EMPIRICAL: dict[str, Effect] = {e.name: e for e in (
    Effect(
        "unexplained_force", "extra force against the motion, over the speed [N]",
        "A force that depends on the speed holds the car back, and no known effect explains it.", "found in a drive",
        (), lambda setup, _v, _w: setup, twins=("aero_drag", "head_wind", "rolling_resistance"),
        table=Table("v_x", "m/s", 0.0, 150.0, "N", -2e4, 2e4, _force),
    ),
    Effect(
        "unexplained_grade", "slope angle along the way [rad]",
        "The road climbs and falls along the way.", "found in a drive",
        (), lambda setup, _v, _w: setup, twins=("road_grade", "accelerometer_drift"),
        table=Table("position", "m", 0.0, 1e7, "rad", -0.3, 0.3, _grade),
    ),
)}  # fmt: skip
"""Terms without a name in physics, as tables of knots; no parameters, neutral without knots.

They are separate from the effects that a search may name: any of them could imitate several effects.
"""
