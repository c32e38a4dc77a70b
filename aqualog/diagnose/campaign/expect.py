"""Expected slip and resistance of tyre, water and car at a speed and traction: the simulator's steady equations. They
are those of `aqualog.model.kernel` without its time, averaged over the fluctuation of contact and water's depth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.compiled import compiled, inlined, part, plain
from aqualog.core.records import FloatArray
from aqualog.model.plant import flat
from aqualog.model.term import Setup
from aqualog.model.wheel import even_full_speed, water_at
from aqualog.physics import contact, load, rolling, water
from aqualog.physics.contact import friction_ratio
from aqualog.physics.tyre_brush import brush_parts

__all__ = ["NODES", "S_MAX", "Driven", "Response", "respond"]

NODES = 32  # points at which contact and depth are averaged
S_MAX = 0.10  # [-] a wheel that slips more spins, and no regression uses it (`campaign.slip_slope`)
_CONTACT = np.linspace(0.0, 1.0, 101)
_SHARE = np.linspace(0.0, 0.995, 200)  # force over what the contact carries
_PRIMES = (2, 3, 5, 7, 11)


class Driven(NamedTuple):
    """How samples (n,) were driven: `v` [m/s], `a` specific force forward [m/s²], and `mu` (4, n), the traction of
    each wheel that its torque gives [-] (`physics.traction`): of a wheel without torque minus the rolling resistance.
    """

    v: FloatArray
    a: FloatArray
    mu: FloatArray


class Response(NamedTuple):
    """Expectation (4, n), or (n,) for the car, and variances over the fluctuation of contact and water: `slip` [-] at
    the given traction, NaN where the contact cannot carry it; `contact` L [-]; `resistance`: deceleration by the water
    [m/s²]; `lost` (4, n): share of the fluctuation at which the wheel spins."""

    slip: FloatArray
    slip_variance: FloatArray
    contact: FloatArray
    lost: FloatArray
    resistance: FloatArray
    resistance_variance: FloatArray


def respond(setups: Sequence[Setup], which: NDArray[np.int64], wet: NDArray[np.bool_], driven: Driven) -> Response:
    """Steady response of cars with plants and scenarios, terms applied; the first stretch of each is its water. `which`
    (n,): setup of each sample; `wet` (n,): on the water. The wheels' inertia, the pitch of the body, and the drag and
    wake of a stopped wheel are left out: where `lost` is not 0, they are no longer small."""
    plants = [flat(s.plant) for s in setups]
    # as numbers: of records numpy compares the fields name by name, which took as long as the response
    cars, wheels = (np.concatenate([p[i].view(np.float64) for p in plants]).view(plants[0][i].dtype) for i in (0, 1))
    lanes = np.zeros((len(setups), 5))
    for k, s in enumerate(setups):
        for lane in s.scenario.lanes[:1]:
            lanes[k] = (
                lane.depth_left, lane.depth_right, lane.irregularity_left, lane.irregularity_right,
                s.scenario.water_scatter,
            )  # fmt: skip
    seen = tuple(plain(driven.v, driven.a, driven.mu, which, wet))
    found = _respond(seen, cars, wheels.reshape(-1, 4), lanes, _points(), _table())
    return Response(*found)


_loads = inlined(load.loads_of_wheels)
_friction_ratio = inlined(contact.friction_ratio)
_residual_film = inlined(water.residual_film)
_load_factor = inlined(rolling.load_factor)
_FIELD_SHARE = float(np.sqrt(0.5))  # half of the contact's variance comes from the road, half from the wheel itself
_CONTACT_STEP, _SHARE_STEP, _SHARE_MAX = float(_CONTACT[1]), float(_SHARE[1]), float(_SHARE[-1])


@part
def _slip(mu, F_z, L, friction, q, table):  # type: ignore[no-untyped-def]
    """Slip of the shortened brush at a traction. [-] NaN where the contact cannot carry it."""
    carried = friction * _friction_ratio(L)
    if not abs(mu) <= _SHARE_MAX * carried or carried <= 0.0:
        return np.nan
    L = max(L, 0.02)
    x, y = L / _CONTACT_STEP, abs(mu) / carried / _SHARE_STEP
    i, j = min(int(x), table.shape[0] - 2), min(int(y), table.shape[1] - 2)
    u, w = x - i, y - j
    bent = (1.0 - u) * ((1.0 - w) * table[i, j] + w * table[i, j + 1])
    bent += u * ((1.0 - w) * table[i + 1, j] + w * table[i + 1, j + 1])
    return mu * bent / (q.slip_slope * _load_factor(F_z, q.F_z_ref, q.load_sensitivity) * L * L)


@part
def _fill(driven, cars, wheels, lanes, points, table, out, room):  # type: ignore[no-untyped-def]
    v, a, traction, which, wet = driven
    slip, slip_variance, contact_mean, lost, resistance, resistance_variance = out
    force, left = room  # what a part makes itself has its references counted
    nodes = points.shape[0]
    for m in range(v.size):
        k = which[m]
        p = cars[k]
        loads = _loads(a[m], 0.0, p.mass, p.l_f, p.l_r, p.h_cg, p.track)
        force[:] = 0.0
        for order in range(4):
            side, rear = order // 2, order % 2
            i = 2 * rear + side
            q = wheels[k, i]
            F_z = loads[i]
            if not wet[m]:
                slip[i, m] = _slip(traction[i, m], F_z, 1.0, q.mu, q, table)
                continue
            count, sum_s, sum_ss, sum_L = 0, 0.0, 0.0, 0.0
            for node in range(nodes):
                uneven = 1.0 + lanes[k, 2 + side] * points[node, 0]
                if rear:
                    uneven = 1.0 + lanes[k, 4] * q.track_irregularity * points[node, 4]
                film = (left[node] if rear else lanes[k, side]) * max(uneven, 0.0)
                L, s, drag = 1.0, 0.0, 0.0
                if film > 0.0:
                    noise = _FIELD_SHARE * (points[node, 1] + points[node, 2 + rear])
                    v_even = even_full_speed(film, F_z, q)
                    v_even *= max(1.0 + lanes[k, 4] * q.contact_scatter * noise, 0.2)
                    for _ in range(2):  # a wheel that has slowed down floats sooner, and slips more
                        wet_now = water_at(film, F_z, v_even, v[m], v[m] / (1.0 - s), q.mu, q)
                        L = wet_now.contact
                        drag = wet_now.film_force + wet_now.shift / q.r_e
                        # the torque that the water takes at the wheel never reaches the road
                        found = _slip(traction[i, m] - drag / F_z, F_z, L, wet_now.mu, q, table)
                        carries = abs(found) < S_MAX
                        s = found if carries else 0.0
                        if s >= 0.0 or not carries:
                            break
                    drag += wet_now.wave
                else:
                    s = _slip(traction[i, m], F_z, 1.0, q.mu, q, table)
                    carries = abs(s) < S_MAX
                if not rear:
                    left[node] = _residual_film(film, L, wheels[k, 2 + side].h_track)
                force[node] += drag
                sum_L += L
                if carries:
                    count += 1
                    sum_s += s
                    sum_ss += s * s
            contact_mean[i, m] = sum_L / nodes
            lost[i, m] = 1.0 - count / nodes
            slip[i, m] = sum_s / count if count > 0 else np.nan
            slip_variance[i, m] = max(sum_ss / count - slip[i, m] ** 2, 0.0) if count > 0 else 0.0
        if wet[m]:
            resistance[m] = force.mean() / (p.mass + p.towed_mass)
            resistance_variance[m] = force.var() / (p.mass + p.towed_mass) ** 2


@compiled
def _respond(driven, cars, wheels, lanes, points, table):  # type: ignore[no-untyped-def]
    n, nodes = driven[0].size, points.shape[0]
    slip, slip_variance, contact_mean, lost = np.zeros((4, n)), np.zeros((4, n)), np.ones((4, n)), np.zeros((4, n))
    out = (slip, slip_variance, contact_mean, lost, np.zeros(n), np.zeros(n))
    _fill(driven, cars, wheels, lanes, points, table, out, (np.zeros(nodes), np.zeros(nodes)))
    return out


@lru_cache(maxsize=1)
def _table() -> FloatArray:
    """theta over force / (3 L^2), its limit (2.2), by contact (rows) and share of the greatest force (columns)."""
    theta = np.concatenate([np.linspace(0.0, 3.0, 3001), np.geomspace(3.01, 300.0, 400)])
    found = np.empty((_CONTACT.size, _SHARE.size))
    for k, L in enumerate(np.maximum(_CONTACT, 0.01)):
        stuck, slid = brush_parts(theta, float(L))
        force = _SHARE * float(friction_ratio(np.array([L]))[0])
        with np.errstate(invalid="ignore", divide="ignore"):
            found[k] = np.interp(force, stuck + slid, theta) / force * (3.0 * L * L)
        found[k, 0] = 1.0
    return found


@lru_cache(maxsize=1)
def _points() -> FloatArray:
    """Points (NODES, 5) of independent normal variables, even in space: depth, road, wheels, film in the track."""
    normal = NormalDist()
    columns = []
    for prime in _PRIMES:
        digits, share, rest = np.zeros(NODES), 1.0, np.arange(1, NODES + 1)
        while rest.any():
            share /= prime
            digits += share * (rest % prime)
            rest //= prime
        columns.append([normal.inv_cdf(float(x)) for x in digits])
    points = np.array(columns).T
    points -= points.mean(axis=0)
    return np.ascontiguousarray(points / points.std(axis=0))
