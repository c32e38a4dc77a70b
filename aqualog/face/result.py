"""What every result of the face offers: tables, a figure, the command's document and files, and a short repr."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of, refuse_existing, write_together, write_whole

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.report.sections import Report

__all__ = [
    "PathLike", "Result", "Writers", "bars", "check_csv", "document_head", "flat", "page_file", "printable",
    "rows_table", "table", "text_file",
]  # fmt: skip

PathLike = str | Path
Writers = Mapping[str, Callable[[Path], None]]
"""Names of files with what writes each to a given path."""

_REPR_LINES = 8
_REPR_WIDTH = 160
_HEADLINE_LINES = 7  # of the text, where a result has no headline of its own


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result(ABC):
    """The result of one call.

    `notes` are sentences for the user. `has_loss` says whether data was lost or an input failed: the command then ends
    with exit code 3. `sources` are the files that no result may overwrite.
    """

    notes: tuple[str, ...] = ()
    has_loss: bool = False
    sources: tuple[Path, ...] = ()

    @property
    @abstractmethod
    def document(self) -> dict[str, Any]:
        """The command's JSON document as plain Python objects."""

    @property
    @abstractmethod
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """The result as polars tables, by name; the first is the one that a notebook shows."""

    @property
    def printed(self) -> Mapping[str, pl.DataFrame]:
        """The tables that the command shows: those of `tables` without samples."""
        return self.tables

    def text(self) -> str:
        """Return what the command prints for a reader."""
        from aqualog.report.text import report_text

        report = self._report()
        return "" if report is None else report_text(report)

    def headline(self) -> str:
        """Return the answer in a few lines, without tables."""
        return "\n".join(self.text().rstrip("\n").split("\n")[:_HEADLINE_LINES])

    @abstractmethod
    def plot(self) -> go.Figure:
        """Return the main figure, to show or to change."""

    @abstractmethod
    def files(self) -> Writers:
        """Return the files that `save` writes, each with its writer."""

    def to_json(self) -> str:
        """Return the command's JSON document as text. Numbers that are not available are null."""
        return json.dumps(self.document, indent=1, allow_nan=False)

    def save(self, folder: PathLike, *, force: bool = False) -> tuple[Path, ...]:
        """Write the files of this result into a folder, all of them whole or none.

        Parameters
        ----------
        folder : str or Path
            It is made if it does not exist.
        force : bool
            Overwrite files of an earlier result. Sources are never overwritten.

        Raises
        ------
        ConfigError
            If a file exists already, or is a source of this result.
        AqualogError
            If a file cannot be written.
        """
        out, files = file_of(folder, "folder"), self.files()
        refuse_existing([out / name for name in files], force=force, sources=self.sources)
        write_together({out / name: write for name, write in files.items()})
        return tuple(out / name for name in files)

    def write_csv(self, path: PathLike, *, decimal_comma: bool = False, force: bool = False) -> tuple[Path, ...]:
        """Write the tables that the command shows as CSV, all of them whole or none.

        Parameters
        ----------
        path : str or Path
            `NAME.csv`, for the first table. Each other table becomes `NAME_TABLE.csv` beside it, but one without
            columns.
        decimal_comma : bool
            For a spreadsheet that expects it: decimal commas, and semicolons between cells.
        force : bool
            Overwrite files that exist. Sources are never overwritten.

        Raises
        ------
        ConfigError
            If the name does not end in .csv, a file exists already, or is a source of this result.
        AqualogError
            If a file cannot be written.
        """
        files = self.csv_files(path, decimal_comma=decimal_comma, force=force)
        write_together(files)
        return tuple(files)

    def csv_files(self, path: PathLike, *, decimal_comma: bool, force: bool) -> Mapping[Path, Callable[[Path], None]]:
        """Return the files of `write_csv`, each with its writer, once they are checked."""
        from aqualog.report.spreadsheet import csv_bytes

        first = check_csv(file_of(path, "path"))
        printed = self.printed
        frames = {first: next(iter(printed.values()))} | {
            first.with_name(f"{first.stem}_{name}{first.suffix}"): frame
            for name, frame in [*printed.items()][1:]
            if frame.columns
        }
        refuse_existing(frames, force=force, sources=self.sources)
        return {p: methodcaller("write_bytes", csv_bytes(f, decimal_comma=decimal_comma)) for p, f in frames.items()}

    def _write_as(self, name: str, path: PathLike, *, force: bool) -> Path:
        """Write the file that `save` calls `name` to a path of the user's choice."""
        return self._write_to(path, self.files()[name], force=force)

    def _write_to(self, path: PathLike, write: Callable[[Path], None], *, force: bool) -> Path:
        """Write a file of this result whole or not at all, neither over a source nor, without force, another file."""
        target = file_of(path, "path")
        refuse_existing([target], force=force, sources=self.sources)
        write_whole(target, write)
        return target

    def _json_file(self) -> Callable[[Path], None]:
        return text_file(lambda: self.to_json() + "\n")

    def __repr__(self) -> str:
        lines = self.headline().rstrip("\n").split("\n")
        shown = lines[:_REPR_LINES] + (["..."] if len(lines) > _REPR_LINES else [])
        return "\n".join(printable(line) for line in shown)

    def _repr_html_(self) -> str:
        report = self._report()
        if report is not None:
            from aqualog.report.page import report_fragment

            return f"<pre>{escape(repr(self))}</pre>{report_fragment(report)}"
        table = next(iter(self.tables.values()), None)
        html = "" if table is None or table.is_empty() else table._repr_html_()
        return f"<pre>{escape(repr(self))}</pre>{html}"

    def _report(self) -> Report | None:
        """The sections that text and page show, where this kind of result has any."""
        return None

    def _page(self, title: str) -> Callable[[Path], None]:
        """Return the writer of the page of these sections."""

        def page() -> str:
            from aqualog.report.page import report_page

            report = self._report()
            assert report is not None
            return report_page(report, title=title)

        return page_file(page)


