"""The page of an hour beside plotly with every sample."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import polars as pl

from aqualog.core.records import DriveResult, Event, Quality, Signals
from tests.bench.compare import Row
from tests.bench.logs import RATE
from tests.bench.scale import Scale

NAMES = ("v_x_hat", *(f"{s}_{w}" for s in ("v_w", "v_w_delta") for w in ("fl", "fr", "rl", "rr")))
EVENTS = 5


def made(seconds: float) -> DriveResult:
    """A drive of ten noisy lines, reference and features, with five events of 2 s."""
    rng = np.random.default_rng(0)
    n = round(seconds * RATE)
    walk = 28.0 + 0.01 * rng.standard_normal(n).cumsum()
    t = np.arange(n) / RATE
    frame = pl.DataFrame({"t": t, "v_x": walk})
    features = {k: (0.0 if "delta" in k else walk) + 0.1 * rng.standard_normal(n) for k in NAMES}
    at = seconds * (np.arange(EVENTS) + 0.5) / EVENTS
    events = tuple(Event("spin_down", "fl", "left", float(s), float(s) + 2.0, "partial", 1.0, 0.6, {}) for s in at)
    signals = Signals(frame, round(1e9 / RATE), None, {}, Quality(), ("drive.mf4",))
    return DriveResult(signals, pl.DataFrame(features), (), events, (), (), "car")


def lines_of(result: DriveResult) -> dict[str, np.ndarray]:
    """The ten lines, in m/s."""
    return {"v_x": result.signals.array("v_x"), **{n: result.features[n].to_numpy() for n in NAMES}}


def with_aqualog(result: DriveResult) -> str:
    """The page of `detect -o`."""
    from aqualog.report.drive.report import drive_page

    return drive_page(result, title="drive")


def with_plotly(result: DriveResult) -> str:
    """One figure, a trace for each line, every sample."""
    import plotly.graph_objects as go

    t = result.signals.frame["t"].to_numpy()
    figure = go.Figure([go.Scatter(x=t, y=x, name=n) for n, x in lines_of(result).items()])
    return str(figure.to_html(include_plotlyjs=True))


def unlike(page: str, result: DriveResult) -> str:
    """Empty if the page has all lines, each with its largest and its smallest sample."""
    found = re.search(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', page, re.S)
    lines = json.loads(found[1])["lines"] if found else []
    drawn = sorted(_span(line) for line in lines)
    there = sorted(_both(x) for x in _shown(result))
    if len(drawn) != len(there):
        return f"{len(drawn)} lines in place of {len(there)}"
    return "" if np.allclose(drawn, there, rtol=1e-6, atol=1e-6) else "a line has lost its extremes"


def _span(line: dict[str, str]) -> tuple[float, float]:
    parts = [np.frombuffer(base64.b64decode(line[k]), dtype="<f4") for k in ("full", "value")]
    return _both(np.concatenate(parts))


def _both(x: np.ndarray) -> tuple[float, float]:
    return float(np.nanmin(x)), float(np.nanmax(x))


def _shown(result: DriveResult) -> list[np.ndarray]:
    """Lines in the unit of their axis."""
    return [3.6 * x for x in lines_of(result).values()]


def rows(scale: Scale) -> list[Row]:
    """Size without plotly.js, which both carry; time of the whole page."""
    from plotly.offline import get_plotlyjs

    result = made(scale.hour_s)
    script = len(get_plotlyjs())
    size = f"10 lines of {result.signals.frame.height} samples, {EVENTS} events in full"

    def ours() -> str:
        return with_aqualog(result)

    def peer() -> str:
        return with_plotly(result)

    def differ(page: str, _: str) -> str:
        return unlike(page, result)

    return [
        Row(
            "page of 1 h: size", "plotly, every sample", 100.0, ours, peer, differ, clock="", rounds=1, unit="MB",
            cost=lambda page: 1e-6 * (len(page) - script), conditions=f"{size}; without plotly.js, which both carry",
        ),
        Row(
            "page of 1 h: time", "plotly, every sample", 30.0, ours, peer, differ, rounds=5,
            conditions=f"{size}; with plotly.js",
        ),
    ]  # fmt: skip
