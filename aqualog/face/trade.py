"""`aq.tyre_test`: the numbers that the tyre trade publishes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of, number_of, text_of, whole_number
from aqualog.face.campaign_inputs import CampaignInputs, split
from aqualog.face.drive import sources_of
from aqualog.face.listener import Counted, Progress, listener
from aqualog.face.result import PathLike, Result, Writers, flat, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.report.sections import Report
    from aqualog.trade.entry import Kind
    from aqualog.trade.evaluation import TradeTest

__all__ = ["TyreTest", "kind_of", "tyre_test"]

_KINDS = ("straight", "curve", "braking")
_INSIDE = ("onset_missing", "curve")  # parts of a row that are no cells of a table


@dataclass(frozen=True, eq=False, repr=False)
class TyreTest(Result):
    """A tyre test: every run with its value and whether it counts, every set with its mean and index.

    `test` holds the records, `name` is that of the campaign, `page` the page that a watch has written.
    """

    test: TradeTest
    name: str
    page: Path | None = None

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.trade.document import trade_document

        return trade_document(self.test, self.name)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`sets`, `runs`, and the `limits` in use. Columns are the fields of the document."""
        d = self.document
        return {n: rows_table([_row(r) for r in d[n]]) for n in ("sets", "runs", "limits")}

    def _report(self) -> Report:
        from aqualog.report.trade.sections import trade_report

        return trade_report(self.test)

    def headline(self) -> str:
        from aqualog.report.trade.sections import headline

        sentences = [f"  {s.index.sentence}" for s in self.test.sets if s.index is not None]
        return "\n".join([f"{self.name}: {headline(self.test)}", *sentences])

    def plot(self) -> go.Figure:
        """Return the figures of the page side by side."""
        from aqualog.report.figures import side_by_side
        from aqualog.report.trade.figures import trade_figures

        sentence = {"text": self.headline(), "showarrow": False}
        return side_by_side(
            list(trade_figures(self.test).values()) or [{"data": [], "layout": {"annotations": [sentence]}}]
        )

    def files(self) -> Writers:
        """Return the document, sets and runs as CSV, and the page, each by the name of the test."""
        from aqualog.report.spreadsheet import csv_bytes

        kind, tables = self.test.options.kind, self.tables
        return {
            f"{kind}.json": self._json_file(),
            **{
                f"{kind}_{n}.csv": text_file(lambda n=n: csv_bytes(tables[n]).decode("utf-8"))  # type: ignore[misc]
                for n in ("sets", "runs")
            },
            f"{kind}.html": self._page(self.name),
        }

    def write_page(self, path: PathLike, *, force: bool = False) -> Any:
        """Write the page to exactly this path."""
        return self._write_as(f"{self.test.options.kind}.html", path, force=force)


