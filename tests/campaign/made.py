"""A small campaign on disk: short passes over a lane, with canonical names."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from aqualog.core.vehicle import vehicle_toml
from aqualog.model.log import write_simulation
from aqualog.model.programme import SEDAN
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import simulate
from aqualog.model.tyre import TYRES


def pass_of(kmh, seed, *, depth=1.3e-3, duration=4.0, tyre="worn_summer", lane=(1.2, 3.2)):
    lanes = (Lane(*lane, depth_left=0.6 * depth, depth_right=depth),) if depth else ()
    return Scenario(
        SEDAN, TYRES[tyre], TYRES[tyre], duration_s=duration, seed=seed, speed=((0.0, kmh / 3.6),), lanes=lanes
    )  # fmt: skip


@cache
def log_of(kmh, seed, suffix):
    """Bytes of a log, simulated once in a session."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"log{suffix}"
        write_simulation(path, simulate(pass_of(kmh, seed)), suffix=suffix, comment="made")
        return path.read_bytes()


def make_campaign(folder: Path, speeds=(70, 100), repeats=2, suffix=".parquet", extra=""):
    """Folder with car.toml, runs.csv, campaign.toml and logs; returns the campaign file."""
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    (folder / "car.toml").write_text(vehicle_toml(SEDAN))
    rows = ["log,tyre,water_depth_mm,pressure_front_bar,pressure_rear_bar,lane_start_s,lane_end_s"]
    for kmh in speeds:
        for k in range(repeats):
            name = f"v{kmh:03d}_{k}{suffix}"
            (folder / "logs" / name).write_bytes(log_of(kmh, k, suffix))
            rows.append(f"logs/{name},worn_summer,1.3,1.9,1.9,1.2,3.2")
    (folder / "runs.csv").write_text("\n".join(rows) + "\n" + extra)
    (folder / "campaign.toml").write_text('name = "made"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    return folder / "campaign.toml"
