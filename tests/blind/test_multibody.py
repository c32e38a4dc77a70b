"""The multibody world obeys mechanics, repeats by seed, keeps its secrets, and shares no physics with the library."""

import ast
import json
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.blind.multibody import cases, make
from tests.blind.multibody.car import NO_ODD, draw_car, gradients, vehicle_file
from tests.blind.multibody.cases import DT, draw_plan, make_case, residuals
from tests.blind.multibody.driver import ROWS, drive_along
from tests.blind.multibody.dynamics import odd_force
from tests.blind.multibody.functions import points_of
from tests.blind.multibody.hidden import HELD_BACK, KINDS, Hidden, Setup, applied, draw, enlarged, in_worths, names_of
from tests.blind.multibody.roads import Place, build_road
from tests.blind.multibody.seal import LEDGER, SealError, open_truth, seal_truth
from tests.blind.multibody.sensors import NOISES, TEETH, WHEELS, Error, coloured, edges, ideal, measure

FOLDER = Path(cases.__file__).parent
G = 9.81
STYLE = np.array([0.3, 0.4, 0.5, 0.03, 0.15, 0.2, 0.0])


@cache
def car_of(seed=3):
    return draw_car(np.random.default_rng(seed))


def ride(car, target, *, coast=False, lateral=0.0, grade=0.0, odd=NO_ODD):
    """Columns of a drive on a smooth road by the speed that the driver wants (n + 200,)."""
    n = target.size - 200
    still = np.zeros(n)
    slow = np.zeros((2000, 4))
    slow[:, 0] = grade
    knows = np.array([car.mass, 0.6 * car.drag_area, float(car.roll_0.mean()), float(car.r_e.mean())])
    rows = drive_along(
        target, np.full(n + 200, float(coast)), np.full(n, lateral), still, still, still, np.zeros((2000, 2)), slow, car,
        odd, STYLE, knows,
    )  # fmt: skip
    assert np.isfinite(rows).all()
    return {name: rows[:, i] for name, i in ROWS.items()}


def steady(v, seconds=12.0):
    return np.full(round(seconds / DT) + 200, v)


def without_losses(car):
    return car._replace(
        roll_0=np.zeros(4), roll_1=0.0, roll_4=0.0, drag_area=0.0, lift_f=0.0, lift_r=0.0, shaft_damper=np.zeros(2),
    )  # fmt: skip


@pytest.mark.nightly
def test_nothing_is_lost_or_won_without_losses():
    x = ride(without_losses(car_of()[0]), steady(25.0), coast=True)
    assert x["v_x"][-1] == pytest.approx(25.0, rel=2e-5)


def test_a_coast_down_is_that_of_the_resistances():
    car = car_of()[0]._replace(roll_1=0.0, roll_4=0.0, lift_f=0.0, lift_r=0.0)
    x = ride(car, steady(30.0), coast=True)
    k = slice(400, 1100)
    v = x["v_x"][k].mean()
    force = car.roll_0.mean() * car.mass * G + 0.5 * car.air_density * car.drag_area * v**2
    gear = -1 if len(car.turning) > 1 else 0
    turning = (car.rim + car.belt).sum() / car.r_e[0] ** 2 + car.turning[gear] / car.r_e[0] ** 2
    a = np.polyfit(np.arange(700) * DT, x["v_x"][k], 1)[0]
    assert a == pytest.approx(-force / (car.mass + turning), rel=0.01)
    # the specific force sees the turning parts as well, and the nose that rises with the drag
    assert np.mean(x["a_x"][k]) == pytest.approx(a, abs=0.02)


def test_work_becomes_speed():
    car = without_losses(car_of()[0])
    x = ride(car, np.linspace(10.0, 25.0, 1700))
    power = sum(x[f"torque_{w}"] * x[f"omega_{w}"] for w in WHEELS)
    kinetic = 0.5 * car.mass * x["v_x"] ** 2 + sum(
        0.5 * (car.rim + car.belt)[i] * x[f"omega_{w}"] ** 2 for i, w in enumerate(WHEELS)
    )
    slip_loss = sum(x[f"force_{w}"] * x[f"slip_{w}"] * x["v_x"] for w in WHEELS)
    work = np.cumsum(power - slip_loss) * DT
    assert kinetic[-1] - kinetic[0] == pytest.approx(work[-1] - work[0], rel=2e-3)


