"""Diagnosis of measured drives: what is there is named, what cannot be judged is said to be so."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.align.load import load_signals
from aqualog.calibrate.derive import calibrated
from aqualog.calibrate.run import calibrate
from aqualog.cli.main import app
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.grade import find_profile, with_profile
from aqualog.diagnose.hypotheses import residual
from aqualog.diagnose.run import Options, accelerometer_defect, diagnose
from aqualog.model.term import Model

HERE = Path(__file__).parent
LOADED = 60.0  # [kg] more in trip B24 than in the others
QUICK = Options(surrogates=9, views=False, consequences=False)
OTHER_TRIPS = ("A05", "A10", "A11", "A15", "A17", "B26")
pytestmark = pytest.mark.real


def command(*args):
    result = CliRunner().invoke(app, ["diagnose", *map(str, args)])
    return result.exit_code, result.stdout, [s for s in result.stderr.splitlines() if s.startswith("error:")]


def toyota(real_logs, signal_map, *more):
    folder = real_logs / "toyota_rav4"
    return command(
        folder / "can_bus.mf4", "--dbc", folder / "toyota_2017.dbc", "--vehicle", HERE / "toyota.toml", "--signals",
        HERE / signal_map, "--json", *more,
    )  # fmt: skip


def test_toyota_wrong_acceleration_channel_is_exposed(real_logs):
    _, out, _ = toyota(real_logs, "diagnose_toyota_wrong_map.toml")
    document = json.loads(out)
    assert document["verdict"] == "not_testable"
    assert "KINEMATICS.ACCEL_X" in document["sentence"]
    assert "-0.9" in document["sentence"]


def prepared(name, paths, car, signal_map, dbc=()):
    signals = load_signals(paths, vehicle=car, signal_map=load_signal_map(HERE / signal_map), dbc=dbc)
    drive = prepare(signals, car, name)
    return drive, residual(drive, Model())


def test_toyota_right_channel_passes(real_logs):
    folder = real_logs / "toyota_rav4"
    drive, r = prepared(
        "toyota", [folder / "can_bus.mf4"], load_vehicle(HERE / "toyota.toml"), "toyota_map.toml",
        [folder / "toyota_2017.dbc"],
    )  # fmt: skip
    assert accelerometer_defect(drive) is None
    assert drive.untorqued
    assert find_profile(drive, r) is None


@pytest.mark.parametrize("name", ["00000001-60FE3F04.MF4", "00000002-60FE415D.MF4"])
def test_canedge_is_refused_with_what_is_missing(real_logs, name):
    folder = real_logs / "canedge"
    code, out, errors = command(folder / name, "--dbc", folder / "canmod-gps.dbc", "--vehicle", HERE / "toyota.toml")
    assert code == 4
    assert out == ""
    assert len(errors) == 1
    assert "omega_fl" in errors[0]


@pytest.fixture(scope="module")
def bmw(real_logs):
    """The car as six other trips show it."""
    car = load_vehicle(HERE / "diagnose_bmw_i3.toml")
    trips = [
        load_signals(
            [real_logs / "bmw_i3" / f"Trip{t}.csv"], vehicle=car,
            signal_map=load_signal_map(HERE / "diagnose_bmw_i3_map.toml"),
        )
        for t in OTHER_TRIPS
    ]  # fmt: skip
    told = calibrate(trips, OTHER_TRIPS, car, {"mass": 1375.0})
    return calibrated(car, told.parameters, spread=told.spread)


def trip_of(real_logs, car, trip):
    path = real_logs / "bmw_i3" / f"Trip{trip}.csv"
    return load_signals([path], vehicle=car, signal_map=load_signal_map(HERE / "diagnose_bmw_i3_map.toml"))


@pytest.mark.parametrize("trip", ["A11", "A17"])
def test_force_balance_of_a_calibrated_trip_does_not_grow_with_the_torque(real_logs, bmw, trip):
    """A gain of 0.87 that counted twice would leave 15 % of the torque."""
    drive = prepare(trip_of(real_logs, bmw, trip), bmw, trip)
    force = residual(drive, Model())[drive.channels.index("force_balance"), drive.mask]
    pull = drive.coordinates["torque"][drive.mask] / (bmw.r_e_r * bmw.mass)
    slope = np.polyfit(pull, force, 1)[0]
    assert abs(slope) < 2.0 * bmw.spread["torque_gain"] / bmw.torque_gain
    assert (drive.coordinates["torque"][drive.mask] > 0.0).all()  # friction brakes are not in the rear torque


@pytest.fixture(scope="module")
def loaded(real_logs, bmw):
    """Diagnosis of the trip with a load."""
    return diagnose([("B24", trip_of(real_logs, bmw, "B24"))], bmw, options=QUICK)


def test_no_load_is_told_that_was_not_there(loaded):
    """Named, its interval holds the load; otherwise the limit says that so small a load is not seen."""
    loads = [e for c in loaded.causes for n, e in c.parameters.items() if n in ("delta_mass", "mass")]
    loads += [
        e for a in loaded.alternatives for c in a.causes for n, e in c.parameters.items() if n in ("delta_mass", "mass")
    ]
    assert all(e.low < LOADED < e.high for e in loads)
    (limit,) = (x for x in loaded.limits if (x.effect, x.where) == ("payload_mass", None))
    assert loads or LOADED < limit.size < 0.3 * 1375.0  # a share of the likelihood counts: limits are wide
    assert not any(c.effect == "torque_gain" for c in loaded.causes)  # it is within what trips differ by


def test_delay_of_the_loaded_trip_is_the_torques(real_logs, bmw, loaded):
    """Calibration finds the same by other means."""
    delays = [c.parameters["delay"] for c in loaded.causes if c.key == "signal_delay@torque"]
    late = calibrate([trip_of(real_logs, bmw, "B24")], ["B24"], bmw, {"mass": bmw.mass}).drives[0].torque_lag_s
    assert late > 0.02
    assert all(d.low < late < d.high for d in delays)
    (limit,) = (x for x in loaded.limits if (x.effect, x.where) == ("signal_delay", "torque"))
    assert delays or late < limit.size  # a single trip shows it hardly
    assert any("from which a road is named: The road" in n for n in loaded.notes)


def test_wind_of_the_loaded_trip_is_what_it_slows_the_car_down_by(real_logs, bmw, loaded):
    """A drag named beside the delay is that of a calibration of this trip alone, as air against the car."""
    own = calibrate([trip_of(real_logs, bmw, "B24")], ["B24"], bmw, {"torque_gain": bmw.torque_gain}).parameters
    (drag,) = (p.value for p in own if p.name == "drag_area")
    v = trip_of(real_logs, bmw, "B24").array("v_x")
    wind = 0.5 * (drag / bmw.drag_area - 1.0) * (v**3).sum() / (v**2).sum()
    told = [c.parameters["speed"] for c in loaded.causes if c.effect == "head_wind"]
    assert all(e.low < wind < e.high for e in told)


@pytest.fixture(scope="module")
def hilly(real_logs, bmw):
    """Diagnosis of the hilly trip without its elevation."""
    return diagnose([("A12", trip_of(real_logs, bmw, "A12"))], bmw, options=QUICK)


@pytest.mark.nightly
def test_road_of_the_hilly_trip_is_a_cause_and_the_withheld_elevation_agrees(real_logs, bmw, hilly):
    assert hilly.verdict in ("named", "compound", "cannot_tell")
    (road,) = (c for c in hilly.causes if "grade_rms" in c.parameters)  # its mean may be open beside it
    assert hilly.verdict != "cannot_tell" or "road grade" in hilly.sentence.split("beside it")[0]
    (term,) = (t for t in hilly.model.terms if t.effect.name == "unexplained_grade")
    s, theta = np.array(term.knots).T
    drive = prepare(trip_of(real_logs, bmw, "A12"), bmw, "A12")
    height = elevation_over_way(real_logs, "A12", drive, s)
    own = np.cumsum(theta) * float(s[1] - s[0])
    flat = [x - np.polyval(np.polyfit(s, x, 1), s) for x in (own, height)]
    assert np.corrcoef(*flat)[0, 1] > 0.85
    mean = road.parameters["grade_mean"]
    assert mean.high - mean.low > 0.01  # without elevation a mean slope is an offset of the accelerometer as well


@pytest.mark.nightly
def test_neither_trip_contradicts_the_torques_delay(real_logs, bmw, hilly, loaded):
    """A trip that names it has the calibrated one in its interval; to one that does not, it is below the limit."""
    for name, d in (("A12", hilly), ("B24", loaded)):
        late = calibrate([trip_of(real_logs, bmw, name)], [name], bmw, {"mass": bmw.mass}).drives[0].torque_lag_s
        delays = [c.parameters["delay"] for c in d.causes if c.key == "signal_delay@torque"]
        (limit,) = (x for x in d.limits if (x.effect, x.where) == ("signal_delay", "torque"))
        assert all(x.low < late < x.high for x in delays)
        assert delays or late < limit.size


@pytest.mark.nightly
def test_nothing_about_tyres_without_wheel_speeds(hilly):
    named = {c.effect for c in hilly.causes}
    assert not named & {"slip_stiffness_drift", "slip_stiffness", "pressure_loss", "tyre_radius"}
    assert hilly.untested["pressure_loss"] == "no wheel speeds in the log"


def looked(real_logs, car, trip):
    drive, r = prepared(trip, [real_logs / "bmw_i3" / f"Trip{trip}.csv"], car, "diagnose_bmw_i3_map.toml")
    return drive, r, find_profile(drive, r)


def smooth(x, over):
    window = np.hanning(2 * over + 1)[1:-1]
    return np.convolve(np.pad(x, over - 1, mode="edge"), window / window.sum(), "valid")


def elevation_over_way(real_logs, trip, drive, s):
    lines = (real_logs / "bmw_i3" / f"Trip{trip}.csv").read_text(encoding="latin1").splitlines()[1:]
    rows = np.array([[float(x or "nan") for x in line.split(";")[:3]] for line in lines])
    height = np.interp(drive.coordinates["t"], rows[:, 0] - rows[0, 0], rows[:, 2])
    return np.interp(s, drive.coordinates["position"], height)


def test_hilly_trip_shows_its_road_and_the_withheld_elevation_agrees(real_logs, bmw):
    drive, r, found = looked(real_logs, bmw, "A12")
    assert found.cause.effect == "road_grade"
    assert 0.02 < found.rms.low < found.rms.high < 0.03
    assert found.shared > 0.95  # accelerometer and torque show the same road
    height = elevation_over_way(real_logs, "A12", drive, found.s)
    own = np.cumsum(found.theta) * float(found.s[1] - found.s[0])
    flat = [x - np.polyval(np.polyfit(found.s, x, 1), found.s) for x in (own, height)]
    assert np.corrcoef(*flat)[0, 1] > 0.85
    slopes = [smooth(x, 24) for x in (found.theta, np.gradient(height, found.s))]
    assert np.corrcoef(*slopes)[0, 1] > 0.7  # over 600 m: the elevation comes in steps of a metre
    assert 0.8 < np.polyfit(slopes[1], slopes[0], 1)[0] < 1.2
    after = residual(drive, with_profile(Model(), found))
    kinematic = drive.channels.index("kinematic")
    assert after[kinematic, drive.mask].std() < 0.9 * r[kinematic, drive.mask].std()


def test_a_road_of_one_percent_is_the_same_on_the_way_back(real_logs, bmw):
    there, back = (looked(real_logs, bmw, t)[2] for t in ("A15", "A16"))
    assert 0.009 < back.rms.value < there.rms.value < 0.011
    length = min(there.theta.size, back.theta.size)
    agree = [
        np.corrcoef(there.theta[:length], np.roll(-back.theta[::-1][:length], lag))[0, 1] for lag in range(-80, 81)
    ]
    assert max(agree) > 0.65  # downhill is uphill on the way back
    assert np.sort(agree)[-30] < 0.4


def test_road_of_the_loaded_trip_is_flatter(real_logs, bmw):
    _, _, found = looked(real_logs, bmw, "B24")
    assert 0.005 < found.rms.low < found.rms.high < 0.012


def test_porsche_offset_and_laps(real_logs):
    drive, r = prepared(
        "porsche", sorted((real_logs / "porsche_981").glob("*.csv")), load_vehicle(HERE / "porsche.toml"),
        "diagnose_porsche_map.toml",
    )  # fmt: skip
    kinematic = r[drive.channels.index("kinematic"), drive.mask]
    assert kinematic.std() < 1.0
    assert np.median(kinematic) == pytest.approx(-1.6, abs=0.2)
    found = find_profile(drive, r)
    assert found.lap_m == pytest.approx(5450.0, abs=75.0)  # Watkins Glen with the boot
    assert 0.02 < found.rms.value < 0.04


@pytest.fixture(scope="module")
def porsche(real_logs):
    """Diagnosis of a track day with the accelerometer as it was mounted."""
    car = load_vehicle(HERE / "porsche.toml")
    signal_map = load_signal_map(HERE / "diagnose_porsche_map.toml")
    paths = sorted((real_logs / "porsche_981").glob("*.csv"))
    return diagnose([("porsche", load_signals(paths, vehicle=car, signal_map=signal_map))], car, options=QUICK)


@pytest.mark.nightly
def test_porsche_offset_and_road_are_named(porsche):
    assert porsche.verdict in ("named", "compound", "cannot_tell")
    found = {c.key: c for c in porsche.causes}
    assert found["accelerometer_bias@a_x"].parameters["bias"].value == pytest.approx(-1.6, abs=0.1)
    lap = re.search(r"again after (\d+) m", found["road_grade"].sentence)
    assert lap is not None
    assert float(lap[1]) == pytest.approx(5450.0, abs=75.0)
    certain = porsche.sentence.split("beside it")[0]
    assert "accelerometer bias" in certain
    assert "road grade" in certain


@pytest.mark.nightly
def test_without_torque_nothing_is_told_about_forces(porsche):
    assert not {c.effect for c in porsche.causes} & {"torque_gain", "payload_mass", "aero_drag", "head_wind"}
    assert porsche.untested["payload_mass"] == "no wheel torque in the log"


@pytest.mark.nightly
def test_what_nobody_told_of_the_porsche_is_no_finding(porsche):
    """No inertia is in its file, and the radii in its wheel speeds are the control unit's."""
    assert not {c.effect for c in porsche.causes} & {"wheel_inertia", "tyre_radius", "pressure_loss"}
