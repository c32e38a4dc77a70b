"""Figure 2.11: resistance measure over speed for several water depths."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.figures.evidence import Evidence
from aqualog.figures.measures import Effect
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.resistance_figure import PER_TEN, UNIT, Resistance, resistance_figure
from aqualog.figures.selection import Level, Wish
from aqualog.figures.tyres import VERY_WORN, depth_mm

__all__ = ["make"]

NUMBER = "2.11"
_WISH = Wish(("depth",), VERY_WORN)
_SHALLOW, _DEEP = 1.35, 1.9  # [mm] up to, and from
_LEVEL, _GRADIENT = 0.05, 0.02  # [m/s^2], [m/s^2 per 10 km/h]: a quarter of the threshold of 0.2, and a tenth, matter


def _c38(found: Resistance) -> Sequence[Finding]:
    known = sorted(
        ((d, x.name, x) for x in found.levels if (d := depth_mm(x, found.selected.wish)) is not None and d > 0.0),
        key=lambda m: m[:2],
    )
    shallow: list[Level] = [x for d, _, x in known if d <= _SHALLOW]
    deep: list[Level] = [x for d, _, x in known if d >= _DEEP]
    if not shallow or not deep:
        return ()
    rise = found.difference(shallow[-1], deep[-1])
    flat = found.difference(shallow[0], shallow[-1]) if len(shallow) > 1 else None
    if rise is None or (len(shallow) > 1 and flat is None):
        return ()
    is_risen = rise[0].is_above and rise[1].is_above
    is_flat = flat is None or (flat[0].is_none(_LEVEL) and flat[1].is_none(_GRADIENT))
    words = (
        f"{shallow[-1].name} to {deep[-1].name}: level {rise[0].words()} {UNIT}, gradient {rise[1].words()} {PER_TEN}"
    )
    if flat is not None:
        words = (
            f"{shallow[0].name} to {shallow[-1].name}: level {flat[0].words()} {UNIT}, gradient {flat[1].words()} "
            f"{PER_TEN}; {words}"
        )
    return (
        Finding(
            "C38",
            "From 0.6 to 1.3 mm neither level nor gradient of the resistance change significantly; at 2 mm both rise.",
            f"from the least to the greatest depth up to 1.3 mm, level and gradient: interval holds 0 or stays within "
            f"{_LEVEL:g} {UNIT} and {_GRADIENT:g} {PER_TEN}; from there to the greatest depth from {_DEEP:g} mm on: "
            "both "
            "intervals above 0; in part: one of both; value: the second step's level",
            words,
            judged(whole=is_flat and is_risen, part=is_flat or is_risen),
            "" if is_flat and is_risen else _reason(flat, rise),
            rise[0].value, rise[0].ci, UNIT,
        ),
    )  # fmt: skip


def _reason(flat: tuple[Effect, Effect] | None, rise: tuple[Effect, Effect]) -> str:
    words = []
    if flat is not None and not flat[0].is_none(_LEVEL):
        words.append("the level rises already within the shallow waters")
    if flat is not None and not flat[1].is_none(_GRADIENT):
        words.append("the gradient changes already within the shallow waters")
    words += [
        f"the {n} in deep water does not differ significantly"
        for n, e in zip(("level", "gradient"), rise, strict=True)
        if not e.is_above
    ]
    return (", ".join(words) + ".").capitalize()


def make(evidence: Evidence) -> Figure:
    """Means over speed by water depth; C38 and C39."""
    return resistance_figure(
        evidence, NUMBER, "resistance measure over speed by water depth", _WISH,
        "runs in two water depths, else alike, with torque, acceleration and speed", _c38,
    )  # fmt: skip
