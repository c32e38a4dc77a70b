"""`aq.evaluate`: detections against what was there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import expand, file_of, list_files, names_of, no_vehicle, text_of
from aqualog.face.campaign import Campaign
from aqualog.face.campaign_inputs import is_campaign, split
from aqualog.face.drive import sources_of
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, flat, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.definition import Run
    from aqualog.campaign.jobs import Configured
    from aqualog.detect.joint_cusum import JointCusumParams
    from aqualog.evaluate.drives import LogSource
    from aqualog.evaluate.gates import GateResult
    from aqualog.evaluate.labels import Label
    from aqualog.evaluate.logged import LoggedRival
    from aqualog.evaluate.run import Evaluation
    from aqualog.report.sections import Report

__all__ = ["Comparison", "evaluate"]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Detections held against what was there.

    `evaluation` holds the records; `keys` are those of the configuration by which tables are repeated; `late` names
    drives whose labels begin after the log has ended, with what is left out of them. It also names rivals in the log
    that are never on. `gates` are those of `gated`, `logged` the rivals in the log.
    """

    evaluation: Evaluation
    name: str
    keys: tuple[str, ...]
    joint: JointCusumParams
    late: Mapping[str, str]
    cut: tuple[str, ...] = ()
    gates: tuple[GateResult, ...] = ()
    logged: tuple[LoggedRival, ...] = ()

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.evaluation import evaluation_document

        logged = {r.name: r.text for r in self.logged}
        return {**evaluation_document(self.evaluation, by=self.keys, gates=self.gates), "logged": logged}

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`detectors` and `by`: a row for each score; `confusion`; the lists of the document, each as a table."""
        d = self.document
        scores = {
            "detectors": [{"detector": n, **flat(s)} for n, s in d["detectors"].items()],
            "by": [{**b["groups"], "detector": n, **flat(s)} for b in d["by"] for n, s in b["detectors"].items()],
            "confusion": [
                {"label": row, "detector": n, **c} for row, of in d["confusion"].items() for n, c in of.items()
            ],
        }
        lists = {
            k: [{n: x if isinstance(x, _CELL) else str(x) for n, x in row.items()} for row in v]
            for k, v in d.items()
            if k not in scores and isinstance(v, list) and v and isinstance(v[0], Mapping)
        }
        return {k: rows_table(rows) for k, rows in {**scores, **lists}.items() if rows or k == "detectors"}

    def gated(self, gates: Sequence[str]) -> Comparison:
        """Return the same, held against gates such as `joint_cusum.recall>=0.9`.

        Each is `DETECTOR.MEASURE` with `>=`, `<=`, `>` or `<` and a number; measures bear the names of the document. A
        gate on what was not measured is not kept.

        Raises
        ------
        ConfigError
            With the nearest known name where one is wrong.
        """
        from aqualog.evaluate.gates import judge_gates, parse_gates
        from aqualog.evaluate.score import score_all

        texts, logged = [text_of(g, "gates") for g in gates], [r.name for r in self.logged]
        given = parse_gates(texts, with_rivals=self.evaluation.rivals is not None, logged=logged)
        return replace(self, gates=judge_gates(given, score_all(self.evaluation.records)))

    def _report(self) -> Report:
        from aqualog.report.evaluation import evaluation_report

        return evaluation_report(self.evaluation, by=self.keys, gates=self.gates)

    def headline(self) -> str:
        from aqualog.report.evaluation_words import headline

        failed = [f"  failed: {name}: {reason}" for name, reason in self.evaluation.failed.items()]
        return "\n".join([f"{self.name}: {len(self.evaluation.records)} drives", headline(self.evaluation), *failed])

    def plot(self) -> go.Figure:
        """Return the recall of each detector; curves over the threshold where they were asked for."""
        from aqualog.report.evaluation_figures import evaluation_figures
        from aqualog.report.figures import side_by_side

        return side_by_side(list(evaluation_figures(self.evaluation).values()))

    def files(self) -> Writers:
        """Return `evaluation.json` and `evaluation.html`; `thresholds.toml` where thresholds were tuned."""
        files = {
            "evaluation.json": self._json_file(),
            "evaluation.html": self._page(self.name),
            "thresholds.toml": text_file(self._thresholds),
        }
        if self.evaluation.tuning is None:
            del files["thresholds.toml"]
        return files

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page to exactly this path."""
        return self._write_as("evaluation.html", path, force=force)

    def write_thresholds(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the tuned thresholds, which `aq.detect` takes."""
        return self._write_to(path, text_file(self._thresholds), force=force)

    def write_junit(self, path: PathLike, *, force: bool = False) -> Path:
        """Write gates and drives as JUnit XML, which build servers show: a drive that cannot be read is an error."""
        return self._write_to(path, self.junit_file(), force=force)

    def junit_file(self) -> Callable[[Path], None]:
        """Return what writes the file of `write_junit`."""
        from aqualog.report.junit import Case, Suite, junit_xml

        gates = [
            Case(
                f"gates.{g.gate.detector}",
                g.gate.text,
                "" if g.is_kept else f"{g.gate.text}: {g.found}",
                output=g.found,
            )
            for g in self.gates
        ]
        drives = [
            *(Case("drives", r.name) for r in self.evaluation.records),
            *(Case("drives", name, error=reason) for name, reason in self.evaluation.failed.items()),
        ]
        return text_file(lambda: junit_xml([Suite("gates", gates), Suite("drives", drives)]))

    def _thresholds(self) -> str:
        from aqualog.config.thresholds import joint_text, thresholds_text

        found, about = self.evaluation, []
        if found.tuning is not None:
            about = [
                f"proposed on {len(found.tuning.tuned_on)} drives of {self.name}, "
                f"reported on {len(found.records)} others:",
                found.tuning.rule,
            ]
        return thresholds_text(found.thresholds, found.rivals, comments=about) + joint_text(self.joint)


_CELL = (str, int, float, bool, type(None))


def evaluate(
    inputs: PathLike | Sequence[PathLike] | Campaign,
    vehicle: PathLike | None = None,
    *,
    labels: PathLike | None = None,
    map: PathLike | None = None,
    dbc: PathLike | Sequence[PathLike] = (),
    by: str | Sequence[str] = (),
    rivals: bool = False,
    rival: str | Sequence[str] = (),
    roc: bool = False,
    thresholds: PathLike | None = None,
    tune: bool = False,
    progress: Progress = None,
) -> Comparison:
    """Compare what the detectors find with what was there.

    What was there comes from labels, from the truth in a simulated log, from the signal `on_water`, or from the lane's
    times in the campaign. A log that cannot be read is reported; the others are evaluated.

    Parameters
    ----------
    inputs : str, Path, several, or Campaign
        A campaign file, or logs of which each is a drive of its own.
    vehicle : str or Path, optional
        Vehicle file; needed for logs.
    labels : str or Path, optional
        CSV with `start_s,end_s,effect,wheel` [s], or a folder with NAME.csv for each log NAME.
    map, dbc : paths, optional
        Signal map and CAN databases.
    by : str or several
        Keys of the configuration by which the tables are repeated.
    rivals : bool
        Evaluate the methods of the prior art, too.
    rival : str or several
        Detectors that are in the log, `NAME=CHANNEL`, or `NAME=CHANNEL>=LEVEL` for a number.
    roc : bool
        Evaluate at thresholds from a quarter to four times, too.
    thresholds : str or Path, optional
        Thresholds to start from.
    tune : bool
        Propose thresholds on some drives, and report them on the others.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    ConfigError, LogError

    Examples
    --------
    >>> aq.evaluate("drive.mf4", "car.toml", labels="labels.csv").tables
    """
    from aqualog.campaign.definition import group_keys
    from aqualog.evaluate.logged import parse_rivals

    hear = listener(progress)
    logged = parse_rivals([rival] if isinstance(rival, str) else [text_of(r, "rival") for r in rival])
    given = inputs_of(inputs, vehicle, map=map, dbc=dbc, labels=labels)
    keys = group_keys(split(by), given.keys)
    hear.detail(f"{len(given.sources)} drives of {given.name}")
    from aqualog.config.thresholds import load_settings, load_thresholds
    from aqualog.detect.thresholds import DEFAULT
    from aqualog.evaluate.run import evaluate as evaluate_drives
    from aqualog.evaluate.run import tune as tune_drives
    from aqualog.report.evaluation_words import notes_of

    start, of_rivals = load_thresholds(file_of(thresholds, "thresholds")) if thresholds is not None else (DEFAULT, {})
    sources = tuple(replace(s, rivals=logged) for s in given.sources)
    if thresholds is not None:
        joint = load_settings(Path(thresholds)).joint_cusum
        sources = tuple(replace(s, joint=joint) for s in sources)
    work = tune_drives if tune else evaluate_drives
    found = work(sources, thresholds=start, rivals=of_rivals if rivals else None, with_roc=roc, report=hear)
    late, cut = _labels_beyond(found, sources)
    late |= _silent(found, logged)
    has_loss = bool(found.failed or late or any(r.is_lossy for r in found.records))
    return Comparison(
        found, given.name, keys, sources[0].joint, late, cut, logged=logged,
        notes=tuple(notes_of(found.records)), has_loss=has_loss, sources=sources_of(given.files, thresholds),
    )  # fmt: skip


def inputs_of(
    inputs: PathLike | Sequence[PathLike] | Campaign,
    vehicle: PathLike | None = None,
    *,
    map: PathLike | None = None,
    dbc: PathLike | Sequence[PathLike] = (),
    labels: PathLike | None = None,
) -> Inputs:
    """Return the drives to evaluate, read and checked completely."""
    names = list(inputs.inputs) if isinstance(inputs, Campaign) else names_of(inputs)
    car, map_file, truth = (
        None if p is None else file_of(p, n) for n, p in (("vehicle", vehicle), ("map", map), ("labels", labels))
    )
    databases = [file_of(p, "dbc") for p in names_of(dbc, "dbc")]
    if isinstance(inputs, Campaign) or is_campaign(names):
        beside: dict[str, object] = {"vehicle": car, "labels": truth}
        beside |= {"map": map_file, "dbc": databases or None} if isinstance(inputs, Campaign) else {}
        given = next((n for n, value in beside.items() if value is not None), None)
        if given is not None:
            raise ConfigError(f"{given} beside a campaign", where=names[0], expected="it in the campaign's runs")
        found = inputs if isinstance(inputs, Campaign) else Campaign(names, map=map_file, dbc=databases)
        return _of_campaign(found.configured)
    return _of_logs(names, car, map_file, databases, truth)


@dataclass(frozen=True, slots=True)
class Inputs:
    """What is evaluated: `keys` by which it can be grouped, `files` that no result may overwrite."""

    name: str
    sources: tuple[LogSource, ...]
    keys: tuple[str, ...]
    files: tuple[Path, ...]


def _of_campaign(configured: Configured) -> Inputs:
    """Drives of a campaign; runs on the same log are one drive with several lanes."""
    from aqualog.campaign.definition import with_load
    from aqualog.config.configured import files_of
    from aqualog.evaluate.drives import LogSource

    campaign = configured.campaign
    base = campaign.path.parent
    of_log: dict[tuple[Path, ...], list[Run]] = {}
    for run in campaign.runs:
        of_log.setdefault(run.logs, []).append(run)

    def source(logs: tuple[Path, ...], runs: Sequence[Run]) -> LogSource:
        first = runs[0]
        named = [configured.labels[r.labels] for r in runs if r.labels is not None]
        return LogSource(
            name="; ".join(str(p.relative_to(base)) if p.is_relative_to(base) else str(p) for p in logs),
            paths=logs,
            vehicle=with_load(configured.vehicles[first.vehicle], first),
            signal_map=configured.signal_map,
            dbc=configured.dbc,
            labels=tuple(dict.fromkeys(x for labels in named for x in labels)) if named else None,
            lanes=tuple(sorted({r.lane for r in runs if r.lane is not None})),
            groups=first.groups,
        )

    sources = tuple(source(logs, runs) for logs, runs in of_log.items())
    return Inputs(campaign.name, sources, campaign.keys, files_of(configured))


def _of_logs(
    inputs: Sequence[str], vehicle: Path | None, map_file: Path | None, dbc: Sequence[Path], labels: Path | None
) -> Inputs:
    """Logs, each a drive of its own."""
    from aqualog.align.mapping import SignalMap
    from aqualog.config.signal_map import check_files, load_signal_map
    from aqualog.config.vehicle import load_vehicle
    from aqualog.evaluate.drives import LogSource

    if vehicle is None:
        raise no_vehicle("a campaign file that names one")
    paths = expand(inputs)
    if not paths:
        raise ConfigError("no log is named", expected="a campaign file, or at least one log")
    car = load_vehicle(vehicle)
    signal_map = load_signal_map(map_file) if map_file else SignalMap()
    check_files(signal_map, paths)
    given = _labels(labels, paths)
    sources = tuple(
        LogSource(str(p), (p,), car, signal_map, tuple(dbc), given.get(p), groups={"vehicle": car.name}) for p in paths
    )  # fmt: skip
    name = ", ".join(str(p) for p in paths) if len(paths) <= 2 else f"{paths[0].parent} ({len(paths)} logs)"
    named = (p for p in (vehicle, map_file, labels) if p)  # of labels in a folder, all that are in it
    return Inputs(name, sources, ("vehicle",), (*paths, *list_files(inputs), *dbc, *named))


def _labels(path: Path | None, logs: Sequence[Path]) -> dict[Path, tuple[Label, ...]]:
    """Labels of each log: from a folder by the log's name, or from one file."""
    from aqualog.config.labels import load_labels

    if path is None:
        return {}
    if path.is_dir():
        files = {log: path / f"{log.stem}.csv" for log in logs}
        missing = [f.name for f in files.values() if not f.is_file()]
        if missing:
            raise ConfigError(f"no {', '.join(missing[:5])} in it", where=str(path), expected="one CSV for each log")
        return {log: load_labels(f) for log, f in files.items()}
    labels = load_labels(path)
    if labels and len(logs) > 1:
        raise ConfigError(
            f"one labels file for {len(logs)} logs", where=str(path), expected="a folder with one CSV for each log",
            hint="a file without lines serves all: no water",
        )  # fmt: skip
    return dict.fromkeys(logs, labels)


def _labels_beyond(found: Evaluation, sources: Sequence[LogSource]) -> tuple[dict[str, str], tuple[str, ...]]:
    """Drives whose labels begin after the log's end, and remarks on labels that the end cuts."""
    from aqualog.evaluate.labels import after

    ends = {r.name: r.duration_s for r in found.records}
    late: dict[str, str] = {}
    for s in sources:
        starts = sorted({x.start_s for x in after(s.labels or (), ends[s.name])}) if s.name in ends else []
        if starts:
            what = "a label begins" if len(starts) == 1 else f"{len(starts)} labels begin"
            late[s.name] = f"{what} after the log's end at {ends[s.name]:g} s, at {starts[0]:g} s; left out"
    cut = [
        f"{s.name}: labels are cut where the log ends, at {ends[s.name]:g} s"
        for s in sources
        if s.name in ends and any(x.start_s < ends[s.name] < x.end_s for x in s.labels or ())
    ]
    return late, tuple(cut)


def _silent(found: Evaluation, logged: Sequence[LoggedRival]) -> dict[str, str]:
    """Rivals in the log that are in no log, missing in some, or never on.

    Raises
    ------
    SignalError
        If no log has the channel of a rival.
    """
    from aqualog.core.errors import SignalError

    out: dict[str, str] = {}
    for r in logged:
        values = [x.heard[r.name] for x in found.records if r.name in x.heard]
        absent = [x for x in found.records if r.name not in x.heard]
        if absent and not values:
            why = next(n for n in absent[0].notes if n.startswith(f"rival {r.name}: "))
            raise SignalError(
                why, where=absent[0].name, expected="a channel of the logs", hint="`aqualog inspect LOG` lists them"
            )
        runs = [x.detectors[r.name] for x in found.records if r.name in x.detectors]
        is_on = any(c.events or c.hit for d in runs for c in d.cells.values()) or any(d.false_alarms for d in runs)
        lines = []
        if absent:
            lines.append(f"not in {len(absent)} of {len(found.records)} drives, the first is {absent[0].name}")
        if values and not is_on:
            low, high = min(v[0] for v in values), max(v[1] for v in values)
            level = "" if r.level is None else f", level {r.sign}{r.level:g}"
            lines.append(
                f'channel "{r.channel}" is never on: its values are {low:g} ... {high:g}{level}; expected one that is '
                f"true somewhere; try: --rival '{r.name}={r.channel}>=LEVEL'"
            )
        if lines:
            out[f"rival {r.name}"] = "; ".join(lines)
    return out
