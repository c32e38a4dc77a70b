"""The law of water from a user's own passes: estimates near the truth, clear errors, and a file that simulates again."""

import math
from dataclasses import replace

import numpy as np
import pytest

import aqualog as aq
from aqualog.config.scenario import load_scenario
from aqualog.core.errors import ConfigError, FitError, SignalError
from aqualog.core.vehicle import Vehicle, WaterNumber, vehicle_toml
from aqualog.model.even_wheel import even_slip
from aqualog.model.published import Condition, full_speed
from aqualog.model.tyre import TYRES, Tyre
from aqualog.trade import water_law
from aqualog.trade.water_law import calibrate_wet, check_known, fit_water
from aqualog.trade.wet_passes import Told, WetPass, Window, passes_of
from tests.both_ways import command
from tests.trade.water_study import drawn, fitted, logs

DAY = 103  # a rear-wheel drive car
KNOWN = {"tread": 1.6, "pressure": 0.0}


@pytest.fixture(scope="module")
def day():
    """Car, true tyre, what is known of the passes, and their signals."""
    car, tyre, p, depth = drawn(DAY)
    return car, tyre, {"tread": 1.6, "pressure": p * 1e-5, "depth": depth * 1e3}, logs(DAY)


@pytest.fixture(scope="module")
def folder(day, tmp_path_factory):
    """The passes as files, and the vehicle file."""
    path = tmp_path_factory.mktemp("wet")
    for k, s in enumerate(day[3]):
        s.frame.write_parquet(path / f"pass{k + 1}.parquet")
    (path / "car.toml").write_text(vehicle_toml(day[0]), encoding="utf-8")
    return path


def names(signals):
    return [f"pass {k + 1}" for k in range(len(signals))]


def test_intervals_hold_the_truth_as_often_as_they_say():
    """95 % intervals: fewer than 6 of 8 would hold once in 170. Of 40 days, from 101 on, 75 of 80 do."""
    fits = [fitted(day) for day in range(101, 105)]
    assert sum(p.ci95[0] <= getattr(t, p.name) <= p.ci95[1] for t, f in fits for p in f.parameters) >= 6


def test_the_numbers_of_a_day_are_found(day):
    car, _, known, signals = day
    found = calibrate_wet(signals, names(signals), car, known)
    assert [p.name for p in found.parameters if p.identified] == ["v_anchor", "contact_exponent"]
    assert len(found.passes) == 8
    assert any(p.v_lost > 0.0 for p in found.passes)
    other = calibrate_wet(signals, names(signals), car, known | {"depth": 2.0 * known["depth"]})
    assert other.parameters == found.parameters
    assert other.notes[1].startswith("the logs' own water depth counts, not the given one: pass 1 2 mm, pass 2 2 mm")


def test_the_logs_own_depth_counts(day):
    car, _, known, signals = day
    for given in (np.nan, 2e-3 * known["depth"]):
        (own,) = passes_of(signals[0], car, "a", Told(given, 1.6e-3, known["pressure"] * 1e5))
        assert own.windows[0].h_w == pytest.approx(known["depth"] * 1e-3, rel=0.1)


@pytest.mark.parametrize("criterion", ["spin-down"])
def test_a_free_wheel_has_no_balance_beyond_its_spin_down(criterion):
    """The slip of an even wheel ends where the published points say that it floats."""
    car, tyre, at = Vehicle(), Tyre(), Condition(1.3, 1.6, 1.9, 4000.0)
    v_full = full_speed(tyre, at, criterion) / 3.6
    v = v_full * np.array([0.6, 0.9, 0.98, 1.04, 1.2])
    one = np.ones(v.size)
    s = even_slip(tyre, car, v, 1.3e-3 * one, 4000.0 * one, p=1.9e5, demand=np.nan * one, scales=np.ones(1))[:, 0]
    assert np.isfinite(s[:3]).all()
    assert np.isnan(s[3:]).all()
    assert (np.diff(s[:3]) < 0.0).all()


def test_dry_road_leaves_the_rolling_resistance_over_the_slope():
    car, one = Vehicle(), np.ones(1)
    s = even_slip(Tyre(), car, 20.0 * one, 1e-6 * one, 4000.0 * one, p=1.9e5, demand=np.nan * one, scales=one)
    assert float(s[0, 0]) == pytest.approx(-car.rolling_resistance / car.slip_slope_f, rel=0.05)


def test_errors_say_what_is_missing(day):
    car, _, known, signals = day
    dry = [
        replace(s, frame=s.frame.drop([c for c in s.frame.columns if c.startswith(("water", "on_w"))])) for s in signals
    ]
    with pytest.raises(SignalError, match=r"no pass over water in the logs; expected on_water, or a water depth"):
        calibrate_wet(dry, names(dry), car, known)
    with pytest.raises(FitError, match=r"2 of 2 passes over water can be used; expected at least 4"):
        calibrate_wet(signals[:2], names(signals[:2]), car, known)
    blind = [replace(s, frame=s.frame.drop("v_x")) for s in signals]
    with pytest.raises(FitError, match=r"0 of 8 passes over water can be used \(pass 1: no velocity \(v_x\)"):
        calibrate_wet(blind, names(blind), car, known)
    bare = [replace(s, frame=s.frame.drop([c for c in s.frame.columns if c.startswith("water")])) for s in signals]
    with pytest.raises(FitError, match=r"no water depth at 4\.0 s"):
        calibrate_wet(bare, names(bare), car, {k: v for k, v in known.items() if k != "depth"})
    with pytest.raises(ConfigError, match="tread and pressure of the tyres not given"):
        check_known({})
    with pytest.raises(ConfigError, match=r'fix "mass" is not known of passes over water; expected tread, pressure'):
        check_known({"mass": 1500.0})
    with pytest.raises(ConfigError, match=r"fix pressure=220; expected a value between 0\.5 and 10 bar"):
        check_known({"tread": 1.6, "pressure": 220.0})


