"""The blind world obeys mechanics, hides what it says it hides, and shares no physics with the library."""

import ast
import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.blind.world import cases
from tests.blind.world.effects import scaled
from tests.blind.world.kernel import OUT
from tests.blind.world.pools import SUITED
from tests.blind.world.sensors import measure
from tests.blind.world.unknown import shape_of
from tests.blind.world.world import WHEELS, G

SHORT = 60.0  # [s]
FOLDER = Path(cases.__file__).parent


@cache
def rows_of(spec):
    return cases.clean_rows(spec, cases.world_of(spec))[0]


def of(rows, name):
    return rows[:, OUT[name]]


def wheels(rows, stem):
    return np.array([of(rows, f"{stem}_{w}") for w in WHEELS])


def from_signals(signals, stem):
    return np.array([signals.array(f"{stem}_{w}") for w in WHEELS])


def believed(signals, vehicle):
    """Specific force that the vehicle file expects from torques, wheel speeds and speed [m/s^2]."""
    per_wheel = [
        (signals.array(f"torque_{w}") - vehicle.inertia(w) * np.gradient(signals.array(f"omega_{w}"), 0.01))
        / vehicle.arm(w)
        for w in WHEELS
    ]
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * signals.array("v_x") ** 2
    # the front axle's lateral force points backwards a little where the wheels are steered
    scrub = vehicle.l_r / vehicle.wheelbase * signals.array("a_y") * np.sin(signals.array("steer_angle"))
    return (np.sum(per_wheel, axis=0) - drag) / vehicle.mass - vehicle.rolling_resistance * G - scrub


def unexplained(signals, vehicle):
    """Measured less expected force balance, without the edges and slow crawling [m/s^2]; NaN there."""
    x = signals.array("a_x") - believed(signals, vehicle)
    x[(signals.array("v_x") < 2.0) | (signals.array("t") < 1.0)] = np.nan
    return x


def fit(signature, residual):
    ok = np.isfinite(residual) & np.isfinite(signature)
    return float(np.dot(signature[ok], residual[ok]) / np.dot(signature[ok], signature[ok]))


def hide(effect, where=None, **values):
    return (cases.Hidden(effect, where, values),)


# every car and every programme, not every pair of them
TOGETHER = [(p, list(cases.CARS)[i % len(cases.CARS)]) for i, p in enumerate(cases.PROGRAMMES)]
TOGETHER += [("mixed", car) for car in cases.CARS if ("mixed", car) not in TOGETHER]


@pytest.mark.nightly
@pytest.mark.parametrize(("programme", "vehicle"), [t for t in TOGETHER if t[0] in cases.EXACT_PROGRAMMES])
def test_forces_balance_by_the_vehicle_file(programme, vehicle):
    signals, same = cases.clean_pair(cases.Spec(programme, "white", seed=4, vehicle=vehicle, duration_s=SHORT))
    left = unexplained(signals, cases.CARS[vehicle])
    assert signals.frame.equals(same.frame)
    # the forces at work are those of driving and of all resistances
    size = np.sqrt(np.nanmean(signals.array("a_x") ** 2) + (cases.CARS[vehicle].rolling_resistance * G) ** 2)
    assert np.sqrt(np.nanmean(left**2)) < 0.01 * max(size, 0.5)
    assert abs(np.nanmean(left)) < 0.003


def test_speed_is_the_integral_of_force_and_position_that_of_speed():
    rows = rows_of(cases.Spec("mixed", "white", hide("road_grade", grade=0.02), seed=2, duration_s=SHORT))
    v, t = of(rows, "v_x"), np.arange(len(rows)) * 0.01
    pull = of(rows, "a_x") - G * np.sin(of(rows, "grade")) + of(rows, "yaw_rate") * of(rows, "v_y")
    gained = np.concatenate([[0.0], np.cumsum(0.5 * (pull[1:] + pull[:-1]) * 0.01)])
    assert np.allclose(v - v[0], gained, atol=0.003)
    driven = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.01)])
    assert np.allclose(of(rows, "position"), driven, atol=0.01)
    assert t[-1] == pytest.approx(SHORT - 0.01)


