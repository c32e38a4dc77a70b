"""Shares of the posterior as probabilities."""

from __future__ import annotations

__all__ = ["SURE", "tempered"]

SURE = 0.95  # probability from which a cause is named
MOST = 0.99995  # no more certain than this: the posterior knows only the causes of the library


def tempered(p: float) -> float:
    """The probability of a name with the share `p` of a posterior that is coarsened (`competition.COARSE`)."""
    return min(max(p, 1.0 - MOST), MOST)