def test_a_braked_car_stands_on_a_slope():
    car = car_of()[0]
    x = ride(car, steady(0.0, 11.0), grade=0.05)
    assert np.abs(x["v_x"][800:]).max() < 1e-3
    assert np.mean(x["a_x"][800:]) == pytest.approx(G * np.sin(0.05), rel=0.06)  # more by the pitch of the body
    loads = sum(x[f"load_{w}"] for w in WHEELS)
    assert loads[-1] == pytest.approx(car.mass * G, rel=1e-3)
    assert all(x[f"omega_{w}"][-1] == pytest.approx(0.0, abs=1e-3) for w in WHEELS)


def test_signs_are_those_of_iso_8855():
    car = car_of()[0]
    left = {n: x[-300:].mean() for n, x in ride(car, steady(20.0), lateral=3.0).items()}
    assert left["steer_angle"] > 0.0
    assert left["yaw_rate"] == pytest.approx(left["a_y"] / left["v_x"], rel=0.1)
    assert left["a_y"] == pytest.approx(3.0, rel=0.15)
    assert left["roll"] > 0.005  # the left side is up
    assert left["load_fr"] > left["load_fl"]
    assert left["omega_rr"] > left["omega_rl"]
    assert left["v_y"] < 0.05 * left["v_x"]
    x = ride(car, np.linspace(10.0, 34.0, 1400))
    k = slice(500, 900)
    assert x["pitch"][k].mean() < 0.0  # nose up
    assert x["load_rl"][k].mean() > car.static[2]
    shift = car.mass * np.gradient(x["v_x"], DT)[k].mean() * car.h_cg / (car.l_f + car.l_r)
    lift = 0.5 * car.air_density * (x["v_x"][k] ** 2).mean() * car.lift_r
    assert 2.0 * (x["load_rl"][k].mean() - car.static[2]) == pytest.approx(shift - lift, rel=0.2)


def test_the_pitch_at_rest_on_the_springs_is_the_one_that_the_sensor_corrects():
    car = without_losses(car_of()[0])
    x = ride(car, np.linspace(8.0, 36.0, 1600))
    k = slice(500, 1000)
    assert -x["pitch"][k].mean() == pytest.approx(gradients(car)[0] * np.gradient(x["v_x"], DT)[k].mean(), rel=0.1)


def test_free_wheels_roll_on_their_radius():
    car = without_losses(car_of()[0])
    x = ride(car, steady(22.0), coast=True)
    for i, w in enumerate(WHEELS):
        assert x["v_x"][-1] / x[f"omega_{w}"][-1] == pytest.approx(car.r_e[i], rel=1e-4)


def test_a_step_of_half_the_length_changes_nothing_that_counts():
    # the scheme is of second order: what is compared is a closed form, not itself
    car = without_losses(car_of()[0])
    x = ride(car._replace(bristle_x=np.full(4, 0.3)), steady(15.0), grade=0.02, coast=True)
    gear = 2 if len(car.turning) > 1 else 0
    turning = ((car.rim + car.belt).sum() + car.turning[gear]) / car.r_e[0] ** 2
    expected = 15.0 - G * np.sin(0.02) * car.mass / (car.mass + turning) * 12.0
    assert x["v_x"][-1] == pytest.approx(expected, rel=2e-3)


def test_edges_give_the_speed():
    angle = np.cumsum(np.full(500, 0.37)) + 1.0
    assert np.allclose(edges(angle, np.zeros(TEETH))[2:], 37.0, rtol=1e-9)
    assert edges(np.zeros(200), np.zeros(TEETH))[-1] == 0.0
    uneven = edges(angle, 0.01 * np.sin(np.arange(TEETH) * 2.0 * np.pi / TEETH))
    assert uneven[2:].mean() == pytest.approx(37.0, rel=1e-3)
    assert uneven[2:].std() > 0.01


