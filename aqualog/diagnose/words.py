"""Sentences of a diagnosis."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from string import Formatter

from aqualog.core.units import displayed_unit
from aqualog.diagnose.records import SURE, Cause, Estimate
from aqualog.model.term import Effect, Term

__all__ = [
    "CERTAIN", "PLACES", "cause_sentence", "change_words", "listed", "name_of", "number", "place", "quantity",
    "term_words", "verdict_sentence",
]  # fmt: skip

MANY_UNTESTED = 5  # more than those of water, which no dry road shows
CERTAIN = "Certain: "  # how a sentence begins that knows some causes, where others cannot be distinguished
PLACES = {
    "fl": "front left wheel", "fr": "front right wheel", "rl": "rear left wheel", "rr": "rear right wheel",
    "f": "front axle", "r": "rear axle", "left": "left side", "right": "right side",
    "a_x": "longitudinal", "a_y": "lateral", "v_x": "reference velocity",
    "omega": "wheel speeds", "torque": "wheel torque", "torque_fl": "torque's bus",
}  # fmt: skip


def place(where: str | None) -> str:
    """` (front left wheel)`, or an empty string for the whole car."""
    return "" if where is None else f" ({PLACES.get(where, where)})"


def number(value: float, sign: str = "") -> str:
    """`1160`: three digits, large ones without an exponent."""
    text = f"{value:{sign}.3g}"
    return f"{float(text):{sign}.0f}" if "e+" in text and abs(value) < 1e6 else text


def quantity(value: float, unit: str, *, change: bool = False) -> str:
    """A value with three digits and its unit; ratios without one."""
    text = number(value, "+" if change else "")
    return text if unit == "-" else f"{text} {displayed_unit(unit)}"


def name_of(effect: str, where: str | None) -> str:
    """`tyre radius (front left wheel)`."""
    return effect.replace("_", " ") + place(where)


def term_words(term: Term) -> str:
    """`tyre radius (front axle): delta -0.0099`."""
    units = {p.name: p.unit for p in term.effect.parameters}
    said = (f"{n} {quantity(v, units[n])}" for n, v in term.values.items())
    return f"{name_of(term.effect.name, term.where)}: {', '.join(said)}"


def change_words(term: Term, known: Mapping[str, float], deviations: Mapping[str, float]) -> str:
    """`tyre radius (front axle) 0.27% larger (1.3 standard deviations)`: how far a term's values are from `known` ones,
    else from no effect, by the standard deviations of the file's values, where there are any."""
    said = []
    for p in (p for p in term.effect.parameters if p.name in term.values):
        change, sd = term.values[p.name] - known.get(p.name, p.neutral), deviations.get(p.name, 0.0)
        is_share = p.neutral == 1.0 or _is_percent(term.effect.sentence, p.name)
        size = f"{abs(100.0 * change):.3g}%" if is_share else quantity(abs(change), p.unit)
        by = f" ({abs(change) / sd:.1f} standard deviations)" if sd else ""
        said.append(f"{name_of(term.effect.name, term.where)} {size} {'larger' if change > 0.0 else 'smaller'}{by}")
    return listed(said)


def _is_percent(sentence: str, name: str) -> bool:
    return any(n == name and (spec or "").endswith("%") for _, n, spec, _ in Formatter().parse(sentence))


def cause_sentence(
    effect: Effect, where: str | None, parameters: Mapping[str, Estimate], drives: Sequence[str] = ()
) -> str:  # fmt: skip
    """The effect's own sentence with its values and the interval of the first one; `drives` that alone have it."""
    name, first = next(iter(parameters.items()))
    factor, unit = effect.shown or (1.0, first.unit)
    less = first.value < 0.0 and "|" in effect.sentence
    low, high = (-factor * first.high, -factor * first.low) if less else (factor * first.low, factor * first.high)
    values = {n: e.value for n, e in parameters.items()} | {name: (-factor if less else factor) * first.value}
    sentence = re.sub(r"\[(.*?)\|(.*?)\]", r"\2" if less else r"\1", effect.sentence)
    at = place(where) or (" (all wheels)" if "fl" in effect.places else "")
    text = sentence.format(where=where or "", at=at, **values).rstrip(".")
    if _is_percent(sentence, name):
        # in the unit in which the sentence has the value
        low, high, unit = 100.0 * low, 100.0 * high, "%"
    only = f" In {listed(drives)} only." if drives else ""
    told = "" if unit == "-" else f" {displayed_unit(unit)}"
    is_said = "{where}" in sentence or place(where).strip(" ()") in text
    return f"{text}{'' if is_said else place(where)}; 95 % interval {_span(low, high)}{told}.{only}"


