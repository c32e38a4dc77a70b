"""Claims of the thesis that are identities: one test each, named by its number in the list of claims.

Each compares the package's function with numbers or with an integration of its own.
"""

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle
from aqualog.detect import ewvar, minor_spin_down, spin
from aqualog.features.stream import FeatureStream
from aqualog.model.excitation import axle_forces, f_step, waveform
from aqualog.model.half_car import HalfCar, HalfCarRun, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics.contact import friction_ratio, remaining_share, slip_stiffness_ratio
from aqualog.physics.resistance import nominal_acceleration
from aqualog.physics.slip import wheel_slip
from aqualog.physics.surface import series_slope
from aqualog.physics.tyre_brush import brush_force, brush_stiffness

DT = 0.01
L_OF_C8 = np.array([0.9, 0.8, np.sqrt(0.5), 0.6, 0.5])
CAR = Vehicle(name="test", given=frozenset({"mass"}))


def one(x):
    return np.array([float(x)])


def cells(low, high, n=400_000):
    """Middles and width of even cells, for integrals by the midpoint rule."""
    width = (high - low) / n
    return low + (np.arange(n) + 0.5) * width, width


# --- chapter 2, contact -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mu", [0.05, 0.3, 1.0])
def test_C2_slip_stiffness_is_a_pure_tyre_parameter(mu):
    """3.1: "the slip stiffness is a pure tire parameter": no friction enters."""
    s = np.array([-1e-8, 1e-8])
    F = brush_force(s, one(4000.0), mu=mu, C_s=120e3)
    assert (F[1] - F[0]) / (s[1] - s[0]) == pytest.approx(120e3, rel=1e-5)


@pytest.mark.parametrize(("L", "printed"), list(zip(L_OF_C8, [0.972, 0.896, 0.793, 0.648, 0.500], strict=True)))
def test_C7_residual_friction(L, printed):
    """2.1: F_x,max = (2a - b)(a + b)^2 F_z mu / (4 a^3), the friction of a parabolic pressure behind the edge b."""
    a = 0.07
    b = (2 * L - 1) * a
    assert remaining_share(one(b), one(a))[0] == pytest.approx(L)
    ratio = friction_ratio(remaining_share(one(b), one(a)))[0]
    assert ratio == pytest.approx(printed, abs=5e-4)
    x, dx = cells(-a, b)
    assert ratio == pytest.approx(np.sum(3 / (4 * a) * (1 - (x / a) ** 2)) * dx, rel=1e-8)


def test_C7_limits():
    """2.1: b = a gives mu F_z, b = -a nothing."""
    a = one(0.07)
    assert friction_ratio(remaining_share(a, a))[0] == 1.0
    assert friction_ratio(remaining_share(-a, a))[0] == 0.0


@pytest.mark.parametrize(("L", "printed"), list(zip(L_OF_C8, [0.81, 0.64, 0.50, 0.36, 0.25], strict=True)))
def test_C8_residual_slip_stiffness(L, printed):
    """2.2: "C_sx = 1/2 c_px (a+b)^2", what bristles give that have stuck since the edge b."""
    a, c_px = 0.07, 12e6
    b = (2 * L - 1) * a
    C = slip_stiffness_ratio(one(L))[0] * brush_stiffness(one(c_px), one(a))[0]
    assert slip_stiffness_ratio(one(L))[0] == pytest.approx(printed, abs=1e-9)
    x, dx = cells(-a, b)
    assert pytest.approx(np.sum(c_px * (b - x)) * dx, rel=1e-8) == C


def test_C11_slip_stiffness_is_the_early_indicator():
    """2: "slip stiffness can be useful as an early indicator [...], given its quadratic dependence"."""
    L = np.linspace(0.001, 0.999, 999)
    assert (slip_stiffness_ratio(L) < friction_ratio(L)).all()
    # at 90 % of the contact friction has lost 3 %, the slope 19 %
    lost = [1 - f(one(0.9))[0] for f in (friction_ratio, slip_stiffness_ratio)]
    assert lost == pytest.approx([0.028, 0.19], abs=1e-9)


# --- chapter 2, wheels ------------------------------------------------------------------------------------------------


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


def test_C30_moving_variance_is_the_weighted_variance():
    """2.5, 2.6 with alpha = beta: the exponentially weighted variance itself (E4)."""
    x = np.random.default_rng(3).normal(2.0, 3.0, 500)
    for alpha in (0.02, 0.1, 0.5):
        mean, var, _ = ewvar.scan(ewvar.EwvarParams(alpha, alpha), ewvar.initial_state(), x)
        weights = alpha * (1 - alpha) ** np.arange(x.size - 1, -1, -1.0)
        weights[0] /= alpha  # the first sample is the first mean
        assert weights.sum() == pytest.approx(1.0)
        centre = np.sum(weights * x)
        assert mean[-1] == pytest.approx(centre, rel=1e-12)
        assert var[-1] == pytest.approx(np.sum(weights * (x - centre) ** 2), rel=1e-12)


