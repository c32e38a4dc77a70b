"""PySINDy on the force balance: polynomials of degree two in speed and reported drive, one fit and an ensemble."""

from __future__ import annotations

import warnings

import numpy as np

from aqualog.core.vehicle import Vehicle
from tests.blind.rivals.columns import Residuals
from tests.blind.rivals.select import Finding

__all__ = ["MEANINGS", "OVER", "THRESHOLDS", "ensemble", "polynomials", "single"]

THRESHOLDS = (0.1, 0.02, 0.005)
BAGS = 20
INCLUSION = 0.9
_V = 30.0  # [m/s] thresholds are in units of coefficients: the library is scaled so that all terms are of order one

MEANINGS: dict[str, frozenset[str]] = {
    # every effect that has this form, so that each is counted as right where it is the truth
    "1": frozenset((
        "rolling_resistance", "brake_drag", "accelerometer_bias", "road_grade", "accelerometer_drift",
        "tyre_warmup",
    )),
    "u": frozenset((
        "payload_mass", "torque_gain", "accelerometer_gain", "wheel_inertia", "trailer",
    )),
    "v": frozenset(("head_wind",)),
    "v v": frozenset(("aero_drag", "water_drag", "trailer")),
    "v u": frozenset(),
    "u u": frozenset(),
}  # fmt: skip
"""What a term would be called in physics; effects of sensors of speed and of tyres have no term in it."""
OVER: dict[str, frozenset[str]] = {
    t: frozenset({"v": "v_x", "u": "torque"}[x] for x in t.split() if x != "1") for t in MEANINGS
}
"""Coordinates of a term."""


def polynomials(r: Residuals, vehicle: Vehicle) -> dict[str, np.ndarray]:
    """The library's columns: name -> (C, n), zero in all channels but the force balance."""
    v, u = _inputs(r, vehicle)
    terms = {"1": np.ones_like(v), "v": v, "u": u, "v v": v * v, "v u": v * u, "u u": u * u}
    row = np.array([[float(c == "force_balance")] for c in r.channels])
    return {n: row * x for n, x in terms.items()}


def _inputs(r: Residuals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    return r.coordinates["v_x"] / _V, r.coordinates["torque"] / (vehicle.r_e_r * vehicle.mass)


def single(r: Residuals, vehicle: Vehicle, threshold: float) -> Finding:
    """`STLSQ` with a threshold."""
    model = _fitted(r, vehicle, threshold)
    return Finding({} if model is None else _ordered(r, vehicle, np.asarray(model.coefficients())[0]))


def ensemble(r: Residuals, vehicle: Vehicle, threshold: float = 0.005) -> Finding:
    """E-SINDy: terms that are in nine of ten bags of rows, with their median coefficient."""
    bags = _fitted(r, vehicle, threshold, bags=True)
    if bags is None:
        return Finding({})
    drawn = np.array([np.asarray(c)[0] for c in bags.optimizer.coef_list])
    kept = (np.abs(drawn) > 0.0).mean(axis=0) >= INCLUSION
    return Finding(_ordered(r, vehicle, np.where(kept, np.median(drawn, axis=0), 0.0)))


def _fitted(r: Residuals, vehicle: Vehicle, threshold: float, *, bags: bool = False):
    import pysindy as ps

    if "force_balance" not in r.channels:
        return None
    y = r.residual[r.channels.index("force_balance")]
    v, u = _inputs(r, vehicle)
    good = r.mask & np.isfinite(y) & np.isfinite(v) & np.isfinite(u)
    optimizer = ps.STLSQ(threshold=threshold, alpha=0.0)
    if bags:
        optimizer = ps.EnsembleOptimizer(optimizer, bagging=True, n_models=BAGS)
    model = ps.SINDy(optimizer=optimizer, feature_library=ps.PolynomialLibrary(degree=2))
    state = np.random.get_state()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.random.seed(1)
        model.fit(v[good, None], t=r.dt, x_dot=y[good, None], u=u[good, None])
    np.random.set_state(state)
    return model


def _ordered(r: Residuals, vehicle: Vehicle, coefficients: np.ndarray) -> dict[str, float]:
    """By size of the term in the residual. The order of the library: 1, v, u, v^2, v u, u^2."""
    columns = polynomials(r, vehicle)
    sizes = {n: float(np.nanstd(x[:, r.mask].sum(axis=0)) if n != "1" else 1.0) for n, x in columns.items()}
    found = {n: float(c) for n, c in zip(columns, coefficients, strict=True) if c != 0.0}
    return dict(sorted(found.items(), key=lambda x: -abs(x[1]) * sizes[x[0]]))
