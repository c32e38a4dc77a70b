"""`aq.Campaign.propose`: from a folder of logs to a campaign file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of, names_of, refuse_existing, write_together
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, document_head, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.propose_map import MapProposal
    from aqualog.campaign.propose_drives import Drive, Found
    from aqualog.campaign.propose_names import NameTable

__all__ = ["Proposal", "propose"]

MOST_ROWS = 20  # drives that are printed; the table of runs has all


AnyCampaign = TypeVar("AnyCampaign")


@dataclass(frozen=True, eq=False, repr=False)
class Proposal(Result, Generic[AnyCampaign]):
    """A campaign file and what belongs beside it, as guessed from names, units and data: read it before you use it.

    `texts` maps each file to its text; the campaign file comes last. `opened` makes a campaign of the file.
    """

    opened: Callable[..., AnyCampaign]
    out: Path
    texts: Mapping[Path, str]
    found: Found
    drives: tuple[Drive, ...]
    names: NameTable
    signals: MapProposal
    remarks: tuple[str, ...]
    label_notes: tuple[str, ...]
    dbc: tuple[Path, ...] = ()

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.campaign.propose_files import blanks

        names, signals = self.names, self.signals
        return {
            **document_head(),
            "campaign": str(self.out),
            "written": [str(p) for p in self.texts],
            "drives": [
                {"files": [f.name for f in d.files], "values": {c: v[i] for c, v in names.columns.items() if v[i]}}
                for i, d in enumerate(self.drives)
            ],
            "rules": dict(names.rules),
            "signals": {
                s: {"channel": list(e.channel), "unit": e.unit, "scale": e.scale, "reason": signals.remarks[s]}
                for s, e in signals.signal_map.entries.items()
            },
            "canonical": self._canonical,
            "blank": blanks(names, len(self.drives)),
            "unmapped": list(signals.unmapped),
            "left_out": {**dict(self.found.bad), **signals.left_out},
            "notes": [*signals.notes, *self.remarks, *names.notes],
        }

    @property
    def _canonical(self) -> list[str]:
        return [s for s in self.signals.found if s not in self.signals.signal_map.entries]

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`drives`: files and what their names say."""
        return {"drives": rows_table({"files": "; ".join(d["files"]), **d["values"]} for d in self.document["drives"])}

    def text(self) -> str:
        from aqualog.report.text import table as text_table

        found, drives, table, signals = self.found, self.drives, self.names, self.signals
        several = sum(len(d.files) > 1 for d in drives)
        unreadable = f", {len(found.bad)} cannot be read" if found.bad else ""
        heading = f"logs: {len(found.logs) + len(found.bad)}{unreadable}; drives: {len(drives)}"
        lines = [heading + (f", {several} of several files" if several else "")]
        columns = list(table.columns)
        rows = [
            (_short(" + ".join(f.name for f in d.files)), *(table.columns[c][i] or "-" for c in columns))
            for i, d in enumerate(drives[:MOST_ROWS])
        ]
        lines.append(text_table(("drive", *columns), rows))
        lines += [f"and {len(drives) - len(rows)} more, all in runs.csv"] if len(drives) > len(rows) else []
        lines += ["", "read from the names:"] if columns else ["", "the names say nothing about how the car was driven"]
        lines += [f"  {c}: {rule}" for c, rule in table.rules.items()]
        lines += [f"  same in all names, left out: {', '.join(table.dropped)}"] if table.dropped else []
        empty = self.document["blank"]
        lines += ["", "to fill in:", *(f"  {c}: {n} of {len(drives)} blank" for c, n in empty.items())] if empty else []
        if signals.needed:
            lines += ["", "signals (map.toml):"]
            for symbol, entry in signals.signal_map.entries.items():
                unit = f" [{entry.unit}]" if entry.unit else ""
                lines.append(f"  {symbol} = {' or '.join(entry.channel)}{unit}  ({signals.remarks[symbol]})")
        own = self._canonical
        lines += ["", f"signals with their canonical names: {', '.join(own)}"] if own else []
        lines += [f"  not in all drives, left out: {s} = {why}" for s, why in signals.left_out.items()]
        if signals.unmapped and signals.needed:
            lines += ["", f"channels that are not mapped: {len(signals.unmapped)}, named at the end of map.toml"]
        elif signals.unmapped:
            shown = ", ".join(signals.unmapped[:5]) + (", ..." if len(signals.unmapped) > 5 else "")
            lines += ["", f"channels that are no signal: {len(signals.unmapped)} ({shown})"]
        remarks = [*signals.notes, *self.remarks, *self.label_notes, *table.notes]
        if "on_water" not in signals.found:
            remarks.append(
                "no signal on_water: fill in lane_start_s and lane_end_s, or labels, of wet runs, "
                "or map the channel that says it: on_water = ..."
            )
        lines += ["", "notes:", *(f"  {n}" for n in remarks)] if remarks else []
        lines += ["", f"written: {', '.join(str(p) for p in self.texts)}", *self._next()]
        return "\n".join(lines) + "\n"

    def _next(self) -> list[str]:
        names = {p.name: p for p in self.texts}
        edits = [f"{names['vehicle.toml']} (every line marked SET)"] if "vehicle.toml" in names else []
        edits += [f"{names['map.toml']} (check channels, units, signs)"] if "map.toml" in names else []
        edits.append(f"{names['runs.csv']} (fill in what is blank)")
        return [
            "next:",
            f"  1. edit {', '.join(edits)}",
            f"  2. aqualog inspect {self.out}",
            f"  3. aqualog report {self.out}{''.join(f' --dbc {d}' for d in self.dbc)} -o report",
        ]

    def headline(self) -> str:
        return "\n".join([self.text().split("\n")[0], *self._next()])

    def plot(self) -> go.Figure:
        """Return how many drives have each value that the names say."""
        import plotly.graph_objects as go

        made = go.Figure()
        for column, values in self.names.columns.items():
            known = [v for v in values if v]
            kinds = sorted(set(known))
            made.add_bar(x=[f"{column}: {k}" for k in kinds], y=[known.count(k) for k in kinds], name=column)
        made.update_layout(title=str(self.out), template="plotly_white")
        made.update_yaxes(title="drives")
        return made

    def files(self) -> Writers:
        """Return the campaign file and the files beside it, by name."""
        return {p.name: text_file(partial(str, text)) for p, text in self.texts.items()}

    def write(self) -> AnyCampaign:
        """Write the files where `propose` was asked to put them, and return the campaign.

        Raises
        ------
        ConfigError
            With all that is left to fill in.
        """
        self.write_files()
        return self.opened(self.out, dbc=self.dbc)

    def write_files(self) -> None:
        """Write the files where `propose` was asked to put them, all of them or none; the campaign file last."""
        write_together({self.out.parent / name: write for name, write in self.files().items()})


