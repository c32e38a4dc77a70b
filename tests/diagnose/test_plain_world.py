"""Drives of a simulator whose tyres, transients and curves are of another form: no false names, the right sizes."""

import pytest

from aqualog.align.load import load_signals
from aqualog.config.vehicle import load_vehicle
from aqualog.core.vehicle import vehicle_toml
from aqualog.diagnose.run import Options, diagnose
from tests.blind import plain

OPTIONS = Options(surrogates=9, views=False, consequences=False)


def diagnosed(folder, seed, *of, **hidden):
    log, car = folder / "log.parquet", folder / "car.toml"
    plain.drive(seed, *of, **hidden).write_parquet(log)
    car.write_text(vehicle_toml(plain.CAR), encoding="utf-8")
    vehicle = load_vehicle(car)
    return diagnose([("log", load_signals([log], vehicle=vehicle))], vehicle, options=OPTIONS)


@pytest.mark.parametrize(("seed", "programme", "noise"), [(2, "mixed", "ou1"), (20, "stop_and_go", "white")])
@pytest.mark.nightly
def test_nothing_hidden_nothing_found(tmp_path, seed, programme, noise):
    assert diagnosed(tmp_path, seed, programme, noise).verdict == "no_effect"


@pytest.mark.parametrize(("effect", "parameter", "value"), [("aero_drag", "delta_drag_area", 0.15)])
@pytest.mark.nightly
def test_what_is_hidden_is_named_with_its_size(tmp_path, effect, parameter, value):
    found = diagnosed(tmp_path, 24, **{effect: value})
    assert found.verdict == "named"
    (cause,) = found.causes
    assert cause.effect == effect
    size = cause.parameters[parameter]
    assert size.low < value < size.high
    assert size.high - size.low < 0.25 * value
