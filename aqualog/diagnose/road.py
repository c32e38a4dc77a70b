"""The road's slope over position, as the competition found it: a process that all channels share.

The accelerometer measures a slope, and so does the balance of wheels against torque; a drift of the one or wind in the
other are rivals of the road in the same competition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aqualog.diagnose.arena import Arena
from aqualog.diagnose.compete import Posterior, fitted
from aqualog.diagnose.competition import Block
from aqualog.diagnose.probability import tempered
from aqualog.diagnose.records import Cause, Estimate
from aqualog.model.effects import EMPIRICAL
from aqualog.model.term import Knots, Term
from aqualog.physics.load import G

__all__ = ["Road", "road_of", "roads_in"]

HALF = 0.5  # probability from which a road is taken into account
# rms of the slope that is named: half of the grade that goes unnoticed on a motorway, twice (K); without torque and on
# one pass 20 mg are an accelerometer's own wander (V, ESC data sheets)
HILLY, HILLY_ALONE = 0.01, 0.02
OFFSET_SD = 0.03  # [m/s^2] mean slope that an offset of the resistance hides (K)
MOST_SLOPE = 0.3  # [rad]
DRAWS = 400


@dataclass(frozen=True, slots=True)
class Road:
    """`term`: slope angle [rad] over position [m], uphill positive, without its mean; `named`: large enough."""

    cause: Cause
    term: Term
    named: bool


def roads_in(arena: Arena, posterior: Posterior) -> tuple[Block, ...]:
    """Slope and bank of the road where they are more likely than not."""
    return tuple(b for i, b in enumerate(arena.blocks) if b.kind == "road" and posterior.blocks.get(i, 0.0) >= HALF)


def road_of(arena: Arena, posterior: Posterior, *, seed: int) -> Road | None:
    """The slope of a single drive's road in the most likely set that has it, or None."""
    at = next(
        (i for i, b in enumerate(arena.blocks) if b.kind == "road" and arena.shapes[b.tag].mechanism.name == "road"), -1
    )
    share = posterior.blocks.get(at, 0.0)
    if share < HALF:
        return None
    block, part = arena.blocks[at], arena.parts[0]
    members = next(m for m, _ in posterior.sets if at in m)
    fit = fitted(arena, posterior.tolerant, members)
    own, c = [fit.columns.index(k) for k in block.columns], list(block.columns)
    mean, cov = fit.mean[own] * arena.sd[c], fit.covariance[np.ix_(own, own)] * np.outer(arena.sd[c], arena.sd[c])
    basis = arena.shapes[block.tag].basis
    driven = basis.columns[arena.rows[0]][part.mask]
    root = np.linalg.cholesky(cov + 1e-12 * np.trace(cov) * np.eye(len(cov)))
    drawn = mean[:, None] + root @ np.random.default_rng(seed).standard_normal((len(mean), DRAWS))
    along = driven @ drawn
    rms = along.std(axis=0)
    middle, half = float(along.mean()), 1.96 * math.hypot(float(along.mean(axis=0).std()), OFFSET_SD / G)
    low, value, high = (float(q) for q in np.quantile(rms, [0.025, 0.5, 0.975]))
    theta = np.clip(basis.at_points @ mean - float((driven @ mean).mean()), -MOST_SLOPE, MOST_SLOPE)
    knots: Knots = tuple(zip(basis.points[:, 0].tolist(), theta.tolist(), strict=True))
    torqued = "force_balance" in part.channels
    text = f"The road climbs and falls with {value:.1%} rms along the way"
    if not torqued:
        text += "; with one pass and no torque, place and time cannot be distinguished"
    text += f"; 95 % interval {low:.1%} to {high:.1%}."
    values = {
        "grade_rms": Estimate(value, low, high, "rad"),
        "grade_mean": Estimate(middle, middle - half, middle + half, "rad"),
    }
    cause = Cause("road_grade", None, values, ("kinematic",), text, tempered(share))
    return Road(cause, Term(EMPIRICAL["unexplained_grade"], knots=knots), value >= (HILLY if torqued else HILLY_ALONE))
