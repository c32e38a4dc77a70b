"""What may be hidden in a drive: the contract's effects by their names and parameters, and forms that no effect has.

Sizes: `worth` of each parameter is a size worth naming, `draw` takes two to four of them, either sign where both exist.
`cases` then enlarges what a drive would not show with a detectability of `cases.Z_LEAST`; for what is held back `make`
draws another drive and size instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .car import Car, Odd, settle
from .roads import Place
from .sensors import TEETH, WHEELS, Error

__all__ = [
    "HELD_BACK", "KINDS", "TWINS", "Hidden", "Kind", "Setup", "applied", "draw", "enlarged", "in_worths", "names_of",
]  # fmt: skip

Values = Mapping[str, float]
DRY = ("city", "country", "motorway", "staircase", "coast_down")
LIVELY = ("country", "staircase", "city")
_AT = {
    None: [0, 1, 2, 3], "f": [0, 1], "r": [2, 3], "left": [0, 2], "right": [1, 3], "fl": [0], "fr": [1], "rl": [2],
    "rr": [3],
}  # fmt: skip
BOXES = {
    "omega": tuple(f"omega_{w}" for w in WHEELS), "torque": tuple(f"torque_{w}" for w in WHEELS),
    "esc": ("a_x", "a_y", "yaw_rate"),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Setup:
    """Car, odd forms, road and errors of the sensors of one drive."""

    car: Car
    odd: Odd
    place: Place
    errors: Mapping[str, Error] = field(default_factory=dict)
    driven: tuple[int, ...] = (2, 3)


@dataclass(frozen=True, slots=True)
class Hidden:
    """One hidden cause: its name, its place, its values by parameter."""

    name: str
    where: str | None
    values: Values


Apply = Callable[[Setup, Values, str | None], Setup]


@dataclass(frozen=True, slots=True)
class Kind:
    """`worth` by place: parameters that carry the size; `shape` draws the others. `signs`: +1, -1 or 0 for both.

    `neutral` of the sized parameters (1 for factors). `channel` and `depends_on` say where an unknown form shows.
    """

    worth: Mapping[str | None, Values]
    apply: Apply
    programmes: tuple[str, ...] = DRY
    signs: int = 0
    neutral: float = 0.0
    shape: Callable[[np.random.Generator], dict[str, float]] = lambda _: {}
    known: bool = True
    held_back: bool = False
    on_the_road: bool = False  # the held-out drive takes the same road
    channel: str = ""
    depends_on: tuple[str, ...] = ()
    accepts: tuple[str, ...] = ()  # names that are right as well, where the library has the form under a known name


def draw(name: str, rng: np.random.Generator, scale: float = 1.0) -> Hidden:
    """A hidden cause of a kind, two to four times as large as worth naming, times `scale`."""
    kind = KINDS[name]
    where = list(kind.worth)[rng.integers(len(kind.worth))]
    sign = kind.signs or int(rng.choice([-1, 1]))
    by = sign * scale * rng.uniform(2.0, 4.0)
    values = {n: kind.neutral + by * x for n, x in kind.worth[where].items()}
    return Hidden(name, where, {**values, **kind.shape(rng)})


def enlarged(hidden: Hidden, by: float) -> Hidden:
    """The same with its deviation from neutral so many times as large; factors stay above a fifth."""
    kind = KINDS[hidden.name]
    sized = kind.worth[hidden.where]
    values = {n: kind.neutral + by * (x - kind.neutral) if n in sized else x for n, x in hidden.values.items()}
    if kind.neutral == 1.0:
        values = {n: max(x, 0.2) if n in sized else x for n, x in values.items()}
    return replace(hidden, values=values)


def in_worths(hidden: Hidden) -> float:
    """The size, in sizes worth naming."""
    kind = KINDS[hidden.name]
    name, worth = next(iter(kind.worth[hidden.where].items()))
    return abs(hidden.values[name] - kind.neutral) / worth


def applied(setup: Setup, hidden: tuple[Hidden, ...]) -> Setup:
    """The setup with all of them in it."""
    for h in hidden:
        setup = KINDS[h.name].apply(setup, h.values, h.where)
    return setup


def _car(**change: str) -> Apply:
    """Add parameters to numbers of the car, those of wheels at the place."""

    def apply(s: Setup, v: Values, where: str | None) -> Setup:
        return replace(s, car=s.car._replace(**{f: _plus(getattr(s.car, f), where, v[n]) for f, n in change.items()}))

    return apply


def _plus(x, where, by):
    if np.ndim(x) == 0:
        return x + by
    out = x.copy()
    out[_AT[where]] += by
    return out


def _times(x, where, by):
    out = x.copy()
    out[_AT[where]] *= by
    return out


def _wheels(field_name: str, parameter: str, offset: float = 0.0) -> Apply:
    """Multiply a number of the wheels at the place by a parameter plus an offset."""
    return lambda s, v, where: replace(
        s, car=s.car._replace(**{field_name: _times(getattr(s.car, field_name), where, offset + v[parameter])})
    )


def _signal(default: str, change: Callable[[Error, Values], Error]) -> Apply:
    def apply(s: Setup, v: Values, where: str | None) -> Setup:
        name = where or default
        at = tuple(f"omega_{WHEELS[i]}" for i in _AT[name]) if name in _AT else BOXES.get(name, (name,))
        return replace(s, errors={**s.errors, **{n: change(s.errors.get(n, Error()), v) for n in at}})

    return apply


def _skew(s: Setup, v: Values, where: str | None) -> Setup:
    box = next((b for b, of in BOXES.items() if where == b or where in of), where)
    return _signal("v_x", lambda e, w: e._replace(skew=e.skew + w["skew"]))(s, v, box)


def _odd(name: str, *parameters: str) -> Apply:
    return lambda s, v, where: replace(s, odd=s.odd._replace(**{name: np.array([
        float(_AT[where][0] if n == "wheel" else v[n]) for n in parameters])}))  # fmt: skip


def _payload(s: Setup, v: Values, where: str | None) -> Setup:
    c, dm = s.car, v["delta_mass"]
    x = {"f": 0.0, "r": c.l_f + c.l_r}.get(where or "", c.l_f)
    m = c.mass + dm
    shift = dm * (x - c.l_f) / m
    I_zz = c.I_zz + c.mass * shift**2 + dm * (x - c.l_f - shift) ** 2
    return replace(s, car=settle(c._replace(mass=m, l_f=c.l_f + shift, l_r=c.l_r - shift, I_zz=I_zz)))


def _inertia(s: Setup, v: Values, where: str | None) -> Setup:
    at = _AT[where]
    rim = s.car.rim.copy()
    rim[at] = np.maximum(rim[at] + v["delta_inertia"], 0.3 * rim[at])
    return replace(s, car=s.car._replace(rim=rim))


def _radius(s: Setup, v: Values, where: str | None) -> Setup:
    by = 1.0 + v["delta"]
    return replace(s, car=s.car._replace(r_e=_times(s.car.r_e, where, by)))


def _uneven(s: Setup, v: Values, where: str | None) -> Setup:
    side = f"depth_{where}"
    return replace(s, place=s.place._replace(**{side: getattr(s.place, side) * v["depth_gain"]}))


def _track_film(s: Setup, v: Values, _: str | None) -> Setup:
    return replace(s, car=s.car._replace(track_film=max(s.car.track_film + v["delta_film"], 0.0)))


def _torque_scale(s: Setup, v: Values, _: str | None) -> Setup:
    of = _signal("omega", lambda e, w: e._replace(by_torque=w["rate"]))
    for i in s.driven:
        s = of(s, v, WHEELS[i])
    return s


def _dead(s: Setup, v: Values, _: str | None) -> Setup:
    of = _signal("torque", lambda e, w: e._replace(dead=w["torque"]))
    for i in s.driven:
        s = of(s, v, f"torque_{WHEELS[i]}")
    return s


def _lingering(name: str, parameter: str) -> Apply:
    return lambda s, v, _: replace(s, odd=s.odd._replace(**{
        name: np.array([v[parameter]]), "linger": np.array([0.0, v["time"]])}))  # fmt: skip


def _valley(s: Setup, v: Values, _: str | None) -> Setup:
    # the torque that a car of this mass needs for an acceleration in the middle of what is driven
    torque = s.car.mass * v["acceleration"] * float(s.car.r_e.mean())
    values = [v["force"], v["centre"], v["width"], torque, 0.6 * torque]
    return replace(s, odd=s.odd._replace(valley=np.array(values)))


def _saddle(s: Setup, v: Values, _: str | None) -> Setup:
    torque = s.car.mass * v["acceleration"] * float(s.car.r_e.mean()) / len(s.driven)
    return replace(s, odd=s.odd._replace(saddle=np.array([v["depth"], torque, 0.4 * torque])))


def _by(parameter: str, **at: float) -> dict[str | None, dict[str, float]]:
    """`worth` of one parameter; `all_` is the whole car, `each` every wheel."""
    out: dict[str | None, dict[str, float]] = {}
    for place, x in at.items():
        places: tuple[str | None, ...] = WHEELS if place == "each" else ((None if place == "all_" else place),)
        out |= {p: {parameter: x} for p in places}
    return out


_KNOWN = {
    "road_grade": Kind(_by("grade", all_=0.005), lambda s, v, _: replace(
        s, place=s.place._replace(grade=s.place.grade + v["grade"]))),
    "head_wind": Kind(_by("speed", all_=1.2), _car(wind="speed"), ("country", "motorway", "staircase", "coast_down")),
    "aero_drag": Kind(_by("delta_drag_area", all_=0.05), _car(drag_area="delta_drag_area"),
                      ("country", "motorway", "staircase", "coast_down")),
    "rolling_resistance": Kind(_by("delta_r_w", all_=0.001, f=0.002, r=0.002, each=0.004), _car(roll_0="delta_r_w"), signs=1),
    "tyre_warmup": Kind(_by("extra", all_=0.15), lambda s, v, _: replace(
        s, car=s.car._replace(warm_extra=v["extra"], warm_time=v["time_constant"])), signs=1,
        shape=lambda rng: {"time_constant": rng.uniform(60.0, 160.0)}),
    "brake_drag": Kind(_by("torque", all_=5.0, f=8.0, r=8.0, each=14.0), _car(brake_drag="torque"), signs=1),
    "cornering_drag": Kind(_by("coefficient", all_=0.012), _car(corner_drag="coefficient"), ("country", "city"), signs=1),
    "payload_mass": Kind(_by("delta_mass", all_=50.0, r=60.0), _payload, LIVELY, signs=1),
    "torque_gain": Kind(_by("gain", all_=0.025), lambda s, v, _: replace(
        s, car=s.car._replace(torque_gain=s.car.torque_gain * v["gain"])), LIVELY, neutral=1.0),
    "wheel_inertia": Kind(_by("delta_inertia", all_=0.6, f=1.0, r=1.0), _inertia, LIVELY, signs=1),
    "accelerometer_bias": Kind(_by("bias", a_x=0.06), _signal("a_x", lambda e, v: e._replace(bias=e.bias + v["bias"]))),
    "accelerometer_gain": Kind(_by("gain", a_x=0.02), _signal("a_x", lambda e, v: e._replace(gain=e.gain * v["gain"])),
                               LIVELY, neutral=1.0),
    "accelerometer_drift": Kind(_by("drift", a_x=3e-4), _signal("a_x", lambda e, v: e._replace(drift=v["drift"]))),
    "accelerometer_position": Kind(
        _by("ahead", a_x=0.5), _signal("a_x", lambda e, v: e._replace(arm=v["ahead"])), ("city",)),
    "signal_delay": Kind(_by("delay", a_x=0.025, v_x=0.05, torque=0.03, omega=0.025), _signal(
        "v_x", lambda e, v: e._replace(delay=e.delay + v["delay"])), LIVELY, signs=1),
    "tone_ring": Kind(_by("amplitude", each=0.0012), _signal("fl", lambda e, v: e._replace(ring=v["amplitude"])), signs=1),
    "velocity_scale": Kind(_by("scale", v_x=0.004), _signal("v_x", lambda e, v: e._replace(gain=e.gain * v["scale"])),
                           neutral=1.0),
    "slip_stiffness": Kind(_by("gain", all_=0.12, f=0.12, r=0.12, each=0.17), _wheels("slope", "gain"), LIVELY, neutral=1.0),
    "slip_stiffness_drift": Kind(_by("rate", all_=5e-4), _car(slope_drift="rate"), LIVELY),
    "load_sensitivity": Kind(_by("delta", all_=0.3), _car(load_law="delta"), LIVELY),
    "tyre_radius": Kind(_by("delta", all_=0.004, f=0.003, r=0.003, each=0.003), _radius),
    "tyre_radius_growth": Kind(_by("growth", all_=1.6e-6), _car(growth="growth"), ("country", "motorway", "staircase"), signs=1),
    "relaxation_length": Kind(_by("length", all_=0.3), _car(bristle_x="length", bristle_y="length"), LIVELY, signs=1),
    "clock_skew": Kind(_by("skew", v_x=250.0, a_x=250.0, torque_fl=250.0), _skew, LIVELY),
    "trailer": Kind({None: {"mass": 200.0, "delta_drag_area": 0.25}}, _car(towed="mass", drag_area="delta_drag_area"),
                    ("country", "staircase"), signs=1),
    "pressure_loss": Kind({w: {"radius": 0.003, "slope": 0.03} for w in WHEELS}, lambda s, v, where: replace(
        s, car=s.car._replace(leak_radius=_plus(s.car.leak_radius, where, v["radius"]),
                              leak_slope=_plus(s.car.leak_slope, where, v["slope"]),
                              leak_start=v["start"], leak_time=v["duration"])), signs=1,
        shape=lambda rng: {"start": rng.uniform(40.0, 140.0), "duration": rng.uniform(30.0, 90.0)}),
    # on water, whose laws here are not the library's: the truth is fair only as a set of these four
    "water_drag": Kind(_by("gain", all_=0.25), _wheels("water_gain", "gain"), ("wet",), neutral=1.0),
    "contact_loss": Kind(_by("gain", all_=0.22), _wheels("contact_gain", "gain"), ("wet",), neutral=1.0),
    "track_clearing": Kind(_by("delta_film", all_=3e-4), _track_film, ("wet",), signs=1),
    "uneven_water": Kind(_by("depth_gain", left=0.2, right=0.2), _uneven, ("wet",), neutral=1.0),
}  # fmt: skip


def _form(
    worth: dict[str | None, dict[str, float]], apply: Apply, channel: str, depends_on: tuple[str, ...], **given
) -> Kind:
    return Kind(worth, apply, known=False, channel=channel, depends_on=depends_on, **given)


_UNKNOWN = {
    "speed_hump": _form(
        _by("force", all_=70.0), _odd("hump", "force", "centre", "width"), "force_balance", ("v_x",),
        programmes=("country", "staircase", "coast_down"),
        shape=lambda rng: {"centre": rng.uniform(16.0, 24.0), "width": rng.uniform(1.5, 3.0)}),
    "torque_saddle": _form(
        _by("depth", all_=0.18), _saddle, "slip", ("torque",), programmes=LIVELY, signs=1,
        shape=lambda rng: {"acceleration": rng.uniform(0.7, 1.3)}),
    "speed_dependent_gain": _form(
        _by("rate", a_x=0.005), _signal("a_x", lambda e, v: e._replace(by_speed=v["rate"])), "accelerometer", ("v_x", "a_x"),
        programmes=("country", "staircase")),
    "passing_force": _form(
        _by("force", all_=60.0), _odd("interval", "force", "start", "length"), "force_balance", ("time",),
        shape=lambda rng: {"start": rng.uniform(60.0, 160.0), "length": rng.uniform(65.0, 85.0)}),
    "way_waves": _form(
        _by("force", all_=70.0), _odd("waves", "force", "period", "phase"), "force_balance", ("position",), on_the_road=True,
        shape=lambda rng: {"period": rng.uniform(120.0, 400.0), "phase": rng.uniform(0.0, 6.28)}),
    "rolling_road": _form(
        _by("rms", all_=0.006), lambda s, v, _: replace(s, place=s.place._replace(rolling=v["rms"], length=v["length"])),
        "kinematic", ("position",), accepts=("road_grade", "unexplained_grade"),
        on_the_road=True, signs=1, shape=lambda rng: {"length": rng.uniform(500.0, 1200.0)}),
    "steering_drag": _form(
        _by("force", all_=2500.0), _odd("steering", "force"), "force_balance", ("steer_angle",), programmes=("city", "country"),
        signs=1),
    "odd_hours": _form(
        _by("force", all_=45.0), _odd("hours", "force", "rise", "hollow"), "force_balance", ("time",),
        shape=lambda rng: {"rise": rng.uniform(0.2, 0.35), "hollow": rng.uniform(0.6, 0.8)}),
    "yawing_slip": _form(
        _by("rate", all_=2.0), lambda s, v, _: replace(s, odd=s.odd._replace(turning=np.array([v["rate"]]))), "slip",
        ("yaw_rate",), programmes=("country", "city"), signs=1),
    "turn_ripple": _form(
        {w: {"torque": 12.0} for w in WHEELS}, _odd("ripple", "torque", "wheel", "order"), "slip", ("angle",), signs=1,
        shape=lambda rng: {"order": float(rng.integers(1, 3))}),
    "lingering_brake": _form(
        _by("torque", all_=16.0), _odd("linger", "torque", "time"), "force_balance", ("time since braking",),
        programmes=("country", "city", "staircase"), signs=1, shape=lambda rng: {"time": rng.uniform(14.0, 26.0)}),
    # tables of scores show the names, so the last ones say nothing
    "torque_speed_valley": _form(
        _by("force", all_=110.0), _valley, "force_balance", ("v_x", "torque"), programmes=("country", "staircase"),
        shape=lambda rng: {
            "centre": rng.uniform(14.0, 23.0), "width": rng.uniform(3.0, 5.0), "acceleration": rng.uniform(0.6, 1.2)}),
    "torque_read_in_speed": _form(_by("rate", all_=0.015), _torque_scale, "slip", ("torque",), programmes=LIVELY),
    "feldspar": _form(
        _by("square", a_x=0.006), _signal("a_x", lambda e, v: e._replace(square=v["square"])), "accelerometer", ("a_x",),
        programmes=("city", "country", "staircase", "coast_down")),
    "dolomite": _form(
        _by("shake", a_y=0.1), _signal("a_y", lambda e, v: e._replace(shake=(v["shake"], v["centre"], v["width"]))),
        "lateral", ("v_x",), programmes=("country", "staircase", "coast_down"),
        shape=lambda rng: {"centre": rng.uniform(20.0, 28.0), "width": rng.uniform(1.2, 2.5)}),
    "gneiss": _form(
        _by("depth", all_=0.12), _odd("hum", "depth", "centre", "width"), "slip", ("v_x",),
        programmes=("country", "staircase"), signs=1,
        shape=lambda rng: {"centre": rng.uniform(15.0, 23.0), "width": rng.uniform(1.5, 3.0)}),
    "basalt": _form(
        _by("force", all_=60.0), _odd("chafe", "force", "side", "threshold", "width"), "force_balance", ("a_y",),
        programmes=("city", "country"), signs=1, shape=lambda rng: {
            "side": float(rng.choice([-1, 1])), "threshold": rng.uniform(0.6, 0.9), "width": rng.uniform(0.1, 0.25)}),
    "quartz": _form(
        _by("force", all_=60.0), _odd("stretch", "force", "period", "phase"), "force_balance", ("position", "v_x"),
        programmes=("country", "staircase"), signs=1, on_the_road=True,
        shape=lambda rng: {"period": rng.uniform(450.0, 900.0), "phase": rng.uniform(0.0, 6.28)}),
    "mica": _form(
        _by("tip", a_x=0.015), _signal("a_x", lambda e, v: e._replace(tip=(v["tip"], v["threshold"]))), "accelerometer",
        ("a_y",), programmes=("city", "country"), shape=lambda rng: {"threshold": rng.uniform(0.4, 0.8)}),
    "slate": _form(
        _by("depth", all_=0.12), _lingering("soft", "depth"), "slip", ("time since braking",), programmes=LIVELY, signs=1,
        shape=lambda rng: {"time": rng.uniform(16.0, 30.0)}),
    "chalk": _form(
        _by("torque", all_=10.0), _dead, "force_balance", ("torque",), signs=1,
        programmes=("city", "country", "staircase", "coast_down")),
    "flint": _form(
        _by("scale", v_x=0.0007), _signal("v_x", lambda e, w: e._replace(pulse=(w["scale"], w["period"], w["phase"]))),
        "slip", ("time",), programmes=("country", "motorway", "staircase"), signs=1,
        shape=lambda rng: {"period": rng.uniform(22.0, 40.0), "phase": rng.uniform(0.0, 6.28)}),
    "agate": _form(
        _by("force", all_=20.0), _odd("agate", "force", "knee"), "force_balance", ("yaw_rate",), programmes=("city", "country"),
        signs=1, shape=lambda rng: {"knee": rng.uniform(0.06, 0.12)}),
    "beryl": _form(
        _by("force", all_=8.0), _odd("beryl", "force", "start", "length"), "force_balance", ("time", "v_x"),
        programmes=("country", "motorway", "staircase", "coast_down"),
        shape=lambda rng: {"start": rng.uniform(50.0, 120.0), "length": rng.uniform(60.0, 110.0)}),
    "galena": _form(
        _by("depth", all_=0.12), _odd("galena", "depth", "period", "phase"), "slip", ("position",), programmes=LIVELY, signs=1,
        on_the_road=True,
        shape=lambda rng: {"period": rng.uniform(250.0, 500.0), "phase": rng.uniform(0.0, 6.28)}),
    "jasper": _form(
        {w: {"depth": 8e-4} for w in WHEELS}, _odd("jasper", "depth", "wheel", "side", "threshold", "width"), "slip", ("a_y",),
        programmes=("city", "country"), signs=1, shape=lambda rng: {
            "side": float(rng.choice([-1, 1])), "threshold": rng.uniform(0.5, 0.8), "width": rng.uniform(0.15, 0.3)}),
    "zircon": _form(
        _by("angle", all_=0.0013), _lingering("zircon", "angle"), "accelerometer", ("time since braking",),
        programmes=LIVELY, shape=lambda rng: {"time": rng.uniform(8.0, 18.0)}),
    "olivine": _form(
        _by("lean", a_y=0.04), _signal("a_y", lambda e, v: e._replace(lean=v["lean"])), "lateral", ("torque",),
        programmes=("city", "country", "staircase")),
    "garnet": _form(
        _by("rate", all_=38.5), _odd("garnet", "rate", "threshold"), "force_balance", ("a_x",), programmes=LIVELY, signs=1,
        shape=lambda rng: {"threshold": rng.uniform(0.4, 0.9)}),
    "pyrite": _form(
        _by("force", all_=24.0), _odd("pyrite", "force", "up", "gap"), "force_balance", ("v_x",),
        programmes=("country", "staircase"),
        shape=lambda rng: {"up": rng.uniform(18.0, 23.0), "gap": rng.uniform(3.5, 6.0)}),
    "rutile": _form(
        _by("depth", all_=0.14), _odd("rutile", "depth"), "slip", ("torque",), programmes=("country", "staircase")),
    "talc": _form(
        _by("rate", all_=0.08), _odd("talc", "rate"), "slip", ("v_x", "torque"), programmes=("country", "staircase"), signs=1),
    "albite": _form(
        _by("power", all_=500.0), _odd("albite", "power", "period", "phase"), "force_balance", ("time", "v_x"),
        programmes=("country", "staircase"), signs=1, held_back=True,
        shape=lambda rng: {"period": rng.uniform(25.0, 50.0), "phase": rng.uniform(0.0, 6.28)}),
    "calcite": _form(
        _by("loss", all_=0.025), lambda s, v, _: replace(
            s, odd=s.odd._replace(calcite=np.array([v["loss"] / s.car.r_e.mean()]))), "force_balance", ("torque",),
        programmes=("city", "country", "staircase"), signs=1, held_back=True),
    "epidote": _form(
        {w: {"share": 0.1} for w in WHEELS}, _signal("fl", lambda e, v: e._replace(
            missed=(v["share"] / TEETH, v["speed"], v["width"]))), "slip", ("v_x",), programmes=("city",), signs=1,
        held_back=True, shape=lambda rng: {"speed": rng.uniform(4.0, 8.0), "width": rng.uniform(0.4, 1.0)}),
    "spinel": _form(
        _by("torque", all_=15.0), _odd("spinel", "torque", "width"), "slip", ("yaw_rate",), programmes=("city", "country"),
        signs=1, held_back=True, shape=lambda rng: {"width": rng.uniform(0.15, 0.4)}),
    "fluorite": _form(
        _by("size", a_x=0.04), _signal("a_x", lambda e, v: e._replace(fresh=(v["size"], v["time"]))), "accelerometer",
        ("time",), held_back=True, shape=lambda rng: {"time": rng.uniform(15.0, 45.0)}),
}  # fmt: skip

KINDS: Mapping[str, Kind] = {**_KNOWN, **_UNKNOWN}
HELD_BACK = tuple(n for n, k in KINDS.items() if k.held_back)
TWINS = tuple(frozenset(p) for p in (
    ("payload_mass", "torque_gain"), ("payload_mass", "trailer"), ("torque_gain", "trailer"), ("aero_drag", "head_wind"),
    ("rolling_resistance", "brake_drag"), ("road_grade", "accelerometer_bias"), ("tyre_radius", "velocity_scale"),
    ("payload_mass", "wheel_inertia"), ("signal_delay", "clock_skew"), ("signal_delay", "relaxation_length"),
    ("tyre_radius", "pressure_loss"), ("accelerometer_drift", "accelerometer_bias"), ("aero_drag", "trailer"),
    ("torque_gain", "wheel_inertia"), ("head_wind", "trailer"), ("tyre_warmup", "rolling_resistance"),
))  # fmt: skip
"""Pairs that one drive hardly separates: no compounds of them."""


def names_of(*, known: bool, wet: bool = False, held_back: bool = False) -> tuple[str, ...]:
    """Names of kinds, in the order of the table."""
    return tuple(
        n
        for n, k in KINDS.items()
        if k.known == known and (k.programmes == ("wet",)) == wet and k.held_back == held_back
    )
