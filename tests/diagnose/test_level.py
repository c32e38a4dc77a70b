"""The diagnosis on campaign level: expectation, scatter, family-wise test, naming on a small simulated campaign."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aqualog.campaign.definition import Run, with_load
from aqualog.campaign.measure import measure
from aqualog.core.intervals import chi2_log_p
from aqualog.diagnose.campaign import diagnose_campaign, refit, run
from aqualog.diagnose.campaign.expect import Driven, respond
from aqualog.diagnose.campaign.passes import expected_values, passes_of
from aqualog.diagnose.campaign.refit import fit
from aqualog.diagnose.run import Options
from aqualog.diagnose.search import DOUBT
from aqualog.diagnose.unexplained import MOST
from aqualog.model.effects import EFFECTS
from aqualog.model.log import as_signals
from aqualog.model.programme import SEDAN
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth, simulate
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES
from aqualog.physics.load import wheel_loads
from aqualog.physics.traction import traction_coefficient
from tests.blind.level_world import CAR, Hidden, campaign_of, world

CAR_FILE = Path("car.toml")


def term(name, where=None, **values):
    return Term(EFFECTS[name], values, where)


def even(kmh=80.0, depth=1.3e-3):
    lane = Lane(0.0, 1e9, depth_left=depth, depth_right=depth, irregularity_left=0.0, irregularity_right=0.0)
    return Scenario(
        SEDAN, TYRES["worn_summer"], TYRES["worn_summer"], duration_s=12.0, speed=((0.0, kmh / 3.6),), lanes=(lane,),
        sensors=IDEAL, water_scatter=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    "model",
    [
        Model(),
        Model((term("contact_loss", "r", gain=1.4),)),
        Model((term("water_drag", gain=1.5),)),
        Model((term("slip_stiffness", "r", gain=0.7),)),
        Model((term("track_clearing", delta_film=1e-4),)),
        Model((term("uneven_water", "left", depth_gain=0.6, irregularity=0.0),)),
    ],
)
def test_steady_expectation_is_where_the_simulation_settles(model):
    setup = assemble(even(), model)
    truth = drive_truth(setup)
    last = {k: x[-1:] for k, x in truth.columns.items()}
    plant = setup.plant
    F_z = wheel_loads(
        last["a_x"], np.zeros(1), mass=plant.mass, l_f=plant.l_f, l_r=plant.l_r, h_cg=plant.h_cg, track=plant.track
    )
    wheels = ("fl", "fr", "rl", "rr")
    mu = np.stack([
        traction_coefficient(last[f"torque_{w}"], F_z[i], np.zeros(1), arm=SEDAN.arm(w), inertia=SEDAN.inertia(w),
                             r_w=SEDAN.rolling_resistance)
        for i, w in enumerate(wheels)
    ])  # fmt: skip
    driven = Driven(last["v_x"], last["a_x"], mu)
    found = respond([setup], np.zeros(1, dtype=np.int64), np.ones(1, dtype=bool), driven)
    for i, w in enumerate(wheels):
        assert found.contact[i, 0] == pytest.approx(last[f"true_contact_{w}"][0], abs=2e-3)
    for i, w in ((2, "rl"), (3, "rr")):
        # the record's slip is over v_x, the expectation's over the rim
        s = last[f"true_slip_{w}"][0]
        assert found.slip[i, 0] == pytest.approx(s / (1.0 + s), rel=0.02)
    water = sum(last[f"true_water_torque_{w}"][0] / SEDAN.arm(w) for w in wheels) + last["true_wave_drag"][0]
    assert found.resistance[0] == pytest.approx(water / plant.mass, rel=0.01)


@pytest.mark.parametrize(
    ("x", "dof", "p"), [(3.841459, 1, 0.05), (5.991465, 2, 0.05), (9.487729, 4, 0.05), (16.26624, 3, 0.001)]
)
def test_tail_of_chi_squared(x, dof, p):
    assert chi2_log_p(x, dof) == pytest.approx(-np.log10(p), abs=1e-4)


def test_scatter_of_runs_is_found_beside_the_sizes_of_columns():
    rng = np.random.default_rng(3)
    sigma = np.array([[4.0, 1.5], [1.5, 1.0]])
    x = rng.standard_normal((400, 2, 2))
    y = x @ np.array([2.0, -1.0]) + rng.multivariate_normal(np.zeros(2), sigma, 400)
    y[::5, 0] = np.nan
    found = fit(y, np.zeros((400, 2, 0)), np.zeros_like(y), x)
    assert found.size == pytest.approx([2.0, -1.0], abs=0.2)
    ratio = found.sigma / sigma
    assert np.all((ratio > 0.65) & (ratio < 1.2)), found.sigma  # heavy tails take some of a normal's spread


def simulated(model, seed, runs=40):
    cases = [("worn_summer", 1.3e-3), ("worn_summer", 0.8e-3), ("very_worn_summer", 1.3e-3), ("worn_summer", 2.0e-3)]
    rows = []
    for k in range(runs):
        tyre, depth = cases[k % 4]
        v, a = (65.0, 75.0, 85.0, 95.0)[k // 4 % 4] / 3.6, (0.0, 0.8, 0.4)[k % 3]
        span = (4.0, 8.0)
        lane = Lane(*span, depth_left=0.6 * depth, depth_right=depth)
        speed = ((0.0, v - 6.0 * a), (10.0, v + 4.0 * a))
        s = Scenario(SEDAN, TYRES[tyre], TYRES[tyre], duration_s=10.0, seed=1000 * seed + k, speed=speed, lanes=(lane,))
        values = {
            "tyre": tyre, "pressure_front_bar": 1.9, "pressure_rear_bar": 1.9, "water_depth_mm": depth * 1e3,
            "water_depth_left_mm": 0.6 * depth * 1e3,
        }  # fmt: skip
        car = with_load(SEDAN, Run((), CAR_FILE, None, span, values))
        samples = measure(as_signals(simulate(s, model), vehicle=car, truth=False), car).samples
        rows.append((f"run{k}", CAR_FILE, values, span, samples))
    return campaign_of(rows, {CAR_FILE: SEDAN})


@pytest.fixture(scope="module")
def cleared():
    return simulated(Model((term("track_clearing", delta_film=1.2e-3),)), 5)


def test_track_clearing_is_the_answer(cleared, monkeypatch):
    taken = []
    monkeypatch.setattr(run, "estimates", lambda *given: taken.append(given) or refit.estimates(*given))
    found = diagnose_campaign(cleared, options=Options(surrogates=19))
    (cause,) = found.causes
    assert cause.key == "track_clearing"
    # a check that fails leaves less than a name has
    assert cause.probability >= (0.95 if found.verdict == "named" else 0.9)
    size = cause.parameters["delta_film"]
    assert 6e-4 < size.value < 1.8e-3
    assert size.low < 1.2e-3 < size.high
    # a car's response is never quite the simulator's
    given, k = next((g, e.index(size)) for g in taken if size in (e := refit.estimates(*g)))
    monkeypatch.setattr(refit, "DOUBT", 0.0)
    narrow = refit.estimates(*given)[k]
    own = math.sqrt((size.high - size.value) ** 2 - (narrow.high - narrow.value) ** 2)
    assert own / size.value == pytest.approx(2.0 * DOUBT, rel=0.05)
    assert any(c.startswith("slip_slope_r") for c in cause.explains)
    # a law of water that is known roughly predicts runs left out about as well
    assert found.gain.log_score > 0.0
    assert found.verdict == ("named" if found.gain.low > 0.0 else "cannot_tell")


def test_nothing_hidden_is_told_as_nothing():
    data = simulated(Model(), 6)
    found, again = (diagnose_campaign(data, options=Options(surrogates=39)) for _ in range(2))
    assert (again.sentence, again.significance) == (found.sentence, found.significance)
    assert found.verdict == "no_effect", found.sentence
    assert found.causes == ()
    shown = {(x.effect, x.where): x.size for x in found.limits}
    assert 0.4 < shown["contact_loss", None] < 2.0  # no law of water is known better than to 0.4
    assert 0.0 < shown["track_clearing", None] < 5e-4


@pytest.mark.parametrize("hidden", [Hidden(drag={"f": 1.4, "r": 1.4}), Hidden(contact={"f": 1.4, "r": 1.4})])
def test_another_law_of_water_is_no_effect(hidden):
    """Sources know lost contact and drag within a factor of two."""
    assert diagnose_campaign(world(43, hidden), options=Options(surrogates=39)).verdict == "no_effect"


def test_a_hump_of_no_effect_is_an_unknown_form():
    data = world(119, Hidden(hump=0.08))
    found = diagnose_campaign(data, options=Options(surrogates=99))
    assert found.verdict == "unexplained", found.sentence
    assert found.causes == ()
    form = found.remainders[0]
    assert (form.mechanism, form.depends_on) == ("resistance", ("v_x",))
    assert form.probability == MOST
    assert abs(3.6 * form.x[np.nanargmax(form.f), 0] - 78.0) < 5.0
    assert np.nanmax(form.low) > 0.02


def test_few_runs_are_not_testable():
    data = world(3, runs=6)
    found = diagnose_campaign(data)
    assert found.verdict == "not_testable"
    assert "at least 12" in found.notes[0]


def test_unknown_tyres_are_left_out_and_told():
    data = world(3, runs=16)
    strange = [replace(i, run=replace(i.run, values={**i.run.values, "tyre": "unheard of"})) for i in data.runs[:3]]
    data.runs = (*strange, *data.runs[3:])
    passes = passes_of(data)
    (why,) = (w for w in passes.left_out if w.startswith("tyre not known to the model: unheard of, it knows "))
    assert passes.left_out[why] == 3
    assert "worn_summer" in why
    assert len(passes.told) == len(data.runs) - sum(passes.left_out.values())


def test_another_world_shows_its_effect_in_the_right_channel():
    plain, dragged = (passes_of(world(4, h, runs=24, car=CAR)) for h in (Hidden(), Hidden(drag={"f": 1.5, "r": 1.5})))
    change = [np.nanmean(p.values - expected_values(p, Model())[0], axis=0) for p in (plain, dragged)]
    assert abs(change[0][-1]) < 0.01
    assert change[1][-1] > 0.02
