"""From the posterior of the competition to probabilities that hold."""

from __future__ import annotations

import math

__all__ = ["SURE", "tempered"]

SURE = 0.95  # probability from which a cause is named
OFFSET, SLOPE = 0.0, 1.0
MOST = 0.999


def tempered(p: float) -> float:
    """The probability that a name is right, of the share `p` of the posterior that has it.

    The logit of the share is scaled and shifted (Platt's scaling) so that probabilities are as often
    right as they say.
    """
    p = min(max(p, 1e-9), 1.0 - 1e-9)
    z = OFFSET + SLOPE * math.log(p / (1.0 - p))
    return min(1.0 / (1.0 + math.exp(-z)), MOST)
