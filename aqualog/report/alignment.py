"""Clocks of sources against a reference for a reader: the JSON document, text, and figures on one clock."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aqualog import __version__
from aqualog.align.clock import ClockFit
from aqualog.align.quantity import QUANTITIES, Quantity
from aqualog.core.errors import AqualogError
from aqualog.core.records import FloatArray, TimeArray
from aqualog.report.axes import axis, layout, rounded
from aqualog.report.plain import plain
from aqualog.report.reduce import ALL_SAMPLES, reduce_indices
from aqualog.report.theme import INK, WHEEL_COLOURS
from aqualog.report.wording import plot_text

__all__ = ["alignment_document", "alignment_figures", "alignment_text"]

Fits = Mapping[str, ClockFit | AqualogError]


def alignment_text(compared: Sequence[Quantity], fits: Fits, quantity: str) -> str:
    """Return offset, drift, scale and match of each source; the first source is the reference."""
    return "".join(_text(compared[0], c, fits[c.file], quantity) for c in compared[1:])


def alignment_document(compared: Sequence[Quantity], fits: Fits, quantity: str) -> dict[str, Any]:
    """Return the JSON document; NaN and infinities become null."""
    sources = []
    for source in compared[1:]:
        fit = fits[source.file]
        entry: dict[str, Any] = {"file": source.file, "channel": source.label}
        if isinstance(fit, AqualogError):
            entry["refused"] = fit.line()
        else:
            entry |= plain(dataclasses.asdict(fit), None)
        sources.append(entry)
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "quantity": quantity,
        "reference": {"file": compared[0].file, "channel": compared[0].label},
        "sources": sources,
    }


def _text(reference: Quantity, source: Quantity, fit: ClockFit | AqualogError, quantity: str) -> str:
    unit = QUANTITIES[quantity]
    head = f"{source.file} ({source.label}) against {reference.file} ({reference.label})\n"
    head += "".join(f"  {c.file}: {c.note}\n" for c in (reference, source) if c.note)
    if isinstance(fit, AqualogError):
        return f"{head}  refused: {fit.what}\n"
    side = "late" if fit.offset_s >= 0 else "early"
    offset_low, offset_high = fit.offset_ci95
    lines = [
        f"offset  {fit.offset_s:+.4f} s  95 % [{offset_low:+.4f}, {offset_high:+.4f}]  the source is {side}",
        f"drift   {fit.drift_ppm:+.0f} ppm  95 % [{fit.drift_ppm_ci95[0]:+.0f}, {fit.drift_ppm_ci95[1]:+.0f}]"
        + ("" if fit.drift_significant else "  not significant, not applied"),
        f"scale   source = {fit.ratio:.5f} * reference  95 % [{fit.ratio_ci95[0]:.5f}, {fit.ratio_ci95[1]:.5f}]",
        f"match   correlation {fit.peak:.3f} (limit {fit.peak_limit:.3f}, next best {fit.runner_up:.3f}) over "
        f"{fit.overlap_s:.0f} s, residual {fit.rms:.3g} {unit}",
    ]
    if quantity == "speed" and not math.isnan(fit.slip_offset_s):
        low, high = fit.slip_offset_ci95
        lines.append(f"        with tyre slip in the model: {fit.slip_offset_s:+.4f} s  95 % [{low:+.4f}, {high:+.4f}]")
        if low > offset_high or high < offset_low:
            lines.append("        the two do not agree: part of the offset is tyre slip, not time")
    return head + "".join(f"  {line}\n" for line in lines)


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
