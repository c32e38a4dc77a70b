"""One drive of a programme."""

from __future__ import annotations

from dataclasses import dataclass

from aqualog.core.vehicle import Vehicle
from aqualog.model.effects import EFFECTS
from aqualog.model.scenario import Scenario
from aqualog.model.term import Model, Term

__all__ = ["PlainTerm", "Run"]

PlainTerm = tuple[str, tuple[tuple[str, float], ...], str | None]  # effect, values, place


@dataclass(frozen=True, slots=True)
class Run:
    """One drive of a programme: its name (a file's stem), the drive, and its row in the campaign."""

    name: str
    scenario: Scenario
    manoeuvre: str
    figures: str  # figures of the thesis that it serves
    water_depth: float  # [m] nominal, right track; 0 for a dry run
    terms: tuple[PlainTerm, ...] = ()  # of the model, as data that another process can be given
    vehicle: Vehicle | None = None  # as the vehicle file has it; None: as it is driven

    @property
    def model(self) -> Model:
        """Return the model that the terms make."""
        return Model(tuple(Term(EFFECTS[name], dict(values), where) for name, values, where in self.terms))
