"""A measuring campaign: which logs were driven in which configuration and load, which exist, and parts of it."""

from __future__ import annotations

import difflib
import os
import re
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.physics.load import centre_shift

__all__ = [
    "GROUP_NAMES", "Campaign", "LogState", "Run", "Shard", "group_keys", "loads_of", "log_states", "missing_lines",
    "near_name", "number_of", "part_of", "shard_of", "with_load",
]  # fmt: skip

_MOST_PARTS = 100_000

GROUP_NAMES: dict[str, tuple[str, ...]] = {
    "depth": ("water_depth_mm",),
    "water-depth": ("water_depth_mm",),
    "pressure": ("pressure_front_bar", "pressure_rear_bar"),
    "load": ("load_front_kg", "load_rear_kg"),
    "tread": ("tread_depth_mm",),
    **{n: (n,) for n in ("tyre", "wear", "manoeuvre", "vehicle")},
}
"""Words that --by accepts in addition to the keys."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run. `values` holds the keys that are given, without `log`, `vehicle`, `labels`, numbers as floats; keys that
    begin with `x_` are text. `logs` are the files of one drive; `lane` is (start, end) [s].
    """

    logs: tuple[Path, ...]
    vehicle: Path
    labels: Path | None
    lane: tuple[float, float] | None
    values: Mapping[str, float | str]

    @property
    def groups(self) -> dict[str, str]:
        """The configuration as text, for grouping."""
        return {
            "vehicle": self.vehicle.stem,
            **{k: v if isinstance(v, str) else f"{v:g}" for k, v in self.values.items()},
        }


@dataclass(frozen=True, slots=True)
class Campaign:
    """A campaign; paths are relative to where the reader is, not to the file. `table` is the table of runs, if there is
    one.
    """

    name: str
    path: Path
    signals: Path | None
    runs: tuple[Run, ...]
    table: Path | None = field(default=None, compare=False)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys by which the runs can be grouped."""
        return tuple(dict.fromkeys(k for r in self.runs for k in r.groups))


def group_keys(names: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Keys behind the value of --by; ConfigError names all unknown ones, with the most similar existing ones."""
    found: list[str] = []
    wrong: list[str] = []
    for name in names:
        keys = [k for k in GROUP_NAMES.get(name, (name,)) if k in known]
        if not keys:
            near = difflib.get_close_matches(name, [*known, *GROUP_NAMES], n=1, cutoff=0.5)
            wrong.append(f'"{name[:60]}"' + (f' (did you mean "{near[0]}"?)' if near and near[0] != name else ""))
        found += keys
    if wrong:
        raise ConfigError(f"by {', '.join(wrong)}: no run has this key", expected=", ".join(known) or "a campaign")
    return tuple(dict.fromkeys(found))


def loads_of(run: Run) -> tuple[float, float]:
    """Load over the front and over the rear axle of a run; 0 where none is given. [kg]"""
    front, rear = (run.values.get(f"load_{axle}_kg", 0.0) for axle in ("front", "rear"))
    return float(front), float(rear)


def with_load(vehicle: Vehicle, run: Run) -> Vehicle:
    """The vehicle with the run's load over its axles; the height of its centre of mass stays.

    Raises
    ------
    ConfigError
        If less than 30 % of the car's mass would remain, or no load on one axle.
    """
    for delta, x in zip(loads_of(run), (0.0, vehicle.wheelbase), strict=True):
        if delta == 0.0:
            continue
        mass = vehicle.mass + delta
        moved = centre_shift(vehicle.mass, vehicle.l_f, delta, x) if mass > 0.3 * vehicle.mass else float("nan")
        if not (vehicle.l_f + moved > 0.05 and vehicle.l_r - moved > 0.05):
            raise ConfigError(
                f"a load of {delta:g} kg on a car of {vehicle.mass:g} kg", where=", ".join(map(str, run.logs)),
                expected="load_front_kg and load_rear_kg that leave load on both axles",
            )  # fmt: skip
        vehicle = replace(vehicle, mass=mass, l_f=vehicle.l_f + moved, l_r=vehicle.l_r - moved)
    return vehicle


@dataclass(frozen=True, slots=True)
class Shard:
    """The `index`-th of `count` parts, counted from 1."""

    index: int
    count: int

    @property
    def name(self) -> str:
        """As a part of a file's name."""
        return f"{self.index}-of-{self.count}"


def shard_of(text: str) -> Shard:
    """The shard of a text such as `2/8`; ConfigError for any other text."""
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    shard = Shard(int(match[1]), int(match[2])) if match else Shard(0, 0)
    if not 1 <= shard.index <= shard.count <= _MOST_PARTS:
        raise ConfigError(f"shard {text}", expected="I/N with I from 1 to N", hint="2/8 is the second of eight parts")
    return shard


def part_of(campaign: Campaign, shard: Shard) -> Campaign:
    """The campaign with the runs of one shard.

    The names of its logs assign a run to a shard. So no log must be read, runs on the same logs stay together, and new
    logs do not move others.
    """
    own = (r for r in campaign.runs if number_of(campaign, r.logs) % shard.count == shard.index - 1)
    return replace(campaign, runs=tuple(own))


def number_of(campaign: Campaign, logs: Sequence[Path]) -> int:
    """A number of a drive by the names of its logs, whose remainder gives its shard."""
    base = campaign.path.parent
    names = [p.relative_to(base) if p.is_relative_to(base) else p for p in logs]
    return zlib.crc32("\n".join(p.as_posix() for p in names).encode())


MOST_NEAR = 20  # missing logs for which a folder is searched for a similar name


@dataclass(frozen=True, slots=True)
class LogState:
    """One file: its size [byte], None if it is not there; `place` of the first run that names it, and `runs` naming it.

    `near` is a file beside it with a similar name, where it is missing.
    """

    path: Path
    size: int | None
    place: str
    runs: int
    near: str = ""


def log_states(campaign: Campaign, places: Sequence[str] = ()) -> tuple[LogState, ...]:
    """State of every file that the runs name, each once; a ROS 2 bag is one, with the size of its files.

    `places`: where each run stands (`config.campaign.read_campaign`); empty: the campaign file.
    """
    first: dict[Path, str] = {}
    count = Counter(path for run in campaign.runs for path in run.logs)
    for index, run in enumerate(campaign.runs):
        for path in run.logs:
            first.setdefault(path, places[index] if places else campaign.path.name)
    states = []
    searched = 0
    for path, place in first.items():
        near = ""
        size: int | None = None
        with suppress(OSError):
            files = [p for p in path.iterdir() if p.is_file()] if path.is_dir() else [path]
            size = sum(p.stat().st_size for p in files)
        if size is None and searched < MOST_NEAR:
            searched += 1
            near = near_name(path)
        states.append(LogState(path, size, place, count[path], near))
    return tuple(states)


def near_name(path: Path) -> str:
    """A file beside a missing one with a similar name, or an empty string."""
    try:
        names = [n.name for n in os.scandir(path.parent)]
    except OSError:
        return ""
    near = difflib.get_close_matches(path.name, names[:2000], n=1, cutoff=0.75)
    return near[0] if near else ""


def missing_lines(states: Sequence[LogState], most: int = 10) -> list[str]:
    """One sentence per log that is missing, at most `most` of them and how many there are beyond."""
    missing = [s for s in states if s.size is None]
    lines = [
        f"{s.place}: no such log {s.path}" + (f' (did you mean "{s.near}"?)' if s.near else "") for s in missing[:most]
    ]
    return [*lines, f"and {len(missing) - most} more logs are missing"] if len(missing) > most else lines
