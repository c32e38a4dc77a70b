"""Claims of the thesis that are identities: one test each, named by its number in the list of claims.

Each compares the package's function with numbers or with an integration of its own.
"""

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle
from aqualog.detect import minor_spin_down, spin
from aqualog.features.stream import FeatureStream
from aqualog.model.half_car import HalfCar, HalfCarRun, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics.resistance import nominal_acceleration

DT = 0.01
CAR = Vehicle(name="test", given=frozenset({"drivetrain", "mass"}))


def one(x):
    return np.array([float(x)])


def drive(n=300, v=25.0, **changed):
    """A steady drive of the default car on which single signals are replaced."""
    columns = {
        "v_x": np.full(n, v),
        "a_x": np.zeros(n),
        "a_y": np.zeros(n),
        "yaw_rate": np.zeros(n),
        "steer_angle": np.zeros(n),
    }
    for w in WHEELS:
        columns[f"omega_{w}"] = np.full(n, v / CAR.r_e(w))
        columns[f"torque_{w}"] = np.zeros(n)
    columns |= changed
    return FeatureStream(CAR, DT, columns).push(columns)


def test_C24_acceleration_difference():
    """2.3: a_w_delta = omega_dot r_e - a_x."""
    n = 300
    omega = 25.0 / 0.317 - 50.0 * np.clip(np.arange(n) * DT - 2.0, 0.0, 0.5)
    f = drive(n, omega_fr=omega)
    assert f["a_w_delta_fr"][245] == pytest.approx(-50.0 * 0.317, rel=0.01)
    assert f["a_w_delta_fr"][190] == pytest.approx(0.0, abs=1e-6)
    assert f["a_w_delta_rr"][245] == pytest.approx(0.0, abs=0.05)


def test_C24_a_car_that_accelerates_shows_none():
    """2.3: the difference to the vehicle's acceleration, so that driving itself does not count."""
    n = 400
    t = np.arange(n) * DT
    v = 20.0 + 1.5 * t
    f = drive(n, v_x=v, a_x=np.full(n, 1.5), **{f"omega_{w}": v / 0.317 for w in WHEELS})
    assert np.abs(f["a_w_delta_fl"][300:]).max() < 0.05


def test_C25_speed_difference():
    """2.4: v_w_delta = omega r_e - v_x."""
    f = drive(omega_rl=np.full(300, 27.0 / 0.317))
    assert f["v_w_delta_rl"][:5] == pytest.approx(2.0, abs=0.05)
    f = drive(omega_rl=np.full(300, 23.0 / 0.317))
    assert f["v_w_delta_rl"][:5] == pytest.approx(-2.0, abs=0.05)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_C25_its_sign_tells_a_spin_down_from_the_end_of_a_spin_up(sign):
    """2.4: "the sign of the wheel and vehicle speed difference is used additionally for the distinction"."""
    n = 200
    p = spin.SpinParams.make(sign, DT)

    def found(a, dv):
        _, active, _ = spin.scan(p, spin.initial_state(), sign * a, sign * dv, np.full(n, 25.0), np.ones(n, dtype=bool))
        return active.any()

    fast = np.where((np.arange(n) > 20) & (np.arange(n) < 40), 20.0, 0.0)
    gentle = np.where((np.arange(n) >= 40) & (np.arange(n) < 120), 2.0, 0.0)
    assert found(fast, np.cumsum(fast) * DT)
    # the same acceleration leads back to the vehicle's speed
    assert not found(fast, np.cumsum(fast) * DT - 4.0)
    # and gently beyond it: what has been summed up belongs to the other event
    assert found(fast + gentle, np.cumsum(fast + gentle) * DT)
    assert not found(fast + gentle, np.cumsum(fast + gentle) * DT - 4.2)
    # nothing to speak of in speed
    assert not found(fast, np.full(n, 0.1))


def variance_difference(front, rear):
    n = front.size
    delta, var, _, _ = minor_spin_down.scan(
        minor_spin_down.MinorParams.make(DT), minor_spin_down.initial_state(), front, rear, np.zeros(n),
        np.full(n, 25.0), np.ones(n, dtype=bool),
    )  # fmt: skip
    return delta, var


def test_C31_difference_of_front_and_rear_variance():
    """2.8: delta sigma^2_j = sigma^2_Fj - sigma^2_Rj."""
    rng = np.random.default_rng(5)
    front, rear = rng.normal(0, 3.0, 400_000), rng.normal(0, 1.0, 400_000)
    delta, var = variance_difference(front, rear)
    assert delta[500:].mean() == pytest.approx(9.0 - 1.0, rel=0.03)
    assert var[500:].mean() == pytest.approx(9.0, rel=0.03)
    np.testing.assert_allclose(variance_difference(rear, front)[0], -delta, rtol=1e-9)


def test_C31_roughness_that_both_axles_see_cancels():
    """2.8: "Absolute levels of the variance measures can vary [...] especially on different grounds"."""
    road = np.random.default_rng(6).normal(0, 5.0, 2000)
    delta, var = variance_difference(road, road)
    assert (delta == 0.0).all()
    assert var[-1] > 10.0


@pytest.mark.parametrize("a_x", [0.0, 1.0])
def test_C35_nothing_is_missing_on_a_dry_drive(a_x):
    """2.10 on the half-car of 3.3: the wheels' inertia apart (E5), the torques explain the acceleration."""
    car = HalfCar()
    r = simulate_half_car(car, HalfCarRun(5.0, a_x=a_x, nu=0.4, excitation=Excitation("sine", 250.0, "force", 8.0)))

    def halves(front, rear):
        return 0.5 * np.array([front, front, rear, rear])

    omega_dot = 2 * halves(np.gradient(r.omega_f, r.t), np.gradient(r.omega_r, r.t))
    kw = {
        "arm": np.full(4, car.r_l_f), "inertia": np.full(4, car.inertia_f / 2), "mass": car.mass, "r_w": car.r_w,
        "drag_area": car.drag_area, "air_density": car.air_density,
    }  # fmt: skip
    torque, F_z = halves(r.torque_f, r.torque_r), halves(r.F_z_f, r.F_z_r)
    inside = slice(200, -1)
    a_nom = nominal_acceleration(torque, F_z, r.v_x, omega_dot, **kw)
    assert a_nom[inside] == pytest.approx(r.a_x[inside], abs=1e-5)
    printed = nominal_acceleration(torque, F_z, r.v_x, 0.0 * omega_dot, **kw)
    assert printed[inside] - r.a_x[inside] == pytest.approx(2 * 2.4 * a_x / 0.317 / 0.309 / 1650.0, abs=5e-4)