def test_wheel_torque_is_what_the_tyre_and_the_rolling_take():
    spec = cases.Spec("handling", "white", seed=6, vehicle="suv_awd", duration_s=SHORT)
    rows, car = rows_of(spec), cases.CARS["suv_awd"]
    for i, w in enumerate(WHEELS):
        spin = car.inertia(w) * np.gradient(of(rows, f"omega_{w}"), 0.01)
        rolling = car.rolling_resistance * wheels(rows, "F_z")[i] * car.arm(w)
        left = of(rows, f"torque_{w}") - spin - rolling - of(rows, f"F_x_{w}") * car.arm(w)
        assert np.std(left[100:]) < 0.01 * np.std(of(rows, f"torque_{w}"))


def test_loads_carry_the_weight_and_move_with_acceleration():
    rows, car = rows_of(cases.Spec("handling", "white", seed=3, duration_s=SHORT)), cases.CARS["sedan_rwd"]
    F_z = wheels(rows, "F_z")
    assert np.allclose(F_z.sum(axis=0), car.mass * G, rtol=1e-9)
    front = F_z[:2].sum(axis=0) - car.mass * G * car.l_r / car.wheelbase
    gain = fit(of(rows, "a_x"), front)
    assert gain == pytest.approx(-car.mass * car.h_cg / car.wheelbase, rel=0.1)
    # pitch swings: the load comes later than the acceleration
    slow = [np.dot(of(rows, "a_x")[100:-100], -front[100 + k : len(front) - 100 + k]) for k in range(30)]
    assert 2 <= int(np.argmax(slow)) <= 15


@pytest.mark.parametrize(("kind", "at_origin"), [("origin", 1.0), ("magic", 0.962), ("parabola", 1.0)])
def test_slip_slope_is_that_of_the_vehicle_file(kind, at_origin):
    spec = cases.Spec("mixed", "white", seed=5, vehicle="estate_fwd", tyre=kind, duration_s=120.0)
    rows, car = rows_of(spec), cases.CARS["estate_fwd"]
    mu, s = of(rows, "F_x_fl") / of(rows, "F_z_fl"), of(rows, "slip_fl")
    static = car.mass * G * car.l_r / car.wheelbase / 2.0
    fair = np.abs(of(rows, "F_z_fl") / static - 1.0) < 0.02
    small = fair & (np.abs(mu) < 0.04) & (of(rows, "v_x") > 5.0)
    assert fit(s[small], mu[small]) == pytest.approx(at_origin * car.slip_slope_f, rel=0.025)
    driving = (np.abs(mu) < 0.3) & (of(rows, "v_x") > 5.0)
    # what the parabola of a brush would say of the same forces: the file's slope, but for the shape of the curve
    D = car.mu_max
    brush = np.sign(mu) * 3.0 * D / car.slip_slope_f * (1.0 - np.cbrt(1.0 - np.abs(mu) / D))
    slope = fit(s[driving], brush[driving])
    assert slope == pytest.approx(1.0, abs={"magic": 0.035, "origin": 0.07, "parabola": 0.02}[kind])


@pytest.mark.parametrize("vehicle", ["sedan_rwd", "electric_awd"])
@pytest.mark.parametrize("programme", ["handling", "stop_and_go", "wet"])
def test_finer_steps_change_nothing(programme, vehicle):
    spec = cases.Spec(programme, "white", seed=8, vehicle=vehicle, duration_s=30.0)
    world = cases.world_of(spec)
    coarse, fine = (cases.clean_rows(spec, world, refine=k)[0] for k in (1, 4))
    assert np.max(np.abs(of(coarse, "v_x") - of(fine, "v_x"))) < 2e-3
    moving = of(fine, "v_x") > 2.0
    assert np.max(np.abs(wheels(coarse, "slip") - wheels(fine, "slip"))[:, moving]) < 2e-4


