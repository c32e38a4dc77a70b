"""The figures of the thesis as data (`figures.toml`), and their names on the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any

from aqualog.core.errors import ConfigError
from aqualog.thesis.claims import Check
from aqualog.thesis.record import Figure, Panel, RunsUsed, Table

__all__ = ["NUMBERS", "OF_CAMPAIGN", "Wish", "chosen", "figure_of", "needs_campaign", "needs_of", "rows"]


@dataclass(frozen=True, slots=True)
class Wish:
    """The selection of a figure.

    `varies` are families; of several the first is compared, within each value of the others, or with `any_one` each of
    them. Values of the thesis, used where the campaign has them too: `tyre` words for the tyre or its wear, best first;
    `pressure` `lowest` or `highest` of the campaign's; `depth_mm`. Always: no load, rear-wheel drive. `only_tyres`:
    words of the tyres that are shown, if there is one for each; `only_lowest_pressures`: how many.
    """

    varies: tuple[str, ...] = ()
    tyre: tuple[str, ...] = ()
    pressure: str = "lowest"
    depth_mm: float | None = None
    any_one: bool = False
    only_tyres: tuple[tuple[str, ...], ...] = ()
    only_lowest_pressures: int = 0


@dataclass(frozen=True, slots=True)
class Row:
    """A figure of the thesis.

    `family`: module of `aqualog.thesis.figures`; `caption`: settings, names in braces are filled in; `claims` that it
    bears; `made_from` what (theory, half_car, scenes, campaign, logs); `needs` of a campaign, in words; `wish` the
    runs of a campaign that are shown; `log` title, rule and needs where it is made from one run of a campaign.
    """

    family: str
    title: str
    caption: str
    claims: tuple[str, ...]
    made_from: tuple[str, ...]
    needs: str = ""
    wish: Wish = field(default_factory=Wish)
    log: Mapping[str, str] = field(default_factory=dict)


@cache
def rows() -> Mapping[str, Row]:
    """All figures by number, 2.1 first; W.1, on what others have published, comes last."""
    text = files("aqualog.thesis").joinpath("figures.toml").read_text(encoding="utf-8")
    return {number: _row(table) for number, table in tomllib.loads(text).items()}


def _row(table: dict[str, Any]) -> Row:
    wish = {k: _tuples(v) for k, v in table.pop("wish", {}).items()}
    return Row(**{k: _tuples(v) for k, v in table.items()}, wish=Wish(**wish))


def _tuples(value: Any) -> Any:
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


NUMBERS = tuple(rows())
OF_CAMPAIGN = tuple(n for n, r in rows().items() if r.made_from == ("campaign",))
"""Made from many runs only."""
WITHOUT = tuple(n for n in NUMBERS if n not in OF_CAMPAIGN)
"""Made without a campaign too."""


def needs_campaign(number: str) -> bool:
    """Whether a figure cannot be made without a campaign."""
    return number in OF_CAMPAIGN


def needs_of(number: str) -> str:
    """What a figure needs of a campaign, in words."""
    return rows()[number].needs


def figure_of(
    number: str,
    panels: Sequence[Panel],
    checks: Iterable[Check | None] = (),
    tables: Sequence[Table] = (),
    *,
    runs: RunsUsed | None = None,
    **words: object,
) -> Figure:
    """A figure with its title and caption; `words` fill the caption. A check that the runs do not allow is None."""
    row = rows()[number]
    return Figure(
        number,
        row.title,
        row.caption.format(**words),
        tuple(panels),
        tuple(c for c in checks if c is not None),
        tuple(tables),
        runs,
    )


def chosen(asked: Sequence[str]) -> tuple[str, ...]:
    """Figure numbers for the typed names, in the order of the thesis, each once.

    Parameters
    ----------
    asked : sequence of str
        Numbers as "3.6", a chapter as "3", "W.1" for what others have published, or "all".

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
            raise ConfigError(
                f"there is no figure {name[:40]!r}", expected="all, 2, 3 or one of 2.1 to 2.25, 3.1 to 3.11 and W.1",
                hint="aqualog figures 3.6 -o DIR",
            )  # fmt: skip
        found.update(match)
    return tuple(n for n in NUMBERS if n in found)