def propose(
    opened: Callable[..., AnyCampaign],
    folder: PathLike,
    out: PathLike = "campaign.toml",
    *,
    vehicle: PathLike | None = None,
    dbc: PathLike | Sequence[PathLike] = (),
    force: bool = False,
    progress: Progress = None,
) -> Proposal[AnyCampaign]:
    """Look at every log in a folder and below it, and propose a campaign file; see `Campaign.propose`.

    `opened` makes a campaign of a campaign file.
    """
    from aqualog.config.vehicle import load_vehicle

    hear, place, target = listener(progress), file_of(folder, "folder"), file_of(out, "out")
    car = None if vehicle is None else file_of(vehicle, "vehicle")
    databases = tuple(file_of(p, "dbc") for p in names_of(dbc, "dbc"))
    if not place.is_dir():
        raise ConfigError("is no folder", where=str(place), expected="a folder with logs")
    if target.suffix.lower() != ".toml":
        raise ConfigError("-o is no .toml", where=str(out), expected="the name of the campaign file to write")
    targets = {n: target.parent / n for n in ("runs.csv", "map.toml", "vehicle.toml")}
    if car is not None:
        load_vehicle(car)
        del targets["vehicle.toml"]
    refuse_existing([target, *targets.values()], force=force, sources=[*databases, *([car] if car else [])])

    from aqualog.align.propose_map import measures_wheels, propose_signals
    from aqualog.campaign.propose_drives import (
        Drive,
        broken_logs,
        drive_name,
        group_drives,
        is_run_table,
        kinds_of,
        scan,
        without_twins,
    )
    from aqualog.campaign.propose_files import labels_of, relative
    from aqualog.campaign.propose_names import read_names
    from aqualog.io.reader import ReadOptions

    way = relative(place, target.parent)
    if ";" in way or not way.isprintable():
        raise ConfigError(f"{way!r}: a ; parts the files of a drive", where=str(place), hint="-o in that folder")
    options = ReadOptions(dbc=databases)
    if targets["runs.csv"].exists() and not is_run_table(targets["runs.csv"]):
        raise ConfigError(
            "is no table of runs", where=str(targets["runs.csv"]), hint="another folder for the campaign file (-o)"
        )
    found = scan(place, options=options, leave_out=[target, *targets.values()], report=hear)
    if not found.logs:
        reasons = "; ".join(f"{name}: {why}" for name, why in found.bad[:5])
        raise ConfigError(f"no log that can be read{f' ({reasons})' if reasons else ''}", where=str(place))
    hear("looking for copies")
    logs, twins = without_twins(found.logs)
    kinds, count = kinds_of(logs)
    hear("grouping files into drives")
    wheels = [measures_wheels(logs[kinds.index(k)], options) if count > 1 else True for k in range(count)]
    drives, notes = group_drives(logs, kinds, lambda a, b: wheels[a] and wheels[b])
    signals = propose_signals([d.files for d in drives], options, hear)
    broken = broken_logs(place, found.bad)
    kept_names = {f.name for f in broken}
    notes = (
        *twins, *notes,
        *(f"cannot be read, but is in runs.csv (failed in a batch): {n}: {why}"
          for n, why in found.bad if n in kept_names),
        *(f"left out: {n}: {why}" for n, why in found.bad if n not in kept_names),
    )  # fmt: skip
    # a broken log is a run that failed: with its row every batch says so
    drives = tuple(sorted((*drives, *(Drive((f,), (0,)) for f in broken)), key=lambda d: d.files[0].name))
    table = read_names([drive_name(d) for d in drives])
    labels = labels_of(drives, found.labels)
    texts = _texts(place, target, car, drives, table, labels, signals)
    kept: tuple[str, ...] = ()
    if force and not signals.needed and targets["map.toml"].exists():
        kept = (f"{targets['map.toml']} exists from before and is not used",)
    own = (*databases, *([car] if car else []), *(f.path for d in drives for f in d.files))
    left = [n for n in found.labels if n not in labels.values()]
    label_notes = (f"labels files that no drive's name fits: {', '.join(left[:5])}",) if left else ()
    return Proposal(
        opened, target, texts, found, drives, table, signals, notes, label_notes, databases, notes=kept,
        has_loss=bool(found.bad), sources=own,
    )  # fmt: skip


