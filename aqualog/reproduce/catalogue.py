"""The claims of the thesis as data: statement and place."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from aqualog.core.errors import ConfigError

__all__ = ["COUNT", "KINDS", "Claim", "claims", "number_of", "read"]

COUNT = 118
KINDS = {
    "A": "identity",
    "S": "in a simulator",
    "M": "needs a measured log of that condition; a simulator can show its shape",
    "D": "rule or definition",
}


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the thesis.

    `where`: chapter, section, equation or figure; `kind` letters of `KINDS`: how it can be checked at all.
    """

    id: str
    where: str
    statement: str
    kind: str


def number_of(claim_id: str) -> int:
    """Its number, for sorting: 7 of C7."""
    return int(claim_id[1:])


@cache
def claims() -> dict[str, Claim]:
    """All claims by id, C1 first.

    Raises
    ------
    ConfigError
        If the file is not whole.
    """
    text = files("aqualog.reproduce").joinpath("claims.toml").read_text(encoding="utf-8")
    return read(tomllib.loads(text))


def read(raw: dict[str, Any]) -> dict[str, Claim]:
    """Claims from the tables of the file.

    Raises
    ------
    ConfigError
        If a claim is missing, unknown, or empty.
    """
    wanted = [f"C{n}" for n in range(1, COUNT + 1)]
    if list(raw) != wanted:
        odd = [c for c in wanted if c not in raw] + [c for c in raw if c not in wanted]
        raise ConfigError(f"claims out of order, missing or unknown: {', '.join(odd) or 'order'}", where="claims.toml")
    found = {}
    for claim_id, table in raw.items():
        if set(table) != {"where", "kind", "statement"} or not all(isinstance(v, str) and v for v in table.values()):
            raise ConfigError("a claim has a place, a kind and a statement", where=f"claims.toml, {claim_id}")
        if not set(table["kind"]) <= set(KINDS):
            raise ConfigError(f"kind {table['kind']}", where=f"claims.toml, {claim_id}", expected=" ".join(KINDS))
        found[claim_id] = Claim(claim_id, **table)
    return found
