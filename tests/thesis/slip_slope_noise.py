"""The slip-slope detector on an all-wheel-drive car with series sensors: delays and false alarms over many seeds.

`PYTHONPATH=tests python tests/thesis/slip_slope_noise.py --seeds 200 --first 1000` prints the tables. The four-wheel
simulator with pick-ups of 48 teeth, quantised torque at 50 Hz, accelerometer offset and gains drawn by seed makes the
drives; the detector gets a vehicle file that is wrong by a random share in mass and radii.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import DriveStream
from aqualog.model.scenario import SURFACES, Excitation, Lane, Scenario
from aqualog.model.simulate import simulate

__all__ = ["CAR", "SPLITS", "Outcome", "drive", "outcome", "study"]

CAR = Vehicle(
    name="AWD SUV", drivetrain="awd", mass=2714.0, l_f=1.686, l_r=1.124, h_cg=0.62, drag_area=0.91,
    torque_split_rear=0.5, r_e_f=0.4, r_e_r=0.4, r_l_f=0.39, r_l_r=0.39, inertia_f=2.55, inertia_r=2.55,
    slip_slope_f=30.0, slip_slope_r=30.0, mu_max=1.0, given=frozenset({"drivetrain", "mass", "tyre.slip_slope_f"}),
)  # fmt: skip
SPLITS = (0.0, 0.2, 0.4, 0.5, 0.6, 0.8, 1.0)
EXCITATION = Excitation("sine", 0.05, "mu", 8.0)
DURATION = 60.0  # [s]
RATE = 100  # [Hz]
SURFACES_OF_STUDY = ("dry", "snow", "water")


@dataclass(frozen=True, slots=True)
class Outcome:
    """One drive: time of the change [s] (NaN on dry), delay of the first event after it [s], events before, shares."""

    change: float
    delay: float
    false_events: int
    blind: float
    slope_before: float
    slope_after: float
    true_share_f: float  # true slope over its dry value, 4 to 9 s after the change, of the front axle


def drive(seed: int, surface: str, split: float, *, excited: bool, rate: int = RATE) -> tuple[Scenario, float]:
    """Scenario of a seed and the time at which the surface changes."""
    rng = np.random.default_rng([seed, 5])
    speed = [(0.0, float(rng.uniform(80.0, 110.0)) / 3.6)]
    for t in np.arange(10.0, DURATION + 1.0, 10.0):
        speed.append((float(t), float(np.clip(speed[-1][1] + 10.0 * rng.uniform(-0.4, 0.4), 18.0, 36.0))))
    change = float(rng.uniform(20.0, 28.0))
    lanes = {
        "dry": (),
        "snow": (Lane(change, DURATION, surface=SURFACES["snow"]),),
        "water": (Lane(change, change + 10.0, depth_left=1.3e-3, depth_right=1.3e-3),),
    }[surface]
    scenario = Scenario(
        vehicle=replace(CAR, torque_split_rear=split), duration_s=DURATION, rate_hz=float(rate), seed=seed,
        speed=tuple(speed), lanes=lanes, excitation=EXCITATION if excited else None,
    )  # fmt: skip
    return scenario, change if lanes else np.nan


def believed_car(seed: int, split: float) -> Vehicle:
    """The vehicle file that the detector gets: mass wrong by 3 %, radii by 0.2 % (rms)."""
    rng = np.random.default_rng([seed, 6])
    mass, front, rear = rng.normal(0.0, [0.03, 0.002, 0.002])
    return replace(
        CAR, torque_split_rear=split, mass=CAR.mass * (1 + mass), r_e_f=0.4 * (1 + front), r_e_r=0.4 * (1 + rear)
    )


def on_grid(simulation, rate: int = RATE) -> dict[str, np.ndarray]:
    """Measured signals on the grid of the wheel speeds; slower ones are linear between their samples."""
    grid = np.arange(round(simulation.setup.scenario.duration_s * rate)) / rate
    return {
        name: np.interp(grid, group.t, values)
        for group in simulation.measured
        if group.name != "truth"
        for name, values in group.columns.items()
    }


def outcome(seed: int, surface: str, split: float, *, excited: bool, rate: int = RATE) -> Outcome:
    """Simulate and detect one drive."""
    scenario, change = drive(seed, surface, split, excited=excited, rate=rate)
    simulation = simulate(scenario)
    columns = on_grid(simulation, rate)
    columns.pop("v_x", None)  # no speed reference
    stream = DriveStream(believed_car(seed, split), round(1e9 / rate), list(columns))
    piece = stream.push(columns)
    events = [e for e in (*piece.events, *stream.finish()) if e.detector == "slip_slope_drop"]
    end = change if np.isfinite(change) else DURATION
    after = [e.start_s - change for e in events if change <= e.start_s < change + 20.0]
    t = np.arange(round(DURATION * rate)) / rate
    # both sides see the same; where one is NaN it tells nothing
    slope = 0.5 * (piece.features["slip_slope_left"] + piece.features["slip_slope_right"])
    judged = blind = 0.0
    for summary in stream.slopes:
        judged += sum(summary.seconds[k] for k in ("estimating", "slope_frozen", "blind"))
        blind += summary.seconds["blind"]

    def true_share(axle: str) -> float:
        names = [f"true_slip_slope_{axle}{side}" for side in "lr"]
        value = np.mean([simulation.truth.columns[n] for n in names], axis=0)
        t_true = simulation.truth.t
        after = (t_true > end + 4.0) & (t_true < end + 9.0)
        return float(value[after].mean() / value[t_true < end].mean()) if surface != "dry" else 1.0

    return Outcome(
        change=change,
        delay=min(after, default=np.nan),
        false_events=sum(e.start_s < end for e in events),
        blind=blind / max(judged, 1e-9),
        slope_before=float(np.nanmedian(slope[(t > 10.0) & (t < end)])),
        slope_after=float(np.nanmedian(slope[(t > end + 4.0) & (t < end + 9.0)])) if surface != "dry" else np.nan,
        true_share_f=true_share("f"),
    )


def _one(job):
    seed, surface, split, excited = job
    return outcome(seed, surface, split, excited=excited)


def study(seeds: range, conditions, *, jobs: int = 2):
    """Outcomes by condition (surface, split, excited)."""
    work = [(seed, *condition) for condition in conditions for seed in seeds]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(_one, work, chunksize=20))
    return {c: found[i * len(seeds) : (i + 1) * len(seeds)] for i, c in enumerate(conditions)}


def line(condition, outcomes: list[Outcome]) -> str:
    """One row of the table."""
    surface, split, excited = condition
    delays = np.array([o.delay for o in outcomes])
    hours = np.nansum([np.where(np.isfinite(o.change), o.change, DURATION) for o in outcomes]) / 3600.0
    false = sum(o.false_events for o in outcomes)
    row = f"{surface:6s} split {split:3.1f} {'sine 0.05' if excited else 'none     '}"
    if surface != "dry":
        q = np.nanquantile(delays, [0.05, 0.5, 0.95]) if np.isfinite(delays).any() else [np.nan] * 3
        row += f" | found {np.isfinite(delays).mean():4.0%}, delay 5/50/95 %: {q[0]:5.2f} {q[1]:5.2f} {q[2]:5.2f} s"
        row += f" | slope {np.nanmedian([o.slope_after for o in outcomes]):5.1f}"
        share, found = np.array([o.true_share_f for o in outcomes]), np.isfinite(delays)
        bins = [(share < 0.5), (share >= 0.5) & (share < 0.7), (share >= 0.7)]
        row += " | found by true front slope < 0.5, < 0.7, above: "
        row += ", ".join(f"{found[b].sum()}/{b.sum()}" for b in bins)
    before = np.array([o.slope_before for o in outcomes])
    row += f" | false {false} in {hours:4.1f} h | blind {np.mean([o.blind for o in outcomes]):4.0%}"
    return row + f" | dry slope {np.nanmedian(before):5.1f} +- {np.nanstd(before):4.1f}"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    conditions = [(s, split, excited) for s in SURFACES_OF_STUDY for split in SPLITS for excited in (False, True)]
    for condition, outcomes in study(seeds, conditions, jobs=options.jobs).items():
        print(line(condition, outcomes), flush=True)


if __name__ == "__main__":
    main()
