"""The record of a diagnosis, from which document, page and model file are made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.model.term import Model, Term

__all__ = [
    "AGREES", "SURE", "Agreement", "Alternative", "ByDrive", "Cause", "ChannelGain", "Confusion", "Consequence",
    "Diagnosis", "Estimate", "Gain", "Limit", "Manoeuvre", "Remainder", "ResidualView", "Significance", "Verdict",
    "tempered",
]  # fmt: skip

AGREES = 0.01  # p-value below which drives are reported to differ
SURE = 0.95  # probability from which a cause is named
# probability of a name, at the least and at the most: the posterior knows only the causes of the library. Of 86 that it
# held for certain, on drives of three other simulators, 0.92 (0.84 to 0.97) were there (D)
LEAST, MOST = 5e-5, 0.97

Verdict = Literal["no_effect", "named", "compound", "cannot_tell", "unexplained", "not_testable"]


@dataclass(frozen=True, slots=True)
class Estimate:
    """Value of a parameter in the simulator's unit with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, slots=True)
class Cause:
    """One effect that the measurement requires. `explains`: residual channels whose error it reduces; `probability`
    that the effect is there, NaN where no competition was held; `drives`: those that alone have it, of several."""

    effect: str
    where: str | None
    parameters: Mapping[str, Estimate]
    explains: tuple[str, ...]
    sentence: str
    probability: float = float("nan")
    drives: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """`tyre_radius@fl`, or the bare name for the whole car."""
        return self.effect if self.where is None else f"{self.effect}@{self.where}"

    @property
    def name(self) -> str:
        """By which probabilities add up, see `name_by_place`."""
        return name_by_place(self.effect, self.where)


def name_by_place(effect: str, where: str | None) -> str:
    """`tyre_radius` at any wheel, axle or side, which are places of one cause; `signal_delay@a_x`: each signal has its
    own."""
    return effect if where in (None, *WHEELS, *AXLES, *SIDES) else f"{effect}@{where}"


@dataclass(frozen=True, slots=True)
class ByDrive:
    """Value estimated from one drive alone. `gain` [nats (natural logarithm)]: gain of the log score on this drive with
    the value from the other drives, compared with no effect; negative where it predicts worse.
    """

    drive: str
    alone: Estimate
    others: float
    gain: float


@dataclass(frozen=True, slots=True)
class Agreement:
    """Whether drives agree on a value: `p_value` of their differing as much by chance. `key` of the cause."""

    key: str
    parameter: str
    drives: tuple[ByDrive, ...]
    p_value: float

    @property
    def holds(self) -> bool:
        """Drives agree, and each one is predicted better with the value of the others."""
        return self.p_value >= AGREES and all(d.gain > 0.0 for d in self.drives)


@dataclass(frozen=True, slots=True)
class Alternative:
    """A set of effects that explains the same; `evidence_ratio`: how many times less likely than the best."""

    causes: tuple[Cause, ...]
    evidence_ratio: float


@dataclass(frozen=True, slots=True)
class Significance:
    """Family-wise test for any effect: largest test value, its p-value, the requested `level`, and the `achieved` one,
    the share of surrogates without effect beyond the threshold that was used."""

    statistic: float
    threshold: float
    p_value: float
    level: float
    achieved: float
    surrogates: int


@dataclass(frozen=True, slots=True)
class Limit:
    """Smallest size of an effect that this log shows with a power of 0.9, in the unit of its first parameter; NaN where
    it shows no physical size. `smallest` is the smallest size worth naming."""

    effect: str
    where: str | None
    size: float
    unit: str
    smallest: float = float("nan")