def _row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of the document as one of a table: an interval in two columns, notes as one text."""
    plain = {k: v for k, v in row.items() if k not in _INSIDE and k not in ("notes", "lane_s")}
    lane = row.get("lane_s") or (None, None)
    if "lane_s" in row:
        plain |= {"lane_start_s": lane[0], "lane_end_s": lane[1]}
    return {**flat(plain), **({"notes": "; ".join(row["notes"])} if "notes" in row else {})}


def tyre_test(
    inputs: PathLike | Sequence[PathLike] | CampaignInputs,
    kind: str = "straight",
    *,
    vehicle: PathLike | None = None,
    map: PathLike | None = None,
    by: str | Sequence[str] = (),
    control: str = "",
    index: float = 100.0,
    limits: PathLike | None = None,
    progress: Progress = None,
    **of_kind: Any,
) -> TyreTest:
    """Evaluate a tyre test: straight or curved aquaplaning, or wet braking.

    Parameters
    ----------
    inputs : str, Path, several, or Campaign
        A campaign file, or logs of which each is a run of its own.
    kind : str
        `straight` (speed of 15 % slip), `curve` (lateral acceleration in a trough) or `braking` (braking force
        coefficient).
    vehicle, map : paths, optional
        Vehicle file, needed for logs; signal map.
    by : str or several
        Keys of a set: tyre, pressure, depth, load, ...; default: those in which the runs differ.
    control : str
        Tyre of the control sets: its drift by run order is taken out of the others' index.
    index : float
        Index of the control, 1 to 1000.
    limits : str or Path, optional
        Thresholds that differ from the defaults.
    progress : callable, optional
        Called with each step of the work, such as `print`.
    **of_kind
        `curve`: `radius` [m], `result` (`min`, `mean`, `area`). `braking`: `v_from`, `v_to` [km/h], `coefficients`
        (file of the wet grip index). All: `jobs` (logs at a time; default one per core), `dbc`.

    Raises
    ------
    ConfigError
        A log that cannot be read is no error: it stands in `test.failed`.

    Examples
    --------
    >>> aq.tyre_test("campaign.toml", "straight", by="tyre", control="SRTT").tables["sets"]
    """
    from aqualog.campaign.bins import check_plan
    from aqualog.config.trade import load_coefficients, load_limits
    from aqualog.trade.evaluation import Options, check_control, entries_of, evaluated
    from aqualog.trade.limits import defaults
    from aqualog.trade.logs import Request, copies_in, measure_logs, names_of_runs

    hear, test_kind = listener(progress), kind_of(kind)
    dbc, jobs = of_kind.pop("dbc", ()), of_kind.pop("jobs", None)
    given = _given(test_kind, of_kind)
    own = inputs if isinstance(inputs, CampaignInputs) else CampaignInputs(inputs, vehicle=vehicle, map=map, dbc=dbc)
    campaign = own.configured.campaign
    keys = check_plan(campaign, split(by)).keys
    check_control(campaign, text_of(control, "control"))
    if index != 100.0 and not control:
        raise ConfigError("an index without a control", expected="the control's tyre, whose index this is")
    used = defaults() if limits is None else load_limits(file_of(limits, "limits"))
    coefficients = given.pop("coefficients", None)
    options = Options(
        test_kind, used, keys, control, number_of(index, "index", 1.0, 1000.0), given.pop("result", "mean"),
        None if coefficients is None else load_coefficients(file_of(coefficients, "coefficients")),
    )  # fmt: skip
    processes = os.cpu_count() or 1 if jobs is None else whole_number(jobs, "jobs", 1, 1024)
    request = Request(test_kind, used, **given)
    names = names_of_runs(own.configured)
    measured = measure_logs(own.configured, request, jobs=processes, report=Counted(hear, "logs"))
    failed = {names[i]: m for i, m in measured.items() if isinstance(m, str)}
    for name, reason in failed.items():
        hear.failed(name, reason)
    copies = {i: k for i, k in copies_in(campaign).items() if not isinstance(measured[i], str)}
    once = {i: m for i, m in measured.items() if i not in copies}
    twice = tuple(f"{names[i]} is the same log as {names[k]}: it counts once" for i, k in sorted(copies.items()))
    found = evaluated(entries_of(campaign, names, once, keys), options, failed)
    found = replace(found, notes=(*found.notes, *twice))
    return TyreTest(
        found, own.name, has_loss=bool(failed), sources=sources_of(own.sources, limits, coefficients),
    )  # fmt: skip


def kind_of(kind: str) -> Kind:
    """Return the kind of a test.

    Raises
    ------
    ConfigError
    """
    found: Any = text_of(kind, "kind")
    if found not in _KINDS:
        raise ConfigError(f'no test "{found[:40]}"', expected=", ".join(_KINDS))
    checked: Kind = found
    return checked


def _given(kind: Kind, of_kind: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of one kind of test, checked, SI; None counts as not given."""
    known = {"straight": (), "curve": ("radius", "result"), "braking": ("v_from", "v_to", "coefficients")}[kind]
    given = {n: x for n, x in of_kind.items() if x is not None}
    strange = next((n for n in given if n not in known), None)
    if strange is not None:
        raise ConfigError(f"{strange} does not apply to {kind}", expected=", ".join(known) or "none of these")
    if "radius" in given:
        given["radius"] = number_of(given["radius"], "radius", 5.0, 2000.0, "m")
    if "result" in given:
        from aqualog.trade.curve_set import RESULTS

        if text_of(given["result"], "result") not in RESULTS:
            raise ConfigError(f'result "{given["result"][:40]}"', expected=", ".join(RESULTS))
    if kind == "braking":
        v = [number_of(given.pop(n, v), n, 1.0, 300.0, "km/h") for n, v in (("v_from", 80.0), ("v_to", 20.0))]
        if v[0] <= v[1]:
            raise ConfigError(f"a stop from {v[0]:g} to {v[1]:g} km/h", expected="from a higher to a lower speed")
        given |= {"v_from": v[0] / 3.6, "v_to": v[1] / 3.6}
    return given
