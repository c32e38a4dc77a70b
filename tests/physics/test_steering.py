"""Moments about the kingpin: limits by hand, and against an integral over bristles."""

import numpy as np
import pytest

from aqualog.physics.steering import STEERING, aligning_moment, kingpin_moment, steering_torque
from aqualog.physics.tyre_brush import brush_forces

A, F_Z, MU, C = 0.07, 4000.0, 1.0, 80_000.0


def of_bristles(s_x, s_y, L, n=200_000):
    """Lateral force and its moment about the middle of the patch, bristle by bristle (equal stiffnesses)."""
    x = np.linspace(A * (2 * L - 1), -A, n)  # from the front edge backwards
    pressure = MU * 0.75 * F_Z / A * (1 - (x / A) ** 2)
    slip = np.hypot(s_x, s_y)
    bent = C / (2 * A * A) * slip * (x[0] - x)
    slides = np.maximum.accumulate(bent > pressure)
    q = np.where(slides, pressure, bent) * s_y / slip
    dx = x[0] - x[1]
    return np.sum(q) * dx, np.sum(q * x) * dx


@pytest.mark.parametrize("L", [1.0, 0.7, 0.35])
@pytest.mark.parametrize(("s_x", "s_y"), [(0.0, 0.004), (0.0, 0.05), (-0.03, 0.03), (0.05, -0.2)])
def test_aligning_moment_is_that_of_the_bristles(L, s_x, s_y):
    force, moment = of_bristles(s_x, s_y, L)
    _, F_y = brush_forces(np.array(s_x), np.array(s_y), F_Z, mu=MU, C_x=C, C_y=C, L=L)
    M_z = aligning_moment(np.array(s_x), np.array(s_y), F_Z, mu=MU, C_x=C, C_y=C, L=L, a=A)
    assert F_y == pytest.approx(force, rel=2e-3)
    assert M_z == pytest.approx(moment, rel=5e-3, abs=0.05)


def test_limits_of_the_trail():
    def trail(s_y, L):
        _, F_y = brush_forces(np.zeros(1), np.array([s_y]), F_Z, mu=MU, C_x=C, C_y=C, L=L)
        M_z = aligning_moment(np.zeros(1), np.array([s_y]), F_Z, mu=MU, C_x=C, C_y=C, L=L, a=A)
        return float(-M_z[0] / F_y[0])

    assert trail(1e-5, 1.0) == pytest.approx(A / 3, rel=1e-3)
    assert trail(1e-5, 0.3) == pytest.approx(A * (1 - 0.2), rel=1e-2)
    assert trail(0.5, 1.0) == pytest.approx(0.0, abs=1e-9)
    none = aligning_moment(np.zeros(1), np.array([0.1]), F_Z, mu=MU, C_x=C, C_y=C, L=0.0, a=A)
    assert none[0] == pytest.approx(0.0, abs=1e-6)


def moment(F_x=0.0, F_y=0.0, F_z=0.0, M_z=0.0, brake=0.0):
    x = [np.array([v]) for v in (F_x, F_y, F_z, M_z, brake)]
    return float(kingpin_moment(*x, r_l=0.31)[0])


def test_signs_about_the_kingpin():
    sine = np.sin(STEERING.inclination)
    assert moment(F_x=-1000.0) == pytest.approx(1000.0 * STEERING.hub_offset)  # what holds the wheel back turns it out
    assert moment(F_y=1000.0) == pytest.approx(-1000.0 * STEERING.caster_trail)
    # a braked wheel has the scrub radius for a lever
    scrub = STEERING.hub_offset - 0.31 * sine
    assert moment(F_x=-1000.0, brake=310.0) == pytest.approx(1000.0 * scrub)


def test_a_load_turns_the_wheel_by_the_kingpin_s_lean():
    """The axis times the moment of the forces about the point where it meets the road, small angles."""
    axis = np.array([-np.sin(STEERING.caster), -np.sin(STEERING.inclination), 1.0])  # forward, outward, up
    contact = [-STEERING.caster_trail, STEERING.hub_offset - 0.31 * np.sin(STEERING.inclination), 0.0]
    for F_y, F_z in ((0.0, 4000.0), (500.0, 4000.0)):
        assert moment(F_y=F_y, F_z=F_z) == pytest.approx(axis @ np.cross(contact, [0.0, F_y, F_z]))


def test_steering_is_held_into_the_curve():
    left_turn = steering_torque(np.array([-250.0]), np.array([400.0]))
    assert left_turn[0] == pytest.approx(650.0 * STEERING.ratio)
    assert steering_torque(np.array([400.0]), np.array([400.0]))[0] == 0.0
