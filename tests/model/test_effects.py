"""Functions without a name in the model: tables of knots."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.config.model import dump_model, load_model
from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.model.drawing import slalom_angle
from aqualog.model.effects import EFFECTS, EMPIRICAL
from aqualog.model.scenario import Lane, Scenario, Steering
from aqualog.model.simulate import assemble, drive_truth, simulate
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES
from tests.thesis.passes import SEDAN

HUMP = ((15.0, 0.0), (20.0, 400.0), (25.0, 0.0))
HILL = ((0.0, 0.0), (60.0, 0.04), (120.0, 0.0))
SCENARIO = Scenario(
    SEDAN, duration_s=8.0, speed=((0.0, 12.0), (8.0, 28.0)), lanes=(Lane(2.0, 4.0, depth_left=1e-3, depth_right=1e-3),)
)


def one(name, knots, **values):
    return Model().with_term(Term(EMPIRICAL[name], values, knots=knots))


@pytest.mark.parametrize("name", sorted(EMPIRICAL))
@pytest.mark.parametrize("knots", [(), ((0.0, 0.0), (30.0, 0.0))], ids=["none", "zero"])
@pytest.mark.parametrize("grade", [(), ((0.0, 0.01), (50.0, -0.02))], ids=["flat", "hilly"])
def test_neutral_changes_no_bit(name, knots, grade):
    scenario = replace(SCENARIO, grade=grade, duration_s=4.0)
    base, same = simulate(scenario), simulate(scenario, one(name, knots))
    for a, b in zip(base.measured, same.measured, strict=True):
        np.testing.assert_array_equal(a.t, b.t)
        for column in a.columns:
            np.testing.assert_array_equal(a.columns[column], b.columns[column], err_msg=column)


def test_force_is_there_where_its_knots_say():
    """The force that the wheels need on top, at constant speed, is the table's."""
    for v, force in ((10.0, 0.0), (17.5, 200.0), (20.0, 400.0), (30.0, 0.0)):
        scenario = Scenario(SEDAN, duration_s=6.0, speed=((0.0, v),))
        drives = [drive_truth(assemble(scenario, m)).columns for m in (Model(), one("unexplained_force", HUMP))]
        needed = [np.mean([sum(c[f"true_force_x_{w}"][-500:] for w in ("fl", "fr", "rl", "rr"))]) for c in drives]
        assert needed[1] - needed[0] == pytest.approx(force, abs=1.0)


def test_hill_is_there_where_its_knots_say():
    truth = drive_truth(assemble(SCENARIO, one("unexplained_grade", HILL))).columns
    wanted = np.interp(truth["true_position"], *np.array(HILL).T)
    np.testing.assert_allclose(truth["true_grade"], wanted, atol=5e-5)
    on_slope = drive_truth(assemble(replace(SCENARIO, grade=((0.0, 0.01),)), one("unexplained_grade", HILL))).columns
    np.testing.assert_allclose(
        on_slope["true_grade"], np.interp(on_slope["true_position"], *np.array(HILL).T) + 0.01, atol=5e-5
    )


@pytest.mark.parametrize(
    ("name", "parameter", "value", "field"),
    [
        ("head_wind", "speed", 3.0, "head_wind"), ("aero_drag", "delta_drag_area", 0.2, "drag_area"),
        ("cornering_drag", "coefficient", 0.01, "cornering_drag"), ("load_sensitivity", "delta", 0.1, "load_sensitivity"),
        ("relaxation_length", "length", 0.4, "relaxation_length"), ("tyre_radius_growth", "growth", 2e-6, "radius_growth"),
        ("brake_drag", "torque", 12.0, "brake_drag"),
    ],
)  # fmt: skip
def test_an_effect_adds_its_parameter(name, parameter, value, field):
    """To the quantity of the car, or of the rear axle's wheels alone."""
    where = "r" if EFFECTS[name].places else None
    plain = assemble(SCENARIO)
    with_it = Model().with_term(Term(EFFECTS[name], {parameter: value}, where)).apply(plain)
    gained = np.subtract(getattr(with_it.plant, field), getattr(plain.plant, field))
    assert gained == pytest.approx(value if where is None else np.array([0.0, 0.0, value, value]), rel=1e-9)


def test_two_tables_add_up():
    other = one("unexplained_force", ((10.0, 50.0), (22.0, 100.0)))
    plant = other.apply(one("unexplained_force", HUMP).apply(assemble(SCENARIO))).plant
    v = np.linspace(0.0, 40.0, 200)
    both = np.interp(v, *np.array(HUMP).T) + np.interp(v, [10.0, 22.0], [50.0, 100.0])
    np.testing.assert_allclose(np.interp(v, *plant.drag_over_v.T), both, atol=1e-9)


