"""Split the headers of a table into names and units."""

from __future__ import annotations

import re
from collections.abc import Sequence

from aqualog.core.units import is_unit

__all__ = ["split_unit", "unique_names"]

# Loggers do write `max. SoC [%)`: either closing bracket ends the group.
_SQUARE = re.compile(r"^(?P<name>.*?)(?P<space>\s*)\[(?P<unit>[^\[\]()]*(?:\([^()]*\)[^\[\]()]*)?)[\])]$")
_ROUND = re.compile(r"^(?P<name>.*\S)(?P<space>\s*)[({](?P<unit>[^(){}]*)[)}]$")
_SLASH = re.compile(r"^(?P<name>.*\S)\s+(?:/|in)\s+(?P<unit>\S+)$")


def split_unit(header: str) -> tuple[str, str]:
    """Name and unit of a header cell: `v_x [km/h]` -> (`v_x`, `km/h`).

    A group in square brackets at the end is the unit, known or not, unless it is an index (`cell[3]`). A group in other
    brackets or behind a slash is one only if its spelling is known: `speed (filtered)` is a name.
    """
    text = " ".join(header.split())
    square = _SQUARE.match(text)
    if square and square["name"] and not (square["unit"].isdigit() and not square["space"]):
        return square["name"].strip(), square["unit"].strip()
    for pattern in (_ROUND, _SLASH):
        other = pattern.match(text)
        if other and is_unit(other["unit"]):
            return other["name"].strip(), other["unit"].strip()
    return text, ""


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, those that come again as `name#2`, `name#3`; a column without a name is `column_1`, counted from 1."""
    taken = set(names)
    numbers: dict[str, int] = {}
    result = []
    for position, name in enumerate(names, start=1):
        own = name or f"column_{position}"
        wanted = own
        if own in numbers:  # counted on from the last one of that name: a header may repeat one thousands of times
            number = numbers[own] + 1
            while f"{own}#{number}" in taken:
                number += 1
            numbers[own] = number
            wanted = f"{own}#{number}"
            taken.add(wanted)
        numbers.setdefault(wanted, 1)
        result.append(wanted)
    return tuple(result)
