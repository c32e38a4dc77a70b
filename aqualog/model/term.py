"""A model is the base simulation plus a set of terms; a term is one physical effect with its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from aqualog.core.errors import ConfigError
from aqualog.model.plant import Plant
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import Sensors

__all__ = ["Effect", "Knots", "Model", "Parameter", "Setup", "Table", "Term"]

Knots = tuple[tuple[float, float], ...]


class Setup(NamedTuple):
    """All parts of a simulation; terms turn one setup into another."""

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
class Table:
    """A function that an effect has instead of parameters: knots with a straight line between neighbours.

    Over `x` [x_unit], within `x_low` ... `x_high`; values in `unit`, within `low` ... `high`. `apply` is pure and adds
    the function to that of the setup; beyond its ends the function is constant.
    """

    x: str
    x_unit: str
    x_low: float
    x_high: float
    unit: str
    low: float
    high: float
    apply: Callable[[Setup, Knots, str | None], Setup]

    def fault(self, knots: Knots) -> str | None:
        """Say what is wrong with knots; None if they are valid."""
        if len(knots) < 2:
            return f"{len(knots)} knots, at least 2 are needed"
        for x, value in knots:
            if not self.x_low <= x <= self.x_high:
                return f"a knot at {x:g} is outside {self.x_low:g} ... {self.x_high:g} {self.x_unit}"
            if not self.low <= value <= self.high:
                return f"a value of {value:g} is outside {self.low:g} ... {self.high:g} {self.unit}"
        if any(b[0] <= a[0] for a, b in pairwise(knots)):
            return f"the knots do not rise in {self.x}"
        return None


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical effect that a model may have.

    `target`: the quantity that it changes. `places`: where it may sit, as `fl`, `f`, `left`, a signal's name; empty:
    the whole car. `default`: place if none is given (None: the car). `apply` is pure and returns a new setup.
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
    table: Table | None = None


@dataclass(frozen=True, slots=True)
class Term:
    """An effect with values; parameters that are not named keep their neutral value.

    `knots` (x, value) are for an effect with a table; without knots, or with all values zero, it is neutral.

    Raises
    ------
    ConfigError
        If a parameter, place or table does not belong to the effect, or a value is outside its physical bounds.
    """

    effect: Effect
    values: Mapping[str, float] = field(default_factory=dict)
    where: str | None = None
    knots: Knots = ()

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
        if self.knots:
            if self.effect.table is None:
                raise ConfigError(f"{self.effect.name} has no table of knots")
            fault = self.effect.table.fault(self.knots)
            if fault is not None:
                raise ConfigError(f"{self.effect.name}: {fault}")

    @property
    def place(self) -> str | None:
        """Return its place: the one that is named, or else the effect's own; None: the whole car."""
        return self.where or self.effect.default

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this effect in it."""
        values = {p.name: float(self.values.get(p.name, p.neutral)) for p in self.effect.parameters}
        setup = self.effect.apply(setup, values, self.place)
        if self.effect.table is None or all(value == 0.0 for _, value in self.knots):
            return setup
        return self.effect.table.apply(setup, self.knots, self.place)


@dataclass(frozen=True, slots=True)
class Model:
    """The base simulation and the terms on top of it, in order."""

    terms: tuple[Term, ...] = ()

    @classmethod
    def read(cls, path: str | Path) -> Model:
        """Read a model file (TOML), as `aqualog diagnose` writes it.

        Raises
        ------
        ConfigError
            With all faults of the file in one message.
        """
        from aqualog.config.model import load_model

        return load_model(Path(path))

    def with_term(self, term: Term) -> Model:
        """Return a new model with one term more.

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
        """Return the setup with all terms in it."""
        for term in self.terms:
            setup = term.apply(setup)
        return setup
