"""The straight test on logs of a simulator that shares neither code nor laws with the library (`tests.blind.multibody`).

`python -m tests.trade.study_multibody [--runs 6]`: an electric rear-driven car, 8 tyres, 7 mm in the right track.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

import numpy as np

from aqualog.align.load import load_signals
from aqualog.core.vehicle import Vehicle
from aqualog.trade.entry import KMH, Entry
from aqualog.trade.evaluation import Options, evaluated
from aqualog.trade.lane import mean_over
from aqualog.trade.limits import defaults
from aqualog.trade.straight import StraightRun, crossing, straight_runs
from tests.blind.multibody.car import NO_ODD, Car, draw_car, of_the_day, vehicle_file
from tests.blind.multibody.driver import ROWS, drive_along
from tests.blind.multibody.make import write_messages
from tests.blind.multibody.roads import Place, build_road
from tests.blind.multibody.sensors import NOISES, Message, measure

DT = 0.01
LANE_M, DRY_M = 700.0, 60.0
GAINS = (0.86, 0.90, 0.94, 0.98, 1.02, 1.06, 1.10, 1.14)  # of the contact that a film takes, tyre by tyre
START, ACCELERATION, DURATION = 45.0 / 3.6, 1.3, 22.0  # [m/s, m/s², s]


def a_car() -> tuple[Car, Vehicle]:
    """An electric rear-driven car, which has one gear, and the vehicle file of its calibration."""
    for seed in range(200):
        car, drivetrain = draw_car(np.random.default_rng((24, seed)))
        if drivetrain == "rwd" and car.is_electric > 0.5:
            return car, vehicle_file(car, drivetrain, np.random.default_rng((24, seed, 3)))
    raise AssertionError("no such car")


def one(car: Car, vehicle: Vehicle, tyre: int, seed: int, folder: Path) -> tuple[StraightRun, float]:
    """A run as it is measured, and the true speed of 15 % slip. [km/h]"""
    rng = np.random.default_rng((24, tyre, seed))
    own = of_the_day(car, rng)._replace(contact_gain=np.full(4, GAINS[tyre]))
    n = round(DURATION / DT)
    a = ACCELERATION * (1.0 + 0.02 * rng.standard_normal())
    target = START + a * np.maximum(np.arange(n + 200) * DT - 1.0, 0.0)
    fine, slow, _ = build_road("country", rng, 1000.0, Place())
    slow[:, :2] = 0.0
    base = own.l_f + own.l_r
    slow[round(DRY_M) : round(DRY_M + LANE_M), 3] = 7e-3 * (1.0 + 0.05 * rng.standard_normal(round(LANE_M)))
    style = np.array([0.3, 0.5, 0.5, 0.03, 0.15, 0.2, 0.4])
    knows = np.array(
        [vehicle.mass, 0.5 * vehicle.air_density * vehicle.drag_area, vehicle.rolling_resistance, vehicle.r_e_r]
    )
    still = np.zeros(n)
    rows = drive_along(target, np.zeros(n + 200), still, still, still, still, fine, slow, own, NO_ODD, style, knows)
    way = rows[:, ROWS["way"]] + base
    wet = ((way >= DRY_M) & (way <= DRY_M + LANE_M)).astype(float)
    messages = measure(rows, own, {}, NOISES[rng.integers(len(NOISES))], rng)
    columns = {"water_depth_left": still, "water_depth_right": 7e-3 * wet, "on_water": wet}
    path = folder / f"run_{tyre}_{seed}.mf4"
    write_messages(path, [*messages, Message("lane", np.arange(n) * DT, columns)])
    found = straight_runs(load_signals([path], vehicle=vehicle), vehicle)[0]
    path.unlink()
    return found, true_v_15(rows, wet > 0.5)


def true_v_15(rows: np.ndarray, on: np.ndarray) -> float:
    """Speed at which the true slips' ratio crosses 15 % [km/h]; the slip is (r omega - v) / (r omega)."""
    s_l, s_r = (np.minimum(rows[:, ROWS[f"slip_r{s}"]], 0.99) for s in "lr")
    slip = (1.0 - s_l) / (1.0 - s_r) - 1.0
    k = crossing(mean_over(slip, 0.1, DT), on, 0.15, 10)
    return float(np.interp(k, np.arange(len(rows)), rows[:, ROWS["v_x"]])) * 3.6 if math.isfinite(k) else math.nan


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=6)
    given = parser.parse_args()
    car, vehicle = a_car()
    entries, truth = [], []
    with tempfile.TemporaryDirectory() as folder:
        for tyre in range(len(GAINS)):
            for seed in range(given.runs):
                found, true = one(car, vehicle, tyre, seed, Path(folder))
                entries.append(Entry(f"{len(truth)}", 1, float(len(truth)), (("tyre", str(tyre)),), str(tyre), found))
                truth.append(true)
    test = evaluated(entries, Options("straight", defaults(), ("tyre",)))
    kept = [i for i, e in enumerate(test.entries) if e.valid and not e.is_censored]
    away = np.array([KMH * test.entries[i].found.v - truth[i] for i in kept])
    print(
        f"{len(kept)} of {len(truth)} runs valid: bias {away.mean():+.3f} km/h, sd {away.std():.3f}, largest {np.abs(away).max():.2f}"
    )
    means = [
        float(np.nanmean([t for t, e in zip(truth, entries, strict=True) if e.tyre == str(k)]))
        for k in range(len(GAINS))
    ]
    seen = [s.summary.mean for s in test.sets]
    print("true means", " ".join(f"{m:.1f}" for m in means), "| measured", " ".join(f"{m:.1f}" for m in seen))
    print(
        "order of the tyres",
        "that of the truth" if list(np.argsort(seen)) == list(np.argsort(means)) else "another one",
    )
    for e in test.entries:
        if not e.valid:
            print(e.log, "; ".join(e.reasons))


if __name__ == "__main__":
    main()