@pytest.mark.parametrize("kind", NOISES)
def test_noises_have_unit_variance(kind):
    x = coloured(kind, 60_000, DT, np.random.default_rng(4))
    assert x.std() == pytest.approx(1.0, rel=0.25)


def test_ideal_sensors_see_the_balance_of_the_vehicle_file(monkeypatch):
    from tests.blind.multibody import car as module

    monkeypatch.setattr(module, "FILE_ERRORS", dict.fromkeys(module.FILE_ERRORS, 0.0))
    monkeypatch.setattr(module, "SPREAD", dict.fromkeys(module.SPREAD, 0.0))
    for seed in (3, 5):
        plan = draw_plan(seed, 1, "null", duration_s=60.0)._replace(programme="country")
        vehicle = vehicle_file(plan.car, plan.drivetrain, np.random.default_rng(1))
        rows = cases.drive(plan, vehicle, smooth=True)
        messages = ideal(rows, plan.car, {}, np.random.default_rng(1))
        r = residuals(messages, vehicle, 50, 60.0)
        assert np.sqrt(np.mean(r["force_balance"] ** 2)) < 0.012
        assert abs(np.mean(r["kinematic"])) < 0.03
        assert all(abs(np.mean(r[f"slip_{w}"])) < 0.03 for w in WHEELS)


def test_kinds_are_the_contracts_and_forms_besides():
    from aqualog.model.effects import EFFECTS

    known, unknown = [n for n, k in KINDS.items() if k.known], [n for n, k in KINDS.items() if not k.known]
    assert set(known) == set(EFFECTS)
    assert not set(unknown) & set(EFFECTS)
    assert len(unknown) >= 10
    assert len(HELD_BACK) == 5
    assert not set(HELD_BACK) & set(names_of(known=False))
    for name in known:
        for h in (draw(name, np.random.default_rng(s)) for s in range(6)):
            given = {p.name: p for p in EFFECTS[name].parameters}
            assert set(h.values) <= set(given)
            assert h.where is None or h.where in EFFECTS[name].places
            assert all(given[p].low <= x <= given[p].high for p, x in h.values.items()), h
            assert all(
                given[p].low <= x <= given[p].high for p, x in enlarged(h, cases.LARGEST / in_worths(h)).values.items()
            )
    assert enlarged(draw("slip_stiffness", np.random.default_rng(2)), 50.0).values["gain"] >= 0.2


@cache
def without_hidden(programme, seconds):
    return clean_messages(programme, seconds)


def clean_messages(programme, seconds, *hidden):
    plan = draw_plan(4, 1, "null", duration_s=seconds)._replace(programme=programme)
    return cases._clean(plan, vehicle_file(plan.car, plan.drivetrain, np.random.default_rng(1)), hidden)


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_changes_its_drive(name):
    h = draw(name, np.random.default_rng(7))
    late = {k: 4.0 for k in h.values if k in ("start", "up")}
    h = replace(h, values={**h.values, **late})
    off = replace(h, values={**h.values, **dict.fromkeys(KINDS[name].worth[h.where], KINDS[name].neutral)})
    brakes = {"time since braking", "a_x", "torque"} & set(KINDS[name].depends_on)
    seconds, programme = (60.0, "city") if brakes else (12.0, KINDS[name].programmes[0])
    seen = clean_messages(programme, seconds, h), without_hidden(programme, seconds)
    none = clean_messages(programme, seconds, off)
    assert all(
        np.array_equal(a.columns[s], b.columns[s]) for a, b in zip(none, seen[1], strict=True) for s in a.columns
    )
    difference = max(np.abs(a.columns[s] - b.columns[s]).max() for a, b in zip(*seen, strict=True) for s in a.columns)
    assert np.isfinite(difference)
    assert difference > 1e-6


