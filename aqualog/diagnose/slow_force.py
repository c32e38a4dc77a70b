"""A force that changes over minutes: what is slow in the force balance and not in the accelerometer. An error of the
accelerometer is in both channels alike, a slope in the kinematic one alone, a force in the force balance alone. What
remains is compared with what forces on measured cars wander by anyway: gusts, bends, the road's surface."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import SHAPE_PRIOR, unit_force
from aqualog.diagnose.channels import block_step
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.records import SURE, Remainder, tempered
from aqualog.diagnose.shapes import MECHANISMS
from aqualog.diagnose.unexplained import WORTH_TELLING
from aqualog.diagnose.unknown_term import describe
from aqualog.model.term import Model

__all__ = ["slow_force"]

WINDOW_S, LEAST_USED, LEAST_WINDOWS = 10.0, 0.3, 12  # of a mean; share of it that is used; windows of a drive
USUAL = 0.012  # [m/s^2] sd by which forces wander: of measured trips of one car the largest has 0.012, most 0.005 (S)
MOST_ALIKE = 0.95  # correlation of neighbouring windows, at most: 39 of them count as one then (K)
OVER = ("v_x", "torque")  # of the coordinates whose functions compete already, those with which forces change most


def slow_force(drive: Drive, left: FloatArray, model: Model) -> Remainder | None:
    """The form of a force over time in what a model leaves (C, m) of a drive; None unless its probability is 0.95. The
    evidence is that of a wander of a force's usual size against the usual wander, over windows that count as
    independent after their own correlation: n (1 - rho) / (1 + rho)."""
    if drive.course.lanes or not {"force_balance", "kinematic"} <= set(drive.channels):
        return None  # on water no law of drag is exact
    t, s, whole, apart = _wander(drive, left)
    near = np.diff(t) < 1.5 * WINDOW_S
    if s.size < LEAST_WINDOWS or near.sum() < LEAST_WINDOWS // 2:
        return None
    slow = float(np.mean((s[1:] * s[:-1])[near]))  # noise of a window is in no other one
    # a wandering accelerometer and a road agree by chance now and then, but mostly they differ
    if slow <= USUAL**2 or apart > float(np.mean(s**2)):
        return None
    rho = min(slow / float(np.mean(s**2)), MOST_ALIKE)
    kind = next(m for m in MECHANISMS if m.name == "force")
    as_force = kind.usual / drive.vehicle.mass
    each = math.log(USUAL / as_force) + 0.5 * slow * (USUAL**-2 - as_force**-2)
    nats = s.size * (1.0 - rho) / (1.0 + rho) * each + math.log(SHAPE_PRIOR)
    if nats < math.log(SURE / (1.0 - SURE)):
        return None
    chance = 1.0 / (1.0 + math.exp(-nats))
    y, at = left[drive.channels.index("force_balance")], np.arange(left.shape[1]) * block_step(drive.dt)
    used = y[drive.mask]
    share = 1.0 - float(np.var(used - np.interp(at, t, whole)[drive.mask]) / max(np.var(used), 1e-30))
    if share <= WORTH_TELLING:
        return None
    try:
        by_newton = float(np.mean(unit_force(drive, model, left)[0][drive.mask]))
    except ConfigError:
        return None
    f = whole / by_newton
    # second differences of a slow function are those of its noise, with six times its variance
    noise = math.sqrt(float(np.mean(np.diff(whole, 2) ** 2)) / 6.0) / abs(by_newton)
    half = NormalDist().inv_cdf(1.0 - 0.025 / s.size) * noise
    every = np.arange(t[0], t[-1] + 0.5 * WINDOW_S, WINDOW_S)
    drawn = np.full(every.size, np.nan)  # where the drive was not usable
    drawn[np.rint((t - t[0]) / WINDOW_S).astype(np.intp)] = f
    found = Remainder(
        "force_balance", ("t",), share, math.nan, every[:, None], drawn, drawn - half, drawn + half, (), None, 0.0, "",
        kind.name, kind.unit, tempered(chance),
    )  # fmt: skip
    return replace(found, sentence=describe(kind, found))


def _wander(drive: Drive, left: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Middles of windows of 10 s [s], what force balance and wheels against torque show alike there on average, 0 where
    they disagree, without what goes with speed and torque and with it [m/s²], each (k,), and the mean square of the
    accelerometer's own [m²/s⁴]."""
    step = block_step(drive.dt)
    number = (np.arange(left.shape[1]) * step // WINDOW_S).astype(np.intp)
    known = drive.mask & np.isfinite(left).all(axis=0)
    count = np.bincount(number, weights=known)
    full = np.flatnonzero(count >= LEAST_USED * WINDOW_S / step)

    def mean(x: FloatArray) -> FloatArray:
        return np.bincount(number, weights=np.where(known, x, 0.0))[full] / count[full]

    force, kinematic = (mean(left[drive.channels.index(c)]) for c in ("force_balance", "kinematic"))
    over = [mean(drive.coordinates[n]) for n in OVER if n in drive.coordinates]
    A = np.array([np.ones(full.size), *over, *(x**2 for x in over)]).T

    def own(x: FloatArray) -> FloatArray:
        return np.asarray(x - A @ np.linalg.lstsq(A, x, rcond=None)[0])

    wheels = force - kinematic
    means = [np.full(full.size, x.mean() if full.size else 0.0) for x in (force, wheels)]
    whole = _alike(force - means[0], wheels - means[1]) + _alike(*means)
    apart = float(np.mean(own(kinematic) ** 2)) if full.size else 0.0
    return np.asarray((full + 0.5) * WINDOW_S), _alike(own(force), own(wheels)), whole, apart


def _alike(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smaller of two values that have the same sign; else 0."""
    return np.asarray(np.where(a * b > 0.0, np.sign(a) * np.minimum(np.abs(a), np.abs(b)), 0.0))
