"""A model is the base simulation plus a set of terms; a term is one physical effect with its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from aqualog.errors import ConfigError
from aqualog.model.plant import Plant
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import Sensors

__all__ = ["Effect", "Model", "Parameter", "Setup", "Term"]


class Setup(NamedTuple):
    """All that a simulation is made of; terms turn one into another."""

    plant: Plant
    sensors: Sensors
    scenario: Scenario


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    `neutral` gives the base model bit for bit; the prior is a normal distribution of standard deviation `sigma` around
    it; a value outside `low` ... `high` is not physical; `smallest` is the smallest deviation worth naming.
    """

    name: str
    unit: str
    neutral: float
    sigma: float
    low: float
    high: float
    smallest: float
    meaning: str


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical effect that a model may have.

    `target` is what it acts on; `places` where it may sit: `fl`, `f`, `left`, a signal's name; empty: the whole car.
    `default` place if none is given (None: the car). `apply` is pure and returns a new setup.
    """

    name: str
    target: str
    sentence: str
    source: str
    parameters: tuple[Parameter, ...]
    apply: Callable[[Setup, Mapping[str, float], str | None], Setup]
    places: tuple[str, ...] = ()
    default: str | None = None
    twins: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Term:
    """An effect with values; parameters that are not named keep their neutral value.

    Raises
    ------
    ConfigError
        If a parameter or place does not belong to the effect, or a value is outside its physical bounds.
    """

    effect: Effect
    values: Mapping[str, float] = field(default_factory=dict)
    where: str | None = None

    def __post_init__(self) -> None:
        known = {p.name: p for p in self.effect.parameters}
        for name, value in self.values.items():
            if name not in known:
                raise ConfigError(f"{self.effect.name} has no parameter {name}", expected=", ".join(known))
            p = known[name]
            if not p.low <= value <= p.high:
                raise ConfigError(f"{self.effect.name}.{name} = {value:g} is outside {p.low:g} ... {p.high:g} {p.unit}")
        if self.where is not None and self.where not in self.effect.places:
            raise ConfigError(
                f"{self.effect.name} cannot sit at {self.where}",
                expected=", ".join(self.effect.places) or "no place: it acts on the whole car",
            )

    @property
    def place(self) -> str | None:
        """Where it sits: the place that is named, or else the effect's own; None: the whole car."""
        return self.where or self.effect.default

    def apply(self, setup: Setup) -> Setup:
        """The setup with this effect in it."""
        values = {p.name: float(self.values.get(p.name, p.neutral)) for p in self.effect.parameters}
        return self.effect.apply(setup, values, self.place)


@dataclass(frozen=True, slots=True)
class Model:
    """The base simulation and the terms on top of it, in order."""

    terms: tuple[Term, ...] = ()

    def with_term(self, term: Term) -> Model:
        """A new model with one term more.

        Raises
        ------
        ConfigError
            If the same effect sits at the same place already.
        """
        if any(t.effect is term.effect and t.place == term.place for t in self.terms):
            place = f" at {term.place}" if term.place else ""
            raise ConfigError(f"{term.effect.name}{place} is in the model already", hint="one term with the sum")
        return Model((*self.terms, term))

    def apply(self, setup: Setup) -> Setup:
        """The setup with all terms in it."""
        for term in self.terms:
            setup = term.apply(setup)
        return setup
