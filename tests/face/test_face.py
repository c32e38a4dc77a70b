"""The package's names: what they are, that they are there, and that they cost nothing until they are used."""

import inspect
import subprocess
import sys
import typing

import pytest

import aqualog as aq
from aqualog.cli.commands import COMMANDS

FACE_OF = {
    "detect": "detect", "inspect": "inspect", "init": "init", "doctor": "doctor", "convert": "convert", "align": "align",
    "slip-slope": "slip_slope", "batch": "Campaign.run", "plan": "Campaign.plan", "bin-slipslope": "Campaign.run",
    "bin-resistance": "Campaign.run", "report": "Campaign.run", "calibrate": "calibrate", "diagnose": "diagnose",
    "evaluate": "evaluate", "simulate": "simulate", "figures": "thesis.figures", "reproduce": "thesis.reproduce",
    "cache": "cache", "campaign": "Campaign.propose", "test": "tyre_test", "validate": "validate", "watch": "watch",
}  # fmt: skip


def test_names():
    assert sorted(aq.__all__) == aq.__dir__()
    assert set(aq.__all__) == {
        "AqualogError", "Campaign", "Drive", "Model", "Signals", "Vehicle", "__version__", "align", "cache",
        "calibrate", "convert", "detect", "diagnose", "doctor", "evaluate", "init", "inspect", "physics", "read", "simulate",
        "slip_slope", "thesis", "tyre_test", "validate", "watch",
    }  # fmt: skip


@pytest.mark.parametrize("name", aq.__all__)
def test_each_name_is_there_and_says_what_it_is(name):
    found = getattr(aq, name)
    assert name == "__version__" or (found.__doc__ and len(found.__doc__) > 20)


@pytest.mark.parametrize("name", [n for n in aq.__all__ if n[0].islower() and n not in ("physics", "thesis")])
def test_functions_are_typed_and_have_an_example(name):
    function = getattr(aq, name)
    hints = function.__annotations__
    assert set(inspect.signature(function).parameters) | {"return"} == set(hints)
    assert name == "cache" or ">>> " in function.__doc__
    assert f"aq.{name}" in function.__doc__ or name in ("cache", "read")


def test_every_command_has_its_function():
    for command in COMMANDS:
        if command == "help":
            continue
        found = aq
        for part in FACE_OF[command].split("."):
            found = getattr(found, part)
        assert callable(found)


def test_importing_costs_nothing():
    code = (
        "import sys, time; before = set(sys.modules); began = time.process_time(); import aqualog; "
        "print(time.process_time() - began); dir(aqualog); print(*sorted(set(sys.modules) - before))"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(3)]
    seconds, loaded = zip(*(r.stdout.split("\n")[:2] for r in runs), strict=True)
    assert min(float(s) for s in seconds) < 0.05
    assert [m for m in loaded[0].split() if m.startswith("aqualog")] == ["aqualog"]
    assert not {"numpy", "polars", "plotly", "typer", "numba"} & set(loaded[0].split())


def test_a_function_keeps_its_name_beside_a_folder_of_the_same_name():
    code = (
        "import aqualog as aq; from aqualog.detect import stream; from aqualog.diagnose import run; import "
        "aqualog.align.load; print(*(callable(getattr(aq, n)) for n in ('detect', 'diagnose', 'align', 'evaluate')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True"] * 4


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'detekt'"):
        aq.detekt  # noqa: B018


def test_records_read_themselves(tmp_path):
    from aqualog.config.model import dump_model
    from aqualog.core.vehicle import vehicle_toml

    car = aq.Vehicle(name="a car", mass=1500.0)
    (tmp_path / "car.toml").write_text(vehicle_toml(car))
    assert aq.Vehicle.read(str(tmp_path / "car.toml")).mass == aq.Vehicle.read(tmp_path / "car.toml").mass == 1500.0
    (tmp_path / "model.toml").write_text(dump_model(aq.Model()))
    assert aq.Model.read(str(tmp_path / "model.toml")) == aq.Model()
    with pytest.raises(aq.AqualogError, match="vehicle file not found"):
        aq.Vehicle.read(tmp_path / "none.toml")


def test_types_are_seen_by_a_checker():
    assert typing.get_type_hints(aq.Vehicle.read)["return"] is aq.Vehicle


def test_functions_of_the_thesis_go_before_modules_of_its_folder():
    code = "import aqualog as aq, types; aq.thesis; import aqualog.thesis.figures; assert isinstance(aq.thesis.figures, types.FunctionType)"
    subprocess.run([sys.executable, "-c", code], check=True)
