"""Simulated tie rods: a polynomial when dry, more than it when a wheel loses the road (thesis 2.4, C59-C63)."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.model.drawing import slalom_angle
from aqualog.model.programme import SEDAN, SUV, SUV_REAR
from aqualog.model.scenario import Lane, Scenario, Steering
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import simulate
from aqualog.model.tyre import TYRES

WORN = TYRES["worn_summer"]
SIDES = (("fl", 1.0), ("fr", -1.0))


def drive(car, **kw):
    return simulate(Scenario(car, **{"sensors": IDEAL, **kw})).truth.columns


def terms(c, wheel, outward):
    y, x = outward * c[f"true_force_y_{wheel}"], c[f"true_force_x_{wheel}"]
    return np.column_stack([np.ones_like(y), y, y * y, x])


def slalom(car, v):
    """20 s at 2 m/s^2 with a period of 4 s, getting slowly faster."""
    steering = Steering(slalom_angle(car, WORN, v, 2.0), 4.0)
    return drive(car, duration_s=20.0, speed=((0.0, v), (10.0, v), (20.0, 1.08 * v)), steering=steering)


def fitted(c):
    A = np.vstack([terms(c, w, s) for w, s in SIDES])
    rods = np.concatenate([c[f"tie_rod_{w}"] for w, _ in SIDES])
    k, *_ = np.linalg.lstsq(A, rods, rcond=None)
    return k, 1.0 - np.var(rods - A @ k) / np.var(rods)


@pytest.mark.parametrize("car", [SEDAN, SUV, SUV_REAR], ids=lambda c: c.name)
@pytest.mark.parametrize("v", [20.0, 30.0])
def test_dry_rods_are_a_polynomial_in_the_forces(car, v):
    c = slalom(car, v)
    assert 1.8 < np.abs(c["a_y"]).max() < 2.6
    assert np.ptp(c["tie_rod_fl"]) > 400.0
    _, explained = fitted(c)
    assert explained >= 0.99


def test_a_wheel_that_loses_the_road_shows_in_its_own_rod():
    """Water under the right wheels at 112 km/h: spin-downs of the front one raise its rod, the other stays."""
    k, _ = fitted(slalom(SUV_REAR, 30.0))
    lane = Lane(4.0, 9.0, depth_left=0.0, depth_right=1.3e-3)
    c = drive(SUV_REAR, duration_s=10.0, speed=((0.0, 112 / 3.6),), lanes=(lane,), seed=3)
    excess = {}
    for w, s in SIDES:
        known = terms(c, w, s)
        known[:, 3] = known[3000, 3]  # the force of a wheel that rolls freely on a dry road
        excess[w] = c[f"tie_rod_{w}"] - known @ k
    on_water = c["true_film_fr"] > 0.0
    down = (c["true_slip_fr"] < -0.1) & on_water
    rolling = (np.abs(c["true_slip_fr"]) < 0.02) & on_water
    assert down.sum() > 20
    assert np.abs(np.median(excess["fr"][:3000])) < 10.0
    assert np.median(excess["fr"][down]) > 150.0  # the contact comes and goes within 0.02 s
    assert 50.0 < np.median(excess["fr"][rolling]) < np.median(excess["fr"][down])
    assert np.abs(excess["fl"][on_water]).max() < 50.0


def test_a_spin_up_leaves_the_force_that_the_torque_promises():
    """Compared with what the torque would do on a dry road, the rod lacks the traction that the spinning wheel lost."""
    k, _ = fitted(slalom(SUV, 30.0))
    fwd = replace(SUV, name="front", torque_split_rear=0.02)
    lane = Lane(4.0, 8.0, depth_left=1.3e-3, depth_right=1.3e-3)
    c = drive(fwd, duration_s=9.0, speed=((0.0, 29.0), (4.0, 31.0), (8.0, 39.0)), lanes=(lane,), seed=3)
    for w, s in SIDES:
        up = (c[f"true_slip_{w}"] > 0.15) & (c[f"true_film_{w}"] > 0.0)
        assert up.any()
        promised = terms(c, w, s)
        promised[:, 3] = c[f"torque_{w}"] / SUV.r_e_f
        assert np.median((c[f"tie_rod_{w}"] - promised @ k)[up]) > 250.0


def test_a_polynomial_of_the_vehicle_file_is_the_dry_rod():
    car = replace(SEDAN, tie_rod={"c0": (20.0,), "c_y": (0.11,), "c_x": (0.06,)})
    c = slalom(car, 25.0)
    expected = 20.0 + 0.11 * c["true_force_y_fl"] + 0.06 * c["true_force_x_fl"]
    np.testing.assert_allclose(c["tie_rod_fl"], expected, atol=1e-9)


def test_steering_torque_holds_into_the_curve():
    c = slalom(SEDAN, 25.0)
    assert np.corrcoef(c["steering_torque"], c["a_y"])[0, 1] > 0.95
    assert 2.0 < np.abs(c["steering_torque"]).max() < 10.0
