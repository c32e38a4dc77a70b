"""`aqualog detect` as a process: beside a script on the standard log, and beside itself on longer ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.bench.child import Child, run
from tests.bench.compare import Row
from tests.bench.logs import CAR, one_log
from tests.bench.scale import Scale

NEAR_S = (0.3, 1.0)  # [s] that begin and end of an event of both may lie apart: the script has one offset for all
ALIKE = 0.98  # share of the events that must have one of the other side at their time
CLEAR = {"spin_down": 0.66, "resistance": 0.22}  # [m/s] a tenth above the threshold: a sum beside it goes either way
LEAST_S = 20.0  # [s] of the log that stands for what a process costs before it reads


def detected(log: Path) -> Child:
    """`aqualog detect LOG --json`."""
    return run("-m", "aqualog", "detect", log, "--vehicle", CAR, "--json", "--quiet")


def scripted(log: Path) -> Child:
    """The peer's script."""
    return run("-m", "tests.bench.script", log, CAR)


def unlike(ours: list[dict[str, Any]], peer: list[dict[str, Any]]) -> str:
    """Empty if spin-downs, wheel by wheel, and resistance are told at the same times."""
    if len({e["detector"] for e in peer}) < 2:
        return "the script found no spin-down or no resistance"
    a = [e for e in ours if e["detector"] in ("spin_down", "resistance")]
    for one, other, whose in ((a, peer, "aqualog's"), (peer, a, "the script's")):
        clear = [e for e in one if e["peak"] > CLEAR[e["detector"]]]
        alone = [e for e in clear if not any(_meet(e, x) for x in other)]
        if len(alone) > (1.0 - ALIKE) * len(clear):
            return f"{len(alone)} of {whose} {len(clear)} clear events are missing on the other side, e.g. {alone[0]}"
    return ""


def _meet(a: dict[str, Any], b: dict[str, Any]) -> bool:
    same = (a["detector"], a["wheel"]) == (b["detector"], b["wheel"])
    return same and all(abs(a[k] - b[k]) <= near for k, near in zip(("start_s", "end_s"), NEAR_S, strict=True))


def script_rows(folder: Path, scale: Scale) -> list[Row]:
    """The standard log, CPU time and wall time of the processes."""
    log = one_log(folder / "hour.mf4", scale.hour_s)

    def differ(a: Child, b: Child) -> str:
        return unlike(json.loads(a.stdout)["events"], json.loads(b.stdout))

    what = f"{log.stat().st_size / 1e6:.0f} MB, 15 signals at 100 Hz, file in the page cache"
    less = "the script has 2 of 8 detectors, no map, units, faults of time stamps, radii learnt or evidence"
    return [
        Row(
            "1 h MF4, cold `aqualog detect --json`", "script: asammdf to_dataframe, pandas, NumPy, loops", 1.5,
            lambda: detected(log), lambda: scripted(log), differ, rounds=5, cost=lambda c: c.cpu_s, needs=("pandas",),
            conditions=f"{what}; CPU of all threads; {less}",
        ),
        Row(
            "same", "same", 1.5, lambda: detected(log), lambda: scripted(log), differ, clock="wall", rounds=5,
            cost=lambda c: c.wall_s, needs=("pandas",), conditions="wall",
        ),
    ]  # fmt: skip


def long_rows(folder: Path, scale: Scale) -> list[Row]:
    """Peak memory and cost per hour of longer logs beside the first; each log is there while its rows run."""
    short, *longer = scale.hours
    first = one_log(folder / "first.mf4", 3600.0 * short)
    least = one_log(folder / "least.mf4", LEAST_S)
    rows = []
    for hours in longer:
        log = folder / f"{hours:g}.mf4"

        def ours(log: Path = log, hours: float = hours) -> Child:
            return detected(log if log.exists() else one_log(log, 3600.0 * hours))

        def growth(c: Child) -> float:
            return c.cpu_s - _start(least)

        what = f"`detect --json`, MF4, 15 signals at 100 Hz, {hours:g} h"
        rows += [
            Row(
                f"peak memory, {hours:g} h", f"itself, {short:g} h", 1.0 / 1.3, ours, lambda: detected(first),
                clock="", rounds=1, cost=lambda c: c.peak_mb, unit="MB", conditions=what,
            ),
            Row(
                f"peak memory, {hours:g} h", "1 GB", 1.0, ours, 1000.0, clock="", rounds=1, cost=lambda c: c.peak_mb,
                unit="MB", conditions="same",
            ),
            Row(
                f"cost per hour, {hours:g} h", f"itself, {short:g} h", 1.0 / 1.1, ours, lambda: detected(first),
                rounds=3, cost=growth, work=hours, peer_work=short,
                conditions=f"CPU without that of the same on {LEAST_S:g} s: what starts, imports and compiles",
            ),
        ]  # fmt: skip
    return rows


def _start(least: Path) -> float:
    """What a process takes whatever the log; measured beside each, for the machine may be busier by then."""
    return min(detected(least).cpu_s for _ in range(2))
