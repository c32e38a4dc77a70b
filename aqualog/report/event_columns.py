"""A long table of events by its columns, for the page's script: a tenth of the same table as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

__all__ = ["event_columns"]


def event_columns(rows: Sequence[dict[str, Any]]) -> dict[str, list[Any]]:
    """Columns of rows as `tables.event_rows` makes them, but for the times, which the page has in any case.

    Returns
    -------
    dict
        `detectors`, `places` (with the colour of the wheel) and `severities`, into which `detector`, `place` and
        `severity` are indices; `peak` and `evidence` as text, `ratio` the sort key of the peak; `speed` in km/h, -1
        where it is unknown.
    """
    detectors = _Index()
    places = _Index()
    severities = _Index()
    columns = {
        "detector": [detectors.of(r["detector"]) for r in rows],
        "place": [places.of((r["where"], r["colour"])) for r in rows],
        "severity": [severities.of(r["severity"]) for r in rows],
        "peak": [r["peak"].text for r in rows],
        "ratio": [float(f"{r['peak'].key:.6g}") for r in rows],
        "speed": [round(r["speed"].key, 3) for r in rows],
        "evidence": [r["evidence"] for r in rows],
    }
    return {**columns, "detectors": list(detectors), "places": list(places), "severities": list(severities)}


class _Index(dict[Any, int]):
    """Values in the order in which they came."""

    def of(self, value: Any) -> int:
        return self.setdefault(value, len(self))
