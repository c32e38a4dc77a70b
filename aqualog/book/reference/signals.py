"""Signals: names, units, ranges, the simulated truth, and the spellings of units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from aqualog.book.markdown import code, number, page, table
from aqualog.core.notation import ACCEPTED, SYMBOLS, WHEELS, Symbol
from aqualog.core.units import spellings
from aqualog.features.names import FEATURES
from aqualog.model.simulate import TRUTH_SYMBOLS

__all__ = ["signals_page"]

_SUMMARY = "Names, units and ranges of all signals, and the spellings of units that aqualog understands."
_HOW = """
aqualog works in SI units and radians. Axes follow ISO 8855 [iso8855_2011]: x forward, y to the left, z up.
The wheels are `fl`, `fr`, `rl` and `rr`. A channel that bears a name of this page needs no entry in a
[signal map](map.md). Every signal is optional; [`aqualog doctor`](commands.md) reports which detector lacks which
signal.

A sample outside the range counts as a fault. aqualog leaves it out, counts it and reports it.
"""
_OTHER = """
A log may also bear these names. They become canonical signals on reading.
"""
_TRUTH = """
A simulated log carries the truth beside the signals. No detector reads a signal that begins with `true_`;
`aqualog evaluate` compares with them.
"""
_FEATURES = """
`Detection.features` of the [Python face](python.md) holds these columns for each sample. A name ends in the wheel,
side, criterion or detector that it belongs to. A column is missing where its signals are.
"""
_UNITS = """
CSV headers carry the unit in brackets: `omega_fl [rad/s]`. Other formats carry it in their description, or the map
gives it. Spellings in one row mean the same unit. A spelling that is not here is an error, which names the nearest one.
A mapped channel without a unit counts as SI, and a note says so.
"""


def signals_page() -> str:
    """The page."""
    return page(
        "Signals",
        _SUMMARY,
        _HOW,
        "## Canonical signals",
        _symbols(SYMBOLS),
        "## Accepted beside them",
        _OTHER,
        _symbols(ACCEPTED),
        "## The truth in simulated logs",
        _TRUTH,
        table(("signal", "unit", "meaning"), _truth()),
        "## Features",
        _FEATURES,
        table(
            ("feature", "unit", "meaning", "made by"), [(code(f.shown), f.unit, f.meaning, f.made_by) for f in FEATURES]
        ),
        "## Units",
        _UNITS,
        table(("quantity", "one unit in SI", "spellings"), _units()),
    )


def _symbols(symbols: Mapping[str, Symbol]) -> str:
    rows = [
        (_names(s.name, symbols), s.unit, s.meaning, f"{number(s.low)} ... {number(s.high)}", s.kind)
        for s in symbols.values()
        if not _is_repeated(s.name, symbols)
    ]
    return table(("signal", "unit", "meaning", "range", "kind"), rows)


def _truth() -> Iterable[tuple[str, str, str]]:
    for name, (unit, meaning) in TRUTH_SYMBOLS.items():
        if not _is_repeated(name, TRUTH_SYMBOLS):
            said = meaning.removeprefix("simulated truth: ")
            yield _names(name, TRUTH_SYMBOLS), unit, said.removesuffix(f", {WHEELS[0]}")


def _stem(name: str) -> str:
    return re.sub(rf"_({'|'.join(WHEELS)})$", "", name)


def _is_repeated(name: str, names: Iterable[str]) -> bool:
    """Whether a row of the same stem stands before."""
    return next(n for n in names if _stem(n) == _stem(name)) != name


def _names(name: str, names: Iterable[str]) -> str:
    """All names of one stem."""
    return ", ".join(code(n) for n in names if _stem(n) == _stem(name))


def _units() -> Iterable[tuple[str, str, str]]:
    for unit, listed in spellings():
        size = f"{unit.factor:.6g}" + (f", offset {unit.offset:g}" if unit.offset else "")
        yield unit.dimension.replace("_", " "), size, " ".join(code(s) for s in listed)
