"""A small campaign with results, for tests of its page: two depths, a dry run, a bad log, names that mean harm."""

import csv
from functools import partial

from aqualog.campaign.batch import run_batch
from aqualog.campaign.results import load_results
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.core.vehicle import vehicle_toml
from aqualog.model.log import write_simulation
from aqualog.model.programme import SEDAN
from aqualog.model.simulate import simulate
from tests.campaign.made import pass_of

SCRIPT = "</script><script>alert(1)</script>"
IMAGE = '"><img src=x onerror=alert(2)>'
FORMULA = "=HYPERLINK(1)"
LONG = "x" * 30_000
HEADING = ("log", "tyre", "water_depth_mm", "pressure_front_bar", "pressure_rear_bar", "lane_start_s", "lane_end_s",
           "manoeuvre", "x_note")  # fmt: skip
LANE = (1.8, 4.3)  # [s]
drive = partial(pass_of, duration=5.0, lane=LANE)
write = partial(write_simulation, suffix=".parquet", comment="made")


def make_case(folder):
    """Campaign file of 2 depths x 2 speeds x 3 repeats, a dry run, a log that is none."""
    (folder / "logs").mkdir(parents=True)
    (folder / "car.toml").write_text(vehicle_toml(SEDAN))
    rows = []
    for depth in (0.8, 1.3):
        for kmh in (80, 110):
            for k in range(3):
                name = f"logs/d{depth}_v{kmh}_{k}.parquet"
                write(folder / name, simulate(drive(kmh, k, depth=depth * 1e-3)))
                rows.append((name, "worn_summer", depth, 1.9, 1.9, *LANE, "constant", f"n{k}"))
    write(folder / "logs" / "dry.parquet", simulate(drive(80, 7, depth=0.0)))
    rows.append(("logs/dry.parquet", "worn_summer", 0, 1.9, 1.9, "", "", "dry", FORMULA))
    (folder / "logs" / "bad.mf4").write_bytes(b"no log at all")
    rows.append(("logs/bad.mf4", "worn_summer", 1.3, 1.9, 1.9, *LANE, "constant", "n0"))
    evil = "a<b>/script><img src=x onerror=alert(3)>' .parquet"
    (folder / evil).parent.mkdir()
    write(folder / evil, simulate(drive(80, 9)))
    rows.append((evil, SCRIPT, 1.3, 1.9, 1.9, *LANE, IMAGE, LONG))
    with (folder / "runs.csv").open("w", newline="") as file:
        csv.writer(file).writerows([HEADING, *rows])
    (folder / "campaign.toml").write_text('name = "case <b>&amp;"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    return folder / "campaign.toml"


def load_case(campaign):
    configured = configure(campaign)
    store = Store(campaign.with_suffix(".store"))
    run_batch(configured, store)
    return load_results(configured, store)
