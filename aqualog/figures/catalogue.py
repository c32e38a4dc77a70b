"""Which figures there are, and how one asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

from aqualog.errors import ConfigError
from aqualog.figures.record import Figure, stem_of

__all__ = ["NUMBERS", "chosen", "make"]

_CHAPTER_2 = ("2.8", "2.9", "2.21", "2.22", "2.23", "2.25")
NUMBERS = (*_CHAPTER_2, *(f"3.{n}" for n in range(1, 12)))


def make(number: str) -> Figure:
    """Make a figure anew: its runs, panels and findings.

    Parameters
    ----------
    number : str
        One of `NUMBERS`.
    """
    module = import_module(f"aqualog.figures.{stem_of(number).replace('figure', 'fig')}")
    figure: Figure = module.make()
    return figure


def chosen(asked: Sequence[str]) -> tuple[str, ...]:
    """Numbers behind what was typed, in the order of the thesis, each once.

    Parameters
    ----------
    asked : sequence of str
        Numbers as "3.6", a chapter as "3", or "all".

    Raises
    ------
    ConfigError
        If a figure is not there.
    """
    found: set[str] = set()
    for name in asked:
        chapter, _, figure = name.partition(".")
        # 3.06 is how the files are named
        plain = f"{chapter}.{int(figure)}" if figure.isdecimal() and figure.isascii() and len(figure) < 4 else name
        match = [n for n in NUMBERS if plain in ("all", n, n.split(".")[0])]
        if not match:
            made = f"; of chapter 2 there are {', '.join(_CHAPTER_2)}" if chapter == "2" else ""
            raise ConfigError(
                f"there is no figure {name[:40]!r}{made}", expected=f"all, 2, 3 or one of {' '.join(NUMBERS)}",
                hint="aqualog figures 3.6 -o DIR",
            )  # fmt: skip
        found.update(match)
    return tuple(n for n in NUMBERS if n in found)
