"""Effects put into measured drives: by mechanics, in all signals that they touch, and by code of their own."""

import ast
from pathlib import Path

import numpy as np
import pytest

from aqualog.core.vehicle import Vehicle
from tests.blind.injected.drives import WHEELS, Drive, measured, real_folder, window, write_drive
from tests.blind.injected.make import bases, filled_case, kinds_of, write_case
from tests.blind.injected.noise import SOURCES, Noise, added, noise_of
from tests.blind.injected.physics import EFFECTS, UNKNOWN, inject, position
from tests.blind.injected.plan import ASKS, STEPS, Z_AT_LIMIT, planned
from tests.blind.judging.answers import Answer
from tests.blind.sealed import open_truth

HERE = Path(__file__).parent
G = 9.80665
CAR = Vehicle(
    name="test", drivetrain="rwd", mass=1500.0, l_f=1.4, l_r=1.4, drag_area=0.6, rolling_resistance=0.01, r_e_f=0.31,
    r_e_r=0.31, r_l_f=0.30, r_l_r=0.30, torque_gain=0.9,
)  # fmt: skip
MIDDLE = slice(20, -20)


@pytest.fixture(scope="module")
def drive():
    """Two minutes of slowly changing speed at 50 Hz, on a level road."""
    t = np.arange(0.0, 120.0, 0.02)
    wave = 2.0 * np.pi / 20.0
    return made(t, 18.0 + 6.0 * np.sin(wave * t), 6.0 * wave * np.cos(wave * t))


def made(t, v, a):
    """The drive that a car as in its file would log."""
    force = CAR.mass * (a + G * CAR.rolling_resistance) + 0.5 * CAR.air_density * CAR.drag_area * v * v
    wheels = {f"omega_{w}": v / 0.31 for w in WHEELS}
    columns = {"t": t, "v_x": v, "a_x": a, "torque_f": np.zeros(t.size), "torque_r": force * 0.31 / 0.9, **wheels}
    return Drive("test", "made", columns, CAR, HERE / "rav4.toml")


def change(drive, effect, where=None, **values):
    """Signals that an effect changes: name -> difference."""
    new = inject(drive, effect, where, values).columns
    pairs = {n: new[n] - x for n, x in drive.columns.items()}
    return {n: x for n, x in pairs.items() if np.abs(x).max() > 1e-12}


def pull(changed):
    """Force [N] at the road that the change of the rear torque is."""
    return changed["torque_r"] * CAR.torque_gain / 0.31


def test_a_load_shows_as_mass_times_acceleration_in_the_torque(drive):
    got = change(drive, "payload_mass", delta_mass=150.0)
    expected = 150.0 * (drive.columns["a_x"] + G * CAR.rolling_resistance)
    assert np.abs(pull(got) - expected)[MIDDLE].max() < 1.0
    assert set(got) == {
        "torque_r",
        "omega_rl",
        "omega_rr",
    }  # free wheels roll as before: load and resistance grow alike


def test_a_load_changes_the_slip_by_the_new_force_over_the_new_stiffness():
    t = np.arange(0.0, 40.0, 0.02)
    drive = made(t, 5.0 + 0.7 * t, np.full(t.size, 0.7))  # steady, so that no smoothing shows
    got = change(drive, "payload_mass", delta_mass=150.0)
    v, a = drive.columns["v_x"], drive.columns["a_x"]
    load = 0.5 * (0.5 * CAR.mass * G + CAR.mass * a * CAR.h_cg / 2.8)
    stiff = CAR.slip_slope_r * load
    before = 0.5 * drive.columns["torque_r"] * 0.9 / 0.31 - 0.01 * load
    after = before + 0.5 * 150.0 * (a + G * 0.01) - 0.01 * 150.0 / 1500.0 * load
    expected = (v / 0.31) * (after / (1.1 * stiff) - before / stiff)
    assert got["omega_rl"] == pytest.approx(expected, rel=1e-9)


def test_a_slope_is_felt_and_pulled_against(drive):
    got = change(drive, "road_grade", grade=0.03)
    assert got["a_x"] == pytest.approx(G * np.sin(0.03))
    assert pull(got) == pytest.approx(CAR.mass * G * np.sin(0.03))
    assert got["omega_rl"].min() > 0.0  # driven wheels slip more
    assert "v_x" not in got


