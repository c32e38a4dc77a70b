"""The half-car of thesis 3.3: its equations, its balance of energy, its integration."""

import time
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.errors import ConfigError
from aqualog.model.half_car import HalfCar, HalfCarRun, SurfaceChange, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics.tyre_brush import brush_force, brush_slip

CAR = HalfCar()
UNEVEN = HalfCar(
    l_f=1.2, l_r=1.6, r_e_f=0.32, r_e_r=0.31, r_l_f=0.31, r_l_r=0.305, inertia_f=2.0, inertia_r=3.0, slope_r=24.0
)
G = 9.80665
SINE = Excitation("sine", 250.0, "force", 8.0)
STRONG = HalfCarRun(4.0, a_x=1.0, nu=0.3, excitation=Excitation("sine", 800.0, "force", 2.0))


def exciting(waveform, amplitude=250.0, kind="force", period=8.0):
    return Excitation(waveform, amplitude, kind, period)


def test_constant_speed_by_hand():
    r = simulate_half_car(CAR, HalfCarRun(5.0, v0=30.0, nu=0.25))
    drag = 0.5 * 0.66 * 1.204 * 900.0
    assert r.v_x == pytest.approx(30.0, abs=1e-6)
    assert r.F_x_f[-1] + r.F_x_r[-1] == pytest.approx(drag, rel=1e-6)
    assert r.F_x_r[-1] == pytest.approx(0.25 * drag, rel=1e-6)
    # the torques carry the drag and the rolling resistance, at the loaded radius (E14)
    assert r.torque_f[-1] + r.torque_r[-1] == pytest.approx(0.309 * (drag + 0.0105 * 1650.0 * G), rel=1e-9)
    assert r.F_z_f[-1] == pytest.approx(1650.0 * G / 2, rel=1e-6)


