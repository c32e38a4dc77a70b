"""`aq.evaluate`: detections against what was there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of, names_of
from aqualog.face.campaign import Campaign
from aqualog.face.campaign_store import is_campaign, split
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, page_file, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.detect.joint_cusum import JointCusumParams
    from aqualog.evaluate.drives import LogSource
    from aqualog.evaluate.run import Evaluation
    from aqualog.face.evaluate_inputs import Inputs
    from aqualog.report.sections import Report

__all__ = ["Comparison", "evaluate"]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Detections held against what was there.

    `evaluation` holds the records; `keys` are those of the configuration by which tables are repeated; `late` names
    drives whose labels begin after the log has ended, with what is left out of them.
    """

    evaluation: Evaluation
    name: str
    keys: tuple[str, ...]
    joint: JointCusumParams
    late: Mapping[str, str]
    cut: tuple[str, ...] = ()
    sources: tuple[Path, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Sentences on the drives."""
        from aqualog.report.evaluation_words import notes_of

        return tuple(notes_of(self.evaluation.records))

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether a drive failed, was cut, or has labels after its end."""
        return bool(self.evaluation.failed or self.late or any(r.is_lossy for r in self.evaluation.records))

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog evaluate`."""
        from aqualog.report.evaluation import evaluation_document

        return evaluation_document(self.evaluation, by=self.keys)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """The lists of the document, each as a table."""
        import polars as pl

        lists = {k: v for k, v in self.document.items() if isinstance(v, list) and v and isinstance(v[0], Mapping)}
        plain = {k: [{n: x if isinstance(x, _CELL) else str(x) for n, x in row.items()} for row in v]
                 for k, v in lists.items()}  # fmt: skip
        return {k: pl.DataFrame(v, infer_schema_length=None, strict=False) for k, v in plain.items()}

    def text(self) -> str:
        """Return the tables that the command prints."""
        from aqualog.report.text import report_text

        return report_text(self._report())

    def _report(self) -> Report:
        from aqualog.report.evaluation import evaluation_report

        return evaluation_report(self.evaluation, by=self.keys)

    def headline(self) -> str:
        """Return the answer in one sentence."""
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
            "evaluation.html": page_file(self._page),
            "thresholds.toml": text_file(self._thresholds),
        }
        if self.evaluation.tuning is None:
            del files["thresholds.toml"]
        return files

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page to exactly this path.

        Raises
        ------
        ConfigError
        """
        return self._write_to(path, page_file(self._page), force=force)

    def write_thresholds(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the tuned thresholds, which `aq.detect` takes.

        Raises
        ------
        ConfigError
        """
        return self._write_to(path, text_file(self._thresholds), force=force)

    def _page(self) -> str:
        from aqualog.report.page import report_page

        return report_page(self._report(), title=self.name)

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

    hear = listener(progress)
    given = inputs_of(inputs, vehicle, map=map, dbc=dbc, labels=labels)
    keys = group_keys(split(by), given.keys)
    hear.detail(f"{len(given.sources)} drives of {given.name}")
    from aqualog.config.thresholds import load_settings, load_thresholds
    from aqualog.detect.thresholds import DEFAULT
    from aqualog.evaluate.run import evaluate as evaluate_drives
    from aqualog.evaluate.run import tune as tune_drives

    start, of_rivals = load_thresholds(file_of(thresholds, "thresholds")) if thresholds is not None else (DEFAULT, {})
    sources = given.sources
    if thresholds is not None:
        joint = load_settings(Path(thresholds)).joint_cusum
        sources = tuple(replace(s, joint=joint) for s in sources)
    work = tune_drives if tune else evaluate_drives
    found = work(sources, thresholds=start, rivals=of_rivals if rivals else None, with_roc=roc, report=hear)
    late, cut = _labels_beyond(found, sources)
    own = (*given.files, *(Path(p) for p in (thresholds,) if p is not None))
    return Comparison(found, given.name, keys, sources[0].joint, late, cut, own)


def inputs_of(
    inputs: PathLike | Sequence[PathLike] | Campaign,
    vehicle: PathLike | None = None,
    *,
    map: PathLike | None = None,
    dbc: PathLike | Sequence[PathLike] = (),
    labels: PathLike | None = None,
) -> Inputs:
    """Return the drives to evaluate, read and checked completely.

    Raises
    ------
    ConfigError, LogError
    """
    from aqualog.face.evaluate_inputs import campaign_inputs, log_inputs

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
        return campaign_inputs(found.configured)
    return log_inputs(names, car, map_file, databases, truth)


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
