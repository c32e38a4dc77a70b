"""How a CSV file is written, as far as the user says it; the rest is found from the file."""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

__all__ = ["CsvFormat", "csv_hint", "format_fault", "format_of"]

_DECIMALS = (".", ",")
_NAMES = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
_NO_SEPARATOR = set("\"'+-.\r\n")


@dataclass(frozen=True, slots=True)
class CsvFormat:
    """Separator (one character), decimal sign (`.` or `,`) and encoding (a name that Python knows); empty: not said."""

    separator: str = ""
    decimal: str = ""
    encoding: str = ""

    @classmethod
    def of(cls, table: Mapping[str, str]) -> CsvFormat:
        """From the keys of a map; a separator may be named `tab`, `comma`, `semicolon` or `space`."""
        separator = table.get("separator", "")
        return cls(_NAMES.get(separator, separator), table.get("decimal", ""), table.get("encoding", ""))


def format_fault(key: str, value: object) -> str:
    """Say what is wrong with one of these keys; empty if it is valid."""
    if not isinstance(value, str) or not value:
        return f"{key} = {str(value)[:40]!r} is no text"
    if key == "separator":
        sign = _NAMES.get(value, value)
        if len(sign) != 1 or sign.isalnum() or sign in _NO_SEPARATOR:
            return f'separator = "{value[:40]}" separates no cells; use one of , ; | tab space or another single sign'
    if key == "decimal" and value not in _DECIMALS:
        return f'decimal = "{value[:40]}" is no decimal sign; use . or ,'
    if key == "encoding" and not _is_encoding(value):
        return (
            f'encoding = "{value[:40]}" is not known; use utf-8, cp1252, utf-16-le, shift_jis or another of Python\'s'
        )
    return ""


def _is_encoding(name: str) -> bool:
    try:
        codecs.lookup(name)
        return "a".encode(name).decode(name) == "a"
    except (LookupError, ValueError, AttributeError, TypeError):  # among them codecs that make no text
        return False


def format_of(formats: Mapping[str, CsvFormat], file: str) -> CsvFormat:
    """What is said of a file: under its own name or pattern, else under `*`."""
    own = (f for pattern, f in formats.items() if pattern != "*" and fnmatchcase(file, pattern))
    return next(own, formats.get("*", CsvFormat()))


def csv_hint(*keys: str) -> str:
    """How to say it."""
    examples = {"separator": 'separator = ";"', "decimal": 'decimal = ","', "encoding": 'encoding = "cp1252"'}
    return f"say it in a signal map: [csv] {' '.join(examples[k] for k in keys)}"