@pytest.mark.parametrize(("programme", "vehicle"), TOGETHER)
def test_drives_are_drives(programme, vehicle):
    rows = rows_of(cases.Spec(programme, "white", seed=7, vehicle=vehicle, duration_s=SHORT))
    assert np.isfinite(rows).all()
    assert of(rows, "v_x").min() > -0.05
    assert of(rows, "v_x").max() < 45.0
    assert np.abs(of(rows, "a_x")).max() < 5.5
    assert np.abs(of(rows, "a_y")).max() < 4.0
    assert np.abs(of(rows, "offset")).max() < 5.0
    assert np.abs(wheels(rows, "slip")[:, of(rows, "v_x") > 3.0]).max() < 0.08
    driven = wheels(rows, "torque").max(axis=1) > 30.0
    assert {w for w, d in zip(WHEELS, driven, strict=True) if d} == set(cases.CARS[vehicle].driven)


@pytest.mark.parametrize("effect", cases.POOLS)
def test_no_size_no_effect(effect):
    spec = cases.Spec(SUITED[effect][0], "white", (cases.POOLS[effect][0],), seed=3, duration_s=40.0, scale=0.0)
    hidden, nominal = cases.clean_pair(spec)
    assert hidden.frame.equals(nominal.frame)


@pytest.mark.nightly
@pytest.mark.parametrize("effect", cases.POOLS)
def test_each_size_in_the_pool_is_seen_and_the_weak_ones_less(effect):
    length = {"pressure_loss": 110.0, "drag_patch": 90.0, "hills": 60.0, "speed_hump": 60.0}.get(effect, 30.0)
    for hidden in cases.POOLS[effect]:
        spec = cases.Spec(SUITED[effect][0], "white", (hidden,), seed=3, duration_s=length)
        change = []
        nominal = cases.clean_drive(spec, cases.implied(spec))
        for scale in (0.3, 1.0):
            seen = cases.clean_drive(spec, cases.truth(replace(spec, scale=scale)))
            changed = 0.0
            for name in seen.symbols:
                if not name.startswith(("water", "on_")):
                    x = seen.array(name) - nominal.array(name)
                    changed += np.sqrt(np.mean(x**2)) / (np.std(nominal.array(name)) + 1e-3)
            change.append(changed)
        assert change[1] > change[0] > 0.0, hidden.key


@pytest.mark.parametrize(
    ("hidden", "touched"),
    [
        (hide("accelerometer_bias", "a_x", bias=0.2), {"a_x"}),
        (hide("accelerometer_gain", "a_x", gain=1.03), {"a_x"}),
        (hide("accelerometer_drift", "a_x", drift=1e-3), {"a_x"}),
        (hide("accelerometer_speed", "a_x", rate=0.01), {"a_x"}),
        (hide("velocity_scale", "v_x", scale=1.01), {"v_x"}),
        (hide("signal_delay", "v_x", delay=0.1), {"v_x"}),
        (hide("signal_delay", "torque", delay=0.1), {"torque_rl", "torque_rr", "torque_fl", "torque_fr"}),
        (hide("clock_skew", "a_x", skew=500.0), {"a_x", "a_y", "yaw_rate"}),
        (hide("tone_ring", "fl", amplitude=0.003), {"omega_fl"}),
    ],
)
def test_sensor_effects_touch_their_signals_alone(hidden, touched):
    seen, nominal = cases.clean_pair(cases.Spec("mixed", "white", hidden, seed=3, duration_s=40.0))
    changed = {n for n in seen.symbols if not np.array_equal(seen.array(n), nominal.array(n))}
    assert changed == touched


