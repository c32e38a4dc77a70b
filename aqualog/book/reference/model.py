"""Pages of what describes the car and its model: vehicle file, effects and model files."""

from __future__ import annotations

from dataclasses import replace

from aqualog.book.markdown import code, fence, number, page, table
from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.provenance import TYPICAL, Share
from aqualog.core.vehicle import (
    COEFFICIENTS,
    KEYS,
    POLYNOMIALS,
    SOURCES,
    SPREAD,
    WATER,
    Provenance,
    Vehicle,
    WaterNumber,
    vehicle_toml,
)
from aqualog.diagnose.tolerances import TOLERANCES
from aqualog.model.effects import EFFECTS, EMPIRICAL
from aqualog.model.term import Effect
from aqualog.model.tyre import TYRE_KEYS

__all__ = ["EFFECTS_EXAMPLE", "effects_page", "vehicle_example", "vehicle_page"]

_VEHICLE = "A vehicle file describes the car: mass, geometry, wheels and tyres, in SI units."
_VEHICLE_HOW = """
Give it with `--vehicle car.toml`. A key that is left out takes its default. The detectors of the resistance and the
joint detectors ask for `mass`: they do not judge with a default. [`aqualog calibrate`](commands.md) estimates most of
the keys from dry drives. Unknown keys are errors, and the message names the nearest known one.

The last column says where a default comes from. V: read in the source named. D: derived. K: general knowledge, not
verified.
"""
_TEXTS = (
    ("name", "text", "the file's name", "name of the car in pages and tables"),
    ("drivetrain", "text", "none", "driven axle: rwd, fwd or awd"),
    ("torque_arm", "text", "effective", "torque over force: effective (r_e) or loaded (r_l), as (2.10) is printed"),
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
writes it. Without `spread.torque_gain`, `diagnose` takes 1 % of it for a load of one of several drives.
"""
_PROVENANCE = """
`[provenance]` says where the value of a key comes from: `mass = "measured"`. With a standard deviation of its own it is
`wheels.r_e_f = { source = "calibrated", sd = 0.0004 }`, in the key's unit. A key that is set without a line here counts
as `data_sheet`, with a value in `[spread]` as `calibrated`. A key that is not set is a `guess`, and no other source may
be given for it. `aqualog calibrate` writes what it estimated, and measured for what `--fix` gave. `aqualog diagnose`
names nothing that these deviations explain. Mass and torque gain are one ratio: where drives have calibrated the mass,
or the gain with a measured mass, neither deviates beyond that ratio. Without this table every value that is set counts
as exact there, and its page says so.
"""
_KNOWN = """
`[known]` lists faults of the car that are known: an [effect](effects.md), with `@` and its place, values of its
parameters, and as `spread` the standard deviation of the first one. `aqualog diagnose` has them in its model from the
start and in the model it writes, lets them move within the spread and notes them as known. One that is further off is a
cause, with its new value. `detect`, `simulate` and a campaign do not take them from here: give them `--model`.

```toml
[known]
"signal_delay@torque" = { delay = 0.03, spread = 0.005 }
```
"""
_WATER = """
`[water]` holds numbers of the law of water for the tyres on this car. `aqualog calibrate --wet` writes them:
`v_anchor = { value = 33.1, sd = 0.4, source = "calibrated" }`, or a plain number. `diagnose`, `validate` and a
scenario's tyres take them, unless the scenario gives its own.
"""
_PROVENANCE_SD = """
The standard deviation of a value whose line gives none. [`[spread]`](#spread-between-drives) comes on top.
"""


def vehicle_page() -> str:
    """The page."""
    keys = [
        (code(k.path), k.unit, f"{k.default:g}", f"{number(k.low)} ... {number(k.high)}", k.meaning, k.source)
        for k in KEYS.values()
    ]
    return page(
        "Vehicle file",
        _VEHICLE,
        _VEHICLE_HOW,
        table(("key", "type", "default", "meaning"), [(code(n), *rest) for n, *rest in _TEXTS]),
        "## Numbers",
        table(("key", "unit", "default", "bounds", "meaning", "where the default comes from"), keys),
        "A loaded radius that is not given follows the effective one: 0.975 of it. `torque_split_rear` follows the "
        "drivetrain. aqualog multiplies the torques of a log with `torque_gain` when it reads them.",
        "## Tie rods and steering torque",
        _POLYNOMIALS,
        table(("key", "unit", "default", "meaning"), _coefficients()),
        "## Where values come from",
        _PROVENANCE,
        table(("source", "meaning"), [(code(source), meaning) for source, meaning in SOURCES.items()]),
        _PROVENANCE_SD,
        table(
            ("key", *(s.replace("_", " ") for s in SOURCES), "why"),
            [
                (code(path), *(_size(getattr(typical, source), KEYS[path].unit) for source in SOURCES), typical.why)
                for path, typical in TYPICAL.items()
            ],
        ),
        "## Spread between drives",
        _SPREAD,
        table(
            ("key", "unit", "default", "meaning"),
            [(code(f"spread.{n}"), KEYS[n].unit, "none", f"scatter of `{n}` between drives") for n in SPREAD],
        ),
        "## Known faults",
        _KNOWN,
        "## How its tyres float",
        _WATER,
        table(("key", "unit", "default", "bounds", "meaning"), _water()),
        "## Full example",
        "Every key stands in this file. It loads as it is.",
        fence(vehicle_example(), "toml"),
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


def _water() -> list[tuple[str, ...]]:
    return [
        (code(f"water.{n}"), unit, "that of the tyre", f"{number(k.low)} ... {number(k.high)}", k.meaning)
        for n, unit in WATER.items()
        for k in (TYRE_KEYS[n],)
    ]


def _size(sd: float, unit: str) -> str:
    return f"{sd:.3g} {unit}".removesuffix(" -") if not isinstance(sd, Share) else f"{100.0 * sd:.3g} %"


def vehicle_example() -> str:
    """The text of a vehicle file with every key."""
    car = replace(
        Vehicle(),
        name="sedan RWD",
        given=frozenset(KEYS),
        provenance={
            "mass": Provenance("measured"),
            "drag_area": Provenance("data_sheet", 0.03),
            "wheels.r_e_f": Provenance("calibrated", 0.0004),
            "tyre.mu_max": Provenance("guess"),
        },
        spread={"mass": 15.0, "drag_area": 0.02, "rolling_resistance": 0.0008, "torque_gain": 0.01},
        water={"v_anchor": WaterNumber(33.1, 0.4), "contact_exponent": WaterNumber(3.2, 0.3)},
        tie_rod={"c0": (0.0,), "c_y": (0.11, 1e-6), "c_x": (0.06,), "sigma": (60.0,)},
        steering_torque={"c0": (0.0,), "c_y": (0.002,), "c_x": (0.001,), "sigma": (0.5,)},
    )
    return vehicle_toml(car)


_EFFECTS = "A model file lists effects on top of the base simulation, each with its parameters and its place."
_EFFECTS_HOW = """
`aqualog diagnose -o model.toml` writes one. `simulate`, `detect` and `diagnose` take it with `--model model.toml`. A
parameter that is left out is neutral, and a neutral effect changes no bit of a drive. Values outside the bounds are
errors. `vehicle = "..."` before the first table is the car that the model was found on: with another one, a note says
so.

`where` names the place: a wheel (`fl`), an axle (`f`, `r`), a side (`left`, `right`) or a signal (`a_x`). An effect
without a place acts on the whole car.
"""
EFFECTS_EXAMPLE = """
[[term]]
effect = "payload_mass"
where = "r"
delta_mass = 120.0

[[term]]
effect = "unexplained_force"
knots = [[10.0, 0.0], [40.0, 35.0]]   # v_x [m/s], force [N]
"""
_KEYS = (
    ("effect", "text", "name of the effect; must be given"),
    ("where", "text", "its place, where it has one"),
    ("a parameter's name", "number", "its value, SI"),
    ("knots", "list of pairs", "a function in place of parameters: [[x, value], ...], straight between the knots"),
)
_FUNCTIONS = """
These two are functions that a diagnosis found and that no effect explains. Values are given as knots; between two knots
the function is straight, beyond the ends it is constant.
"""


def effects_page() -> str:
    """The page."""
    return page(
        "Effects and model files",
        _EFFECTS,
        _EFFECTS_HOW,
        fence(EFFECTS_EXAMPLE, "toml"),
        table(("key of `[[term]]`", "type", "meaning"), [(code(n) if " " not in n else n, k, m) for n, k, m in _KEYS]),
        "## Effects",
        table(("effect", "acts on", "places", "looks like", "size in the field"), map(_effect, EFFECTS.values())),
        "## Parameters",
        "The prior is a normal distribution around the neutral value; `diagnose` uses it. A deviation below the "
        "smallest one is not worth naming.",
        table(("effect", "parameter", "unit", "neutral", "bounds", "prior ±", "smallest", "meaning"), _parameters()),
        "## Functions",
        _FUNCTIONS,
        table(("effect", "acts on", "knots", "bounds of x", "bounds of the value"), map(_function, EMPIRICAL.values())),
        "## Deviations",
        "No vehicle file and no simulator has these exactly. `diagnose` allows for them and names none as a cause; the "
        "document lists what is likeliest as `deviations`, with the value `by`. Effects above may be there, too.",
        table(("deviation", "of", "unit", "allowed ±"), map(_deviation, TOLERANCES)),
    )


def _effect(effect: Effect) -> tuple[str, ...]:
    twins = ", ".join(map(code, effect.twins))
    return code(effect.name), effect.target, _places(effect.places), twins, effect.source


def _deviation(effect: Effect) -> tuple[str, ...]:
    (by,) = effect.parameters
    return code(effect.name), effect.target, by.unit, f"{by.sigma:g}"


def _places(places: tuple[str, ...]) -> str:
    """Groups of places by name; single ones as they are."""
    left, named = list(places), []
    for word, group in (("wheels", WHEELS), ("axles", tuple(AXLES)), ("sides", tuple(SIDES))):
        if set(group) <= set(left):
            named.append(f"{word} ({', '.join(map(code, group))})")
            left = [p for p in left if p not in group]
    return ", ".join([*named, *map(code, left)]) or "whole car"


def _parameters() -> list[tuple[str, ...]]:
    return [
        (code(e.name), code(p.name), p.unit, f"{p.neutral:g}", f"{p.low:g} ... {p.high:g}", f"{p.sigma:g}",
         f"{p.smallest:g}", p.meaning)
        for e in EFFECTS.values() for p in e.parameters
    ]  # fmt: skip


def _function(effect: Effect) -> tuple[str, ...]:
    t = effect.table
    if t is None:
        return code(effect.name), effect.target, "", "", ""
    knots = f"{t.x} [{t.x_unit}], value [{t.unit}]"
    return code(effect.name), effect.target, knots, f"{t.x_low:g} ... {t.x_high:g}", f"{t.low:g} ... {t.high:g}"
