"""Arguments of the face, as users give them: paths, names and numbers. A wrong type is a TypeError that names it."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from aqualog.core.errors import AqualogError, ConfigError

__all__ = ["check_name", "file_of", "names_of", "number_of", "text_of", "whole_number"]

_SHOWN = 60  # characters of a name that cannot be one


def names_of(given: object, what: str = "logs") -> list[str]:
    """Return one path or several as they were named.

    Raises
    ------
    TypeError
        If it is neither.
    """
    if isinstance(given, str | Path):
        return [str(given)]
    if isinstance(given, bytes | bytearray | Mapping) or not isinstance(given, Iterable):
        raise TypeError(f"{what}: expected str or Path, one or several, not {type(given).__name__}")
    names = list(given)
    odd = next((n for n in names if not isinstance(n, str | Path)), None)
    if odd is not None or None in names:
        raise TypeError(f"{what}: expected str or Path, one or several; {type(odd).__name__} is among them")
    return [str(n) for n in names]


def file_of(given: object, what: str, other: str = "") -> Path:
    """Return a path that names a file; `other` is what could have been given in its place.

    Raises
    ------
    TypeError
        If it is no path.
    ConfigError
        If no file can have this name.
    """
    if not isinstance(given, str | Path):
        raise TypeError(f"{what}: expected str or Path{f' or {other}' if other else ''}, not {type(given).__name__}")
    path = Path(given)
    check_name(path)
    return path


def check_name(path: Path) -> None:
    """Refuse a name that no file can have.

    Raises
    ------
    ConfigError
        If it holds a NUL character.
    AqualogError
        If it is too long.
    """
    shown = repr(str(path))[:_SHOWN]
    try:
        os.lstat(path)
    except ValueError as error:
        raise ConfigError(f"{shown} is no name of a file", expected="a name without NUL characters") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise AqualogError(
                f"{shown}... is too long for the name of a file ({len(str(path))} characters)"
            ) from error


def text_of(given: object, what: str) -> str:
    """Return a text.

    Raises
    ------
    TypeError
        If it is not a text.
    """
    if not isinstance(given, str):
        raise TypeError(f"{what}: expected a text, not {type(given).__name__}")
    return given


def whole_number(given: object, what: str, low: int, high: int) -> int:
    """Return a whole number of a range.

    Raises
    ------
    TypeError
        If it is no whole number.
    ConfigError
        If it is out of range.
    """
    if isinstance(given, bool) or not hasattr(given, "__index__"):
        raise TypeError(f"{what}: expected a whole number, not {type(given).__name__}")
    number = int(given.__index__())
    if not low <= number <= high:
        raise ConfigError(f"{what} = {number}", expected=f"{low} to {high}")
    return number


def number_of(given: object, what: str, low: float, high: float, unit: str = "") -> float:
    """Return a number of a range.

    Raises
    ------
    TypeError
        If it is no number.
    ConfigError
        If it is out of range or not finite.
    """
    if isinstance(given, bool | str) or not hasattr(given, "__float__"):
        raise TypeError(f"{what}: expected a number, not {type(given).__name__}")
    number = float(given.__float__())
    if not (math.isfinite(number) and low <= number <= high):
        raise ConfigError(f"{what} = {number:g}", expected=f"{low:g} to {high:g} {unit}".rstrip())
    return number