@pytest.mark.parametrize(("alpha", "beta", "factor"), [(0.05, 0.05, 0.97), (0.02, 0.1, 0.91), (0.1, 0.02, 1.03)])
def test_C30_unequal_weights_of_white_noise(alpha, beta, factor):
    """2.5, 2.6 with alpha and beta apart: (1 - beta) 2 / (2 - alpha) of the variance (E4)."""
    x = np.random.default_rng(4).normal(0.0, 2.0, 2_000_000)
    _, var, _ = ewvar.scan(ewvar.EwvarParams(alpha, beta), ewvar.initial_state(), x)
    assert var[1000:].mean() / 4.0 == pytest.approx(factor, abs=0.006)
    assert factor == pytest.approx((1 - beta) * 2 / (2 - alpha), abs=0.006)


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
    assert variance_difference(rear, front)[0] == pytest.approx(-delta, rel=1e-9)


def test_C31_roughness_that_both_axles_see_cancels():
    """2.8: "Absolute levels of the variance measures can vary [...] especially on different grounds"."""
    road = np.random.default_rng(6).normal(0, 5.0, 2000)
    delta, var = variance_difference(road, road)
    assert (delta == 0.0).all()
    assert var[-1] > 10.0


# --- chapter 2, resistance --------------------------------------------------------------------------------------------


def test_C34_resistance_measure_is_positive_for_more_resistance():
    """2.9: delta a_x = a_x,nom - a_x,meas,ESC."""
    dry = 0.5 * CAR.drag_area * CAR.air_density * 625.0 + CAR.rolling_resistance * CAR.mass * 9.80665
    wheel = dry * CAR.r_l("rl") / 2
    torque = {"torque_rl": np.full(300, wheel), "torque_rr": np.full(300, wheel)}
    assert drive(**torque)["delta_a_x"][1:] == pytest.approx(0.0, abs=1e-9)
    f = drive(**torque, a_x=np.full(300, -0.3))
    assert f["delta_a_x"][1:] == pytest.approx(0.3, abs=2e-3)


def test_C35_nominal_acceleration_by_hand():
    """2.10: a_nom = (sum(T_i / r_l,i - r_w,i F_z,i) - c_x v^2) / m with c_x = 1/2 c_w A rho."""
    torque = np.array([[10.0], [20.0], [300.0], [310.0]])
    F_z = np.array([[4100.0], [4200.0], [3900.0], [3800.0]])
    a = nominal_acceleration(
        torque, F_z, one(30.0), np.zeros((4, 1)), r_l=np.array([0.30, 0.30, 0.31, 0.31]), inertia=np.ones(4), mass=1600.0,
        r_w=0.01, drag_area=0.7, air_density=1.2,
    )[0]  # fmt: skip
    # 30/0.3 + 610/0.31 = 2067.742; 160 N of rolling; 378 N of drag
    assert a == pytest.approx((2067.7419 - 160.0 - 378.0) / 1600.0, rel=1e-7)


@pytest.mark.parametrize("a_x", [0.0, 1.0])
def test_C35_nothing_is_missing_on_a_dry_drive(a_x):
    """2.10 on the half-car of 3.3: the wheels' inertia apart (E5), the torques explain the acceleration."""
    car = HalfCar()
    r = simulate_half_car(car, HalfCarRun(5.0, a_x=a_x, nu=0.4, excitation=Excitation("sine", 250.0, "force", 8.0)))

    def halves(front, rear):
        return 0.5 * np.array([front, front, rear, rear])

    omega_dot = 2 * halves(np.gradient(r.omega_f, r.t), np.gradient(r.omega_r, r.t))
    kw = {
        "r_l": np.full(4, car.r_l_f), "inertia": np.full(4, car.inertia_f / 2), "mass": car.mass, "r_w": car.r_w,
        "drag_area": car.drag_area, "air_density": car.air_density,
    }  # fmt: skip
    torque, F_z = halves(r.torque_f, r.torque_r), halves(r.F_z_f, r.F_z_r)
    inside = slice(200, -1)
    a_nom = nominal_acceleration(torque, F_z, r.v_x, omega_dot, **kw)
    assert a_nom[inside] == pytest.approx(r.a_x[inside], abs=1e-5)
    printed = nominal_acceleration(torque, F_z, r.v_x, 0.0 * omega_dot, **kw)
    assert printed[inside] - r.a_x[inside] == pytest.approx(2 * 2.4 * a_x / 0.317 / 0.309 / 1650.0, abs=5e-4)


def test_C68_half_the_slope_leaves_four_fifths_of_the_friction():
    """2.5: "the actual slip slope decreases below half of the maximum historic value": L = 0.707, mu / mu_0 = 0.793."""
    L = np.linspace(0.0, 1.0, 1_000_001)
    at = L[np.argmin(np.abs(slip_stiffness_ratio(L) - 0.5))]
    assert at == pytest.approx(0.7071, abs=1e-4)
    assert friction_ratio(one(at))[0] == pytest.approx(0.793, abs=5e-4)


