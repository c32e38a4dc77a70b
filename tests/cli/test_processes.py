"""Each command once as installed: in a process of its own, watched, with the system's streams and exit code."""

import shutil
import subprocess
import sys

import pytest

from aqualog.cli.commands import COMMANDS
from tests.commands import run_process
from tests.conftest import ROOT

SAMPLES = ROOT / "sample_logs"
SCENARIO = 'vehicle = "vehicle.toml"\nspeed_kmh = 80.0\nduration_s = 1.0\n'
CAR = ("--vehicle", "vehicle.toml")
# command: arguments, exit code, and a part of what it prints; in this order, as some go on with what others left
CALLS = {
    "detect": (("lane_drive.mf4", *CAR, "--fail-on-event", "--json"), 5, "minor_spin_down"),
    "inspect": (("lane_drive.mf4",), 0, "omega_fl"),
    "init": (("lane_drive.mf4", "-o", "work"), 0, "aqualog detect lane_drive.mf4"),
    "doctor": (("cut.mcap", *CAR), 3, "cut.mcap"),
    "convert": (("lane_drive.mf4", *CAR, "-o", "again.parquet"), 0, ""),
    "align": (("lane_drive.mf4",), 2, "at least one other file"),
    "slip-slope": (("short.csv", *CAR), 4, "error: "),
    "batch": (("campaign.toml", "--jobs", 1, "--json"), 0, '"made": 1'),
    "plan": (("campaign.toml", "--jobs", 1), 0, "1 log"),
    "bin-slipslope": (("campaign.toml", "--by", "tyre", "--jobs", 1, "--json"), 0, '"rows"'),
    "bin-resistance": (("campaign.toml", "--by", "tyre", "--jobs", 1, "--json"), 0, '"rows"'),
    "report": (("campaign.toml", "--jobs", 1, "-o", "page"), 0, ""),
    "calibrate": (("short.csv", *CAR), 4, "error: "),
    "diagnose": (("short.csv", *CAR), 4, "error: "),
    "validate": (("short.csv", *CAR, "--no-why"), 4, "error: "),
    "evaluate": (("lane_drive.mf4",), 2, "no vehicle"),
    "test": (("straight", "lane_drive.mf4", *CAR), 4, "no side is dry beside a wet one"),
    "watch": (("logs", "--campaign", "campaign.toml", "--once", "--every", 0.5), 4, "a.parquet: not valid: "),
    "simulate": (("scenario.toml", "-o", "made.csv"), 0, "(seed 1)"),
    "figures": (("2.1", "-o", "figures"), 0, "2.1"),
    "reproduce": (("-o", "lane_drive.mf4"), 2, "is no folder"),
    "cache": ((), 0, ""),
    "campaign": (("init", "logs", "-o", "made/campaign.toml", *CAR), 0, ""),
    "help": (("exit",), 0, "exit"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("processes")
    for name in ("lane_drive.mf4", "vehicle.toml"):
        shutil.copy(SAMPLES / name, path / name)
    (path / "cut.mcap").write_bytes((SAMPLES / "lane_drive.mcap").read_bytes()[:200_000])
    (path / "short.csv").write_text("t [s],v_x [m/s],a_x [m/s^2]\n" + "".join(f"{i / 10},20,0\n" for i in range(50)))
    (path / "scenario.toml").write_text(SCENARIO)
    (path / "logs").mkdir()
    shutil.copy(SAMPLES / "lane_drive.parquet", path / "logs" / "a.parquet")
    (path / "campaign.toml").write_text(
        'name = "c"\n[[run]]\nlog = "lane_drive.mf4"\nvehicle = "vehicle.toml"\ntyre = "x"\nwater_depth_mm = 1.3\n'
    )
    return path


def test_no_warning_of_python_reaches_a_user():
    code = "import numpy as np, aqualog.cli.main as m, aqualog.cli.start as s; m.run = lambda: np.exp(1e3); s.run()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""


def test_every_command_is_called():
    assert list(CALLS) == list(COMMANDS)


@pytest.mark.parametrize("name", CALLS)
def test_a_command_ends_with_its_exit_code(folder, name):
    args, code, said = CALLS[name]
    result = run_process(name, *args, cwd=folder, env={"AQUALOG_CACHE": str(folder / "kept")})
    assert result.exit_code == code, result
    assert said in result.stdout + result.stderr
    assert "Traceback" not in result.stderr
    assert sum(line.startswith("error:") for line in result.stderr.splitlines()) == (code in (2, 4))