def test_odd_forces_are_where_they_say():
    def force(name, t=10.0, share=0.5, v=20.0, way=0.0, steer=0.0, torque=300.0, a_side=0.0, yaw=0.0, a_x=0.0, is_open=0.0,
              **values):  # fmt: skip
        h = draw(name, np.random.default_rng(1))
        car, _ = car_of()
        setup = applied(Setup(car, NO_ODD, Place()), (replace(h, values={**h.values, **values}),))
        return odd_force(t, share, v, way, steer, torque, a_side, yaw, a_x, is_open, setup.odd)

    assert force("speed_hump", force=100.0, centre=20.0) == pytest.approx(100.0)
    assert force("passing_force", t=70.0, force=90.0, start=60.0, length=75.0) == pytest.approx(90.0)
    assert force("passing_force", t=140.0, force=90.0, start=60.0, length=75.0) == 0.0
    assert force("way_waves", way=50.0, force=80.0, period=200.0, phase=0.0) == pytest.approx(80.0)
    assert force("steering_drag", steer=-0.1, force=5000.0) == pytest.approx(500.0)
    assert force("odd_hours", share=0.05, force=50.0) == pytest.approx(-50.0, rel=0.1)
    given = {"force": 80.0, "period": 700.0, "phase": 0.0}
    at = [force("quartz", v=v, way=w, **given) for v, w in ((20.0, 175.0), (10.0, 875.0), (20.0, 525.0))]
    assert at == pytest.approx([80.0, 20.0, 0.0], rel=0.01, abs=0.1)
    given = {"force": 90.0, "side": -1.0, "threshold": 0.8, "width": 0.1}
    at = [force("basalt", a_side=a, **given) for a in (-2.0, -0.8, 0.0, 2.0)]
    assert at == pytest.approx([90.0, 45.0, 0.0, 0.0], abs=1e-3)
    at = [force("agate", yaw=y, force=50.0, knee=0.1) for y in (-0.1, 0.0, 0.4)]
    assert at == pytest.approx([50.0 * np.tanh(1.0), 0.0, 50.0], abs=0.1)
    given = {"force": 50.0, "start": 60.0, "length": 70.0}
    at = [force("beryl", t=t, v=v, **given) for t, v in ((90.0, 30.0), (60.0, 20.0), (140.0, 20.0))]
    assert at == pytest.approx([112.5, 25.0, 0.0], abs=1e-3)
    at = [force("garnet", a_x=a, rate=100.0, threshold=0.5) for a in (-2.5, -0.5, 1.0)]
    assert at == pytest.approx([200.0, 0.0, 0.0])
    assert [force("pyrite", v=v, is_open=o, force=40.0) for v, o in ((30.0, 1.0), (30.0, 0.0))] == [90.0, 0.0]
    given = {"power": 1000.0, "period": 40.0, "phase": 0.0}
    at = [force("albite", t=t, v=v, **given) for t, v in ((10.0, 20.0), (50.0, 2.0), (30.0, 20.0))]
    assert at == pytest.approx([50.0, 200.0, 0.0], abs=0.2)
    at = [force("calcite", torque=x, loss=0.1) * car_of()[0].r_e.mean() for x in (-300.0, 300.0)]
    assert at == pytest.approx([30.0, 0.0])