def signature(name, signals, vehicle):
    """What one unit of an effect adds to the unexplained force balance [m/s^2]."""
    v, m = signals.array("v_x"), vehicle.mass
    rho, area = vehicle.air_density, vehicle.drag_area
    T = from_signals(signals, "torque").sum(axis=0)
    radius = vehicle.torque_split_rear * vehicle.r_e_r + (1.0 - vehicle.torque_split_rear) * vehicle.r_e_f
    spin = np.gradient(from_signals(signals, "omega"), 0.01, axis=1).sum(axis=0)
    return {
        "aero_drag": -0.5 * rho * v**2 / m,
        "head_wind": -rho * area * v / m,
        "rolling_resistance": -G * np.ones_like(v),
        "brake_drag": -4.0 / radius / m * np.ones_like(v),
        "payload_mass": -signals.array("a_x") / m - vehicle.rolling_resistance * G / m,
        "torque_gain": T / radius / m,
        "wheel_inertia": -spin / radius / m,
        "cornering_drag": -(signals.array("a_y") ** 2),
        "accelerometer_bias": np.ones_like(v),
        "accelerometer_gain": signals.array("a_x"),
        "accelerometer_drift": signals.array("t"),
        "tyre_warmup": -vehicle.rolling_resistance * G * np.exp(-signals.array("t") / 90.0),
    }[name]


@cache
def left_without_effects(vehicle):
    spec = cases.Spec("mixed", "white", seed=3, vehicle=vehicle, duration_s=120.0)
    return np.nanmean(unexplained(cases.clean_drive(spec, ()), cases.CARS[vehicle]))


@pytest.mark.parametrize(
    ("effect", "where", "values"),
    [
        ("aero_drag", None, {"delta_drag_area": 0.2}),
        ("head_wind", None, {"speed": 0.5}),
        ("rolling_resistance", None, {"delta_r_w": 0.004}),
        ("brake_drag", None, {"torque": 15.0}),
        ("payload_mass", None, {"delta_mass": 40.0}),
        ("torque_gain", None, {"gain": 1.02}),
        ("wheel_inertia", None, {"delta_inertia": 2.0}),
        ("cornering_drag", None, {"coefficient": 0.05}),
        ("accelerometer_bias", "a_x", {"bias": 0.2}),
        ("accelerometer_gain", "a_x", {"gain": 1.02}),
        ("accelerometer_drift", "a_x", {"drift": 1e-3}),
        ("tyre_warmup", None, {"extra": 0.5, "time_constant": 90.0}),
    ],
)
@pytest.mark.parametrize("vehicle", ["sedan_rwd", "compact_fwd", "suv_awd"])
def test_force_effects_have_their_size(effect, where, values, vehicle):
    spec = cases.Spec("mixed", "white", hide(effect, where, **values), seed=3, vehicle=vehicle, duration_s=120.0)
    seen, car = cases.clean_drive(spec, cases.truth(spec)), cases.CARS[vehicle]
    name, x = next(iter(values.items()))
    size = x - 1.0 if name == "gain" else x
    measured = fit(signature(effect, seen, car), unexplained(seen, car) - left_without_effects(vehicle))
    assert measured == pytest.approx(size, rel=0.06)


@pytest.mark.parametrize(("where", "wheel", "other"), [("fl", "fl", "fr"), ("r", "rr", "fl")])
def test_a_smaller_tyre_turns_faster_and_pulls_alike(where, wheel, other):
    seen, _ = cases.clean_pair(
        cases.Spec("motorway", "white", hide("tyre_radius", where, delta=-0.01), seed=3, duration_s=SHORT)
    )
    car = cases.CARS["sedan_rwd"]
    free = seen.array("v_x") / (seen.array(f"omega_{wheel}") * car.r_e(wheel))
    still = seen.array("v_x") / (seen.array(f"omega_{other}") * car.r_e(other))
    slip = 0.004 if wheel[0] == "r" else 8e-4  # of a wheel that drives, of one that rolls
    assert np.mean(free) == pytest.approx(0.99, abs=slip)
    assert np.mean(still) == pytest.approx(1.0, abs=8e-4)