@dataclass(frozen=True, slots=True)
class Confusion:
    """Two sets of effects and how well this log can distinguish them, before any residual is used. `separation` lambda:
    whitened energy of `effect` at its reference size that the `rivals` (1 to 3) cannot imitate; `p_correct` =
    Phi(sqrt(lambda) / 2). `relation`: sentence, where it is exact, and the `sizes` in it: of the effect, then of the
    rivals."""

    effect: str
    rivals: tuple[str, ...]
    separation: float
    p_correct: float
    relation: str = ""
    sizes: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Remainder:
    """An unknown form as a function: value and simultaneous 95 % band, NaN where the drive was not.

    `x` (k, d) points of the coordinates `depends_on` [SI], `f`, `low`, `high` (k,) in `unit`, or in the channel's if
    that is empty; `mechanism` that it acts through; `share` of the channel's variance that it
    explains; `proxies`: coordinates that explain it nearly as well; `nearest`: effect whose signature is most alike,
    with the cosine; `probability` of the mechanism itself; `p_value` NaN where no test was made; `manner`:
    `from 66 s to 145 s` or `in waves of 197 m`, empty if it is any smooth function.
    """

    channel: str
    depends_on: tuple[str, ...]
    share: float
    p_value: float
    x: FloatArray
    f: FloatArray
    low: FloatArray
    high: FloatArray
    proxies: tuple[str, ...]
    nearest: str | None
    cosine: float
    sentence: str
    mechanism: str | None = None
    unit: str = ""
    probability: float = float("nan")
    manner: str = ""


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """A run that would distinguish the remaining causes, or the answer that no run of the catalogue does. `name`: of
    the catalogue, `none`, or `sensor`; `separation_now`, `separation_then`: lambda of the worst pair, NaN where
    `before` and `after` have the probability of naming the right cause."""

    name: str
    separates: tuple[tuple[str, str], ...]
    sentence: str
    separation_now: float
    separation_then: float
    minutes: float
    before: float = float("nan")
    after: float = float("nan")


@dataclass(frozen=True, slots=True)
class ChannelGain:
    """Root mean square of a residual channel before and after, one sample ahead (`rmse`) and in free simulation
    (`free`)."""

    channel: str
    unit: str
    rmse_before: float
    rmse_after: float
    free_before: float = float("nan")
    free_after: float = float("nan")


@dataclass(frozen=True, slots=True)
class Consequence:
    """Effect of the extended model on a detector: false alarms and latency on drives, before and after."""

    detector: str
    false_alarms_before: int
    false_alarms_after: int
    distance_km: float
    latency_before_s: float | None
    latency_after_s: float | None
    found_before: int
    found_after: int
    passes: int


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain of the extended model. `log_score` on the drives `heldout` with its 95 % interval; without these on the
    diagnosed ones (`in_sample`). `promised`: what the effects would gain there on average if they and their values were
    right, NaN where it was not computed. [nats (natural logarithm)] `is_burst`: of the diagnosed drives one block alone
    gains, and the rest loses."""

    channels: tuple[ChannelGain, ...]
    log_score: float
    low: float
    high: float
    heldout: tuple[str, ...]
    in_sample: bool
    consequences: tuple[Consequence, ...] = ()
    notes: tuple[str, ...] = ()
    promised: float = math.nan
    is_burst: bool = False


@dataclass(frozen=True, slots=True)
class ResidualView:
    """A residual channel for the page, with the vehicle file alone and with the extended model: arrays (n,) at `dt`;
    NaN where masked. `coordinates`: `t` [s], `v_x` [m/s], `torque` [N·m], `position` [m], `a_x` [m/s²] ... (n,) each.
    """

    drive: str
    channel: str
    title: str
    unit: str
    dt: float
    coordinates: Mapping[str, FloatArray]
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The result. `causes` with `cannot_tell`: the set that the log cannot separate; `caution`: to know before it.

    `deviations`: what car and tyres differ by from their file within its tolerances, most likely, counted in the gain.
    """

    verdict: Verdict
    sentence: str
    drives: tuple[str, ...]
    duration_s: float
    used_s: float
    model: Model
    channels: tuple[str, ...]
    causes: tuple[Cause, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    significance: Significance | None = None
    limits: tuple[Limit, ...] = ()
    confusions: tuple[Confusion, ...] = ()
    remainders: tuple[Remainder, ...] = ()
    manoeuvre: Manoeuvre | None = None
    gain: Gain | None = None
    untested: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    views: tuple[ResidualView, ...] = field(default=(), repr=False)
    agreement: tuple[Agreement, ...] = ()
    caution: str = ""
    deviations: tuple[Term, ...] = ()


def tempered(p: float) -> float:
    """The probability of a name with the share `p` of a coarsened posterior (`competition.COARSE`), up to `MOST`."""
    return min(max(p, LEAST), MOST)
