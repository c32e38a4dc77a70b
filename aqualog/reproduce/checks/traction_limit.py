"""Spin-ups on water and on other slippery roads, with the limit of the traction coefficient and without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import BoolArray
from aqualog.detect import spin
from aqualog.evaluate.intervals import wilson
from aqualog.model.situations import SCORING_POOL, draw
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.drawn import WATER, Taken, detected, drives, made
from aqualog.reproduce.tables import spread_over
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(13000, 13200)  # the weaker form of the criterion was chosen while 11000 on were known
_PER_WATER = 6  # seeds of each situation on water
_SLIP = 0.05  # [-] a wheel that spins
_SLIPPERY = ("snow", "ice", "wet_ice")
_KICKED = 20  # seeds of each


def _spun(d: Taken, *, limited: bool) -> BoolArray:
    """Spin-up bits of any wheel, with the limit of the traction coefficient or without it."""
    result = detected(d)
    bits = np.zeros(d.t.size, dtype=bool)
    for track in result.tracks:
        if track.detector == "spin_up":
            if limited:
                bits |= track.active
            else:
                f = result.features
                _, found, _ = spin.scan(
                    spin.SpinParams.make(1.0, d.signals.dt),
                    spin.initial_state(),
                    f[f"a_w_delta_{track.wheel}"].to_numpy(),
                    f[f"v_w_delta_{track.wheel}"].to_numpy(),
                    f["v_x_hat"].to_numpy(),
                    np.ones(d.t.size, dtype=bool),
                )
                bits |= found
    return bits


def _kicked(name: str, seed: int) -> Taken:
    """A drive on a slippery road in which the driver twice asks for more than the road holds."""
    drawn = draw(name, seed, SCORING_POOL)
    lane = drawn.scenario.lanes[0]
    mu = lane.surface.mu or 1.0
    force = 1.5 * mu * drawn.scenario.vehicle.mass * 9.80665  # [N] beyond what any number of wheels can hold
    torque = force * drawn.scenario.vehicle.r_l_r
    kick = (
        (0.0, 0.0),
        (15.0, 0.0),
        (15.5, torque),
        (16.5, torque),
        (16.8, 0.0),
        (25.0, 0.0),
        (25.5, torque),
        (26.5, torque),
        (26.8, 0.0),
    )
    scenario = replace(drawn.scenario, extra_torque=kick, duration_s=32.0)
    return made(name, seed, scenario, drawn.believed, drawn.model)


def _spun_when_kicked(item: tuple[str, int]) -> tuple[bool, bool, bool]:
    """Whether a wheel spun, and whether that is reported without and with the limit."""
    d = _kicked(*item)
    spun = max(float(np.nanmax(d.truth[f"slip_{w}"])) for w in d.vehicle.driven) >= _SLIP
    return spun, bool(_spun(d, limited=False).any()), bool(_spun(d, limited=True).any())


def _traction_limit(plan: Plan) -> Checks:
    """C27: spin-ups on snow and ice with and without the limit, and the cost of the limit on water."""
    rows: dict[str, tuple[int, int, int]] = {}
    for name in _SLIPPERY:
        found = spread_over(_spun_when_kicked, [(name, seed) for seed in plan.first(_KICKED)], plan, "drives")
        spun = [f for f in found if f[0]]
        rows[name] = (len(spun), sum(f[1] for f in spun), sum(f[2] for f in spun))
    n_water = [0, 0, 0]
    for d in drives(WATER, plan, _PER_WATER):
        for w in d.vehicle.driven:
            up = (d.truth[f"slip_{w}"] > _SLIP) & (d.truth[f"contact_{w}"] < 0.3)
            if up.sum() * d.signals.dt < 0.2:
                continue
            n_water[0] += 1
            n_water[1] += int(_spun(d, limited=False).any())
            n_water[2] += int(_spun(d, limited=True).any())
    quiet = {k: rows[k][2] <= 0.1 * rows[k][0] for k in rows}
    seen = all(rows[k][1] > 0.5 * rows[k][0] > 0 for k in rows)
    kept = n_water[2] >= 0.9 * n_water[1] > 0
    less = all(rows[k][2] <= 0.2 * rows[k][1] for k in ("snow", "ice"))
    whole = seen and kept and all(quiet.values())
    words = ", ".join(f"{k.replace('_', ' ')} {rows[k][1]} to {rows[k][2]} of {rows[k][0]}" for k in rows)
    caught, n = sum(r[2] for r in rows.values()), sum(r[0] for r in rows.values())
    return (
        Check(
            "C27",
            "drives on snow, dry ice and wet ice whose driver spins the wheels: spin-up reported in at most 10 % "
            "each, without the limit in over half; on water at least 90 % of what is found without it; in part: on "
            "snow and on dry ice at least 80 % fewer than without",
            f"drives with a report, without and with the limit: {words}; on water {n_water[1]} to {n_water[2]} of "
            f"{n_water[0]} wheels that spun",
            judged(whole=whole, part=seen and kept and less),
            value=caught / max(n, 1),
            ci95=wilson(caught, n),
            reason=""
            if whole
            else "Wet ice holds less than 0.07 itself, so that the limit cannot distinguish it from water. On snow a "
            "wheel that goes from braking to driving while the driver catches the car passes the limit for a moment.",
            source="drawn situations with extra torque",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = ((("C27",), _traction_limit),)