def test_odd_tyres_and_sensors_are_where_they_say():
    car = car_of()[0]
    band = Hidden("gneiss", None, {"depth": 0.4, "centre": 20.0, "width": 2.0})
    driven = [w for i, w in enumerate(WHEELS) if (car.split_rear if i > 1 else 1.0 - car.split_rear) > 0.0]
    wheel = Hidden("jasper", "fr", {"depth": 0.01, "side": 1.0, "threshold": 0.7, "width": 0.2})
    odd = applied(Setup(car, NO_ODD, Place()), (wheel,)).odd
    for lateral, by in ((2.0, 0.01), (-2.0, 0.0)):
        one, two = (ride(car, steady(20.0), coast=True, lateral=lateral, odd=o) for o in (odd, NO_ODD))
        turns = [one[f"omega_{w}"][-1] / two[f"omega_{w}"][-1] for w in ("fr", "rl")]
        assert turns[0] / turns[1] - 1.0 == pytest.approx(by, abs=1e-3)
    odd = applied(Setup(car, NO_ODD, Place()), (Hidden("spinel", None, {"torque": 60.0, "width": 0.2}),)).odd
    one, two = (ride(car, steady(20.0), lateral=2.0, odd=o) for o in (odd, NO_ODD))
    more = [(x[f"force_{driven[0]}"] - x[f"force_{driven[1]}"])[-300:].mean() * car.r_e[2] for x in (one, two)]
    faster = (one[f"omega_{driven[1]}"] - one[f"omega_{driven[0]}"])[-300:].mean()
    assert more[0] - more[1] == pytest.approx(120.0 * np.tanh(faster / 0.2), rel=0.05)
    place = Hidden("galena", None, {"depth": 0.4, "period": 200.0, "phase": 0.0})
    for hidden, by, at, near, expected in (
        (band, "v_x", (13.0, 18.0, 20.0, 28.0), 0.3, [1.0, 1.0 - 0.4 * np.exp(-0.5), 0.6, 1.0]),
        (place, "way", (50.0, 150.0), 2.0, [0.6, 1.0]),
        (Hidden("rutile", None, {"depth": -0.3}), "slip", (0.005, -0.005), 0.002, [1.0, 1.3]),
        (Hidden("talc", None, {"rate": 0.3}), "kW", (3.0, 9.0), 0.5, [1.0 / 1.09, 1.0 / 1.27]),
    ):
        slope = []
        for odd in (applied(Setup(car, NO_ODD, Place()), (hidden,)).odd, NO_ODD):
            x = ride(car, np.concatenate([np.linspace(10.0, 32.0, 1300), np.linspace(32.0, 20.0, 400)]), odd=odd)
            x |= {n: np.mean([x[f"{n}_{w}"] for w in driven], axis=0) for n in ("slip", "torque")}
            x["kW"] = x["torque"] * x["v_x"] / 1e3
            stiff = np.mean([x[f"force_{w}"] / (x[f"load_{w}"] * x[f"slip_{w}"]) for w in driven], axis=0)
            slope.append([np.median(stiff[np.abs(x[by] - here) < near]) for here in at])
        assert np.divide(*slope) == pytest.approx(expected, rel=0.04)

    odd = applied(Setup(car, NO_ODD, Place()), (Hidden("pyrite", None, {"force": 600.0, "up": 22.0, "gap": 8.0}),)).odd
    x = ride(car, np.concatenate([np.linspace(10.0, 28.0, 1000), np.linspace(28.0, 10.0, 1200)]), odd=odd)
    F = sum(x[f"force_{w}"] for w in WHEELS) - car.mass * np.gradient(x["v_x"], DT)
    near, top = np.abs(x["v_x"] - 18.0) < 0.5, x["v_x"].argmax()
    assert F[top:][near[top:]].mean() - F[:top][near[:top]].mean() == pytest.approx(600.0 * 0.81, rel=0.1)

    def seen(*hidden):
        return {s: x for m in clean_messages("country", 20.0, *hidden) for s, x in m.columns.items()}

    true = seen()
    assert np.ptp(true["v_x"]) > 5.0
    added = seen(Hidden("feldspar", "a_x", {"square": 0.03}))["a_x"] - true["a_x"]
    assert added == pytest.approx(0.03 * true["a_x"] ** 2, abs=1e-9)
    added = seen(Hidden("dolomite", "a_y", {"shake": 0.3, "centre": 18.0, "width": 2.0}))["a_y"] - true["a_y"]
    assert added == pytest.approx(0.3 / (1.0 + (0.5 * (true["v_x"] - 18.0)) ** 2), abs=1e-3)
    added = seen(Hidden("mica", "a_x", {"tip": 0.1, "threshold": 0.3}))["a_x"] - true["a_x"]
    beyond = np.abs(true["a_y"]) > 0.5
    assert np.any(beyond)
    assert added[beyond] == pytest.approx(0.1 * np.sign(true["a_y"][beyond]), abs=1e-9)
    by = {s: x - true[s] for s, x in seen(Hidden("chalk", None, {"torque": 30.0})).items() if s.startswith("torque")}
    big = {s: np.abs(true[s]) > 100.0 for s in by}
    assert max(np.abs(x).max() for x in by.values()) == pytest.approx(0.43 * 30.0, rel=0.02)
    assert all(np.abs(x[big[s]]).max(initial=0.0) < 0.01 for s, x in by.items())
    ratio = seen(Hidden("flint", "v_x", {"scale": 0.01, "period": 8.0, "phase": 0.0}))["v_x"] / true["v_x"]
    assert ratio[[200, 600, 1000]] == pytest.approx([1.01, 0.99, 1.01], abs=1e-4)
    added = seen(Hidden("olivine", "a_y", {"lean": 0.2}))["a_y"] - true["a_y"]
    pull = sum(x for s, x in true.items() if s.startswith("torque"))
    assert added == pytest.approx(0.2e-3 * np.maximum(pull, 0.0), rel=0.02, abs=1e-4)
    added = seen(Hidden("accelerometer_position", "a_x", {"ahead": 2.0}))["a_x"] - true["a_x"]
    assert added == pytest.approx(-2.0 * true["yaw_rate"] ** 2, abs=1e-9)
    added = seen(Hidden("fluorite", "a_x", {"size": 0.1, "time": 9.0}))["a_x"] - true["a_x"]
    assert added[[0, 900]] == pytest.approx([0.1, 0.1 / np.e], rel=1e-3)
    ratio = seen(Hidden("epidote", "rl", {"share": 0.5, "speed": 18.0, "width": 0.5}))["omega_rl"] / true["omega_rl"]
    there = np.abs(true["v_x"] - 18.0) > 1.5
    assert ratio[there] == pytest.approx(np.where(true["v_x"] < 18.0, 1.0 - 0.5 / TEETH, 1.0)[there], abs=1e-4)
    tilt = Hidden("zircon", None, {"angle": 0.01, "time": 9.0})
    late, none = (x[0].columns["a_x"] for x in (clean_messages("city", 60.0, tilt), without_hidden("city", 60.0)))
    after = (late - none)[np.argmax(late - none) :]
    assert after[[0, 200]] == pytest.approx(0.0981 * np.exp([0.0, -2.0 / 9.0]), rel=0.03)


