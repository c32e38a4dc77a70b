"""Metrics 8 to 12: what the verdict is worth: the next manoeuvre, compounds, gain, the detectors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tests.blind.metrics.measure import Measure, by, quantity, share
from tests.blind.metrics.rows import Row

__all__ = ["compounds", "detectors", "gains", "manoeuvres", "speed"]

STRONG = 8.0


def manoeuvres(rows: Sequence[Row]) -> list[Measure]:
    """Metric 8: the recommended run, driven by the world and diagnosed together with the first, gives the true name."""
    cases = [r for r in rows if r.second is not None]
    can = [r for r in cases if r.second.possible]
    cannot = [r for r in cases if not r.second.possible]
    out = [
        share(8, "resolved by the recommended run", [_is_resolved(r) for r in can], ">= 0.95", least=20),
        quantity(8, "separation over the median run's", [r.second.advantage for r in can], _median, ">= 2", least=20),
        share(8, "says that no run can", [r.second.name in ("none", "sensor") for r in cannot], ">= 0.95", least=10),
    ]
    for name, group in sorted(by(can, lambda r: r.second.name).items()):
        out.append(share(8, f"  {name}", [_is_resolved(r) for r in group], ">= 0.95", least=5))
    return out


def _is_resolved(r: Row) -> bool:
    return r.second.verdict in ("named", "compound") and {c.key for c in r.second.causes} == set(r.hidden)


def compounds(rows: Sequence[Row]) -> list[Measure]:
    """Metric 9: two effects at once, each strong and no more than so much alike."""
    pairs = [r for r in rows if r.group == "compound" and len(r.truth) == 2]
    # a case that failed has no sizes and counts
    cases = [r for r in pairs if r.error or (min(f.z for f in r.truth) >= STRONG and r.separation >= 0.3)]
    recalled = [n in r.names for r in cases for n in r.hidden]
    return [
        share(9, "exact set of two", [set(r.names) == set(r.hidden) for r in cases], ">= 0.85", least=100),
        share(9, "a false member", [bool(set(r.names) - set(r.hidden)) for r in cases], "<= 0.08", least=100),
        share(9, "members recalled", recalled, ">= 0.92", least=200),
    ]


def gains(rows: Sequence[Row]) -> list[Measure]:
    """Metric 10: gain on the held-out drive as a share of that of the truth put into the same simulator."""
    cases = [r for r in rows if r.group in ("named", "third") and r.truth and r.truth[0].known and r.truth[0].z >= 6.0]
    cases = [r for r in cases if math.isfinite(r.oracle) and r.oracle > 0.0]
    # no verdict, no gain: a case that was missed or failed has the share zero
    shares = [(r.gain if math.isfinite(r.gain) else 0.0) / r.oracle for r in cases]
    nulls = [r.worse for r in rows if not r.truth and not r.error and math.isfinite(r.worse)]
    return [
        quantity(10, "share of the oracle's gain, median", shares, _median, ">= 0.95", least=50),
        quantity(
            10, "share of the oracle's gain, p10", shares, lambda x: float(np.quantile(x, 0.1)), ">= 0.80", least=50
        ),
        quantity(
            10,
            "worst channel's error on nulls, largest",
            nulls,
            _largest,
            "<= +1 %",
            accept=lambda v: v <= 0.01,
            least=50,
        ),
    ]


def detectors(rows: Sequence[Row]) -> list[Measure]:
    """Metric 12: false alarms of the detectors on wet drives, with the extended model and with the truth; finds kept."""
    cases = [r.detector for r in rows if r.group == "detector" and r.detector]
    before, after, truth = (sum(c[f"alarms_{k}"] for c in cases) for k in ("before", "after", "oracle"))
    km, passes = sum(c["km"] for c in cases), sum(c["passes"] for c in cases)
    found_before, found_after = sum(c["found_before"] for c in cases), sum(c["found_after"] for c in cases)
    ratio = after / truth if truth else (0.0 if after == 0 else math.inf)
    enough = len(cases) >= 10
    lost = (found_before - found_after) / passes if passes else math.nan
    per = 100.0 / km if km else math.nan
    return [
        Measure(12, "false alarms over the oracle's", len(cases), ratio if cases else math.nan, math.nan, math.nan, "<= 1.2",
                ratio <= 1.2 if enough else None,
                f"per 100 km: {before * per:.1f} before, {after * per:.1f} after, {truth * per:.1f} with the truth"),
        Measure(12, "finds lost", int(passes), lost, math.nan, math.nan, "<= 0.01", lost <= 0.01 if enough and passes else None),
    ]  # fmt: skip


def speed(rows: Sequence[Row]) -> list[Measure]:
    """Time and memory of a verdict, and cases that ended in an error."""
    seconds = [r.seconds for r in rows if math.isfinite(r.seconds)]
    cpu = [r.cpu_seconds for r in rows if math.isfinite(r.cpu_seconds)]
    memory = [r.peak_mb for r in rows if math.isfinite(r.peak_mb)]
    failed = by([r for r in rows if r.error], lambda r: r.error[:80])
    return [
        quantity(0, "time of a verdict, p90 [s]", seconds, lambda x: float(np.quantile(x, 0.9)), "<= 60"),
        quantity(0, "processor time of it, p90 [s]", cpu, lambda x: float(np.quantile(x, 0.9)), "-"),
        quantity(0, "peak memory, largest [MB]", memory, _largest, "<= 1000"),
        share(0, "cases that failed", [bool(r.error) for r in rows], "0",
              note="; ".join(f"{len(g)} {n}" for n, g in failed.items())),
    ]  # fmt: skip


def _median(x: np.ndarray) -> float:
    return float(np.median(x))


def _largest(x: np.ndarray) -> float:
    return float(np.max(x))
