"""Scripted wheel speeds, made without the tyre model: what is put in is what must come out."""

import numpy as np
import polars as pl
import pytest

from aqualog.detect.stream import detect_drive
from tests.drives import CAR, FWD, as_signals, drive
from tests.small_model import Lane

DT = 0.01
WHEELS = ("fl", "fr", "rl", "rr")


def scripted(seed=0, duration=40.0, dips=(), speed=27.0, noise=1.0, offset=0.2, reference=True, radius=None, road=None):
    """A car on a dry road whose wheels dip as told: (wheel, start, depth share, length)."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, DT)
    v = speed + 1.5 * np.sin(2 * np.pi * t / 20)
    columns = {"t": t}
    for wheel in WHEELS:
        v_w = v * (1 + rng.normal(0, 0.002)) + rng.normal(0, noise * DT / np.sqrt(2), t.size)
        for own, start, depth, length in dips:
            inside = (t >= start) & (t < start + length)
            if own == wheel:
                v_w[inside] -= v[inside] * depth * np.sin(np.pi * (t[inside] - start) / length)
        if road is not None:
            v_w += road[wheel]
        columns[f"omega_{wheel}"] = v_w * (1.0 + (radius or {}).get(wheel, 0.0)) / CAR.r_e_f
    columns["a_x"] = np.gradient(v, DT) + offset + rng.normal(0, 0.06, t.size)
    if reference:  # a GNSS receiver: late and a little wrong
        columns["v_x"] = np.interp(t - 0.2, t, v) * 1.01 + rng.normal(0, 0.03, t.size)
    columns["yaw_rate"] = rng.normal(0, 0.003, t.size)
    return columns


def found(columns, car=CAR):
    return detect_drive(as_signals(columns), car).events


def with_torque(columns):
    """Wheel torques that explain the accelerometer without any water."""
    force = CAR.mass * columns["a_x"] + 0.5 * CAR.drag_area * CAR.air_density * 27.0**2 + 0.0105 * CAR.mass * 9.80665
    torque = force * CAR.r_e_r / 2
    zero = np.zeros_like(torque)
    return columns | {"torque_fl": zero, "torque_fr": zero, "torque_rl": torque, "torque_rr": torque}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("reference", [True, False])
def test_noise_alone_is_nothing(seed, reference):
    assert not found(scripted(seed, reference=reference))


@pytest.mark.parametrize("length", [0.05, 0.1, 0.15, 0.2, 0.3])
@pytest.mark.parametrize("depth", [0.03, 0.05, 0.08])
def test_trains_of_short_dips(length, depth):
    dips = [("fr", 20 + 0.4 * k, depth, length) for k in range(8)]
    events = found(scripted(dips=dips))
    minor = [e for e in events if e.detector == "minor_spin_down"]
    assert {e.wheel for e in events} == {"fr"}
    assert minor
    assert minor[0].start_s < 20.9
    assert all(e.end_s < 24.5 for e in minor)


@pytest.mark.parametrize(("depth", "length"), [(0.06, 0.1), (0.02, 0.05)])
def test_a_single_short_dip(depth, length):
    minor = [e for e in found(scripted(dips=[("fl", 20.0, depth, length)])) if e.detector == "minor_spin_down"]
    assert [(e.wheel, e.end_s < 21.5) for e in minor] == [("fl", True)]


@pytest.mark.parametrize("seed", range(10))
def test_rough_road_is_no_minor_spin_down_from_its_first_second_on(seed):
    rng = np.random.default_rng(100 + seed)
    n = round(40.0 / DT)
    shake = {w: np.convolve(rng.normal(0, 1, n + 4), np.ones(5) / 5, "valid") * 0.22 for w in WHEELS}
    road = {w: shake[w] * (1.0 if w[0] == "f" else 0.8) for w in WHEELS}
    assert not [e for e in found(scripted(seed, road=road)) if e.detector == "minor_spin_down"]


@pytest.mark.parametrize("signal", ["yaw_rate", "a_x", "v_x"])
@pytest.mark.parametrize("gap", [0.1, 0.6, 2.0])
def test_a_gap_in_another_signal_does_not_hide_a_full_spin_down(signal, gap):
    columns = scripted()
    t = columns["t"]
    down = np.clip((t - 20.0) / 0.65, 0, 1) - np.clip((t - 22.0) / 0.4, 0, 1)
    columns["omega_fr"] = columns["omega_fr"] * (1 - down)
    columns[signal] = np.where((t >= 19.98) & (t < 19.98 + gap), np.nan, columns[signal])
    spins = [e for e in found(columns) if e.detector == "spin_down"]
    assert [e.wheel for e in spins] == ["fr"]
    assert spins[0].start_s < 20.3
    assert spins[0].severity == "full"


def test_a_reference_that_fails_to_zero_is_outvoted_by_the_wheels():
    columns = scripted()
    t = columns["t"]
    columns["v_x"] = np.where((t > 15) & (t < 18), 0.0, columns["v_x"])
    assert not found(columns)
    result = detect_drive(as_signals(columns), CAR)
    assert result.features["v_x_hat"].to_numpy()[1500:1800].min() > 24.0


@pytest.mark.parametrize("depth", [0.3, 0.6, 1.0])
def test_dips_on_a_dry_car_do_not_open_the_resistance_gate(depth):
    """C64: neither a dipping wheel nor a dead sensor is resistance."""
    columns = with_torque(scripted(dips=[("fr", 20.0, depth, 0.6)], offset=0.0))
    events = found(columns)
    assert [e for e in events if e.detector == "spin_down"]
    assert not [e for e in events if e.detector in ("joint_criteria", "resistance")]


def test_dead_sensor_is_no_joint_detection():
    columns = with_torque(scripted(offset=0.0))
    t = columns["t"]
    columns["omega_fl"] = np.where((t > 20) & (t < 25), 0.0, columns["omega_fl"])
    assert not [e for e in found(columns) if e.detector == "joint_criteria"]


@pytest.mark.parametrize("share", [-0.03, -0.02, 0.03])
def test_wrong_radius_does_not_keep_an_event_open(share):
    events = found(scripted(radius={"fl": share}, dips=[("fl", 20.0, 0.08, 0.05)]))
    assert all(e.end_s - e.start_s < 3.0 for e in events)
    assert all(e.start_s > 19.9 for e in events)


def test_lifting_off_is_not_braking():
    """A driver lifts when the car aquaplanes: engine braking must not silence the detectors."""
    kw = {"lanes": (Lane(6, 14, 1.0e-3, 1.3e-3),), "speed_kmh": ((0.0, 110.0),)}
    lift = {"extra_torque": ((0, 0), (8, 0), (8.5, -300), (16, -300)), "holds_speed": True}
    for vehicle in (CAR, FWD):
        signals, _ = drive(vehicle, **kw, **lift)
        result = detect_drive(signals, vehicle)
        assert not [e for e in result.events if e.evidence.get("braking_at_start") and e.start_s < 14.0]


@pytest.mark.parametrize("mu", [0.15, 0.2, 0.3])
@pytest.mark.parametrize("offset", [0.0, -0.15])
def test_spin_up_on_snow_is_rejected_with_an_offset_too(mu, offset):
    """C27: snow rolls heavier, and accelerometers are off."""
    kw = {
        "lanes": (Lane(6, 14, mu=mu, slope_factor=0.4),), "speed_kmh": ((0.0, 70.0),), "holds_speed": False,
        "extra_torque": ((0, 200), (7.5, 200), (8.5, 1800), (9.5, 1800), (10, 200)), "a_x_offset": offset,
    }  # fmt: skip
    signals, truth = drive(CAR, **kw)
    assert (truth["omega_rl"] * CAR.r_e_r / truth["v_x"]).max() > 1.1
    assert not [e for e in detect_drive(signals, CAR).events if e.detector in ("spin_up", "joint_criteria")]


def test_braking_after_the_spin_down_began_does_not_undo_it():
    columns = with_torque(scripted(offset=0.0))
    t = columns["t"]
    down = np.clip((t - 20.0) / 0.65, 0, 1) - np.clip((t - 23.0) / 0.4, 0, 1)
    columns["omega_fr"] = columns["omega_fr"] * (1 - down)
    columns["a_x"] = columns["a_x"] - np.where((t > 19.5) & (t < 24), 0.5, 0.0)  # the water holds the car back
    columns["brake_pressure"] = np.where((t > 21) & (t < 22), 2e6, 0.0)
    events = found(columns)
    spin = next(e for e in events if e.detector == "spin_down")
    assert spin.evidence["braking"]
    assert not spin.evidence["braking_at_start"]
    joint = [e for e in events if e.detector == "joint_criteria"]
    assert joint
    assert joint[0].severity == "full"


def test_frames_of_the_table_are_not_changed():
    signals = as_signals(scripted())
    before = signals.frame.clone()
    detect_drive(signals, CAR)
    assert before.equals(signals.frame, null_equal=True)
    assert isinstance(signals.frame, pl.DataFrame)
