"""Measured dry drives: what is there is found, what is not there is not."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.align.load import load_signals
from aqualog.align.mapping import Entry, SourceClock
from aqualog.cli.main import app
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.detect.stream import detect_drive
from aqualog.report.drive.judged import missing_words
from aqualog.report.drive.report import drive_report
from aqualog.report.text import report_text

HERE = Path(__file__).parent
pytestmark = pytest.mark.real


def command(*args):
    result = CliRunner().invoke(app, [str(a) for a in args])
    return result.exit_code, result.stdout, result.stderr


def drive(name, paths, dbc=()):
    car = load_vehicle(HERE / f"{name}.toml")
    signals = load_signals(paths, vehicle=car, signal_map=load_signal_map(HERE / f"{name}_map.toml"), dbc=dbc)
    return car, signals


@pytest.fixture(scope="module")
def toyota(real_logs):
    folder = real_logs / "toyota_rav4"
    car, signals = drive("toyota", [folder / "can_bus.mf4"], [folder / "toyota_2017.dbc"])
    return detect_drive(signals, car)


def test_toyota_dry_minute_has_no_event(toyota):
    assert toyota.signals.frame.height * toyota.signals.dt == pytest.approx(60.0, abs=0.1)
    assert toyota.events == ()
    # its a_x is the derivative of a speed: it knows no hills, 7 % apart, by which the front wheels slip
    assert "margin" in {t.detector for t in toyota.tracks}
    assert toyota.margin is None


def test_toyota_lists_what_needs_torque(toyota):
    missing = {u.detector: set(u.missing) for u in toyota.unavailable}
    for detector in ("resistance", "joint_criteria", "slip_slope_drop", "joint_cusum"):
        assert {"torque_fl", "torque_fr"} <= missing[detector]
    assert "minor_spin_down" not in missing
    assert "spin_down" not in missing


def test_toyota_without_a_vehicle_file_cannot_be_judged(real_logs):
    """D5: a rear-driven default car gave a spin-up of 0.01 s on this front-driven one."""
    folder = real_logs / "toyota_rav4"
    given = ("--dbc", folder / "toyota_2017.dbc", "--signals", HERE / "toyota_map.toml")
    code, out, _ = command("detect", folder / "can_bus.mf4", *given, "--json")
    found = json.loads(out)
    assert (code, found["verdict"], found["events"]) == (0, "cannot_be_judged", [])
    assert found["missing"] == ["torque of the driven wheels", "vehicle.drivetrain", "vehicle.mass"]
    assert found["ran"] == ["spin_down"]
    assert len(found["unavailable"]) == 8


def test_toyota_clock(real_logs):
    folder = real_logs / "toyota_rav4"
    code, out, _ = command("align", folder / "speed.csv", folder / "gnss.csv", "--json")
    assert code == 0
    fit = json.loads(out)["sources"][0]
    assert 0.1 < fit["offset_s"] < 0.25
    assert fit["offset_ci95"][1] - fit["offset_ci95"][0] < 0.15
    assert fit["ratio"] == pytest.approx(1.009, abs=0.002)


def test_toyota_map_is_proposed_from_names_units_and_data(real_logs):
    folder = real_logs / "toyota_rav4"
    code, out, _ = command("inspect", folder / "can_bus.mf4", "--dbc", folder / "toyota_2017.dbc", "--json")
    assert code == 0
    proposed = {s: p["channel"] for s, p in json.loads(out)["proposed"].items()}
    assert proposed["a_x"] == "VSC1S07.GVC"  # KINEMATICS.ACCEL_X does not follow this car's speed
    assert proposed["omega_rr"] == "WHEEL_SPEEDS.WHEEL_SPEED_RR"
    assert proposed["steering_wheel_angle"] == "STEER_ANGLE_SENSOR.STEER_ANGLE"


@pytest.fixture(scope="module")
def porsche(real_logs):
    return drive("porsche", sorted((real_logs / "porsche_981").glob("*.csv")))


def test_porsche_spins_and_lock_ups_are_found(porsche):
    car, signals = porsche
    result = detect_drive(signals, car)
    kinds = Counter((e.detector, e.wheel) for e in result.events)
    assert kinds["spin_down", "fr"] > 20  # the inner front wheel of a clockwise track
    assert kinds["spin_up", "rl"] + kinds["spin_up", "rr"] >= 5
    assert not any(d == "spin_up" and w in ("fl", "fr") for d, w in kinds)


def test_porsche_events_are_real(porsche, real_logs):
    """GPS or the wheel's neighbour say so too, by 1 % of speed more than the path difference of the curve explains."""
    car, signals = porsche
    result = detect_drive(signals, car)
    signal_map = load_signal_map(HERE / "porsche_map.toml")
    with_gps = replace(
        signal_map,
        entries={**signal_map.entries, "v_x": Entry("v_x", ("GPS Speed",), "m/s")},
        clocks={"gps_10Hz.csv": SourceClock(offset_s=0.208)},
    )
    both = load_signals(sorted((real_logs / "porsche_981").glob("*.csv")), vehicle=car, signal_map=with_gps)
    lead = signals.frame.height - both.frame.height  # the grids begin with the first sample of their own sources
    gps = both.array("v_x")
    gps = np.concatenate([np.full(max(lead, 0), np.nan), gps])[max(-lead, 0) :][: signals.frame.height]
    t, v = signals.frame["t"].to_numpy(), result.features["v_x_hat"].to_numpy()
    neighbour = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}
    real = 0
    for event in result.events:
        sign = -1.0 if event.detector == "spin_down" else 1.0
        inside = (t >= event.start_s - 0.1) & (t <= event.end_s + 0.1)
        own = result.features[f"v_w_{event.wheel}"].to_numpy()[inside]
        other = result.features[f"v_w_{neighbour[event.wheel]}"].to_numpy()[inside]
        path = np.nanmax(np.abs(signals.array("yaw_rate")[inside]) * car.track / 2 / v[inside])
        by_gps = np.nanmax(sign * (own / gps[inside] - 1.0))
        by_neighbour = np.nanmax(sign * (own - other) / v[inside])
        real += by_gps > path + 0.01 or by_neighbour > path + 0.01
    assert real >= 0.95 * len(result.events)


