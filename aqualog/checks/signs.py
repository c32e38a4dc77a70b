"""Signs: which of the signals that must move together moves the wrong way.

Speed decides on a_x. Turning has several witnesses; each is brought to the lateral acceleration that it stands for.
Forward and left are positive [iso8855_2011].
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from aqualog.checks.course import turning_by_course
from aqualog.checks.doubts import Change, Doubt, exchanged
from aqualog.checks.follows import follow
from aqualog.checks.relations import Relation, changes, relate
from aqualog.checks.windows import Windows, middle
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray

__all__ = ["LATERAL", "named", "sign_doubts", "witnesses"]

AGAINST = 0.4  # correlation from which a signal is called turned: noise and delays weaken it, nothing turns it
TOGETHER = 0.3  # from which a signal is a witness: wheel speeds in steps of 0.1 km/h show no more
LONGITUDINAL = 0.10  # [m/s^2] changes of less are no driving
MOTION = 0.3  # [m/s^2] standard deviation of the change of dv/dt: less may be the resolution of the speed
UNRELATED = 0.4  # correlation below which an accelerometer shows another axis: noise and a second of delay leave more
LATERAL = 0.06  # [m/s^2] changes of less are no steering, but wind and the crown of the road
LEAST_AGAINST, MOSTLY = 10, 0.5  # windows, and share of those that move, in which a car surely does not go backwards
MOVING = 3.0  # [m/s] below, wheels stand or go backwards without a sign
BANKED, LITTLE = 1.0, 0.3  # [m/s^2] a bend on which banks may count, and what is no bend the other way
OVAL_SHARE = 0.05  # of the drive
UNLIKE = 0.005  # [-] by which radii of an axle differ (K)
SLIDING = 0.015  # half of the slip between the axles from which a driver may steer against the turning
UNDERSTEER = 0.003  # [rad s^2/m] of a car; it only weighs fast driving against slow
CROSSED = 0.6  # correlation of the differences along both sides: in slow bends the front wheels' longer paths make less
TURN = Change(-1.0)

_SIGNALS = {"a_y", "yaw_rate", "steer_angle"}
_PAIRS = {
    "front": ("omega_fl", "omega_fr"), "rear": ("omega_rl", "omega_rr"), "course": ("latitude", "longitude"),
}  # fmt: skip
"""Witnesses that are made of two signals: they point the other way where these are exchanged."""
_NAMES = {
    "front": "the front wheels (right minus left)", "rear": "the rear wheels (right minus left)",
    "course": "the course (latitude, longitude)",
}  # fmt: skip
_ONE_FAULT = (
    ({"a_y", "yaw_rate"}, 1),  # an IMU with y to the right and z down
    ({"a_y"}, 1), ({"yaw_rate"}, 1), ({"steer_angle"}, 1),
    ({"front"}, 2), ({"rear"}, 2), ({"front", "rear"}, 3),  # names of wheels are rarely wrong
    ({"course"}, 4),
)  # fmt: skip
"""Sets of signals that one mistake turns, and how much it takes to believe it."""


def sign_doubts(windows: Windows) -> Iterator[Doubt]:
    """Yield what has the wrong sign; a signal without enough driving is not judged."""
    speed = windows.speed
    if not speed.size:
        return
    yield from _velocity(windows)
    yield from _forward(windows, speed)
    yield from _turning(windows, speed)


def _velocity(windows: Windows) -> Iterator[Doubt]:
    """Yield a velocity against the wheels for most of a drive; the negative one is turned: cars drive forward."""
    if "v_x" not in windows or not windows.wheels:
        return
    v, wheels = windows["v_x"], middle(list(windows.wheels.values()))
    with np.errstate(invalid="ignore"):
        moves = (np.abs(v) > MOVING) & (np.abs(wheels) > MOVING)
        against = moves & (v * wheels < 0.0)
    share = float(against.sum()) / max(int(moves.sum()), 1)
    if int(against.sum()) < LEAST_AGAINST or share < MOSTLY:
        return
    own = ("v_x",) if float(np.median(v[against])) < 0.0 else tuple(f"omega_{w}" for w in windows.wheels)
    what = f"v_x has the opposite sign of the wheels in {100.0 * share:.0f} % of the time in which both move"
    yield Doubt("sign", own, what, "forward is positive", ways=(dict.fromkeys(own, TURN),), value=share)


def _forward(windows: Windows, speed: FloatArray) -> Iterator[Doubt]:
    if "a_x" not in windows or speed.size < 3:
        return
    step = windows.step_s
    speed = np.where(windows.slips, np.nan, speed)
    gained = np.gradient(speed, step)
    found = relate(changes(windows["a_x"], step), changes(gained, step), step, least=LONGITUDINAL)
    if found.is_sure and found.r < -AGAINST:
        by = "the wheels' acceleration" if windows.wheels else "the change of v_x"
        what = f"a_x has the opposite sign of {by} (correlation {found.r:.2f})"
        yield Doubt("sign", ("a_x",), what, ways=({"a_x": TURN},), value=found.r)
        return
    a_x = windows["a_x"]
    own = follow(a_x, speed, np.isfinite(a_x) & np.isfinite(speed), step)
    if own is not None and own.motion > MOTION and abs(own.correlation) < UNRELATED:
        what = f"a_x does not follow the change of the speed (correlation {own.correlation:.2f}): another channel?"
        yield Doubt("channel", ("a_x",), what, value=own.correlation)


def _turning(windows: Windows, speed: FloatArray) -> Iterator[Doubt]:
    step = windows.step_s
    seen = {n: changes(x, step) for n, x in witnesses(windows, speed).items()}
    relations = {(a, b): relate(seen[a], seen[b], step, least=LATERAL) for a, b in combinations(seen, 2)}
    yield from _crossed(windows, speed, seen, relations)
    for one, other in _camps(relations):
        turned = _turned(one, other)
        if turned is None:
            yield _undecided(one, other, relations)
            continue
        right = other if turned is one else one
        pairs = sorted(turned - _SIGNALS)
        if pairs:
            yield _exchanged(pairs, right, relations)
        for name in sorted(turned & _SIGNALS):
            yield _opposite(name, right, relations)


def _crossed(
    windows: Windows, speed: FloatArray, seen: Mapping[str, FloatArray], relations: Mapping[tuple[str, str], Relation]
) -> Iterator[Doubt]:
    """Yield a front wheel and a rear one of the other side that look exchanged.

    Then the wheels of an axle are of one side and show no turning; the differences along either side show it.
    """
    wheels, step = windows.wheels, windows.step_s
    by = next((n for n in ("yaw_rate", "course", "a_y", "steer_angle") if n in seen), None)
    if by is None or len(wheels) < len(WHEELS):
        return
    across = [relations.get((by, axle)) or relations[axle, by] for axle in ("front", "rear")]
    v = np.where(speed > MOVING, speed, np.nan) / windows.vehicle.track
    along = [
        relate(changes(v * (wheels[f"f{side}"] - wheels[f"r{side}"]), step), seen[by], step, least=LATERAL)
        for side in "lr"
    ]
    weakest = min(along, key=lambda found: abs(found.r))
    if not all(f.is_sure and abs(f.r) > CROSSED for f in along) or along[0].r * along[1].r < 0.0:
        return
    if any(abs(f.r) > abs(weakest.r) for f in across):
        return
    one, other = ("omega_fl", "omega_rr") if weakest.r > 0.0 else ("omega_fr", "omega_rl")
    what = (
        f"{one} and {other} look exchanged: the differences of front and rear wheels follow {named(by)} (correlation "
        f"{weakest.r:.2f}), those of left and right wheels do not"
    )
    yield Doubt("exchange", (one, other), what, ways=(exchanged(one, other),), value=weakest.r)


def witnesses(windows: Windows, speed: FloatArray, *, on_banks: bool = False) -> dict[str, FloatArray]:
    """Return the lateral acceleration (n,) that each witness of turning stands for, where the car moves. [m/s²]

    Without a_y on an oval, as its sign means nothing there; with it if `on_banks`.
    """
    car = windows.vehicle
    wheels = windows.wheels
    v = np.where(speed > MOVING, speed, np.nan)
    if len(wheels) == len(WHEELS):
        front, rear = (wheels[f"{a}l"] + wheels[f"{a}r"] for a in AXLES)
        with np.errstate(invalid="ignore"):
            v = np.where(np.abs(front - rear) < SLIDING * (front + rear), v, np.nan)
    found = {}
    if "yaw_rate" in windows:
        found["yaw_rate"] = v * windows["yaw_rate"]
    if "a_y" in windows:
        found["a_y"] = np.where(np.isfinite(v), windows["a_y"], np.nan)
    if "steer_angle" in windows:
        found["steer_angle"] = v**2 * windows["steer_angle"] / (car.wheelbase + UNDERSTEER * v**2)
    for axle in ("front", "rear"):
        left, right = f"{axle[0]}l", f"{axle[0]}r"
        if left in wheels and right in wheels:
            found[axle] = v * (wheels[right] - _as_large(wheels[left], wheels[right])) / car.track
    if "latitude" in windows and "longitude" in windows:
        found["course"] = turning_by_course(windows["latitude"], windows["longitude"], v, windows.step_s)
    if not on_banks and any(_is_oval(x) for n, x in found.items() if n != "a_y"):
        found.pop("a_y", None)
    return found


def _as_large(left: FloatArray, right: FloatArray) -> FloatArray:
    """The speed of the left wheel with the radius of the right one, as far as tyres of one size differ: a drive that is
    mostly straight shows it. Else a changing speed would look like turning. (n,) [m/s]"""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(np.abs(left) > MOVING, right / left, np.nan)
    if not np.isfinite(ratio).any():
        return left
    return left * float(np.clip(np.nanmedian(ratio), 1.0 - UNLIKE, 1.0 + UNLIKE))


def _is_oval(turning: FloatArray) -> bool:
    """Whether the car turns one way only: on a bank that is too steep for its speed a_y then points the other way."""
    known = turning[np.isfinite(turning)]
    if not known.size:
        return False
    low, high = np.quantile(known, OVAL_SHARE), np.quantile(known, 1.0 - OVAL_SHARE)
    return bool(max(high, -low) > BANKED and min(high, -low) < LITTLE)


def _camps(relations: Mapping[tuple[str, str], Relation]) -> Iterator[tuple[set[str], set[str]]]:
    """Yield pairs of camps: within each all go the same way, and against the other one.

    The surest relations come first; one that contradicts them is left out.
    """
    camp: dict[str, tuple[int, int]] = {}  # number of the group, and side
    said = [(r.weight, pair, r.r) for pair, r in relations.items() if r.weight and (r.r > TOGETHER or r.r < -AGAINST)]
    for i, (_, (a, b), r) in enumerate(sorted(said, reverse=True)):
        sign = 1 if r > 0.0 else -1
        (group_a, side_a), (group_b, side_b) = camp.setdefault(a, (2 * i, 1)), camp.setdefault(b, (2 * i + 1, 1))
        if group_a != group_b:
            flip = sign * side_a * side_b
            for name, (group, side) in camp.items():
                if group == group_b:
                    camp[name] = (group_a, side * flip)
    for number in dict.fromkeys(group for group, _ in camp.values()):
        sides = [{n for n, own in camp.items() if own == (number, side)} for side in (1, -1)]
        if all(sides):
            yield sides[0], sides[1]


def _turned(one: set[str], other: set[str]) -> set[str] | None:
    """Return the camp that takes fewer mistakes to be the wrong one; None where both take the same."""
    a, b = _mistakes(one), _mistakes(other)
    return None if a == b else one if a < b else other


def _mistakes(names: set[str]) -> int:
    """Return the least sum of mistakes that turns exactly these signals."""
    fitting = [(own, cost) for own, cost in _ONE_FAULT if own <= names]
    best = {frozenset[str](): 0}
    for own, cost in fitting:
        for done, total in list(best.items()):
            both = done | own
            best[both] = min(best.get(both, 99), total + cost)
    return best[frozenset(names)]


def _opposite(name: str, right: Collection[str], relations: Mapping[tuple[str, str], Relation]) -> Doubt:
    told, r = _against(name, right, relations)
    # nothing else than its names speaks against wheels that are the only witnesses
    advice = f"or left and right are exchanged at both axles: {_DECIDES}" if set(right) == {"front", "rear"} else ""
    return Doubt("sign", (name,), f"{name} has the opposite sign of {told}", advice, ways=({name: TURN},), value=r)


def _undecided(one: set[str], other: set[str], relations: Mapping[tuple[str, str], Relation]) -> Doubt:
    told = " and ".join(named(n) for n in sorted(one))
    first = min(one, key=lambda n: _against(n, other, relations)[1])
    against, r = _against(first, other, relations)
    verb = "have" if len(one) > 1 or one <= {"front", "rear"} else "has"
    what = f"{told} {verb} the opposite sign of {against}; this log does not show which of them is turned"
    advice = "in a left turn each must be positive" + ("" if "course" in one | other else f"; {_DECIDES}")
    return Doubt("sign", tuple(sorted(one | other)), what, advice, (_way(one), _way(other)), r)


_DECIDES = "latitude and longitude in the map would decide"


def _way(camp: Collection[str]) -> dict[str, Change]:
    """Return the changes that put right all of a camp."""
    way: dict[str, Change] = {}
    for name in sorted(camp):
        way |= exchanged(*_PAIRS[name]) if name in _PAIRS else {name: TURN}
    return way


def _exchanged(turned: Sequence[str], right: Collection[str], relations: Mapping[tuple[str, str], Relation]) -> Doubt:
    told, r = _against(turned[0], right, relations)
    names = ", ".join(" and ".join(_PAIRS[n]) for n in turned)
    verb = "has" if turned == ["course"] else "have"
    what = f"{names} look exchanged: {' and '.join(named(n) for n in turned)} {verb} the opposite sign of {told}"
    symbols = tuple(s for n in turned for s in _PAIRS[n])
    return Doubt("exchange", symbols, what, ways=(_way(turned),), value=r)


def _against(name: str, others: Collection[str], relations: Mapping[tuple[str, str], Relation]) -> tuple[str, float]:
    """Name the others, with the strongest correlation, and return that."""
    pairs = {o: relations.get((name, o)) or relations.get((o, name)) for o in sorted(others)}
    found = {o: r.r for o, r in pairs.items() if r is not None and r.r < 0.0}
    if not found:
        return " and of ".join(named(o) for o in pairs), math.nan
    first = min(found, key=lambda o: found[o])
    rest = [named(o) for o in pairs if o != first]
    told = f"{named(first)} (correlation {found[first]:.2f})" + (f" and of {', '.join(rest)}" if rest else "")
    return told, found[first]


def named(witness: str) -> str:
    """Return what a witness of turning is called in a sentence."""
    return _NAMES.get(witness, witness)
