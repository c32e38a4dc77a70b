"""Channels with a fault as a few samples, with the times of the fault: for a picture."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from aqualog.align.freezes import Stretch, longest_stop
from aqualog.core.records import BoolArray, Channel, FloatArray, TimeFaults
from aqualog.doctor.findings import Finding, Picture

__all__ = ["MOST_PICTURES", "pictures_of"]

MOST_PICTURES = 12  # of a file
_STRETCHES = 600  # of a picture: least and greatest value of each
_MOST_SPANS = 100
_NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?")
_OF_VALUES = ("not_finite", "frozen", "code")


def pictures_of(
    findings: Sequence[Finding], channels: Sequence[Channel], standing: Sequence[Stretch] = ()
) -> Iterator[Picture]:
    """Yield a picture of each channel that a finding names, the first `MOST_PICTURES`.

    Parameters
    ----------
    findings : sequence of Finding
        Of one file.
    channels : sequence of Channel
        Of that file.
    standing : sequence of Stretch
        Times at standstill, as for the findings.
    """
    by_path = {c.info.path: c for c in channels}
    kinds: dict[str, list[Finding]] = {}
    for f in findings:
        if f.channel in by_path and (f.kind in _OF_VALUES or f.kind in TimeFaults.KINDS):
            kinds.setdefault(f.channel, []).append(f)
    for path, own in list(kinds.items())[:MOST_PICTURES]:
        channel = by_path[path]
        if channel.t_ns.size < 2 or not np.isfinite(channel.values).any():
            continue
        order = np.argsort(channel.t_ns, kind="stable")
        t = (channel.t_ns[order] - channel.t_ns[order[0]]) * 1e-9
        values = channel.values[order]
        spans = [s for f in own for s in _spans(f, channel, t, values, standing)][:_MOST_SPANS]
        keep = _thinned(values)
        yield Picture(
            channel.info.file, path, channel.info.unit or "", t[keep], values[keep], tuple(spans),
            tuple(f.kind for f in own),
        )  # fmt: skip


def _spans(
    finding: Finding, channel: Channel, t: FloatArray, values: FloatArray, standing: Sequence[Stretch]
) -> Iterator[tuple[float, float]]:
    """Yield where a fault is, as far as that is known."""
    if finding.kind == "frozen":
        stop = longest_stop(channel.t_ns, channel.values, standing)
        if stop is not None:
            yield stop.from_s, stop.from_s + stop.length_s
    elif finding.kind == "not_finite":
        yield from _stretches(~np.isfinite(values), t)
    elif finding.kind == "code":
        first = finding.what.split(" ", 1)[0]
        if _NUMBER.fullmatch(first):
            yield from _stretches(values == float(first), t)
    elif finding.first_s is not None:
        yield finding.first_s, finding.first_s


def _stretches(bad: BoolArray, t: FloatArray) -> Iterator[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bad, [False]]).astype(np.int8))).reshape(-1, 2)
    for a, b in edges.tolist():
        yield float(t[a]), float(t[b - 1])


def _thinned(values: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    """Least and greatest value of each stretch, in order; a stretch without any value keeps its first sample."""
    n = values.size
    if n <= 2 * _STRETCHES:
        return np.arange(n)
    edges = np.linspace(0, n, _STRETCHES + 1).astype(np.intp)
    kept = [0, n - 1]
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = values[a:b]
        known = np.flatnonzero(np.isfinite(part))
        if known.size < b - a:
            kept.append(a + int(np.argmin(np.isfinite(part))))
        if known.size:
            kept += [a + int(known[np.argmin(part[known])]), a + int(known[np.argmax(part[known])])]
    return np.unique(np.array(kept, dtype=np.intp))
