"""Catalogue of safe runs, checks and sensors that may distinguish causes, as data. Runs stay within 3.5 m/s² and 130
km/h on a dry road, 90 km/h on a wet one, and last a minute. They are driven on the road of the log and soon after it,
so that slope and wind are the same."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import cycle

from aqualog.diagnose.drive import Drive
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import PERFECT
from aqualog.model.scenario import Lane, Profile, Scenario, Steering
from aqualog.model.term import Check, Model

__all__ = ["RUNS", "SENSORS", "Run", "Sensor", "checks", "fitting", "programme", "turned"]

LENGTH_S = 60.0
RATE_HZ = 50.0  # [Hz] of a simulated run; residuals are means over 0.1 s
KMH = 1.0 / 3.6
WET_S = 5.0  # [s] on and beside the water, in turn
WET_STEP, WET_LEAST, WET_MOST = 20.0 * KMH, 30.0 * KMH, 90.0 * KMH  # [m/s]


@dataclass(frozen=True, slots=True)
class Run:
    """A run of one minute. `how`: an order; `speed` (t [s], v [km/h]) that the driver keeps to; `minutes` with the way
    there and back; `rolls`: from this time on without drive or brakes [s]; `water`: how it differs from the log's speed
    on water: -1 slower, 1 faster, 0 dry at that speed; None: dry, with the given `speed`."""

    name: str
    how: str
    minutes: float
    speed: Profile = ()
    steering: Steering | None = None
    rolls: float | None = None
    opposite: bool = False
    water: int | None = None


@dataclass(frozen=True, slots=True)
class Sensor:
    """Signals that a log may lack."""

    name: str
    signals: tuple[str, ...]


def _saw(low: float, high: float, up: float, down: float) -> Profile:
    """Speeds up and down between two [km/h] at two accelerations [m/s²], until the minute is over."""
    out, t, v = [(0.0, low), (3.0, low)], 3.0, low
    while t < LENGTH_S:
        v = high if v == low else low
        t += abs(high - low) * KMH / (up if v == high else down)
        out.append((t, v))
    return tuple(out)


_SAME = "on the same road, in the same direction and soon"
RUNS: tuple[Run, ...] = (
    Run("hard_acceleration", f"Accelerate from 40 to 110 km/h at 3 m/s² and slow down, repeatedly, {_SAME}", 2.0,
        _saw(40.0, 110.0, 3.0, 1.5)),
    Run("coast_down", f"Coast down from 120 km/h in neutral, without brakes, {_SAME}", 2.0,
        ((0.0, 100.0), (8.0, 120.0), (10.0, 120.0)), rolls=10.0),
    Run("speed_steps", f"Drive at 40, 60, 80, 100 and 120 km/h for ten seconds each, {_SAME}", 2.0,
        ((0.0, 40.0), (10.0, 40.0), (14.0, 60.0), (22.0, 60.0), (26.0, 80.0), (34.0, 80.0), (38.0, 100.0),
         (46.0, 100.0), (50.0, 120.0), (60.0, 120.0))),
    Run("brake_steps", f"Drive at 100 km/h and brake to 40 km/h at 1.5, 2.5 and 3.5 m/s², {_SAME}", 2.0,
        ((0.0, 100.0), (4.0, 100.0), (15.1, 40.0), (25.0, 100.0), (31.7, 40.0), (42.0, 100.0), (46.8, 40.0),
         (60.0, 100.0))),
    Run("slalom", f"Drive at 60 km/h and swing gently from side to side within the lane, {_SAME}", 2.0,
        ((0.0, 60.0), (60.0, 60.0)), steering=Steering(0.02, 4.0, 3.0)),
    Run("opposite_direction", "Drive the same road in the opposite direction, at 60 to 110 km/h, in the same wind",
        6.0, _saw(60.0, 110.0, 1.0, 0.7), opposite=True),
    Run("second_pass_dry", "Drive the same road at the same speed when it is dry", 2.0, water=0),
    Run("wet_pass_slower", "Drive through the same water 20 km/h slower", 2.0, water=-1),
    Run("wet_pass_faster", "Drive through the same water 20 km/h faster, at most at 90 km/h", 2.0, water=1),
)  # fmt: skip

SENSORS: tuple[Sensor, ...] = (
    Sensor("a reference velocity", ("v_x",)),
    Sensor("a longitudinal accelerometer", ("a_x",)),
    Sensor("wheel torques", ("torque_fl", "torque_fr", "torque_rl", "torque_rr")),
    Sensor("steering angle, gyro and lateral accelerometer", ("steer_angle", "yaw_rate", "a_y")),
)


def checks(effects: frozenset[str]) -> tuple[Check, ...]:
    """Values of these effects that are read without driving, the shortest first."""
    rows = (EFFECTS[name].drive.check for name in effects if name in EFFECTS)
    return tuple(sorted((c for c in rows if c is not None), key=lambda c: (c.minutes, c.name)))


def fitting(effects: frozenset[str], drive: Drive) -> tuple[Run, ...]:
    """Runs that make sense for these effects and signals: water only for effects of water, the way back where it
    changes a sign, bends only where the log shows the steering."""
    rows = [EFFECTS[name] for name in effects if name in EFFECTS]
    on_water, turning = bool(drive.course.lanes) and any(e.of_water for e in rows), any(e.drive.turns for e in rows)
    bends = "steer_angle" in drive.present
    return tuple(
        r for r in RUNS
        if (r.water is None or on_water) and (not r.opposite or turning) and (r.steering is None or bends)
    )  # fmt: skip


def programme(run: Run, drive: Drive) -> Scenario:
    """A run as the scenario of a simulation with perfect sensors, with the car and the water of a drive."""
    course, speed = drive.course, tuple((t, v * KMH) for t, v in run.speed)
    water: tuple[Lane, ...] = ()
    if run.water is not None:
        on = [(course.t >= lane.start) & (course.t < lane.end) for lane in course.lanes]
        v = float(course.v_x[sum(on, start=course.t < 0.0)].mean()) + run.water * WET_STEP
        v = v if run.water == 0 else min(max(v, WET_LEAST), WET_MOST)
        speed = ((0.0, v), (LENGTH_S, v))
    if run.water:
        # water and dry road in turn, as deep as on the log's stretches one after the other
        starts = [WET_S * (1 + 2 * i) for i in range(int(LENGTH_S / (2.0 * WET_S)))]
        turns = zip(starts, cycle(course.lanes), strict=False)
        water = tuple(replace(lane, start=s, end=s + WET_S) for s, lane in turns)
    share = () if run.rolls is None else ((0.0, 1.0), (run.rolls, 1.0), (run.rolls + 0.5, 0.0))
    return Scenario(
        drive.vehicle, duration_s=LENGTH_S, rate_hz=min(RATE_HZ, 1.0 / drive.dt), speed=speed, steering=run.steering,
        drive_share=share, lanes=water, water_scatter=0.0, sensors=PERFECT,
    )  # fmt: skip


def turned(model: Model) -> Model:
    """The model as it acts when the same road is driven the other way: wind and slope come from the other side."""
    return Model(tuple(
        replace(t, values={n: -v for n, v in t.values.items()}, knots=tuple((x, -v) for x, v in t.knots))
        if t.effect.drive.turns else t for t in model.terms
    ))  # fmt: skip
