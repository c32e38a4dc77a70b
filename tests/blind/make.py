"""Sealed cases of the simulated worlds.

`python -m tests.blind.make DIR --world magic|plain|realnoise --seed N --count K --kind null|known|unknown|compound|mixed`

`magic`: `tests/blind/world`; `realnoise`: the same with ideal sensors and the noise of measured drives; `plain`:
`tests/blind/plain.py`. Each case has a drive, a held-out drive with the same effects, the true vehicle file, and its truth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from aqualog.core.vehicle import Vehicle, vehicle_toml
from tests.blind import plain
from tests.blind.injected.drives import real_folder
from tests.blind.injected.make import kinds_of
from tests.blind.injected.noise import SOURCES, added, noise_source
from tests.blind.judging.answers import twins_of
from tests.blind.metrics.plan import KNOWN
from tests.blind.sealed import KINDS, seal
from tests.blind.traces import detectability, residuals
from tests.blind.world.cases import EXACT_PROGRAMMES, NOISES, Spec, clean_pair, clean_rows, make_case, truth, world_of
from tests.blind.world.effects import Hidden
from tests.blind.world.pools import COMPOUNDS, POOLS, SUITED
from tests.blind.world.sensors import MEASURED, as_signals, measure
from tests.blind.world.unknown import shape_of
from tests.blind.world.vehicles import CARS
from tests.blind.world.world import WHEELS

__all__ = ["main", "write"]

WORLDS = ("magic", "plain", "realnoise")
FORMS: Mapping[str, tuple[str, list[str], list[list[str]]]] = {
    "speed_hump": ("force", ["v_x"], []), "wet_hump": ("force", ["v_x", "water_depth"], [["water_depth"]]),
    "slip_saddle": ("slip", ["slip"], [["torque"], ["slip", "torque"]]), "drag_patch": ("force", ["position"], []),
    "gear_loss": ("force", ["torque"], []), "accelerometer_speed": ("accelerometer", ["v_x", "a_x"], [["v_x"]]),
}  # fmt: skip
"""How the forms of the world act: mechanism, coordinates, other coordinates that say the same. Hills are a road."""
PLAIN: tuple[tuple[str, str | None, str, str, float], ...] = (  # effect, place, parameter, its name there, size
    ("payload_mass", None, "delta_mass", "payload_mass", 150.0), ("rolling_resistance", None, "delta_r_w", "rolling_resistance", 0.004),
    ("aero_drag", None, "delta_drag_area", "aero_drag", 0.15), ("head_wind", None, "speed", "head_wind", 4.0),
    ("torque_gain", None, "gain", "torque_gain", 0.94), ("brake_drag", None, "torque", "brake_drag", 14.0),
    ("road_grade", None, "grade", "road_grade", 0.02), ("road_grade", None, "rms", "hills", 0.015),
    ("slip_stiffness", None, "gain", "slip_stiffness", 0.75), ("tyre_radius", "fl", "delta", "tyre_radius_fl", -0.008),
    ("velocity_scale", "v_x", "scale", "velocity_scale", 1.01), ("accelerometer_bias", "a_x", "bias", "accelerometer_bias", 0.15),
    ("accelerometer_gain", "a_x", "gain", "accelerometer_gain", 1.05), ("signal_delay", "a_x", "delay", "delay_a_x", 0.08),
    ("signal_delay", "v_x", "delay", "delay_v_x", 0.15),
)  # fmt: skip

Case = tuple[pl.DataFrame, pl.DataFrame, Vehicle, dict[str, Any]]


def write(folder: Path, case: Case, world: str, seed: int) -> None:
    """A case as the judge wants it."""
    frame, held, vehicle, rest = case
    folder.mkdir(parents=True, exist_ok=True)
    frame.write_parquet(folder / "drive.parquet")
    held.write_parquet(folder / "held.parquet")
    (folder / "vehicle.toml").write_text(vehicle_toml(vehicle), encoding="utf-8")
    seal(folder, {"effects": [], "unknown": None, **rest, "world": world, "seed": seed})


APART = 1000  # drives of a seed: with fewer, the next seed would have most of the same ones


def specs(kind: str, seed: int) -> Iterator[Spec]:
    """Specs of one kind without end: effects, sizes, noises, programmes and cars in turn; no two seeds share a drive."""
    cars, i = list(CARS), APART * seed
    while True:
        k, car = i // 7, cars[i % len(cars)]
        noise = NOISES[(3 * i + i // 10) % len(NOISES)]
        if kind == "null":
            yield Spec((*EXACT_PROGRAMMES, "wet")[i % 5], noise, (), 10_000 + i, car)
        elif kind == "compound":
            yield Spec(("mixed", "handling")[i % 2], noise, COMPOUNDS[i % len(COMPOUNDS)], 10_000 + i, car)
        else:
            pool = [*KNOWN, "hills", "tone_ring"] if kind == "known" else list(FORMS)
            name = pool[i % len(pool)]
            hidden = POOLS[name][k % len(POOLS[name])]
            scale = (1.0, 0.6, 0.3)[k % 3] if kind == "known" else 1.0
            yield Spec(SUITED[name][k % len(SUITED[name])], noise, (hidden,), 10_000 + i, car, scale=scale)
        i += 1


def magic(spec: Spec, kind: str, duration_s: float) -> Case:
    """A case of the blind world with its own noise."""
    spec = replace(spec, duration_s=duration_s)
    case = make_case(spec)
    return case.drives[0][1].frame, case.holdout[0][1].frame, case.vehicle, _truth(spec, kind, case.drives[0][1].frame)


def realnoise(spec: Spec, kind: str, duration_s: float, real: Path) -> Case:
    """A case of the blind world with the noise of measured drives; the source changes with the seed."""
    source = SOURCES[spec.seed % len(SOURCES)]
    spec = replace(spec, duration_s=duration_s, noise="white")
    noises = noise_source(source, real, spec.seed)
    car, world, frames = CARS[spec.vehicle], world_of(spec), []
    for k in range(2):
        rows, road = clean_rows(spec, world, k)
        columns = measure(rows, world, None, spec.seed + k)
        noisy = added({n: columns[n] for n in MEASURED}, noises, 0.01, np.random.default_rng([spec.seed, 61, k]))
        frames.append(as_signals(noisy, rows, road, car.wheelbase, name="drive", has_v_x=True).frame)
    return frames[0], frames[1], car, {**_truth(spec, kind, frames[0]), "noise": f"measured {source}"}


def _truth(spec: Spec, kind: str, frame: pl.DataFrame) -> dict[str, Any]:
    effects: list[dict[str, Any]] = []
    unknown = None
    for h in truth(spec):
        z = _z(replace(spec, hidden=(h,), scale=1.0), frame)
        if h.effect in FORMS:
            mechanism, over, also = FORMS[h.effect]
            unknown = {
                "mechanism": mechanism, "depends_on": over, "also": also, "kind": h.effect, "held_back": False,
                "parameters": dict(h.values), "detectability": z, "points": _points(h, CARS[spec.vehicle], frame),
            }  # fmt: skip
        else:
            name = "road_grade" if h.effect == "hills" else h.effect
            effects.append({"effect": name, "where": h.where, "parameters": dict(h.values), "detectability": z})
    return {"kind": kind, "drive_type": spec.programme, "noise": spec.noise, "effects": effects, "unknown": unknown}


def _points(h: Hidden, car: Vehicle, frame: pl.DataFrame) -> dict[str, Any] | None:
    """The function of a form over one coordinate of a drive, as a diagnosis has it: a force against the motion, a gain."""
    shape = shape_of(h, car)
    if h.effect not in ("speed_hump", "gear_loss", "accelerometer_speed") or shape is None:
        return None
    columns = {"v_x": pl.col("v_x"), "torque": pl.sum_horizontal(f"torque_{w}" for w in WHEELS)}
    at = frame.select(columns[shape.depends_on[0]]).to_series().to_numpy()
    x = np.linspace(np.nanmin(at), np.nanmax(at), 100)
    is_gain = len(shape.depends_on) > 1
    f = shape.f(x, 1.0) if is_gain else -car.mass * shape.f(x)
    return {"x": x.tolist(), "f": f.tolist(), "unit": "-" if is_gain else "N"}


def _z(spec: Spec, frame: pl.DataFrame) -> float:
    """The clean drive with the effect beside that without, and the noise of the case."""
    car = CARS[spec.vehicle]
    with_it, without = (residuals(s.frame, car) for s in clean_pair(spec))
    noisy = residuals(frame, car)
    return round(detectability(with_it, without, {n: x - with_it[n] for n, x in noisy.items()}), 2)


def plain_case(index: int, seed: int, kind: str, duration_s: float, rng: np.random.Generator) -> Case:
    """A case of the plain simulator: sizes from a third of the moderate to one and a half times."""
    programme, noise = list(plain.SPEEDS)[index % 3], ("white", "ou01", "ou1", "ou5", "mix", "pink")[index % 6]
    if kind == "unknown":
        raise SystemExit("error: --world plain has no unknown forms: take another kind, or --world magic")
    first = PLAIN[index % len(PLAIN)]
    others = [p for p in PLAIN if p[0] != first[0] and p[0] not in twins_of(first[0])]
    chosen = {"null": [], "known": [first]}.get(kind, [first, others[int(rng.integers(len(others)))]])
    own = 100_000 + seed * 1000 + index

    def driven(hidden: Mapping[str, float], other: int = 0) -> pl.DataFrame:
        return plain.drive(own + other, programme, noise, duration_s, **hidden)

    hidden, effects = {}, []
    calm = residuals(driven({}), plain.CAR)
    for effect, where, parameter, name, size in chosen:
        neutral = plain.EFFECTS[name]
        value = neutral + (size - neutral) * float(rng.choice([0.35, 1.0, 1.5]))
        hidden[name] = value
        z = round(detectability(residuals(driven({name: value}), plain.CAR), calm, calm), 2)
        effects.append({"effect": effect, "where": where, "parameters": {parameter: value}, "detectability": z})
    rest = {"kind": kind, "drive_type": programme, "noise": noise, "effects": effects}
    return driven(hidden), driven(hidden, 500_000), plain.CAR, rest


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the cases."""
    given = _parsed(arguments)
    real = given.real_logs or real_folder()
    if given.world == "realnoise" and real is None:
        raise SystemExit("error: no measured drives: name their folder with --real-logs or AQUALOG_REAL_LOGS")
    rng = np.random.default_rng([given.seed, 71])
    kinds = kinds_of(given.kind, given.count, rng)
    if given.world == "plain" and given.kind == "mixed":
        kinds = ["known" if k == "unknown" else k for k in kinds]
    streams = {k: specs(k, given.seed) for k in KINDS}
    for i, kind in enumerate(kinds):
        if given.world == "plain":
            case = plain_case(given.seed + i, given.seed, kind, given.duration, rng)
        elif given.world == "magic":
            case = magic(next(streams[kind]), kind, given.duration)
        else:
            assert real is not None
            case = realnoise(next(streams[kind]), kind, given.duration, real)
        write(given.folder / f"case-{i + 1:04d}", case, given.world, given.seed)
    print(f"{len(kinds)} cases in {given.folder}")
    return 0


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.blind.make", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--world", choices=WORLDS, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--kind", choices=["mixed", *KINDS], default="mixed")
    parser.add_argument("--duration", type=float, default=300.0, help="seconds of a drive")
    parser.add_argument("--real-logs", type=Path, help="folder of the measured drives, for `realnoise`")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
