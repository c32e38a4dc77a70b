"""The four-wheel simulation: balances, limits, symmetry, convergence, speed."""

import time
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.tolerances import TOLERANCES
from aqualog.model import kernel, state
from aqualog.model.effects import EFFECTS
from aqualog.model.plant import build_plant, flat
from aqualog.model.scenario import SURFACES, Excitation, Lane, Scenario, Steering
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth, run_kernel, simulate
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES
from aqualog.model.wheel import water_at
from aqualog.physics.load import G, wheel_loads
from tests.thesis.passes import SEDAN, resistance, slip_and_traction

FWD = Vehicle(name="fwd", drivetrain="fwd", torque_split_rear=0.0, given=frozenset({"drivetrain", "mass"}))
AWD = Vehicle(name="awd", drivetrain="awd", torque_split_rear=0.6, given=frozenset({"drivetrain", "mass"}))
CARS = {"rwd": SEDAN, "fwd": FWD, "awd": AWD}
DIFFERENTIAL = [e for e in TOLERANCES if e.name in ("preload", "locking")]
RAMP = ((0.0, 60 / 3.6), (20.0, 130 / 3.6))


def scenario(vehicle=SEDAN, **kw):
    return Scenario(vehicle, **{"sensors": IDEAL, **kw})


def truth(sc, model=None, dt=1e-3):
    t = drive_truth(assemble(sc, model or Model()), dt=dt)
    return t.t, dict(t.columns)


def raw(sc, dt=1e-3, every=1):
    setup = assemble(sc)
    return run_kernel(setup, dt=dt, every=every), setup.plant


def col(rows, name, wheel=None):
    return rows[:, state.COLUMNS[name] + (wheel or 0)]


def lane(start=6.0, end=14.0, h=1.3e-3, **kw):
    return Lane(start, end, depth_left=h, depth_right=h, **kw)


@pytest.mark.parametrize("car", CARS)
@pytest.mark.parametrize("speed", [((0.0, 27.0),), RAMP, ((0.0, 20.0), (5.0, 30.0), (10.0, 30.0), (16.0, 18.0))])
def test_dry_resistance_measure_is_zero(car, speed):
    """Torque in, speed out, as the features book it: nothing is left on a dry road."""
    t, c = truth(scenario(CARS[car], speed=speed))
    delta = resistance(t, c, scenario(CARS[car]))
    assert np.abs(delta[5:-5]).max() < 0.01


@pytest.mark.parametrize("car", CARS)
def test_radii_3_percent_apart_are_no_resistance(car):
    """E24: the torque of a wheel that rolls on r_e acts with r_e. (2.10) as printed books T / r_l."""
    hard = ((0.0, 20.0), (2.0, 20.0), (8.0, 20.0 + 6.0 * 2.35))
    apart = replace(CARS[car], r_l_f=0.97 * CARS[car].r_e_f, r_l_r=0.97 * CARS[car].r_e_r)
    t, c = truth(scenario(apart, speed=hard, duration_s=8.0))
    steady = (t > 4.0) & (t < 7.5)
    assert c["a_x"][steady].mean() == pytest.approx(2.38, abs=0.04)
    assert np.abs(resistance(t, c, scenario(apart))[steady]).max() < 0.005
    printed = replace(apart, torque_arm="loaded")
    assert resistance(t, c, scenario(printed))[steady].mean() == pytest.approx((1 / 0.97 - 1) * 2.6, abs=0.01)


@pytest.mark.parametrize("car", CARS)
def test_what_the_driveline_takes_is_no_resistance(car):
    heavy = replace(CARS[car], driveline_inertia=4.0)
    t, c = truth(scenario(heavy, speed=RAMP))
    assert np.abs(resistance(t, c, scenario(heavy))[5:-5]).max() < 0.01
    assert np.abs(resistance(t, c, scenario(CARS[car]))[(t > 5.0) & (t < 15.0)].mean()) > 0.015


def test_a_driveline_slows_both_wheels_of_an_axle_down_and_one_alone_by_half():
    """By hand: both by I + J / 2; one alone by I + J / 4 less what the other, which turns back, gives."""
    f = np.zeros(state.N_STATES)
    wheels = np.zeros(4, dtype=[("inertia", float), ("driveline", float)])
    wheels["inertia"], wheels["driveline"] = 1.2, [0.0, 0.0, 4.0, 4.0]
    f[state.OMEGA : state.OMEGA + 4] = 10.0
    kernel._turn_driveline(f, wheels)
    assert f[state.OMEGA : state.OMEGA + 4] == pytest.approx([10.0, 10.0, 10.0 * 1.2 / 3.2, 10.0 * 1.2 / 3.2])
    f[state.OMEGA + 2 : state.OMEGA + 4] = 10.0, 0.0
    kernel._turn_driveline(f, wheels)
    one, other = f[state.OMEGA + 2], f[state.OMEGA + 3]
    assert other < 0.0 < one
    assert 1.2 * one + (one + other) == pytest.approx(12.0)  # torque on the left wheel: itself and a quarter of J
    assert 1.2 * other + (one + other) == pytest.approx(0.0, abs=1e-12)