def test_points_are_a_form_as_a_diagnosis_has_it():
    def points(name, where=None, **values):
        plan = draw_plan(4, 1, "null", duration_s=20.0)._replace(programme="country")
        plan = plan._replace(hidden=(Hidden(name, where, values),))
        (hidden,) = make_case(plan, z_least=0.0).truth["hidden"]
        found = hidden["points"]
        return plan.car, found, *(np.array(found[n]) for n in ("x", "f"))

    _, found, x, f = points("speed_hump", force=-90.0, centre=18.0, width=2.0)
    assert (found["unit"], x.size) == ("N", 100)
    assert f == pytest.approx(-90.0 * np.exp(-0.5 * ((x - 18.0) / 2.0) ** 2), abs=0.02)
    _, found, x, f = points("speed_dependent_gain", "a_x", rate=0.01)
    assert (found["unit"], f) == ("-", pytest.approx(0.01 * (x - 15.0), abs=1e-5))
    _, found, x, f = points("yawing_slip", rate=5.0)
    assert found["slip_r"] == pytest.approx(1.0 / (1.0 + 5.0 * np.abs(x)) - 1.0, abs=1e-4)
    assert not any(found["slip_f"])
    _, found, x, f = points("rutile", depth=0.4)
    assert np.interp([0.0, 999.0], x, f) == pytest.approx([-0.2, 0.0], abs=0.01)
    _, found, x, f = points("garnet", rate=50.0, threshold=0.8)
    assert f == pytest.approx(50.0 * np.maximum(-0.8 - x, 0.0), abs=0.01)
    car, _, x, f = points("calcite", loss=0.1)
    assert f == pytest.approx(np.clip(-0.1 * x / car.r_e.mean(), 0.0, max(f.max(), 5.0)), abs=0.01)
    assert f.max() > 5.0
    _, found, x, f = points("fluorite", "a_x", size=0.1, time=20.0)
    assert (found["unit"], f) == ("m/s^2", pytest.approx(0.1 * np.exp(-x / 20.0), abs=1e-5))
    car, found, x, f = points("torque_read_in_speed", rate=0.03)
    slip = 200.0 / (car.r_e[2] * car.slope[2] * car.static[2])  # of a rear wheel with 200 N m
    there = np.interp(400.0 / car.split_rear, x, found["slip_r"])
    assert there == pytest.approx(slip / (slip + 0.03 * 0.2**2) - 1.0, rel=0.03)
    car, _, x, f = points("chalk", torque=30.0)
    wheel = 0.5 * np.outer([1.0 - car.split_rear, car.split_rear], (x - f * car.r_e.mean())[x > 0.0])
    assert (2.0 * wheel * (1.0 - np.exp(-((wheel / 30.0) ** 2)))).sum(axis=0) == pytest.approx(x[x > 0.0], rel=0.01)
    assert f.min() < -100.0
    assert points_of("way_waves", Setup(car, NO_ODD, Place()), []) is None


