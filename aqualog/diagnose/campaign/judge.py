"""Effects that a campaign can distinguish before its residual is used, and the smallest effects it can show."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.catalogue import Library
from aqualog.diagnose.campaign.refit import conditioned
from aqualog.diagnose.records import Confusion, Limit

__all__ = ["confusions", "limits"]

POWER = 0.9
ALIKE = 10.8  # lambda below which two effects are confused more than once in twenty times
RIVALS = 3


def _parts(lib: Library, nuisances: FloatArray, weight: FloatArray, y: FloatArray) -> FloatArray:
    information, _, _ = conditioned(lib.x, np.where(np.isfinite(y), 0.0, np.nan), nuisances, weight)
    return information


def limits(
    lib: Library, nuisances: FloatArray, weight: FloatArray, y: FloatArray, threshold: float
) -> tuple[Limit, ...]:
    """Smallest size of each effect (its first parameter) that passes the family-wise test nine times in ten.

    `threshold` -log10 p of that test. NaN where that size is beyond what is physical.
    """
    normal = NormalDist()
    needed = normal.inv_cdf(1.0 - 0.5 * 10.0 ** -min(threshold, 15.0)) + normal.inv_cdf(POWER)
    information = _parts(lib, nuisances, weight, y)
    out = []
    for h, columns in zip(lib.hypotheses, lib.columns, strict=True):
        p, energy = h.parameters[0], float(information[columns[0], columns[0]])
        size = needed / math.sqrt(energy) * p.sigma if energy > 0.0 else math.inf
        reach = max(p.high - p.neutral, p.neutral - p.low)
        out.append(Limit(h.effect.name, h.where, size if size <= reach else math.nan, p.unit))
    return tuple(out)


def confusions(lib: Library, nuisances: FloatArray, weight: FloatArray, y: FloatArray) -> tuple[Confusion, ...]:
    """Whitened energy of each effect, at one prior standard deviation, that one to three others cannot imitate.

    Per effect: the most similar rival, and larger sets that leave half of its energy or less.
    """
    information = _parts(lib, nuisances, weight, y)
    out = []
    for i, h in enumerate(lib.hypotheses):
        others = [j for j, o in enumerate(lib.hypotheses) if j != i and o.goes_with(h)]
        least = math.inf
        for size in range(1, RIVALS + 1):
            found = [(_left(information, lib, i, s), s) for s in itertools.combinations(others, size)]
            if not found:
                break
            separation, rivals = min(found)
            if separation < 0.5 * least:
                least = separation
                names = tuple(lib.hypotheses[j].key for j in rivals)
                p = NormalDist().cdf(0.5 * math.sqrt(separation))
                out.append(Confusion(h.key, names, separation, p, _relation(h.key, names, separation)))
    return tuple(out)


def _left(information: FloatArray, lib: Library, i: int, rivals: Sequence[int]) -> float:
    """Energy of the first parameter of a hypothesis that others cannot imitate, whatever their size."""
    own = lib.columns[i][0]
    c = [k for j in rivals for k in lib.columns[j]]
    a = information[np.ix_(c, c)]
    across = information[own, c]
    return max(float(information[own, own] - across @ np.linalg.pinv(a, rcond=1e-10, hermitian=True) @ across), 0.0)


def _relation(key: str, rivals: Sequence[str], separation: float) -> str:
    if separation >= ALIKE:
        return ""
    return f"These runs hardly distinguish {key} from {' with '.join(rivals)}."
