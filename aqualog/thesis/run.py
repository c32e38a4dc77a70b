"""The whole reproduction: figures and checks made side by side, and one verdict on each claim."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module

from aqualog.campaign.results import CampaignData
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.guard.worker import Crashed, work_on
from aqualog.thesis.catalogue import NUMBERS, OF_CAMPAIGN, needs_campaign, rows
from aqualog.thesis.claims import Check, Checks, Conclusion, claims, combined, number_of
from aqualog.thesis.evidence.campaign import Evidence
from aqualog.thesis.evidence.seeds import Maker, Plan
from aqualog.thesis.record import Figure

__all__ = ["Made", "conclude", "make", "make_all"]

_FROM_CAMPAIGN = ("2.2", *OF_CAMPAIGN)
"""Scenes of single drives are simulated again: their claims need twenty seeds, and a campaign has one or three."""
_CHECKS = ("contact", "wheels", "resistance", "slip_slope", "joint", "differential", "estimator", "excitation", "spins")


@dataclass(frozen=True, slots=True)
class Made:
    """Figures and checks; `missing` number of a figure -> why it could not be made."""

    figures: tuple[Figure, ...]
    checks: Checks
    missing: Mapping[str, str]


@cache
def makers() -> Mapping[str, Maker]:
    """Makers of the checks beside those that figures hold, by their claims: C9 C10."""
    modules = (import_module(f"aqualog.thesis.checks.{name}") for name in _CHECKS)
    return {" ".join(m.claims): m for module in modules for m in module.CHECKS}


def make(number: str, evidence: Evidence | None = None) -> Figure:
    """Make a figure: its runs, panels and checks.

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
    row = rows()[number]
    is_from_log = evidence is not None and "logs" in row.made_from
    figures = import_module(f"aqualog.thesis.figures.{'logs' if is_from_log else row.family}").FIGURES
    takes = is_from_log or (evidence is not None and "campaign" in row.made_from)
    figure: Figure = figures[number](number, evidence) if takes else figures[number]()
    return figure


def make_all(data: CampaignData, *, jobs: int, report: Callable[[int, int], None]) -> Made:
    """All figures, and all checks beside those that figures hold.

    Parameters
    ----------
    data : CampaignData
        The thesis' programme, measured.
    jobs : int
        Processes.
    report : callable
        Called with the numbers of finished tasks and of all tasks.

    Raises
    ------
    ConfigError
        If a check fails to run: a claim must not lose its verdict silently.
    """
    single = [*(n for n in NUMBERS if n not in _FROM_CAMPAIGN), *(k for k, m in makers().items() if not m.spreads)]
    total = len(NUMBERS) + len(makers())
    found: dict[str, Figure | Checks | str] = {}

    def record(task: str, result: Figure | Checks | str | Crashed) -> None:
        found[task] = "its process ended without a message" if isinstance(result, Crashed) else result
        report(len(found), total)

    report(0, total)
    evidence = Evidence(data)
    for number in _FROM_CAMPAIGN:
        record(number, _figure(number, evidence))
    if jobs > 1:
        work_on({task: (task,) for task in single}, _made, jobs=jobs, record=record)
    else:
        for task in single:
            record(task, _made(task))
    for task, maker in makers().items():
        if maker.spreads:
            record(task, maker.checks(Plan(maker.seeds, jobs)))
    figures = {n: r for n in NUMBERS if isinstance(r := found[n], Figure)}
    missing = {n: r for n in NUMBERS if isinstance(r := found[n], str)}
    lost = [f"{task}: {r}" for task in makers() if isinstance(r := found[task], str)]
    if lost:
        raise ConfigError(f"checks could not be made: {'; '.join(lost)}", hint=f"fewer --jobs than {os.cpu_count()}")
    checks = tuple(c for task in makers() if isinstance(r := found[task], tuple) for c in r)
    return Made(tuple(figures.values()), checks, missing)


def conclude(made: Made) -> tuple[Conclusion, ...]:
    """One verdict on each claim, in their order.

    Raises
    ------
    ConfigError
        If a claim has no check.
    """
    of_figures = (replace(c, source=f"figure {f.number}") for f in made.figures for c in f.checks)
    of: dict[str, list[Check]] = {}
    for check in (*made.checks, *of_figures):
        of.setdefault(check.claim, []).append(check)
    without = [c for c in claims() if c not in of]
    if without:
        raise ConfigError(f"claims without a check: {', '.join(sorted(without, key=number_of))}")
    return tuple(
        Conclusion(claim, tuple(of[name]), combined(c.verdict for c in of[name])) for name, claim in claims().items()
    )


def _made(task: str) -> Figure | Checks | str:
    if task in NUMBERS:
        return _figure(task)
    return makers()[task].checks()


def _figure(number: str, evidence: Evidence | None = None) -> Figure | str:
    """The figure, or why it could not be made."""
    try:
        return make(number, evidence)
    except (AqualogError, ArithmeticError, ValueError, LookupError) as error:
        return str(error)
