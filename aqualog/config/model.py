"""Read model files: the base simulation and the effects on top of it."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aqualog.config.toml_file import TableFaults, is_number, load_toml
from aqualog.core.errors import ConfigError
from aqualog.model.effects import EFFECTS
from aqualog.model.empirical import EMPIRICAL
from aqualog.model.term import Effect, Knots, Model, Term

__all__ = ["dump_model", "load_model"]

_KNOWN = {**EFFECTS, **EMPIRICAL}


def load_model(path: Path) -> Model:
    """Read and check a model file: `[[term]]` tables with `effect`, where it sits (`where`) and its parameters, SI.

    A parameter that is left out keeps its neutral value; a file without terms gives the base model. An effect that is a
    function has `knots = [[x, value], ...]`.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    document, text = load_toml(path, what="model file")
    faults = TableFaults(path, text)
    for name in document:
        if name != "term":
            faults.unknown(name, ("term",))
    tables = document.get("term", [])
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        faults.add("term", "term is not a list of tables; write [[term]]")
        tables = []
    model = Model()
    for index, table in enumerate(tables):
        with faults.inside("term", index):
            term = _term(table, faults)
            if term is None:
                continue
            try:
                model = model.with_term(term)
            except ConfigError as error:
                faults.add("effect", error.line())
    faults.raise_if_any()
    return model


def _term(table: Mapping[str, Any], faults: TableFaults) -> Term | None:
    effect = _effect(table, faults)
    if effect is None:
        return None
    known = {p.name: p for p in effect.parameters}
    values: dict[str, float] = {}
    for name in table:
        if name in ("effect", "where") or (name == "knots" and effect.table is not None):
            continue
        if name not in known:
            faults.unknown(name, ["effect", "where", *known, *(["knots"] if effect.table else [])])
            continue
        p = known[name]
        number = faults.number(table, name, low=p.low, high=p.high, unit=p.unit)
        if number is not None:
            values[name] = number
    where = table.get("where")
    if where is not None and (not isinstance(where, str) or where not in effect.places):
        places = ", ".join(effect.places) or "no place: it acts on the whole car"
        faults.add("where", f"{effect.name} cannot sit at {repr(where)[:40]}; expected {places}")
        where = None
    return Term(effect, values, where, _knots(table, effect, faults))


def _knots(table: Mapping[str, Any], effect: Effect, faults: TableFaults) -> Knots:
    given = table.get("knots")
    if given is None or effect.table is None:
        return ()
    pairs = [p for p in given if isinstance(p, list) and len(p) == 2] if isinstance(given, list) else []
    if not pairs or len(pairs) != len(given) or not all(is_number(x) for p in pairs for x in p):
        t = effect.table
        faults.add("knots", f"knots = {str(given)[:40]} is not a list of pairs [{t.x} [{t.x_unit}], value [{t.unit}]]")
        return ()
    knots = tuple((float(x), float(value)) for x, value in pairs)
    fault = effect.table.fault(knots)
    if fault is not None:
        faults.add("knots", f"{effect.name}: {fault}")
        return ()
    return knots


def _effect(table: Mapping[str, Any], faults: TableFaults) -> Effect | None:
    name = table.get("effect")
    if name is None:
        faults.add("term", "term names no effect")
        return None
    if isinstance(name, str) and name in _KNOWN:
        return _KNOWN[name]
    near = difflib.get_close_matches(str(name), list(_KNOWN), n=1, cutoff=0.5)
    hint = f' (did you mean "{near[0]}"?)' if near else f"; known: {', '.join(_KNOWN)}"
    faults.add("effect", f"unknown effect {repr(name)[:40]}{hint}")
    return None


def dump_model(model: Model) -> str:
    """Return the TOML text of a model; `load_model` reads it back equal."""
    return "\n".join(_term_text(t) for t in model.terms)


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