def test_a_case_is_a_function_of_seed_and_number():
    def made(number):
        return make_case(draw_plan(5, number, "compound", duration_s=10.0), z_least=0.0)

    one, two, other = made(1), made(1), made(2)
    assert one.truth == two.truth != other.truth
    assert one.vehicle == two.vehicle
    for a, b in ((one.drive, two.drive), (one.held, two.held)):
        assert all(np.array_equal(x.columns[s], y.columns[s]) for x, y in zip(a, b, strict=True) for s in x.columns)
    assert not np.array_equal(one.drive[0].columns["a_x"], one.held[0].columns["a_x"])
    assert len(one.truth["hidden"]) == 2


@pytest.mark.nightly
def test_sizes_are_raised_until_the_drive_shows_them():
    plan = draw_plan(6, 1, "null", duration_s=30.0)._replace(programme="country", noise="white")
    h = draw("payload_mass", np.random.default_rng(1), 0.3)
    vehicle = vehicle_file(plan.car, plan.drivetrain, np.random.default_rng(1))
    small = cases.detectability(plan, vehicle, h)["z"]
    large = cases.detectability(plan, vehicle, enlarged(h, 3.0))["z"]
    assert large == pytest.approx(3.0 * small, rel=0.35)
    raised = make_case(plan._replace(hidden=(h,)), z_least=2.0 * small).truth["hidden"][0]
    assert raised["values"]["delta_mass"] > 1.5 * h.values["delta_mass"]


def test_cars_roads_and_noises_are_all_drawn():
    plans = [draw_plan(1, k, "null") for k in range(60)]
    assert {(p.drivetrain, p.car.is_electric) for p in plans} >= {
        ("rwd", 0.0),
        ("fwd", 0.0),
        ("awd", 0.0),
        ("rwd", 1.0),
    }
    assert {p.noise for p in plans} == set(NOISES)
    assert {p.programme for p in plans} == {"city", "country", "motorway", "staircase", "coast_down"}
    fine, slow, label = build_road("wet", np.random.default_rng(1), 2000.0, Place(depth_left=1.5))
    assert 1e-3 < fine.std() < 0.03
    assert label.max() > 4e-4
    assert np.allclose(slow[:, 2], 1.5 * label[:, 0])
    wheel = measure_one(Error(ring=0.01))
    assert wheel.std() > 2.0 * measure_one(Error()).std()


def measure_one(error):
    rows = np.zeros((2000, len(ROWS)))
    rows[:, ROWS["v_x"]] = 15.0
    for w in WHEELS:
        rows[:, ROWS[f"omega_{w}"]] = 50.0
        rows[:, ROWS[f"angle_{w}"]] = 50.0 * np.arange(2000) * DT
    messages = measure(rows, car_of()[0], {"omega_fl": error}, "white", np.random.default_rng(1))
    return next(m for m in messages if m.name == "wheels").columns["omega_fl"][10:]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blind")
    for kind, first in (("null", 1), ("known", 2), ("unknown", 3)):
        assert make.main([str(folder), "--seed", "1", "--kind", kind, "--first", str(first), "--duration", "15",
                          "--scale", "0.9"]) == 0  # fmt: skip
    return folder