def _texts(
    folder: Path,
    out: Path,
    vehicle: Path | None,
    drives: tuple[Drive, ...],
    table: NameTable,
    labels: dict[int, str],
    signals: MapProposal,
) -> dict[Path, str]:
    """What is to be written; the campaign file last, so that it never names a file that is not there."""
    from aqualog.campaign.propose_files import campaign_text, relative, runs_text, vehicle_text
    from aqualog.config.signal_map import map_text

    base = out.parent
    name = folder.resolve().name or "campaign"
    texts = {base / "runs.csv": runs_text(drives, table, labels, base=base, folder=folder)}
    if signals.needed:
        comments = [f"proposed for {len(drives)} drives in {name}: check every line"]
        comments += [f"not in all drives, so left out: {s} = {why}" for s, why in signals.left_out.items()]
        texts[base / "map.toml"] = map_text(
            signals.signal_map, comments=comments, remarks=signals.remarks, unmapped=signals.unmapped
        )
    if vehicle is None:
        texts[base / "vehicle.toml"] = vehicle_text(name)
        car = "vehicle.toml"
    else:
        car = relative(vehicle, base)
    texts[out] = campaign_text(name, car, "map.toml" if signals.needed else None, "runs.csv")
    return texts


def _short(text: str) -> str:
    return text if len(text) <= 70 else f"{text[:30]}...{text[-37:]}"
