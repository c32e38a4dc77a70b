"""The road under a simulated drive: stretches, and fields along the way that do not depend on the time step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.compiled import compiled
from aqualog.model.scenario import Scenario
from aqualog.types import FloatArray

__all__ = ["Road", "build_road"]

DS = 0.1  # [m] grid of the fields
DS_LONG = 0.5  # [m] on drives beyond 20 km


class Road(NamedTuple):
    """Stretches (k,) and fields (m,) over the position of the front axle, from 0, `ds` apart.

    The last stretch of `lanes` that holds a point rules; -1 is dry asphalt. Fields have unit variance.
    """

    ds: float
    lanes: FloatArray  # (k, 9): in_metres, start, end, depth left, right, irregularity left, right, rolling, roughness
    lane_mu: FloatArray  # (k,) friction of the tyre, negative: the tyre's own
    lane_compliance: FloatArray  # (k,)
    contact_road: FloatArray  # (m, 2) sides: what both axles meet at the same spot
    contact_wheel: FloatArray  # (m, 4) what each wheel adds
    depth: FloatArray  # (m, 2)
    bumps: FloatArray  # (m, 2)
    grade: FloatArray  # (m,) slope angle, uphill positive [rad]


def build_road(scenario: Scenario, length: float) -> Road:
    """Lay out the road of a scenario.

    Parameters
    ----------
    scenario : Scenario
    length : float
        To be covered, generously. [m]
    """
    ds = DS if length < 20e3 else DS_LONG
    m = int(length / ds) + 2
    s = np.arange(m) * ds
    lanes = scenario.lanes
    table = np.array(
        [
            [
                float(lane.in_metres), lane.start, lane.end, lane.depth_left, lane.depth_right,
                lane.irregularity_left, lane.irregularity_right, lane.surface.rolling, lane.surface.roughness,
            ]
            for lane in lanes
        ]
    ).reshape(len(lanes), 9)  # fmt: skip
    streams = [np.random.default_rng(child) for child in np.random.SeedSequence([scenario.seed, 1]).spawn(10)]
    wet = any(lane.depth_left > 0 or lane.depth_right > 0 for lane in lanes)
    rough = any(lane.surface.roughness > 0 for lane in lanes)
    front, rear = scenario.tyre_front.scatter_length, scenario.tyre_rear.scatter_length
    none = np.zeros((2, 4))
    return Road(
        ds=ds,
        lanes=table,
        lane_mu=np.array([-1.0 if lane.surface.mu is None else lane.surface.mu for lane in lanes]),
        lane_compliance=np.array([lane.surface.compliance for lane in lanes]),
        contact_road=_fields(streams[:2], m, ds, [front, front]) if wet else none[:, :2],
        contact_wheel=_fields(streams[2:6], m, ds, [front, front, rear, rear]) if wet else none,
        depth=_fields(streams[6:8], m, ds, [5.0, 5.0]) if wet else none[:, :2],
        bumps=_fields(streams[8:10], m, ds, [0.3, 0.3]) if rough else none[:, :2],
        grade=np.interp(s, [p[0] for p in scenario.grade], [p[1] for p in scenario.grade])
        if scenario.grade
        else np.zeros(2),
    )


def _fields(streams: list[np.random.Generator], m: int, ds: float, lengths: list[float]) -> FloatArray:
    """Ornstein-Uhlenbeck processes over the position, unit variance, one column each."""
    columns = []
    for rng, length in zip(streams, lengths, strict=True):
        keep = float(np.exp(-ds / length))
        noise = rng.normal(size=m)
        noise[1:] *= np.sqrt(1.0 - keep * keep)
        columns.append(_recursive(keep, noise))
    return np.column_stack(columns)


@compiled
def _recursive(keep, noise):  # type: ignore[no-untyped-def]
    y = np.empty_like(noise)
    y[0] = noise[0]
    for i in range(1, noise.size):
        y[i] = keep * y[i - 1] + noise[i]
    return y