def test_radius_grows_with_the_square_of_speed():
    spec = cases.Spec("motorway", "white", hide("tyre_radius_growth", growth=5e-6), seed=3, duration_s=SHORT)
    seen, nominal = cases.clean_pair(spec)
    radius = [x.array("v_x") / x.array("omega_fl") for x in (seen, nominal)]
    v = seen.array("v_x")
    assert np.mean(radius[0] / radius[1] - 1.0) == pytest.approx(5e-6 * np.mean(v**2), rel=0.05)


def test_a_tyre_loses_its_air_when_it_is_told_to():
    values = {"radius": 0.01, "slope": 0.1, "start": 20.0, "duration": 10.0}
    seen, nominal = cases.clean_pair(
        cases.Spec("motorway", "white", hide("pressure_loss", "fr", **values), seed=3, duration_s=SHORT)
    )
    ratio = seen.array("omega_fr") / nominal.array("omega_fr")
    ratio *= nominal.array("v_x") / seen.array("v_x")
    assert np.allclose(ratio[:1900], 1.0, atol=1e-5)
    assert np.mean(ratio[3200:]) == pytest.approx(1.0 / 0.99, abs=1e-4)


@pytest.mark.parametrize(("where", "soft", "stiff"), [("rl", "rl", "rr"), ("r", "rr", "fl"), (None, "rl", None)])
def test_slip_slope_changes_where_it_should(where, soft, stiff):
    spec = cases.Spec(
        "mixed", "white", hide("slip_stiffness", where, gain=0.7), seed=3, vehicle="suv_awd", duration_s=SHORT
    )
    rows, nominal = rows_of(spec), rows_of(replace(spec, hidden=()))

    def slope(x, w):
        mu = of(x, f"F_x_{w}") / of(x, f"F_z_{w}")
        small = (np.abs(mu) < 0.1) & (of(x, "v_x") > 4.0)
        return fit(of(x, f"slip_{w}")[small], mu[small])

    assert slope(rows, soft) / slope(nominal, soft) == pytest.approx(0.7, abs=0.01)
    if stiff:
        assert slope(rows, stiff) / slope(nominal, stiff) == pytest.approx(1.0, abs=0.01)


def test_slope_drifts_and_follows_the_load():
    spec = cases.Spec(
        "handling", "white", hide("slip_stiffness_drift", rate=-2e-3), seed=3, vehicle="suv_awd", duration_s=120.0
    )
    rows = rows_of(spec)
    mu, s, t = of(rows, "F_x_rl") / of(rows, "F_z_rl"), of(rows, "slip_rl"), np.arange(12000) * 0.01
    late, early = ((np.abs(mu) < 0.15) & (np.abs(t - at) < 30.0) for at in (90.0, 30.0))
    nominal = rows_of(replace(spec, hidden=()))
    mu_0, s_0 = of(nominal, "F_x_rl") / of(nominal, "F_z_rl"), of(nominal, "slip_rl")
    for part, at in ((late, 90.0), (early, 30.0)):
        same = (np.abs(mu_0) < 0.15) & (np.abs(t - at) < 30.0)
        assert fit(s[part], mu[part]) / fit(s_0[same], mu_0[same]) == pytest.approx(np.exp(-2e-3 * at), abs=0.03)
    loaded = rows_of(replace(spec, hidden=hide("load_sensitivity", delta=0.8)))
    ratio = []
    for x in (loaded, nominal):
        mu_x, s_x, F = of(x, "F_x_fl") / of(x, "F_z_fl"), of(x, "slip_fl"), of(x, "F_z_fl") / np.mean(of(x, "F_z_fl"))
        heavy, light = ((np.abs(mu_x) < 0.3) & (mu_x * sign > 0.08) for sign in (-1.0, 1.0))
        ratio.append(fit(s_x[heavy], mu_x[heavy]) / fit(s_x[light], mu_x[light]))
        assert F[heavy].mean() > F[light].mean()
    assert ratio[0] > ratio[1] + 0.08


