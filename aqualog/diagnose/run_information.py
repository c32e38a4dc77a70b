"""Simulated trial of a run or check: separation of the sets of effects, weighted by the noise of the log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.records import FloatArray, Signals
from aqualog.diagnose.channels import block_step
from aqualog.diagnose.drive import Drive, prepare
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in
from aqualog.diagnose.isolate import separation
from aqualog.diagnose.manoeuvres import Run, Sensor, programme, turned
from aqualog.diagnose.noise import Noise, bridged, for_mask, spectra, whitened
from aqualog.diagnose.outcome import Rival
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.term import Check, Model

__all__ = ["Case", "of_check", "of_log", "of_run"]

STEP_S = 2e-3  # [s] of the integration
# rms noise of channels that the log does not have yet, independent from second to second (K)
_ASSUMED = {"force_balance": 0.1, "kinematic": 0.15, "lateral": 0.2, "tie_rod": 100.0}
_ASSUMED_SPEED = 0.05  # [m/s] of all others


@dataclass(frozen=True, slots=True)
class Case:
    """The decision to make: the sets, their pairs, and all tolerances as (hypothesis, parameter, its sd)."""

    evidence: Evidence
    credible: tuple[Rival, ...]
    noises: tuple[Noise, ...]
    model: Model
    pairs: tuple[tuple[int, int], ...]
    forgiven: tuple[tuple[Hypothesis, str, float], ...]
    like: int  # the drive whose signals, noise and water a run is assumed to have

    @property
    def drive(self) -> Drive:
        """The drive whose signals a run has."""
        return self.evidence.drives[self.like]

    @property
    def effects(self) -> frozenset[str]:
        """Names of all effects in question."""
        return frozenset(h.effect.name for c in self.credible for h in c.refit.members)

    @property
    def near(self) -> tuple[int, ...]:
        """Tolerances of the effects in question, and those of every vehicle file."""
        names = self.effects
        return tuple(i for i, (h, _, _) in enumerate(self.forgiven) if h.allowed or h.effect.name in names)

    def rows(self, kept: Sequence[int]) -> list[int]:
        """Rows of the sets, of the simulation's error in a run, and of a part of the tolerances."""
        first = len(self.credible) + sum(len(c.refit.values) for c in self.credible) + 1
        return [*range(first), *(first + i for i in kept)]

    def apart(self, gram: FloatArray, kept: Sequence[int]) -> FloatArray:
        """Separation of each pair by inner products of rows with a part of the tolerances; the smaller of two ways."""
        k = len(gram) - len(kept) + np.arange(len(kept))
        inner = gram[np.ix_(k, k)] + np.diag([self.forgiven[i][2] ** -2.0 for i in kept])
        gram = gram - gram[:, k] @ np.linalg.solve(inner, gram[k, :])
        own, at = [], len(self.credible)
        for c in self.credible:
            own.append(tuple(range(at, at + len(c.refit.values))))
            at += len(c.refit.values)
        ways = [
            [
                _certain(gram, (a, b, at), own[b])
                for a, b in ((i, j), (j, i))
                # a set that holds the truth and more can always imitate it
                if any(h not in self.credible[b].refit.members for h in self.credible[a].refit.members)
            ]
            for i, j in self.pairs
        ]
        return np.array([min(w) for w in ways])


def _certain(gram: FloatArray, rows: tuple[int, int, int], rivals: Sequence[int]) -> float:
    """Separation of a truth from its rivals, reduced by the possible influence of the simulation's own error `rows[2]`.

    The difference d of two sets is disturbed by noise and the error e: twice the log of the ratio of evidence has mean
    d^2 - 2 |e d| and variance 4 d^2. The result is the separation that is equally certain without an error.
    """
    plain = separation(gram, rows, rivals, np.array([-1.0, 1.0, 0.0]))
    if plain <= 0.0:
        return 0.0
    cross = 0.25 * (
        separation(gram, rows, rivals, np.array([-1.0, 1.0, 1.0]))
        - separation(gram, rows, rivals, np.array([-1.0, 1.0, -1.0]))
    )
    return max(plain - 2.0 * abs(cross), 0.0) ** 2 / plain


def of_log(case: Case) -> FloatArray:
    """Inner products of the remainders of the log after each set, its columns, and all tolerances."""
    evidence = case.evidence
    forgiven = np.flatnonzero(evidence.forgiven > 0.0).tolist()
    total: FloatArray | float = 0.0
    for d, (drive, noise) in enumerate(zip(evidence.drives, case.noises, strict=True)):
        parts = [c.refit.residuals[d][None] for c in case.credible] + [c.refit.signatures[d] for c in case.credible]
        rows = whitened(spectra(bridged(np.concatenate(parts), drive.mask)), noise)
        nothing = np.zeros((1, rows.shape[1]))
        own = spectra(bridged(evidence.signatures[d][forgiven], drive.mask))
        rows = np.concatenate([rows, nothing, whitened(own, noise)])
        total = total + rows @ rows.T
    return np.asarray(total)


