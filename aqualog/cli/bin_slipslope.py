"""`aqualog bin-slipslope`."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.options import (
    CarOfLogs,
    Dbc,
    Debug,
    Force,
    Inputs,
    Jobs,
    Json,
    Progress,
    Quiet,
    Signals,
    StoreOption,
    Verbose,
)

if TYPE_CHECKING:
    from aqualog.cli.console import Console

__all__ = ["BinWidth", "By", "Road", "Robust", "TableOut", "bin_slipslope", "check_table", "split", "write_table"]

By = Annotated[
    str,
    typer.Option(
        "--by",
        help="Configuration keys: tyre,pressure,water-depth,load,wear,side,manoeuvre,... Default: those that differ.",
        metavar="KEYS",
    ),
]
BinWidth = Annotated[
    float, typer.Option("--bin-width", help="Width of the speed bins.", min=1.0, max=100.0, metavar="KMH")
]
Road = Annotated[str, typer.Option("--road", help="wet, dry or both.", metavar="ROAD")]
Robust = Annotated[bool, typer.Option("--robust", help="Weigh outliers down (Huber).")]
TableOut = Annotated[
    Path | None, typer.Option("-o", "--out", help="Table of the rows: FILE.csv or FILE.parquet.", metavar="FILE")
]
_SUFFIXES = (".csv", ".parquet")


def bin_slipslope(
    inputs: Inputs,
    by: By = "",
    width: BinWidth = 10.0,
    road: Road = "wet",
    robust: Robust = False,
    store: StoreOption = None,
    vehicle: CarOfLogs = None,
    signals: Signals = None,
    dbc: Dbc = None,
    out: TableOut = None,
    jobs: Jobs = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Slip slope over speed for each configuration, and the speed of full aquaplaning.

    Slip is regressed on traction in bins of speed; the 95 % intervals treat a run, not a sample, as the unit, and are
    given with three runs or more. Beside each slope: the contact that is left against dry road, and what the model
    expects. Logs that have no results yet are run first, as `aqualog batch` does. The delay of v_x is estimated and
    taken off. --by side puts the wheels of a side together.

    JSON: rows, dry, delays, full_aquaplaning (from the slopes, from minor and from full spin-downs), spin_ups,
    minor_spin_downs.

    \b
    Examples:
      aqualog bin-slipslope campaign.toml
      aqualog bin-slipslope campaign.toml --by tyre,pressure --road both
      aqualog bin-slipslope campaign.toml --by water-depth,side --bin-width 20 --robust
      aqualog bin-slipslope campaign.toml --json | jq '.full_aquaplaning[] | select(.v_full_kmh)'
      aqualog bin-slipslope campaign.toml --store results -o slopes.csv
    """
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _bin_slipslope(
            inputs, by, width, road, store, vehicle, signals, dbc or [], out, jobs, robust=robust, as_json=as_json,
            force=force, console=console,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _bin_slipslope(
    inputs: list[str],
    by: str,
    width: float,
    road: str,
    store: str | None,
    vehicle: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    out: Path | None,
    jobs: int | None,
    *,
    robust: bool,
    as_json: bool,
    force: bool,
    console: Console,
) -> int:
    from aqualog.campaign.bins import check_plan, plan
    from aqualog.cli.campaign_results import check_targets, exit_code, opened, results
    from aqualog.cli.console import clean

    check_table(out)
    configured = opened(inputs, vehicle=vehicle, map_file=map_file, dbc=dbc)
    check_plan(configured.campaign, split(by), width_kmh=width, road=road)
    check_targets(configured, [out] if out is not None else [], force=force, store=store)
    data, outcome = results(configured, store, console=console, jobs=jobs)
    if not outcome.done:
        return exit_code(outcome, data)
    with console.steps() as steps:
        steps("regressing")
        from aqualog.campaign.full_speed import full_speeds
        from aqualog.campaign.slip_slope import slip_slopes
        from aqualog.campaign.spin_downs import minor_spin_downs
        from aqualog.campaign.spin_ups import spin_ups
        from aqualog.report.campaign_document import slope_document
        from aqualog.report.campaign_tables import slope_text

        cells = plan(data, split(by), width_kmh=width, road=road)
        slopes = slip_slopes(data, cells, robust=robust)
        steps("speeds of full aquaplaning")
        wet = cells if road != "dry" else plan(data, split(by), width_kmh=width)
        speeds = full_speeds(data, wet, slopes if road != "dry" else slip_slopes(data, wet, robust=robust))
        ups = list(zip(spin_ups(data, wet), spin_ups(data, wet, residual=True), strict=True))
        downs = minor_spin_downs(data, wet)
    document = slope_document(data.name, slopes, speeds, ups, downs)
    if out is not None:
        write_table(out, document["rows"])
        console.note(f"the table is {out}")
    if as_json:
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(clean(slope_text(slopes, speeds, ups, downs)))
    return exit_code(outcome, data)


def split(names: str) -> list[str]:
    """Names said after --by."""
    return [n.strip() for n in names.split(",") if n.strip()]


def check_table(out: Path | None) -> None:
    """Refuse a name of a table that says no known format, before any work.

    Raises
    ------
    ConfigError
    """
    from aqualog.errors import ConfigError

    if out is not None and out.suffix.lower() not in _SUFFIXES:
        raise ConfigError(f'"{out.suffix}" is no format of a table', where=str(out), expected=" or ".join(_SUFFIXES))


def write_table(out: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows of a document as CSV or Parquet, whole; intervals in two columns."""
    import polars as pl

    from aqualog.face.paths import write_whole
    from aqualog.report.campaign_csv import safe_cell
    from aqualog.report.campaign_document import flat_rows

    plain = flat_rows(rows)
    if out.suffix.lower() == ".csv":
        plain = [{k: safe_cell(v) if isinstance(v, str) else v for k, v in row.items()} for row in plain]
    frame = pl.DataFrame(plain, infer_schema_length=None)
    if out.suffix.lower() == ".parquet":
        write_whole(out, frame.write_parquet)
    else:
        write_whole(out, frame.write_csv)