def test_forces_build_up_over_the_relaxation_length():
    spec = cases.Spec("stop_and_go", "white", hide("relaxation_length", length=1.0), seed=3, duration_s=SHORT)
    rows, nominal = rows_of(spec), rows_of(replace(spec, hidden=()))

    def lag(x):
        kinematic = of(x, "omega_rl") * cases.CARS["sedan_rwd"].r_e_r
        direct = (kinematic - of(x, "v_x") + 0.5 * 1.55 * of(x, "yaw_rate")) / np.maximum(kinematic, 1.0)
        return np.std(direct - of(x, "slip_rl"))

    assert lag(nominal) < 1e-6
    assert lag(rows) > 1e-4


def test_delay_is_late_by_its_size():
    seen, nominal = cases.clean_pair(
        cases.Spec("handling", "white", hide("signal_delay", "a_x", delay=0.08), seed=3, duration_s=SHORT)
    )
    assert np.allclose(seen.array("a_x")[100:], nominal.array("a_x")[92:-8], atol=1e-9)
    skewed, _ = cases.clean_pair(
        cases.Spec("handling", "white", hide("clock_skew", "v_x", skew=5000.0), seed=3, duration_s=SHORT)
    )
    x, y, t = skewed.array("v_x"), nominal.array("v_x"), nominal.array("t")
    assert np.allclose(np.interp(t / 1.005, t, y), x, atol=2e-3)


def test_a_trailer_is_pulled_but_not_carried():
    spec = cases.Spec("mixed", "white", hide("trailer", mass=500.0, delta_drag_area=0.0), seed=3, duration_s=SHORT)
    rows, car = rows_of(spec), cases.CARS["sedan_rwd"]
    assert np.allclose(wheels(rows, "F_z").sum(axis=0), car.mass * G, rtol=1e-9)
    pulled = wheels(rows, "F_x").sum(axis=0) - 0.5 * car.air_density * car.drag_area * of(rows, "v_x") ** 2
    total = (pulled - 500.0 * G * car.rolling_resistance) / (car.mass + 500.0)
    assert np.allclose(total, of(rows, "a_x"), atol=0.02)


def test_load_sits_where_it_is_put():
    spec = cases.Spec("motorway", "white", hide("payload_mass", "r", delta_mass=200.0), seed=3, duration_s=30.0)
    more = wheels(rows_of(spec), "F_z").mean(axis=1) - wheels(rows_of(replace(spec, hidden=())), "F_z").mean(axis=1)
    assert np.allclose(more[:2].sum(), 0.0, atol=25.0)
    assert more[2:].sum() == pytest.approx(200.0 * G, abs=25.0)


def test_a_grade_is_in_the_speed_but_not_in_the_balance():
    seen, nominal = cases.clean_pair(
        cases.Spec("mixed", "white", hide("road_grade", grade=0.02), seed=3, duration_s=SHORT)
    )
    kinematic = seen.array("a_x") - np.gradient(seen.array("v_x"), 0.01)
    assert np.mean(kinematic) == pytest.approx(G * np.sin(0.02), abs=0.01)
    car = cases.CARS["sedan_rwd"]
    assert np.nanmean(unexplained(seen, car)) == pytest.approx(np.nanmean(unexplained(nominal, car)), abs=0.003)


def test_water_brakes_softens_and_is_cleared():
    spec = cases.Spec("wet", "white", seed=3, vehicle="suv_awd", duration_s=120.0)
    rows = rows_of(spec)
    film, lost = wheels(rows, "film"), wheels(rows, "lost")
    wet = film[1] > 1e-4
    assert 0.15 < np.mean(wet) < 0.75
    assert 1e-3 < film[1][wet].max() < 2.6e-3
    assert film[3].max() < 0.7e-3
    assert np.median(lost[1][wet]) > 1.4 * np.median(lost[3][film[3] > 1e-4])
    assert np.all(film[0] <= film[1] + 1e-12)
    signals = cases.make_case(replace(spec, holdout=0)).drives[0][1]
    assert np.mean(np.abs(signals.array("water_depth_right") - film[1]) < 1e-4) > 0.99
    residual = unexplained(signals, cases.CARS["suv_awd"])
    assert np.nanmean(residual[wet]) < np.nanmean(residual[~wet]) - 0.05


