"""Learn what water and dry roads show: `aqualog/detect/margin/emissions.toml`.

    python -m tests.margin.learn gather --passes 6000 --drives 20 --to /tmp/windows.npz
    python -m tests.margin.learn fit --from /tmp/windows.npz

Windows come from passes whose tyres are drawn by `passes.any_tyre`, and from dry drives of the tuning pool. What is
compared with is learnt from the dry road before, by the filter itself, which is told where the water is.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from aqualog.detect.braking import BrakeWatch
from aqualog.detect.detector import Scene
from aqualog.detect.margin import emissions as kept
from aqualog.detect.margin.emissions import COVARIATES, FEATURES, FULL_SPEEDS, NODES, VERSION, Emissions
from aqualog.detect.margin.inputs import Reader
from aqualog.detect.margin.recursion import scan
from aqualog.detect.margin.state import Filter, FilterParams, Inputs
from aqualog.detect.margin.watch import params
from aqualog.features.stream import FeatureStream
from aqualog.model.drawing import KMH, TUNING_POOL
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import draw
from aqualog.model.tyre import TYRES
from aqualog.physics.hydroplaning import gallaway_speed, usf_speed
from tests.detect.episode_study import DRY
from tests.margin.passes import own_pass

DRIVETRAINS = ("rwd", "fwd", "awd")
TARGET = Path(kept.__file__).with_name("emissions.toml")
DISTANCE = (-20.0 * KMH, 100.0 * KMH)
_N = len(FEATURES)
BANDWIDTH = 0.06  # [-] of the log ratio
TAIL = FilterParams._field_defaults["tail"]
KINDS = 8  # of dry road, and as many of wet
WET = 0.6  # [-] log ratio up to which water counts as such
DEPTHS, PRESSURES, TREADS = (0.6e-3, 6e-3), (1.8e5, 2.9e5), (1e-3, 8e-3)  # [m, Pa, m] that a prior is a mean over
LOAD = np.array(4000.0)  # [N]
TEXTURE = 0.8e-3  # [m] mean texture depth of asphalt
STOPS_AT = 0.93  # a free wheel stops at about this share of the speed at which its contact ends
LAW_SD = 0.20  # [-] log of a tyre's full speed about a law
NEUTRAL = Emissions(
    np.zeros((NODES.size, _N, COVARIATES)), np.tile(1e9 * np.eye(_N), (NODES.size, 1, 1)), np.ones(NODES.size),
    np.full(FULL_SPEEDS.size, 1.0 / FULL_SPEEDS.size), np.zeros((2, _N, COVARIATES)), np.tile(1e9 * np.eye(_N), (2, 1, 1)),
    np.ones(2), np.array([0.0, 1.0]),
)  # fmt: skip


def windows(columns, vehicle, dt: float, wet):
    """Features and covariates (steps, 8), NaN where one is missing, of a drive; `wet` [s]: where the water is."""
    columns = {s: x for s, x in columns.items() if not s.startswith("true_") and np.isfinite(x).any()}
    stream = FeatureStream(vehicle, dt, columns)
    f = stream.push(columns)
    known = {s: columns[s] for s in stream.available}
    inputs = Reader(vehicle, dt).push(Scene(f, BrakeWatch(vehicle, dt).push(f, known), known))
    p = params(vehicle, dt)
    state, rows = Filter.new(p, NEUTRAL), []
    for k in range(f["v_x_hat"].size // p.block):
        at = slice(k * p.block, (k + 1) * p.block)
        is_wet = wet[0] - 0.1 <= k * p.dt < wet[1] + 1.0
        state.kinds[:] = (0.0, 1.0) if is_wet else (1.0, 0.0)
        _, state = scan(p, NEUTRAL, state, Inputs(*(x[at] for x in inputs)))
        traction = np.nanmean(np.nansum(state.window[:, 5:9], axis=1)) * 0.5
        v = state.window[int(state.samples[1] - 1) % 6, 0]
        x = state.x[0] if (state.x[1] < 1.0).all() and v > p.v_least else np.full(_N, np.nan)
        with np.errstate(invalid="ignore"):
            rows.append((*x, 1.0, np.log(v / 30.0), np.arcsinh(traction / 0.02)))
    return np.array(rows)


def gather(a: argparse.Namespace) -> None:
    """Windows with drivetrain, kind, log ratio, pass, contact.

    Kinds: -1 water, -3 its edge, -2 dry road before it, else the number of the dry situation.
    """
    found = []
    for n in range(a.passes):
        p = own_pass(a.first + n, DRIVETRAINS[n % 3], distance=DISTANCE, broad=True)
        x = windows(p.columns, p.vehicle, p.dt, p.wet)
        d = n % 3
        for after in (0.2, 0.3, 0.4, 0.5, 0.7, 0.8, 1.4, 2.0, 2.6, 3.2, 3.7):
            k = round((p.wet[0] + after) / 0.1)
            if k < len(x):
                v = 30.0 * np.exp(x[k, 6])
                found.append((d, -1.0 if after > 0.7 else -3.0, np.log(p.v_full / v), n, p.contact(v), *x[k]))
        for k in range(40, round(p.wet[0] / 0.1) - 2, 20):
            found.append((d, -2.0, np.nan, n, np.nan, *x[k]))
        if n % 300 == 299:
            print(n + 1, flush=True)
            np.savez(a.to, x=np.array(found))
    for n in range(a.drives):
        for i, name in enumerate(DRY):
            drawn = draw(name, a.first + n, TUNING_POOL)
            signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
            columns = {s: signals.array(s) for s in signals.symbols}
            x = windows(columns, drawn.believed, signals.dt_ns * 1e-9, (1e9, 1e9))
            d = DRIVETRAINS.index(drawn.believed.drivetrain)
            found += [(d, float(i), np.nan, n, np.nan, *row) for row in x[30::5]]
        print("dry", n + 1, flush=True)
        np.savez(a.to, x=np.array(found))


def water(x, where, contact):
    """Mean by covariates, scatter and contact at each node: local regression on the log ratio, by Student's law."""
    mean, scatter, share = [], [], []
    features, z = x[:, :_N], x[:, _N:]
    for node in NODES:
        away = where - node
        near = np.exp(-0.5 * (away / BANDWIDTH) ** 2)
        form = np.column_stack([z, away])
        w = near.copy()
        for _ in range(6):
            fit = np.linalg.solve(
                (w[:, None] * form).T @ form + 1e-3 * np.eye(COVARIATES + 1), (w[:, None] * form).T @ features
            )
            left = features - form @ fit
            S = (w[:, None] * left).T @ left / near.sum() + 1e-3 * np.eye(_N)
            square = np.einsum("ni,ij,nj->n", left, np.linalg.inv(S), left)
            w = near * (TAIL + _N) / (TAIL + square)
        mean.append(fit[:COVARIATES].T)
        scatter.append(S)
        share.append(float(near @ contact / near.sum()))
    return np.array(mean), np.array(scatter), np.array(share)


