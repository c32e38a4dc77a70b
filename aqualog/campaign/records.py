"""A measuring campaign: which logs were driven in which configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aqualog.core.errors import ConfigError

__all__ = ["GROUP_NAMES", "Campaign", "Run", "group_keys"]

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
    """Keys behind the value of --by.

    Raises
    ------
    ConfigError
        Names all unknown keys, with the most similar existing ones.
    """
    import difflib

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
