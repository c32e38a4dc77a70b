"""Model and scenario files, and a short simulation of what they say."""

import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from aqualog.config.model import dump_model, load_model
from aqualog.config.scenario import load_scenario
from aqualog.core.errors import ConfigError
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import simulate
from aqualog.model.term import Model
from tests.fuzz.registry import Target, add
from tests.fuzz.settings_files import check_error, folder_with, loaded

_SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
_VEHICLE = (_SAMPLES / "vehicle.toml").read_bytes()
_SHORT_S = 1.0

_MODEL = b"""[[term]]
effect = "payload_mass"
where = "r"
delta_mass = 150.0
[[term]]
effect = "tyre_radius"
where = "fl"
delta = -0.01
[[term]]
effect = "unexplained_force"
knots = [[0.0, 0.0], [10.0, 120.0], [40.0, -50.0]]
[[term]]
effect = "pressure_loss"
where = "left"
radius = 0.01
slope = 0.2
start = 3.0
duration = 10.0
[[term]]
effect = "signal_delay"
where = "omega"
delay = 0.02
[[term]]
effect = "uneven_water"
where = "right"
depth_gain = 1.5
"""
_SCENARIO = b"""vehicle = "vehicle.toml"
tyre_front = "worn_summer"
tyre_rear = { base = "worn_summer" }
pressure_front_bar = 2.1
pressure_rear_bar = 2.3
load_rear_kg = 100.0
duration_s = 6.0
sample_rate_hz = 50
seed = 11
profile = [[0.0, 60.0], [2.0, 90.0], [5.0, 80.0]]
sensors = "esc"
grade_profile = [[0.0, 0.0], [50.0, 3.0]]
brake_profile = [[0.0, 0.0], [3.0, 200.0], [3.5, 0.0]]
wind_profile = [[0.0, 0.0], [4.0, 20.0]]
brakes = "antilock"
[[lane]]
start_m = 5.0
end_m = 60.0
water_depth_mm = 2.0
surface = "asphalt"
[[kick]]
at_m = 12.0
torque_nm = 300.0
load_n = 500.0
side = "left"
[[fault]]
signal = "omega_fl"
start_s = 0.2
end_s = 0.4
kind = "missing"
[steering]
amplitude_deg = 1.5
period_s = 2.0
"""


@cache
def models() -> dict[str, bytes]:
    """Several terms, and the base model."""
    return {"terms": _MODEL, "one": b'[[term]]\neffect = "aero_drag"\ndelta_drag_area = 0.1\n'}


@cache
def scenarios() -> dict[str, bytes]:
    """The sample's, and one with most keys."""
    return {"sample": (_SAMPLES / "scenario.toml").read_bytes(), "full": _SCENARIO}


@cache
def _drive() -> Scenario:
    with folder_with({"vehicle.toml": _VEHICLE, "scenario.toml": _SCENARIO}) as folder:
        return replace(load_scenario(folder / "scenario.toml"), duration_s=_SHORT_S)


def _simulated(scenario: Scenario, model: Model) -> None:
    """What the sensors show is a number, wherever they show something."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            found = simulate(scenario, model)
    except ConfigError as error:
        check_error(error)
        return
    for group in found.measured:
        assert np.isfinite(group.t).all(), f"{group.name} has times that are none"
        for name, values in group.columns.items():
            assert len(values) == len(group.t), f"{name} has {len(values)} values at {len(group.t)} times"
            assert not np.isinf(values).any(), f"{name} is infinite"
    for name, values in found.truth.columns.items():
        assert not np.isinf(values).any(), f"{name} is infinite"
    for name in (
        "true_v_x",
        "true_v_y",
        "true_position",
        "true_grade",
    ):  # others are told where there is something to tell
        assert np.isfinite(found.truth.columns[name]).all(), f"{name} is no number"


def model(data: bytes) -> None:
    """Read a model, write it again, and simulate a second with it."""
    with folder_with({"model.toml": data}) as folder:
        found = loaded(load_model, folder / "model.toml")
    if found is None:
        return
    with folder_with({"model.toml": dump_model(found).encode()}) as again:
        assert load_model(again / "model.toml") == found, "written and read again it is another"
    _simulated(_drive(), found)


def scenario(data: bytes) -> None:
    """Read a scenario and simulate its first second."""
    with folder_with({"vehicle.toml": _VEHICLE, "scenario.toml": data}) as folder:
        found = loaded(load_scenario, folder / "scenario.toml")
    if found is not None:
        _simulated(replace(found, duration_s=min(found.duration_s, _SHORT_S)), Model())


add("model", Target("model files, and a simulation with them", models, model, is_text=True))
add("scenario", Target("scenario files, and their simulation", scenarios, scenario, is_text=True))
