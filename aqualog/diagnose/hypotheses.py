"""Effects and places that a log is tested for, and the simulated change of its residuals by each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.channels import channel_values
from aqualog.diagnose.drive import Drive, led_by, on_water, stretches
from aqualog.diagnose.records import name_by_place
from aqualog.diagnose.threads import beside
from aqualog.diagnose.tolerances import LANE_TOLERANCES, STAND_IN, TOLERANCES
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import STEP_S, Led, led_along, shown
from aqualog.model.term import Effect, Model, Need, Parameter, Term

__all__ = [
    "WORTH", "Hypothesis", "hypotheses", "residual", "room_of", "signatures", "simulated", "value_in", "with_free",
    "with_values",
]  # fmt: skip

TOLERANCE = 1.0 / 3.0  # of the smallest size worth naming, as standard deviation
WORTH = 2.0  # tolerances
# of a scale of the speed or the acceleration without wheel speeds: between ten trips of one car the slope of the one
# over the change of the other has a standard deviation of 0.02 (D): pitching, filters, hills
OF_CHANGES, _OF_CHANGES = 0.02, ("velocity_scale", "accelerometer_gain")
# [s] of the gyro's delay against the steering, where nobody knows the torque that turns the car in (K)
OF_TURNING = 0.03
POWER_OF_SPEED = 4.0  # of the speed of full aquaplaning, with which the lost contact goes
_TURNING = {"a_y", "yaw_rate", "steer_angle"}
# signals that a place needs
_SIGNALS: dict[str | None, set[str]] = {
    "a_y": _TURNING, "yaw_rate": _TURNING, "v_x": {"v_x"}, "a_x": {"a_x"}, "omega": {f"omega_{w}" for w in WHEELS},
}  # fmt: skip
ROUGH_S = 1e-2  # [s] step that is enough for differences of simulations on dry road
MOST_APART = 8  # drives that may each have an effect of their own
MOST_LANES = 16  # that differ from each other; of more lanes, every 16th have a deviation in common


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One effect at one place. `free` parameters are sought, `fixed` ones have these values. `room`: tolerance in place
    of the effect's own, where the log shows the effect less well or the vehicle file knows it better. `drive`: name of
    the only drive that has it, of several; empty: all of them. `most`: bound of the first parameter on this car."""

    effect: Effect
    where: str | None
    free: tuple[str, ...]
    fixed: Mapping[str, float] = field(default_factory=dict)
    room: float | None = None
    drive: str = ""
    most: float = math.inf

    @property
    def allowed(self) -> bool:
        """Whether it is a tolerance: taken into account but never reported."""
        return self.effect in TOLERANCES or self.lane is not None or self.effect is STAND_IN

    @property
    def lane(self) -> int | None:
        """Lanes, by number, of which it is the tolerance."""
        return round(self.fixed["lane"]) if "lane" in self.fixed else None

    @property
    def of_water(self) -> bool:
        """Whether it is an effect of water."""
        return self.lane is not None or self.effect.of_water

    @property
    def key(self) -> str:
        """`tyre_radius@fl`."""
        return self.effect.name if self.where is None else f"{self.effect.name}@{self.where}"

    @property
    def name(self) -> str:
        """By which probabilities add up, like that of a cause."""
        return name_by_place(self.effect.name, self.where)

    @property
    def parts(self) -> tuple[str, ...]:
        """Wheels or axles of which it is the sum; none of one that is simulated itself."""
        by_wheel = self.effect.drive.by_wheel
        if "fl" not in self.effect.places or not (self.where is None or (self.where in AXLES and by_wheel)):
            return ()
        return AXLES.get(self.where or "", WHEELS) if by_wheel else tuple(AXLES)

    def parameter(self, name: str) -> Parameter:
        """One of the effect's parameters."""
        p = next(p for p in self.effect.parameters if p.name == name)
        return p if p.high <= self.most or name != self.free[0] else replace(p, high=self.most)

    def tolerance(self, name: str) -> float:
        """Standard deviation of a parameter that is not worth naming; 0 for events and for places whose parts are
        tested."""
        if self.allowed:
            return self.parameter(name).sigma
        if self.parts or (self.effect.drive.is_single and self.where is not None):
            return 0.0  # its parts have theirs
        own = self._own_tolerance
        return self.parameter(name).smallest * TOLERANCE if own is None else own

    def worth_naming(self, name: str) -> float:
        """Smallest deviation that is worth naming: the effect's own, or twice the usual error of a file."""
        return max(self.parameter(name).smallest, WORTH * (self._own_tolerance or 0.0))

    @property
    def _own_tolerance(self) -> float | None:
        return self.room or self.effect.drive.tolerance_at.get(self.where or "", self.effect.drive.tolerance)


