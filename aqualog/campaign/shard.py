"""A part of a campaign for one of several machines; it does not depend on the others."""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from aqualog.campaign.records import Campaign
from aqualog.core.errors import ConfigError

__all__ = ["Shard", "number_of", "part_of", "shard_of"]

_MOST = 100_000


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
    """The shard of a text such as `2/8`.

    Raises
    ------
    ConfigError
    """
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    shard = Shard(int(match[1]), int(match[2])) if match else Shard(0, 0)
    if not 1 <= shard.index <= shard.count <= _MOST:
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