# --- chapter 3 --------------------------------------------------------------------------------------------------------


def test_C79_slip_stiffness_of_the_full_contact():
    """3.12: C_s = 2 c_px a^2, with a HALF the contact length (E1)."""
    a, c_px = 0.065, 14e6
    x, dx = cells(-a, a)
    assert brush_stiffness(one(c_px), one(a))[0] == pytest.approx(np.sum(c_px * (a - x)) * dx, rel=1e-8)
    assert brush_stiffness(one(10e6), one(0.06))[0] == pytest.approx(72e3)


def test_C80_slip_is_related_to_the_wheel_speed():
    """3.13: s = (omega r_e - v_x) / (omega r_e): driving positive, to minus infinity as the wheel stops (E7)."""
    s = wheel_slip(np.array([100.0, 100.0, 100.0, 10.0]), np.array([30.0, 29.7, 30.3, 30.0]), 0.3)
    assert s == pytest.approx([0.0, 0.01, -0.01, -9.0])
    assert np.isnan(wheel_slip(np.zeros(1), one(30.0), 0.3)[0])


@pytest.mark.parametrize("compliance", [1 / 60, 1 / 15, 1.0])
def test_C82_a_layer_acts_in_series_with_the_bristles(compliance):
    """3.1: "acts like an additional ground stiffness in series with the bristle stiffness"."""
    traction = 0.1
    slip_of_tyre, slip_of_layer = traction / 30.0, traction * compliance  # the same force through both
    assert series_slope(one(30.0), compliance=compliance)[0] == pytest.approx(traction / (slip_of_tyre + slip_of_layer))
    assert series_slope(one(30.0), compliance=compliance)[0] < min(30.0, 1 / compliance)


# --- chapter 3, excitation --------------------------------------------------------------------------------------------

TAU = 8.0
PERIOD = (np.arange(48_000) + 0.5) / 48_000 * TAU


@pytest.mark.parametrize("kind", ["triangle", "sine", "ramp"])
@pytest.mark.parametrize("a_x", [0.0, 1.0])
def test_C97_excitation_leaves_the_acceleration(kind, a_x):
    """3.26, 3.27: "while keeping their sum constant as required to maintain the currently requested velocity"."""
    F_f, F_r = axle_forces(one(1650.0), 250.0 * waveform(kind, PERIOD, period=TAU), nu=0.3)
    assert F_f + F_r == pytest.approx(1650.0)
    run = HalfCarRun(8.0, a_x=a_x, nu=0.3, excitation=Excitation(kind, 250.0, "force", TAU))
    r = simulate_half_car(HalfCar(), run)
    assert np.abs(r.a_x - a_x).max() < 0.01
    assert np.ptp(0.3 * r.F_x_f - 0.7 * r.F_x_r) == pytest.approx(500.0, abs=3.0)  # F_exc itself


def test_C100_triangle():
    """3.35: a triangle of the period tau; 0, 1, 0, -1 at the quarters (E16: floored modulo)."""
    t = np.array([0.0, 2.0, 4.0, 6.0, 8.0, 9.0])
    assert waveform("triangle", t, period=TAU) == pytest.approx([0, 1, 0, -1, 0, 0.5], abs=1e-12)
    assert np.sqrt(np.mean(waveform("triangle", PERIOD, period=TAU) ** 2)) == pytest.approx(0.577, abs=5e-4)


def test_C101_sine():
    """3.36: the same amplitude and period."""
    t = np.array([0.0, 2 / 3, 2.0, 4.0, 6.0, 8.0])
    assert waveform("sine", t, period=TAU) == pytest.approx([0, 0.5, 1, 0, -1, 0], abs=1e-12)
    assert np.sqrt(np.mean(waveform("sine", PERIOD, period=TAU) ** 2)) == pytest.approx(0.707, abs=5e-4)


def test_C102_ramps_and_plateaus():
    """3.37: "the ramp and constant value sections have a length of tau/6" (E17)."""
    f = waveform("ramp", PERIOD, period=TAU)
    first = np.flatnonzero(f == 1.0)
    assert PERIOD[first[0]] == pytest.approx(TAU / 6, abs=1e-3)
    assert PERIOD[first[-1]] == pytest.approx(TAU / 3, abs=1e-3)
    assert np.diff(first).max() == 1
    assert f[PERIOD < TAU / 6] == pytest.approx(PERIOD[PERIOD < TAU / 6] * 6 / TAU)
    assert np.sqrt(np.mean(f**2)) == pytest.approx(0.745, abs=5e-4)


def test_C103_step():
    """3.38: an alternating step; as printed it begins at -1, against the others (E18)."""
    t = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    assert f_step(t, period=TAU, printed_phase=True).tolist() == [-1, -1, 1, 1, -1]
    assert waveform("step", t, period=TAU).tolist() == [1, 1, -1, -1, 1]
    assert np.sqrt(np.mean(waveform("step", PERIOD, period=TAU) ** 2)) == pytest.approx(1.0)
