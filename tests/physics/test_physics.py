import numpy as np
import pytest

from aqualog.physics.contact import friction_ratio, slip_stiffness_ratio
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.resistance import air_drag, nominal_acceleration
from aqualog.physics.slip import slip_of_wheel_speed, wheel_slip
from aqualog.physics.traction import residual_traction, traction_coefficient

CAR = {"mass": 1600.0, "l_f": 1.2, "l_r": 1.6, "h_cg": 0.55, "track": 1.5}


def test_slip_signs_and_limits():
    v = np.array([20.0, 20.0, 20.0, 0.2])
    v_w = np.array([20.0, 21.0, 0.0, 0.1])
    s = slip_of_wheel_speed(v_w, v)
    assert s[:3] == pytest.approx([0.0, 0.05, -1.0])
    assert np.isnan(s[3])


def test_thesis_slip_agrees_for_small_slip():
    omega, r_e, v = np.array([100.0]), 0.3, np.array([29.9])
    assert wheel_slip(omega, v, r_e)[0] == pytest.approx(0.1 / 30.0)
    assert wheel_slip(omega, v, r_e)[0] == pytest.approx(slip_of_wheel_speed(omega * r_e, v)[0], rel=0.01)
    assert np.isnan(wheel_slip(np.zeros(1), v, r_e)[0])


def test_wheel_loads():
    zero = np.zeros(1)
    static = wheel_loads(zero, zero, **CAR)[:, 0]
    assert static.sum() == pytest.approx(1600 * G)
    assert static[0] == static[1] > static[2]  # centre of mass nearer to the front axle
    braking = wheel_loads(np.array([-5.0]), zero, **CAR)[:, 0]
    assert braking[0] > static[0]
    assert braking[2] < static[2]
    assert braking[:2].sum() - static[:2].sum() == pytest.approx(1600 * 5.0 * 0.55 / 2.8)
    left_turn = wheel_loads(zero, np.array([4.0]), **CAR)[:, 0]
    assert left_turn[1] > static[1] > left_turn[0]
    assert left_turn.sum() == pytest.approx(1600 * G)
    assert (wheel_loads(zero, np.array([40.0]), **CAR) >= 0).all()


def _nominal(torque, omega_dot, v=20.0):
    loads = wheel_loads(np.zeros(1), np.zeros(1), **CAR)
    return nominal_acceleration(
        np.array(torque)[:, None], loads, np.array([v]), np.array(omega_dot)[:, None], arm=np.full(4, 0.3),
        inertia=np.full(4, 1.2), mass=1600.0, r_w=0.01, drag_area=0.7, air_density=1.2,
    )[0]  # fmt: skip


def test_nominal_acceleration_by_hand():
    expected = (600.0 / 0.3 - 0.01 * 1600 * G - 0.5 * 0.7 * 1.2 * 400.0) / 1600.0
    assert _nominal([0, 0, 300, 300], [0, 0, 0, 0]) == pytest.approx(expected)
    assert _nominal([0, 0, -300, -300], [0, 0, 0, 0], v=-20.0) == pytest.approx(-expected)  # in reverse


def test_inertia_takes_its_torque():
    """E5: a wheel that spins up by 100 rad/s^2 must not look like traction."""
    difference = _nominal([0, 0, 0, 120], [0, 0, 0, 0]) - _nominal([0, 0, 0, 120], [0, 0, 0, 100.0])
    assert difference == pytest.approx(1.2 * 100.0 / 0.3 / 1600.0)


def test_air_drag_is_odd():
    assert air_drag(np.array([10.0]), drag_area=0.6, air_density=1.2)[0] == pytest.approx(36.0)
    assert air_drag(np.array([-10.0]), drag_area=0.6, air_density=1.2)[0] == pytest.approx(-36.0)


def test_traction_coefficient():
    kw = {"arm": 0.3, "inertia": 1.2, "r_w": 0.01}
    F_z, zero = np.array([4000.0]), np.zeros(1)
    assert traction_coefficient(zero, F_z, zero, **kw)[0] == pytest.approx(-0.01)
    assert traction_coefficient(np.array([120.0]), F_z, zero, **kw)[0] == pytest.approx(0.1 - 0.01)
    # torque that only spins the wheel is no traction
    assert traction_coefficient(np.array([120.0]), F_z, np.array([100.0]), **kw)[0] == pytest.approx(-0.01)
    assert np.isnan(traction_coefficient(zero, np.array([50.0]), zero, **kw)[0])


def test_residual_traction():
    """A wheel that only works against water has no traction left; what snow or an offset makes changes nothing."""
    F_z, mu = np.array([4000.0]), np.array([0.2])
    missing = 0.2 + 0.2 * 4000.0 / 1600.0
    assert residual_traction(mu, np.array([missing]), F_z, mass=1600.0)[0] == pytest.approx(0.0)
    assert residual_traction(mu, np.zeros(1), F_z, mass=1600.0)[0] == 0.2
    assert residual_traction(mu, np.array([0.2]), F_z, mass=1600.0)[0] == 0.2
    assert residual_traction(mu, np.array([-0.5]), F_z, mass=1600.0)[0] == 0.2


def test_contact_ratios_of_the_thesis():
    """C8: the pairs that the audit derives from 2.1 and 2.2."""
    L = np.array([1.0, 0.9, 0.8, np.sqrt(0.5), 0.6, 0.5, 0.0])
    assert slip_stiffness_ratio(L) == pytest.approx([1.0, 0.81, 0.64, 0.5, 0.36, 0.25, 0.0])
    assert friction_ratio(L) == pytest.approx([1.0, 0.972, 0.896, 0.793, 0.648, 0.5, 0.0], abs=5e-4)