def test_the_friction_of_a_differential_moves_torque_to_the_inner_wheel_of_its_axle():
    """By hand: 20 N·m and 5 % of the wheel's torque, from the wheel that turns faster to the other one."""
    curve = scenario(FWD, speed=((0.0, 15.0),), duration_s=12.0, steering=Steering(0.04, 2.0, 2.0, "hold"))
    preload, locking = (Term(e, {"by": by}, "f") for e, by in zip(DIFFERENTIAL, (20.0, 0.05), strict=True))
    (_, open_), (_, stiff) = (truth(curve, m) for m in (Model(), Model((preload, locking))))
    at = -500  # of 1 ms: a circle to the left
    assert stiff["omega_fr"][at] > stiff["omega_fl"][at] + 0.5
    half = 0.5 * (stiff["torque_fl"][at] + stiff["torque_fr"][at])
    moved = (20.0 + 0.05 * half) * np.tanh((stiff["omega_fr"][at] - stiff["omega_fl"][at]) / 0.5)
    assert stiff["torque_fl"][at] - half == pytest.approx(moved, rel=0.05)
    assert stiff["torque_fr"][at] - half == pytest.approx(-moved, rel=0.05)
    assert (stiff["torque_rl"][at], stiff["torque_rr"][at]) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert open_["torque_fl"][at] == pytest.approx(open_["torque_fr"][at])


def test_dry_resistance_measure_does_not_see_a_grade():
    t, c = truth(scenario(grade=((0.0, 0.0), (100.0, 0.04), (300.0, -0.03))))
    assert np.abs(resistance(t, c, scenario())[5:-5]).max() < 0.01
    assert np.abs(c["true_grade"]).max() > 0.03


@pytest.mark.parametrize("car", CARS)
def test_slip_slope_by_regression_is_the_parameter(car):
    vehicle = CARS[car]
    t = np.arange(0.0, 20.0, 0.05)
    # small traction, driving and braking: the brush's own curvature, mu / (3 mu_max), stays below 1 %
    torque = tuple((float(x), float(60.0 * np.sin(2 * np.pi * x / 4.0))) for x in t)
    sc = scenario(vehicle, speed=((0.0, 8.0),), extra_torque=torque)
    t, c = truth(sc)
    for w in vehicle.driven:
        s, mu = slip_and_traction(t, c, w, sc)
        use = (t > 2.0) & (np.abs(mu) < 0.03)
        assert use.sum() > 3000
        A = np.column_stack([mu[use], mu[use] * np.abs(mu[use]), np.ones(use.sum())])
        slope = 1.0 / np.linalg.lstsq(A, s[use], rcond=None)[0][0]
        expected = vehicle.slip_slope_f if w[0] == "f" else vehicle.slip_slope_r
        assert slope == pytest.approx(expected, rel=0.01)
        straight = 1.0 / np.linalg.lstsq(A[:, [0, 2]], s[use], rcond=None)[0][0]
        assert straight == pytest.approx(expected, rel=0.01)


def energy_terms(rows, p, dt):
    """Power of every sink and source at each step, and the energy stored."""
    names = (
        "omega",
        "tread_omega",
        "twist",
        "F_x",
        "F_y",
        "v_along",
        "torque",
        "resisting_torque",
        "wave_drag",
        "climb",
    )
    columns = (np.array([col(rows, n, i) for i in range(4)]) for n in names)
    omega, tread, twist, F_x, F_y, v, torque, resisting, wave, climb = columns
    inertia, belt, stiff, damping = (
        x[:, None] for x in (p.inertia, p.belt_inertia, p.torsion_stiffness, p.torsion_damping)
    )
    across = -np.tan(np.array([col(rows, "slip_angle", i) for i in range(4)])) * v
    stored = 0.5 * p.mass * (col(rows, "v_x") ** 2 + col(rows, "v_y") ** 2) + 0.5 * (inertia * omega**2).sum(0)
    stored += 0.5 * (belt * tread**2 + stiff * twist**2).sum(0)
    stored += 0.5 * p.I_zz * col(rows, "yaw_rate") ** 2
    stored += (
        p.mass * G * np.concatenate([[0.0], np.cumsum(np.sin(col(rows, "grade"))[1:] * np.diff(col(rows, "position")))])
    )
    into = (torque * omega).sum(0)
    out = (resisting * tread).sum(0) + col(rows, "drag") * col(rows, "v_x") + ((wave + climb) * v).sum(0)
    out += (damping * (omega - tread) ** 2).sum(0)
    sliding = (F_x * (p.r_e[:, None] * tread - v) - F_y * across).sum(0)
    return stored, into, out, sliding


