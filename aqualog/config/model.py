"""Read model files: the base simulation and the effects on top of it."""

from __future__ import annotations

import difflib
import json
from pathlib import Path

from aqualog.config.reader import Table, is_number, read
from aqualog.core.errors import ConfigError
from aqualog.model.effects import EFFECTS, EMPIRICAL
from aqualog.model.term import Effect, Knots, Model, Term

__all__ = ["dump_model", "load_model"]

_KNOWN = {**EFFECTS, **EMPIRICAL}


def load_model(path: Path) -> Model:
    """Read and check a model file: `[[term]]` tables with `effect`, where it sits (`where`) and its parameters, SI.

    `vehicle` is the name of the car that it was found on. A parameter that is left out keeps its neutral value; a file
    without terms gives the base model. An effect that is a function has `knots = [[x, value], ...]`.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    file = read(path, "model file")
    file.check_names("term", "vehicle")
    model = Model(car=str(file.get("vehicle", "")))
    for table in file.tables("term"):
        term = _term(table)
        if term is None:
            continue
        try:
            model = model.with_term(term)
        except ConfigError as error:
            table.add("effect", error.line())
    file.faults.raise_if_any()
    return model


def _term(table: Table) -> Term | None:
    effect = _effect(table)
    if effect is None:
        return None
    knots = ["knots"] if effect.table else []
    values = table.numbers({p.name: p for p in effect.parameters}, "effect", "where", *knots)
    where = table.get("where")
    if where is not None and (not isinstance(where, str) or where not in effect.places):
        places = ", ".join(effect.places) or "no place: it acts on the whole car"
        table.add("where", f"{effect.name} cannot sit at {repr(where)[:40]}; expected {places}")
        where = None
    return Term(effect, values, where, _knots(table, effect))


def _knots(table: Table, effect: Effect) -> Knots:
    given = table.get("knots")
    if given is None or effect.table is None:
        return ()
    pairs = [p for p in given if isinstance(p, list) and len(p) == 2] if isinstance(given, list) else []
    if not pairs or len(pairs) != len(given) or not all(is_number(x) for p in pairs for x in p):
        t = effect.table
        table.add("knots", f"knots = {str(given)[:40]} is not a list of pairs [{t.x} [{t.x_unit}], value [{t.unit}]]")
        return ()
    knots = tuple((float(x), float(value)) for x, value in pairs)
    fault = effect.table.fault(knots)
    if fault is not None:
        table.add("knots", f"{effect.name}: {fault}")
        return ()
    return knots


def _effect(table: Table) -> Effect | None:
    name = table.get("effect")
    if name is None:
        table.add("term", "term names no effect")
        return None
    if isinstance(name, str) and name in _KNOWN:
        return _KNOWN[name]
    near = difflib.get_close_matches(str(name), list(_KNOWN), n=1, cutoff=0.5)
    hint = f' (did you mean "{near[0]}"?)' if near else f"; known: {', '.join(_KNOWN)}"
    table.add("effect", f"unknown effect {repr(name)[:40]}{hint}")
    return None


def dump_model(model: Model) -> str:
    """Return the TOML text of a model; `load_model` reads it back equal."""
    head = [f"vehicle = {json.dumps(model.car, ensure_ascii=False)}\n"] if model.car else []
    return "\n".join([*head, *map(_term_text, model.terms)])


def _term_text(term: Term) -> str:
    units = {p.name: p.unit for p in term.effect.parameters}
    lines = ["[[term]]", f"effect = {json.dumps(term.effect.name)}"]
    if term.where is not None:
        lines.append(f"where = {json.dumps(term.where)}")
    lines += [f"{n} = {float(v)!r}  # {units[n]}" for n, v in term.values.items()]
    if term.knots and term.effect.table is not None:
        table = term.effect.table
        lines.append(f"knots = [  # {table.x} [{table.x_unit}], value [{table.unit}]")
        lines += [f"    [{float(x)!r}, {float(value)!r}]," for x, value in term.knots]
        lines.append("]")
    return "\n".join(lines) + "\n"
