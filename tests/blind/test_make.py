"""Sealed cases of the simulated worlds: what stands in a folder, and how visible its effect is."""

from itertools import islice

import numpy as np
import polars as pl
import pytest

import aqualog as aq
from aqualog.core.vehicle import vehicle_toml
from tests.blind import make
from tests.blind.injected.noise import Noise, added
from tests.blind.plain import CAR, drive
from tests.blind.sealed import open_truth
from tests.blind.traces import detectability, residuals
from tests.blind.world.effects import UNKNOWN
from tests.blind.world.sensors import MEASURED


def test_an_offset_in_white_noise_has_the_length_that_theory_gives():
    rng = np.random.default_rng(1)
    n, sigma, size = 4000, 0.02, 0.004
    noise = {"force": sigma * rng.standard_normal(n)}
    flat = {"force": np.zeros(n)}
    z = detectability({"force": np.full(n, size)}, flat, noise)
    assert z == pytest.approx(size / sigma * np.sqrt(n), rel=0.15)
    slow = {"force": np.convolve(noise["force"], np.ones(40) / np.sqrt(40.0), "same")}  # as large, but slow
    assert detectability({"force": np.full(n, size)}, flat, slow) < 0.5 * z


def test_residuals_of_a_plain_drive_are_its_noise_and_a_load_shows_in_the_force_alone():
    calm, loaded = (residuals(drive(5, "mixed", "white", 60.0, payload_mass=m), CAR) for m in (0.0, 300.0))
    assert np.nanstd(calm["force"]) < 0.2
    parts = {n: detectability({n: loaded[n]}, {n: calm[n]}, {n: calm[n]}) for n in ("force", "kinematic", "slip_fl")}
    assert parts["force"] > 5.0 * max(parts["kinematic"], parts["slip_fl"])


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("of", "hidden"), [((2, "mixed", "ou1"), {}), ((20, "stop_and_go", "white"), {}), ((24,), {"aero_drag": 0.15})]
)
def test_a_plain_drive_has_the_hidden_cause_and_no_other(tmp_path, of, hidden):
    drive(*of, **hidden).write_parquet(log := tmp_path / "log.parquet")
    (car := tmp_path / "car.toml").write_text(vehicle_toml(CAR), encoding="utf-8")
    found = aq.diagnose(log, car).document
    assert found["verdict"] == ("named" if hidden else "no_effect")
    for cause, (effect, size) in zip(found["causes"], hidden.items(), strict=True):
        low, high = cause["parameters"]["delta_drag_area"]["ci95"]
        assert (cause["effect"], low < size < high < low + 0.25 * size) == (effect, True)


def case_of(folder, case):
    make.write(folder, case, "plain", 4)
    (folder / "verdict.json").write_text("{}")
    return open_truth(folder)


def test_plain_cases(tmp_path):
    rng = np.random.default_rng(7)
    for index, kind in enumerate(("null", "known", "compound")):
        truth = case_of(tmp_path / kind, make.plain_case(index, 4, kind, 20.0, rng))
        assert (truth["kind"], len(truth["effects"])) == (kind, index)
        assert all(e["detectability"] > 0.0 for e in truth["effects"])
        frames = [pl.read_parquet(tmp_path / kind / f"{n}.parquet") for n in ("drive", "held")]
        assert frames[0].columns == frames[1].columns
        assert not frames[0]["v_x"].equals(frames[1]["v_x"])
    with pytest.raises(SystemExit, match="no unknown forms"):
        make.plain_case(0, 4, "unknown", 20.0, rng)


@pytest.mark.parametrize("kind", ["null", "known", "unknown", "compound"])
def test_no_two_seeds_share_a_drive(kind):
    seeds = [{s.seed for s in islice(make.specs(kind, seed), 400)} for seed in (3801, 3802, 3803)]
    assert len(set().union(*seeds)) == 3 * 400


def test_magic_case_of_a_form_says_how_it_acts():
    spec = next(s for s in make.specs("unknown", 0) if s.hidden[0].effect == "speed_hump")
    frame, held, vehicle, truth = make.magic(spec, "unknown", 20.0)
    assert frame.height == held.height == 2000
    assert (truth["unknown"]["mechanism"], truth["unknown"]["depends_on"]) == ("force", ["v_x"])
    assert truth["effects"] == []
    points, bump = truth["unknown"]["points"], truth["unknown"]["parameters"]
    away = (np.array(points["x"]) - bump["centre"]) / bump["width"]
    assert (points["unit"], points["f"]) == ("N", pytest.approx(bump["force"] * np.exp(-0.5 * away**2)))
    assert vehicle.mass > 0.0
    assert set(UNKNOWN) == {*make.FORMS, "hills"}


def test_world_with_measured_noise_has_that_noise_and_no_other(monkeypatch, tmp_path):
    size = 0.3
    piece = {"a_x": size * np.random.default_rng(8).standard_normal(900)}
    monkeypatch.setattr(make, "noise_source", lambda *_: [Noise("rav4", 0.01, piece)])
    spec = next(make.specs("null", 1))
    frame, _, _, truth = make.realnoise(spec, "null", 20.0, tmp_path)
    assert truth["noise"].startswith("measured ")
    jumps = np.diff(frame["a_x"].to_numpy())
    assert np.std(jumps) == pytest.approx(size * np.sqrt(2.0), rel=0.1)
    assert np.std(np.diff(frame["v_x"].to_numpy(), 2)) < 1e-3
    assert {"a_x", "v_x"} <= set(MEASURED)
    assert added({"v_x": np.ones(3)}, [Noise("rav4", 0.01, piece)], 0.01, np.random.default_rng(1))["v_x"].all()
