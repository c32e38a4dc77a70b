"""Rivals on the residuals that the engine itself sees: what they find, what they name first, what they predict better."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aqualog.core.vehicle import Vehicle
from tests.blind.rivals.columns import TWINS, Residuals, named_columns, scales, stacked
from tests.blind.rivals.select import SELECTORS, Finding
from tests.blind.rivals.sindy import MEANINGS, THRESHOLDS, ensemble, polynomials, single

__all__ = ["METHODS", "heldout_share", "measured"]

METHODS = (*SELECTORS, *(f"PySINDy, threshold {t:g}" for t in THRESHOLDS), "E-SINDy, inclusion 0.9")

Columns = Callable[[Residuals, Vehicle], dict[str, np.ndarray]]


def measured(
    log: Residuals, heldout: Residuals | None, heldout_clean: np.ndarray | None, vehicle: Vehicle, hidden: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Each method: `found` (0 or 1), `terms`, `right` (its first is what is hidden), `gain` as a share of the oracle's.

    Parameters
    ----------
    log, heldout : Residuals
        Of the diagnosed and of the held-out drive.
    heldout_clean : array (C, n)
        What the hidden effect does to the held-out residual, without noise: the oracle predicts just that.
    hidden : sequence of str
        Keys of what is hidden.
    """
    out: dict[str, dict[str, float]] = {}
    for name, (finding, columns_of, meant) in _all(log, vehicle).items():
        result = {
            "found": float(bool(finding.coefficients)),
            "terms": float(len(finding.coefficients)),
            "right": float(any(meant(n, h) for n in list(finding.coefficients)[:1] for h in hidden)),
        }
        if heldout is not None and heldout_clean is not None:
            result["gain"] = heldout_share(heldout, finding.predicted(columns_of(heldout, vehicle)), heldout_clean)
        out[name] = result
    return out


def heldout_share(heldout: Residuals, predicted: np.ndarray | float, truth: np.ndarray) -> float:
    """Squared error taken away from the held-out residual as a share of what the truth takes away; NaN if that is none.

    Channels weigh by their spread there.
    """
    scale = scales(heldout)
    good = heldout.mask & np.isfinite(heldout.residual).all(axis=0)

    def error(x: np.ndarray | float) -> float:
        return float(np.sum(((heldout.residual - x) / scale)[:, good] ** 2))

    before, oracle = error(0.0), error(truth)
    return (before - error(predicted)) / (before - oracle) if before > oracle else float("nan")


def _all(log: Residuals, vehicle: Vehicle) -> dict[str, tuple[Finding, Columns, Callable[[str, str], bool]]]:
    columns = named_columns(log, vehicle)
    rows, y = stacked(log, columns, scales(log))
    out: dict[str, tuple[Finding, Columns, Callable[[str, str], bool]]] = {
        n: (select(rows, y, list(columns)), named_columns, _same) for n, select in SELECTORS.items()
    }
    for threshold in THRESHOLDS:
        out[f"PySINDy, threshold {threshold:g}"] = (single(log, vehicle, threshold), polynomials, _may_mean)
    out["E-SINDy, inclusion 0.9"] = (ensemble(log, vehicle), polynomials, _may_mean)
    return out


def _same(column: str, hidden: str) -> bool:
    """The name itself, or one whose column is the same; a place at the wheel counts for the whole car's name."""
    return column == hidden or hidden in TWINS.get(column, ()) or hidden.split("@")[0] in TWINS.get(column, ())


def _may_mean(term: str, hidden: str) -> bool:
    return hidden in MEANINGS[term] or hidden.split("@")[0] in MEANINGS[term]
