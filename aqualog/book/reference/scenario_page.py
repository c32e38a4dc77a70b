"""The scenario file and its tyres."""

from __future__ import annotations

from aqualog.book.markdown import code, fence, number, page, table
from aqualog.config.scenario import SCENARIO_KEYS, ScenarioKey
from aqualog.model.tyre import TYRE_KEYS, TYRES

__all__ = ["text"]

_SUMMARY = "A scenario file says what a simulated car drives: speed, lanes of water, steering, sensors."
_HOW = """
`aqualog simulate scenario.toml -o drive.mf4` drives it. The same scenario, model and seed give the same bytes. Keys
without a default have no effect if they are left out, unless they must be given. `[[lane]]`, `[[kick]]` and
`[[fault]]` may stand any number of times.
"""
_EXAMPLE = """
vehicle = "vehicle.toml"         # relative to this file
tyre = "worn_summer"
pressure_bar = 1.9
duration_s = 20.0
seed = 1
speed_kmh = 98.0                 # or profile = [[0.0, 60.0], [20.0, 130.0]]  (t [s], v [km/h])

[[lane]]
start_s = 6.0
end_s = 14.0
water_depth_mm = 1.3
"""
_TYRES = """
`tyre` names one of the tyres below, or is a table: a `base` and the parameters that differ from it. The vehicle file's
slip slope and friction hold for a worn summer tyre at 1.9 bar and the static load.

The last column says where a value comes from. V: read in the source named. D: derived. K: general knowledge, not
verified. A: the one anchor, a worn summer tyre at low pressure in 1.3 mm of water that aquaplanes fully near 118 km/h.
"""
_TYRE_EXAMPLE = """
[tyre]
base = "worn_summer"
tread_depth = 0.003
"""


def text() -> str:
    """The page."""
    return page(
        "Scenario file",
        _SUMMARY,
        _HOW,
        fence(_EXAMPLE, "toml"),
        "## Keys",
        table(("key", "unit", "default", "bounds", "meaning"), map(_row, SCENARIO_KEYS.values())),
        "## Tyres",
        _TYRES,
        fence(_TYRE_EXAMPLE, "toml"),
        table(("key", "unit", *(code(t) for t in TYRES), "bounds", "meaning", "where it comes from"), _tyres()),
    )


def _row(key: ScenarioKey) -> tuple[str, ...]:
    default = "" if key.default is None else code(key.default) if isinstance(key.default, str) else f"{key.default:g}"
    bounds = f"{number(key.low)} ... {number(key.high)}" if number(key.low) else ""
    return code(key.path), key.unit, default, bounds, key.meaning


def _tyres() -> list[tuple[str, ...]]:
    return [
        (
            code(k.name),
            k.unit,
            *(f"{getattr(t, k.name):g}" for t in TYRES.values()),
            f"{k.low:g} ... {k.high:g}",
            k.meaning,
            k.source,
        )
        for k in TYRE_KEYS.values()
    ]
