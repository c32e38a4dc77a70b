"""Model files: the effects that a simulation can have on top of its base."""

from __future__ import annotations

from aqualog.book.markdown import code, fence, page, table
from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.model.effects import EFFECTS
from aqualog.model.empirical import EMPIRICAL
from aqualog.model.term import Effect

__all__ = ["EXAMPLE", "text"]

_SUMMARY = "A model file lists effects on top of the base simulation, each with its parameters and its place."
_HOW = """
`aqualog diagnose -o model.toml` writes one. `simulate`, `detect` and `diagnose` take it with `--model model.toml`. A
parameter that is left out is neutral, and a neutral effect changes no bit of a drive. Values outside the bounds are
errors.

`where` names the place: a wheel (`fl`), an axle (`f`, `r`), a side (`left`, `right`) or a signal (`a_x`). An effect
without a place acts on the whole car.
"""
EXAMPLE = """
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


def text() -> str:
    """The page."""
    return page(
        "Effects and model files",
        _SUMMARY,
        _HOW,
        fence(EXAMPLE, "toml"),
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
    )


def _effect(effect: Effect) -> tuple[str, ...]:
    twins = ", ".join(map(code, effect.twins))
    return code(effect.name), effect.target, _places(effect.places), twins, effect.source


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