def of_run(case: Case, run: Run, kept: Sequence[int], sensor: Sensor | None = None) -> FloatArray:
    """Whitened rows of a run, simulated under the best set; empty if no sample of it can be used."""
    drive = _driven(case, run, sensor)
    n_rows = len(case.rows(kept))
    if not drive.mask.any():
        return np.zeros((n_rows, 1))
    models = [c.refit.model for c in case.credible]
    model = case.model
    if run.opposite:
        models, model = [turned(m) for m in models], turned(model)
    left = [residual(drive, m) for m in models]
    own = [
        _signatures(drive, m, c.refit.members, r, run, each=True)
        for m, c, r in zip(models, case.credible, left, strict=True)
    ]
    asked: list[Hypothesis] = []
    for i in kept:
        if case.forgiven[i][0] not in asked[-1:]:
            asked.append(case.forgiven[i][0])
    shown = _signatures(drive, model, asked, residual(drive, model), run, each=False)
    rows = np.concatenate([np.array(left), *own, left[0][None], shown])
    return _weighed(case, drive, rows)


def _signatures(
    drive: Drive, model: Model, asked: Sequence[Hypothesis], base: FloatArray, run: Run, *, each: bool
) -> FloatArray:
    """Signatures by the values that the same road has in the log's direction. (k, C, m)"""
    parts = signatures(drive, model, asked, base=base, each=each)
    if run.opposite:
        parts = [-s if h.effect.drive.turns else s for h, s in zip(asked, parts, strict=True)]
    return np.concatenate(parts)


def _driven(case: Case, run: Run, sensor: Sensor | None) -> Drive:
    """A run under the best set, with perfect sensors for the signals that the log has."""
    truth = case.credible[0].refit.model
    simulation = simulate(programme(run, case.drive), turned(truth) if run.opposite else truth, dt=STEP_S)
    signals = as_signals(simulation, truth=False)
    present = case.drive.present | set(sensor.signals if sensor else ())
    keep = [s for s in signals.frame.columns if s in present or s == "t" or s.startswith("water_depth")]
    signals = Signals(signals.frame.select(keep), signals.dt_ns, signals.start_ns, {}, signals.quality, signals.files)
    drive = prepare(signals, case.drive.vehicle, run.name)
    known = case.drive.channels
    return replace(drive, channels=(*known, *(c for c in drive.channels if c not in known)))


def _weighed(case: Case, drive: Drive, rows: FloatArray) -> FloatArray:
    """Rows (k, C, m), the driven set's first, by the noise of the log; channels that it lacks by assumed noise."""
    count = len(case.drive.channels)
    noise = for_mask(case.noises[case.like], drive.mask)
    out = whitened(spectra(bridged(rows[:, :count], drive.mask)), noise)
    # the simulation's error for the driven set counts as noise, because a real run has it too
    of_channels = out.reshape(len(out), count, -1)
    missed = (of_channels[0] ** 2).sum(axis=-1) / max(int(drive.mask.sum()), 1)
    out = (of_channels / np.sqrt(1.0 + missed)[:, None]).reshape(len(out), -1)
    step = block_step(drive.dt)
    for c, name in enumerate(drive.channels[count:], count):
        sd = next((x for n, x in _ASSUMED.items() if name.startswith(n)), _ASSUMED_SPEED)
        out = np.concatenate([out, rows[:, c, drive.mask] / sd * math.sqrt(min(step, 1.0))], axis=1)
    return out


def of_check(case: Case, check: Check, kept: Sequence[int]) -> FloatArray:
    """One column: the remainder of the reading after each set, and the change by its parameters."""

    def meant(h: Hypothesis, name: str) -> bool:
        return h.effect.drive.check is check and h.where in check.where and name == check.parameter

    asked = next(h for h in case.evidence.asked if h.effect.drive.check is check and h.where in check.where)
    left = [-value_in(c.refit.model, asked, check.parameter) for c in case.credible]
    own = [float(meant(c.refit.members[i], n)) for c in case.credible for i, n in c.refit.names]
    forgiven = [float(meant(*case.forgiven[i][:2])) for i in kept]
    return np.array([*left, *own, 0.0, *forgiven])[:, None] / check.sd
