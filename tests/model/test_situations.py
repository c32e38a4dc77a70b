"""The catalogue of situations, and what the simulator needs for it: neutral when absent, physical when there."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import KEYS
from aqualog.model.effects import EFFECTS
from aqualog.model.log import as_signals
from aqualog.model.programme import situations
from aqualog.model.scenario import SURFACES, Kick, Lane, Scenario
from aqualog.model.sensors import ESC, IDEAL, SensorFault
from aqualog.model.simulate import simulate
from aqualog.model.situations import SCORING_POOL, SITUATIONS, TUNING_POOL, draw
from aqualog.model.term import Model, Term
from aqualog.physics.load import G
from tests.thesis.passes import SEDAN

SLOW = 25.0  # [m/s]


def drive(model=None, **kw):
    s = Scenario(SEDAN, **{"sensors": IDEAL, "duration_s": 6.0, "speed": ((0.0, SLOW),), **kw})
    return dict(simulate(s, model or Model()).truth.columns)


def brake(demand, at=2.0):
    torque = demand * SEDAN.mass * G * SEDAN.r_e_f
    return ((at, 0.0), (at + 0.2, torque), (at + 20.0, torque))


def test_catalogue():
    kinds = [s.kind for s in SITUATIONS.values()]
    assert kinds.count("aquaplaning") >= 9
    assert kinds.count("nuisance") >= 28
    for name, s in SITUATIONS.items():
        assert s.name == name
        assert s.title
    with pytest.raises(ConfigError, match="no situation"):
        draw("snowy", 1, TUNING_POOL)


def test_pools_share_nothing():
    a, b = TUNING_POOL, SCORING_POOL
    for of in ("vehicles", "tyres", "depths", "pressures"):
        assert not set(map(repr, getattr(a, of))) & set(map(repr, getattr(b, of))), of
    assert {v.drivetrain for v in a.vehicles} == {v.drivetrain for v in b.vehicles} == {"rwd", "fwd", "awd"}
    for name in SITUATIONS:
        assert draw(name, 3, a).scenario.seed != draw(name, 3, b).scenario.seed


@pytest.mark.parametrize("name", SITUATIONS)
def test_a_seed_is_a_drive(name):
    one, same, other = draw(name, 5, TUNING_POOL), draw(name, 5, TUNING_POOL), draw(name, 6, TUNING_POOL)
    assert one.scenario == same.scenario
    assert one.believed == same.believed
    assert one.scenario != other.scenario
    assert 10.0 <= one.scenario.duration_s <= 130.0


@pytest.mark.parametrize("name", SITUATIONS)
@pytest.mark.parametrize(
    "pool", [TUNING_POOL, pytest.param(SCORING_POOL, marks=pytest.mark.nightly)], ids=["tuning", "scoring"]
)
def test_wheels_float_where_they_should(name, pool):
    d = draw(name, 11, pool)
    c = simulate(d.scenario, d.model).truth.columns
    contact = np.array([c[f"true_contact_{w}"] for w in WHEELS])
    assert np.isfinite(c["v_x"]).all()
    if d.kind == "aquaplaning":
        assert contact.min() < 0.9
        assert contact[:, 500].min() == 1.0  # dry before the lane
        assert c["on_water"].any()
    else:
        assert contact.min() == 1.0
        assert not np.any(c.get("on_water", 0.0))


def test_the_vehicle_file_is_a_little_wrong():
    cars = [draw("dry_cruise", seed, TUNING_POOL) for seed in range(300)]
    for name, rms in (("mass", 0.03), ("r_e_f", 0.002), ("rolling_resistance", 0.05), ("drag_area", 0.05)):
        error = [getattr(d.believed, name) / getattr(d.scenario.vehicle, name) - 1.0 for d in cars]
        assert np.std(error) == pytest.approx(rms, rel=0.15)
        assert abs(np.mean(error)) < 0.3 * rms
    assert cars[0].believed.given >= set(KEYS)
    assert not cars[0].believed.tie_rod


def test_programme():
    runs = situations()
    assert {r.manoeuvre for r in runs} == set(SITUATIONS)
    trailer = next(r for r in runs if r.manoeuvre == "trailer")
    assert [t.effect.name for t in trailer.model.terms] == ["trailer"]
    assert trailer.vehicle.mass != trailer.scenario.vehicle.mass


def test_same_surface_on_both_sides_is_one_surface():
    whole = Lane(2.0, 5.0, surface=SURFACES["gravel"])
    a, b = drive(lanes=(whole,)), drive(lanes=(replace(whole, surface_right=SURFACES["gravel"]),))
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_split_friction_is_one_sided():
    lane = Lane(2.0, 5.0, surface=SURFACES["ice"], surface_right=SURFACES["asphalt"])
    c = drive(lanes=(lane,))
    at = 3000
    assert c["true_mu_max_fl"][at] == pytest.approx(0.12)
    assert c["true_mu_max_rl"][at] == pytest.approx(0.12)
    assert c["true_mu_max_fr"][at] == pytest.approx(SEDAN.mu_max)


@pytest.mark.parametrize("surface", ["asphalt", "damp", "snow"])
def test_antilock_modulates_and_does_not_lock(surface):
    lanes = (Lane(0.0, 99.0, surface=SURFACES[surface]),)
    mu = SURFACES[surface].mu or SEDAN.mu_max
    plain = drive(lanes=lanes, brake_torque=brake(1.5 * mu), speed=((0.0, 30.0),))
    c = drive(lanes=lanes, brake_torque=brake(1.5 * mu), speed=((0.0, 30.0),), antilock=True)
    braking = (np.arange(6001) > 2500) & (c["v_x"] > 5.0)
    assert min(plain[f"true_slip_{w}"][braking].min() for w in WHEELS) < -0.95
    for w in WHEELS:
        slip = c[f"true_slip_{w}"][braking]
        assert slip.min() > -0.6
        crossed = np.count_nonzero(np.diff((slip < -0.08).astype(int)) == 1)
        assert 2.0 < crossed / (braking.sum() * 1e-3) < 12.0, w  # a cycle of 3 to 10 Hz
    mean = (c["v_x"][braking][0] - c["v_x"][braking][-1]) / (braking.sum() * 1e-3)
    assert mean > 0.75 * mu * G
    assert c["brake_pressure"][braking].std() < 1e3  # the driver's foot knows nothing of it


def test_a_kerb_hits_front_then_rear():
    kick = Kick(50.0, 0.4, "right", torque=310.0, load=3000.0)  # 1 kN at r_e
    c, calm = drive(kicks=(kick,)), drive()
    hit = {w: np.flatnonzero(np.abs(c[f"true_load_{w}"] - calm[f"true_load_{w}"]) > 1000.0) for w in ("fr", "rr")}
    assert c["true_position"][hit["fr"][0]] == pytest.approx(50.0, abs=0.4)
    assert c["true_position"][hit["rr"][0]] == pytest.approx(50.0 + SEDAN.wheelbase, abs=0.4)
    assert np.abs(c["true_load_fl"] - calm["true_load_fl"]).max() < 300.0
    assert np.abs(c["omega_fr"] - calm["omega_fr"]).max() > 0.3


def test_shares_of_the_drive_reach_the_wheels():
    ramp = ((0.0, 20.0), (6.0, 32.0))
    c = drive(speed=ramp, drive_share=((0.0, 1.0), (3.0, 1.0), (3.1, 0.0), (3.5, 0.0), (3.6, 1.2), (4.0, 1.0)))
    torque = sum(c[f"torque_{w}"] for w in WHEELS)
    assert abs(torque[3300]) < 1.0
    assert torque[3600] > 1.1 * torque[2900]


def test_a_head_wind_costs_torque():
    calm, gust = drive(), drive(wind=((0.0, 0.0), (2.0, 0.0), (2.01, 10.0)))
    assert gust["a_x"][2012] == pytest.approx(-0.137, abs=0.02)  # 0.5 rho A (35^2 - 25^2) / m, before the driver acts
    base = drive(wind=((0.0, 0.0),), drive_share=((0.0, 1.0),))
    for name in calm:
        np.testing.assert_array_equal(calm[name], base[name], err_msg=name)


def test_a_trailer_is_pulled_along_and_does_not_load_the_axles():
    tow = Model((Term(EFFECTS["trailer"], {"mass": 800.0, "delta_drag_area": 1.0}),))
    ramp = ((0.0, 20.0), (6.0, 26.0))
    alone, towing = drive(speed=ramp), drive(tow, speed=ramp)
    ratio = sum(towing[f"torque_{w}"][4000] for w in WHEELS) / sum(alone[f"torque_{w}"][4000] for w in WHEELS)
    assert 1.3 < ratio < 1.9
    load = sum(towing[f"true_load_{w}"] for w in WHEELS)
    np.testing.assert_allclose(load, SEDAN.mass * G, rtol=1e-9)


def test_a_tyre_that_loses_air_turns_faster():
    loss = Model((Term(EFFECTS["pressure_loss"], {"radius": 0.01, "start": 1.0, "duration": 2.0}, "fl"),))
    c = drive(loss)
    ratio = c["omega_fl"] / c["omega_fr"]
    assert ratio[900] == pytest.approx(1.0, abs=1e-9)
    assert ratio[2000] == pytest.approx(1.005, abs=2e-4)
    assert ratio[5000] == pytest.approx(1.0 / 0.99, abs=2e-4)


def test_faults_of_sensors():
    faults = (SensorFault("omega_fr", 2.0, 3.0), SensorFault("esc", 4.0, 4.5), SensorFault("gnss", 1.0, 2.0, "frozen"))
    plain = Scenario(SEDAN, duration_s=6.0, speed=((0.0, 20.0), (6.0, 30.0)))
    whole = as_signals(simulate(plain)).frame
    frame = as_signals(simulate(replace(plain, sensors=replace(ESC, faults=faults)))).frame
    lost = frame["omega_fr"].is_null()
    assert lost.slice(205, 90).all()
    assert lost.sum() <= 101
    assert frame["a_x"].is_null().slice(405, 40).all()
    assert frame["yaw_rate"].is_null().slice(405, 40).all()
    assert frame["v_x"].slice(110, 80).n_unique() == 1
    kept = ["omega_fl", "torque_rl", "steer_angle"]
    assert frame.select(kept).equals(whole.select(kept))
    assert frame.filter(pl.col("t") < 0.9).select(pl.exclude("a_x")).height == 90