def kinds(x, rng):
    """Means, covariances and shares of `KINDS` kinds of windows: a mixture of Student's laws."""
    mean = x[rng.choice(len(x), KINDS, replace=False)]
    S = np.tile(np.cov(x.T), (KINDS, 1, 1))
    share = np.full(KINDS, 1.0 / KINDS)
    for _ in range(150):
        left = x[None] - mean[:, None]
        square = np.einsum("kni,kij,knj->kn", left, np.linalg.inv(S), left)
        logs = np.log(share)[:, None] - 0.5 * np.linalg.slogdet(S)[1][:, None]
        logs = logs - 0.5 * (TAIL + _N) * np.log1p(square / TAIL)
        r = np.exp(logs - logs.max(axis=0))
        r /= r.sum(axis=0)
        w = r * (TAIL + _N) / (TAIL + square)
        share = r.mean(axis=1)
        mean = (w[..., None] * x[None]).sum(axis=1) / w.sum(axis=1)[:, None]
        left = x[None] - mean[:, None]
        S = np.einsum("kn,kni,knj->kij", w, left, left) / r.sum(axis=1)[:, None, None] + 1e-3 * np.eye(_N)
    order = np.argsort(-share)
    return mean[order], S[order], share[order]


def prior(rng):
    """How likely each full speed is before any evidence: of tyres, pressures and depths, by three laws that disagree."""
    n = 4000
    h, p, tread = (low * (high / low) ** rng.uniform(size=n) for low, high in (DEPTHS, PRESSURES, TREADS))
    worn = TYRES["worn_summer"]
    laws = [
        STOPS_AT
        * np.array(
            [replace(worn, tread_depth=t).full_speed(x, LOAD, p=y) for t, x, y in zip(tread, h, p, strict=True)]
        ),
        np.array(
            [gallaway_speed(x, y, tread_depth=t, texture_depth=TEXTURE) for t, x, y in zip(tread, h, p, strict=True)]
        ),
        usf_speed(h, p, LOAD),
    ]
    away = np.log(FULL_SPEEDS[:, None] / np.concatenate(laws)) / LAW_SD
    found = np.exp(-0.5 * away * away).mean(axis=1)
    return found / found.sum()