@pytest.mark.nightly
@pytest.mark.parametrize("effect", ["speed_hump", "drag_patch", "gear_loss", "accelerometer_speed"])
@pytest.mark.parametrize("vehicle", ["compact_fwd", "suv_awd"])
def test_functions_of_the_unknown_are_what_the_drive_holds(effect, vehicle):
    hidden = cases.POOLS[effect][0]
    spec = cases.Spec(SUITED[effect][0], "white", (hidden,), seed=3, vehicle=vehicle, duration_s=200.0)
    rows, car = rows_of(spec), cases.CARS[vehicle]
    seen, nominal = cases.clean_pair(spec)
    shape = shape_of(hidden, car)
    coordinates = {
        "v_x": seen.array("v_x"), "a_x": of(rows, "a_x"), "position": of(rows, "position"),
        "torque": from_signals(seen, "torque").sum(axis=0),
    }  # fmt: skip
    expected = shape.f(*(coordinates[n] for n in shape.depends_on))
    residual = unexplained(seen, car) - np.nanmean(unexplained(nominal, car))
    ok = np.isfinite(residual)
    assert np.std(expected[ok]) > 0.02
    assert np.sqrt(np.mean((residual - expected)[ok] ** 2)) < 0.15 * np.sqrt(np.mean(expected[ok] ** 2))


def test_the_driver_reacts_to_what_is_hidden():
    spec = cases.Spec("motorway", "white", hide("head_wind", speed=8.0), seed=3, duration_s=120.0)
    rows, nominal = rows_of(spec), rows_of(replace(spec, hidden=()))
    late = slice(4000, None)
    car = cases.CARS["sedan_rwd"]
    v = of(nominal, "v_x")[late]
    needed = 0.5 * car.air_density * car.drag_area * np.mean((v + 8.0) ** 2 - v**2) * car.r_e_r
    more = wheels(rows, "torque").sum(axis=0)[late].mean() - wheels(nominal, "torque").sum(axis=0)[late].mean()
    assert more == pytest.approx(needed, rel=0.25)
    assert abs(np.mean(of(rows, "v_x")[late] - v)) < 0.7
    # he takes his time: nothing changes before he can have seen it
    assert np.array_equal(of(rows, "torque_rl")[:30], of(nominal, "torque_rl")[:30])
    assert abs(of(rows, "v_x") - of(nominal, "v_x"))[:2000].max() > 0.3


@pytest.mark.parametrize("kind", cases.NOISES)
def test_accelerometer_noise_has_its_size(kind):
    spec = cases.Spec("mixed", kind, seed=3, duration_s=120.0)
    world, rows = cases.world_of(spec), rows_of(replace(spec, noise="white"))
    x = measure(rows, world, kind, 3)["a_x"] - measure(rows, world, None, 3)["a_x"]
    assert np.nanstd(x) == pytest.approx(0.05, rel=0.6 if kind in ("ou5", "pink", "student") else 0.1)


def test_gaps_are_null_and_the_rest_stays():
    frame = cases.make_case(cases.Spec("mixed", "gaps", seed=3, holdout=0, duration_s=150.0)).drives[0][1].frame
    missing = np.array(
        [frame[c].null_count() / frame.height for c in frame.columns if c.startswith(("a_", "omega", "v_"))]
    )
    assert 0.003 < missing.mean() < 0.12
    assert frame["t"].null_count() == 0
    assert (
        cases.make_case(cases.Spec("mixed", "white", seed=3, holdout=0, duration_s=20.0))
        .drives[0][1]
        .frame.null_count()
        .to_numpy()
        .sum()
        == 0
    )


