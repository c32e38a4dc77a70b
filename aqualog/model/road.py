"""The road under a simulated drive: stretches, and fields along the way that do not depend on the time step.

Between the points of their grid fields are straight, so that their rms is 0.96 of 1, and 0.87 beyond 20 km.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import FloatArray
from aqualog.model.scenario import Kick, Scenario, Surface
from aqualog.physics.load import unevenness_rms

__all__ = ["DRY", "Road", "at_position", "build_road", "rise_at", "stretch_at", "track_row"]

DS = 0.1  # [m] grid of the fields
DS_LONG = 0.5  # [m] on drives beyond 20 km
DEPTH_LENGTH, BUMP_LENGTH, TRACK_LENGTH = 5.0, 0.3, 1.0  # [m] correlation: depth of water, bumps, film in a track (K)
HEIGHT_LENGTH = 5.0  # [m] waves beyond 30 m move body and wheel alike, so that they hardly change the load (K)


# columns of a stretch
IN_METRES, START, END, DEPTH_LEFT, DEPTH_RIGHT, IRREGULARITY_LEFT, IRREGULARITY_RIGHT = range(7)
# of the surface under the left wheels, and `SURFACE_WIDTH` further of that under the right ones
ROLLING, ROUGHNESS, LANE_MU, LANE_COMPLIANCE = range(7, 11)  # a negative friction: the tyre's own
SURFACE_WIDTH = 4
_LANE_WIDTH = 7 + 2 * SURFACE_WIDTH
# columns of the fields; of sides and wheels from the left, from fl
CONTACT_ROAD, CONTACT_WHEEL, DEPTH, BUMPS, GRADE, KICK_TORQUE, KICK_LOAD, TRACK, HEIGHT = 0, 2, 6, 8, 10, 11, 13, 15, 17
_FIELD_WIDTH = 19


class Road(NamedTuple):
    """Stretches (k, 15) and fields (m, 19) over the position of the front axle, from 0, `ds` apart.

    The last stretch of `lanes` that holds a point applies; outside all is dry asphalt. The fields of contact, depth,
    bumps and the film in a track have unit variance: both axles meet `CONTACT_ROAD`, each wheel adds `CONTACT_WHEEL`.
    The slope angle is in rad, uphill positive; the height under left and right wheels in m; kerbs and holes give torque
    [N·m] and wheel load [N] of either side.
    """

    ds: float
    lanes: FloatArray
    fields: FloatArray


DRY = Road(1.0, np.zeros((0, _LANE_WIDTH)), np.zeros((2, _FIELD_WIDTH)))


def build_road(scenario: Scenario, length: float) -> Road:
    """Lay out the road of a scenario.

    Parameters
    ----------
    length : float
        Length to be covered, with a margin. [m]
    """
    ds = DS if length < 20e3 else DS_LONG
    m = int(length / ds) + 2
    s: FloatArray = np.arange(m, dtype=np.float64) * ds
    table = np.array(
        [
            [
                float(lane.in_metres), lane.start, lane.end, lane.depth_left, lane.depth_right,
                lane.irregularity_left, lane.irregularity_right, *_of_surface(lane.surface),
                *_of_surface(lane.surface_right or lane.surface),
            ]
            for lane in scenario.lanes
        ],
        dtype=np.float64,
    ).reshape(len(scenario.lanes), _LANE_WIDTH)  # fmt: skip
    streams = [np.random.default_rng(child) for child in np.random.SeedSequence([scenario.seed, 1]).spawn(14)]
    front, rear = scenario.tyre_front.scatter_length, scenario.tyre_rear.scatter_length
    fields = np.zeros((m, _FIELD_WIDTH))
    if any(lane.depth_left > 0 or lane.depth_right > 0 for lane in scenario.lanes):
        lengths = [front, front, front, front, rear, rear, DEPTH_LENGTH, DEPTH_LENGTH]
        _fill(fields, CONTACT_ROAD, streams[:8], ds, lengths)
        _fill(fields, TRACK, streams[10:12], ds, [TRACK_LENGTH, TRACK_LENGTH])
    surfaces = [s for lane in scenario.lanes for s in (lane.surface, lane.surface_right or lane.surface)]
    if any(s.roughness > 0 for s in surfaces):
        _fill(fields, BUMPS, streams[8:10], ds, [BUMP_LENGTH, BUMP_LENGTH])
    if scenario.unevenness > 0.0:
        _fill(fields, HEIGHT, streams[12:], ds, [HEIGHT_LENGTH, HEIGHT_LENGTH])
        fields[:, HEIGHT : HEIGHT + 2] *= unevenness_rms(np.asarray(scenario.unevenness), length=HEIGHT_LENGTH)
    if scenario.grade:
        fields[:, GRADE] = np.interp(s, [p[0] for p in scenario.grade], [p[1] for p in scenario.grade])
    for kick in scenario.kicks:
        _add_kick(fields, s, kick)
    return Road(ds, table, fields)


def _of_surface(surface: Surface) -> tuple[float, float, float, float]:
    return surface.rolling, surface.roughness, -1.0 if surface.mu is None else surface.mu, surface.compliance


def _add_kick(fields: FloatArray, s: FloatArray, kick: Kick) -> None:
    """Half a sine against the wheel and on its load, then the load that the springing wheel lacks."""
    x = (s - kick.at) / kick.length
    hit = np.where((x >= 0.0) & (x <= 1.0), np.sin(np.pi * x), 0.0)
    back = np.where((x > 1.0) & (x <= 3.0), np.sin(0.5 * np.pi * (x - 1.0)), 0.0)
    for side in {"left": (0,), "right": (1,)}.get(kick.side, (0, 1)):
        fields[:, KICK_TORQUE + side] -= kick.torque * hit
        fields[:, KICK_LOAD + side] += kick.load * (hit - 0.5 * back)


def _fill(fields: FloatArray, first: int, streams: list[np.random.Generator], ds: float, lengths: list[float]) -> None:
    """Ornstein-Uhlenbeck processes over the position, unit variance, one column each, into columns from `first` on."""
    m = fields.shape[0]
    for i, (rng, length) in enumerate(zip(streams, lengths, strict=True)):
        keep = float(np.exp(-ds / length))
        noise = rng.standard_normal((m,))
        noise[1:] *= np.sqrt(1.0 - keep * keep)
        fields[:, first + i] = _recursive(keep, noise)


@compiled
def _recursive(keep, noise):  # type: ignore[no-untyped-def]
    y = np.empty(noise.size)
    y[0] = noise[0]
    for i in range(1, noise.size):
        y[i] = keep * y[i - 1] + noise[i]
    return y


@compiled
def at_position(field, column, position, ds):  # type: ignore[no-untyped-def]
    """Linear interpolation of a field over the position; constant beyond its ends."""
    x = position / ds
    last = field.shape[0] - 1
    if not x > 0.0:  # also a position that is no number
        return field[0, column]
    if x >= last:
        return field[last, column]
    j = int(x)
    return field[j, column] + (x - j) * (field[j + 1, column] - field[j, column])


@compiled
def rise_at(field, column, position, ds):  # type: ignore[no-untyped-def]
    """Slope of a field over the position; 0 beyond its ends."""
    x = position / ds
    if not 0.0 <= x < field.shape[0] - 1:
        return 0.0
    return (field[int(x) + 1, column] - field[int(x), column]) / ds


@compiled
def stretch_at(lanes, t, position):  # type: ignore[no-untyped-def]
    """Return the index of the stretch under the front axle, -1 for dry asphalt."""
    found = -1
    for i in range(lanes.shape[0]):
        x = position if lanes[i, IN_METRES] > 0.0 else t
        if lanes[i, START] <= x < lanes[i, END]:
            found = i
    return found


@compiled
def track_row(track, position, ds):  # type: ignore[no-untyped-def]
    """Return the row of the front axle's record of a position: stretch and film; before the start: dry."""
    if not 0.0 <= position < ds * track.shape[0]:
        return -1
    return min(int(position / ds), track.shape[0] - 1)