def hypotheses(drives: Sequence[Drive], model: Model) -> tuple[tuple[Hypothesis, ...], dict[str, str]]:
    """All hypotheses that these logs can test, and the reason why others cannot be tested, by name. An effect that the
    model already has is tested as a change of its value. Of several drives each may have what belongs to a drive by
    itself: a load, a wind, a slope."""
    present = frozenset.intersection(*(d.present for d in drives))
    wet = any(d.course.lanes for d in drives)
    judged = any(on_water(d.mask, d.course, d.dt)[1] > 0.0 for d in drives)
    torque = not any(d.untorqued for d in drives)
    wheels = all(f"omega_{w}" in present for w in WHEELS)
    has: dict[Need, bool] = {"water depth": judged, "wheel torque": torque, "wheel speeds": wheels}
    has["a_x or wheel torque"] = torque or "a_x" in present
    driven = [a for a, own in AXLES.items() if {*own} & {*drives[0].vehicle.driving}]
    length, names = max(d.duration_s for d in drives), [d.name for d in drives]
    apart = names if 1 < len(names) <= MOST_APART else []
    out: list[Hypothesis] = []
    untested: dict[str, str] = {}
    for effect in EFFECTS.values():
        if effect.drive.at_full_rate:
            continue
        is_sought = bool(effect.drive.begins_like) and (len(drives) == 1 or bool(apart))  # see `moments`
        missing = next((need for need in effect.drive.needs if not has[need]), None)
        if missing is not None:
            is_hidden = missing == "water depth" and wet
            untested[effect.name] = "no time on water is judged" if is_hidden else f"no {missing} in the log"
            continue
        free = tuple(p.name for p in effect.parameters[: effect.drive.count])
        wheels_of = WHEELS if effect.drive.by_wheel else ()
        places = effect.drive.places or ((*wheels_of, *AXLES, None) if "fl" in effect.places else (None,))
        if effect.drive.of_motors and len(driven) < len(AXLES):
            places = (None,)
        asked = [w for w in places if (torque if w in ("torque", "torque_fl") else _SIGNALS.get(w, set()) <= present)]
        if not asked:
            untested[effect.name] = f"no {' or '.join(str(p) for p in places)} in the log"
        if "steer_angle" in present & set(effect.places):
            untested[f"{effect.name}@steer_angle"] = "no residual compares the steering with the car's turning"
        for where in () if is_sought else asked:
            room = room_of(effect, where, drives[0].vehicle, wheels=wheels, torque=torque)
            is_whole = where not in (*WHEELS, *AXLES) or effect.drive.is_single  # a load may sit at an axle
            alone = apart if effect.belongs == "drive" and is_whole else []
            variants = effect.drive.variants(length)
            own = AXLES.get(where or "", WHEELS if where is None else (where,))
            most = math.inf if set(own) <= {*drives[0].vehicle.driving} else effect.drive.most_free
            out += [Hypothesis(effect, where, free, fixed, room, n, most) for n in ("", *alone) for fixed in variants]
    tolerated = TOLERANCES if torque else (*(e for e in TOLERANCES if not e.places), STAND_IN)
    out += [Hypothesis(e, w, ("by",)) for e in tolerated for w in (driven if e.places else (None,))]
    lanes = min(MOST_LANES, max(int(stretches(d).max()) for d in drives))
    # without torque there is no drag to test, nor one that differs
    asked_at = {(h.effect.name, h.where) for h in out}
    laws = [e for source, e in LANE_TOLERANCES.items() if source in asked_at]
    out += [Hypothesis(e, None, ("by",), {"lane": k}) for k in range(lanes) for e in laws]
    return tuple(out), untested


def room_of(effect: Effect, where: str | None, car: Vehicle, *, wheels: bool, torque: bool = True) -> float | None:
    """Tolerance of the lost contact of a car whose speed of full aquaplaning was fitted to its passes, by the spread of
    that speed, of what shows in changes of the speed alone, and of a turn into a curve that torque may help."""
    fitted = car.water.get("v_anchor")
    if effect.name == "contact_loss" and fitted is not None and fitted.source in ("calibrated", "measured"):
        return max(POWER_OF_SPEED * fitted.sd / fitted.value, TOLERANCE * effect.parameters[0].smallest)
    if not torque and (effect.name, where) == ("signal_delay", "yaw_rate"):
        return OF_TURNING
    return OF_CHANGES if not wheels and effect.name in _OF_CHANGES and where in ("v_x", "a_x") else None


def with_values(model: Model, found: Sequence[tuple[Hypothesis, Mapping[str, float]]]) -> Model:
    """The model with hypotheses at absolute values of free parameters; ConfigError if one is beyond its bounds."""
    terms = list(model.terms)
    for h, values in found:
        own = {**h.fixed, **values}
        for i, t in enumerate(terms):
            if _is_of(t, h):
                terms[i] = Term(h.effect, {**t.values, **own}, h.where, drive=h.drive)
                break
        else:
            terms.append(Term(h.effect, own, h.where, drive=h.drive))
    return Model(tuple(terms))


def _is_of(t: Term, h: Hypothesis) -> bool:
    return t.effect is h.effect and t.place == (h.where or h.effect.default) and t.drive == h.drive


def with_free(model: Model, members: Sequence[Hypothesis], values: FloatArray) -> Model:
    """The same with the values (k,) of all free parameters, one after the other."""
    left = iter(values.tolist())
    return with_values(model, [(h, {n: next(left) for n in h.free}) for h in members])


