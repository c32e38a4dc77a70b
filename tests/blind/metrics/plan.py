"""Which cases are made for which metric: effects with their sizes, programmes, noises, cars, seeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from tests.blind.world.cases import EXACT_PROGRAMMES, Hidden, Spec
from tests.blind.world.effects import UNKNOWN as NOT_IN_LIBRARY
from tests.blind.world.noise import NOISES
from tests.blind.world.pools import POOLS, SUITED
from tests.blind.world.vehicles import CARS

__all__ = ["KNOWN", "PARTS", "TWINS", "Job", "Sizes", "plan"]

DEVELOPMENT = 200  # seeds below it are for development: a run that begins there stays there


@dataclass(frozen=True, slots=True)
class Job:
    """One case. `target_z`: size of the trace that the hidden effect is scaled to. `members`: effects that cannot be told
    apart, `twins` what the others would have to be like, `can`: whether any run could part them.
    """

    key: str
    group: str
    spec: Spec
    target_z: float | None = None
    members: tuple[str, ...] = ()
    twins: tuple[Hidden, ...] = ()
    can: bool = True
    surrogates: int = 49


@dataclass(frozen=True, slots=True)
class Sizes:
    """Cases of each part: per cell of noise and programme, per effect, per pair of twins."""

    null: int = 10
    named: int = 20
    limit: int = 2
    twins: int = 5
    detector: int = 24
    pairs: int = 24
    duration_s: float = 300.0


def _h(effect: str, where: str | None = None, **values: float) -> Hidden:
    return Hidden(effect, where, values)


KNOWN = tuple(n for n in POOLS if n not in NOT_IN_LIBRARY and n != "tone_ring")
"""Effects that the library has; the unevenness of a tone ring is faster than residuals at 10 Hz and not asked about."""


@dataclass(frozen=True, slots=True)
class Twins:
    """A relation: what is hidden, what the rest of it would be, on which drive, and whether any run could break it."""

    hidden: Hidden
    others: tuple[Hidden, ...]
    programme: str
    can: bool
    duration_s: float = 300.0

    @property
    def members(self) -> tuple[str, ...]:
        return tuple(sorted({self.hidden.effect, *(o.effect for o in self.others)}))


_BIAS = _h("accelerometer_bias", "a_x", bias=0.15)
_GRADE = _h("road_grade", grade=0.015)
_ROLL = _h("rolling_resistance", delta_r_w=0.004)
_BRAKE = _h("brake_drag", torque=15.0)
TWINS: tuple[Twins, ...] = (
    # triple: an offset of the accelerometer is a slope and the rolling resistance that hides its pull
    Twins(_BIAS, (_GRADE, _ROLL), "mixed", can=False),
    Twins(_GRADE, (_BIAS, _ROLL), "motorway", can=False),
    Twins(_ROLL, (_BRAKE,), "mixed", can=False),
    Twins(_BRAKE, (_ROLL,), "motorway", can=False),
    # nothing but drag, rolling and hills part them; in slow traffic there is little of that
    Twins(_h("payload_mass", delta_mass=120.0), (_h("torque_gain", gain=0.95),), "stop_and_go", can=True),
    Twins(_h("torque_gain", gain=0.95), (_h("payload_mass", delta_mass=120.0),), "stop_and_go", can=True),
    # one way, at nearly one speed
    Twins(_h("head_wind", speed=3.0), (_h("aero_drag", delta_drag_area=0.1),), "motorway", can=True),
    Twins(_h("aero_drag", delta_drag_area=0.1), (_h("head_wind", speed=3.0),), "motorway", can=True),
    Twins(_h("velocity_scale", "v_x", scale=1.005), (_h("tyre_radius", delta=-0.005),), "motorway", can=True),
    # on a short drive a warm-up is a rolling resistance, and a clock that runs off is a delay
    Twins(_h("tyre_warmup", extra=0.4, time_constant=600.0), (_ROLL,), "motorway", can=True, duration_s=90.0),
)  # fmt: skip


def plan(parts: Sequence[str], sizes: Sizes, seeds_from: int) -> list[Job]:
    """The jobs of these parts. Seeds are numbered through each part; those of development do not leave their range."""
    return [job for part in parts for job in _numbered(part, _MAKERS[part](sizes), seeds_from, sizes)]


def _numbered(part: str, made: Iterator[Job], seeds_from: int, sizes: Sizes) -> Iterator[Job]:
    for i, job in enumerate(made):
        n = 1000 * PARTS.index(part) + i
        if seeds_from < DEVELOPMENT:
            seed = seeds_from + (37 * PARTS.index(part) + i) % (DEVELOPMENT - seeds_from)
        else:
            seed = seeds_from + n
        length = min(job.spec.duration_s, sizes.duration_s)
        yield replace(
            job, key=f"{part}-{i:04d}-{seed}-{length:g}", spec=replace(job.spec, seed=seed, duration_s=length)
        )


def _job(group: str, spec: Spec, **given: object) -> Job:
    return Job("", group, spec, **given)  # type: ignore[arg-type]


def _null(sizes: Sizes) -> Iterator[Job]:
    cars = list(CARS)
    for k in range(sizes.null):
        for p, programme in enumerate(EXACT_PROGRAMMES):
            for n, noise in enumerate(NOISES):
                yield _job("null", Spec(programme, noise, (), vehicle=cars[(k + 2 * p + n) % len(cars)]))


def _singles(group: str, count: int) -> Iterator[Job]:
    cars = list(CARS)
    # one case of every effect first: whoever stops early has all effects
    for k in range(count):
        for e, name in enumerate(KNOWN):
            hidden, fit = POOLS[name][k % len(POOLS[name])], SUITED[name]
            noise, car = NOISES[(3 * k + 7 * e) % len(NOISES)], cars[(k + k // len(cars) + e) % len(cars)]
            yield _job(group, Spec(fit[(k // len(POOLS[name])) % len(fit)], noise, (hidden,), vehicle=car))


def _twins(sizes: Sizes) -> Iterator[Job]:
    cars = list(CARS)
    for k in range(sizes.twins):
        for i, t in enumerate(TWINS):
            noise, car = NOISES[(k + 3 * i) % len(NOISES)], cars[(k + i) % len(cars)]
            spec = Spec(t.programme, noise, (t.hidden,), vehicle=car, duration_s=t.duration_s)
            yield _job("twins", spec, target_z=12.0, members=t.members, twins=t.others, can=t.can)


def _detector(sizes: Sizes) -> Iterator[Job]:
    cars = list(CARS)
    hidden = (_h("tyre_radius", "rr", delta=-0.01), _h("water_drag", gain=1.8), _h("tyre_radius", "r", delta=0.012))
    for k in range(sizes.detector):
        yield _job(
            "detector", Spec("wet", NOISES[k % len(NOISES)], (hidden[k % len(hidden)],), vehicle=cars[k % len(cars)])
        )


def _pairs(sizes: Sizes) -> Iterator[Job]:
    for k in range(sizes.pairs):
        programme, noise = EXACT_PROGRAMMES[k % len(EXACT_PROGRAMMES)], NOISES[(3 * k + k // 10) % len(NOISES)]
        yield _job("pairs", Spec(programme, noise, (), vehicle=list(CARS)[(k + k // 6) % len(CARS)], holdout=0))


_MAKERS = {
    "null": _null,
    "named": lambda s: _singles("named", s.named),
    "limit": lambda s: _singles("limit", s.limit),
    "twins": _twins,
    "detector": _detector,
    "pairs": _pairs,
}  # fmt: skip
PARTS = tuple(_MAKERS)
"""Parts of the plan, in the order in which they are worked on."""
