"""Scales: speeds, accelerations and torques that are too large or too small for each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from aqualog.checks.doubts import Doubt
from aqualog.checks.relations import changes
from aqualog.checks.windows import Windows, middle
from aqualog.core.records import FloatArray

__all__ = ["scale_doubts"]

LEAST_CORRELATION = 0.6
LEAST_WINDOWS = 40
RATIO = 1.8  # between twice the noise of such a ratio and the 2.2 of mph, the 3.6 of km/h, the 9.81 of g
MOVING = 3.0  # [m/s] from which a ratio of speeds means something


def scale_doubts(windows: Windows) -> Iterator[Doubt]:
    """Yield wheels that always turn at another speed than the others, and scales that do not fit each other."""
    yield from _speeds(windows)
    yield from _acceleration(windows)


def _speeds(windows: Windows) -> Iterator[Doubt]:
    wheels = windows.wheels
    if not wheels:
        return
    common = middle(list(wheels.values()))
    ratios: Mapping[str, float] = {w: _ratio(x, common) for w, x in wheels.items()} if len(wheels) > 2 else {}
    odd = {w: r for w, r in ratios.items() if not 1 / RATIO < r < RATIO}
    if odd:
        told = ", ".join(f"omega_{w} is {r:.2g} times" for w, r in odd.items())
        advice = "check its unit (km/h, m/s, rad/s) and scale"
        yield Doubt("scale", tuple(f"omega_{w}" for w in odd), f"{told} the speed of the other wheels", advice)
        return
    ratio = _ratio(common, windows["v_x"]) if "v_x" in windows else 1.0
    if not 1 / RATIO < ratio < RATIO:
        what = f"wheel speeds times radius are {ratio:.2g} times v_x"
        yield Doubt("scale", ("v_x",), what, "check the units of both (km/h, m/s, rad/s)", value=ratio)


def _ratio(x: FloatArray, y: FloatArray) -> float:
    """Return the median of x over y where both are known and the faster one moves; 1 where too few do."""
    with np.errstate(invalid="ignore"):
        good = (np.maximum(x, y) > MOVING) & (np.minimum(x, y) > 0.0)
    return float(np.median(x[good] / y[good])) if int(good.sum()) >= LEAST_WINDOWS else 1.0


def _acceleration(windows: Windows) -> Iterator[Doubt]:
    if "a_x" not in windows or not windows.wheels or windows["a_x"].size < 3:
        return
    step = windows.step_s
    x, y = changes(windows["a_x"], step), changes(np.gradient(windows.speed, step), step)
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size < LEAST_WINDOWS or not x.any() or not y.any() or np.corrcoef(x, y)[0, 1] < LEAST_CORRELATION:
        return
    ratio = float(y.std() / x.std())
    if not 1 / RATIO < ratio < RATIO:
        what = f"wheel speeds change {ratio:.1f} times as fast as a_x says"
        yield Doubt("scale", ("a_x",), what, "check the units of both (km/h, g)", value=ratio)
