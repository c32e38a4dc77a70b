"""Calibration on simulated dry drives."""

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.align.load import load_signals
from aqualog.calibrate.balance import energy_offset
from aqualog.calibrate.derive import calibrated, identified_values
from aqualog.calibrate.design import _correlations, lag_between, prepare
from aqualog.calibrate.run import calibrate
from aqualog.calibrate.words import notes
from aqualog.config.vehicle import calibrated_toml, load_vehicle
from aqualog.core.errors import FitError, SignalError
from aqualog.core.provenance import provenance_of
from aqualog.core.records import Quality, Signals
from aqualog.core.vehicle import Provenance, Vehicle
from aqualog.features.smoothing import earlier
from aqualog.model.sensors import ESC, IDEAL
from aqualog.report.calibration import estimated, parameter_cells
from tests.calibrate.dry_drives import believed, campaign, car, one_drive, truth


@pytest.fixture(scope="module")
def ideal():
    rng = np.random.default_rng(31)
    true, _ = car(rng)
    return true, one_drive(true, 1.0, rng, seconds=300.0, wind=0.0, sensors=IDEAL)


@pytest.fixture(scope="module")
def series():
    signals, true, gain = campaign(32, 2, seconds=300.0)
    return signals, true, gain, calibrate(signals, ["a", "b"], believed(true), accept=True)


def test_perfect_sensors_give_the_truth(ideal):
    true, signals = ideal
    known = truth(true, 1.0, signals)
    result = calibrate([signals], ["drive"], believed(true), {"torque_gain": 1.0}, accept=True)
    for name, limit in (
        ("mass", 2e-3), ("drag_area", 5e-3), ("r_e_f", 2e-4), ("r_e_r", 2e-4), ("r_e_ratio", 1.5e-4),
        ("rolling_resistance", 0.15),
    ):  # fmt: skip
        assert result.get(name).value == pytest.approx(known[name], rel=limit), name


def test_series_sensors_within_the_intervals(series):
    signals, true, gain, result = series
    known = truth(true, gain, signals[0])
    for name in ("mass_per_gain", "mass", "drag_area", "rolling_resistance", "r_e_f", "r_e_r", "r_e_ratio"):
        p = result.get(name)
        half = 0.5 * (p.ci95[1] - p.ci95[0])
        assert abs(p.value - known[name]) < 1.6 * half, name  # two of three would be luck, none far off is not
    assert not result.get("torque_gain").identified
    assert any("one ratio" in s for s in result.cannot_tell)


def test_a_weighed_car_tells_the_torque_gain(series):
    signals, true, gain, _ = series
    result = calibrate(signals, ["a", "b"], believed(true), {"mass": true.mass})
    assert result.get("torque_gain").value == pytest.approx(1.0 / gain, rel=0.01)
    assert result.get("torque_gain").identified
    assert result.get("mass").ci95 == (true.mass, true.mass)
    light = calibrate(signals, ["a", "b"], believed(true), {"mass": 0.9 * true.mass})
    (gain_cells,) = (cells for p in light.parameters if (cells := parameter_cells(p))[0] == "torque_gain")
    assert any(n.startswith(f"the torques are {gain_cells[1]} of what was read") for n in light.notes)


def test_hills_do_not_matter_to_mass():
    """The accelerometer's specific force has no grade in it (E2)."""
    rng = np.random.default_rng(33)
    true, _ = car(rng)
    seeds = np.random.default_rng(5), np.random.default_rng(5)
    flat, hilly = (
        one_drive(true, 1.0, r, seconds=360.0, wind=0.0, grade=g, sensors=IDEAL)
        for r, g in zip(seeds, (0.0, 3.0), strict=True)
    )
    masses = [calibrate([s], ["x"], believed(true)).get("mass_per_gain").value for s in (flat, hilly)]
    assert masses[0] == pytest.approx(true.mass, rel=2e-3)
    assert masses[1] == pytest.approx(true.mass, rel=2e-3)


