"""List of the modules of checks, their claims, and how they are run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from importlib import import_module

from aqualog.reproduce.check import Checks, Maker, Plan

__all__ = ["MODULES", "WITH_PROCESSES", "claims_of", "makers", "run"]

MODULES = (
    "findings", "contact", "friction_estimate", "wheels", "traction_limit", "resistance_rules", "resistance_parameters",
    "slope_rules", "joint_rules", "joint_sum", "differential", "estimator", "half_car", "excitation", "logs",
    "contact_loss", "spin_down", "spin", "resistance", "resistance_variants", "slip_slope", "slip_slope_variants",
    "joint",
)  # fmt: skip
"""In the package aqualog.reproduce.checks. Each has `CHECKS`, pairs of the claims and the function that makes their
checks, and `SEEDS`, those that its numbers are reported from."""

WITH_PROCESSES = (
    "wheels", "traction_limit", "resistance_rules", "slope_rules", "joint_rules", "logs",
    "contact_loss", "spin_down", "spin", "resistance", "resistance_variants", "slip_slope", "slip_slope_variants",
    "joint",
)  # fmt: skip
"""Modules that share what they have simulated, and spread the rest over processes themselves."""


def makers(module: str) -> tuple[tuple[tuple[str, ...], Maker], ...]:
    """Checks of a module: claims and function."""
    found: tuple[tuple[tuple[str, ...], Maker], ...] = import_module(f"aqualog.reproduce.checks.{module}").CHECKS
    return found


def claims_of(modules: Sequence[str] = MODULES) -> frozenset[str]:
    """Claims that the modules are about."""
    return frozenset(c for m in modules for ids, _ in makers(m) for c in ids)


def run(
    only: Collection[str] | None = None,
    *,
    modules: Sequence[str] = MODULES,
    jobs: int = 1,
    tell: Callable[[str], None] | None = None,
) -> Checks:
    """Make the checks.

    Parameters
    ----------
    only : collection of str, optional
        Requested claims; a function that also checks others is run as a whole.
    modules : sequence of str
    jobs : int
        Processes at most.
    tell : callable, optional
        Gets a sentence before each function.
    """
    found: list[Checks] = []
    for module in modules:
        seeds = import_module(f"aqualog.reproduce.checks.{module}").SEEDS
        for ids, make in makers(module):
            if only is None or set(ids) & set(only):
                if tell is not None:
                    tell(f"checking {', '.join(ids)}")
                found.append(make(Plan(seeds, jobs, tell)))
    return tuple(c for checks in found for c in checks if only is None or c.claim in only)