def imbalance(sc, dt):
    """Energy that the balance misses over the energy that the engine gave, and the least power lost in sliding."""
    rows, p = raw(sc, dt)
    stored, into, out, sliding = energy_terms(rows, p, dt)
    missing = np.trapezoid(into - out - sliding, dx=dt) - (stored[-1] - stored[0])
    friction = [
        col(rows, "F_x", i) * (p.r_e[i] * col(rows, "tread_omega", i) - col(rows, "v_along", i)) for i in range(4)
    ]
    return abs(missing) / np.trapezoid(np.abs(into), dx=dt), np.min(friction)


@pytest.mark.parametrize("car", CARS)
def test_power_balance_over_a_run(car):
    """What the engine gives is stored, or lost in air, rolling, water and sliding: exactly, as the step goes to zero."""
    speed = ((0.0, 22.0), (4.0, 27.0), (9.0, 33.0))
    dry, friction = imbalance(scenario(CARS[car], speed=speed, duration_s=10.0), 1e-3)
    assert dry < 1e-7
    assert friction > -1e-6  # sliding never gives energy
    wet = scenario(CARS[car], speed=speed, duration_s=10.0, lanes=(lane(3.0, 7.0),))
    coarse, friction = imbalance(wet, 1e-3)
    fine, _ = imbalance(wet, 2.5e-4)
    assert friction > -1e-6
    assert fine < 1e-6
    assert fine < 0.2 * coarse or coarse < 1e-7


