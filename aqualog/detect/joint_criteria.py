"""Joint detector 1: the resistance opens a gate, and at least one other criterion is met (thesis 2.5, Fig. 2.24)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from aqualog.core.notation import SIDES, WHEELS
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect import cusum, other_surface
from aqualog.detect.braking import UNLOGGED, began_free, hold_on, lasting
from aqualog.detect.cusum import CusumParams
from aqualog.detect.detector import Detector, Needs, Output, Scene, Setup, missing_wheels, traction
from aqualog.detect.events import AFTER
from aqualog.detect.margin.watch import MARGIN, PROBABLE
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN, VAR_MIN
from aqualog.detect.resistance import LEVEL, MEASURE, RESISTANCE
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP
from aqualog.detect.spin import HELD_S, MU_FULL, SLIP_FULL, SPIN_DOWN, spins_round
from aqualog.detect.spin_up import SPIN_UP
from aqualog.features.stream import Features
from aqualog.physics.load import G
from aqualog.physics.slip import slip_of_wheel_speed

__all__ = [
    "ALONE", "CRITERIA", "FULL", "GATE", "GATED", "GATE_AFTER", "GATE_HOLD", "HOLD", "JOINT_CRITERIA", "MAY_BE_WATER",
    "ROTATES", "SLOPE", "Criteria", "JointCriteriaWatch", "criteria", "gate_params", "is_alone", "joint_needs",
    "joint_severity", "without_start",
]  # fmt: skip

THRESHOLD = 0.03  # [m/s]
GATE_HOLD = 1.0  # [s] the resistance gate stays open this long
HOLD = 0.5  # [s] a warning outlasts its criteria by this
ALONE = 0.7  # of a wheel's variance that the other axle must not have: gravel shakes both (C33)
SLIP_STOPPED = -0.10  # [-] a braked wheel this far behind slides on any road
A_STOPPED = -3.0  # [m/s^2] the water takes the brakes' force from the car too
V_STOPPED = 17.0  # [m/s] slower, no film of road water carries a wheel: `other_surface`
BEGIN = 3.0  # [s] of a log in which no minor spin-down begins, and an offset may have been learnt in water
CONTACT_PARTIAL = 0.7  # [-] thesis 2.2
_NUMBERED = {1: SPIN_DOWN, 2: MINOR_SPIN_DOWN, 3: SPIN_UP, 4: SLIP_SLOPE_DROP, 5: RESISTANCE}
CRITERIA = {d.name: number for number, d in _NUMBERED.items()}
SLOPE = 4
GATED = (1, 2, 3, 4)  # one of these must be met while the gate is open; 5 needs no gate
_OF_WHEELS = (SPIN_DOWN.name, MINOR_SPIN_DOWN.name, SPIN_UP.name)
# as later detectors find them
GATE, GATE_AFTER, MAY_BE_WATER, FULL = "gate", "gate_after", "may_be_water", "criterion_full"
ROTATES = "rotates"  # the car does, or has a moment ago


@dataclass(frozen=True, slots=True)
class Criteria:
    """Which criteria are met, and how far each wheel has lost contact; arrays (n,)."""

    met: Mapping[int, BoolArray]
    is_full: BoolArray
    slip_min: FloatArray

    def behind(self, gate: BoolArray, slope: BoolArray) -> dict[int, BoolArray]:
        """Return the criteria that count: 1 to 4 behind the gate, 4 also where water may cause a lost slope."""
        return {
            k: bits if k not in GATED else bits & gate & slope if k == SLOPE else bits & gate
            for k, bits in self.met.items()
        }


def criteria(
    tracks: Sequence[tuple[Track, BoolArray]],
    v_w: Mapping[str, FloatArray],
    mu: Mapping[str, FloatArray | None],
    v_x: FloatArray,
) -> Criteria:
    """Evaluate criteria 1 to 5 from the tracks of the single detectors, of a piece of the drive. (n,)

    Tracks of wheels come with the detections that began without a braking force; tracks of other detectors are
    ignored. `v_w` centre-line wheel speeds and `v_x` [m/s]; `mu` traction coefficients, None if not known [-].

    Thesis: section 2.5 (C65-C69). 1 to 3 do not count under a negative tyre force; a detection that began without it
    stays when the driver brakes after it. 4: slope below half of the dry one, tyre driven, wheel acceleration calm.
    """
    n = v_x.size
    met = {number: np.zeros(n, dtype=bool) for number in CRITERIA.values()}
    full = np.zeros(n, dtype=bool)
    slip_min = np.full(n, np.nan)
    for track, bits in tracks:
        if track.detector not in CRITERIA:
            continue
        met[CRITERIA[track.detector]] |= bits
        if track.wheel is None or track.detector not in _OF_WHEELS:
            continue
        slip = slip_of_wheel_speed(v_w[track.wheel], v_x)
        mu_wheel = mu[track.wheel]
        with np.errstate(invalid="ignore"):
            if track.detector != SPIN_UP.name:
                full |= bits & (slip < SLIP_FULL)
            elif mu_wheel is not None:
                full |= bits & (mu_wheel < MU_FULL)
        slip_min = np.fmin(slip_min, np.where(bits, slip, np.nan))
    return Criteria(met, full, slip_min)


def gate_params(dt: float, threshold: float = THRESHOLD) -> CusumParams:
    """Tuning of the gate, sensitive: it only has to show that something holds the car back (C64)."""
    return CusumParams(0.5 * LEVEL, threshold, 2.0 * threshold, dt)


class JointCriteriaWatch:
    """Joint detector 1: criteria 1 to 4 behind the resistance gate, 5 beside them.

    The gate, where water may be the cause of a lost slope, and where the car spins round (n,) are shared as `GATE`,
    `MAY_BE_WATER` and `ROTATES`. Features:
    `criterion_1` ... `criterion_5`, `criterion_full`, `joint_gate`.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._dt = setup.dt
        self._params = gate_params(setup.dt, setup.threshold)
        self._sum, self._ages = cusum.initial_state(), cusum.new_ages()
        self._other = other_surface.OtherParams.make(setup.dt)
        self._surface = other_surface.initial_state()
        self._free: dict[tuple[str, str], tuple[bool, bool]] = {}
        self._open = self._hold = self._recent = self._round = self._rows = 0
        self._stopped = dict.fromkeys(WHEELS, 0)

    def push(self, scene: Scene) -> Output:
        """Take the next piece: one track, the number of criteria that count. [-]"""
        f, x = scene.f, scene.shared[MEASURE]
        g, gate, self._sum = cusum.scan(self._params, self._sum, x)
        _, after, self._ages = cusum.ages(self._dt, self._ages, g, gate)
        gate, self._open = hold_on(gate, self._open, seconds=GATE_HOLD, dt=self._dt)
        slope = self._may_be_water(scene, x)
        # on its way from one side to the other the drift is small for a moment
        rotates, self._round = hold_on(spins_round(f, beyond=G), self._round, seconds=HOLD, dt=self._dt)
        found = criteria(
            [(t, self._began_free(t, scene, rotates)) for t in scene.tracks],
            {w: f[f"v_w_{w}"] for w in scene.wheels},
            {w: traction(f, w) for w in WHEELS},
            f["v_x_hat"],
        )
        bits, stopped = found.behind(gate, slope), self._stopped_by_water(scene)
        bits[1] |= stopped
        early = self._begins_in_water(scene)
        sure = stopped | early
        recent, self._recent = hold_on(sure, self._recent, seconds=HOLD, dt=self._dt)
        count = np.sum([early, *(bits[k] for k in GATED)], axis=0, dtype=np.float64)
        warned: BoolArray = np.asarray((count > 0) & (sure | ~np.isnan(x)))
        active, self._hold = hold_on(warned, self._hold, seconds=HOLD, dt=self._dt)
        name = self._setup.detector.name
        track = Track(name, None, None, "-", np.where(np.isnan(x) & ~sure, np.nan, count), 1.0, active)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "slip_min": ("min", found.slip_min),
            "delta_a_x_max": ("max", scene.unbraked_resistance),
            **{f"criterion_{k}": ("any", b) for k, b in bits.items()},
            **{f"at_start_{k}": ("at_start", b) for k, b in bits.items()},
            f"at_start_{MARGIN.name}": ("at_start", early),
            "full": ("any", found.is_full | stopped),
            AFTER: ("last", np.where(recent, np.minimum(after, HOLD), after)),
        }
        features = {f"criterion_{k}": b.astype(np.float64) for k, b in found.met.items()}
        features["joint_gate"] = gate.astype(np.float64)
        features[FULL] = found.is_full.astype(np.float64)
        shared = {GATE: gate | stopped, GATE_AFTER: after, MAY_BE_WATER: slope, ROTATES: rotates}
        return Output(((track, evidence),), features, shared)

    def _may_be_water(self, scene: Scene, x: FloatArray) -> BoolArray:
        slopes = scene.of(SLIP_SLOPE_DROP)
        loss = reduce(np.fmax, (t.statistic for t in slopes), np.full(scene.size, np.nan))
        dropped = np.any([np.zeros(scene.size, dtype=bool), *(t.active for t in slopes)], axis=0)
        allowed, self._surface = other_surface.scan(self._other, self._surface, x, scene.f["v_x_hat"], dropped, loss)
        return allowed

    def _stopped_by_water(self, scene: Scene) -> BoolArray:
        """Where a braked wheel slides and goes on slowing down although its brake is let off. (n,)

        A road, and be it ice, turns such a wheel up again: its friction is a negative traction. Only water stops it.
        A light braking that may be in no torque shuts the gate as well.
        """
        f, stopped = scene.f, np.zeros(scene.size, dtype=bool)
        light = scene.braking.get(UNLOGGED, np.zeros_like(stopped))
        for w in scene.wheels:
            if f"mu_{w}" not in f:
                continue
            with np.errstate(invalid="ignore"):
                slides = (scene.braking[w] | light) & (f["v_x_hat"] > V_STOPPED) & (f["a_kin_slow"] > A_STOPPED)
                slides &= slip_of_wheel_speed(f[f"v_w_{w}"], f["v_x_hat"]) < SLIP_STOPPED
                slows = slides & (f[f"mu_{w}"] > 0.0)
            least = max(2, round(HELD_S / self._dt))
            bits, self._stopped[w] = lasting(slows, self._stopped[w], least=least, stays=slides)
            stopped |= bits
        return stopped

    def _begins_in_water(self, scene: Scene) -> BoolArray:
        """Where a log begins on water, and the front axle has probably lost three tenths of its contact (n,).

        What this car shows on dry road is not known yet: only slips, shake and resistance together show water. Gravel
        shakes both axles.
        """
        f, none, first = scene.f, np.full(scene.size, np.nan), self._rows
        self._rows += scene.size
        with np.errstate(invalid="ignore"):
            lost = f.get("contact_expected", none) < CONTACT_PARTIAL
            lost &= (f.get("water_probability", none) > PROBABLE) & (f["v_x_hat"] > V_STOPPED)
            alone = np.zeros(scene.size, dtype=bool)
            for pair in SIDES.values():
                front, rear = (f.get(f"variance_{w}", none) for w in pair)
                alone |= np.minimum(front, rear) < (1.0 - ALONE) * np.maximum(front, rear)
        return np.asarray(lost & alone & (np.arange(first, self._rows) * self._dt < BEGIN) & ~scene.is_braking)

    def _began_free(self, track: Track, scene: Scene, rotates: BoolArray) -> BoolArray:
        if track.detector not in _OF_WHEELS or track.wheel is None:
            return track.active
        key = (track.detector, track.wheel)
        bits, self._free[key] = began_free(
            track.active, scene.braking[track.wheel], self._free.get(key, (False, False))
        )
        if track.detector == MINOR_SPIN_DOWN.name and track.wheel in self._setup.vehicle.driven:
            # its torque swings it both ways: only a free wheel must fall behind the car (C66)
            with np.errstate(invalid="ignore"):
                shakes = track.statistic > VAR_MIN * track.threshold
            bits = bits | (shakes & is_alone(track, scene.f) & ~scene.braking[track.wheel])
        bits = bits & ~rotates
        # a wheel may spin up on water before the car spins round, and go on where the road is dry
        return bits & ~spins_round(scene.f) if track.detector == SPIN_UP.name else bits


