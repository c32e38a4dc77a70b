"""Thresholds: one TOML with sources, and the user's file of those that differ."""

from dataclasses import fields

import pytest

from aqualog.config.trade import load_coefficients, load_limits
from aqualog.core.errors import ConfigError
from aqualog.trade.limits import BrakingLimits, CurveLimits, Limits, SetLimits, StraightLimits, defaults, described


def test_every_threshold_is_described_and_used():
    kinds = {"straight": StraightLimits, "curve": CurveLimits, "braking": BrakingLimits, "set": SetLimits}
    assert {d.path for d in described()} == {f"{t}.{f.name}" for t, kind in kinds.items() for f in fields(kind)}
    for d in described():
        assert d.low <= d.value <= d.high, d.path
        assert d.meaning
        assert d.source
        assert defaults().value(d) == d.value


def test_file_of_a_user(tmp_path):
    path = tmp_path / "limits.toml"
    path.write_text("[straight]\nyaw_rate = 0.08\n[set]\nruns = 4\n")
    limits = load_limits(path)
    assert limits.straight.yaw_rate == 0.08
    assert limits.set.runs == 4.0
    assert limits.straight.slip == defaults().straight.slip
    assert limits.changed == {"straight.yaw_rate", "set.runs"}


@pytest.mark.parametrize(
    ("text", "words"),
    [("[straight]\nyaw_rte = 0.08\n", 'unknown key "yaw_rte" \\(did you mean "yaw_rate"'),
     ("[strait]\nslip = 0.1\n", 'did you mean "straight"'),
     ("[straight]\nslip = 9.0\n", "slip = 9 is outside 0.02 ... 1"), ('[straight]\nslip = "0.1"\n', "line 2"),
     ("[braking]\ndepth_low = 3.0\n", "depth_low is above"), ("straight = 3\n", "straight is not a table")],
)  # fmt: skip
def test_wrong_file_of_a_user(tmp_path, text, words):
    path = tmp_path / "limits.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_limits(path)


def test_values_by_path():
    assert Limits.of({"curve.steer": 0.2}).curve.steer == 0.2


def test_coefficients(tmp_path):
    path = tmp_path / "r117.toml"
    path.write_text('name = "my copy"\nscale = 125\na = -0.4\nt0 = 20\nb = -8.0\nbfc_r0 = 0.68\n')
    assert load_coefficients(path).b == -8.0
    path.write_text("scale = 125\na = -0.4\nt0 = 20\n")
    with pytest.raises(ConfigError, match=r"b is missing.*bfc_r0 is missing"):
        load_coefficients(path)
