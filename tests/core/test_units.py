import numpy as np
import pytest

from aqualog.core.errors import SignalError
from aqualog.core.notation import ACCEPTED, SYMBOLS
from aqualog.core.units import convert, displayed_units, is_unit, parse_unit


@pytest.mark.parametrize(
    ("value", "source", "target", "expected"),
    [(36.0, "km/h", "m/s", 10.0), (100.0, "kph", "m/s", 27.7777777778), (1.0, "g", "m/s^2", 9.80665),
     (1.0, "G", "m/s^2", 9.80665), (180.0, "deg", "rad", np.pi), (60.0, "rpm", "rad/s", 2 * np.pi),
     (60.0, "U/min", "rad/s", 2 * np.pi), (90.0, "°/s", "rad/s", np.pi / 2), (2.0, "bar", "Pa", 2e5),
     (25.0, "°C", "K", 298.15), (32.0, "degF", "K", 273.15), (1.3, "mm", "m", 1.3e-3), (50.0, "%", "-", 0.5),
     (2.0, "kNm", "N*m", 2000.0), (3.0, "Nm", "N*m", 3.0), (30.0, "psi", "Pa", 206842.7), (5.0, "ms", "s", 5e-3),
     (7.0, "kN", "N", 7000.0)],
)  # fmt: skip
def test_conversion(value, source, target, expected):
    assert convert(np.array([value]), source, target)[0] == pytest.approx(expected, rel=1e-7)


def test_there_and_back():
    x = np.linspace(-40, 60, 11)
    assert convert(convert(x, "degF", "K"), "K", "degF") == pytest.approx(x)


def test_unknown_unit_names_the_nearest():
    with pytest.raises(SignalError, match="km/h"):
        parse_unit("km/hh", where="x.csv:v")


def test_dimensions_are_not_mixed():
    with pytest.raises(SignalError, match="speed"):
        convert(np.zeros(1), "km/h", "rad/s")


def test_input_is_not_changed():
    x = np.array([36.0])
    convert(x, "km/h", "m/s")
    assert x[0] == 36.0


def test_every_symbol_has_a_unit_of_the_table():
    assert all(is_unit(s.unit) for s in (*SYMBOLS.values(), *ACCEPTED.values()))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("5 m/s^2, up to -3 m/s^2.", "5 m/s², up to -3 m/s²."), ("(m/s^2)^2 [kg*m^2]", "(m/s²)² [kg·m²]"),
        ("1/s^2; N*m; s^2/m^2", "1/s²; N·m; s²/m²"),
        ("run^2/m^2.mf4 a^2 dry*.mf4 /m^2/", "run^2/m^2.mf4 a^2 dry*.mf4 /m^2/"),
    ],
)  # fmt: skip
def test_units_in_a_text_are_written_one_way_and_names_stay(text, shown):
    assert displayed_units(text) == shown