@pytest.mark.parametrize("car", [CAR, UNEVEN])
@pytest.mark.parametrize("a_x", [-2.0, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("nu", [0.0, 0.4, 1.0])
def test_acceleration_loads_and_slip_of_steady_driving(car, a_x, nu):
    r = simulate_half_car(car, HalfCarRun(4.0, v0=20.0, a_x=a_x, nu=nu))
    wheelbase = car.l_f + car.l_r
    transfer = car.mass * car.h_cg / wheelbase * r.a_x
    F_sum = car.mass * a_x + 0.5 * 0.66 * 1.204 * r.v_x**2
    s_f = brush_slip((1 - nu) * F_sum / r.F_z_f, mu=car.mu, slope=car.slope_f)
    s_r = brush_slip(nu * F_sum / r.F_z_r, mu=car.mu, slope=car.slope_r)
    near = np.testing.assert_allclose  # of arrays a hundred times as fast as `approx`
    near(r.a_x, a_x, rtol=0.0, atol=4e-3)
    near(r.F_z_f, car.mass * G * car.l_r / wheelbase - transfer, rtol=1e-6)
    near(r.F_z_r, car.mass * G * car.l_f / wheelbase + transfer, rtol=1e-6)
    near(r.F_x_f, (1 - nu) * F_sum, rtol=0.0, atol=6.0)
    near(r.F_x_r, nu * F_sum, rtol=0.0, atol=6.0)
    near(r.s_f, s_f, rtol=0.0, atol=6e-5)
    near(r.s_r, s_r, rtol=0.0, atol=6e-5)


@pytest.mark.parametrize(("nu", "free", "driven"), [(0.0, "r", "f"), (1.0, "f", "r")])
def test_one_driven_axle(nu, free, driven):
    """E19: nu = 0 is front drive. The free axle rolls without slip, so that the differential slip is the slip."""
    r = simulate_half_car(CAR, HalfCarRun(4.0, a_x=1.0, nu=nu))
    assert np.abs(getattr(r, f"s_{free}")).max() < 1e-5
    assert getattr(r, f"s_{driven}").min() > 0.005
    front, rear = r.omega_f * 0.317, r.omega_r * 0.317
    differential = (front - rear) / front if driven == "f" else (rear - front) / rear
    assert differential == pytest.approx(getattr(r, f"s_{driven}"), abs=1e-5)


@pytest.mark.parametrize("waveform", ["triangle", "sine", "ramp"])
@pytest.mark.parametrize("a_x", [0.0, 1.0])
@pytest.mark.parametrize("car", [CAR, UNEVEN])
def test_acceleration_is_held_under_excitation(waveform, a_x, car):
    """C97."""
    r = simulate_half_car(car, HalfCarRun(16.0, a_x=a_x, nu=0.3, excitation=exciting(waveform)))
    assert np.abs(r.a_x - a_x).max() < 0.005
    assert np.ptp(r.F_x_f - r.F_x_r) > 990.0  # while the axles do change their forces


def test_acceleration_is_held_by_steps_but_for_the_wheels_inertia():
    r = simulate_half_car(CAR, HalfCarRun(16.0, a_x=1.0, nu=0.3, excitation=exciting("step")))
    since = np.minimum(np.mod(r.t, 4.0), 4.0 - np.mod(r.t, 4.0))
    assert np.abs(r.a_x - 1.0)[since > 0.02].max() < 0.005
    assert np.abs(r.a_x - 1.0).max() < 0.03
    assert np.abs(r.v_x - 30.0 - r.t).max() < 0.01


def test_forces_follow_the_excitation():
    r = simulate_half_car(CAR, HalfCarRun(8.0, a_x=1.0, nu=0.3, excitation=SINE))
    F_sum = 1650.0 + 0.5 * 0.66 * 1.204 * (30.0 + r.t) ** 2
    F_exc = 250.0 * np.sin(2 * np.pi * r.t / 8.0)
    assert r.F_x_f == pytest.approx(0.7 * F_sum + F_exc, abs=2.0)
    assert r.F_x_r == pytest.approx(0.3 * F_sum - F_exc, abs=2.0)


def test_mu_amplitude_is_a_traction_coefficient():
    r = simulate_half_car(CAR, HalfCarRun(8.0, excitation=exciting("sine", 0.03, "mu")))
    assert np.ptp(r.mu_f) / 2 == pytest.approx(0.03, rel=1e-3)
    assert np.ptp(r.mu_r) / 2 == pytest.approx(0.03, rel=1e-3)
    assert r.F_x_f.min() < 0.0  # C111


@pytest.mark.parametrize("a_x", [0.0, 1.0])
def test_relative_amplitude_keeps_axle_forces_positive(a_x):
    """C110."""
    r = simulate_half_car(CAR, HalfCarRun(16.0, a_x=a_x, nu=0.3, excitation=exciting("triangle", 1.0, "relative")))
    assert min(r.F_x_f.min(), r.F_x_r.min()) > -1.0
    assert r.F_x_r.min() < 1.0


def test_slope_30_to_10_makes_three_times_the_slip():
    """C98: at the same traction. The brush is linear at first only: 1 % here."""
    r = simulate_half_car(CAR, HalfCarRun(8.0, nu=0.3, surface=(SurfaceChange(5.0, 10.0, 10.0, 1.0),)))
    before, after = np.searchsorted(r.t, [4.99, 6.0])
    assert r.mu_f[after] == pytest.approx(r.mu_f[before], rel=1e-4)
    assert r.s_f[after] / r.s_f[before] == pytest.approx(3.0, rel=0.01)
    assert r.s_r[after] / r.s_r[before] == pytest.approx(3.0, rel=0.01)
    assert r.slope[5000] == 10.0
    assert r.slope[4999] == 30.0


def test_the_change_is_at_its_time():
    change = SurfaceChange(5.0, 10.0, 12.0, 0.4)
    changed = simulate_half_car(CAR, HalfCarRun(8.0, nu=0.3, surface=(change,)))
    unchanged = simulate_half_car(CAR, HalfCarRun(8.0, nu=0.3))
    assert changed.t[5000] == pytest.approx(5.0)
    assert np.array_equal(changed.omega_f[:5001], unchanged.omega_f[:5001])
    assert changed.omega_f[5001] > unchanged.omega_f[5001]
    assert changed.F_x_f[5000] == pytest.approx(unchanged.F_x_f[5000] / 3, rel=0.02)
    assert (changed.slope_r[5000], changed.mu_max[5000]) == (12.0, 0.4)


def test_several_changes_in_any_order():
    back = SurfaceChange(4.0, 30.0, 30.0, 1.0)
    low = SurfaceChange(2.0, 10.0, 10.0, 0.4)
    r = simulate_half_car(CAR, HalfCarRun(6.0, nu=0.3, surface=(back, low)))
    assert [r.slope[i] for i in (1999, 2000, 3999, 4000)] == [30.0, 10.0, 10.0, 30.0]
    assert r.s_f[5900] == pytest.approx(r.s_f[1900], rel=1e-3)


def test_acceleration_is_held_on_low_friction():
    run = HalfCarRun(8.0, a_x=1.0, nu=0.3, excitation=SINE, surface=(SurfaceChange(5.0, 10.0, 10.0, 0.4),))
    r = simulate_half_car(CAR, run)
    assert np.abs(r.a_x - 1.0)[r.t > 5.2].max() < 0.005
    assert r.s_f[-1] > 0.015


def test_torque_beyond_friction_spins_the_wheel_up():
    r = simulate_half_car(CAR, HalfCarRun(3.0, a_x=2.0, nu=0.0, surface=(SurfaceChange(1.0, 10.0, 10.0, 0.2),)))
    assert r.mu_f[-1] == pytest.approx(0.2, abs=1e-9)
    assert r.omega_f[-1] > 3 * r.omega_r[-1]
    assert r.a_x[-1] < 1.0
    assert np.abs(r.s_r[-1]) < 5e-3


def test_a_run_that_asks_too_much_from_the_start():
    r = simulate_half_car(CAR._replace(mu=0.1), HalfCarRun(0.5, a_x=3.0, nu=0.0))
    assert r.s_f[0] == pytest.approx(3 * 0.1 / 30)
    assert r.mu_f == pytest.approx(0.1)


@pytest.mark.parametrize("car", [CAR, UNEVEN])
def test_loop_of_acceleration_and_load_is_closed(car):
    """E15: force, load and acceleration of one sample fit each other to rounding, also during a change of surface."""
    r = simulate_half_car(car, replace(STRONG, surface=(SurfaceChange(2.0, 10.0, 8.0, 0.4),)))
    for F_x, F_z, s, slope in ((r.F_x_f, r.F_z_f, r.s_f, r.slope_f), (r.F_x_r, r.F_z_r, r.s_r, r.slope_r)):
        assert F_x == pytest.approx(brush_force(s, F_z, mu=r.mu_max, C_s=slope * F_z), abs=1e-9)
    drag = 0.5 * 0.66 * 1.204 * r.v_x**2
    assert r.F_x_f + r.F_x_r - drag == pytest.approx(car.mass * r.a_x, abs=1e-8)
    static = car.mass * G * car.l_r / (car.l_f + car.l_r)
    assert static - r.F_z_f == pytest.approx(car.mass * car.h_cg / (car.l_f + car.l_r) * r.a_x, abs=1e-8)
    assert r.mu_f == pytest.approx(r.F_x_f / r.F_z_f)


@pytest.mark.parametrize("car", [CAR, UNEVEN])
def test_residual_of_the_wheel_equations(car):
    """3.28 to 3.30 against central differences of the states."""
    dt = 2.5e-4
    r = simulate_half_car(car, replace(STRONG, dt=dt))

    def rate(x):
        return (x[2:] - x[:-2]) / (2 * dt)

    assert rate(r.v_x) == pytest.approx(r.a_x[1:-1], abs=5e-6)
    for omega, torque, F_x, F_z, r_l, inertia in (
        (r.omega_f, r.torque_f, r.F_x_f, r.F_z_f, car.r_l_f, car.inertia_f),
        (r.omega_r, r.torque_r, r.F_x_r, r.F_z_r, car.r_l_r, car.inertia_r),
    ):
        residual = inertia * rate(omega) - (torque - r_l * F_x - 0.0105 * r_l * F_z)[1:-1]
        assert np.abs(residual)[20:].max() < 2e-3  # N m, of some 400


def energy_terms(car, r):
    """Work over a run [J]: of the drive, into motion, drag, rolling and slip, and through the difference of the radii."""

    def over_time(power):
        return np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(r.t))

    drag = 0.5 * car.drag_area * car.air_density * r.v_x**2
    kinetic = 0.5 * (car.mass * r.v_x**2 + car.inertia_f * r.omega_f**2 + car.inertia_r * r.omega_r**2)
    axles = (
        (r.torque_f, r.omega_f, r.F_x_f, r.F_z_f, car.r_e_f, car.r_l_f),
        (r.torque_r, r.omega_r, r.F_x_r, r.F_z_r, car.r_e_r, car.r_l_r),
    )
    return {
        "drive": sum(over_time(M * w) for M, w, *_ in axles),
        "motion": kinetic[-1] - kinetic[0],
        "drag": over_time(drag * r.v_x),
        "rolling": sum(over_time(car.r_w * r_l * F_z * w) for _, w, _, F_z, _, r_l in axles),
        "slip": sum(over_time(F * (r_e * w - r.v_x)) for _, w, F, _, r_e, _ in axles),
        "radii": sum(over_time(F * (r_e - r_l) * w) for _, w, F, _, r_e, r_l in axles),
    }


@pytest.mark.parametrize("car", [CAR, UNEVEN, CAR._replace(r_l_f=0.317, r_l_r=0.317)])
@pytest.mark.parametrize("surface", [(), (SurfaceChange(2.0, 10.0, 10.0, 0.4),)])
def test_power_balance(car, surface):
    """M w = dT/dt + drag v + r_w r_l F_z w + F (r_e w - v) - F (r_e - r_l) w, from the equations of motion.

    The last term is none of a real tyre: torque acts on the arm r_l while the wheel rolls on r_e (as printed).
    """
    r = simulate_half_car(car, replace(STRONG, surface=surface))
    w = energy_terms(car, r)
    residual = w["drive"] + w["radii"] - w["motion"] - w["drag"] - w["rolling"] - w["slip"]
    # the trapezoid cannot follow the few ms after a change of surface
    assert abs(residual) < (1e-5 if surface else 1e-7) * w["drive"]
    assert w["slip"] > 0.001 * w["drive"]
    if car.r_l_f == car.r_e_f:
        assert w["radii"] == 0.0


@pytest.mark.parametrize("v0", [30.0, 12.0])
def test_second_order(v0):
    """Half the step, a quarter of the error, once the step resolves the wheels (1 ms at 30 m/s)."""
    run = replace(STRONG, v0=v0)
    fine = simulate_half_car(CAR, replace(run, dt=1.25e-5 * 2))
    for name in ("v_x", "omega_f", "omega_r", "s_f", "F_x_r"):
        error = []
        for dt in (8e-4, 4e-4, 2e-4):
            r = simulate_half_car(CAR, replace(run, dt=dt))
            error.append(np.abs(getattr(r, name) - getattr(fine, name)[:: round(dt / 2.5e-5)]).max())
        assert error[0] / error[1] == pytest.approx(4.0, abs=0.5), name
        assert error[1] / error[2] == pytest.approx(4.0, abs=0.4), name


@pytest.mark.parametrize("v0", [0.3, 0.6, 1.0, 2.0, 3.0, 4.0, 6.0, 10.0, 30.0])
@pytest.mark.parametrize("dt", [2e-3, 1e-2, 5e-2])
@pytest.mark.parametrize("slope", [30.0, 60.0])
def test_stable_at_low_speed_and_big_steps(v0, dt, slope):
    """A kick by a change of the surface dies out; with the wheels' diagonal alone as Jacobian it grows at 10 ms."""
    car = CAR._replace(slope_f=slope, slope_r=slope)
    kick = SurfaceChange(1.0, 0.7 * slope, 0.7 * slope, 1.0)
    r = simulate_half_car(car, HalfCarRun(4.0, dt=dt, v0=v0, a_x=0.1, nu=0.3, surface=(kick,)))
    assert np.abs(r.a_x - 0.1)[r.t > 3.0].max() < 1e-3
    assert r.s_f[-1] == pytest.approx(brush_slip(r.F_x_f[-1] / r.F_z_f[-1], mu=1.0, slope=0.7 * slope), rel=1e-6)


def test_step_size_hardly_matters_across_jumps():
    run = HalfCarRun(8.0, a_x=1.0, nu=0.3, excitation=exciting("step"), surface=(SurfaceChange(5.0, 10.0, 10.0, 0.4),))
    fine = simulate_half_car(CAR, replace(run, dt=1e-4))
    for dt in (1e-3, 1e-2):
        r = simulate_half_car(CAR, replace(run, dt=dt))
        every = round(dt / 1e-4)
        assert np.abs(r.v_x - fine.v_x[::every]).max() < 0.02
        calm = (np.mod(r.t, 4.0) > 0.2) & (np.abs(r.t - 5.1) > 0.1)
        assert np.abs(r.s_f - fine.s_f[::every])[calm].max() < 1e-4


def test_braking_to_a_stop():
    r = simulate_half_car(CAR, HalfCarRun(4.9, v0=10.0, a_x=-2.0, nu=0.4))
    assert np.abs(r.a_x + 2.0).max() < 0.01
    assert r.v_x[-1] == pytest.approx(0.2, abs=0.01)
    assert (r.s_f < 0).all()


def test_grid_of_the_result():
    r = simulate_half_car(CAR, HalfCarRun(2.0, dt=0.01))
    assert r.t.size == 201
    assert r.t[-1] == pytest.approx(2.0)
    for name in r.__dataclass_fields__:
        assert getattr(r, name).shape == (201,)
        assert np.isfinite(getattr(r, name)).all()


def test_whole_numbers_are_the_same_car():
    r = simulate_half_car(CAR._replace(mass=1650, mu=1), HalfCarRun(1, v0=30, a_x=1))
    assert np.array_equal(r.v_x, simulate_half_car(CAR, HalfCarRun(1.0, a_x=1.0)).v_x)


@pytest.mark.parametrize(
    "run", [HalfCarRun(2.0, dt=0.0), HalfCarRun(0.0), HalfCarRun(2.0, v0=0.0), HalfCarRun(20.0, v0=10.0, a_x=-1.0)]
)
def test_runs_that_cannot_be(run):
    with pytest.raises(ConfigError):
        simulate_half_car(CAR, run)


def test_fast():
    run = HalfCarRun(8.0, excitation=SINE)
    simulate_half_car(CAR, run)
    spent = []
    for _ in range(10):
        begin = time.perf_counter()
        simulate_half_car(CAR, run)
        spent.append(time.perf_counter() - begin)
    assert min(spent) < 0.03
