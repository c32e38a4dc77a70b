"""`aq.inspect`: what a log holds, and which channel looks like which signal."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ExitCode
from aqualog.face.drive import DriveLike, drive_of
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.mapping import SignalMap
    from aqualog.align.overview import ChannelOverview
    from aqualog.align.propose import Proposal
    from aqualog.face.drive import Drive

__all__ = ["Contents", "inspect"]

_HEADER = ("channel", "unit", "samples", "Hz", "from s", "to s", "min", "max", "gaps", "faults", "signal?")


@dataclass(frozen=True, eq=False, repr=False)
class Contents(Result):
    """The channels of one drive's files, and the signals that they look like."""

    drive: Drive
    formats: tuple[str, ...]
    overviews: tuple[ChannelOverview, ...]
    proposals: Mapping[str, Proposal]
    absolute: frozenset[str]
    notes: tuple[str, ...] = ()
    has_loss: bool = False
    sources: tuple[Path, ...] = ()

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the command."""
        if self.has_loss:
            return ExitCode.PARTIAL
        return ExitCode.DONE if self.overviews else ExitCode.NOTHING_USABLE

    @property
    def map(self) -> SignalMap:
        """The proposed signal map, which `aq.read` takes; a guess from names, units and data."""
        return replace(self.drive.signal_map, entries={s: p.entry for s, p in self.proposals.items()})

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog inspect`."""
        from aqualog import __version__

        return {
            "schema_version": 1,
            "tool_version": __version__,
            "files": [{"file": str(p), "format": f} for p, f in zip(self.drive.paths, self.formats, strict=True)],
            "channels": [_plain(dataclasses.asdict(o)) for o in self.overviews],
            "proposed": {
                s: {"channel": p.entry.channel[0], "unit": p.entry.unit, "scale": p.entry.scale, "reason": p.reason}
                for s, p in self.proposals.items()
            },
            "notes": list(self.notes),
        }

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`channels` and `proposed`."""
        import polars as pl

        channels = [{k: v for k, v in c.items() if not isinstance(v, dict)} for c in self.document["channels"]]
        proposed = [{"signal": s, **p} for s, p in self.document["proposed"].items()]
        return {
            n: pl.DataFrame(x, infer_schema_length=None) for n, x in (("channels", channels), ("proposed", proposed))
        }

    def text(self) -> str:
        """Return the tables that the command prints."""
        from aqualog.report.text import table
        from aqualog.report.values import CELL, NOTE, cut

        lines = []
        by_channel = {p.entry.channel[0]: s for s, p in self.proposals.items()}
        for path, kind in zip(self.drive.paths, self.formats, strict=True):
            own = [o for o in self.overviews if o.file == path.name]
            clock = "absolute time" if path.name in self.absolute else "a clock of its own"
            lines.append(f"{cut(path.name, CELL)}: {kind.upper()}, {len(own)} channels, {clock}")
            if own:
                rows = [_row(o, by_channel) for o in own]
                lines += [table(_HEADER, rows), ""]
        lines += self._proposed()
        if self.notes:
            lines += ["", "notes:", *(f"  {cut(n, NOTE)}" for n in self.notes)]
        return "\n".join(lines) + "\n"

    def _proposed(self) -> list[str]:
        from aqualog.report.values import CELL, cut

        if not self.proposals:
            return ["no channel looks like a signal that aqualog knows"]
        own = self.proposals.items()
        return [
            "proposed signals:",
            *(f"  {s} = {cut(p.entry.channel[0], CELL)}  ({cut(p.reason, CELL)})" for s, p in own),
        ]

    def headline(self) -> str:
        """Return how many channels there are, and which signals they look like."""
        head = f"{self.drive.title}: {len(self.overviews)} channels"
        return "\n".join([head, *self._proposed()[:6]])

    def plot(self) -> go.Figure:
        """Return over which time each channel has samples."""
        import plotly.graph_objects as go

        made = go.Figure(
            go.Bar(
                base=[o.start_s for o in self.overviews], x=[o.end_s - o.start_s for o in self.overviews],
                y=[f"{o.file}: {o.path}" for o in self.overviews], orientation="h",
                text=[f"{o.rate_hz:.4g} Hz" for o in self.overviews],
            )
        )  # fmt: skip
        made.update_layout(title=self.drive.title, template="plotly_white", height=120 + 22 * len(self.overviews))
        made.update_xaxes(title="time [s]")
        return made

    def files(self) -> Writers:
        """Return `inspect.json` and the proposed `map.toml`."""
        return {"inspect.json": self._json_file(), "map.toml": text_file(self._map_text)}

    def write_map(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the proposed signal map: read it before you use it.

        Raises
        ------
        ConfigError
            If the file exists and `force` is not given.
        """
        return self._write_as("map.toml", path, force=force)

    def _map_text(self) -> str:
        from aqualog.config.signal_map import map_text

        return map_text(
            self.map,
            comments=[f"proposed for {', '.join(p.name for p in self.drive.paths)}: check every line"],
            remarks={s: p.reason for s, p in self.proposals.items()},
        )


def inspect(drive: DriveLike, *, progress: Progress = None) -> Contents:
    """List what the files of one drive hold, and propose which channel is which signal.

    Parameters
    ----------
    drive : Drive, str, Path or several
        From `aq.read`, or files of ONE drive.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError
        If nothing can be read.

    Examples
    --------
    >>> contents = aq.inspect("drive.mf4")
    >>> aq.read("drive.mf4", map=contents.map)
    """
    from aqualog.align.load import read_options
    from aqualog.align.overview import find_mounting
    from aqualog.align.propose import look_at
    from aqualog.io.open_log import DriveLog

    one, hear = drive_of(drive), listener(progress)
    with one.reading(), DriveLog(one.paths, read_options(one.signal_map, one.dbc)) as log:
        hear("reading")
        channels, lost = log.read_readable()
        formats, faults = log.formats, log.faults
        hear("looking at the channels")
        found, proposals = look_at(channels)
    remarks = [*lost, *((p.name, n) for p, f in zip(one.paths, faults, strict=True) for n in f.notes)]
    changes = one.changes()
    notes = [*(n if n.startswith(f"{name}: ") else f"{name}: {n}" for name, n in remarks), *find_mounting(found)]
    damaged = changes or lost or any(f.truncated or f.lost_samples for f in faults)
    return Contents(
        one,
        tuple(formats),
        tuple(found),
        proposals,
        frozenset(c.info.file for c in channels if c.absolute),
        (*notes, *changes),
        bool(damaged),
        one.sources,
    )


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _row(o: ChannelOverview, by_channel: dict[str, str]) -> tuple[str, ...]:
    gaps = f"{o.gaps} (to {o.longest_gap_s:.2g} s)" if o.gaps else "-"
    symbol = by_channel.get(o.path) or by_channel.get(f"{o.file}:{o.path}") or ""
    numbers = (f"{o.start_s:.2f}", f"{o.end_s:.2f}", f"{o.low:.6g}", f"{o.high:.6g}")
    return (o.path, o.unit or "-", str(o.samples), f"{o.rate_hz:.4g}", *numbers, gaps, _faults(o), symbol)


def _faults(o: ChannelOverview) -> str:
    counts = {n.replace("_", "-"): getattr(o.faults, n) for n in type(o.faults).KINDS if n != "pauses"}
    counts["not finite"] = o.not_finite
    text = ", ".join(f"{n} {name}" for name, n in counts.items() if n)
    return ", ".join(t for t in (text, o.remark) if t) or "-"
