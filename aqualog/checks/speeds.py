"""Scales: wheels, velocity and accelerometer that are too large or too small for each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aqualog.checks.doubts import Change, Doubt
from aqualog.checks.relations import changes
from aqualog.checks.windows import Windows, middle
from aqualog.core.records import FloatArray
from aqualog.physics.load import G

__all__ = ["scale_doubts"]

LEAST_CORRELATION = 0.6
LEAST_WINDOWS = 40
LEAST_CHANGE = 1e-9  # [m/s^2] of a standard deviation: nothing moves
# of accelerations, by how well they follow each other: pitch and gain of a sensor make 1.25; mph makes 2.2, time 2
RATIOS = ((0.9, 12, 1.5), (LEAST_CORRELATION, LEAST_WINDOWS, 1.8))  # least correlation and number of windows
LENGTHS = (1, 2, 4, 8, 16)  # windows over which both are averaged: time that is too slow needs long ones
OFF = 0.05  # of speeds: no wear and no GNSS is so far off; a tyre of another size is
MOVING = 3.0  # [m/s] from which a ratio of speeds means something
STEADY = 0.04  # between the quartiles of such a ratio: the resolution of slow wheels, and a bend
RADII = (0.2, 0.6)  # [m] of tyres from the smallest car to a van
_SIDES = {"f": "front", "r": "rear"}
_UNITS = {3.6: ("km/h", "m/s"), 2.23694: ("mph", "m/s"), 1.60934: ("km/h", "mph")}  # true unit, unit taken: too large
_NEAR = 0.04  # about such a factor
_ROUGH = 1.3  # about that of g, as noise and grades change it


def scale_doubts(windows: Windows) -> Iterator[Doubt]:
    """Yield wheels that always turn at another speed than the others, and scales that do not fit each other."""
    found = list(_speeds(windows))
    yield from found
    yield from _acceleration(windows, are_speeds_right=not found)


def _speeds(windows: Windows) -> Iterator[Doubt]:
    wheels = windows.wheels
    if not wheels:
        return
    if (axles := _axles(windows)) is not None:
        yield axles
        return
    common = middle(list(wheels.values()))
    radius = {w: windows.vehicle.r_e(w) for w in wheels}
    odd = {w: r for w, x in wheels.items() if _is_off(r := _ratio(x, common))} if len(wheels) > 2 else {}
    if odd:
        told = ", ".join(f"omega_{w} is {_factor(r)} times" for w, r in odd.items())
        own = {f"omega_{w}": Change(1.0 / r, radius=radius[w]) for w, r in odd.items()}
        names = tuple(f"omega_{w}" for w in odd)
        yield Doubt("scale", names, f"{told} the speed of the other wheels", "check its unit and tyre size", (own,))
        return
    ratio = _ratio(common, windows["v_x"]) if "v_x" in windows else 1.0
    if _is_off(ratio):
        what = f"wheel speeds times radius are {_factor(ratio)} times v_x"
        ways = (
            {"v_x": Change(ratio, radius=1.0)},
            {f"omega_{w}": Change(1.0 / ratio, radius=radius[w]) for w in wheels},
        )
        advice = "check the units (km/h, mph, m/s, rad/s) and r_e in the vehicle file"
        yield Doubt("scale", ("v_x", *(f"omega_{w}" for w in wheels)), what, advice, ways, ratio)


def _axles(windows: Windows) -> Doubt | None:
    """Return what is wrong with an axle both of whose wheels are off by one factor: first of all its radius."""
    wheels = windows.wheels
    if len(wheels) < 4 or any(_is_off(_ratio(wheels[f"{a}l"], wheels[f"{a}r"])) for a in "fr"):
        return None
    speed = {a: middle([wheels[f"{a}l"], wheels[f"{a}r"]]) for a in "fr"}
    between = _ratio(speed["f"], speed["r"])
    if not _is_off(between):
        return None
    factor = {"f": between, "r": 1.0 / between}
    beside = "the speed of the other axle"
    if "v_x" in windows:
        by_road = {a: r for a in "fr" if _is_off(r := _ratio(speed[a], windows["v_x"]))}
        factor, beside = (by_road, "v_x") if by_road else (factor, beside)
    size = {a: windows.vehicle.r_e(f"{a}l") / x for a, x in factor.items()}
    own = [
        {f"omega_{a}{side}": Change(1.0 / x, radius=windows.vehicle.r_e(f"{a}l")) for side in "lr"}
        for a, x in factor.items()
    ]
    names = tuple(name for way in own for name in way)
    told = ", ".join(f"both {_SIDES[a]} wheels are {_factor(x)} times" for a, x in factor.items())
    keys = (" and " if beside == "v_x" else " or ").join(f"r_e_{a} = {r:.3f}" for a, r in size.items())
    is_tyre = all(RADII[0] < r < RADII[1] for r in size.values())
    radius = f"check the rolling radius in the vehicle file: {keys} fits, under [wheels]" if is_tyre else ""
    ways = ({n: c for way in own for n, c in way.items()},) if beside == "v_x" else tuple(own)
    return Doubt("scale", names, f"{told} {beside}", "check unit and tyre size", ways, radius=radius)


def _is_off(ratio: float) -> bool:
    return not 1.0 / (1.0 + OFF) < ratio < 1.0 + OFF


def _factor(ratio: float) -> str:
    """A factor, and the mistaken unit that would make it."""
    size = max(ratio, 1.0 / ratio)
    units = next((u for x, u in _UNITS.items() if abs(size / x - 1.0) < _NEAR), None)
    if units is None:
        return f"{ratio:.3g}"
    true, taken = units if ratio > 1.0 else units[::-1]
    return f"{ratio:.3g} ({true} read as {taken}?)"


def _ratio(x: FloatArray, y: FloatArray) -> float:
    """Return the median of x over y where both are known and the faster one moves.

    1 where too few do, or where the ratio changes on the way, as with wheels that slip: a scale is always the same.
    """
    with np.errstate(invalid="ignore"):
        good = (np.maximum(x, y) > MOVING) & (np.minimum(x, y) > 0.0)
    if int(good.sum()) < LEAST_WINDOWS:
        return 1.0
    low, ratio, high = np.quantile(x[good] / y[good], (0.25, 0.5, 0.75))
    return float(ratio) if high - low < STEADY * ratio else 1.0


def _acceleration(windows: Windows, *, are_speeds_right: bool) -> Iterator[Doubt]:
    if "a_x" not in windows or not windows.wheels or windows["a_x"].size < 3:
        return
    found = [(*seen, most) for k in LENGTHS for least, count, most in RATIOS
             if (seen := _beside(windows, k))[0] > least and seen[2] >= count]  # fmt: skip
    if not found:
        return
    r, ratio, _, limit = max(found, key=lambda f: (f[0], -f[3]))
    # the scale lies between both regressions: noise, or grades in a_x, make one of the signals the larger one
    if r * ratio > limit or ratio / r < 1.0 / limit:
        what = f"wheel speeds change {ratio:.2g} times as fast as a_x says"
        g = next((x for x in (G, 1.0 / G) if 1.0 / _ROUGH < ratio / x < _ROUGH), None)
        ways = ({"a_x": Change(g, radius=1.0)},) if g and are_speeds_right else ()
        advice = "check the units of both (km/h, g), and of the time stamps"
        yield Doubt("scale", ("a_x",), what, advice, ways, ratio)


def _beside(windows: Windows, length: int) -> tuple[float, float, int]:
    """Correlation of dv/dt and a_x over means of so many windows, the ratio of their sizes, and how many means."""
    step = length * windows.step_s
    n = windows["a_x"].size // length * length
    a, v = (x[:n].reshape(-1, length).mean(axis=1) for x in (windows["a_x"], windows.speed))
    if a.size < 3:
        return 0.0, 1.0, 0
    # whatever the length, changes of as many means: the time itself may be wrong
    x, y = changes(a, windows.step_s), changes(np.gradient(v, step), windows.step_s)
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size < RATIOS[0][1] or min(x.std(), y.std()) < LEAST_CHANGE:
        return 0.0, 1.0, 0
    return float(np.corrcoef(x, y)[0, 1]), float(y.std() / x.std()), x.size
