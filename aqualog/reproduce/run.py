"""The whole reproduction: figures and checks made side by side, and one verdict on each claim."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

from aqualog.campaign.samples import CampaignData
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.figures import catalogue as figure_catalogue
from aqualog.figures.evidence import Evidence
from aqualog.figures.record import Figure
from aqualog.reproduce.catalogue import Claim, claims, number_of
from aqualog.reproduce.check import Check, Checks, Plan
from aqualog.reproduce.checks import catalogue
from aqualog.reproduce.checks.findings import of_figure
from aqualog.reproduce.verdict import Verdict, combined
from aqualog.workers import Crashed, work_on

__all__ = ["Conclusion", "Made", "conclude", "make_all"]

Report = Callable[[int, int], None]

_FROM_CAMPAIGN = ("2.2", *figure_catalogue.OF_CAMPAIGN)
"""Scenes of single drives are simulated again: their claims need twenty seeds, and a campaign has one or three."""

_Task = tuple[str, str, int]  # "figure", number, 0; or "checks", module, index of its maker


@dataclass(frozen=True, slots=True)
class Made:
    """Figures and checks; `missing` number of a figure -> why it could not be made."""

    figures: tuple[Figure, ...]
    checks: Checks
    missing: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Conclusion:
    """A claim with all that was checked of it."""

    claim: Claim
    checks: Checks
    verdict: Verdict


def make_all(data: CampaignData, *, jobs: int, report: Report) -> Made:
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
    apart = [t for t in _tasks() if t[1] not in catalogue.WITH_PROCESSES]
    together = [t for t in _tasks() if t[1] in catalogue.WITH_PROCESSES]
    from_campaign = _FROM_CAMPAIGN
    total = len(apart) + len(together) + len(from_campaign)
    found: dict[_Task, Figure | Checks | str] = {}

    def record(task: _Task, result: Figure | Checks | str | Crashed) -> None:
        found[task] = "its process ended without a message" if isinstance(result, Crashed) else result
        report(len(found), total)

    report(0, total)
    evidence = Evidence(data)
    for number in from_campaign:
        record(("figure", number, 0), _campaign_figure(number, evidence))
    if jobs > 1:
        work_on({t: t for t in apart}, _make, jobs=jobs, record=record)
    else:
        for task in apart:
            record(task, _make(*task))
    for kind, module, index in together:
        record((kind, module, index), _checks(module, index, jobs))
    return _sorted(found)


def conclude(made: Made) -> tuple[Conclusion, ...]:
    """One verdict on each claim, in their order.

    Raises
    ------
    ConfigError
        If a claim has no check.
    """
    checks = (*made.checks, *(c for f in made.figures for c in of_figure(f)))
    of: dict[str, list[Check]] = {}
    for check in checks:
        of.setdefault(check.claim, []).append(check)
    without = [c for c in claims() if c not in of]
    if without:
        raise ConfigError(f"claims without a check: {', '.join(sorted(without, key=number_of))}")
    return tuple(
        Conclusion(claim, tuple(of[name]), combined(c.verdict for c in of[name])) for name, claim in claims().items()
    )


def _tasks() -> list[_Task]:
    apart = [("figure", n, 0) for n in figure_catalogue.NUMBERS if n not in _FROM_CAMPAIGN]
    modules = [m for m in catalogue.MODULES if m != "findings"]  # those are of the figures, which are made here
    return [*apart, *(("checks", m, i) for m in modules for i in range(len(catalogue.makers(m))))]


def _make(kind: str, name: str, index: int) -> Figure | Checks | str:
    if kind == "checks":
        return _checks(name, index, 1)
    try:
        return figure_catalogue.make(name)
    except (AqualogError, ArithmeticError, ValueError, LookupError) as error:
        return str(error)


def _campaign_figure(number: str, evidence: Evidence) -> Figure | str:
    try:
        return figure_catalogue.make(number, evidence)
    except (AqualogError, ArithmeticError, ValueError, LookupError) as error:
        return str(error)


def _checks(module: str, index: int, jobs: int) -> Checks:
    seeds: Sequence[int] = import_module(f"aqualog.reproduce.checks.{module}").SEEDS
    _, make = catalogue.makers(module)[index]
    return make(Plan(seeds, jobs))


def _sorted(found: Mapping[_Task, Figure | Checks | str]) -> Made:
    figures = {t[1]: r for t, r in found.items() if t[0] == "figure" and isinstance(r, Figure)}
    missing = {t[1]: r for t, r in found.items() if t[0] == "figure" and isinstance(r, str)}
    lost = [f"{t[1]}: {r}" for t, r in found.items() if t[0] == "checks" and isinstance(r, str)]
    if lost:
        raise ConfigError(f"checks could not be made: {'; '.join(lost)}", hint=f"fewer --jobs than {os.cpu_count()}")
    of_tasks = (found[task] for task in _tasks() if task[0] == "checks")
    checks = tuple(c for made in of_tasks if isinstance(made, tuple) for c in made)
    order = [n for n in figure_catalogue.NUMBERS if n in figures]
    return Made(tuple(figures[n] for n in order), checks, missing)
