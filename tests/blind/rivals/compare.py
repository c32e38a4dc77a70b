"""Rivals on the residuals that the engine itself sees: what each says first, and what it predicts better."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.vehicle import Vehicle
from tests.blind.rivals.columns import TWINS, Residuals, form_columns, named_columns, scales, stacked
from tests.blind.rivals.select import SELECTORS, Finding
from tests.blind.rivals.sindy import MEANINGS, OVER, THRESHOLDS, ensemble, polynomials, single

__all__ = ["Claim", "claims", "error_taken"]

WITH_FORMS = ("BIC forward", "LASSO, BIC")


class Claim(NamedTuple):
    """What a method says first: `effects` it may mean, wherever they act, or a form by its mechanisms and coordinates.

    `found`: it says anything. `gain`: see `error_taken`.
    """

    found: bool
    effects: tuple[str, ...] = ()
    mechanisms: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    gain: float = float("nan")


def claims(log: Residuals, heldout: Residuals | None, vehicle: Vehicle) -> dict[str, Claim]:
    """Every method on one drive, its gain on another one."""
    named, forms = (lambda r: named_columns(r, vehicle)), form_columns
    out = {}
    for method, select in SELECTORS.items():
        ways = {method: named, f"{method}, with forms": lambda r: {**named(r), **forms(r)}}
        for name, columns_of in ways.items():
            if name == method or method in WITH_FORMS:
                columns = columns_of(log)
                out[name] = _claim(select(*stacked(log, columns, scales(log)), list(columns)), heldout, columns_of)
    sindy = {f"PySINDy, threshold {t:g}": single(log, vehicle, t) for t in THRESHOLDS}
    sindy["E-SINDy, inclusion 0.9"] = ensemble(log, vehicle)
    return out | {n: _claim(f, heldout, lambda r: polynomials(r, vehicle)) for n, f in sindy.items()}


def _claim(finding: Finding, heldout: Residuals | None, columns_of) -> Claim:
    gain = float("nan") if heldout is None else error_taken(heldout, finding.predicted(columns_of(heldout)))
    first = next(iter(finding.coefficients), None)
    if first is None:
        return Claim(False, gain=gain)
    if first in MEANINGS:
        return Claim(True, tuple(MEANINGS[first]), ("force", "accelerometer"), tuple(OVER[first]), gain)
    if "|" in first:
        mechanism, coordinate, _ = first.split("|")
        return Claim(True, (), (mechanism.split("@")[0],), (coordinate,), gain)
    effect = first.split("@")[0]
    return Claim(True, tuple({effect, *TWINS.get(effect, ())}), gain=gain)


def error_taken(heldout: Residuals, predicted: np.ndarray | float) -> float:
    """Share of the squared error that a prediction (C, n) takes from a residual, the mean over its channels."""
    good = heldout.mask & np.isfinite(heldout.residual).all(axis=0)
    before = np.sum(heldout.residual[:, good] ** 2, axis=1)
    after = np.sum((heldout.residual - predicted)[:, good] ** 2, axis=1)
    return float(np.mean(1.0 - after / np.maximum(before, 1e-300)))
