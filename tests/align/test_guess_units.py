"""Units by size and by motion."""

import numpy as np
import pytest

from aqualog.align.guess_units import CHOICES, by_acceleration, by_factor, by_range, top_of
from aqualog.core.units import parse_unit


@pytest.mark.parametrize(
    ("quantity", "factor", "unit"),
    [
        ("wheel", 1 / 3.6, "km/h"), ("wheel", 1.02, "m/s"), ("wheel", 0.32, "rad/s"), ("wheel", 0.0335, "rpm"),
        ("wheel", 0.45, "mph"), ("wheel", 2.0, None), ("wheel", float("nan"), None), ("wheel", -1.0, None),
        ("speed", 0.32, None), ("brake", 0.11, "bar"), ("brake", 1.1, "MPa"), ("brake", 0.0011, "kPa"),
    ],
)  # fmt: skip
def test_the_factor_to_si_shows_the_unit(quantity, factor, unit):
    assert by_factor(factor, CHOICES[quantity], spread=0.04) == unit


@pytest.mark.parametrize(
    ("quantity", "top", "unit", "doubt"),
    [
        ("wheel", 237.0, "km/h", ("mph", "rad/s")), ("wheel", 900.0, "rpm", ()), ("speed", 30.0, "km/h", ("m/s", "mph")),
        ("acceleration", 9.0, "m/s^2", ()), ("acceleration", 0.9, "m/s^2", ("g",)), ("acceleration", 0.1, "m/s^2", ("g",)), ("acceleration", 0.01, "g", ()),
        ("yaw_rate", 30.0, "deg/s", ()), ("yaw_rate", 0.4, "deg/s", ("rad/s",)), ("steering", 400.0, "deg", ()),
        ("brake", 90.0, "bar", ("psi",)), ("tyre_pressure", 220.0, "kPa", ()), ("torque", 1500.0, "N*m", ()),
        ("tie_rod", 0.9, "kN", ()), ("temperature", 290.0, "K", ()),
    ],
)  # fmt: skip
def test_the_range_shows_the_unit_and_what_it_does_not_rule_out(quantity, top, unit, doubt):
    guess = by_range(np.linspace(-top, top, 4001), CHOICES[quantity])
    assert (guess.unit, guess.doubt) == (unit, doubt)


def test_a_range_that_no_unit_has():
    assert by_range(np.full(9, 1e9), CHOICES["speed"]) is None
    assert by_range(np.full(9, np.nan), CHOICES["speed"]) is None


def test_a_code_among_thousands_is_not_the_top():
    assert top_of(np.append(np.full(5000, 7.0), 1022.0)) == 7.0


@pytest.mark.parametrize(
    ("ratio", "units", "unit", "doubt"),
    [(1.0, ("m/s^2",), "m/s", ()), (1 / 3.6, ("m/s^2",), "km/h", ("rad/s",)), (1 / 9.80665, ("m/s^2", "g"), "m/s", ()),
     (50.0, ("m/s^2",), None, ())],
)  # fmt: skip
def test_an_accelerometer_shows_the_unit_of_a_speed(ratio, units, unit, doubt):
    guess = by_acceleration(ratio, CHOICES["wheel"], [c for c in CHOICES["acceleration"] if c.unit in units])
    assert (guess and guess.unit, guess.doubt if guess else ()) == (unit, doubt)


@pytest.mark.parametrize("quantity", CHOICES)
def test_every_unit_is_one_of_its_quantity(quantity):
    dimensions = {parse_unit(c.unit).dimension for c in CHOICES[quantity]}
    assert dimensions <= (
        {"speed", "angular_speed"} if quantity == "wheel" else {parse_unit(CHOICES[quantity][0].unit).dimension}
    )
    assert all(c.low <= c.high and c.least < c.most for c in CHOICES[quantity])
