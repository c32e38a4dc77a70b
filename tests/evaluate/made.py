"""Short simulated drives, as logs of a campaign."""

from dataclasses import replace

from aqualog.core.vehicle import Vehicle, vehicle_toml
from aqualog.model.log import write_simulation
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import simulate
from aqualog.model.tyre import TYRES

GIVEN = frozenset({"name", "drivetrain", "mass", "tyre.slip_slope_f", "tyre.slip_slope_r"})
RWD = Vehicle(name="rwd", given=GIVEN)
FWD = Vehicle(name="fwd", drivetrain="fwd", torque_split_rear=0.0, given=GIVEN)

# name, car, tyre, speed [km/h], water [mm], suffix
DRIVES = (
    ("deep", RWD, "worn_summer", 118.0, 1.8, ".mf4"),
    ("dry", RWD, "worn_summer", 90.0, 0.0, ".csv"),
    ("deep2", FWD, "new_winter", 125.0, 2.0, ".parquet"),
    ("slow", FWD, "new_winter", 50.0, 1.3, ".mcap"),
)


def scenario(car, tyre, kmh, depth_mm, seed=7, duration=12.0):
    lanes = (Lane(5.0, 8.5, depth_left=depth_mm * 1e-3, depth_right=depth_mm * 1e-3),) if depth_mm else ()
    tyre = TYRES[tyre]
    speed = ((0.0, kmh / 3.6),)
    return Scenario(
        car, tyre_front=tyre, tyre_rear=tyre, p_front=1.9e5, p_rear=1.9e5, duration_s=duration, seed=seed, speed=speed,
        lanes=lanes,
    )  # fmt: skip


def write_campaign(folder, broken=True):
    """Four drives and one log that is none; the campaign file's path."""
    for car in (RWD, FWD):
        (folder / f"{car.name}.toml").write_text(vehicle_toml(car), encoding="utf-8")
    lines = ["log,tyre,vehicle,manoeuvre,water_depth_mm,x_kmh"]
    for seed, (name, car, tyre, kmh, depth, suffix) in enumerate(DRIVES, 1):
        simulation = simulate(replace(scenario(car, tyre, kmh, depth), seed=seed))
        write_simulation(folder / f"{name}{suffix}", simulation, suffix=suffix, comment="")
        manoeuvre = "dry road" if not depth else "lane"
        lines.append(f"{name}{suffix},{tyre},{car.name}.toml,{manoeuvre},{depth:g},{kmh:g}")
    if broken:
        (folder / "broken.mf4").write_bytes(b"MDF     4.10" + b"\0" * 90)
        lines.append("broken.mf4,worn_summer,rwd.toml,lane,1.3,90")
    (folder / "runs.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    path = folder / "campaign.toml"
    path.write_text('name = "short drives"\nruns = "runs.csv"\n', encoding="utf-8")
    return path