def _span(low: float, high: float) -> str:
    """`1.095 to 1.103`: as many digits as needed to distinguish the two."""
    half = 0.5 * abs(high - low)
    if not 0.0 < half < math.inf:
        return f"{low:.3g} to {high:.3g}"
    digits = max(0, -math.floor(math.log10(0.5 * half)))
    return f"{low:.{digits}f} to {high:.{digits}f}"


def listed(names: Sequence[str], last: str = "and") -> str:
    """`a, b and c`."""
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + f" {last} " + names[-1]


def verdict_sentence(
    verdict: str, causes: Sequence[Cause], *, level: float, reason: str = "", certain: frozenset[str] = frozenset(),
    seen: float | None = None, source: str = "log", untested: Mapping[str, str] | None = None,
    moved: Sequence[str] = (), unjudged: Sequence[str] = (),
) -> str:  # fmt: skip
    """The verdict in one sentence, of a log that can be tested. `certain`: effects that are certain where others cannot
    be distinguished; `seen`: the test's p-value where it found more than noise; `source`: `log` or `campaign`;
    `untested`: effects that the log cannot show, and why; `moved`: in words, which values of the vehicle file
    the model has otherwise; `unjudged`: water on which most of the drives was not judged."""
    names = [name_of(c.effect, c.where) + (f" in {listed(c.drives)}" if c.drives else "") for c in causes]
    if verdict == "no_effect" and seen is not None:
        return f"No effect is named: more than noise is left (p = {seen:.2g}), but no known effect explains it clearly."
    if verdict == "no_effect":
        where = "No effect where the drive is judged" if unjudged else "No effect"
        agrees = f"{where}: the model agrees with the measurement, at a false-alarm level of {level:g}"
        why = Counter((untested or {}).values()).most_common(1)
        few = ""
        if why and why[0][1] >= MANY_UNTESTED:
            most = "" if why[0][1] == len(untested or {}) else f"{why[0][1]} of them: "
            few = f"; {len(untested or {})} effects were not tested ({most}{why[0][0]})"
        if moved:
            few += f". This holds with values that the vehicle file allows: {listed(moved)}"
        few += f". But {unjudged[0]}" if unjudged else ""
        return f"{agrees}{few}."
    if verdict == "named":
        return causes[0].sentence
    if verdict == "compound":
        return f"{len(causes)} effects together: {listed(names)}."
    if verdict == "cannot_tell":
        # a road's mean slope may be open although the road itself is certain
        is_sure = [c.effect in certain and not c.probability < SURE for c in causes]
        sure = [n for n, yes in zip(names, is_sure, strict=True) if yes]
        open_ones = [f"{n} (mean)" if n in sure else n for n, yes in zip(names, is_sure, strict=True) if not yes]
        if sure and open_ones:
            others = listed(open_ones, "or")
            if len(open_ones) == 1:
                odds = _odds(causes[is_sure.index(False)].probability)
                return f"{CERTAIN}{listed(sure)}. This {source} leaves open: {others}{odds}."
            return f"{CERTAIN}{listed(sure)}. This {source} cannot distinguish the other causes: {others}."
        if len(causes) == 1 and not sure:
            odds = _odds(causes[0].probability)
            return f"The car may differ from the model, but this {source} does not make it certain: {names[0]}{odds}."
        if len(causes) == 1:
            odds = _odds(causes[0].probability)
            return f"One effect is likely, but it is not named: {names[0]}{odds}. The notes say why."
        return f"The car differs from the model, but this {source} cannot distinguish {listed(names)}."
    likely = [_odds(c.probability) if c.probability < SURE else "" for c in causes]
    known = f" beside {listed([n + o for n, o in zip(names, likely, strict=True)])}" if names else ""
    return f"The car differs from the model{known} in a way that no effect of the library explains{reason}."


def _odds(probability: float) -> str:
    return "" if math.isnan(probability) else f" (probability {probability:.2f})"
