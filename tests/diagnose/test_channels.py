"""Residual channels: what each effect shows in, and means over blocks."""

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.diagnose.channels import CHANNELS, block_means, block_step, channel_values, channels_of, contrasts
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.hypotheses import residual
from aqualog.model.term import Model
from aqualog.physics.load import G
from tests.diagnose.test_drive import CAR, plain, signals, term

ALL = frozenset(
    {"a_x", "a_y", "yaw_rate", "v_x", "steer_angle", *(f"omega_{w}" for w in WHEELS), *(f"torque_{w}" for w in WHEELS)}
)


def shown(*terms, under=(), **kw):
    """Mean residual of each channel away from the ends."""
    d = prepare(signals(*terms, **kw), CAR, "a")
    return dict(zip(d.channels, residual(d, Model(under))[:, 50:-50], strict=True))


def test_the_car_of_the_file_leaves_nothing():
    r = shown()
    for name, limit in (
        ("force_balance", 0.01),
        ("kinematic", 0.01),
        ("slip_fl", 0.01),
        ("slip_rr", 0.01),
        ("lateral", 1e-6),
        ("tie_rod_fl", 1.0),
    ):
        assert np.sqrt(np.mean(r[name] ** 2)) < limit, name


def test_a_grade_shows_in_the_kinematic_channel_alone():
    r = shown(term("road_grade", grade=0.03))
    assert r["kinematic"].mean() == pytest.approx(G * np.sin(0.03), rel=0.02)
    assert abs(r["force_balance"].mean()) < 0.003


def test_a_bias_of_the_accelerometer_shows_in_both():
    r = shown(term("accelerometer_bias", "a_x", bias=0.3))
    assert r["kinematic"].mean() == pytest.approx(0.3, abs=0.002)
    assert r["force_balance"].mean() == pytest.approx(0.3, abs=0.002)


def test_mass_shows_in_the_force_balance_not_in_the_kinematic_channel():
    r = shown(term("payload_mass", delta_mass=300.0))
    force, kinematic = (np.sqrt(np.mean(r[n] ** 2)) for n in ("force_balance", "kinematic"))
    assert force > 0.03
    # the driven wheels slip by more, and their acceleration is in the mean of the wheels: F m / C_s of half of them
    assert kinematic < 0.1 * force


def test_a_radius_shows_at_its_wheel():
    r = shown(term("tyre_radius", "fl", delta=-0.01))
    v = plain().array("v_x").mean()
    assert r["slip_fl"].mean() == pytest.approx(0.01 * v, rel=0.05)
    assert abs(r["slip_fr"].mean()) < 0.02 * r["slip_fl"].mean()
    assert abs(r["slip_rl"].mean()) < 0.02 * r["slip_fl"].mean()


def test_the_right_model_leaves_nothing():
    mass = term("payload_mass", delta_mass=300.0)
    assert np.sqrt(np.mean(shown(mass, under=(mass,))["force_balance"] ** 2)) < 0.01


def test_blocks_are_means_and_missing_where_any_sample_is():
    x = np.arange(35.0)
    x[12] = np.nan
    m = block_means(x, 0.01)
    assert m.size == 3
    np.testing.assert_allclose(m, [4.5, np.nan, 24.5])
    assert block_means(x, 0.1) is x
    assert block_means(x, 0.2) is x


def test_without_a_reference_wheels_are_compared_with_wheels():
    names = channels_of(ALL - {"v_x"}, CAR)
    assert {"axle_slip", "side_slip_f", "side_slip_r"} <= set(names)
    assert not any(n.startswith("slip_") for n in names)
    n = 50
    columns = {f"omega_{w}": np.full(n, 60.0) for w in WHEELS} | {"a_x": np.zeros(n), "yaw_rate": np.zeros(n)}
    columns["omega_rl"] = columns["omega_rr"] = np.full(n, 61.0)
    columns["omega_fl"] = np.full(n, 60.5)
    x = channel_values(columns, ("axle_slip", "side_slip_f", "side_slip_r"), CAR, dt=0.1)[:, 0]
    np.testing.assert_allclose(x, np.array([0.75, 0.5, 0.0]) * CAR.r_e_f, atol=1e-9)


@pytest.mark.parametrize(("without", "lost"), [
    ({"a_x"}, {"kinematic"}), ({"a_x", "v_x", "omega_fl"}, {"force_balance", "kinematic", "lateral", *(f"slip_{w}" for w in WHEELS)}),
    ({"torque_rl"}, {"force_balance"}), ({"steer_angle"}, {"lateral"}),
    ({"omega_fl"}, {f"slip_{w}" for w in WHEELS}),
])  # fmt: skip
def test_a_channel_needs_its_signals(without, lost):
    assert set(channels_of(ALL, CAR)) - set(channels_of(ALL - without, CAR)) == lost


def test_without_an_accelerometer_the_torque_is_judged_by_the_change_of_speed():
    t = np.arange(0.0, 10.0, 0.01)
    wheels = {f"omega_{w}": (20.0 + 0.5 * t) / CAR.r_e(w) for w in WHEELS}
    (x,) = channel_values(wheels, ("force_balance",), CAR, dt=0.01)
    np.testing.assert_allclose(x, 0.5, atol=1e-9)
    # what drew a simulated speed to the measured one is no force of the car
    (x,) = channel_values(wheels | {"nudge_seen": np.full(t.size, 0.2)}, ("force_balance",), CAR, dt=0.01)
    np.testing.assert_allclose(x, 0.3, atol=1e-9)


def test_tie_rods_need_the_torque():
    rods = {"tie_rod_fl", "tie_rod_fr"}
    assert rods <= set(channels_of(ALL | rods, CAR))
    assert not rods & set(channels_of((ALL | rods) - {"torque_rl"}, CAR))


def test_contrasts_are_invertible_and_take_the_shared_noise_out():
    names = tuple(c for c in CHANNELS if not c.startswith(("axle", "side")))
    C = contrasts(names)
    assert np.linalg.cond(C) < 20.0
    at = {n: i for i, n in enumerate(names)}
    accelerometer = np.zeros(len(names))
    accelerometer[[at["force_balance"], at["kinematic"]]] = 1.0
    assert np.flatnonzero(C @ accelerometer).tolist() == [at["force_balance"]]
    reference = np.zeros(len(names))
    reference[[at[f"slip_{w}"] for w in WHEELS]] = 1.0
    assert np.count_nonzero(C @ reference) == 1


def test_the_nudge_is_taken_out_of_the_kinematic_channel():
    n = 1000
    a = np.full(n, 0.2)
    speed = 20.0 + np.arange(n) * 0.01 * 0.5
    columns = {"a_x": a, "v_x": speed, "nudge_seen": np.full(n, 0.3)}
    np.testing.assert_allclose(channel_values(columns, ("kinematic",), CAR, dt=0.01)[0], 0.0, atol=1e-9)


@pytest.mark.parametrize("rate", [200, 100, 50, 25, 16, 12.5, 10, 5])
def test_an_acceleration_of_the_wheels_is_the_same_at_every_rate(rate):
    """Blocks are 0.1 s only where the rate allows it; the speed's change is over their own length."""
    dt = 1.0 / rate
    t = np.arange(round(20.0 * rate)) * dt
    columns = {"a_x": 0.0 * t, "v_x": 10.0 + 0.8 * t}
    (kinematic,) = channel_values(columns, ("kinematic",), CAR, dt=dt)
    np.testing.assert_allclose(kinematic[2:-2], -0.8, rtol=1e-9)
    assert kinematic.size * block_step(dt) == pytest.approx(20.0, abs=block_step(dt))
