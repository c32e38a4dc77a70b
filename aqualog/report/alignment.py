"""Clocks of sources against a reference for a reader: the JSON document, sections, and figures on one clock."""

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
from aqualog.report.figures import axis, figure, line
from aqualog.report.reduce import ALL_SAMPLES, reduce_indices
from aqualog.report.sections import Lines, Para, Report, Section, Table
from aqualog.report.theme import INK, WHEEL_COLOURS
from aqualog.report.values import plain

__all__ = ["alignment_document", "alignment_figures", "alignment_report"]

Fits = Mapping[str, ClockFit | AqualogError]


def alignment_report(
    compared: Sequence[Quantity], fits: Fits, quantity: str, left_out: Mapping[str, AqualogError]
) -> Report:
    """Offset, drift, scale and match of each source; the first source is the reference."""
    sections = [_section(compared[0], c, fits[c.file], quantity) for c in compared[1:]]
    if left_out:
        rest = Lines([f"left out: {file}: {error.what}" for file, error in left_out.items()])
        sections.append(Section("", [rest]))
    return Report("clocks", "clocks of several loggers", sections)


def _section(reference: Quantity, source: Quantity, fit: ClockFit | AqualogError, quantity: str) -> Section:
    head = f"{source.file} ({source.label}) against {reference.file} ({reference.label})"
    notes = [f"{c.file}: {c.note}" for c in (reference, source) if c.note]
    if isinstance(fit, AqualogError):
        return Section("", [Para(head, "everywhere"), Lines([*notes, f"refused: {fit.what}"])])
    offset, drift, scale = ([f"{x:{form}}" for x in ci] for ci, form in (
        (fit.offset_ci95, "+.4f"), (fit.drift_ppm_ci95, "+.0f"), (fit.ratio_ci95, ".5f")
    ))  # fmt: skip
    rows = [
        ("offset", f"{fit.offset_s:+.4f} s", " ... ".join(offset),
         f"the source is {'late' if fit.offset_s >= 0 else 'early'}"),
        ("drift", f"{fit.drift_ppm:+.0f} ppm", " ... ".join(drift),
         "" if fit.drift_significant else "not significant, not applied"),
        ("scale", f"{fit.ratio:.5f}", " ... ".join(scale), "source over reference"),
    ]  # fmt: skip
    if quantity == "speed" and not math.isnan(fit.slip_offset_s):
        low, high = fit.slip_offset_ci95
        remark = "with tyre slip in the model"
        rows.insert(1, ("", f"{fit.slip_offset_s:+.4f} s", f"{low:+.4f} ... {high:+.4f}", remark))
    match = (
        f"correlation {fit.peak:.3f} (limit {fit.peak_limit:.3f}, next best {fit.runner_up:.3f}) over "
        f"{fit.overlap_s:.0f} s, residual {fit.rms:.3g} {QUANTITIES[quantity]}"
    )
    table = Table(("Clock", "Value", "95 %", "Remark"), rows, words=(0, 3), wide=(3,))
    taken = [("taken", f"{fit.taken_s:+.4f} s: {fit.taken_because}")] if fit.taken_because else []
    return Section("", [Para(head, "everywhere"), table, Lines([*taken, ("match", match), *notes])])


def alignment_document(
    compared: Sequence[Quantity], fits: Fits, quantity: str, left_out: Mapping[str, AqualogError]
) -> dict[str, Any]:
    """Return the JSON document; NaN and infinities become null."""
    sources = []
    for source in compared[1:]:
        fit = fits[source.file]
        entry: dict[str, Any] = {"file": source.file, "channel": source.label}
        if isinstance(fit, AqualogError):
            entry["refused"] = fit.line()
        else:
            entry |= plain(dataclasses.asdict(fit), None)
            entry |= {"taken_s": plain(fit.taken_s, None), "taken_because": fit.taken_because}
        sources.append(entry)
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "quantity": quantity,
        "reference": {"file": compared[0].file, "channel": compared[0].label},
        "sources": sources,
        "left_out": [{"file": file, "reason": error.line()} for file, error in left_out.items()],
    }


def alignment_figures(
    reference: Quantity, sources: Sequence[tuple[Quantity, ClockFit]], quantity: str
) -> list[dict[str, Any]]:  # fmt: skip
    """Return two figures: the quantity over the time of the reference, and each source less the reference.

    Offset, significant drift and scale of each source are taken out.
    """
    start, unit = int(reference.t_ns[0]), QUANTITIES[quantity]
    t_ref = _seconds(reference.t_ns, start)
    curves, rests = [_curve(t_ref, reference.x, reference.file, INK)], []
    for i, (source, fit) in enumerate(sources):
        colour = list(WHEEL_COLOURS.values())[i % len(WHEEL_COLOURS)]
        t, x = _seconds(fit.to_reference(source.t_ns), start), source.x / fit.ratio
        curves.append(_curve(t, x, source.file, colour))
        inside = (t >= t_ref[0]) & (t <= t_ref[-1])
        rests.append(_curve(t[inside], x[inside] - np.interp(t[inside], t_ref, reference.x), source.file, colour))
    name = quantity.replace("_", " ")
    return [
        figure(curves, f"{name}, aligned", axis("time [s]"), axis(f"{name} [{unit}]")),
        figure(rests, "source less reference", axis("time [s]"), axis(f"difference [{unit}]")),
    ]


def _seconds(t_ns: TimeArray, start: int) -> FloatArray:
    return (t_ns - start).astype(np.float64) * 1e-9


def _curve(t: FloatArray, x: FloatArray, name: str, colour: str) -> dict[str, Any]:
    index = np.arange(x.size) if x.size <= ALL_SAMPLES else reduce_indices(x)
    return line(name, t[index], x[index], colour, width=1.5)