def test_passes_far_below_floating_identify_nothing(day):
    car, _, known, signals = day
    slow = [signals[0]] * 4
    found = calibrate_wet(slow, names(slow), car, known)
    speed = found.get("v_anchor")
    assert not speed.identified
    assert speed.why_not
    assert found.cannot_tell


def test_face_and_command_agree_and_the_file_simulates(day, folder, tmp_path):
    known = day[2]
    files = [folder / f"pass{k}.parquet" for k in range(1, 9)]
    result = aq.calibrate(files, folder / "car.toml", fix=known, wet=True)
    fixes = [x for k, v in known.items() for x in ("--fix", f"{k}={v!r}")]
    out, page = tmp_path / "wet.toml", tmp_path / "page.html"
    args = ("calibrate", "--wet", *files, "--vehicle", folder / "car.toml", *fixes)
    assert result.to_json() + "\n" == command(*args, "--json")[0]
    assert "8 passes over water" in command(*args, "-o", out, "--page", page)[0]
    car = aq.Vehicle.read(out)
    assert set(car.water) == {"v_anchor", "contact_exponent"}
    speed = result.found.get("v_anchor")
    assert car.water["v_anchor"].value == pytest.approx(speed.value, rel=1e-6)
    assert 3.92 * car.water["v_anchor"].sd == pytest.approx(speed.ci95[1] - speed.ci95[0], rel=1e-5)
    assert "passes over water" in page.read_text(encoding="utf-8")
    assert set(result.tables) >= {"parameters", "passes"}
    assert result.plot().data
    (tmp_path / "s.toml").write_text('vehicle = "wet.toml"\nspeed_kmh = 90\ntyre_rear = { contact_exponent = 2.5 }\n')
    made = load_scenario(tmp_path / "s.toml")
    assert made.tyre_front.v_anchor == car.water["v_anchor"].value
    assert made.tyre_rear.v_anchor == car.water["v_anchor"].value
    assert made.tyre_rear.contact_exponent == 2.5


def test_water_in_a_vehicle_file(tmp_path):
    path = tmp_path / "car.toml"
    car = replace(Vehicle(given=frozenset({"name"})), water={"v_anchor": WaterNumber(33.0, 0.5)})
    path.write_text(vehicle_toml(car), encoding="utf-8")
    assert aq.Vehicle.read(path).water == {"v_anchor": WaterNumber(33.0, 0.5)}
    path.write_text("[water]\ncontact_exponent = 3.5\n", encoding="utf-8")
    assert aq.Vehicle.read(path).water == {"contact_exponent": WaterNumber(3.5, 0.0, "data_sheet")}
    path.write_text("[water]\nv_anchr = 30.0\nv_anchor = { sd = 1.0 }\ncontact_exponent = { value = 99.0 }\n")
    with pytest.raises(ConfigError, match=r"v_anchr.*v_anchor.*has no value.*99 is outside"):
        aq.Vehicle.read(path)


def test_a_named_tyre_takes_the_numbers_of_the_car(tmp_path):
    (tmp_path / "car.toml").write_text("[water]\nv_anchor = 31.0\n", encoding="utf-8")
    (tmp_path / "s.toml").write_text('vehicle = "car.toml"\nspeed_kmh = 90\ntyre = "new_summer"\n', encoding="utf-8")
    made = load_scenario(tmp_path / "s.toml")
    assert made.tyre_front == replace(TYRES["new_summer"], v_anchor=31.0)


def test_numbers_between_the_values_of_the_grid(monkeypatch):
    """Passes that show more than the first grid's steps of 2 and 12 %."""
    passes = [WetPass(f"{k}", (Window(25.0 + k, 1e-3, 4e3, math.nan, 0.0, False),)) for k in range(5)]

    def likelihood(windows, vehicle, tyre, p, grid):
        scale, exponent = (((x - m) / s) ** 2 for x, m, s in zip(grid, (0.0337, 1.271), (0.004, 0.02), strict=True))
        return np.broadcast_to(-0.5 * (scale[:, None] + exponent), (4, scale.size, exponent.size))

    monkeypatch.setattr(water_law, "_likelihood", likelihood)
    v_anchor, exponent = fit_water(passes, Vehicle(), Tyre(), p=2e5).parameters
    assert v_anchor.value == pytest.approx(Tyre().v_anchor * math.exp(0.0337), rel=2e-4)
    assert exponent.value == pytest.approx(math.exp(1.271), rel=1e-3)
