"""`aq.diagnose`: what the simulation gets wrong on measured drives, and why."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import number_of, whole_number
from aqualog.face.campaign import Campaign
from aqualog.face.campaign_inputs import is_campaign
from aqualog.face.campaign_runs import CampaignRuns
from aqualog.face.detect import model_of
from aqualog.face.drive import Drive, sources_of, vehicle_needed
from aqualog.face.drives import DrivesLike, NothingUsableError, drives_of, load_drives, repeated_of, with_own_names
from aqualog.face.listener import Listener, Progress, lasting, listener
from aqualog.face.result import PathLike, Result, Writers, document_head, flat, page_file, table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.checks.several import OfDrives
    from aqualog.core.records import Signals
    from aqualog.diagnose.records import Diagnosis as Found
    from aqualog.diagnose.records import ResidualView
    from aqualog.model.term import Model
    from aqualog.report.sections import Report

__all__ = ["Diagnosis", "check_apart", "diagnose"]

_MOST_DRIVES = 20  # named in the model file


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result):
    """Verdict, causes with size and interval, and what the extended model predicts better.

    `found` holds the records, `logs` the files as they were named, `vehicle_name` the cars. `model_file` is
    the file of the extended model that document and page name. `checks` hold what does not fit among the signals.
    `is_of_runs`: the drives are the runs of a campaign, and the document has each remark once.
    """

    found: Found
    logs: tuple[str, ...]
    vehicle_name: str
    file_notes: tuple[str, ...] = ()
    model_file: str | None = None
    checks: OfDrives = ()
    is_of_runs: bool = False

    @property
    def verdict(self) -> str:
        """`no_effect`, `named`, `compound`, `cannot_tell`, `unexplained` or `not_testable`."""
        return self.found.verdict

    @property
    def model(self) -> Model:
        """The extended model, for the argument `model` of `detect`, `simulate` and `diagnose`."""
        return self.found.model

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.checks.several import distinct
        from aqualog.report.diagnosis.document import diagnosis_document
        from aqualog.report.drive.document import drive_remark_rows, run_remark_rows

        document = diagnosis_document(
            self.found, logs=self.logs, tool_version=document_head()["tool_version"], notes=self.file_notes,
            vehicle=self.vehicle_name, extended_model=self.model_file,
        )  # fmt: skip
        rows = run_remark_rows(distinct(self.checks)) if self.is_of_runs else drive_remark_rows(self.checks)
        return {**document, "checks": rows}

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`causes`, `gain` by channel, `limits` of detection, `unexplained` and `alternatives`.

        A row of `causes` is a parameter: effect, where, drives, parameter, value, low and high (95 %), unit.
        """
        d = self.document
        causes = [
            {"effect": c["effect"], "where": c["where"], "drives": ", ".join(c["drives"]), "parameter": name, **flat(p)}
            for c in d["causes"]
            for name, p in (c["parameters"] or {"": {}}).items()
        ]
        channels = (d["gain"] or {"channel": {}})["channel"]
        others = [
            {"effects": " + ".join(c["key"] for c in a["causes"]), "evidence_ratio": a["evidence_ratio"]}
            for a in d["alternative_sets"]
        ]
        unexplained = [{**r, "depends_on": ", ".join(r["depends_on"])} for r in d["unexplained"]]
        return {
            "causes": table(
                causes, "effect where drives parameter value low high unit",
                text=("effect", "where", "drives", "parameter", "unit"),
            ),
            "gain": table(
                [{"channel": name, **c} for name, c in channels.items()],
                "channel unit rmse_before rmse_after rmse_change free_before free_after free_change",
                text=("channel", "unit"),
            ),
            "limits": table(
                d["limits"], "effect where size unit smallest_worth_naming ratio", text=("effect", "where", "unit")
            ),
            "unexplained": table(
                unexplained, "channel depends_on share p_value nearest cosine sentence",
                text=("channel", "depends_on", "nearest", "sentence"),
            ),
            "alternatives": table(others, "effects evidence_ratio", text=("effects",)),
        }  # fmt: skip

    def _report(self) -> Report:
        return self._sections(())

    def _sections(self, views: Sequence[ResidualView]) -> Report:
        from aqualog.checks.several import distinct
        from aqualog.report.diagnosis.sections import diagnosis_report

        return diagnosis_report(self.document, views, [r for _, r in distinct(self.checks)])

    def headline(self) -> str:
        from aqualog.report.diagnosis.words import effect_title, sentences
        from aqualog.report.values import interval_text, ordinary, pretty_unit

        d = self.document
        said = sentences(d)
        used = f"{len(d['drives'])} drives" if len(d["drives"]) > 1 else ", ".join(d["drives"]) or "no drive"
        lines = [f"{self.vehicle_name}, {used}: {self.verdict}", *said["headline"]]
        for c in d["causes"][:3]:
            for name, p in c["parameters"].items():
                value, interval = interval_text(p)
                lines.append(f"  {effect_title(c['key'])}, {name.replace('_', ' ')}: {value} ({interval}) "
                             f"{pretty_unit(p['unit'])}")  # fmt: skip
        return ordinary("\n".join([*lines[:6], *said["manoeuvre"][:1]]))

    def plot(self) -> go.Figure:
        """Return residuals before and after, errors of each channel, and what is not explained."""
        from aqualog.report.diagnosis.figures import plots
        from aqualog.report.diagnosis.views import view_figures
        from aqualog.report.figures import side_by_side

        explained = [x for c in self.found.causes for x in c.explains]
        found = plots(self.document)
        separation = found.pop("isolability", None)
        figures = [*view_figures(self.found.views, explained), *found.values()]
        sentence = {"text": self.found.sentence, "showarrow": False}
        return side_by_side(figures or [separation or {"data": [], "layout": {"annotations": [sentence]}}])

    def files(self) -> Writers:
        """Return `diagnosis.json`, `model.toml` and `diagnosis.html`."""
        from aqualog.report.page import report_page

        drives = self.found.drives
        title = ", ".join(dict.fromkeys([self.vehicle_name, *drives[:3]])) + (" …" if len(drives) > 3 else "")
        return {
            "diagnosis.json": self._json_file(),
            "model.toml": text_file(lambda: _model_text(self.found, self.vehicle_name)),
            "diagnosis.html": page_file(lambda: report_page(self._sections(self.found.views), title=title)),
        }

    def save(self, folder: PathLike, *, force: bool = False) -> tuple[Path, ...]:
        """Write document, model and page into a folder; document and page name the model file there."""
        return super(Diagnosis, self.naming(Path(folder) / "model.toml")).save(folder, force=force)

    def naming(self, path: PathLike) -> Diagnosis:
        """Return the same with `path` as the model file that document and page name."""
        return replace(self, model_file=str(path))

    def write_model(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the extended model, a file that `detect`, `simulate` and `diagnose` take."""
        return self._write_as("model.toml", path, force=force)

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page with the pictures before and after (HTML)."""
        return self._write_as("diagnosis.html", path, force=force)


def _model_text(found: Found, vehicle: str) -> str:
    """Return the model file: its origin as comments, then its terms; the same for the same result."""
    from aqualog.config.model import dump_model

    head = [
        f"What the simulation of {vehicle} lacks, by aqualog diagnose.",
        f"Verdict {found.verdict}: {found.sentence}",
        *(f"Drive: {name}" for name in found.drives[:_MOST_DRIVES]),
    ]
    if len(found.drives) > _MOST_DRIVES:
        head.append(f"and {len(found.drives) - _MOST_DRIVES} drives more.")
    if not found.model.terms:
        head.append("No term: this is the base model.")
    # a name may hold anything, a comment ends with its line
    lines = ["# " + "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split())) for text in head]
    name = "".join(c for c in vehicle if c.isprintable())
    return "\n".join(lines) + "\n\n" + dump_model(replace(found.model, car=name))


def diagnose(
    drives: DrivesLike | Campaign | CampaignRuns,
    vehicle: PathLike | Vehicle | None = None,
    *,
    holdout: DrivesLike = (),
    model: PathLike | Model | None = None,
    seed: int = 1,
    level: float = 0.01,
    surrogates: int | None = None,
    views: bool = True,
    progress: Progress = None,
) -> Diagnosis:
    """Find what the simulation gets wrong on measured drives: the cause, its size and interval, and the gain.

    Parameters
    ----------
    drives : Drive, Signals, str, Path or several; or a campaign
        Each `Drive` and each file is a drive; the files of a folder are one drive. A drive that cannot be read is left
        out, and `progress` hears why. A campaign is its file (TOML), a `Campaign`, or its runs.
    vehicle : Vehicle, str or Path
        What the simulation believes. Without it that of the first drive; a campaign names its own.
    holdout : Drive, Signals, str, Path or several
        Drives on which the gain is measured and nothing is fitted.
    model : Model, str or Path, optional
        Effects that are known already, on top of the base simulation.
    seed : int
        Of all that is drawn at random.
    level : float
        Share of drives without effect that may be given one, 0.0001 to 0.5.
    surrogates : int, optional
        Draws of noise that calibrate the test, 2 or more; 0: the test by its formula alone. Default 499.
    views : bool
        Keep the residuals before and after for page and figure, as the command does with `--page`. The document then
        has the units of all channels.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError, SignalError, ConfigError
        SignalError if no drive can be used.

    Examples
    --------
    >>> r = aq.diagnose(["monday.mf4", "tuesday.mf4"], "car.toml", holdout="friday.mf4")
    >>> r.verdict, r.tables["causes"]
    >>> aq.detect("wet.mf4", "car.toml", model=r.model)
    """
    hear = listener(progress)
    level = number_of(level, "level", 1e-4, 0.5)
    seed = whole_number(seed, "seed", 0, 2**63 - 1)
    if surrogates is not None:
        surrogates = whole_number(surrogates, "surrogates", 0, 100_000)
        if surrogates == 1:  # the spread of one draw is not known
            raise ConfigError("surrogates = 1", expected="0, or 2 to 100000")
    options: dict[str, Any] = {"seed": seed, "level": level}
    options |= {} if surrogates is None else {"surrogates": surrogates}
    campaign = _campaign_of(drives, vehicle)
    if campaign is not None:
        if not (isinstance(holdout, Sequence) and not holdout):
            raise ConfigError("holdout beside a campaign", expected="drives, or a campaign alone")
        return _of_campaign(campaign, model, options, hear)
    assert not isinstance(drives, Campaign | CampaignRuns)
    named, held = drives_of(drives), drives_of(holdout, is_needed=False)
    check_apart(named, held)
    own, unseen = with_own_names(named, held)
    car = vehicle_needed(vehicle, own[0] if own else None)
    known = model_of(model, car, hear)
    loaded = load_drives([*own, *unseen], car, hear)
    names = [d.label for d in unseen]

    def work(signals: dict[str, Signals]) -> Found:
        from aqualog.diagnose.run import Options
        from aqualog.diagnose.run import diagnose as run
        from aqualog.model.term import Model

        return run(
            [(n, s) for n, s in signals.items() if n not in names], car, model=known or Model(),
            holdout=[(n, s) for n, s in signals.items() if n in names], options=Options(**options, views=views),
            progress=_shares(hear),
        )  # fmt: skip

    found = loaded.tried(work, hear, names)
    used = [d for d in loaded.used if d.label not in names]
    from aqualog.checks.several import look_at_all, sentences

    checks = look_at_all(loaded.signals, car)
    notes = (*loaded.notes, *loaded.changes, *sentences(checks))
    notes = (*repeated_of(named), *notes)
    return Diagnosis(
        found, tuple(str(p) for d in used for p in d.paths), car.name, notes, checks=checks,
        notes=(*notes, *found.notes),
        has_loss=loaded.has_loss or bool(loaded.changes) or len(found.drives) < len(used),
        sources=sources_of((p for d in (*own, *unseen) for p in d.sources), vehicle, model),
    )  # fmt: skip


def check_apart(drives: Sequence[Drive], unseen: Sequence[Drive]) -> None:
    """Refuse a file that is diagnosed and held out: a gain on what was fitted means nothing."""
    own = {p.resolve() for d in drives for p in d.paths}
    twice = next((p for d in unseen for p in d.paths if p.resolve() in own), None)
    if twice is not None:
        raise ConfigError("is diagnosed and held out", where=str(twice), expected="other drives as holdout")


FORESEEN = 0.1  # share of the work from which on its time can be foreseen


def _shares(hear: Listener) -> Callable[[str, float], None]:
    """Report each step of work with its share and the time left: renewed on a terminal, as lines every tenth."""
    last: list[object] = []
    began = time.monotonic()

    def report(what: str, share: float) -> None:
        now = [what, round(10.0 * share) if hear.mode == "plain" else round(100.0 * share)]
        if now != last:
            last[:] = now
            seconds = time.monotonic() - began
            left = f", about {lasting(seconds * (1.0 - share) / share)} left" if share >= FORESEEN else ""
            hear(f"{what}, {100.0 * min(max(share, 0.0), 1.0):.0f} %{left}")

    return report


# --- campaigns -------------------------------------------------------------------------------------------------------


def _campaign_of(drives: object, vehicle: PathLike | Vehicle | None) -> Campaign | CampaignRuns | None:
    """Return the campaign behind an argument; None for drives."""
    if isinstance(drives, Campaign | CampaignRuns):
        if vehicle is not None:
            raise ConfigError("vehicle beside a campaign", expected="it in the campaign's runs")
        return drives
    names = [drives] if isinstance(drives, str | Path) else drives
    if not (isinstance(names, list | tuple) and all(isinstance(n, str | Path) for n in names)):
        return None
    texts = [str(n) for n in names]
    if not is_campaign(texts):
        return None
    if isinstance(vehicle, Vehicle):
        raise ConfigError("vehicle beside a campaign", where=texts[0], expected="it in the campaign's runs")
    return Campaign(texts, vehicle=vehicle)


def _of_campaign(
    campaign: Campaign | CampaignRuns, model: PathLike | Model | None, options: dict[str, Any], hear: Listener
) -> Diagnosis:
    """Diagnose the runs of a campaign together: they show what no single drive does."""
    from aqualog.model.term import Model

    known = model_of(model) or Model()
    runs = campaign.run(progress=hear) if isinstance(campaign, Campaign) else campaign
    if not runs.outcome.done:
        raise NothingUsableError([f"{name}: {reason}" for name, reason in runs.outcome.failed.items()])
    from aqualog.diagnose.campaign import diagnose_campaign
    from aqualog.diagnose.run import Options

    configured = runs.campaign.configured
    found = diagnose_campaign(runs.data, known, options=Options(**options), progress=hear)
    from aqualog.checks.several import sentences

    names = dict.fromkeys(car.name for car in configured.vehicles.values())
    checks = tuple((r.name, c) for r in runs.data.done for c in r.checks)
    notes = tuple(sentences(checks))
    return Diagnosis(
        found, runs.campaign.inputs, ", ".join(names), notes, checks=checks, is_of_runs=True,
        notes=(*notes, *found.notes), has_loss=runs.has_loss,
        sources=sources_of(runs.campaign.sources, model),
    )  # fmt: skip