def test_hills_return_at_their_places(drive):
    got = change(drive, "road_grade", rms=0.02, wavelength=300.0, phase=0.2)
    assert np.sqrt(np.mean(got["a_x"] ** 2)) == pytest.approx(G * 0.02, rel=0.01)
    assert pull(got) == pytest.approx(CAR.mass * got["a_x"])


def test_air_and_rolling_forces(drive):
    v = drive.columns["v_x"]
    assert pull(change(drive, "aero_drag", delta_drag_area=0.2)) == pytest.approx(0.5 * CAR.air_density * 0.2 * v * v)
    wind = pull(change(drive, "head_wind", speed=4.0))
    assert wind == pytest.approx(0.5 * CAR.air_density * 0.6 * ((v + 4.0) ** 2 - v * v))
    rolling = change(drive, "rolling_resistance", delta_r_w=0.004)
    assert pull(rolling) == pytest.approx(0.004 * CAR.mass * G)
    assert rolling["omega_fl"].max() < 0.0  # a free wheel that rolls harder lags


def test_a_dragging_brake_is_pulled_by_the_driven_wheels(drive):
    got = change(drive, "brake_drag", "fl", torque=30.0)
    assert pull(got) == pytest.approx(30.0 / 0.31)
    assert "omega_fr" not in got
    load = 0.5 * (0.5 * CAR.mass * G - CAR.mass * drive.columns["a_x"] * CAR.h_cg / 2.8)
    expected = -(30.0 / 0.31) / (CAR.slip_slope_f * load) * drive.columns["v_x"] / 0.31
    assert np.abs(got["omega_fl"] - expected)[MIDDLE].max() < 1e-3


def test_sensors(drive):
    c = drive.columns
    assert inject(drive, "torque_gain", None, {"gain": 0.8}).columns["torque_r"] == pytest.approx(c["torque_r"] / 0.8)
    late = inject(drive, "signal_delay", "omega", {"delay": 0.1}).columns
    assert late["omega_rr"][5:] == pytest.approx(c["omega_rr"][:-5])
    half = inject(drive, "signal_delay", "a_x", {"delay": 0.01}).columns["a_x"]
    assert np.abs(half - np.interp(c["t"] - 0.01, c["t"], c["a_x"]))[3:-3].max() < 1e-4
    assert change(drive, "accelerometer_drift", "a_x", drift=1e-3)["a_x"][-1] == pytest.approx(1e-3 * c["t"][-1])
    assert change(drive, "accelerometer_gain", "a_x", gain=1.1)["a_x"] == pytest.approx(0.1 * c["a_x"])
    turning = Drive("test", "made", {**c, "yaw_rate": 0.02 * c["v_x"]}, CAR, HERE / "rav4.toml")
    moved = change(turning, "accelerometer_position", "a_x", ahead=-2.0)["a_x"]
    assert moved[MIDDLE] == pytest.approx(2.0 * (0.02 * c["v_x"][MIDDLE]) ** 2, abs=0.01)
    assert set(change(drive, "velocity_scale", "v_x", scale=1.02)) == {"v_x"}
    smaller = inject(drive, "tyre_radius", "rr", {"delta": -0.01}).columns
    assert smaller["omega_rr"] == pytest.approx(c["omega_rr"] / 0.99)
    assert smaller["torque_r"] == pytest.approx(c["torque_r"] * 0.995)
    ring = change(drive, "tone_ring", "fl", amplitude=0.002)
    assert np.abs(ring["omega_fl"] / c["omega_fl"]).max() == pytest.approx(0.002, rel=0.02)


def test_forms_act_where_they_should(drive):
    v, t = drive.columns["v_x"], drive.columns["t"]
    hump = pull(change(drive, "force_hump", force=200.0, centre=20.0, width=2.0))
    assert hump == pytest.approx(200.0 * np.exp(-0.5 * ((v - 20.0) / 2.0) ** 2))
    step = pull(change(drive, "force_step", force=150.0, start=30.0, duration=75.0))
    assert step[(t > 31.0) & (t < 104.0)] == pytest.approx(150.0)
    assert step[(t < 29.0) | (t > 106.0)] == pytest.approx(0.0)
    wave = pull(change(drive, "force_wave", force=100.0, wavelength=200.0))
    assert wave == pytest.approx(100.0 * np.sin(2.0 * np.pi * position(drive) / 200.0))
    gain = change(drive, "accelerometer_speed", rate=0.01)["a_x"]
    assert gain == pytest.approx(0.01 * (v - 15.0) * drive.columns["a_x"])
    assert set(UNKNOWN) <= set(EFFECTS)


