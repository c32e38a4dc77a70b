"""Thresholds files as `detect --thresholds` takes them."""

import re

import pytest

from aqualog.config.thresholds import joint_text, load_settings
from aqualog.core.errors import ConfigError
from aqualog.detect.registry import BY_NAME
from aqualog.detect.thresholds import DEFAULT, Thresholds

TEXT = """[thresholds]
resistance = 0.3
[joint_cusum]
third = "variance"
with_slope = false
weights = { resistance = 0.5, spin_up = 2.0 }
"""


def written(tmp_path, text):
    path = tmp_path / "thresholds.toml"
    path.write_text(text)
    return path


def test_what_is_set_and_what_is_left(tmp_path):
    settings = load_settings(written(tmp_path, TEXT))
    assert settings.thresholds == Thresholds(resistance=0.3)
    p = settings.joint_cusum
    assert (p.third, p.with_slope, p.gated) == ("variance", False, True)
    assert p.weights == (2.0, 1.0, 0.5, 1.0, 1.0)
    assert load_settings(written(tmp_path, "")).thresholds == DEFAULT
    assert load_settings(written(tmp_path, joint_text(p))).joint_cusum == p
    assert joint_text(load_settings(written(tmp_path, "")).joint_cusum) == ""


@pytest.mark.parametrize(
    ("text", "told"),
    [("[thresholds]\nresistence = 0.3\n", "resistance"), ("[thresholds]\nresistance = -1\n", "resistance"),
     ("[joint_cusum]\nthrid = 'variance'\n", "third"), ("[joint_cusum]\nthird = 'spin'\n", '"variance"'),
     ("[joint_cusum]\ngated = 1\n", "true or false"),
     ("[joint_cusum]\nweights = { resistence = 1.0 }\n", "resistance"), ("[joint_cusum]\nweights = 3\n", "table"),
     ("joint_cusum = 3\n", "not a table")],
)  # fmt: skip
def test_faults_are_told(tmp_path, text, told):
    with pytest.raises(ConfigError, match=r"thresholds\.toml") as error:
        load_settings(written(tmp_path, text))
    assert told in error.value.line()


def test_every_threshold_has_unit_and_meaning_and_bounds():
    for name, value in DEFAULT.items():
        assert BY_NAME[name].unit
        with pytest.raises(ConfigError, match=re.escape(BY_NAME[name].meaning)):
            Thresholds(**{name: 0.0})
        assert DEFAULT.scaled(name, 2.0)[name] > value
    assert DEFAULT.scaled("slip_slope_drop", 2.0).slip_slope_drop == pytest.approx(0.75)
    assert 0 < DEFAULT.scaled("slip_slope_drop", 0.25).slip_slope_drop < 1
