"""Tables of results from the entries of their documents."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl

__all__ = ["flat", "table"]


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