def test_offset_from_the_energy_balance(ideal):
    true, signals = ideal
    plain = energy_offset(prepare(signals, believed(true), "x"))
    moved = replace(signals, frame=signals.frame.with_columns(pl.col("a_x") - 0.2))
    offset = energy_offset(prepare(moved, believed(true), "x"))
    assert offset.value - plain.value == pytest.approx(-0.2, abs=1e-3)
    assert abs(plain.value) < 3.0 * plain.sd
    t = signals.array("t")
    climbing = replace(signals, frame=signals.frame.with_columns(pl.col("altitude") + pl.Series(100.0 * t / t[-1])))
    higher = energy_offset(prepare(climbing, believed(true), "x"))
    assert higher.value - plain.value == pytest.approx(-9.81 * 100.0 / plain.way, rel=0.02)
    blind = energy_offset(prepare(replace(signals, frame=signals.frame.drop("altitude")), believed(true), "x"))
    assert blind.sd > 2.0 * plain.sd


def test_lags_are_found_and_taken_out(ideal):
    _, signals = ideal
    a = signals.array("a_x")
    dt = signals.dt
    late = np.concatenate([np.full(10, np.nan), a[:-10]])
    assert lag_between(late, a, dt) == pytest.approx(10 * dt, abs=0.003)
    assert lag_between(a, late, dt) == pytest.approx(-10 * dt, abs=0.003)
    np.testing.assert_allclose(earlier(late, 10 * dt, dt)[20:-20], a[20:-20], atol=1e-9)
    assert lag_between(np.random.default_rng(1).normal(size=a.size), a, dt) == 0.0


def test_correlations_are_those_of_the_pairs_that_are_known():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 80)).cumsum(axis=1)
    a[[0, 7, 8, 40]], b[[3, 8, 70, 79]] = np.nan, np.nan
    for k, found in zip(range(-30, 31), _correlations(a, b, 30), strict=True):
        pairs = np.array([(a[i + k], b[i]) for i in range(80) if 0 <= i + k < 80])
        x, y = pairs[np.isfinite(pairs).all(axis=1)].T
        assert found == pytest.approx(x @ y / np.sqrt((x @ x) * (y @ y)), abs=1e-12)
    assert not _correlations(np.full(80, np.nan), b, 3).any()


def test_late_torque_does_not_bias_mass(ideal):
    true, signals = ideal
    wheels = [f"torque_{w}" for w in ("fl", "fr", "rl", "rr")]
    late = replace(signals, frame=signals.frame.with_columns(pl.col(w).shift(15) for w in wheels))
    result = calibrate([late], ["x"], believed(true))
    assert result.get("mass_per_gain").value == pytest.approx(true.mass, rel=4e-3)
    assert result.drives[0].torque_lag_s == pytest.approx(0.3, abs=0.02)


def test_without_velocity_the_ratio_of_the_radii_remains(series):
    signals, true, gain, _ = series
    blind = [replace(s, frame=s.frame.drop("v_x")) for s in signals]
    result = calibrate(blind, ["a", "b"], believed(true))
    assert result.get("r_e_ratio").value == pytest.approx(truth(true, gain, signals[0])["r_e_ratio"], rel=3e-4)
    assert not result.get("r_e_f").identified
    assert any("give only the ratio of the radii" in s for s in result.cannot_tell)
    assert result.get("mass_per_gain").value == pytest.approx(true.mass * gain, rel=0.02)


def test_braked_and_wet_driving_is_left_out(ideal):
    true, signals = ideal
    plain = prepare(signals, believed(true), "x")
    wet = replace(signals, frame=signals.frame.with_columns(pl.lit(1.0).alias("on_water")))
    assert plain.left_out["braking"] > 5.0
    assert plain.windows.v.size > 60
    assert prepare(wet, believed(true), "x").windows.v.size == 0
    with pytest.raises(FitError, match="wet"):
        calibrate([wet], ["x"], believed(true))
    assert prepare(replace(signals, frame=signals.frame.head(20)), believed(true), "x").windows.v.size == 0


def test_missing_signals_are_named():
    frame = pl.DataFrame({"t": np.arange(100) * 0.01, "v_x": np.full(100, 20.0)})
    with pytest.raises(SignalError, match=r"a_x, torque_rl, torque_rr"):
        calibrate([Signals(frame, 10**7, None, {}, Quality(), ("x",))], ["x"], Vehicle(given=frozenset({"drivetrain"})))


