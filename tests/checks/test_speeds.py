"""Scales of speeds: one wheel against the others, wheels against v_x; the unit that was mistaken is named."""

import numpy as np
import pytest

from aqualog.checks.look import look
from tests.checks.made import CAR, made, signals

DRIVE = made(stops=1)


def said(**factors):
    return [r for r in look(signals({n: x * factors.get(n, 1.0) for n, x in DRIVE.items()}), CAR) if r.kind == "scale"]


def test_small_differences_of_radii_are_no_fault():
    assert said(omega_fl=1.03, omega_rr=0.97, v_x=1.02) == []


def test_a_tyre_of_another_size():
    (remark,) = said(omega_rr=1.08)
    assert remark.what.startswith("omega_rr is 1.08 times the speed of the other wheels")
    (line,) = remark.lines
    assert float(line.split("scale = ")[1].rstrip(" }")) == pytest.approx(1 / 1.08, rel=0.01)


@pytest.mark.parametrize(
    ("factor", "unit"),
    [
        (3.6, "km/h read as m/s"), (1 / 3.6, "m/s read as km/h"), (2.237, "mph read as m/s"),
        (1 / 2.237, "m/s read as mph"), (1.609, "km/h read as mph"), (1 / 1.609, "mph read as km/h"), (1.1, ""),
    ],
)  # fmt: skip
def test_wheels_against_the_velocity(factor, unit):
    (remark,) = said(v_x=1.0 / factor)
    assert remark.value == pytest.approx(factor, rel=0.02)
    assert f"are {remark.value:.3g}" in remark.what
    assert f"({unit}?)" in remark.what if unit else "?" not in remark.what
    assert len(remark.lines) == 5
    assert " or " in remark.advice
    assert float(remark.lines[0].split("scale = ")[1].rstrip(" }")) == pytest.approx(factor, rel=0.02)


def test_wheels_that_slip_for_most_of_the_time_have_no_other_scale():
    """Snow: the driven wheels are faster, but not always by the same share."""
    rng = np.random.default_rng(1)
    slip = 1.0 + np.repeat(rng.uniform(0.0, 0.3, DRIVE["v_x"].size // 200), 200)
    columns = {n: x * slip if n in ("omega_rl", "omega_rr") else x for n, x in DRIVE.items()}
    assert not [r for r in look(signals(columns), CAR) if r.kind == "scale"]
