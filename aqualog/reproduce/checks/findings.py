"""Checks that the figures themselves hold: their findings."""

from __future__ import annotations

from functools import partial

from aqualog.figures.catalogue import make
from aqualog.figures.record import Figure
from aqualog.reproduce.check import Checks, Maker, Plan, from_finding

__all__ = ["CHECKS", "JUDGED", "SEEDS", "of_figure"]

SEEDS: tuple[int, ...] = ()  # the figures have their own

JUDGED: dict[str, tuple[str, ...]] = {
    "2.8": ("C28",), "2.9": ("C29", "C32", "C33"), "2.21": ("C61",), "2.22": ("C60", "C62"), "2.23": ("C59", "C63"),
    "2.25": ("C72", "C73", "C74", "C75", "C76", "C77"), "3.1": ("C81", "C82"), "3.2": ("C90",), "3.3": ("C92",),
    "3.4": ("C93",), "3.5": ("C94", "C95"), "3.6": ("C104",), "3.7": ("C96", "C97", "C99", "C105", "C107"),
    "3.8": ("C106",), "3.9": ("C108", "C109"), "3.10": ("C110", "C111", "C112", "C113"), "3.11": ("C114",),
}  # fmt: skip
"""Figures that are made without a campaign, and the claims that they judge."""


def of_figure(figure: Figure) -> Checks:
    """The checks in a figure that has been made already."""
    return tuple(from_finding(f, figure.number) for f in figure.findings)


def _made(number: str, _: Plan) -> Checks:
    return of_figure(make(number))


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = tuple(
    (claims, partial(_made, number)) for number, claims in JUDGED.items()
)
