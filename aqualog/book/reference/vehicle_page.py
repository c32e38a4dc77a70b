"""The vehicle file: every key, and a full example."""

from __future__ import annotations

from dataclasses import replace

from aqualog.book.markdown import code, fence, number, page, table
from aqualog.core.vehicle import COEFFICIENTS, KEYS, POLYNOMIALS, SPREAD, Vehicle, vehicle_toml

__all__ = ["example", "text"]

_SUMMARY = "A vehicle file describes the car: mass, geometry, wheels and tyres, in SI units."
_HOW = """
Give it with `--vehicle car.toml`. A key that is left out takes its default. The detectors of the resistance and the
joint detectors ask for `mass`: they do not judge with a default. [`aqualog calibrate`](commands.md) estimates most of
the keys from dry drives. Unknown keys are errors, and the message names the nearest known one.

The last column says where a default comes from. V: read in the source named. D: derived. K: general knowledge, not
verified.
"""
_TEXTS = (
    ("name", "text", "the file's name", "name of the car in pages and tables"),
    ("drivetrain", "text", "rwd", "driven axle: rwd, fwd or awd"),
)
_POLYNOMIALS = """
A model of the tie-rod forces lets the detector `tie_rod` work; one of the steering torque serves cars without measured
rods. Both come from `aqualog calibrate`. The model is F = c0 + c_y F_y + c_x F_x. A coefficient may be a list: the
second number belongs to the second power, up to the fifth.
"""
_COEFFICIENTS = {
    "c0": "constant",
    "c_y": "factor on the lateral force, or factors of its powers",
    "c_x": "factor on the longitudinal force, or factors of its powers",
    "sigma": "what the model leaves on dry road, as standard deviation",
}
_DEFAULT_SIGMA = {"tie_rod": "60", "steering_torque": "0.5"}
_CONSTANT_UNIT = {"tie_rod": "N", "steering_torque": "N*m"}
_POWER_UNIT = {"tie_rod": "-", "steering_torque": "m"}
_SPREAD = """
`[spread]` holds standard deviations: by how much one more drive of the same car differs from the file's value. Wind,
surface, temperature and fuel are in it. `aqualog diagnose` allows for it; `aqualog calibrate` with four drives or more
writes it.
"""


def text() -> str:
    """The page."""
    keys = [
        (code(k.path), k.unit, f"{k.default:g}", f"{number(k.low)} ... {number(k.high)}", k.meaning, k.source)
        for k in KEYS.values()
    ]
    return page(
        "Vehicle file",
        _SUMMARY,
        _HOW,
        table(("key", "type", "default", "meaning"), [(code(n), *rest) for n, *rest in _TEXTS]),
        "## Numbers",
        table(("key", "unit", "default", "bounds", "meaning", "where the default comes from"), keys),
        "A loaded radius that is not given follows the effective one: 0.975 of it. `torque_split_rear` follows the "
        "drivetrain. aqualog multiplies the torques of a log with `torque_gain` when it reads them.",
        "## Tie rods and steering torque",
        _POLYNOMIALS,
        table(("key", "unit", "default", "meaning"), _coefficients()),
        "## Spread between drives",
        _SPREAD,
        table(("key", "unit", "default", "meaning"), _spread()),
        "## Full example",
        "Every key stands in this file. It loads as it is.",
        fence(example(), "toml"),
    )


def _coefficients() -> list[tuple[str, str, str, str]]:
    rows = []
    for section, meaning in POLYNOMIALS.items():
        for name in COEFFICIENTS:
            unit = (_CONSTANT_UNIT if name in ("c0", "sigma") else _POWER_UNIT)[section]
            default = _DEFAULT_SIGMA[section] if name == "sigma" else "none"
            said = f"{_COEFFICIENTS[name]} ({meaning})" if name == "c0" else _COEFFICIENTS[name]
            rows.append((code(f"{section}.{name}"), unit, default, said))
    return rows


def _spread() -> list[tuple[str, str, str, str]]:
    return [(code(f"spread.{n}"), KEYS[n].unit, "none", f"scatter of `{n}` between drives") for n in SPREAD]


def example() -> str:
    """The text of a vehicle file with every key."""
    car = replace(
        Vehicle(),
        name="sedan RWD",
        spread={"mass": 15.0, "drag_area": 0.02, "rolling_resistance": 0.0008, "torque_gain": 0.01},
        tie_rod={"c0": (0.0,), "c_y": (0.11, 1e-6), "c_x": (0.06,), "sigma": (60.0,)},
        steering_torque={"c0": (0.0,), "c_y": (0.002,), "c_x": (0.001,), "sigma": (0.5,)},
    )
    return vehicle_toml(car)
