"""JSON documents, and the tables that aqualog writes."""

from __future__ import annotations

from collections.abc import Iterable

from aqualog.book.documents import DOCUMENTS
from aqualog.book.documents.fields import Document, Field, paths
from aqualog.book.documents.tables import TABLES, Table
from aqualog.book.markdown import code, page, table

__all__ = ["documents_page"]

_SUMMARY = "Every field of the JSON documents that commands print, and every column of the tables that aqualog writes."
_HOW = """
`--json` prints one document on stdout. Numbers are SI unless the name says otherwise (`_kmh`, `_km`). A value that is
not available is null; NaN and infinity never appear. `[]` marks a list, `NAME` a key that is data. A JSON Schema of
each document lies in `aqualog/docs/schemas`; aqualog's own tests hold every document against it. New fields may be
added without a new `schema_version`. A document becomes a file by `-o`, or by `.save(DIR)` [from Python](python.md).

Gains of a log score are in nats (natural logarithm of a likelihood ratio).

Names of detectors: see [thresholds](thresholds.md). Names of effects: see [effects](effects.md).
"""
_LONG = 4
_STEP = {"list": "[].", "by name": ".NAME."}
_TABLES = """
Tables are Parquet files, which polars, pandas and DuckDB open as they are, or CSV files with commas and decimal points.
"""


def documents_page() -> str:
    """The page."""
    listed = [(f"[`{d.heading}`](#{_anchor(d.heading)})", d.summary) for d in DOCUMENTS.values()]
    listed += [(f"[`{t.name}`](#{_anchor(t.name)})", t.summary) for t in TABLES]
    return page(
        "Documents and tables",
        _SUMMARY,
        _HOW,
        table(("document", "what it holds"), listed),
        *(part for d in DOCUMENTS.values() for part in _document(d)),
        "## Tables",
        _TABLES,
        *(part for t in TABLES for part in _table(t)),
    )


def _anchor(heading: str) -> str:
    kept = "".join(c for c in heading.lower() if c.isalnum() or c in " -_")
    return "-".join(kept.split())


def _document(document: Document) -> list[str]:
    files = f" As a file: {', '.join(map(code, document.files))}." if document.files else ""
    return [
        f"## `{document.heading}`",
        f"{document.summary}{files} Schema: `schemas/{document.name}.schema.json`.",
        table(("field", "type", "unit", "meaning"), _rows(document)),
    ]


def _rows(document: Document) -> Iterable[tuple[str, str, str, str]]:
    """Every field; fields that stood before, as those of a score, are named by where."""
    shown: dict[tuple[Field, ...], str] = {}
    before = ""
    for path, field in paths(document.fields):
        if before and path.startswith(before):
            continue
        before = ""
        meaning = _meaning(field)
        inner = _inner(field)
        if inner in shown and len(inner) >= _LONG:
            meaning = f"{meaning}; fields as those of `{shown[inner]}`"
            before = f"{path}{_STEP.get(field.kind, '.')}"
        elif inner:
            shown[inner] = path
        yield code(path), _type(field), field.unit, meaning


def _inner(field: Field) -> tuple[Field, ...]:
    """The fields of an object, or of what a list or table of objects holds."""
    while field.item is not None:
        field = field.item
    return field.fields


def _type(field: Field) -> str:
    return field.type + (" or null" if field.can_be_null else "") + ("" if field.is_always else ", not always")


def _meaning(field: Field) -> str:
    values = ", ".join(code(v) for v in field.values if v)
    own = "keys of the runs stand beside the fields below" if field.keys else ""
    return "; ".join(x for x in (field.meaning, own, f"one of {values}" if values else "") if x)


def _table(of: Table) -> list[str]:
    return [
        f"## `{of.name}`",
        f"{of.summary} Written by {of.source}.",
        table(("column", "type", "unit", "meaning"), [(code(c.name), c.type, c.unit, c.meaning) for c in of.columns]),
    ]