def is_alone(track: Track, f: Features) -> BoolArray:
    """Where the other axle has less than three tenths of the variance of a wheel's acceleration. (n,)"""
    with np.errstate(invalid="ignore"):
        return np.asarray(track.statistic > ALONE * f.get(f"variance_{track.wheel}", track.statistic))


def joint_needs(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    """Name what a joint detector needs: the resistance and any wheel; it lacks the slope if that does not run."""
    omega = missing_wheels(have)
    gone = SLIP_SLOPE_DROP.needs(vehicle, have, rate_hz).missing
    return Needs(
        (*RESISTANCE.needs(vehicle, have, rate_hz).missing, *(omega if len(omega) == len(WHEELS) else ())),
        (*omega, *((SLIP_SLOPE_DROP.name,) if gone else ())),
    )


def joint_severity(evidence: Mapping[str, Any]) -> str:
    """Return full where a wheel has lost the road."""
    return "full" if evidence.get("full", False) else "partial"


def without_start(evidence: Mapping[str, Any]) -> dict[str, Any]:
    """Return evidence without what was gathered at the start only."""
    return {k: v for k, v in evidence.items() if not k.startswith("at_start_")}


def _explain(evidence: dict[str, Any]) -> dict[str, Any]:
    """Add `decided_by`: the criteria that were met when the warning began."""
    numbered: Mapping[Any, Detector] = {**_NUMBERED, MARGIN.name: MARGIN}
    met = [d.name for k, d in numbered.items() if evidence.get(f"at_start_{k}")]
    return {**without_start(evidence), "decided_by": met}


JOINT_CRITERIA = Detector(
    name="joint_criteria",
    title="Joint criteria",
    unit="m/s",
    meaning="sum of the resistance measure beyond 0.1 m/s² that opens the gate",
    statistic="wheel criteria met while the resistance gate is open",
    threshold=THRESHOLD,
    needs=joint_needs,
    start=JointCriteriaWatch,
    kind="joint",
    reads=(*_NUMBERED.values(), MARGIN),
    severity=joint_severity,
    explain=_explain,
)
