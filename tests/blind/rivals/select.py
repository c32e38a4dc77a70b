"""Selection of named columns: forward by BIC, LASSO along its path by BIC, LASSO by cross-validation."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

__all__ = ["SELECTORS", "Finding"]

_MOST = 12


class Finding(NamedTuple):
    """What a rival says: coefficient of each chosen column, the most important one first."""

    coefficients: Mapping[str, float]

    def predicted(self, columns: Mapping[str, np.ndarray]) -> np.ndarray | float:
        """What it makes of a residual: (C, n), or 0."""
        return sum((c * columns[n] for n, c in self.coefficients.items() if n in columns), 0.0)


def bic_forward(rows: np.ndarray, y: np.ndarray, names: list[str]) -> Finding:
    """One column after the other, as long as BIC (independent rows) falls; in the order of choice."""
    n = y.size
    norms = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    unit = rows / norms
    gram, inner, total = unit.T @ unit, unit.T @ y, float(y @ y)
    chosen: list[int] = []
    best, coefficients = n * math.log(max(total / n, 1e-300)), np.zeros(0)
    while len(chosen) < min(_MOST, len(names)):
        tried = []
        for i in set(range(len(names))) - set(chosen):
            at = [*chosen, i]
            c, *_ = np.linalg.lstsq(gram[np.ix_(at, at)], inner[at], rcond=1e-10)
            tried.append((total - float(c @ inner[at]), i, c))
        rss, i, c = min(tried, key=lambda x: x[0])
        bic = n * math.log(max(rss / n, 1e-300)) + (len(chosen) + 1) * math.log(n)
        if bic >= best:
            break
        best, coefficients = bic, c
        chosen.append(i)
    return Finding({names[i]: float(c / norms[i]) for i, c in zip(chosen, coefficients, strict=True)})


def lasso_bic(rows: np.ndarray, y: np.ndarray, names: list[str]) -> Finding:
    """`LassoLarsIC` with BIC."""
    from sklearn.linear_model import LassoLarsIC

    return _lasso(LassoLarsIC(criterion="bic", fit_intercept=False), rows, y, names)


def lasso_cv(rows: np.ndarray, y: np.ndarray, names: list[str]) -> Finding:
    """`LassoCV` with five blocks that are not shuffled."""
    from sklearn.linear_model import LassoCV
    from sklearn.model_selection import KFold

    return _lasso(LassoCV(cv=KFold(5), fit_intercept=False, alphas=30), rows, y, names)


def _lasso(model, rows: np.ndarray, y: np.ndarray, names: list[str]) -> Finding:
    norms = np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(rows / norms, y)
    order = np.argsort(-np.abs(model.coef_))
    return Finding({names[i]: float(model.coef_[i] / norms[i]) for i in order if abs(model.coef_[i]) > 1e-10})


SELECTORS: dict[str, Callable[[np.ndarray, np.ndarray, list[str]], Finding]] = {
    "BIC forward": bic_forward, "LASSO, BIC": lasso_bic, "LASSO, cross-validated": lasso_cv,
}  # fmt: skip