def test_braking_is_shared_as_the_brakes_are_and_a_standing_car_is_left_alone(drive):
    c = {n: x.copy() for n, x in drive.columns.items()}
    c["torque_f"][:], c["torque_r"][:] = -300.0, -100.0
    c["v_x"][:500] = 0.0
    braked = Drive("test", "made", c, CAR, HERE / "rav4.toml")
    got = change(braked, "road_grade", grade=-0.02)
    assert got["torque_f"][600] == pytest.approx(3.0 * got["torque_r"][600])
    assert got["torque_r"][:500] == pytest.approx(0.0)
    assert got["a_x"][:500] == pytest.approx(G * np.sin(-0.02))


def limits_of(drive):
    return Answer("no_effect", limits={
        "payload_mass": 60.0, "torque_gain": 0.04, "signal_delay@torque": 0.03, "accelerometer_bias@a_x": 0.06,
        "rolling_resistance": 0.003, "tyre_radius@rr": 0.002, "aero_drag": 5.0,
    })  # fmt: skip


def test_sizes_are_one_to_four_times_the_stated_limit(drive):
    answer, rng, seen = limits_of(drive), np.random.default_rng(1), set()
    neutral = {(a.effect, a.where, a.parameter): a.neutral for a in ASKS}
    for i in range(60):
        plan = planned(drive, answer, "known", i, rng)
        ((effect, where, values, z),) = plan.effects
        key = effect if where is None else f"{effect}@{where}"
        seen.add(key)
        if key in answer.limits:
            name, x = next(iter(values.items()))
            times = abs(x - neutral[effect, where, name]) / answer.limits[key]
            assert min(abs(times - s) for s in STEPS) < 1e-9 or times < max(STEPS)
            assert z == pytest.approx(Z_AT_LIMIT * times)
        else:
            assert z is None
    assert "aero_drag" not in seen  # no such drag is worth making
    assert "head_wind" not in seen  # no limit is stated
    assert {"payload_mass", "torque_gain", "tyre_radius@rr"} <= seen


def test_a_drive_without_torque_gets_no_force_form(drive):
    bare = {n: x for n, x in drive.columns.items() if not n.startswith("torque")}
    own, rng = Drive("test", "made", bare, CAR, HERE / "rav4.toml"), np.random.default_rng(1)
    forms = {planned(own, limits_of(own), "unknown", i, rng).form[0] for i in range(8)}
    assert forms == {"accelerometer_speed"}


def test_truth_of_each_kind(drive, tmp_path):
    rng = np.random.default_rng(2)
    for i, kind in enumerate(("null", "known", "unknown", "compound")):
        own, truth = filled_case(drive, drive, planned(drive, limits_of(drive), kind, i, rng))
        folder = tmp_path / f"c{i}"
        write_case(folder, own, {**truth, "seed": 1, "clean": "base-1"})
        (folder / "verdict.json").write_text("{}")
        read = open_truth(folder)
        assert (read["kind"], len(read["effects"])) == (kind, {"known": 1, "compound": 2}.get(kind, 0))
        assert (read["unknown"] is not None) == (kind == "unknown")
        assert {f.name for f in folder.iterdir()} == {"drive.parquet", "vehicle.toml", "truth.bin", "verdict.json"}
    kinds = kinds_of("mixed", 40, rng)
    assert [kinds.count(k) for k in ("null", "known", "unknown", "compound")] == [6, 20, 8, 6]


def test_written_drives_need_no_map(drive, tmp_path):
    import aqualog as aq

    write_drive(drive.columns, tmp_path / "drive.parquet")
    (tmp_path / "vehicle.toml").write_text((HERE / "porsche.toml").read_text())
    signals = aq.read(tmp_path / "drive.parquet", vehicle=tmp_path / "vehicle.toml").signals
    assert signals.array("v_x")[100] == pytest.approx(drive.columns["v_x"][100], abs=1e-6)
    # the file's torque gain counts once, on reading
    total = signals.array("torque_rl")[100] + signals.array("torque_rr")[100]
    assert total == pytest.approx(0.835 * drive.columns["torque_r"][100])