def test_porsche_lock_ups_are_folded(porsche):
    """D6: over a hundred detections on a dry track, none of which is aquaplaning."""
    car, signals = porsche
    result = detect_drive(signals, car)
    found = Counter(e.kind for e in result.judgement.episodes)
    assert len(result.events) > 80
    assert found["aquaplaning"] == 0
    assert found["wheel_lock"] < 0.4 * len(result.events)
    assert found["wheel_lock"] > 10 * (found["suspected"] + 1)
    text = report_text(drive_report(result))
    assert len(text.splitlines()) < 45
    assert "Braking slip: " in text


def test_porsche_gps_clock(real_logs):
    folder = real_logs / "porsche_981"
    code, out, _ = command(
        "align", folder / "gps_10Hz.csv", folder / "wheels_10Hz.csv", "--signals", HERE / "porsche_map.toml", "--json"
    )
    assert code == 0
    fit = json.loads(out)["sources"][0]
    assert fit["offset_s"] == pytest.approx(-0.2, abs=0.03)


@pytest.mark.parametrize("trip", ["A05", "A10", "A11", "A12", "A15", "A17", "B24", "B26"])
def test_bmw_resistance_runs_on_every_trip(real_logs, trip):
    car, signals = drive("bmw_i3", [real_logs / "bmw_i3" / f"Trip{trip}.csv"])
    result = detect_drive(signals, car)
    assert {u.detector for u in result.unavailable} >= {"spin_down", "minor_spin_down", "spin_up", "joint_criteria"}
    assert len([e for e in result.events if e.detector == "resistance"]) <= 4
    moving = signals.array("v_x") > 14.0
    measure = result.features["delta_a_x"].to_numpy()[moving & (signals.array("torque_rl") > 5.0)]
    assert abs(np.nanmedian(measure)) < 0.1
    assert result.judgement.verdict == "cannot_be_judged"
    assert missing_words(result.judgement.missing) == "no wheel speeds"
    assert "resistance" in result.judgement.ran


@pytest.mark.parametrize("trip", ["A10", "B02", "B24"])
def test_bmw_lines_of_the_logger_are_missing(real_logs, trip):
    _, signals = drive("bmw_i3", [real_logs / "bmw_i3" / f"Trip{trip}.csv"])
    joined = {n: o.joined for n, o in signals.origins.items() if o.joined}
    assert joined == (dict.fromkeys(("v_x", "a_x", "torque_rl", "torque_rr"), 1589) if trip == "B02" else {})
    assert np.isnan(signals.array("a_x")[401:1990]).all() == (trip == "B02")


@pytest.mark.parametrize("name", ["00000001-60FE3F04.MF4", "00000002-60FE415D.MF4"])
def test_canedge_is_explained_and_refused(real_logs, name):
    folder = real_logs / "canedge"
    code, out, _ = command("inspect", folder / name, "--dbc", folder / "canmod-gps.dbc")
    assert code == 0
    assert "gravity is on x" in out
    assert "gnss_imu.AccelerationX" in out
    code, _, err = command("detect", folder / name, "--dbc", folder / "canmod-gps.dbc")
    assert code == 4
    assert len([line for line in err.splitlines() if line.startswith("error:")]) == 1
    assert "omega_fl" in err


def test_unfinalised_canedge_file_stays_as_it_is(real_logs):
    path = real_logs / "canedge" / "00000001-63BEF5CD.MF4"
    before = path.read_bytes()
    code, out, _ = command("inspect", path)
    assert code == 4  # frames only, and no database for them
    assert "not finalised" in out
    assert "--dbc" in out
    assert path.read_bytes() == before
