"""Hold-out on measured drives: torque in, speed out, with parameters from two trips; nothing is fitted to the others.

`python tests/real/holdout.py FOLDER` prints the table; FOLDER holds the BMW i3 trips.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aqualog.config.vehicle import load_vehicle
from aqualog.model.follow import replay
from aqualog.model.plant import build_plant
from aqualog.model.tyre import TYRES

HERE = Path(__file__).resolve().parent
FITTED = ("A10", "A11")
HELD_OUT = ("A05", "A12", "A15", "A17", "B24", "B26")
TORQUE_SCALE = 8.284  # motor to wheels, fitted with the vehicle file on A10 and A11
WINDOW_S = 30.0
MIN_SPEED = 5.0  # [m/s] below, creeping and standstill rule
STEP_S = 0.1


@dataclass(frozen=True)
class Holdout:
    """RMS of the speed error after 10 and 30 s of free running, of the acceleration, and the latter's mean."""

    trip: str
    windows: int
    v_10s: float
    v_30s: float
    v_30s_median: float
    a_rms: float
    a_mean: float
    a_spread: float  # of the measured acceleration itself


def plant_of_trips():
    car = load_vehicle(HERE / "bmw_i3.toml")
    return build_plant(car, TYRES["worn_summer"], TYRES["worn_summer"])


def read_trip(folder, trip):
    lines = (folder / f"Trip{trip}.csv").read_text(encoding="latin1").splitlines()[1:]
    rows = np.array([[float(x or "nan") for x in line.split(";")[:6]] for line in lines])
    t = np.arange(0.0, rows[-1, 0], STEP_S)
    v, elevation, torque, a = (np.interp(t, rows[:, 0], rows[:, i]) for i in (1, 2, 4, 5))
    return t, v / 3.6, elevation, torque * TORQUE_SCALE, a


def slope_angle(v, elevation):
    """Slope angle over 200 m of way, from an elevation in steps of a metre."""
    s = np.cumsum(v) * STEP_S
    grid = np.arange(0.0, s[-1], 10.0)
    height = np.interp(grid, s, elevation)
    smooth = np.convolve(np.pad(height, 10, mode="edge"), np.ones(21) / 21, "valid")
    return np.interp(s, grid, np.gradient(smooth, 10.0))


def hold_out(folder, trip, plant):
    t, v, elevation, torque, a = read_trip(folder, trip)
    theta = slope_angle(v, elevation)
    n = round(WINDOW_S / STEP_S)
    errors, acceleration, measured = [], [], []
    for i in range(0, t.size - n - 1, n):
        w = slice(i, i + n + 1)
        if v[w].min() < MIN_SPEED:
            continue
        r = replay(plant, t[w], torque[w], split_rear=1.0, v_0=float(v[i]), grade=theta[w])
        errors.append((r.v_x[n // 3] - v[i + n // 3], r.v_x[-1] - v[i + n]))
        acceleration.append(r.a_x - a[w])
        measured.append(a[w])
    e, d = np.array(errors), np.concatenate(acceleration)
    rms = np.sqrt((e**2).mean(axis=0))
    return Holdout(
        trip, len(e), float(rms[0]), float(rms[1]), float(np.median(np.abs(e[:, 1]))),
        float(np.sqrt((d**2).mean())), float(d.mean()), float(np.concatenate(measured).std()),
    )  # fmt: skip


def main():
    plant = plant_of_trips()
    for trip in (*FITTED, *HELD_OUT):
        h = hold_out(Path(sys.argv[1]), trip, plant)
        print(
            f"| {trip} | {h.windows} | {h.v_10s:.2f} | {h.v_30s:.2f} | {h.v_30s_median:.2f} | {h.a_rms:.3f} | {h.a_mean:+.3f} | {h.a_spread:.3f} |"
        )


if __name__ == "__main__":
    main()