def test_logs_are_read_and_say_nothing(written):
    from aqualog.align.load import load_signals
    from aqualog.config.vehicle import load_vehicle

    folders = sorted(written.glob("case_*"))
    for folder in folders:
        assert sorted(p.name for p in folder.iterdir()) == ["drive.mf4", "held.mf4", "truth.bin", "vehicle.toml"]
        signals = load_signals([folder / "drive.mf4"], vehicle=load_vehicle(folder / "vehicle.toml"))
        assert {"v_x", "a_x", "yaw_rate", "omega_rr", "torque_fl", "steer_angle"} <= set(signals.symbols)
        assert signals.frame.height > 1300
        for path in folder.iterdir():
            if path.suffix != ".toml":  # which has keys of these names
                assert not [n for n in KINDS if n.encode() in path.read_bytes()]
    assert len({(f / "truth.bin").stat().st_size for f in folders}) == 1


def test_no_truth_before_the_verdict(written, tmp_path):
    folder = shutil.copytree(written / "case_0002", tmp_path / "case_0002")
    verdict = folder / "verdict.json"
    with pytest.raises(SealError, match="diagnose first"):
        open_truth(folder, verdict)
    verdict.write_text("nothing", encoding="utf-8")
    with pytest.raises(SealError, match="no JSON"):
        open_truth(folder, verdict)
    verdict.write_text("{}", encoding="utf-8")
    with pytest.raises(SealError, match='no "verdict"'):
        open_truth(folder, verdict)
    elsewhere = tmp_path / "verdict.json"
    elsewhere.write_text('{"verdict": "named"}', encoding="utf-8")
    with pytest.raises(SealError, match="diagnose first"):
        open_truth(folder, elsewhere)
    assert not (tmp_path / LEDGER).exists()
    verdict.write_text('{"verdict": "named"}', encoding="utf-8")
    truth = open_truth(folder, verdict)
    made = make_case(draw_plan(1, 2, "known", scale=0.9, duration_s=15.0), z_least=0.0).truth
    assert truth == json.loads(json.dumps(made))
    assert open_truth(folder, verdict) == truth
    lines = (tmp_path / LEDGER).read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1
    assert set(json.loads(lines[0])) == {"case", "verdict_sha256", "truth_sha256"}
    verdict.write_text('{"verdict": "no_effect"}', encoding="utf-8")
    with pytest.raises(SealError, match="another verdict"):
        open_truth(folder, verdict)


def test_a_seal_is_that_of_its_case(tmp_path):
    one, two = tmp_path / "case_0001", tmp_path / "case_0002"
    for folder in (one, two):
        folder.mkdir()
        (folder / "verdict.json").write_text('{"verdict": "named"}', encoding="utf-8")
    seal_truth(one, {"hidden": []})
    shutil.copy(one / "truth.bin", two / "truth.bin")
    assert b"hidden" not in (one / "truth.bin").read_bytes()
    with pytest.raises(SealError, match="does not belong"):
        open_truth(two, two / "verdict.json")
    with pytest.raises(SealError, match="number of a case"):
        seal_truth(tmp_path, {})


def test_held_back_forms_are_not_for_development(tmp_path):
    with pytest.raises(SystemExit):
        make.main([str(tmp_path), "--seed", "999", "--kind", "unknown", "--held-back"])
    plans = [draw_plan(s, 1, "unknown") for s in range(40)]
    assert not {h.name for p in plans for h in p.hidden} & set(HELD_BACK)
    held = [draw_plan(s, 1, "unknown", held_back=True) for s in range(1000, 1040)]
    assert {h.name for p in held for h in p.hidden} == set(HELD_BACK)


def test_the_world_shares_no_physics_with_the_library_or_another_world():
    allowed = {"aqualog.core.vehicle", "aqualog.core.compiled", "aqualog.io.write_log"}
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [n.name for n in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and node.level == 0 else []
            assert not [n for n in names if n.split(".")[0] in ("aqualog", "tests") and n not in allowed], path.name
            assert not (isinstance(node, ast.ImportFrom) and node.level > 1), path.name