def test_vehicle_file_holds_values_and_intervals(series, tmp_path):
    _, true, _, result = series
    path = tmp_path / "car.toml"
    path.write_text(calibrated_toml(believed(true), result), encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    loaded = load_vehicle(path)
    assert loaded.mass == pytest.approx(result.get("mass").value, rel=1e-6)
    assert loaded.r_e_f == pytest.approx(result.get("r_e_f").value, rel=1e-6)
    assert loaded.r_l_f == believed(true).r_l_f
    assert "h_cg" not in loaded.given
    assert "# h_cg = " in text
    low, high = result.get("mass").ci95
    assert f"95 %: {low:.0f} ... {high:.0f}" in text
    assert "# - torque_gain: mass and torque gain are one ratio" in text
    assert result.spread == {}  # two drives do not show how drives differ
    assert "[spread]" not in text


def test_vehicle_file_holds_the_spread_from_drive_to_drive(series, tmp_path):
    _, true, _, result = series
    before = replace(believed(true), torque_gain=2.0, spread={"mass": 9.0, "drag_area": 0.03})
    path = tmp_path / "car.toml"
    shown = replace(result, spread={"mass": 12.5, "torque_gain": 0.01})
    path.write_text(calibrated_toml(before, shown), encoding="utf-8")
    assert load_vehicle(path).spread == {"mass": 12.5, "drag_area": 0.03, "torque_gain": 0.02}


def test_between_drives_the_heavy_one_stands_out():
    """Four drives, the last with 200 kg more: its own mass against the others tells it."""
    rng = np.random.default_rng(34)
    true, gain = car(rng)
    heavy = replace(true, mass=true.mass + 200.0)
    signals = [one_drive(c, gain, rng, seconds=320.0, sensors=ESC) for c in (true, true, true, heavy)]
    result = calibrate(signals, list("abcd"), believed(true), {"torque_gain": 1.0 / gain})
    assert set(result.spread) <= {"mass", "drag_area", "rolling_resistance"}  # the gain is given
    assert 50.0 < result.spread["mass"] < 400.0
    difference, low, high = result.drives[3].against_others
    assert low < 200.0 < high
    assert difference == pytest.approx(200.0, abs=30.0)
    assert low > 0.0


def frozen(signals, *names):
    value = {n: pl.Series(signals.array(n)[100] + np.linspace(0.0, 1e-9, signals.frame.height)) for n in names}
    return replace(signals, frame=signals.frame.with_columns(**value))


@pytest.mark.parametrize("name", ["a_x", "v_x", "omega_rr"])
def test_a_signal_that_never_changes_is_refused(ideal, name):
    true, signals = ideal
    with pytest.raises(SignalError, match=f"{name} never changes"):
        calibrate([frozen(signals, name)], ["drive"], believed(true))


def test_a_dead_torque_is_refused_and_no_rolling_resistance_comes_of_it(ideal):
    true, signals = ideal
    torques = [f"torque_{w}" for w in true.driven]
    with pytest.raises(SignalError, match="never change"):
        calibrate([frozen(signals, *torques)], ["drive"], believed(true))
    # a torque of noise tells no slope between force and acceleration, so no level either
    rng = np.random.default_rng(1)
    noise = {t: pl.Series(rng.normal(0.0, 2.0, signals.frame.height)) for t in torques}
    made = replace(signals, frame=signals.frame.with_columns(**noise, brake_pressure=pl.lit(0.0)))
    found = {p.name: p for p in calibrate([made], ["drive"], believed(true)).parameters}
    assert not found["mass_per_gain"].identified
    assert not found["rolling_resistance"].identified


def test_what_contradicts_the_drives_is_said(series):
    signals, true, _, _ = series
    mass = believed(true).mass
    result = calibrate(signals, ["a", "b"], believed(true), {"mass": mass, "torque_gain": 0.5})
    assert any("contradict" in n for n in result.notes)
    quiet = calibrate(signals, ["a", "b"], believed(true), {"mass": mass})
    assert not any("contradict" in n for n in quiet.notes)


def test_a_gain_that_is_told_goes_into_the_file_and_onto_the_torques(series, tmp_path):
    """The weighed car's file with its torque gain: what is read with it shows no gain any more."""
    signals, true, _, _ = series
    before = believed(true)
    mass = 1.1 * true.mass  # a heavier car on the scales: torques must be larger than they were read
    result = calibrate(signals, ["a", "b"], before, {"mass": mass})
    path = tmp_path / "car.toml"
    path.write_text(calibrated_toml(before, result), encoding="utf-8")
    car = load_vehicle(path)
    assert car.torque_gain == pytest.approx(result.get("torque_gain").value, rel=1e-6)
    assert car.torque_gain > 1.05
    log = tmp_path / "drive.csv"
    names = [f"torque_{w}" for w in true.driven]
    frame = signals[0].frame.select("t", "a_x", *names)
    frame.rename({"t": "t [s]", "a_x": "a_x [m/s^2]", **{n: f"{n} [N*m]" for n in names}}).write_csv(log)
    plain, scaled = (load_signals([log], vehicle=v).array(names[0]) for v in (before, car))
    np.testing.assert_allclose(scaled, car.torque_gain * plain, rtol=1e-12)


def test_a_weighed_mass_that_the_drives_contradict_stays_unless_accepted(series):
    """A file that says 300 kg less than the drives show: the mass or the torques are wrong, and only the user knows."""
    signals, true, _, plain = series
    light = replace(believed(true), mass=plain.get("mass").value - 300.0, given=frozenset({"drivetrain", "mass"}))
    kept, taken = (calibrate(signals, ["a", "b"], light, accept=accept) for accept in (False, True))
    for result, word in ((kept, "is kept"), (taken, "is taken")):
        (note,) = (n for n in result.notes if "the vehicle file says mass" in n)
        assert word in note
    (note,) = (n for n in kept.notes if "the vehicle file says mass" in n)
    assert f"--fix mass={light.mass:.5g} gives a torque gain of {light.mass / plain.get('mass').value:.3g}" in note
    p = kept.get("mass")
    assert (p.kept, p.file_value) == (True, light.mass)
    assert p.value == pytest.approx(plain.get("mass").value, rel=1e-6)  # the search begins elsewhere
    car, other = (calibrated(light, r.parameters) for r in (kept, taken))
    assert car.mass == light.mass
    assert other.mass == pytest.approx(p.value, rel=1e-6)
    # the balance fits no car of another mass: all of it stays, and says where it comes from although drives differ
    assert (car.drag_area, car.rolling_resistance) == (light.drag_area, light.rolling_resistance)
    assert other.drag_area == pytest.approx(taken.get("drag_area").value, rel=1e-6)
    assert {provenance_of(car, key).source for key in ("mass", "drag_area")} == {"data_sheet", "guess"}
    assert f"mass = {light.mass!r}" in calibrated_toml(light, kept)
    assert "kept, the drives show" in calibrated_toml(light, kept)


def test_a_guess_of_the_file_is_no_knowledge_to_keep(series):
    signals, true, _, plain = series
    light = replace(
        believed(true), mass=plain.get("mass").value - 300.0, given=frozenset({"drivetrain", "mass"}),
        provenance={"mass": Provenance("guess")},
    )  # fmt: skip
    result = calibrate(signals, ["a", "b"], light)
    assert not result.get("mass").kept
    assert calibrated(light, result.parameters).mass == pytest.approx(plain.get("mass").value, rel=1e-6)


def test_what_is_not_given_or_fixed_is_no_contradiction(series):
    signals, true, _, plain = series
    free = replace(believed(true), mass=plain.get("mass").value - 300.0, given=frozenset({"drivetrain"}))
    assert not any(p.kept for p in calibrate(signals, ["a", "b"], free).parameters)
    given = replace(free, given=frozenset({"drivetrain", "mass"}))
    assert not any(p.kept for p in calibrate(signals, ["a", "b"], given, {"mass": true.mass}).parameters)


@pytest.mark.parametrize(("sd", "kept"), [(None, False), (1e-5, True)])
def test_a_radius_off_by_less_than_its_source_leaves_is_no_contradiction(series, sd, kept):
    signals, true, _, plain = series
    found = plain.get("r_e_f")
    half = 0.5 * (found.ci95[1] - found.ci95[0])
    off = replace(
        believed(true), r_e_f=found.value - 4.0 * half, given=believed(true).given | {"wheels.r_e_f"},
        provenance={"wheels.r_e_f": Provenance("data_sheet" if sd is None else "measured", sd)},
    )  # fmt: skip
    assert calibrate(signals, ["a", "b"], off).get("r_e_f").kept == kept


def test_beside_a_kept_drag_area_the_rolling_resistance_is_found_anew(series):
    """A file must fit its own drives: a rolling resistance that was found with another drag area does not."""
    signals, true, _, plain = series
    mass = plain.get("mass").value
    odd = replace(believed(true), drag_area=3.0 * true.drag_area, given=frozenset({"drivetrain", "drag_area"}))
    kept = calibrate(signals, ["a", "b"], odd, {"mass": mass})
    beside = calibrate(signals, ["a", "b"], odd, {"mass": mass, "drag_area": odd.drag_area})
    assert kept.get("drag_area").kept
    car = calibrated(odd, kept.parameters)
    assert car.drag_area == odd.drag_area
    for name in ("rolling_resistance", "torque_gain"):
        assert kept.get(name).value == pytest.approx(beside.get(name).value, rel=1e-9)
    assert abs(car.rolling_resistance / plain.get("rolling_resistance").value - 1.0) > 0.05
    assert [d.rmse_after for d in kept.drives] == [d.rmse_after for d in beside.drives]
    accepted = calibrate(signals, ["a", "b"], odd, {"mass": mass}, accept=True).get("drag_area").value
    (note,) = (n for n in kept.notes if "the vehicle file says drag_area" in n)
    assert f"--accept takes {accepted:.2f}" in note


def test_a_torque_gain_that_is_not_identified_is_not_said_to_be_written(series):
    """With a weighed mass, but forces that hardly tell the gain: the file keeps its own, and the note says that."""
    signals, true, _, plain = series
    wide = replace(plain.get("torque_gain"), value=1.2, ci95=(0.9, 1.5), identified=False, why_not="wide")
    written = identified_values([wide], believed(true))
    assert written == {}
    (note,) = (n for n in notes([], [], {"mass": true.mass, "torque_gain": 1.2}, {}, written, by_drive=True))
    assert "keeps the torque_gain" in note
    assert "corrects them" not in note
    given = calibrate(signals, ["a", "b"], believed(true), {"mass": 1.2 * plain.get("mass").value})
    assert any("torque_gain in the calibrated vehicle file corrects them" in n for n in given.notes)
    assert "\ntorque_gain = 1.2" in calibrated_toml(believed(true), given)


def with_all_torques(signals, true):
    """As a log that holds the torques of all wheels: those of the axle that is not driven are zero."""
    free = [f"torque_{w}" for w in ("fl", "fr", "rl", "rr") if w not in true.driven]
    return replace(signals, frame=signals.frame.with_columns(**dict.fromkeys(free, pl.lit(0.0))))


def test_without_a_drivetrain_only_what_needs_no_driven_axle_is_estimated(series, tmp_path):
    signals, true, gain, plain = series
    free = ["torque_fl", "torque_fr"] if true.drivetrain == "rwd" else ["torque_rl", "torque_rr"]
    lone = [replace(s, frame=s.frame.drop(free, strict=False)) for s in signals]
    bare = replace(believed(true), drivetrain="rwd", given=frozenset())
    result = calibrate(lone, ["a", "b"], bare)
    axle = true.driven[0][0]
    proposed = f"torque_{axle} moves, torque_{'f' if axle == 'r' else 'r'} is not in the log: drivetrain = "
    for name in ("mass", "drag_area", "rolling_resistance", "mass_per_gain"):
        assert not result.get(name).identified
        assert "does not say which axle is driven" in result.get(name).why_not
        assert proposed in result.get(name).why_not
    known = truth(true, gain, signals[0])
    for name in ("r_e_f", "r_e_r", "r_e_ratio"):
        low, high = result.get(name).ci95
        assert low <= known[name] <= high, name
    assert result.get("accelerometer_offset[a]").value == pytest.approx(
        plain.get("accelerometer_offset[a]").value, abs=1e-6
    )
    text = calibrated_toml(bare, result)
    assert '\n# drivetrain: SET "rwd", "fwd" or "awd"' in text
    (tmp_path / "car.toml").write_text(text, encoding="utf-8")
    assert not load_vehicle(tmp_path / "car.toml").knows_drivetrain


def test_the_torques_of_all_wheels_need_no_drivetrain(series):
    signals, true, _, plain = series
    bare = replace(believed(true), drivetrain="rwd", given=frozenset())
    result = calibrate([with_all_torques(s, true) for s in signals], ["a", "b"], bare)
    assert result.get("mass").value == pytest.approx(plain.get("mass").value, rel=2e-3)


def test_without_torques_and_drivetrain_nothing_is_left(series):
    signals, true, _, _ = series
    bare = replace(believed(true), given=frozenset())
    none = replace(signals[0], frame=signals[0].frame.drop([n for n in signals[0].symbols if n.startswith("torque")]))
    with pytest.raises(SignalError, match="without torque of the driven wheels, drivetrain in the vehicle file"):
        calibrate([none], ["a"], bare)


def own_sd(p):
    """Standard deviation without the part of inertias and radii, which have deviations of their own."""
    return math.sqrt(((p.ci95[1] - p.ci95[0]) / 3.92) ** 2 - p.shared**2)


def test_wrong_inertias_and_radii_are_in_the_interval_of_the_gain(series):
    signals, true, _, _ = series
    heavy = replace(believed(true), inertia_f=1.3 * true.inertia_f, inertia_r=1.3 * true.inertia_r)
    gain = calibrate(signals, ["a", "b"], heavy, {"mass": true.mass}).get("torque_gain")
    assert gain.ci95[0] < 1.0 < gain.ci95[1]
    assert abs(gain.value - 1.0) > 2.0 * own_sd(gain)  # by scatter alone it would be outside
    keys = dict.fromkeys(("wheels.inertia_f", "wheels.inertia_r"), Provenance("measured", 0.01))
    sure = replace(heavy, provenance=keys, given=heavy.given | set(keys))
    assert calibrate(signals, ["a", "b"], sure, {"mass": true.mass}).get("torque_gain").shared < gain.shared


def test_where_the_values_of_a_calibrated_file_come_from(series, tmp_path):
    signals, true, _, result = series
    before = replace(believed(true), given=frozenset({"name", "drivetrain", "mass", "l_f", "wheels.r_e_f"}))
    before = replace(before, provenance={"l_f": Provenance("measured", 0.02), "mass": Provenance("data_sheet")})
    path = tmp_path / "car.toml"
    path.write_text(calibrated_toml(before, result), encoding="utf-8")
    car = load_vehicle(path)
    assert car.provenance == calibrated(before, result.parameters).provenance
    for name, key in (("mass", "mass"), ("drag_area", "drag_area"), ("r_e_f", "wheels.r_e_f")):
        assert car.provenance[key] == Provenance("calibrated", pytest.approx(own_sd(result.get(name)), rel=5e-3))
    assert car.provenance["l_f"] == Provenance("measured", 0.02)  # as before
    assert car.provenance["torque_gain"] == Provenance("guess", 0.02)  # the mass rests on it
    assert car.provenance["wheels.r_l_f"] == Provenance("guess")  # written for the forces, measured by nobody
    weighed = calibrate(signals, ["a", "b"], before, {"mass": true.mass})
    gain = weighed.get("torque_gain")
    twice = replace(before, torque_gain=2.0, mass=true.mass, provenance={})
    car = calibrated(twice, weighed.parameters)
    assert car.provenance["mass"] == Provenance("measured")
    assert car.provenance["torque_gain"].sd == pytest.approx(2.0 * own_sd(gain), rel=5e-3)
    known = replace(twice, provenance={"mass": Provenance("measured", 3.0)})
    assert calibrated(known, weighed.parameters).provenance["mass"].sd == 3.0
    known = replace(known, mass=true.mass + 5.0)  # of another value
    assert calibrated(known, weighed.parameters).provenance["mass"] == Provenance("measured")


def test_what_is_kept_keeps_its_provenance_and_a_ratio_of_radii_knows_no_size(series):
    _, true, _, result = series
    light = replace(believed(true), given=frozenset({"mass"}), provenance={"mass": Provenance("measured")})
    kept = [replace(p, kept=True) if p.name == "mass" else p for p in result.parameters]
    assert calibrated(light, kept).provenance["mass"] == Provenance("measured")
    assert "; 1 of them contradicts the vehicle file" in estimated(replace(result, parameters=tuple(kept)))
    assert "contradict" not in estimated(result)
    ratio = [p for p in result.parameters if p.name == "r_e_ratio"]
    for given, share in ((frozenset(), 0.015), (frozenset({"wheels.r_e_f", "wheels.r_e_r"}), 0.01)):
        car = calibrated(replace(light, given=given), ratio)
        assert car.provenance["wheels.r_e_f"].sd == pytest.approx(share * light.r_e_f, rel=0.05)
