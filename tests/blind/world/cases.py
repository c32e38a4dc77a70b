"""Blind cases: which drives are made, and with what in them.

A case is a function of its `Spec` alone. Its drives have roads and drivers by seed, its held-out drives others; only what
sits on the road (`PLACE_FIXED`) has the same road in all of them, since no other road could show a gain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle, vehicle_toml

from .effects import PLACE_FIXED, UNKNOWN, Hidden, apply, scaled
from .kernel import drive_car
from .noise import NOISES, coloured, gust_series
from .pools import POOLS, SUITED
from .programmes import PROGRAMMES, speed_programme
from .road import Road, build_road
from .sensors import as_signals, measure
from .tyre import KINDS
from .vehicles import CARS
from .world import World, nominal_world

__all__ = [
    "CARS", "EXACT_PROGRAMMES", "NOISES", "POOLS", "PROGRAMMES", "UNKNOWN", "Case", "Hidden", "Spec", "clean_drive",
    "clean_pair", "clean_rows", "hidden_specs", "implied", "make_case", "null_specs", "scaled", "truth", "world_of", "write_case",
]  # fmt: skip

EXACT_PROGRAMMES = ("mixed", "motorway", "handling", "stop_and_go")
"""Programmes on flat dry roads: with nothing hidden the vehicle file is all there is to know. On `hilly` the hills
themselves are what a model of flat roads lacks; on `wet` the water is not the library's."""


@dataclass(frozen=True, slots=True)
class Spec:
    """What a case is made from. `hidden` empty: null; `scale` times the hidden deviations from neutral; `tyre`:
    law of the tyre, see `tyre.KINDS`."""

    programme: str
    noise: str
    hidden: tuple[Hidden, ...] = ()
    seed: int = 1
    vehicle: str = "sedan_rwd"
    duration_s: float = 300.0
    drives: int = 1
    holdout: int = 1
    has_v_x: bool = True
    scale: float = 1.0
    tyre: str = "magic"

    def __post_init__(self) -> None:
        for what, value, known in (
            ("programme", self.programme, PROGRAMMES), ("noise", self.noise, NOISES), ("vehicle", self.vehicle, CARS),
            ("tyre", self.tyre, KINDS),
        ):  # fmt: skip
            if value not in known:
                raise KeyError(f"no {what} {value!r}; there are {', '.join(known)}")

    @property
    def name(self) -> str:
        causes = "+".join(h.key for h in self.hidden) or "null"
        return f"{self.programme}-{self.noise}-{self.vehicle}-{causes}-{self.scale:g}-{self.seed}"


@dataclass(frozen=True, slots=True)
class Case:
    """The logs of a spec; names of drives tell nothing of what is hidden."""

    spec: Spec
    vehicle: Vehicle
    drives: tuple[tuple[str, Signals], ...]
    holdout: tuple[tuple[str, Signals], ...]


def implied(spec: Spec) -> tuple[Hidden, ...]:
    """What the programme itself hides: the hills of `hilly`, if none are hidden by name."""
    if spec.programme != "hilly" or any(h.effect == "hills" for h in spec.hidden):
        return ()
    return (Hidden("hills", None, {"rms": 0.02, "wavelength": 900.0}),)


def truth(spec: Spec) -> tuple[Hidden, ...]:
    """All effects that are in the drives of a spec, at the sizes that they have there."""
    return tuple(scaled(h, spec.scale) for h in spec.hidden) + implied(spec)


def world_of(spec: Spec) -> World:
    """Car, sensors and road of a spec with everything in them."""
    return apply(nominal_world(CARS[spec.vehicle], spec.tyre), truth(spec))


def make_case(spec: Spec) -> Case:
    """Drives and held-out drives of a spec."""
    vehicle = CARS[spec.vehicle]
    world = world_of(spec)
    total = spec.drives + spec.holdout
    made = [_signals(spec, world, vehicle, k) for k in range(total)]
    names = [f"drive_{k + 1}" for k in range(spec.drives)] + [f"unseen_{k + 1}" for k in range(spec.holdout)]
    named = tuple(zip(names, made, strict=True))
    return Case(spec, vehicle, named[: spec.drives], named[spec.drives :])


def clean_pair(spec: Spec, index: int = 0) -> tuple[Signals, Signals]:
    """Drive `index` (held-out ones behind the others) without noise and gusts, with and without what is hidden; same road, same driver.

    The driver reacts: after a while the two are at slightly different places.
    """
    return clean_drive(spec, truth(spec), index), clean_drive(spec, implied(spec), index)


def clean_drive(spec: Spec, hidden: tuple[Hidden, ...], index: int = 0) -> Signals:
    """One side of a pair: a drive without noise and gusts, with `hidden` alone."""
    vehicle = CARS[spec.vehicle]
    world = apply(nominal_world(vehicle, spec.tyre), hidden)
    rows, road = clean_rows(spec, world, index)
    columns = measure(rows, world, None, _drive_seed(spec, index))
    return as_signals(columns, rows, road, vehicle.wheelbase, name="clean", has_v_x=spec.has_v_x)


