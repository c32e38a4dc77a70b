"""Estimate the slow offset of the resistance measure on dry road while driving, and freeze it in the wet.

An accelerometer that drifts, a head wind and a wrong rolling resistance all leave a slow offset in the measure (2.9).
Water comes fast and only ever adds resistance. A single scalar has no other means to distinguish the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.features.smoothing import gain

__all__ = ["OnlineParams", "OnlineState", "initial_state", "scan"]


class OnlineParams(NamedTuple):
    """Tuning; made by `make`. Accelerations in m/s², times in s."""

    dt: float
    k_fast: float  # share of a new sample in the short memory
    tau: float  # time constant of the offset once it is known
    guard: float  # the short memory this far above the offset is no offset: nothing is learnt
    certain: float  # from this much learning on the guard watches
    bound: float  # the offset stays within +-bound
    give_up: float  # so long above the guard without a break it is no water lane, and is learnt after all
    below: float  # so long below -guard the offset was wrong: it is learnt anew
    returned: float  # so long back at the level before that, it was a wind that had paused
    v_rest: float  # [m/s] slower than this is standstill
    rest: float  # so long at standstill everything is learnt anew

    @classmethod
    def make(cls, dt: float) -> OnlineParams:
        """Return the tuning for a sample time dt [s].

        An offset with tau = 60 s follows a ramp of 1.6e-3 m/s³ within the guard of 0.1 m/s². Faster ramps are taken for
        water, slower ones for drift (ESC accelerometers: 2e-4 m/s³ rms, up to 1e-3). The guard is half the threshold of
        partial aquaplaning (thesis 2.2: 0.2 m/s²), so that no change that matters enters the offset. The bound is the
        sum of an offset of 0.2, as much of drift, and a head wind of 10 m/s at motorway speed (0.17).
        """
        return cls(dt, gain(1.0, dt), 60.0, 0.1, 1.0, 0.6, 180.0, 10.0, 2.0, 0.5, 2.0)


class OnlineState(NamedTuple):
    """State: offset [m/s²], seconds of learning, short memory of x, seconds above, below and at standstill.

    `before` is the level that was given up for a lower one, NaN without one; `back` the seconds at that level again.
    """

    offset: float
    age: float
    fast: float
    above: float
    beneath: float
    resting: float
    before: float
    back: float


def initial_state(offset: float = 0.0) -> OnlineState:
    """Return the state before the first sample; `offset` [m/s²] is reported until the first sample that can be used."""
    return OnlineState(offset, 0.0, math.nan, 0.0, 0.0, 0.0, math.nan, 0.0)


@compiled
def _scan(p, state, x, v_x, frozen):  # type: ignore[no-untyped-def]
    offset, age, fast, above, beneath, resting, before, back = state
    out = np.empty(x.size)
    for i in range(x.size):
        if not math.isnan(v_x[i]):
            resting = resting + p.dt if v_x[i] < p.v_rest else 0.0
        if resting > p.rest:  # the controller zeroes its sensor there, and the wind may have turned
            age = 0.0
            fast = math.nan
            above = 0.0
            beneath = 0.0
            before = math.nan
        if not math.isnan(x[i]) and not frozen[i]:
            fast = x[i] if math.isnan(fast) else fast + p.k_fast * (x[i] - fast)
            innovation = fast - offset
            watched = age > p.certain
            above = above + p.dt if watched and innovation > p.guard else 0.0
            beneath = beneath + p.dt if watched and innovation < -p.guard else 0.0
            if beneath > p.below:  # water only adds: less than the dry resistance shows that it was not the dry one
                age = 0.0
                beneath = 0.0
                before = offset
                offset = fast
            # a car that leaves the lee of a wood meets the same wind again; water as large as that is reported first
            back = back + p.dt if above > 0.0 and abs(fast - before) < 0.5 * p.guard else 0.0
            if back > p.returned:
                offset = before
                age = p.certain
                above = 0.0
                before = math.nan
            if not (0.0 < above <= p.give_up) and not beneath > 0.0:
                age = min(age + p.dt, p.tau)
                # the short memory is late, so that little of a step is learnt before it passes the guard
                offset += p.dt / age * ((fast if watched else x[i]) - offset)
                offset = min(max(offset, -p.bound), p.bound)
        out[i] = offset
    return out, OnlineState(offset, age, fast, above, beneath, resting, before, back)


def scan(
    p: OnlineParams, state: OnlineState, x: FloatArray, v_x: FloatArray, frozen: BoolArray
) -> tuple[FloatArray, OnlineState]:
    """Estimate the offset of the resistance measure over a drive or a piece of one.

    Parameters
    ----------
    state : OnlineState
        From `initial_state` or the piece before.
    x : array (n,)
        Resistance measure (2.9) where the balance of forces can be trusted; NaN where it is not to be used (braking,
        cornering, gear shift, gap). Low speeds, 5 m/s and more, help: water hardly shows there. [m/s²]
    v_x : array (n,)
        Velocity, to see standstill; NaN holds. [m/s]
    frozen : bool array (n,)
        Suspicion of water from elsewhere: any wheel criterion, a lost slip slope. The offset is frozen, no time counts.

    Returns
    -------
    offset : array (n,)
        Value to subtract from the measure, after this sample; within ±bound. [m/s²]
    state : OnlineState

    The estimate is a running mean at first (gain dt / age), then a low-pass with the time constant tau. It is frozen
    outside ±guard: above it for at most `give_up` seconds, below for `below` seconds. Then it restarts from the lower
    level. It returns to the old level if the measure stays within half a guard of that level for `returned` seconds.
    It restarts at standstill, too. Limits: a constant x gives that constant from the first sample on. Water that is
    there from the first sample on cannot be distinguished from an offset: a log that begins on water hides it.

    Thesis: 2.2 asks for a separate estimator of mass and rolling resistance on dry road and gives no method. This one
    estimates their joint effect at even traction only.
    """
    found: tuple[FloatArray, OnlineState] = _scan(p, state, *plain(x, v_x, frozen))
    return found