def test_model_file_reads_back(tmp_path):
    model = (
        one("unexplained_force", tuple((x + 1 / 3, f / 7) for x, f in HUMP))
        .with_term(Term(EMPIRICAL["unexplained_grade"], knots=HILL))
        .with_term(Term(EFFECTS["payload_mass"], {"delta_mass": 12.5}, "r"))
        .with_term(Term(EFFECTS["road_grade"], {"grade": 0.01}))
    )
    path = tmp_path / "model.toml"
    path.write_text(dump_model(model), encoding="utf-8")
    assert load_model(path) == model
    path.write_text('[[term]]\neffect = "unexplained_force"\n', encoding="utf-8")
    assert load_model(path) == Model((Term(EMPIRICAL["unexplained_force"]),))


@pytest.mark.parametrize(
    ("knots", "said"),
    [("3", "line 4: knots = 3 is not a list of pairs"), ("[]", "is not a list of pairs"),
     ("[[1.0, 2.0, 3.0], [2.0, 1.0]]", "is not a list of pairs"),
     ('[[1.0, "a"], [2.0, 1.0]]', "is not a list of pairs"), ("[[1.0, nan], [2.0, 1.0]]", "is not a list of pairs"),
     ("[[1.0, 2.0]]", "1 knots, at least 2"), ("[[2.0, 1.0], [1.0, 1.0]]", "do not rise in v_x"),
     ("[[-2.0, 1.0], [1.0, 1.0]]", "a knot at -2 is outside 0 ... 150 m/s"),
     ("[[2.0, 1.0], [3.0, 1e6]]", "a value of 1e+06 is outside")],
)  # fmt: skip
def test_faulty_knots_are_told(tmp_path, knots, said):
    path = tmp_path / "model.toml"
    path.write_text(f'# a model\n[[term]]\neffect = "unexplained_force"\nknots = {knots}\n', encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_model(path)
    assert said in error.value.line()


def test_knots_only_where_there_is_a_table(tmp_path):
    with pytest.raises(ConfigError, match="no table"):
        Term(EFFECTS["payload_mass"], knots=HUMP)
    path = tmp_path / "model.toml"
    path.write_text('[[term]]\neffect = "payload_mass"\nknots = [[1.0, 2.0], [2.0, 1.0]]\n', encoding="utf-8")
    with pytest.raises(ConfigError, match='unknown key "knots"'):
        load_model(path)
    with pytest.raises(ConfigError, match="do not rise"):
        one("unexplained_force", HUMP[::-1])


def test_no_name_is_taken_twice():
    assert not set(EFFECTS) & set(EMPIRICAL)
    for effect in EMPIRICAL.values():
        assert set(effect.twins) <= set(EFFECTS)
        assert effect.table is not None


def test_a_wheel_that_carries_more_rolls_on_less_radius():
    steering = Steering(slalom_angle(SEDAN, TYRES["worn_summer"], 25.0, 3.0), 4.0)
    setup = assemble(Scenario(SEDAN, duration_s=6.0, speed=((0.0, 25.0), (6.0, 25.0)), steering=steering))
    pressed = setup._replace(plant=setup.plant._replace(radius_loss=np.full(4, 0.02)))
    base, with_it = (drive_truth(s).columns for s in (setup, pressed))
    for i, w in enumerate(WHEELS):
        expected = -0.02 * (base[f"true_load_{w}"] / setup.plant.F_z_ref[i] - 1.0)
        assert np.ptp(expected) > 0.004
        assert base[f"omega_{w}"] / with_it[f"omega_{w}"] - 1.0 == pytest.approx(
            expected, abs=0.1 * np.ptp(expected)
        ), w


def test_a_build_up_shorter_than_a_step_is_none():
    """Slip and wheel would swing against each other between steps."""
    setup = assemble(SCENARIO)
    shorter = setup._replace(plant=setup.plant._replace(relaxation_length=np.full(4, 8e-6)))
    base, short = (drive_truth(s).columns for s in (setup, shorter))
    for w in WHEELS:
        np.testing.assert_allclose(short[f"omega_{w}"], base[f"omega_{w}"], rtol=1e-3)


def test_a_build_up_of_forces_does_not_swing_in_long_steps():
    """A wheel and the slip that its force waits for make an oscillator: steps of 5 ms would feed it below 10 m/s."""
    setup = assemble(Scenario(SEDAN, duration_s=6.0, speed=((0.0, 4.0), (3.0, 8.0), (6.0, 4.0))))
    setup = setup._replace(plant=setup.plant._replace(relaxation_length=np.full(4, 0.1)))
    fine, coarse = (drive_truth(setup, dt=dt) for dt in (1e-3, 5e-3))
    for w in WHEELS:
        expected = np.interp(coarse.t, fine.t, fine.columns[f"omega_{w}"])
        np.testing.assert_allclose(coarse.columns[f"omega_{w}"][40:], expected[40:], atol=0.02)  # from 0.2 s on