def clean_rows(spec: Spec, world: World, index: int = 0, *, refine: int = 1) -> tuple[np.ndarray, Road]:
    """What happens in drive `index` without gusts: rows (n, len(OUT)) of the kernel, and the road.

    `refine`: so many times finer steps than the integrator needs.
    """
    return _driven(spec, world, index, calm=True, refine=refine)


def _driven(spec: Spec, world: World, index: int, *, calm: bool, refine: int = 1) -> tuple[np.ndarray, Road]:
    own = _drive_seed(spec, index)
    stays = any(h.effect in PLACE_FIXED for h in spec.hidden)
    route = _drive_seed(spec, 0) if stays else own
    rng = np.random.default_rng([own, 1])
    pace = rng.uniform(0.96, 1.04) if stays else 1.0
    pull = {"rwd": 2.9, "fwd": 2.3, "awd": 3.3}[CARS[spec.vehicle].drivetrain]
    target = speed_programme(spec.programme, route, spec.duration_s, pace=pace, pull=pull)
    plan = speed_programme(spec.programme, route, spec.duration_s, pull=pull)
    road = build_road(spec.programme, route, plan, world)
    n = round(spec.duration_s / 0.01)
    ability = 1.0 + 0.12 * coloured("ou5", n + 1, rng)
    unrest = rng.uniform(0.05, 0.12) * coloured("ou1", n + 1, rng)
    wander = rng.uniform(5e-4, 1.2e-3) * coloured("ou1", n + 1, rng)
    style = (
        rng.uniform(0.35, 0.7), rng.uniform(0.3, 0.6), rng.uniform(0.4, 0.8), rng.uniform(0.03, 0.08),
        rng.uniform(0.15, 0.35), rng.uniform(0.1, 0.2), rng.uniform(0.9, 1.4),
    )  # fmt: skip
    gust = np.zeros(n + 1) if calm else gust_series(spec.noise, n + 1, np.random.default_rng([own, 2]))
    rows = drive_car(target, ability, unrest, wander, gust, road.grid, road.ds, world.car, world.tyre, style, refine)
    if not np.isfinite(rows).all():
        raise ArithmeticError(f"the drive {spec.name} diverged")
    return rows, road


def _signals(spec: Spec, world: World, vehicle: Vehicle, index: int) -> Signals:
    rows, road = _driven(spec, world, index, calm=False)
    columns = measure(rows, world, spec.noise, _drive_seed(spec, index))
    return as_signals(columns, rows, road, vehicle.wheelbase, name=f"blind_{index + 1}", has_v_x=spec.has_v_x)


def _drive_seed(spec: Spec, index: int) -> int:
    """Seed of a drive of a case: the same whatever is hidden, so that pairs can be compared."""
    key = [spec.seed, index, list(PROGRAMMES).index(spec.programme), list(CARS).index(spec.vehicle)]
    return int(np.random.SeedSequence(key).generate_state(1)[0])


def null_specs(
    seeds: range, *, programmes: tuple[str, ...] = EXACT_PROGRAMMES, noises: tuple[str, ...] = NOISES, **given: object
) -> Iterator[Spec]:
    """Specs with nothing hidden, over all noises and programmes for every seed; cars in turn."""
    cars = list(CARS)
    k = 0
    for seed in seeds:
        for programme in programmes:
            for noise in noises:
                spec = Spec(programme, noise, (), seed, cars[(k + seed) % len(cars)])
                yield replace(spec, **given)  # type: ignore[arg-type]
                k += 1


def hidden_specs(
    seeds: range,
    *,
    effects: tuple[str, ...] = tuple(POOLS),
    noises: tuple[str, ...] = NOISES,
    scale: float = 1.0,
    **given: object,
) -> Iterator[Spec]:
    """One spec per effect and seed: place and size drawn from the pool, programme from those that show it."""
    cars = list(CARS)
    for name in effects:
        for seed in seeds:
            rng = np.random.default_rng([seed, list(POOLS).index(name), 41])
            hidden = POOLS[name][rng.integers(len(POOLS[name]))]
            programme = SUITED[name][rng.integers(len(SUITED[name]))]
            noise = noises[rng.integers(len(noises))]
            spec = Spec(programme, noise, (hidden,), seed, cars[rng.integers(len(cars))], scale=scale)
            yield replace(spec, **given)  # type: ignore[arg-type]


def write_case(case: Case, folder: Path, *, suffix: str = ".parquet") -> dict[str, list[Path]]:
    """Logs and vehicle file as a user has them: paths by `drives`, `holdout`, `vehicle`."""
    folder.mkdir(parents=True, exist_ok=True)
    car = folder / "vehicle.toml"
    car.write_text(vehicle_toml(case.vehicle), encoding="utf-8")
    paths: dict[str, list[Path]] = {"drives": [], "holdout": [], "vehicle": [car]}
    for group, logs in (("drives", case.drives), ("holdout", case.holdout)):
        for name, signals in logs:
            path = folder / f"{name}{suffix}"
            frame = signals.frame
            if suffix == ".csv":
                frame.with_columns(pl.col("on_water").cast(pl.Int8)).write_csv(path)
            else:
                frame.write_parquet(path)
            paths[group].append(path)
    return paths
