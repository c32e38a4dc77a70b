"""Campaign files and tables of runs: read with all that they name, and the test matrix made of them."""

from functools import cache
from pathlib import Path

from aqualog.campaign.definition import log_states, missing_lines, with_load
from aqualog.campaign.matrix import campaign_matrix
from aqualog.config.campaign import read_campaign
from aqualog.config.configured import configure, files_of
from aqualog.core.errors import ConfigError
from tests.fuzz.registry import Target, add
from tests.fuzz.settings_files import LOG, check_error, check_finite, folder_with, loaded

_SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
_FILES = {
    "vehicle.toml": (_SAMPLES / "vehicle.toml").read_bytes(), "map.toml": (_SAMPLES / "map_csv.toml").read_bytes(),
    "labels.csv": b"start_s,end_s,effect,wheel\n1,2,full,fl\n", "log.csv": LOG,
}  # fmt: skip
_NAMED = b'name = "wet lane, May"\nvehicle = "vehicle.toml"\nsignals = "map.toml"\nruns = "runs.csv"\n'
_TABLES = b"""name = "two"
vehicle = "vehicle.toml"
[[run]]
log = ["log.csv", "imu.csv"]
tyre = "A"
tread_depth_mm = 7.5
wear = "new"
pressure_front_bar = 2.0
pressure_rear_bar = 2.2
water_depth_mm = 2
lane_start_s = 1.0
lane_end_s = 3.0
labels = "labels.csv"
x_day = 2026-05-01
x_speed_kmh = 80.0
[[run]]
log = "other.csv"
tyre = "B"
load_rear_kg = 120
manoeuvre = "coast"
vehicle = "vehicle.toml"
x_speed_kmh = 80
"""
_RUNS = (
    "log,tyre,tread_depth_mm,wear,pressure_front_bar,water_depth_mm,load_front_kg,lane_start_s,lane_end_s,labels,x_a\n"
    "log.csv,A,7.5,new,2.0,1.0,,1.0,3.0,labels.csv,u\n"
    "log.csv;imu.csv,A,7.5,new,2.0,0,,,,,v\n"
    "other.csv,B,1.5,worn,2.4,1.0,100,,,,u\n"
)


@cache
def campaigns() -> dict[str, bytes]:
    """With a table of runs, and with runs of its own."""
    return {"named": _NAMED, "tables": _TABLES}


@cache
def runs() -> dict[str, bytes]:
    """Tables of runs as an editor and as a spreadsheet writes them."""
    sheet = "sep=;\r\n" + _RUNS.replace("log.csv;imu.csv", '"log.csv;imu.csv"').replace(",", ";").replace(".", ",").replace(",csv", ".csv")  # fmt: skip
    return {
        "plain": _RUNS.encode(),
        "sheet": sheet.replace("\n", "\r\n").encode("utf-8-sig"),
        "wide": _RUNS.encode("utf-16"),
    }


def _worked_with(campaign: bytes, table: bytes) -> None:
    with folder_with({**_FILES, "campaign.toml": campaign, "runs.csv": table}) as folder:
        path = folder / "campaign.toml"
        found = loaded(read_campaign, path, "runs.csv")
        if found is None:
            return
        assert len(found.places) == len(found.campaign.runs) > 0
        for run in found.campaign.runs:
            check_finite(run.values)
            assert run.lane is None or run.lane[0] < run.lane[1]
        missing_lines(log_states(found.campaign, found.places))
        matrix = campaign_matrix(found.campaign)
        counted = [i for c in matrix.configurations for i in c.runs]
        assert sorted(counted) == list(range(len(found.campaign.runs))), "runs are not counted once each"
        configured = configure(path)
        assert path in files_of(configured)
        for run in found.campaign.runs:
            try:
                check_finite(with_load(configured.vehicles[run.vehicle], run))
            except ConfigError as error:
                check_error(error)


def campaign(data: bytes) -> None:
    """Work with a campaign file."""
    _worked_with(data, _RUNS.encode())


def run_table(data: bytes) -> None:
    """Work with a table of runs."""
    _worked_with(_NAMED, data)


add("campaign", Target("campaign files, and their test matrix", campaigns, campaign, is_text=True))
add("runs", Target("tables of runs of a campaign", runs, run_table, is_text=True))