def test_a_case_is_a_function_of_its_spec():
    spec = cases.Spec(
        "mixed", "student", (cases.POOLS["payload_mass"][0],), seed=5, duration_s=30.0, drives=2, holdout=1
    )
    one, two = cases.make_case(spec), cases.make_case(pickle.loads(pickle.dumps(spec)))
    assert hash(spec) == hash(pickle.loads(pickle.dumps(spec)))
    frames = [s.frame for _, s in (*one.drives, *one.holdout)]
    assert all(a.equals(b.frame) for a, (_, b) in zip(frames, (*two.drives, *two.holdout), strict=True))
    assert not frames[0].equals(frames[1])
    assert not frames[0].equals(frames[2])
    assert not frames[0].equals(cases.make_case(replace(spec, seed=6)).drives[0][1].frame)
    assert [n for n, _ in one.drives] == ["drive_1", "drive_2"]
    assert [n for n, _ in one.holdout] == ["unseen_1"]


def test_speed_may_be_withheld():
    signals = cases.make_case(cases.Spec("mixed", "white", seed=5, duration_s=10.0, holdout=0, has_v_x=False)).drives[
        0
    ][1]
    assert "v_x" not in signals.symbols
    assert {"a_x", "a_y", "yaw_rate", "steer_angle", "omega_rr", "torque_fl", "on_water"} <= set(signals.symbols)


def test_names_are_those_of_the_library():
    from aqualog.model.effects import EFFECTS

    known = set(cases.POOLS) - set(cases.UNKNOWN)
    assert known == set(EFFECTS)
    for hidden in (h for pool in cases.POOLS.values() for h in pool if h.in_library):
        effect = EFFECTS[hidden.effect]
        by_name = {p.name: p for p in effect.parameters}
        assert hidden.where is None or hidden.where in effect.places, hidden.key
        for name, x in hidden.values.items():
            assert by_name[name].low <= x <= by_name[name].high
            assert scaled(hidden, 0.0).values[name] in (by_name[name].neutral, x)


def test_specs_cover_noises_programmes_and_cars():
    nulls = list(cases.null_specs(range(1, 4)))
    assert len(nulls) == 3 * 4 * 10
    assert {s.vehicle for s in nulls} == set(cases.CARS)
    assert all(not cases.truth(s) for s in nulls)
    assert cases.truth(cases.Spec("hilly", "white"))[0].effect == "hills"
    hidden = list(cases.hidden_specs(range(1, 3), scale=0.3))
    assert len(hidden) == 2 * len(cases.POOLS)
    assert all(s.programme in SUITED[s.hidden[0].effect] for s in hidden)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_written_cases_are_read_back(tmp_path, suffix):
    from aqualog.align.load import load_signals
    from aqualog.config.vehicle import load_vehicle

    case = cases.make_case(cases.Spec("wet", "gaps", seed=5, duration_s=20.0, vehicle="suv_awd"))
    paths = cases.write_case(case, tmp_path, suffix=suffix)
    vehicle = load_vehicle(paths["vehicle"][0])
    assert replace(vehicle, given=frozenset(), torque_split_rear=0.6) == replace(case.vehicle, given=frozenset())
    again = load_signals(paths["drives"], vehicle=vehicle)
    assert again.frame.height == 2000
    # short gaps are bridged by the reader
    x, y = again.array("omega_fl"), case.drives[0][1].array("omega_fl")
    both = np.isfinite(x) & np.isfinite(y)
    assert both.mean() > 0.8
    assert np.allclose(x[both], y[both], rtol=1e-9)


def test_wrong_words_are_told():
    for wrong in ({"programme": "fast"}, {"noise": "loud"}, {"vehicle": "tank"}, {"tyre": "square"}):
        with pytest.raises(KeyError, match="there are"):
            cases.Spec(**({"programme": "mixed", "noise": "white"} | wrong))
    with pytest.raises(KeyError, match="no hidden effect"):
        cases.Hidden("gravity", None, {})


def test_the_world_shares_no_physics_with_the_library():
    allowed = {"aqualog.core.vehicle", "aqualog.core.records", "aqualog.align", "aqualog.core.compiled"}
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [n.name for n in node.names] if isinstance(node, ast.Import) else []
            assert not [n for n in names if n.startswith("aqualog") and n not in allowed], path.name
