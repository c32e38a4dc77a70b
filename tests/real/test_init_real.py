"""`aqualog init` on each kind of measured drive: what is written loads, with the signals that the log holds."""

import shlex

import pytest

import aqualog as aq
from tests.commands import run

pytestmark = pytest.mark.real

WHEELS = {f"omega_{w}" for w in ("fl", "fr", "rl", "rr")}
PLACE = {"latitude", "longitude", "altitude"}
DRIVES = {
    "porsche_981": ("porsche_981", "", WHEELS | PLACE | {"v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "brake_pressure"}),
    "rav4 raw CAN": (
        "toyota_rav4/can_bus.mf4", "toyota_rav4/toyota_2017.dbc", WHEELS | {"a_x", "a_y", "yaw_rate", "steer_angle"},
    ),
    "rav4 csv": ("toyota_rav4", "", WHEELS | PLACE | {"v_x", "steer_angle"}),
    "bmw_i3": ("bmw_i3/TripA17.csv", "", {"v_x", "a_x", "altitude", "ambient_temperature"}),
    "canedge": ("canedge/00000002-60FE415D.MF4", "canedge/canmod-gps.dbc", PLACE | {"v_x", "a_x", "a_y", "yaw_rate"}),
}  # fmt: skip


@pytest.mark.parametrize("name", DRIVES)
def test_what_is_written_loads_with_all_signals_and_the_next_command_runs(real_logs, tmp_path, name):
    log, dbc, expected = DRIVES[name]
    logs = sorted((real_logs / log).glob("*.csv")) if name == "rav4 csv" else [real_logs / log]
    given = ("--dbc", real_logs / dbc) if dbc else ()
    done = run("init", *logs, *given, "-o", tmp_path / "work")
    assert done.exit_code == 0, done.stderr
    drive = aq.read(logs, map=tmp_path / "work" / "map.toml", dbc=given[1:])
    assert set(drive.signals.symbols) == expected
    first = next(line for line in done.stdout.splitlines() if line.startswith("  1. aqualog doctor "))
    code = run(*shlex.split(first.removeprefix("  1. aqualog "))).exit_code
    assert code in (0, 3, 4)  # 4: a log on which no detector works


def test_a_folder_of_drives_is_sent_to_campaign_init(real_logs, tmp_path):
    done = run("init", real_logs / "bmw_i3", "-o", tmp_path / "work")
    assert done.exit_code == 4
    assert "aqualog campaign init FOLDER" in done.stderr
    assert not (tmp_path / "work").exists()


def test_the_speed_on_the_bus_is_offered_and_no_checksum(real_logs, tmp_path):
    folder = real_logs / "toyota_rav4"
    done = run("init", folder / "can_bus.mf4", "--dbc", folder / "toyota_2017.dbc", "-o", tmp_path / "work")
    (line,) = (n for n in done.stdout.splitlines() if n.startswith("  no v_x: "))
    assert "; SPEED [km/h] may be it: map it" in line
    assert not [w for w in ("CHECKSUM", "LOCKOUT", "SET_", "ENCODER", "UI_") if w in line]
