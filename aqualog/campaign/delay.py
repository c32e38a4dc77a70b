"""Delay of a campaign's reference velocity, estimated from dry driving at different accelerations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.campaign.bins import NO_DRIVETRAIN, Cell, Picked, Plan, cells
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.core.intervals import NOWHERE, Interval
from aqualog.core.moments import Design
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.regression import estimate

__all__ = ["Delay", "Late", "delays", "late_slip", "source_of"]

LEAST_RUNS = 3
HALF_MAX = 0.03  # [s] half interval up to which a delay is used: at 90 km/h 0.1 % of slip per m/s^2
LATEST = 1.0  # [s]
U_MIN = 1e-3  # [1/s] a / v: 0.03 m/s^2 at 100 km/h
ROUNDS, STEP = 5, 1e-4  # of the estimate, each around the delay of the one before [s]
_V_UNIT = 30.0  # [m/s]

Source = tuple[str, str]
"""Vehicle file and reference of the slip."""


@dataclass(frozen=True, slots=True)
class Delay:
    """Delay of v_x against the wheels of one car, late positive. [s]

    `value` and `ci` are NaN without an estimate; `reason` then gives the cause, and slopes are fitted with a delay.
    """

    vehicle: str
    value: float
    ci: Interval
    runs: int
    samples: int
    reason: str = ""

    @property
    def told(self) -> bool:
        """Whether there is a value."""
        return not self.reason

    @property
    def half(self) -> float:
        """Half of the 95 % interval. [s]"""
        return 0.5 * (self.ci[1] - self.ci[0])


class Late(NamedTuple):
    """What a velocity that is late by tau adds to the slip: `slip` (n,), and `rate` (n,), its change with tau [1/s]."""

    slip: FloatArray
    rate: FloatArray


def late_slip(samples: RunSamples, tau: float) -> Late:
    """What a delay of `tau` [s] adds to the slips of a run: the speed gained in that time over the speed.

    v(t) - v(t - tau) is the integral of the acceleration. a tau would be right where the acceleration stays as it is;
    where it changes sign every 3 s, it is 8 % too much at 0.25 s. Without a delay, the slip is zero and `rate` a / v.
    """
    v, rate, t = samples.array("v_x"), samples.array("a_over_v"), samples.t
    if tau == 0.0 or t.size < 2:
        return Late(0.0 * rate, rate)
    a = v * rate
    gained = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * np.nan_to_num(a[1:] + a[:-1]))])
    unknown = np.cumsum(np.isnan(a))
    is_known = (np.interp(t - tau, t, unknown, left=-1.0) == unknown) & np.isfinite(a)
    if tau < 0.0:
        is_known &= t - tau <= t[-1]
    slip = np.where(is_known, (gained - np.interp(t - tau, t, gained)) / v, np.nan)
    return Late(slip, np.where(is_known, np.interp(t - tau, t, a) / v, np.nan))


def source_of(info: RunInfo) -> Source:
    """Properties that runs with one delay share."""
    return info.run.vehicle.stem, str(info.about.get("slip_against", "none"))


def delays(data: CampaignData) -> dict[Source, Delay]:
    """Delays of all cars whose slip refers to a measured velocity.

    A late reference adds about tau a / v to every slip, see `late_slip`. On dry road the free wheels' slip consists of
    this delay term, an offset of the run (radii, scale of v_x), and the growth of radii with v². On all-wheel drive the
    mean slip also depends on the mean traction; both are estimated together where the data allow. The estimate is
    corrected for the noise of a / v (free wheels) or of the traction. What each round leaves of the delay, the next
    one estimates around it.
    """
    first = {source_of(info): info for info in reversed(data.done) if source_of(info)[1] == "v_x"}
    found: dict[str, Delay] = {}
    for _ in range(ROUNDS):
        dry = _dry(data, {name: d.value for name, d in found.items() if d.told})
        new = {s[0]: _delay(s[0], first[s], dry.get(s[0]), found.get(s[0])) for s in first}
        is_done = all(not d.told or (n in found and abs(d.value - found[n].value) < STEP) for n, d in new.items())
        found = new
        if is_done:
            break
    return {s: found[s[0]] for s in dict.fromkeys(map(source_of, data.done)) if s in first}


def _dry(data: CampaignData, known: Mapping[str, float]) -> dict[str, Cell]:
    """Dry driving of each car against v_x, without the slip of the delay that is known."""

    def columns(info: RunInfo, samples: RunSamples, _: str) -> Picked | str:
        if source_of(info)[1] != "v_x":
            return "no measured velocity"
        if not info.vehicle.knows_drivetrain:
            return NO_DRIVETRAIN
        is_awd = info.vehicle.drivetrain == "awd"
        wheels = [w for w in WHEELS if is_awd or w not in info.vehicle.driven]
        slip, mu = (np.mean([samples.array(f"{n}_{w}") for w in wheels], axis=0) for n in ("slip", "mu"))
        late, v = late_slip(samples, known.get(source_of(info)[0], 0.0)), samples.array("v_x") / _V_UNIT
        # behind the lane a wheel that floated comes back while the car speeds up again
        spun = [samples.bits(f"{kind}_{w}") for w in wheels for kind in ("spin", "minor")]
        without = {"a wheel spins": samples.around(np.any(spun, axis=0))}
        columns = {"u": late.rate, "slip": slip - late.slip, "mu": mu if is_awd else np.zeros_like(v), "v": v}
        return Picked(columns, without)

    found, _ = cells(
        data, Plan(("vehicle",)), wheels=lambda _: ("",), columns=columns, road="dry", by_speed=False
    )  # fmt: skip
    return {cell.infos[0].run.vehicle.stem: cell for cell in found}


def _delay(name: str, first: RunInfo, dry: Cell | None, before: Delay | None) -> Delay:
    runs, samples = (len(dry.infos), dry.pool.run.size) if dry is not None else (0, 0)
    if dry is None or runs < LEAST_RUNS:
        reason = f"{runs} runs with dry, straight driving against v_x, at least {LEAST_RUNS} needed"
        return Delay(name, math.nan, NOWHERE, runs, samples, reason)
    is_awd = first.vehicle.drivetrain == "awd"
    c = dry.pool.columns
    columns, scatters = [c["u"], np.ones_like(c["u"]), c["v"] ** 2], [False, True, False]
    if is_awd:
        # the brush's curve, s = k mu (1 + mu / 3 mu_max ...), looks like a delay: both grow with the acceleration
        columns, scatters = [*columns, c["mu"], c["mu"] ** 2], [*scatters, True, False]
    noisy = tuple(i == (3 if is_awd else 0) for i in range(len(columns)))
    design = Design(np.stack(columns), c["slip"], dry.pool.run, dry.pool.step, tuple(scatters), noisy)
    found = estimate(design, robust=True)
    known = before.value if before is not None and before.told else 0.0
    low, high = found.interval(0)
    tau, ci = known + float(found.value[0]), (known + low, known + high)
    half = 0.5 * (ci[1] - ci[0])
    reason = ""
    if not float(np.ptp(c["u"])) > U_MIN:
        reason = "no accelerations in the dry driving"
    elif not half <= HALF_MAX:
        with_slope = " apart from the slope" if is_awd else ""
        reason = f"known only to ±{half:.3f} s{with_slope}: the accelerations of the dry driving differ too little"
    elif not abs(tau) <= LATEST:
        reason = f"{tau:+.2f} s is too long for the delay of a velocity: check the clocks (`aqualog align`)"
    return Delay(name, tau if not reason else math.nan, ci if not reason else NOWHERE, runs, samples, reason)