def check_csv(path: Path) -> Path:
    """Return the name of a table to be written, with `.csv` where it has no ending; a ConfigError if it is no .csv."""
    if not path.suffix:
        path = path.with_name(f"{path.name}.csv")
    if path.suffix.lower() != ".csv":
        raise ConfigError(f'"{path.suffix}" is no CSV', where=str(path), expected="a name that ends in .csv")
    return path


# --- files -----------------------------------------------------------------------------------------------------------


def text_file(text: Callable[[], str]) -> Callable[[Path], None]:
    """Return a writer of a text file; the text is made when it is written."""

    def write(path: Path) -> None:
        path.write_text(text(), encoding="utf-8")

    return write


def page_file(page: Callable[[], str]) -> Callable[[Path], None]:
    """Return a writer of a page; the page is made when it is written."""

    def write(path: Path) -> None:
        from aqualog.report.page import write_page

        write_page(path, page())

    return write


def printable(line: str) -> str:
    """Return a line that fits and drives no terminal."""
    shown = "".join(c if c.isprintable() or c == "\t" else "\ufffd" for c in line)
    return shown if len(shown) <= _REPR_WIDTH else f"{shown[: _REPR_WIDTH - 1]}…"


# --- documents, tables and figures -----------------------------------------------------------------------------------


def document_head() -> dict[str, Any]:
    """Return what every JSON document begins with: the version of its schema and that of aqualog."""
    from aqualog import __version__

    return {"schema_version": 1, "tool_version": __version__}


def rows_table(rows: Iterable[Mapping[str, Any]]) -> pl.DataFrame:
    """Return rows as a table; all of them decide the kind of a column."""
    import polars as pl

    return pl.DataFrame(list(rows), infer_schema_length=None, strict=False)


def table(
    rows: Iterable[Mapping[str, Any]], columns: str, *, text: Sequence[str] = (), whole: Sequence[str] = ()
) -> pl.DataFrame:  # fmt: skip
    """Return rows as a table of these columns (names with blanks between them): numbers, but for `text` and `whole`.

    NaN becomes null, and a value that a row does not have is null.
    """
    import polars as pl

    names = columns.split()
    kinds: dict[str, Any] = {**dict.fromkeys(text, pl.String), **dict.fromkeys(whole, pl.Int64)}
    schema = {n: kinds.get(n, pl.Float64) for n in names}
    return pl.DataFrame([{n: r.get(n) for n in names} for r in rows], schema=schema).fill_nan(None)


def flat(entry: Mapping[str, Any], stem: str = "") -> dict[str, Any]:
    """Return a row: `ci95` becomes `low` and `high`; an inner mapping gives columns with its name before theirs.

    Lists other than intervals are left out.
    """
    row: dict[str, Any] = {}
    for name, value in entry.items():
        if isinstance(value, Mapping):
            row |= flat(value, f"{stem}{name}_")
        elif name == "ci95" or name.endswith("_ci95"):
            low, high = value or (None, None)
            row |= {f"{stem}{name[:-4]}low": low, f"{stem}{name[:-4]}high": high}
        elif not isinstance(value, list | tuple):
            row[stem + name] = value
    return row


def bars(title: str, names: Sequence[str], values: Sequence[float], axis: str) -> go.Figure:
    """Return horizontal bars, one for each name."""
    import plotly.graph_objects as go

    made = go.Figure(go.Bar(x=values, y=names, orientation="h"))
    made.update_layout(title=title, template="plotly_white")
    made.update_xaxes(title=axis)
    return made