def _text(x) -> str:
    if np.ndim(x) == 0:
        return f"{float(x):.4g}"
    return "[" + ", ".join(_text(y) for y in x) + "]"


def fit(a: argparse.Namespace) -> None:
    found = np.concatenate([np.load(p)["x"] for p in a.source])
    found = found[np.isfinite(found[:, 5:]).all(axis=1)]
    out = [f"# Made by `python -m tests.margin.learn`; {len(found)} windows.", f"version = {VERSION}"]
    before = prior(np.random.default_rng(5))
    which, features = found[:, 1], found[:, 5 : 5 + _N]
    for d, name in enumerate(DRIVETRAINS):
        own = found[:, 0] == d
        at = own & (which == -1.0)
        laws = water(found[at, 5:], found[at, 2], found[at, 4])
        rng = np.random.default_rng(1)
        wet = own & ((which == -1.0) | (which == -3.0)) & (found[:, 2] < WET)
        roads = [kinds(features[some], rng) for some in (own & ((which == -2.0) | (which >= 0.0)), wet)]
        m, S, share = (np.concatenate(x) for x in zip(*roads, strict=True))
        m = np.concatenate([m[..., None], np.zeros((*m.shape, COVARIATES - 1))], axis=2)
        tables = Emissions(*laws, before, m, S, share, np.repeat([0.0, 1.0], KINDS))
        out.append(f"\n[{name}]")
        for field, x in tables._asdict().items():
            rows = x if x.ndim > 1 else [x]
            body = ",\n".join(_text(r) for r in rows)
            out.append(f"{field} = [\n{body},\n]" if x.ndim > 1 else f"{field} = {body}")
        print(name, at.sum(), "windows of water; kinds of road", np.round(share, 3))
        print(np.round(m[..., 0], 2), np.round(np.sqrt(np.einsum("kii->ki", S)), 2), sep="\n")
    TARGET.write_text("\n".join(out) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("gather", "fit"))
    parser.add_argument("--passes", type=int, default=6000)
    parser.add_argument("--drives", type=int, default=20)
    parser.add_argument("--first", type=int, default=100_000)
    parser.add_argument("--from", dest="source", type=Path, nargs="+", default=[Path("/tmp/windows.npz")])
    parser.add_argument("--to", type=Path, default=Path("/tmp/windows.npz"))
    a = parser.parse_args()
    {"gather": gather, "fit": fit}[a.what](a)


if __name__ == "__main__":
    main()
