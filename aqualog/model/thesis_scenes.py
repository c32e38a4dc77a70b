"""The drives behind single figures of the thesis' chapter 2, as scenarios.

Car, tyre, pressure class, depth, times of entry, speeds and manoeuvres follow the text where it names them. Other
depths and speeds are chosen so that the described course of events results. So is the seed, which decides where along
the lane the contact is worst. Tyres and water are those of every other drive.
"""

from __future__ import annotations

from dataclasses import replace

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.model.programme import LEFT_SHARE, SEDAN, SUV, SUV_REAR
from aqualog.model.scenario import Lane, Profile, Scenario, Steering
from aqualog.model.sketch import KMH, slalom_angle
from aqualog.model.tyre import TYRES

__all__ = ["SCENES", "scene"]

SCENES = ("2.8", "2.9", "2.21", "2.22", "2.23", "2.25")
LOW = 1.9e5  # [Pa]
WORN = TYRES["worn_summer"]


def scene(number: str) -> Scenario:
    """The drive of a figure.

    Raises
    ------
    ConfigError
        If there is no such scene.
    """
    scenes = {
        # full aquaplaning: front right spins down, rear right spins up; 0.8 mm (C28)
        "2.8": _sedan(118.0, 0.8, entry_s=23.0, on_lane_s=4.0, a=0.5, seed=3),
        # minor spin-downs of the front right wheel from the entry on, almost constant speed; 0.8 mm, 23 s (C33)
        "2.9": _sedan(104.0, 0.8, entry_s=23.0, on_lane_s=5.0, seed=3),
        # below full speed: rear slip rises, minor spin-downs front right; 0.8 mm, 24 s (C72-C77)
        "2.25": _sedan(107.0, 0.8, entry_s=24.0, on_lane_s=6.0, seed=3),
        "2.21": _deceleration(),
        "2.22": _two_accelerations(),
        "2.23": _slalom(),
    }
    if number not in scenes:
        raise ConfigError(f'no scene of figure "{number}"', expected=", ".join(SCENES))
    return scenes[number]


def _sedan(kmh: float, depth_mm: float, *, entry_s: float, on_lane_s: float, seed: int, a: float = 0.0) -> Scenario:
    """Rear-wheel drive on worn summer tyres with low pressure; less water in the left track."""
    v, depth, end = kmh * KMH, depth_mm * 1e-3, entry_s + on_lane_s
    lane = Lane(entry_s, end, depth_left=LEFT_SHARE * depth, depth_right=depth, irregularity_left=0.3)
    speed: Profile = ((0.0, v), (entry_s, v), (end + 3.0, v + a * (on_lane_s + 3.0)))
    return _drive(SEDAN, speed, (lane,), end + 3.0, seed)


def _drive(
    car: Vehicle,
    speed: Profile,
    lanes: tuple[Lane, ...],
    duration_s: float,
    seed: int,
    steering: Steering | None = None,
) -> Scenario:
    return Scenario(car, WORN, WORN, LOW, LOW, duration_s=duration_s, seed=seed, speed=speed, lanes=lanes,
                    steering=steering)  # fmt: skip


def _deceleration() -> Scenario:
    """All-wheel drive with 2 % of the torque in front, straight on, slowing down slightly from 112 km/h (C61)."""
    lane = Lane(10.0, 15.0, depth_left=0.35e-3, depth_right=1.3e-3)
    return _drive(SUV_REAR, ((0.0, 112 * KMH), (10.0, 112 * KMH), (18.0, 103 * KMH)), (lane,), 18.0, 3)


def _two_accelerations() -> Scenario:
    """All-wheel drive, straight on: rolling at 18 s, a short push before 19 s, rolling again, faster from 22.7 s (C62).

    60 % of the torque go to the front axle.
    """
    speed: Profile = (
        (0.0, 112 * KMH), (18.6, 112 * KMH), (19.1, 116 * KMH), (22.7, 115 * KMH), (25.0, 129 * KMH), (28.0, 129 * KMH)
    )  # fmt: skip
    drive = _drive(SUV, speed, (Lane(17.5, 24.5, depth_left=1.3e-3, depth_right=1.3e-3),), 28.0, 5)
    return replace(drive, split_rear=((0.0, 0.4),))


def _slalom() -> Scenario:
    """Slalom of 2 m/s² and 4 s, almost constant speed; water at 23 s, left from 26 s, right from 27 s on (C63)."""
    v = 112 * KMH
    steering = Steering(slalom_angle(SUV_REAR, WORN, v, 2.0), 4.0, 2.0)
    lanes = (
        Lane(22.9, 23.3, depth_left=1.6e-3, depth_right=1.6e-3),
        Lane(26.0, 27.1, depth_left=1.2e-3, depth_right=0.3e-3),
        Lane(27.1, 29.0, depth_left=1.2e-3, depth_right=1.6e-3),
    )
    return _drive(SUV_REAR, ((0.0, v),), lanes, 32.0, 8, steering)