@pytest.mark.parametrize("car", CARS)
def test_mirrored_drive_is_the_mirror_image(car):
    """Left and right swapped: the same numbers on the other wheel, lateral signs turned, to rounding."""
    base = scenario(CARS[car], speed=((0.0, 25.0),), steering=Steering(0.012, 4.0), water_scatter=0.0, duration_s=12.0)
    a = replace(
        base,
        lanes=(Lane(4.0, 9.0, depth_left=1.0e-3, depth_right=1.6e-3, irregularity_left=0.0, irregularity_right=0.0),),
    )
    b = replace(
        base, steering=Steering(-0.012, 4.0),
        lanes=(Lane(4.0, 9.0, depth_left=1.6e-3, depth_right=1.0e-3, irregularity_left=0.0, irregularity_right=0.0),),
    )  # fmt: skip
    _, x = truth(a)
    _, y = truth(b)
    swap = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}
    assert np.abs(x["a_y"]).max() > 1.0
    for w in WHEELS:
        for name in ("omega_{}", "true_contact_{}", "true_load_{}", "true_force_x_{}"):
            np.testing.assert_allclose(x[name.format(w)], y[name.format(swap[w])], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(x[f"true_force_y_{w}"], -y[f"true_force_y_{swap[w]}"], rtol=1e-6, atol=1e-4)
    for name in ("a_y", "yaw_rate", "steer_angle", "true_v_y"):
        np.testing.assert_allclose(x[name], -y[name], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(x["tie_rod_fl"], y["tie_rod_fr"], rtol=1e-6, atol=1e-4)


def errors_of_steps(sc, steps, finest, names):
    reference, _ = raw(sc, finest, round(0.02 / finest))
    out = []
    for dt in steps:
        rows, _ = raw(sc, dt, round(0.02 / dt))
        out.append(max(float(np.abs(col(rows, n, i) - col(reference, n, i)).max()) for n, i in names))
    return np.array(out)


def test_step_halving_shows_second_order():
    t = np.arange(0.0, 6.0, 0.01)
    torque = tuple((float(x), float(300.0 * np.sin(2 * np.pi * x))) for x in t)
    sc = scenario(AWD, speed=((0.0, 25.0),), extra_torque=torque, duration_s=5.0, steering=Steering(0.01, 3.0, 0.0))
    e = errors_of_steps(sc, (2e-3, 1e-3, 5e-4), 1.25e-4, [("omega", i) for i in range(4)] + [("v_x", 0)])
    assert np.all(e[:-1] / e[1:] > 3.0)
    assert e[1] < 2e-3  # rad/s at 80 rad/s


def test_step_halving_on_water():
    """Spin-downs to a stop and up again: what 1 ms gives is what 0.25 ms gives, beyond the speed that decides which."""
    sc = scenario(speed=((0.0, 114 / 3.6),), lanes=(lane(2.0, 6.0),), duration_s=8.0, seed=3)
    a, _ = raw(sc, 1e-3, 10)
    b, _ = raw(sc, 2.5e-4, 40)
    for i in range(4):
        difference = np.abs(col(a, "omega", i) - col(b, "omega", i))
        assert np.sqrt(np.mean(difference**2)) < 0.5  # rad/s of 100
    assert col(a, "omega", 1).min() < 50.0
    assert np.abs(col(a, "v_x") - col(b, "v_x")).max() < 0.02


@pytest.mark.parametrize("dt", [1e-3, 2e-3, 4e-3])
def test_stable_at_low_speed_where_the_wheels_are_stiffest(dt):
    sc = scenario(speed=((0.0, 15.0), (8.0, 0.6), (20.0, 0.6)), duration_s=20.0)
    rows, _ = raw(sc, dt, 1)
    tail = rows[-round(4.0 / dt) :]
    assert np.abs(col(tail, "omega", 2) * SEDAN.r_e("rl") - col(tail, "v_x")).max() < 0.05
    assert np.abs(np.diff(col(tail, "a_x"))).max() < 0.05


def test_a_free_wheel_without_contact_stops_and_recovers():
    sc = scenario(speed=((0.0, 145 / 3.6),), lanes=(lane(3.0, 6.0, h=2e-3),), water_scatter=0.0, duration_s=10.0)
    t, c = truth(sc)
    wet = (t > 3.1) & (t < 6.0)
    assert c["true_contact_fl"][wet].max() < 0.05
    stopped = t[c["omega_fl"] < 2.0]
    assert 3.0 < stopped[0] < 4.0
    assert c["omega_fl"].min() > -0.5
    after = t > 7.0
    np.testing.assert_allclose(c["omega_fl"][after] * SEDAN.r_e("fl"), c["v_x"][after], rtol=5e-3)


def test_driven_wheels_spin_up_with_torque_beyond_what_the_contact_holds():
    def peak(a):
        sc = scenario(speed=((0.0, 26.0), (2.0, 26.0), (8.0, 26.0 + 6 * a)), lanes=(lane(3.0, 7.0),), duration_s=8.0)
        t, c = truth(sc)
        return (c["omega_rr"] * SEDAN.r_e("rr") / c["v_x"] - 1.0)[t > 3.0].max()

    assert peak(0.0) < 0.02
    assert peak(3.5) > 0.2


def test_water_costs_nothing_when_there_is_none():
    _, dry = truth(scenario(speed=((0.0, 27.0),)))
    _, none = truth(scenario(speed=((0.0, 27.0),), lanes=(lane(h=0.0),)))
    np.testing.assert_array_equal(dry["omega_fl"], none["omega_fl"])


def test_rear_wheels_run_in_the_tracks_of_the_front_wheels():
    sc = scenario(
        speed=((0.0, 20.0),),
        lanes=(lane(2.0, 4.0, h=1.3e-3, irregularity_left=0.0),),
        water_scatter=0.0,
        duration_s=6.0,
    )
    t, c = truth(sc)
    assert c["true_film_fl"].max() == pytest.approx(1.3e-3, rel=0.3)
    h_track, rear = TYRES["worn_summer"].h_track, c["true_film_rl"]
    assert rear[rear > 0.0] == pytest.approx(h_track * (1.0 - np.exp(-1.3e-3 / h_track)), rel=1e-3)
    front, rear = t[c["true_film_fl"] > 0][0], t[c["true_film_rl"] > 0][0]
    assert rear - front == pytest.approx(SEDAN.wheelbase / 20.0, abs=0.01)


def test_the_film_in_a_track_has_its_own_roughness():
    even = lane(2.0, 14.0, irregularity_left=0.0, irregularity_right=0.0)
    _, c = truth(scenario(speed=((0.0, 20.0),), lanes=(even,), duration_s=14.0))
    left, right = (c[f"true_film_r{s}"][4000:] for s in "lr")
    assert left.std() / left.mean() == pytest.approx(TYRES["worn_summer"].track_irregularity, rel=0.3)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.4


def test_lane_in_metres_starts_where_it_says():
    sc = scenario(
        speed=((0.0, 20.0),),
        lanes=(Lane(100.0, 140.0, in_metres=True, depth_left=1e-3, depth_right=1e-3),),
        duration_s=9.0,
    )
    _, c = truth(sc)
    inside = c["true_film_fl"] > 0
    assert c["true_position"][inside][0] == pytest.approx(100.0, abs=0.1)
    assert c["true_position"][inside][-1] == pytest.approx(140.0, abs=0.1)
    assert c["on_water"][inside].all()


def test_anchor_of_the_full_aquaplaning_speed():
    tyre = TYRES["worn_summer"]
    assert tyre.full_speed(1.3e-3, 4000.0, p=1.9e5) == pytest.approx(tyre.v_anchor)


@pytest.mark.parametrize("name", ["snow", "ice", "wet_ice", "gravel", "rough", "damp"])
def test_other_surfaces(name):
    sc = scenario(speed=((0.0, 15.0),), lanes=(Lane(2.0, 8.0, surface=SURFACES[name]),), duration_s=8.0)
    t, c = truth(sc)
    inside = (t > 3.0) & (t < 7.5)
    surface = SURFACES[name]
    expected = 31.0 / (1.0 + 31.0 * surface.compliance)
    assert c["true_slip_slope_rl"][inside].mean() == pytest.approx(expected, rel=0.02)
    if surface.mu is not None:
        assert c["true_mu_max_rl"][inside].max() == pytest.approx(surface.mu)
    assert (c["true_contact_fl"] == 1.0).all()  # no water, no lost contact
    assert c["on_water"].max() == 0.0


def test_slalom_to_two_metres_per_second_squared():
    """Steady gain of the two-track model at small steering: delta / (l / v^2 + K), K = (1/16 - 1/20) / g."""
    v = 70 / 3.6
    sc = scenario(speed=((0.0, v),), steering=Steering(0.0145, 4.0), duration_s=14.0)
    t, c = truth(sc)
    late = t > 6.0
    understeer = (1 / 16 - 1 / 20) / G
    expected = 0.0145 / (SEDAN.wheelbase / v**2 + understeer)
    assert c["a_y"][late].max() == pytest.approx(expected, rel=0.15)
    assert expected == pytest.approx(1.6, rel=0.1)
    assert (np.abs(c["yaw_rate"] * c["v_x"] - c["a_y"])[late]).max() < 0.6
    first = (t > 1.2) & (t < 2.5)  # the first lobe goes to the left: yaw and acceleration are positive
    assert c["steer_angle"][first].min() > 0.0
    assert c["yaw_rate"][first][-1] > 0.0
    assert c["a_y"][first].mean() > 0.0
    assert abs(np.degrees(np.cumsum(c["yaw_rate"])[late].mean() * 1e-3)) < 1.0  # and the car goes straight on average
    left_turn = late & (c["a_y"] > 1.0)
    assert (c["true_load_fr"] > c["true_load_fl"])[left_turn].all()


def test_excitation_leaves_the_acceleration_alone():
    _, c = truth(scenario(AWD, speed=((0.0, 25.0),), excitation=Excitation("sine", 250.0, "force", 4.0)))
    _, plain = truth(scenario(AWD, speed=((0.0, 25.0),)))
    assert np.ptp(c["torque_fl"]) == pytest.approx(250.0 * AWD.arm("fl"), rel=0.02)  # +-125 N a wheel
    assert np.abs(c["a_x"] - plain["a_x"]).max() < 0.01


def test_driver_holds_speed_and_profile():
    t, c = truth(scenario(speed=RAMP))
    wanted = np.interp(t, [0, 20], [60 / 3.6, 130 / 3.6])
    assert np.abs(c["v_x"] - wanted).max() < 0.3
    _, w = truth(scenario(speed=((0.0, 27.0),), lanes=(lane(),)))
    assert np.abs(w["v_x"] - 27.0).max() < 1.5


def test_same_scenario_same_bits_other_seed_other_contact():
    sc = scenario(lanes=(lane(),))
    _, a = truth(sc)
    _, b = truth(sc)
    _, c = truth(replace(sc, seed=2))
    np.testing.assert_array_equal(a["omega_fl"], b["omega_fl"])
    assert not np.array_equal(a["omega_fl"], c["omega_fl"])


# a lane, a curve, a grade and a changing speed: every effect has something to act on
EVERYTHING = scenario(
    AWD, speed=RAMP, lanes=(lane(1.0, 3.0),), steering=Steering(0.01, 2.0), duration_s=4.0, seed=4, load_rear=100.0,
    grade=((0.0, 0.01),),
)  # fmt: skip


@pytest.fixture(scope="module")
def base():
    return simulate(EVERYTHING)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_neutral_terms_change_no_bit(name, base):
    effect = EFFECTS[name]
    for where in (None, *effect.places):
        with_term = simulate(EVERYTHING, Model().with_term(Term(effect, {}, where)))
        for a, b in zip(base.measured, with_term.measured, strict=True):
            np.testing.assert_array_equal(a.t, b.t)
            for column in a.columns:
                np.testing.assert_array_equal(a.columns[column], b.columns[column], err_msg=f"{name} {where} {column}")


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_every_effect_does_something(name, base):
    effect = EFFECTS[name]
    p = effect.parameters[0]
    value = p.neutral + (p.sigma if p.neutral + p.sigma <= p.high else -p.sigma)
    where = effect.places[0] if effect.default is None and effect.places else None
    changed = simulate(EVERYTHING, Model().with_term(Term(effect, {p.name: value}, where)))
    different = any(
        not np.array_equal(a.columns[c], b.columns[c]) or not np.array_equal(a.t, b.t)
        for a, b in zip(base.measured, changed.measured, strict=True)
        for c in a.columns
    )
    assert different or name == "tone_ring"  # ideal sensors have no tone ring


def test_effects_carry_what_a_report_needs():
    for effect in EFFECTS.values():
        assert effect.source
        assert effect.sentence
        assert effect.target
        for p in effect.parameters:
            assert p.low <= p.neutral <= p.high
            assert p.sigma > 0
            assert p.smallest > 0


def test_twenty_seconds_in_a_tenth_of_a_second():
    sc = scenario(lanes=(lane(),))
    drive_truth(assemble(sc))
    times = []
    for seed in range(7):
        s = assemble(replace(sc, seed=seed))
        start = time.process_time()  # what others do on this machine does not count
        drive_truth(s)
        times.append(time.process_time() - start)
    assert min(times) < 0.1


def test_given_split_shares_the_torque_out():
    sc = scenario(AWD, speed=((0.0, 25.0),), split_rear=((0.0, 0.2), (4.0, 0.2), (8.0, 0.9)), duration_s=10.0)
    t, c = truth(sc)
    rear = (c["torque_rl"] + c["torque_rr"]) / (c["torque_rl"] + c["torque_rr"] + c["torque_fl"] + c["torque_fr"])
    np.testing.assert_allclose(rear, np.interp(t, [0, 4, 8], [0.2, 0.2, 0.9]), atol=1e-6)
    assert np.abs(resistance(t, c, sc)[5:-5]).max() < 0.01


def test_one_machine_code_serves_all_drives():
    """Another layout of an array would compile the whole simulation again."""
    drive_truth(assemble(scenario(duration_s=0.1)))
    drive_truth(assemble(scenario(duration_s=0.1, lanes=(lane(0.0, 1.0),), steering=Steering(0.01, 1.0))))
    drive_truth(assemble(scenario(AWD, duration_s=0.1, excitation=Excitation("sine", 100, "force", 1))))
    term = Term(EFFECTS["payload_mass"], {"delta_mass": 100}, "f")
    drive_truth(assemble(scenario(AWD, duration_s=0.1, grade=((0, 0),)), Model().with_term(term)))
    assert len(kernel.integrate.signatures) == 1


def test_a_brake_takes_the_foot_off_the_other_pedal():
    sc = scenario(
        speed=((0.0, 25.0),), brake_torque=((0.0, 0.0), (2.0, 0.0), (2.1, 1500.0), (6.0, 1500.0)), duration_s=6.0
    )
    t, c = truth(sc)
    braking = t > 3.0
    for w in WHEELS:
        assert c[f"torque_{w}"][braking].max() < 0.0
    assert c["a_x"][braking].mean() < -2.0


def test_starts_in_balance_on_a_hill_too():
    _, c = truth(scenario(speed=((0.0, 25.0),), grade=((0.0, 0.05),), duration_s=3.0))
    assert np.abs(c["v_x"] - 25.0).max() < 0.01
    assert c["a_x"].mean() == pytest.approx(G * np.sin(0.05), rel=1e-3)


def test_water_holds_a_floating_car_back():
    """A skidding tread still pushes the film, less than at full aquaplaning: floating does not mean rolling on."""
    sc = scenario(speed=((0.0, 145 / 3.6),), lanes=(lane(3.0, 6.0, h=1.3e-3),), water_scatter=0.0, duration_s=6.0)
    t, c = truth(sc)
    late = t > 4.5
    assert c["true_wave_drag"][late].mean() > 100.0
    assert c["a_x"][late].mean() < -0.3


@pytest.mark.parametrize("torque", [2000.0, 8000.0, 50000.0])
def test_a_hard_stop_ends_at_rest(torque):
    sc = scenario(speed=((0.0, 27.0),), brake_torque=((0.0, 0.0), (2.0, 0.0), (2.1, torque)), duration_s=30.0)
    t, c = truth(sc)
    rest = t > 26.0
    assert np.abs(c["v_x"][rest]).max() < 0.01
    assert np.abs(c["a_x"][rest]).max() < 0.01
    assert np.abs(c["omega_fl"][rest]).max() < 0.1


@pytest.mark.parametrize("torque", [2000.0, 50000.0])
def test_wheels_lock_on_ice(torque):
    ice = Lane(1.0, 9.0, surface=SURFACES["wet_ice"])
    sc = scenario(
        speed=((0.0, 25.0),), brake_torque=((0.0, 0.0), (2.0, 0.0), (2.1, torque)), duration_s=8.0, lanes=(ice,)
    )
    t, c = truth(sc)
    locked = t > 4.0
    for w in WHEELS:
        assert np.abs(c[f"omega_{w}"][locked]).max() < 0.3
    assert c["a_x"][locked].mean() == pytest.approx(-0.06 * G, rel=0.3)


def test_a_driver_does_not_wind_up_nor_run_away():
    _, c = truth(
        scenario(
            speed=((0.0, 27.0),),
            brake_torque=((0.0, 0.0), (2.0, 0.0), (2.1, 9000.0), (40.0, 9000.0), (40.1, 0.0)),
            duration_s=80.0,
        )
    )
    assert c["v_x"].max() < 1.2 * 27.0
    ice = Lane(5.0, 40.0, surface=SURFACES["wet_ice"])
    _, c = truth(scenario(speed=((0.0, 14.0), (5.0, 14.0), (10.0, 36.0)), lanes=(ice,), duration_s=40.0))
    assert max(c[f"omega_{w}"].max() for w in WHEELS) < 300.0
    _, c = truth(scenario(speed=((0.0, 14.0),), extra_torque=((0.0, -20000.0),), duration_s=20.0))
    assert c["v_x"].min() > -0.1


def test_absurd_water_ends_in_a_drive():
    """It ended in a crash of the process: a position that is no number was used as an index."""
    deep = Lane(3.0, 10.0, depth_left=0.02, depth_right=0.02, irregularity_left=1.0)
    term = Term(EFFECTS["uneven_water"], {"depth_gain": 5.0, "irregularity": 2.0})
    _, c = truth(scenario(Vehicle(), speed=((0.0, 83.0),), lanes=(deep,)), Model().with_term(term))
    assert np.isfinite(c["v_x"]).all()
    assert np.hypot(c["v_x"], c["true_v_y"]).max() < 1.05 * 83.0  # it may turn round, not gain speed


def test_a_car_that_turns_round_goes_on_along_its_road():
    ice = Lane(3.0, 20.0, surface=SURFACES["ice"])
    turned = scenario(speed=((0.0, 25.0),), lanes=(ice,), duration_s=12.0, steering=Steering(0.03, 4.0))
    rows, _ = raw(turned, every=10)
    v_x, v_y, psi = (col(rows, n) for n in ("v_x", "v_y", "psi"))
    assert np.abs(psi).max() > 2.0
    along = np.cumsum(v_x * np.cos(psi) - v_y * np.sin(psi)) * 0.01
    assert col(rows, "position")[-1] == pytest.approx(along[-1], rel=0.01)


def test_a_wheel_that_rolls_backwards_is_none_that_stands():
    """On a car that has turned round they float as they do forwards, and water holds it back."""
    _, wheels, _ = flat(build_plant(SEDAN, TYRES["worn_summer"], TYRES["worn_summer"]))
    ahead, back, stands = (
        water_at(3e-3, 4000.0, 33.0, v, rim, 1.0, wheels[0]) for v, rim in ((28.0, 28.0), (-28.0, -28.0), (-28.0, 0.0))
    )
    assert back.v_full == ahead.v_full
    assert back.contact == ahead.contact
    assert back.film_force == ahead.film_force > 0.0  # against the turning
    assert stands.wave < back.wave == -ahead.wave < 0.0  # against the motion
    assert stands.contact < back.contact


def test_masses_that_leave_no_car_are_refused():
    light = replace(SEDAN, mass=600.0)
    for mass, where in ((-500.0, None), (-500.0, "r")):
        with pytest.raises(ConfigError, match="mass"):
            assemble(scenario(light), Model().with_term(Term(EFFECTS["payload_mass"], {"delta_mass": mass}, where)))


def test_loads_carry_the_weight_where_a_wheel_lifts():
    loads = wheel_loads(
        np.array([-12.0, 0.0]), np.array([3.0, 0.0]), mass=1000.0, l_f=1.2, l_r=1.2, h_cg=1.5, track=1.4
    )
    assert loads[:, 0].min() == 0.0
    np.testing.assert_allclose(loads.sum(axis=0), 1000.0 * G, rtol=1e-9)


def test_a_drive_too_large_for_memory_is_refused():
    with pytest.raises(ConfigError, match="GB"):
        drive_truth(assemble(scenario(duration_s=7200.0, rate_hz=1000.0)))


def test_the_same_effect_at_the_same_place_counts_once():
    bias = EFFECTS["accelerometer_bias"]
    with pytest.raises(ConfigError, match="already"):
        Model().with_term(Term(bias, {"bias": 0.1})).with_term(Term(bias, {"bias": 0.1}, "a_x"))


def with_effect(name, values, where=None, **kw):
    sc = scenario(**{"speed": RAMP, "duration_s": 6.0, **kw})
    base, changed = simulate(sc), simulate(sc, Model().with_term(Term(EFFECTS[name], values, where)))
    return base.measured[0].columns, changed.measured[0].columns, changed.truth.columns


def test_torque_gain_is_true_over_reported():
    base, seen, truth_ = with_effect("torque_gain", {"gain": 1.25})
    np.testing.assert_allclose(truth_["true_torque_rl"][::10][: seen["torque_rl"].size], 1.25 * seen["torque_rl"])
    np.testing.assert_allclose(seen["torque_rl"] * 1.25, base["torque_rl"], atol=1.0)  # the driver needs the same


def test_signal_delay_is_late():
    base, seen, _ = with_effect("signal_delay", {"delay": 0.1})
    np.testing.assert_allclose(seen["v_x"][20:], base["v_x"][10:-10], atol=1e-9)


@pytest.mark.parametrize(("where", "heavier", "same"), [("f", "fl", "rl"), ("r", "rr", "fr")])
def test_payload_loads_its_axle(where, heavier, same):
    sc = scenario(speed=((0.0, 25.0),), duration_s=4.0)
    _, base = truth(sc)
    _, loaded = truth(sc, Model().with_term(Term(EFFECTS["payload_mass"], {"delta_mass": 200.0}, where)))
    assert (loaded[f"true_load_{heavier}"] - base[f"true_load_{heavier}"])[-1] == pytest.approx(100.0 * G, rel=0.02)
    assert (loaded[f"true_load_{same}"] - base[f"true_load_{same}"])[-1] == pytest.approx(0.0, abs=20.0)


def test_signs_of_the_other_effects():
    base, seen, _ = with_effect("accelerometer_bias", {"bias": 0.3})
    np.testing.assert_allclose(seen["a_x"] - base["a_x"], 0.3)
    base, seen, _ = with_effect("velocity_scale", {"scale": 1.02})
    np.testing.assert_allclose(seen["v_x"], 1.02 * base["v_x"])
    base, seen, _ = with_effect("tyre_radius", {"delta": 0.01}, "fl")
    assert (seen["omega_fl"] / base["omega_fl"])[100] == pytest.approx(1 / 1.01, rel=1e-4)
    for name, values in (
        ("head_wind", {"speed": 10.0}), ("aero_drag", {"delta_drag_area": 0.3}), ("rolling_resistance", {"delta_r_w": 0.01}),
        ("brake_drag", {"torque": 50.0}), ("tyre_warmup", {"extra": 0.5}), ("road_grade", {"grade": 0.02}),
    ):  # fmt: skip
        base, seen, _ = with_effect(name, values)
        more = seen["torque_rl"] - base["torque_rl"]
        assert more[200:].min() > 5.0, name  # each costs drive torque
    base, seen, _ = with_effect("slip_stiffness", {"gain": 0.5}, "r")
    slip = [(c["omega_rl"] * SEDAN.r_e("rl") / c["v_x"] - 1.0)[300] for c in (base, seen)]
    assert slip[1] == pytest.approx(2.0 * slip[0], rel=0.05)
