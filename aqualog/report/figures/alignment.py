"""A quantity in a reference and in its sources on one clock, and what remains between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aqualog.align.clock import ClockFit
from aqualog.align.quantity import QUANTITIES, Quantity
from aqualog.core.records import FloatArray, TimeArray
from aqualog.report.figures.slope_axes import axis, layout, rounded
from aqualog.report.reduce import ALL_SAMPLES, reduce_indices
from aqualog.report.theme import INK, WHEEL_COLOURS
from aqualog.report.wording import plot_text

__all__ = ["alignment_figures"]


def alignment_figures(
    reference: Quantity, sources: Sequence[tuple[Quantity, ClockFit]], quantity: str
) -> list[dict[str, Any]]:  # fmt: skip
    """Return two figures: the quantity over the time of the reference, and each source less the reference.

    Offset, significant drift and scale of each source are taken out.
    """
    start, unit = int(reference.t_ns[0]), QUANTITIES[quantity]
    t_ref = _seconds(reference.t_ns, start)
    curves = [_curve(t_ref, reference.x, reference.file, INK)]
    rests = []
    for (source, fit), colour in zip(sources, _colours(len(sources)), strict=True):
        t, x = _seconds(fit.to_reference(source.t_ns), start), source.x / fit.ratio
        curves.append(_curve(t, x, source.file, colour))
        inside = (t >= t_ref[0]) & (t <= t_ref[-1])
        rests.append(_curve(t[inside], x[inside] - np.interp(t[inside], t_ref, reference.x), source.file, colour))
    name = quantity.replace("_", " ")
    return [
        {"data": curves, "layout": layout(f"{name}, aligned", axis("time [s]"), axis(f"{name} [{unit}]"))},
        {"data": rests, "layout": layout("source less reference", axis("time [s]"), axis(f"difference [{unit}]"))},
    ]


def _seconds(t_ns: TimeArray, start: int) -> FloatArray:
    return (t_ns - start).astype(np.float64) * 1e-9


def _colours(n: int) -> list[str]:
    known = list(WHEEL_COLOURS.values())
    return [known[i % len(known)] for i in range(n)]


def _curve(t: FloatArray, x: FloatArray, name: str, colour: str) -> dict[str, Any]:
    index = np.arange(x.size) if x.size <= ALL_SAMPLES else reduce_indices(x)
    return {
        "type": "scatter", "mode": "lines", "name": plot_text(name), "x": rounded(t[index]), "y": rounded(x[index]),
        "line": {"color": colour, "width": 1.5},
    }  # fmt: skip
