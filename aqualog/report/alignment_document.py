"""Clocks of sources against a reference as the JSON document and as text for a terminal."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.align.clock import ClockFit
from aqualog.align.quantity import QUANTITIES, Quantity
from aqualog.core.errors import AqualogError

__all__ = ["alignment_document", "alignment_text"]

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
            entry |= {name: _plain(value) for name, value in dataclasses.asdict(fit).items()}
        sources.append(entry)
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "quantity": quantity,
        "reference": {"file": compared[0].file, "channel": compared[0].label},
        "sources": sources,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
    if quantity == "speed" and fit.slip_offset_s == fit.slip_offset_s:  # not NaN
        low, high = fit.slip_offset_ci95
        lines.append(f"        with tyre slip in the model: {fit.slip_offset_s:+.4f} s  95 % [{low:+.4f}, {high:+.4f}]")
        if low > offset_high or high < offset_low:
            lines.append("        the two do not agree: part of the offset is tyre slip, not time")
    return head + "".join(f"  {line}\n" for line in lines)
