"""Tie-rod forces against their model: residual, alarm, what is asked of log and vehicle file, steering torque."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.records import Quality, Signals
from aqualog.detect import tie_rod
from aqualog.detect.registry import check_needs
from aqualog.detect.stream import Settings, detect_drive
from aqualog.detect.thresholds import Thresholds
from aqualog.physics.load import wheel_loads
from aqualog.report.drive.document import result_groups
from tests.drives import CAR

DT, N = 0.01, 2000
POLYNOMIAL = {"c0": (20.0,), "c_y": (0.11, 1e-6), "c_x": (0.06,), "sigma": (40.0,)}
WITH_RODS = replace(CAR, tie_rod=POLYNOMIAL)


def slalom(excess=0.0, wheel="fr", at=slice(1000, 1020), a_y_max=2.0, brake=0.0, vehicle=CAR, steering=False):
    """A dry slalom at 90 km/h whose rods carry what the polynomial says, and `excess` [N] on one of them."""
    t = np.arange(N) * DT
    v = 25.0
    a_y = a_y_max * np.sin(2 * np.pi * t / 4.0)
    yaw_rate = a_y / v
    psi_ddot = np.gradient(yaw_rate, DT)
    F_z = wheel_loads(np.zeros(N), a_y, mass=vehicle.mass, l_f=vehicle.l_f, l_r=vehicle.l_r, h_cg=vehicle.h_cg,
                      track=vehicle.track)  # fmt: skip
    axle = (vehicle.mass * vehicle.l_r * a_y + vehicle.mass * vehicle.l_f * vehicle.l_r * psi_ddot) / vehicle.wheelbase
    columns = {"t": t, "v_x": np.full(N, v), "a_x": np.zeros(N), "a_y": a_y, "yaw_rate": yaw_rate}
    for i, w in enumerate(WHEELS):
        y = 0.5 * vehicle.track * (1 if w.endswith("l") else -1)
        columns[f"omega_{w}"] = (v - yaw_rate * y) / vehicle.r_e(w)
        columns[f"torque_{w}"] = np.full(N, 100.0 if w[0] == "r" else 0.0) - brake
        if w[0] == "f" and not steering:
            share = axle * F_z[i] / (F_z[0] + F_z[1]) * (1.0 if w == "fl" else -1.0)
            force = 20.0 + 0.11 * share + 1e-6 * share**2
            force[at] += excess if w == wheel else 0.0
            columns[f"tie_rod_{w}"] = force
    if steering:
        columns["steering_torque"] = 0.3 + 1e-3 * axle
        columns["steering_torque"][at] += excess
    return Signals(pl.DataFrame(columns), round(DT * 1e9), None, {}, Quality(), ("slalom",))


def found(signals, vehicle=WITH_RODS, **settings):
    result = detect_drive(signals, vehicle, settings=Settings(**settings))
    return [e for e in result.events if e.detector == "tie_rod"], result


def test_a_dry_slalom_matches_its_model():
    events, result = found(slalom())
    assert events == []
    f = result.features
    for w in ("fl", "fr"):
        residual = (f[f"tie_rod_meas_{w}"] - f[f"tie_rod_hat_{w}"]).to_numpy()[300:]
        assert np.abs(residual).max() < 40.0  # of +-600 N; the rest is the lag of the yaw acceleration


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_short_spin_down_shows_on_its_own_rod(sign):
    """200 ms of 700 N, pressed or pulled: an event on that wheel alone, within 0.15 s (C61)."""
    events, _ = found(slalom(sign * 700.0))
    assert [(e.wheel, e.side) for e in events] == [("fr", "right")]
    (event,) = events
    assert 10.0 < event.start_s < 10.15
    key = "force_residual_max" if sign > 0 else "force_residual_min"
    assert 450.0 < sign * event.evidence[key] < 750.0
    assert event.evidence["from_steering_torque"] is False


def test_small_forces_of_early_partial_aquaplaning_do_not_alarm():
    """C60: slight changes are no reliable sign."""
    assert found(slalom(120.0, at=slice(1000, 1400)))[0] == []


def test_a_kerb_of_one_sample_does_not_alarm():
    assert found(slalom(4000.0, at=slice(1000, 1001)))[0] == []


def test_beyond_the_range_of_the_polynomial_nothing_is_said():
    assert found(slalom(2500.0, a_y_max=7.0, at=slice(1080, 1120)))[0] == []
    assert found(slalom(700.0, brake=900.0))[0] == []


def test_the_threshold_is_the_users():
    assert found(slalom(700.0), thresholds=Thresholds(tie_rod=5.0))[0] == []


def test_the_steering_torque_stands_in_and_says_so():
    vehicle = replace(CAR, steering_torque={"c0": (0.3,), "c_y": (1e-3,), "sigma": (0.3,)})
    assert found(slalom(steering=True), vehicle)[0] == []
    (event,) = found(slalom(6.0, steering=True), vehicle)[0]
    assert event.wheel is None
    assert event.side is None
    assert event.evidence["from_steering_torque"] is True
    assert 4.0 < event.evidence["torque_residual_max"] < 7.0


def needed(vehicle, symbols):
    unavailable, limited = check_needs(vehicle, symbols, rate_hz=100.0)
    lacks = {u.detector: u.missing for u in unavailable}
    return lacks.get("tie_rod"), {u.detector: u.missing for u in limited}.get("tie_rod")


def test_what_is_missing_is_named():
    motion = {"a_y", "yaw_rate", *(f"omega_{w}" for w in WHEELS)}
    assert needed(WITH_RODS, motion) == (("tie_rod_fl", "tie_rod_fr"), None)
    assert needed(CAR, motion | {"tie_rod_fl", "tie_rod_fr"}) == (("vehicle.tie_rod (aqualog calibrate)",), None)
    assert needed(CAR, motion | {"steering_torque"}) == (("vehicle.steering_torque (aqualog calibrate)",), None)
    assert needed(WITH_RODS, {"tie_rod_fl", "a_y"}) == (("yaw_rate",), None)
    assert needed(WITH_RODS, motion | {"tie_rod_fl"}) == (None, ("tie_rod_fr",))
    fwd = replace(WITH_RODS, drivetrain="fwd")
    assert needed(fwd, motion | {"tie_rod_fl", "tie_rod_fr"}) == (("torque_fl", "torque_fr"), None)


def test_scaled_residual_by_hand():
    ones = np.ones(5)
    z = tie_rod.scaled_residual(
        np.array([100.0, -300.0, 1e5, 300.0, np.nan]), np.array([0.0, 200.0, 0.0, 0.0, 0.0]),
        np.array([20.0, 20.0, 20.0, 5.0, 20.0]), 0.0 * ones, np.zeros(5, dtype=bool), sigma=50.0,
    )  # fmt: skip
    assert z[:4] == pytest.approx([2.0, 500.0 / 70.0, tie_rod.CLIP, 0.0])
    assert np.isnan(z[4])


def test_statistics_and_signals_have_names_of_their_own():
    """A written log is read again: the sum of the detector must not be taken for the force."""
    _, result = found(slalom(700.0))
    names = [n for g in result_groups(result) for n in g.columns]
    assert len(set(names)) == len(names)
    assert {"tie_rod_fl", "tie_rod_cusum_fl", "tie_rod_cusum_fl_bit"} <= set(names)