def test_noise_keeps_its_size_and_goes_to_and_fro():
    x = np.random.default_rng(3).standard_normal(500)
    noises = [Noise("one", 0.1, {"a_x": x, "torque_r": 2.0 * x}), Noise("other", 0.02, {"omega_fl": 0.1 * x})]
    clean = {n: np.zeros(20_000) for n in ("a_x", "torque_rl", "omega_fl", "gear")}
    got = added(clean, noises, 0.1, np.random.default_rng(4))
    assert np.std(got["a_x"]) == pytest.approx(np.std(x), rel=0.02)
    assert np.std(got["torque_rl"]) == pytest.approx(np.std(x), rel=0.02)  # half of the axle's
    assert abs(np.corrcoef(got["torque_rl"], got["a_x"])[0, 1]) < 0.1  # of another moment
    assert 0.05 < np.std(got["omega_fl"]) < 0.11
    assert not got["gear"].any()
    fine = added(clean, noises, 0.01, np.random.default_rng(4))["a_x"]
    assert np.abs(np.diff(fine)).max() < 0.11 * np.ptp(x)  # a line between samples


def test_noise_of_a_drive_is_what_its_other_signals_do_not_show(drive):
    rng = np.random.default_rng(5)
    n = drive.columns["t"].size
    level = {"a_x": 0.08, "omega_fl": 0.05, "torque_r": 3.0}
    noisy = {**drive.columns, **{k: drive.columns[k] + s * rng.standard_normal(n) for k, s in level.items()}}
    found = noise_of(Drive("test", "made", noisy, CAR, HERE / "rav4.toml"))
    for name, size in level.items():
        assert 0.6 * size < np.std(found.columns[name]) < 1.3 * size


def test_an_accelerometer_that_comes_late_leaves_no_jerk_in_the_noise(drive):
    """What it lags by is a delay that is there, and would be named in drives without an effect."""
    rng = np.random.default_rng(4)
    t = drive.columns["t"]
    v = 18.0 + np.sin(t)
    a, jerk = (np.cos(t - lag) for lag in (0.2, 0.2 - np.pi / 2.0))
    hiss = 0.05 * rng.standard_normal(t.size)
    late = {**drive.columns, "v_x": v, "a_x": a + hiss, **{f"omega_{w}": v / 0.31 for w in WHEELS}}
    found = noise_of(Drive("test", "made", late, CAR, HERE / "rav4.toml")).columns["a_x"]
    assert found.std() == pytest.approx(0.05, rel=0.1)
    assert abs(np.corrcoef(found, jerk[: found.size])[0, 1]) < 0.1


def test_nothing_of_the_librarys_physics_or_model_is_used():
    for path in HERE.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [a.name for a in node.names] if isinstance(node, ast.Import) else []
            assert not [n for n in names if n.startswith(("aqualog.physics", "aqualog.model", "aqualog.diagnose"))], (
                path
            )


@pytest.mark.real
@pytest.mark.parametrize("car", ["bmw", "rav4"])
def test_measured_drives(car):
    real = real_folder()
    if real is None:
        pytest.skip("no measured drives: AQUALOG_REAL_LOGS names their folder")
    ((_, drive, later, other),) = bases(car, 1, 1, 200.0, real)
    assert (other is None) == (car == "rav4")
    v, a, dt = drive.columns["v_x"], drive.columns["a_x"], drive.dt
    slow = np.convolve(np.nan_to_num(np.gradient(v, dt)), np.ones(9) / 9.0, "same")
    good = np.isfinite(a) & np.isfinite(v)
    assert np.corrcoef(slow[good], a[good])[0, 1] > 0.5
    assert later.columns["v_x"].size >= 0.89 * drive.columns["v_x"].size  # a short drive has no later part as long
    assert window(drive, 10.0, 20.0).columns["t"][0] == 0.0
    noise = noise_of(measured(car, drive.trip, real))
    assert 0.02 < np.std(noise.columns["a_x"]) < 0.2
    assert car in SOURCES
