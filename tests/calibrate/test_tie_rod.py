"""The polynomial from wheel forces to tie rods."""

import numpy as np
import pytest

from aqualog.calibrate.design import prepare
from aqualog.calibrate.tie_rod import fit_tie_rod, transfers
from aqualog.core.errors import FitError
from aqualog.core.vehicle import Vehicle
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.simulate import simulate
from aqualog.physics.steering import tie_rod_force

DT = 0.01
TRUE = {"c0": (40.0,), "c_y": (-0.31, 8e-6), "c_x": (0.07,)}


def forces(seconds=60.0, amplitude=2000.0, seed=0):
    t = np.arange(0.0, seconds, DT)
    rng = np.random.default_rng(seed)
    F_y = amplitude * np.sin(2 * np.pi * t / 4.0) * (1.0 + 0.2 * np.sin(2 * np.pi * t / 31.0))
    F_x = 300.0 * np.sin(2 * np.pi * t / 13.0)
    F_y, F_x = np.array([F_y, -0.9 * F_y]), np.array([F_x, F_x])
    return F_y, F_x, tie_rod_force(F_x, F_y, **TRUE) + rng.normal(0.0, 10.0, F_y.shape)


def test_known_polynomial_is_found_within_its_interval():
    F_y, F_x, rods = forces()
    fit = fit_tie_rod(F_y, F_x, rods, dt=DT)
    for name, values in TRUE.items():
        for value, estimate, (low, high) in zip(values, fit.coefficients[name], fit.ci95[name], strict=True):
            assert estimate == pytest.approx(value, rel=0.05)
            assert low < estimate < high
    assert fit.explained > 0.999
    assert fit.sigma == pytest.approx(10.0, rel=0.05)


def test_intervals_cover():
    inside = []
    for seed in range(60):
        fit = fit_tie_rod(*forces(seed=seed), dt=DT)
        inside += [low < TRUE[n][i] < high for n in TRUE for i, (low, high) in enumerate(fit.ci95[n])]
    assert 0.88 < np.mean(inside) < 0.995


def test_no_longitudinal_force_leaves_its_share_open():
    F_y, F_x, _ = forces()
    fit = fit_tie_rod(F_y, 0.0 * F_x, tie_rod_force(0.0 * F_x, F_y, **TRUE), dt=DT)
    assert fit.coefficients["c_x"] == (0.0,)
    assert np.isinf(fit.ci95["c_x"][0]).all()


def test_wet_samples_do_not_count():
    F_y, F_x, rods = forces()
    dry = np.arange(rods.shape[1]) < 4000
    rods[:, ~dry] += 800.0
    assert fit_tie_rod(F_y, F_x, rods, dt=DT, used=dry).coefficients["c0"][0] == pytest.approx(40.0, abs=2.0)
    assert abs(fit_tie_rod(F_y, F_x, rods, dt=DT).coefficients["c0"][0] - 40.0) > 100.0


def test_refused_without_steering_or_time():
    F_y, F_x, rods = forces(amplitude=100.0)
    with pytest.raises(FitError, match="slalom"):
        fit_tie_rod(F_y, F_x, rods, dt=DT)
    with pytest.raises(FitError, match="20 s"):
        fit_tie_rod(*forces(seconds=10.0), dt=DT)


def test_braking_is_left_out_of_a_drive():
    """Brakes pull at the rods on another lever than the drive: one coefficient for both would be neither."""
    car = Vehicle(name="fwd", drivetrain="fwd", torque_split_rear=0.0, given=frozenset({"drivetrain", "mass"}))
    found = {}
    for braked in (False, True):
        brakes = tuple((t, m) for k in range(4) for t, m in ((15 + 20 * k, 0), (15.3 + 20 * k, 2000), (17 + 20 * k, 0)))
        scenario = Scenario(
            car, duration_s=90.0, seed=7, speed=tuple((float(t), 20.0 + 4.0 * (t // 8 % 2)) for t in range(0, 91, 8)),
            steering=Steering(0.015, 4.0), brake_torque=brakes if braked else (),
        )  # fmt: skip
        drive = prepare(as_signals(simulate(scenario)), car, "slalom")
        found[braked] = transfers([drive], car)[0]["tie_rod"]
    assert found[True].coefficients["c_x"][0] == pytest.approx(found[False].coefficients["c_x"][0], rel=0.05)
    assert found[True].explained > 0.95
    assert found[True].sigma < 1.3 * found[False].sigma
