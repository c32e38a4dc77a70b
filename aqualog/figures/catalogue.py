"""List of figures, their names on the command line, and the data of each."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from aqualog.core.errors import ConfigError
from aqualog.figures.record import Figure, stem_of

if TYPE_CHECKING:
    from aqualog.figures.evidence import Evidence

__all__ = ["NUMBERS", "OF_CAMPAIGN", "WITHOUT", "chosen", "make", "needs_campaign"]

OF_CAMPAIGN = ("2.3", "2.4", "2.5", "2.6", "2.7", *(f"2.{n}" for n in range(10, 21)))
"""Made from many runs only."""
_EITHER = ("2.8", "2.9", "2.21", "2.22", "2.23", "2.25")  # from simulated scenes, or from a campaign's own logs
_MORE = ("2.2",)  # computed, with measurements of a campaign for comparison
NUMBERS = (*(f"2.{n}" for n in range(1, 26)), *(f"3.{n}" for n in range(1, 12)))
WITHOUT = tuple(n for n in NUMBERS if n not in OF_CAMPAIGN)
"""Made without a campaign too."""


def needs_campaign(number: str) -> bool:
    """Whether a figure cannot be made without a campaign."""
    return number in OF_CAMPAIGN


def make(number: str, evidence: Evidence | None = None) -> Figure:
    """Make a figure: its runs, panels and findings.

    Parameters
    ----------
    number : str
        One of `NUMBERS`.
    evidence : Evidence, optional
        A campaign's results. Without them figures are computed or simulated.

    Raises
    ------
    NotInCampaign
        If the campaign does not have the runs.
    ConfigError
        If the figure needs a campaign and no campaign is given.
    """
    if evidence is None and needs_campaign(number):
        raise ConfigError(
            "needs the runs of a campaign", where=f"figure {number}", expected="--campaign campaign.toml",
            hint="`aqualog reproduce`, or `aqualog simulate campaign thesis -o DIR` and its campaign.toml",
        )  # fmt: skip
    if evidence is not None and number in _EITHER:
        from aqualog.figures.log_figures import make_from_logs

        return make_from_logs(number, evidence)
    module = import_module(f"aqualog.figures.{stem_of(number).replace('figure', 'fig')}")
    with_data = evidence is not None and (needs_campaign(number) or number in _MORE)
    figure: Figure = module.make(evidence) if with_data else module.make()
    return figure


def chosen(asked: Sequence[str]) -> tuple[str, ...]:
    """Figure numbers for the typed names, in the order of the thesis, each once.

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
            raise ConfigError(
                f"there is no figure {name[:40]!r}", expected="all, 2, 3 or one of 2.1 to 2.25 and 3.1 to 3.11",
                hint="aqualog figures 3.6 -o DIR",
            )  # fmt: skip
        found.update(match)
    return tuple(n for n in NUMBERS if n in found)
