"""How large a hidden effect's trace is beside the noise, what other effects could imitate it, and tests of forecasts.

The trace is the world's own: the same drive with and without the effect, no noise. The noise is that of the log once the
trace is taken away, in the engine's channels and by its noise model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.records import Diagnosis
from aqualog.model.term import Model
from tests.blind.metrics.engine import Drive, Noise, noise_of, prepare, residual, shapes, unit_innovations

__all__ = [
    "Log", "chance", "clean_trace", "length", "log_of", "p_right", "pairs_tested", "span_left", "white",
]  # fmt: skip

_TINY = 1e-9


class Log(NamedTuple):
    """A drive with its residual (C, n) under the vehicle file alone, the trace (C, n) in it, and the noise of the rest."""

    drive: Drive
    residual: np.ndarray
    trace: np.ndarray
    noise: Noise


def log_of(signals: Signals, vehicle: Vehicle, pair: tuple[Signals, Signals] | None) -> Log:
    """A log beside the clean drives with and without what is hidden; None: nothing is."""
    drive = prepare(signals, vehicle, "log")
    base = residual(drive, Model())
    hidden = np.zeros_like(base) if pair is None else _fitted(clean_trace(*pair, vehicle), base.shape)
    return Log(drive, base, hidden, noise_of(drive, base - hidden))


def clean_trace(with_effect: Signals, without: Signals, vehicle: Vehicle) -> np.ndarray:
    """What the effect does to the residual channels (C, n).

    Each of the two drives is compared with the simulation of its own torque, as the engine would do it.
    """
    a, b = (residual(prepare(s, vehicle, "clean"), Model()) for s in (with_effect, without))
    n = min(a.shape[-1], b.shape[-1])
    return a[:, :n] - b[:, :n]


def _fitted(x: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    out = np.zeros(shape)
    n = min(x.shape[-1], shape[-1])
    out[:, :n] = np.where(np.isfinite(x[:, :n]), x[:, :n], 0.0)
    return out


def white(log: Log, x: np.ndarray) -> np.ndarray:
    """A residual-shaped array (C, n) as unit innovations (N,)."""
    return unit_innovations(log.drive, log.noise, _fitted(x, log.residual.shape))


def length(log: Log) -> float:
    """Detectability z: length of the whitened trace."""
    return float(np.linalg.norm(white(log, log.trace)))


def span_left(x: np.ndarray, others: Sequence[np.ndarray]) -> float:
    """Energy of a whitened trace (N,) that the others together, at any sizes, cannot imitate."""
    if not others:
        return float(x @ x)
    rows = np.array([o / max(float(np.linalg.norm(o)), _TINY) for o in others])
    _u, s, vt = np.linalg.svd(rows, full_matrices=False)
    inner = vt[s > 1e-6 * s[0]] @ x
    return max(float(x @ x - inner @ inner), 0.0)


def chance(separation: float) -> float:
    """Chance to name the right one of two: Phi(sqrt(lambda) / 2)."""
    return 0.5 * (1.0 + math.erf(0.5 * math.sqrt(max(separation, 0.0)) / math.sqrt(2.0)))


def p_right(diagnosis: Diagnosis, key: str, size: float) -> float:
    """The engine's own forecast for an effect at its true size: the smallest over all rivals that it lists.

    It states separations at its detection limit; they grow with the square of the size. NaN if it says nothing, as where
    the log shows the effect at no physical size.
    """
    limit = next((x.size for x in diagnosis.limits if _key(x.effect, x.where) == key), math.nan)
    own = [c.separation for c in diagnosis.confusions if c.effect == key and not _same_payload(key, c.rivals)]
    if not own or not limit > 0.0:
        return math.nan
    return chance(min(own) * (size / limit) ** 2)


def _same_payload(key: str, rivals: Sequence[str]) -> bool:
    """Where in the car a load lies is no other cause."""
    return key.startswith("payload_mass") and any(r.startswith("payload_mass") for r in rivals)


def _key(effect: str, where: str | None) -> str:
    return effect if where is None else f"{effect}@{where}"


def pairs_tested(diagnosis: Diagnosis, log: Log, rng: np.random.Generator, most: int = 60) -> list[tuple[float, bool]]:
    """The engine's forecast for two effects beside what happens: (chance to name the right one, whether it was).

    Into the noise of a log without effects goes the library's shape of the one effect at the size of its detection limit
    and at half of that; it is named right if it explains more than the other does. Which pairs is drawn.
    """
    found = {k: white(log, x) for k, x in shapes(log.drive).items()}
    noise = white(log, log.residual)
    size = {_key(x.effect, x.where): x.size for x in diagnosis.limits}
    told = [c for c in diagnosis.confusions if len(c.rivals) == 1 and {c.effect, *c.rivals} <= set(found)]
    told = [c for c in told if math.isfinite(size.get(c.effect, math.nan))]
    # most pairs are told for sure; drawn so that all chances occur
    order = rng.permutation(len(told))
    by_chance: dict[int, list[int]] = {}
    for i in order:
        by_chance.setdefault(min(int(20.0 * told[i].p_correct), 19), []).append(int(i))
    picked = [i for group in by_chance.values() for i in group[: max(3, most // (2 * len(by_chance)))]]
    out = []
    for i in picked[: most // 2]:
        c = told[i]
        own, rival = found[c.effect] * size[c.effect], found[c.rivals[0]]
        for part in (1.0, 0.5):
            sign = rng.choice([-1.0, 1.0])
            y = sign * part * own + noise
            out.append((chance(c.separation * part**2), _explained(y, own) > _explained(y, rival)))
    return out


def _explained(y: np.ndarray, shape: np.ndarray) -> float:
    return float(y @ shape) ** 2 / max(float(shape @ shape), _TINY)
