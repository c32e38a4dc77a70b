"""One blind case from its plan to its row: made by the world, diagnosed by the engine, compared with what was hidden."""

from __future__ import annotations

import math
import resource
import time
import traceback
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.diagnose.records import Cause, Diagnosis
from aqualog.diagnose.run import Options, diagnose
from aqualog.model.effects import EFFECTS
from tests.blind.metrics import forecast, gain
from tests.blind.metrics.detector import consequence
from tests.blind.metrics.plan import Job
from tests.blind.metrics.rows import Fact, Row, Said
from tests.blind.metrics.second import second
from tests.blind.world.cases import Case, Hidden, Spec, clean_pair, make_case, truth
from tests.blind.world.vehicles import CARS

__all__ = ["LEVEL", "SEED", "work"]

SEED, LEVEL = 1, 0.01


def work(job: Job) -> Row:
    """The row of a case; what went wrong stands in `error`."""
    spec = job.spec
    empty = Row(job.key, job.group, spec.programme, spec.noise, spec.seed, members=job.members)
    try:
        return _worked(job, empty)
    except Exception as error:  # a case that fails is a result
        where = traceback.extract_tb(error.__traceback__)[-1]
        known = tuple(_fact(h) for h in truth(spec))
        return replace(empty, truth=known, error=f"{type(error).__name__}: {error} ({where.name}, line {where.lineno})")


def _worked(job: Job, row: Row) -> Row:
    spec = _sized(job)
    case = make_case(spec)
    pair = clean_pair(spec) if spec.hidden else None
    log = forecast.log_of(case.drives[0][1], case.vehicle, pair)
    began, used = time.perf_counter(), time.process_time()
    found = _diagnosed(case, job)
    row = _said(row, found, time.perf_counter() - began, time.process_time() - used)
    facts = [_fact(h) for h in truth(spec)]
    if len(facts) == 1:
        size = _size(facts[0])
        facts = [replace(facts[0], z=forecast.length(log), p_right=forecast.p_right(found, facts[0].key, size))]
    row = replace(row, truth=tuple(facts))
    if job.twins:
        # a relation that no run can break is exact by its equations, whatever two drives of the world differ by
        row = replace(row, separation=_left_by_twins(job, spec, case, log) if job.can else 0.0)
    if job.twins and found.verdict == "cannot_tell":
        row = replace(row, second=second(job, spec, case, found, lambda c: _diagnosed(c, job)))
    if job.group == "pairs":
        rng = np.random.default_rng([spec.seed, 6])
        row = replace(row, pairs=tuple(forecast.pairs_tested(found, log, rng)))
    if case.holdout:
        row = _heldout(row, job, spec, case, found, log)
    return replace(row, peak_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)


def _diagnosed(case: Case, job: Job) -> Diagnosis:
    return diagnose(
        case.drives, case.vehicle, holdout=case.holdout,
        options=Options(seed=SEED, level=LEVEL, surrogates=job.surrogates, views=False, consequences=False),
    )  # fmt: skip


def _sized(job: Job) -> Spec:
    """The spec with its hidden effect at the size that the plan asks for."""
    spec = job.spec
    if job.target_z is not None:
        for _ in range(2):  # the trace is nearly as large as the effect, not quite
            pair = clean_pair(spec)
            log = forecast.log_of(make_case(replace(spec, holdout=0)).drives[0][1], CARS[spec.vehicle], pair)
            z = forecast.length(log)
            if abs(z / job.target_z - 1.0) < 0.1:
                break
            # never larger than ten times the moderate size: what the drive does not show cannot be made visible
            spec = replace(spec, scale=spec.scale * min(job.target_z / max(z, 1e-9), 10.0))
    if job.twins:
        # what is too small to be worth naming is rightly not named
        fact = _fact(truth(spec)[0])
        smallest = EFFECTS[fact.effect].parameters[0].smallest
        spec = replace(spec, scale=spec.scale * max(1.0, 2.0 * smallest / _size(fact)))
    if job.group == "limit":
        # another log of the same kind, in which nothing is hidden, says how large an effect has to be
        calm = make_case(replace(spec, hidden=(), holdout=0, seed=spec.seed + 100_000))
        fact = _fact(spec.hidden[0])
        told = {_key(x.effect, x.where): x.size for x in _diagnosed(calm, job).limits}
        limit = told.get(fact.key, math.nan)
        if not math.isfinite(limit):
            raise ValueError(f"no limit for {fact.key}")
        spec = replace(spec, scale=limit / _size(fact))
    return spec


def _fact(hidden: Hidden) -> Fact:
    effect, where = _named(hidden.effect, hidden.where)
    return Fact(effect, where, dict(hidden.values), known=hidden.in_library)


def _named(effect: str, where: str | None) -> tuple[str, str | None]:
    """Name and place by which an effect is judged: a load is a load wherever it lies, a default place is spelled out."""
    if effect == "payload_mass":
        return effect, None
    default = EFFECTS[effect].default if effect in EFFECTS else None
    return effect, where or default


def _key(effect: str, where: str | None) -> str:
    effect, where = _named(effect, where)
    return effect if where is None else f"{effect}@{where}"


def _size(fact: Fact) -> float:
    """Deviation of the first parameter from neutral."""
    if fact.effect not in EFFECTS:
        return math.nan
    p = EFFECTS[fact.effect].parameters[0]
    return abs(fact.values.get(p.name, p.neutral) - p.neutral)


def _said(row: Row, d: Diagnosis, seconds: float, cpu: float) -> Row:
    return replace(
        row,
        verdict=d.verdict,
        causes=tuple(said_of(d.causes)),
        alternatives=tuple(tuple(_key(c.effect, c.where) for c in a.causes) for a in d.alternatives),
        p_value=d.significance.p_value if d.significance is not None else math.nan,
        limits={_key(x.effect, x.where): x.size for x in d.limits},
        seconds=seconds,
        cpu_seconds=cpu,
    )


def said_of(causes: Sequence[Cause]) -> list[Said]:
    """Causes by the names by which they are judged."""
    return [
        Said(*_named(c.effect, c.where), {k: (e.value, e.low, e.high) for k, e in c.parameters.items()}) for c in causes
    ]


def _trace_of(spec: Spec, case: Case, log: forecast.Log) -> np.ndarray:
    return forecast.white(log, forecast.clean_trace(*clean_pair(spec), case.vehicle))


def _left_by_twins(job: Job, spec: Spec, case: Case, log: forecast.Log) -> float:
    """What of the hidden trace the world's own twins, at any sizes, do not imitate."""
    others = [_trace_of(replace(spec, hidden=(h,), scale=0.3), case, log) for h in job.twins]
    return forecast.span_left(forecast.white(log, log.trace), others)


def _heldout(row: Row, job: Job, spec: Spec, case: Case, found: Diagnosis, log: forecast.Log) -> Row:
    """Gain on the held-out drive beside the truth's."""
    signals = case.holdout[0][1]
    if job.group == "detector":
        oracle = gain.true_model(row.truth)
        if oracle is None:
            return row
        models = {"before": type(found.model)(), "after": found.model, "oracle": oracle}
        return replace(row, detector=consequence(signals, case.vehicle, models))
    pair = clean_pair(spec, spec.drives) if spec.hidden else None
    unseen = forecast.log_of(signals, case.vehicle, pair)
    if spec.hidden:
        model = gain.true_model(row.truth)
        row = replace(row, gain=gain.log_score(unseen, found.model), oracle=gain.log_score(unseen, model))
    else:
        row = replace(row, worse=gain.worse(unseen, found.model))
    return row
