"""A model is the base simulation plus a set of terms; a term is one physical effect with its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.model.plant import Plant
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import Sensors

__all__ = [
    "CampaignSearch", "Check", "DayToDay", "DriveSearch", "Effect", "Kind", "Knots", "Model", "Need", "Parameter",
    "Setup", "Table", "Term",
]  # fmt: skip

Kind = Literal["", "inertia", "drag", "rolling"]  # of the differences between drives of the same car
Belongs = Literal["car", "tyre", "drive", "moment"]
Need = Literal["water depth", "wheel torque", "wheel speeds", "a_x or wheel torque"]

Knots = tuple[tuple[float, float], ...]


class Setup(NamedTuple):
    """All parts of a simulation; terms turn one setup into another."""

    plant: Plant
    sensors: Sensors
    scenario: Scenario


@dataclass(frozen=True, slots=True)
class DayToDay:
    """How a parameter looks like a difference between drives of the same car.

    `value` turns the standard deviation of its kind into one of the parameter, at a place and a speed [m/s]: a share of
    the mass (inertia), a drag area [m²] (drag), a coefficient (rolling). `key`: key of the vehicle file whose value and
    spread are the parameter's own, at the whole car.
    """

    kind: Kind
    value: Callable[[float, Vehicle, str | None, float], float]
    key: str = ""


@dataclass(frozen=True, slots=True)
class Check:
    """A value that is read without driving: of one parameter, with standard deviation `sd` in its unit."""

    name: str
    how: str
    minutes: float
    where: tuple[str | None, ...]
    parameter: str
    sd: float


@dataclass(frozen=True, slots=True)
class DriveSearch:
    """How a diagnosis of drives searches for an effect.

    `needs`: what a log must hold; `at_full_rate`: faster than blocks of 0.1 s, so the search leaves it out.
    `places` where it is searched, None the whole car; empty: the car, both axles where it acts on wheels, and with
    `by_wheel` every wheel. The first `count` parameters are sought; `variants` are values of the others, by the
    length of the longest drive [s]. Of a single drive, the response of the effect `begins_like` shows where this one
    begins, in place of variants.

    `tolerance`: standard deviation that is not worth naming; None: a third of the smallest size, 0: a car has the
    effect or not; `tolerance_at` some places. `axle_key`: start of an axle's key in the vehicle file, which the first
    parameter changes. `equals`: sets of effects that together look like this one on every log. `check`: how it is read
    without driving.

    `turns`: the sign changes on the way back; `is_shift`: it moves signals in time; `is_relative`: at all its places
    together it changes nothing; `is_single`: it counts once per car, wherever it acts; `is_quick`: it acts within
    10 ms, so that only short steps show it; `divides`: it acts as one over its value, so a straight line overshoots.
    `doubt`: share by which another law of the tyre may respond. `most_free`: bound of the first parameter at wheels
    that are not driven; `of_motors`: an axle has it by itself only where the other one is driven, too.
    """

    needs: tuple[Need, ...] = ()
    at_full_rate: bool = False
    places: tuple[str | None, ...] = ()
    by_wheel: bool = False
    count: int = 1
    variants: Callable[[float], Sequence[Mapping[str, float]]] = lambda _: ({},)
    begins_like: str = ""
    tolerance: float | None = None
    tolerance_at: Mapping[str, float] = field(default_factory=dict)
    doubt: float = 0.0
    axle_key: str = ""
    equals: tuple[tuple[str, ...], ...] = ()
    check: Check | None = None
    turns: bool = False
    is_shift: bool = False
    is_relative: bool = False
    is_single: bool = False
    is_quick: bool = False
    divides: bool = False
    most_free: float = math.inf
    of_motors: bool = False


@dataclass(frozen=True, slots=True)
class CampaignSearch:
    """How a diagnosis of a campaign searches for an effect: as number `order`, at `places` (None: all wheels).

    `driven`: only at axles that are driven. `sentence` names the place as `{place}` or `{Place}`, and the values, times
    `scale`, as `{0.value}`, `{0.low}` and `{0.high}`.
    """

    order: int
    places: tuple[str | None, ...]
    sentence: str
    driven: bool = False
    scale: float = 1.0


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
    day_to_day: DayToDay | None = None

    @property
    def step(self) -> float:
        """Step of finite differences: of the order that is expected, toward the side that has more room."""
        size = 0.5 * self.sigma
        return size if self.high - self.neutral >= size else -size

    @property
    def is_share(self) -> bool:
        """Whether it is a gain or a share, which is read in per cent."""
        return self.unit == "-" and (self.neutral == 1.0 or any(w in self.meaning for w in ("relative", "share")))


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
    the whole car. `default`: place if none is given (None: the car). `apply` is pure and returns a new setup. Of
    `[more|less]` in the sentence the second stands for a negative first value, which is then shown as positive.
    `shown`: factor and unit by which the sentence has the first value. `campaign` None: a campaign does not show it.
    `belongs`: what has it, and so which drives share its value; one of a drive or a moment differs from drive to drive.
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
    shown: tuple[float, str] | None = None
    drive: DriveSearch = DriveSearch()
    campaign: CampaignSearch | None = None
    belongs: Belongs = "car"

    @property
    def of_water(self) -> bool:
        """Whether it acts on water only."""
        return "water depth" in self.drive.needs


@dataclass(frozen=True, slots=True)
class Term:
    """An effect with values; parameters that are not named keep their neutral value.

    `knots` (x, value) are for an effect with a table; without knots, or with all values zero, it is neutral. `drive`:
    name of the only drive that has it; empty: every drive.

    Raises
    ------
    ConfigError
        If a parameter, place or table does not belong to the effect, or a value is outside its physical bounds.
    """

    effect: Effect
    values: Mapping[str, float] = field(default_factory=dict)
    where: str | None = None
    knots: Knots = ()
    drive: str = ""

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
    """The base simulation and the terms on top of it, in order; `car`: name of the one it was found on, if known."""

    terms: tuple[Term, ...] = ()
    car: str = field(default="", compare=False)

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
        if any((t.effect, t.place, t.drive) == (term.effect, term.place, term.drive) for t in self.terms):
            place = f" at {term.place}" if term.place else ""
            raise ConfigError(f"{term.effect.name}{place} is in the model already", hint="one term with the sum")
        return replace(self, terms=(*self.terms, term))

    def of(self, drive: str) -> Model:
        """Return the model of a drive by its name, without the terms of others; of no name: what all drives share."""
        if all(t.drive in ("", drive) for t in self.terms):
            return self
        return Model(tuple(t for t in self.terms if t.drive in ("", drive)))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with all terms in it."""
        for term in self.terms:
            setup = term.apply(setup)
        return setup
