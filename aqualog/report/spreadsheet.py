"""Tables as CSV that a spreadsheet opens, and in which nothing runs."""

from __future__ import annotations

import json
import math
import re
from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl

__all__ = ["csv_bytes", "safe_cell"]

_DIGITS = 6
_FRAME_DIGITS = 9  # as the numbers of the JSON documents

# a spreadsheet takes a cell that begins so for a formula; one that splits at semicolons or tabs makes cells of its own
_FORMULA = re.compile(r"(?:^|(?<=[;,|\t\r\n]))(?=\s*[=+\-@＝＋－＠])|^(?=[\t\r\n])")


def safe_cell(value: object) -> str:
    """A cell that no spreadsheet takes for a formula; empty for NaN and infinities."""
    if isinstance(value, float):
        return f"{value:.{_DIGITS}g}" if math.isfinite(value) else ""
    text = str(value)
    is_number = text.removeprefix("-").replace(".", "", 1).isdigit()
    return text if is_number or text == "-" else _FORMULA.sub("'", text)


def csv_bytes(frame: pl.DataFrame, *, decimal_comma: bool = False) -> bytes:
    """Return a table as CSV in UTF-8, numbers with 9 significant digits, what is missing blank.

    Lists become texts with `; ` between their values. With `decimal_comma`: `,` as decimal sign, `;` between cells,
    and the mark by which Excel knows UTF-8.
    """
    import polars as pl
    import polars.selectors as cs

    texts = {name: [_text(v) for v in frame[name]] for name, kind in frame.schema.items() if kind.is_nested()}
    plain = frame.with_columns(
        cs.float().fill_nan(None).round_sig_figs(_FRAME_DIGITS), *(pl.Series(n, t, pl.String) for n, t in texts.items())
    )
    safe = plain.with_columns(
        pl.Series(n, [None if v is None else safe_cell(v) for v in plain[n]], pl.String)
        for n, kind in plain.schema.items()
        if kind == pl.String
    )
    out = BytesIO()
    named = safe.rename({n: safe_cell(n) for n in safe.columns})
    named.write_csv(
        out, separator=";" if decimal_comma else ",", decimal_comma=decimal_comma, include_bom=decimal_comma
    )
    return out.getvalue()


def _text(value: Any) -> str | None:
    """A list or an object in one cell."""
    if value is None:
        return None
    if isinstance(value, dict):
        return json.dumps(value, default=str)
    return "; ".join("" if v is None else json.dumps(v, default=str) if isinstance(v, dict) else str(v) for v in value)