def value_in(model: Model, h: Hypothesis, name: str) -> float:
    """Value of a parameter in a model; neutral if it has no such term."""
    for t in model.terms:
        if _is_of(t, h):
            return float(t.values.get(name, h.parameter(name).neutral))
    return h.parameter(name).neutral


def residual(drive: Drive, model: Model, *, step: float = STEP_S, like: Led | None = None) -> FloatArray:
    """Residual channels (C, m) of a drive under a model, simulated in steps of `step` [s]. A model that changes the
    velocity's sensor changes the target speed, too. `like`: the drive along the same course in these steps under
    another model, which need not be driven again for a sensor's effect."""
    shown = simulated(drive, model, step=step, like=like)
    measured = channel_values(drive.columns, drive.channels, drive.vehicle, dt=drive.dt)
    return measured - channel_values(shown, drive.channels, drive.vehicle, dt=drive.dt)


def simulated(
    drive: Drive, model: Model, *, step: float = STEP_S, like: Led | None = None
) -> dict[str, FloatArray]:  # fmt: skip
    """Signals of the drive as the simulation has them under a model, those that the log has alone. Each (n,)"""
    model = model.of(drive.name)
    if any(t.place == "v_x" for t in model.terms):
        drive, like = led_by(drive, model), None
    led = led_along(drive.vehicle, drive.course, model, step=step, like=like)
    own = shown(led.truth, led.setup.sensors, drive.course)
    # of the same signals: both sides must use the same speed, either the reference or the wheels
    return {n: x for n, x in own.items() if n in drive.present or n == "nudge_seen"}


def signatures(
    drive: Drive, model: Model, asked: Sequence[Hypothesis], *, base: FloatArray,
    tick: Callable[[], None] = lambda: None, each: bool = False,
) -> list[FloatArray]:  # fmt: skip
    """Change of the residual by one unit of each free parameter: (k, C, m) per hypothesis, by differences of
    simulations.

    To first order, a hypothesis of a whole axle or car is the sum of its wheels; unless `each` is set, it is not
    simulated again. The tolerance of a lane is what its effect does there. What another drive alone has changes
    nothing. On dry road longer steps than those of `base` do: a difference of two simulations is exact to 1 % with
    them.
    """
    # the force in a tie rod jumps with the torque
    model = model.of(drive.name)
    is_rough = not drive.course.lanes and not drive.course.has_rods
    is_rough &= not any(t.effect.drive.is_quick for t in model.terms)
    leads = any(t.place == "v_x" for t in model.terms)
    led = led_along(drive.vehicle, drive.course, model, step=ROUGH_S) if is_rough and not leads else None
    rough = residual(drive, model, step=ROUGH_S, like=led) if is_rough else base

    def one(h: Hypothesis) -> FloatArray:
        out = []
        step_s, start = (ROUGH_S, rough) if is_rough and not h.effect.drive.is_quick else (STEP_S, base)

        def left(name: str, x: float) -> FloatArray:
            changed = with_values(model, [(h, {name: x})])
            return residual(drive, changed, step=step_s, like=led if step_s == ROUGH_S else None)

        for name in h.free:
            at, step = value_in(model, h, name), (p := h.parameter(name)).step
            if h.effect.drive.is_shift:
                # noise of an input, shifted one way only, would correlate with itself in the residual
                low, high = max(at - step, p.low), min(at + step, p.high)
                out.append((left(name, low) - left(name, high)) / (high - low))
                continue
            try:
                out.append((start - left(name, at + step)) / step)
            except ConfigError:
                out.append((left(name, at - step) - start) / step)
        tick()
        return np.array(out)

    own = [h for h in asked if h.drive in ("", drive.name)]
    has = {t.effect.name for t in model.terms}

    def at(h: Hypothesis, where: str | None) -> tuple[str, str | None, tuple[tuple[str, float], ...], str]:
        """What one drive alone has changes it like what all have, unless one of them is there already."""
        return h.effect.name, where, tuple(h.fixed.items()), h.drive if h.effect.name in has else ""

    alone = {at(h, h.where): h for h in own if h.lane is None and (each or not h.parts or at(h, h.where)[-1])}
    sources = {e.name: at for at, e in LANE_TOLERANCES.items()}
    for name, where in {sources[h.effect.name] for h in asked if h.lane is not None}:
        source = Hypothesis(EFFECTS[name], where, (EFFECTS[name].parameters[0].name,))
        alone.setdefault((name, where, (), ""), source)
    done = dict(zip(alone, beside(one, alone.values()), strict=True))
    number = stretches(drive)

    def of(h: Hypothesis) -> FloatArray:
        if h.lane is not None:
            there = (number > 0) & ((number - 1) % MOST_LANES == h.lane)
            return np.asarray(done[*sources[h.effect.name], (), ""][:1] * there)
        if h.drive not in ("", drive.name):
            return np.zeros((len(h.free), *base.shape))
        places = (h.where,) if at(h, h.where) in done else h.parts
        return np.asarray(np.sum([done[at(h, w)] for w in places], axis=0))

    return [of(h) for h in asked]
