"""Learn what water and dry roads show: `aqualog/detect/margin/emissions.toml`.

    python -m tests.margin.learn --passes 5400 --one-side 4500 --drives 24 --keep /tmp/windows.npz
    python -m tests.margin.learn --same-roads    # kinds of road stay as the file has them
    python -m tests.margin.learn --passes 0 --one-side 900 --others 360    # only snow under one side is learnt, and what
                                                 # the rear axle shows of it and of water there; the rest stays
    python -m tests.margin.learn --steady 6000 --first 1200000    # only wet kinds of cars that have been in the water for
                                                 # long; the rest stays

Windows come from passes whose tyres are drawn by `passes.any_tyre`, from dry drives of the tuning pool, and from drives
on snow, ice and gravel. What is compared with is learnt from the dry road before, by the filter itself, which is told
where the road is not dry.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from aqualog.detect.braking import BrakeWatch
from aqualog.detect.detector import Scene
from aqualog.detect.margin import emissions, state
from aqualog.detect.margin.inputs import Reader
from aqualog.detect.margin.recursion import scan
from aqualog.detect.margin.state import FULL_SPEEDS, NODES, REAR, TAIL, Emissions, Filter, FilterParams, Inputs
from aqualog.detect.margin.watch import params
from aqualog.features.stream import FeatureStream
from aqualog.model.drawing import KMH, SCORING_POOL, TUNING_POOL, Drawing
from aqualog.model.log import as_signals
from aqualog.model.scenario import SURFACES, Lane, Surface
from aqualog.model.simulate import simulate
from aqualog.model.situations import believed_vehicle, draw
from aqualog.model.tyre import TYRES
from aqualog.physics.hydroplaning import gallaway_speed, usf_speed
from tests.detect.episode_study import DRY
from tests.margin.passes import LAWS, own_pass

DRIVETRAINS = ("rwd", "fwd", "awd")
DISTANCE = (-20.0 * KMH, 100.0 * KMH)
WATER, EDGE = (0.8, 1.4, 2.0, 2.6, 3.2, 3.7), (0.2, 0.3, 0.4, 0.5, 0.7)  # [s] behind the begin of the water
STEADY, LONG = (0.8, 1.4, 2.0, 2.6, 3.2, 4.0, 5.0, 6.0, 7.0, 8.0), 9.0  # [s] the same of such that stay so long
OTHER = 3  # surface: snow, ice, gravel
GRIPS = float(np.arcsinh(0.02 / FilterParams._field_defaults["scale_D"]))  # 2 % of slip
WET = 0.6  # [-] log ratio up to which water counts as such
STOPS_AT = 0.93  # a free wheel stops at about this share of the speed at which its contact ends
LAW_SD = 0.20  # [-] log of a tyre's full speed about a law
BANDWIDTH = 0.06  # [-] of the log ratio
SHARP = 1.0  # how surely a slip of 1 in its feature tells which way a wheel goes
SHARES = (0.6, 0.1, 0.3)  # of `LAWS` (K)
OF_TEN = (0, 0, 0, 0, 0, 0, 1, 2, 2, 2)  # the same among passes with water under one side alone
ONE_SIDE, SHARE_ONE = len(LAWS), 0.25  # its law, of all others together; its share of wet road, that of snow above (K)
KINDS, KINDS_STEADY, KINDS_ONE = 8, 12, 4  # of dry, wet, other roads; of wet ones by the traction; under one side
LEAST = 1e-3  # [-] of a variance
_N, _Z = len(state.FEATURES), state.COVARIATES
NEUTRAL = Emissions(
    np.zeros((1, NODES.size, _N, _Z)), np.tile(1e9 * np.eye(_N), (1, NODES.size, 1, 1)), np.ones((1, NODES.size)),
    np.zeros((1, NODES.size)), np.ones(1), np.full(FULL_SPEEDS.size, 1.0 / FULL_SPEEDS.size), np.zeros((2, _N, _Z)), np.tile(1e9 * np.eye(_N), (2, 1, 1)),
    np.ones(2), np.array([0.0, 1.0]), np.zeros((0, len(REAR), _Z + _N)), np.zeros((0, len(REAR), len(REAR))),
)  # fmt: skip


def regression(form, x, share, ridge=LEAST):
    """Coefficients of x on `form`, and covariance, by Student's law; `share` (n,): how much each window counts."""
    w, n = share, x.shape[1]
    for _ in range(6):
        fit = np.linalg.solve(form.T @ (w[:, None] * form) + ridge * np.eye(form.shape[1]), form.T @ (w[:, None] * x))
        left = x - form @ fit
        S = left.T @ (w[:, None] * left) / share.sum() + LEAST * np.eye(n)
        w = share * (TAIL + n) / (TAIL + np.einsum("ni,ij,nj->n", left, np.linalg.inv(S), left))
    return fit, S


def laws_of(x, z, where, share):
    """Mean by covariates and covariance at each node, where the log speed ratio (n,) is."""
    mean, scatter = np.empty((NODES.size, _N, _Z)), np.empty((NODES.size, _N, _N))
    for k, away in enumerate(where - NODES[:, None]):
        near = share * np.exp(-0.5 * (away / BANDWIDTH) ** 2)
        fit, scatter[k] = regression(np.column_stack([z, away]), x, near)
        mean[k] = fit[:_Z].T
    return mean, scatter


def _logs(left, S, share):
    """Log likelihood of each kind (kinds, n), less what all have in common, and squared distance from its mean."""
    square = np.einsum("kni,kij,knj->kn", left, np.linalg.inv(S), left)
    logs = np.log(share)[:, None] - 0.5 * np.linalg.slogdet(S)[1][:, None]
    return logs - 0.5 * (TAIL + _N) * np.log1p(square / TAIL), square


def _kinds(left, S, share):
    """Probability of each kind (kinds, n), and squared distance from its mean."""
    logs, square = _logs(left, S, share)
    return np.exp(logs - np.logaddexp.reduce(logs)), square


def kinds_of(x, z, rng, kinds=KINDS):
    """Means by covariates (the first is 1), covariances and shares of kinds of windows: a mixture of Student's laws."""
    mean = np.zeros((kinds, _N, _Z))
    mean[:, :, 0] = x[rng.choice(len(x), kinds, replace=False)]
    used = z.shape[1]
    S = np.tile(np.cov(x.T), (kinds, 1, 1))
    share = np.full(kinds, 1.0 / kinds)
    for _ in range(150):
        left = x - z @ mean[:, :, :used].transpose(0, 2, 1)
        r, square = _kinds(left, S, share)
        w = r * (TAIL + _N) / (TAIL + square)
        share = r.mean(axis=1)
        for k, form in enumerate(w[:, :, None] * z):
            mean[k, :, :used] = np.linalg.solve(form.T @ z + LEAST * np.eye(used), form.T @ x).T
        left = x - z @ mean[:, :, :used].transpose(0, 2, 1)
        S = np.einsum("kn,kni,knj->kij", w, left, left) / r.sum(axis=1)[:, None, None] + LEAST * np.eye(_N)
    return mean, S, share


def best_kinds_of(x, z, kinds, starts=6):
    """The likeliest of several mixtures: each depends on the windows that it starts from."""

    def fits(found):
        mean, S, share = found
        return float(np.logaddexp.reduce(_logs(x - z @ mean.transpose(0, 2, 1), S, share)[0]).sum())

    return max((kinds_of(x, z, np.random.default_rng(k), kinds) for k in range(starts)), key=fits)


def rear_of(x, z, rear, kinds):
    """Mean of what the rear axle shows by covariates and features, and covariance, of each kind of windows."""
    mean, S, share = kinds
    shares = _kinds(x - z @ mean.transpose(0, 2, 1), S, share)[0]
    fits, scatters = zip(*(regression(np.hstack([z, x]), rear, w, ridge=1.0) for w in shares), strict=True)
    return np.stack(fits).transpose(0, 2, 1), np.stack(scatters)


def _text(x):
    return f"{float(x):.4g}" if np.ndim(x) == 0 else "[" + ", ".join(_text(y) for y in x) + "]"


def text_of(found, note):
    """Lines of the file of emissions, by drivetrain."""
    yield f"# {note}"
    yield f"version = {emissions.VERSION}"
    for drivetrain, tables in found.items():
        yield f"\n[{drivetrain}]"
        for name, x in tables._asdict().items():
            yield f"{name} = {_text(x)}"


def inputs_of(columns, vehicle, dt):
    """What the filter takes of a drive."""
    columns = {s: x for s, x in columns.items() if not s.startswith("true_") and np.isfinite(x).any()}
    stream = FeatureStream(vehicle, dt, columns)
    f = stream.push(columns)
    known = {s: columns[s] for s in stream.available}
    return Reader(vehicle, dt).push(Scene(f, BrakeWatch(vehicle, dt).push(f, known), known))


def windows(columns, vehicle, dt, *wet):
    """Features and covariates (steps, 8), NaN where one is missing, of a drive; `wet` [s]: spans that are not dry."""
    inputs, p = inputs_of(columns, vehicle, dt), params(vehicle, dt)
    now, rows = Filter.new(p, NEUTRAL), []
    for k in range(inputs.v.size // p.block):
        at = slice(k * p.block, (k + 1) * p.block)
        is_wet = any(a - 0.1 <= k * p.dt < b + 1.0 for a, b in wet)
        now.kinds[:] = (0.0, 1.0) if is_wet else (1.0, 0.0)
        _, now = scan(p, NEUTRAL, now, Inputs(*(x[at] for x in inputs)))
        traction = np.nanmean(np.nansum(now.window[:, 6:10], axis=1)) * 0.5
        v = now.window[int(now.samples[1] - 1) % state.ROWS, 0]
        x = now.x[0] if (now.x[1, :_N] < 1.0).all() and v > p.v_least else np.full(_N + len(REAR), np.nan)
        with np.errstate(invalid="ignore"):
            rear = np.where(now.x[1, _N:] < 1.0, x[_N:], np.nan)
            rows.append((*x[:_N], 1.0, np.log(v / 30.0), np.arcsinh(traction / 0.02), *rear))
    return np.array(rows)


def of_passes(first, number, one_side=False):
    """Rows of drivetrain, kind of road (0 dry, 1 water, 2 its edge, `OTHER`), law of contact, log ratio, contact share,
    window."""
    for n in range(number):
        law = OF_TEN[n // 3 % 10] if one_side else n // 3 % len(LAWS)
        p = own_pass(first + n, DRIVETRAINS[n % 3], distance=DISTANCE, law=law, one_side=one_side)
        law = ONE_SIDE if one_side else law
        x = windows(p.columns, p.vehicle, p.dt, p.wet)
        contact = 0.5 * (p.columns["true_contact_fl"] + p.columns["true_contact_fr"])
        for road, times in ((1, WATER), (2, EDGE)):
            for k in (round((p.wet[0] + after) / 0.1) for after in times):
                if k < len(x):
                    here = contact[round((0.1 * k - 0.5) / p.dt) : round((0.1 * k + 0.1) / p.dt)].mean()
                    yield n % 3, road, law, np.log(p.v_full / 30.0) - x[k, _N + 1], here, *x[k]
        yield from ((n % 3, 0, law, np.nan, np.nan, *row) for row in x[40 : round(p.wet[0] / 0.1) - 2 : 20])


def of_drives(first, number):
    """The same of dry drives."""
    for name, seed in ((name, first + n) for n in range(number) for name in DRY):
        drawn = draw(name, seed, TUNING_POOL)
        signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
        x = windows({s: signals.array(s) for s in signals.symbols}, drawn.believed, signals.dt_ns * 1e-9)
        yield from ((DRIVETRAINS.index(drawn.believed.drivetrain), 0, 0, np.nan, np.nan, *row) for row in x[30::5])


def other_drive(seed, drivetrain, one_side=False):
    """Signals, the vehicle, and since when [s], of a minute partly on snow, ice or gravel of laws drawn far wider than
    sources have them. `one_side`: with asphalt under the other side."""
    rng = np.random.default_rng([seed, 80])
    pool = (SCORING_POOL, TUNING_POOL)[int(rng.integers(2))]
    car = next(c for c in pool.vehicles if c.drivetrain == drivetrain)
    tyre = pool.tyres[int(rng.integers(len(pool.tyres)))]
    k = Drawing(rng, pool, car, tyre, rng.uniform(1.8e5, 2.8e5), int(rng.integers(2**31)))
    compliance, mu = k.one_of(0.0, *[0.01 * 12.5 ** rng.uniform()] * 6), 0.06 * 12.0 ** rng.uniform()
    other = Surface("other", mu, compliance, 0.05 * rng.uniform() ** 2, k.between(0.0, 70.0))
    split = (other, SURFACES["asphalt"]), (SURFACES["asphalt"], other)
    left, right = k.one_of(*[(other, other)] * 6 * (not one_side), *split)
    start, v = k.one_of(0.0, k.between(10.0, 20.0)), k.between(42.0, 110.0) * KMH
    speed = k.cruise(60.0, v, spread=k.between(0.02, 0.15), a_most=0.4)
    drive = k.drive(60.0, speed, lanes=(Lane(start, 90.0, surface=left, surface_right=right),))
    believed = believed_vehicle(drive, rng)
    return as_signals(simulate(drive), vehicle=believed), believed, start or k.between(1.0, 4.0)


def of_others(first, number, one_side=False):
    """The same of minutes on other surfaces, where wheels grip: one that spins is no matter of the margin. `one_side`:
    spinning ones too, for there the rear axle shows what they spin on.
    """
    for n in range(number):
        # who starts on snow takes seconds of it for dry road
        signals, believed, start = other_drive(first + n, DRIVETRAINS[n % 3], one_side)
        x = windows({s: signals.array(s) for s in signals.symbols}, believed, signals.dt_ns * 1e-9, (start, 90.0))
        x = x[round(start / 0.1) + 5 :: 5]
        law = ONE_SIDE if one_side else 0
        few = x[one_side | ~(np.abs(x[:, 1:3]) > GRIPS).any(axis=1)]
        yield from ((n % 3, OTHER, law, np.nan, np.nan, *row) for row in few)


def prior(rng, n=4000):
    """How likely each full speed is before any evidence: of tyres, pressures and depths, by three laws that disagree."""
    ends = ((0.6e-3, 6e-3), (1.8e5, 2.9e5), (1e-3, 8e-3))  # [m, Pa, m] depth, pressure, tread
    drawn = np.array([low * (high / low) ** rng.uniform(size=n) for low, high in ends])
    load = np.array(4000.0)
    tyres = (replace(TYRES["worn_summer"], tread_depth=t) for t in drawn[2])
    laws = (
        [STOPS_AT * tyre.full_speed(h, load, p=p) for tyre, h, p in zip(tyres, drawn[0], drawn[1], strict=True)],
        [gallaway_speed(h, p, tread_depth=t, texture_depth=0.8e-3) for h, p, t in drawn.T],
        usf_speed(drawn[0], drawn[1], load),
    )
    away = np.log(FULL_SPEEDS[:, None] / np.concatenate(laws)) / LAW_SD
    found = np.exp(-0.5 * away * away).mean(axis=1)
    return found / found.sum()


def of_law(rows):
    """Mean, covariance, contact share and log of the share at each distance, of windows of one law of contact: of front
    wheels that slip ahead of the rear ones, then of those that slip behind."""
    ratio, x = rows[:, 3], rows[:, 5:]
    near = np.exp(-0.5 * ((ratio - NODES[:, None]) / BANDWIDTH) ** 2)
    # far away the mean of few tyres wavers; contact only grows with distance
    contact = np.maximum.accumulate(near @ rows[:, 4] / near.sum(axis=1))
    for sign in (1.0, -1.0):
        share = 1.0 / (1.0 + np.exp(-sign * SHARP * x[:, 1]))  # a small slip may be either
        ways = np.log(near @ share / near.sum(axis=1))
        yield *laws_of(x[:, :_N], x[:, _N:], ratio, share), contact, ways


def steady_passes(first, number):
    """Rows of drivetrain, log ratio and window of cars that stay in the water: by then they drive against it."""
    for n in range(number):
        d = n % 3
        p = own_pass(first + n, DRIVETRAINS[d], distance=DISTANCE, law=n // 3 % len(LAWS), stay=LONG)
        x = windows(p.columns, p.vehicle, p.dt, p.wet)
        for k in (round((p.wet[0] + after) / 0.1) for after in STEADY):
            if k < len(x):
                yield d, np.log(p.v_full / 30.0) - x[k, _N + 1], *x[k]


def with_steady(t, rows):
    """Emissions with wet kinds whose slips follow the traction, as likely in all as those that do not, from `rows`."""
    rows = rows[np.isfinite(rows[:, 2 : 2 + _N + _Z]).all(axis=1)]
    x = rows[rows[:, 1] < WET, 2:]
    own, first = np.flatnonzero(t.road == 1.0)[:KINDS], 2 * KINDS
    *new, share = best_kinds_of(x[:, :_N], x[:, _N : _N + _Z], KINDS_STEADY)
    rest = t.road.size - 2 * KINDS_ONE - KINDS  # other surfaces, and those under one side, are the last
    whole = (1.0 - SHARE_ONE) / 2.0
    prior = np.concatenate([t.kind_prior[own] * whole / t.kind_prior[own].sum(), share * whole])
    tables = {n: np.concatenate([a[:first], b, a[rest:]]) for n, a, b in (
        ("kind_mean", t.kind_mean, new[0]), ("kind_scatter", t.kind_scatter, new[1]), ("road", t.road, np.ones(share.size)),
    )}  # fmt: skip
    return t._replace(**tables, kind_prior=np.concatenate([t.kind_prior[:KINDS], prior, t.kind_prior[rest:]]))


def learn(found, kept=()):
    """Emissions by drivetrain from rows of windows; `kept` of the file at hand: "distances" and "roads".

    Distances, and kinds of water under one side, stay together.
    """
    found = found[np.isfinite(found[:, 5 : 5 + _N + _Z]).all(axis=1)]
    before, tables = prior(np.random.default_rng(5)), {}
    shares = 0.5 * np.repeat([*((1.0 - SHARE_ONE) * np.array(SHARES)), SHARE_ONE], 2)
    for d, drivetrain in enumerate(DRIVETRAINS):
        own = found[found[:, 0] == d]
        road, law, ratio, x = own[:, 1], own[:, 2], own[:, 3], own[:, 5:]
        file, rng = emissions.emissions_of(drivetrain), np.random.default_rng(1)
        is_wet = (road > 0) & (road < OTHER) & (ratio < WET)
        # what slips on snow slips in proportion to the traction; means of water that did so warned on a measured road
        roads = ((road == 0, 1), (is_wet & (law != ONE_SIDE), 1), ((road == OTHER) & (law != ONE_SIDE), _Z))
        water, snow = is_wet & (law == ONE_SIDE), (road == OTHER) & (law == ONE_SIDE)
        distances = zip(*file[:4], strict=True) if "distances" in kept else (
            way for k in range(len(LAWS) + 1) for way in of_law(own[(road == 1) & (law == k)])
        )  # fmt: skip
        # wet kinds by the traction are learnt by themselves
        both = file.road.size - 2 * KINDS_ONE if "roads" in kept else 3 * KINDS
        of_water, of_snow = slice(-2 * KINDS_ONE, -KINDS_ONE), slice(-KINDS_ONE, None)
        m, S, share = (np.concatenate(k) for k in zip(
            *([[t[:both] for t in file[6:9]]] if "roads" in kept else
              [kinds_of(x[some, :_N], x[some, _N : _N + used], rng) for some, used in roads]),
            [t[of_water] for t in file[6:9]] if "distances" in kept else
            kinds_of(x[water, :_N], x[water, _N : _N + 1], rng, KINDS_ONE),
            kinds_of(x[snow, :_N], x[snow, _N : _N + _Z], rng, KINDS_ONE), strict=True,
        ))  # fmt: skip
        known = np.isfinite(x).all(axis=1)
        rear = zip(*(
            rear_of(*np.split(x[some & known], (_N, _N + _Z), axis=1), (m[k], S[k], share[k]))
            for some, k in ((water, of_water), (snow, of_snow))
        ), strict=True)  # fmt: skip
        of = np.repeat([0.0, 1.0, 2.0, 1.0, 3.0], [KINDS, both - 2 * KINDS, KINDS, *[KINDS_ONE] * 2])
        is_one = np.arange(of.size) >= both
        for some, whole in (((of == 1.0) & ~is_one, 1.0 - SHARE_ONE), ((of == 1.0) & is_one, SHARE_ONE)):
            share[some] *= whole / share[some].sum()
        by_law = (np.array(each) for each in zip(*distances, strict=True))
        tables[drivetrain] = Emissions(*by_law, shares, before, m, S, share, of, *map(np.concatenate, rear))
    return tables, len(found)


def write(tables, of_what):
    """Write the file of emissions."""
    target = Path(emissions.__file__).with_name("emissions.toml")
    lines = text_of(tables, f"Made by `python -m tests.margin.learn` from {of_what}.")
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (
        ("passes", 5400),
        ("one-side", 4500),
        ("drives", 24),
        ("others", 600),
        ("steady", 0),
        ("first", 100_000),
    ):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--keep", type=Path, default=Path("windows.npz"), help="file of windows, taken where it exists")
    parser.add_argument("--same-roads", action="store_true", help="learn distances, and keep the file's kinds of road")
    a = parser.parse_args()
    if a.steady:
        rows = np.array([*steady_passes(a.first, a.steady)])
        tables = {d: emissions.emissions_of(d) for d in DRIVETRAINS}
        # of all-wheel drive, where both axles slip alike, they are too near to a tyre that loses its air
        tables |= {d: with_steady(tables[d], rows[rows[:, 0] == k]) for k, d in enumerate(DRIVETRAINS[:2])}
        write(tables, f"{len(rows):,} windows, all but wet kinds by the traction of before")
        return
    kept = ("roads",) * (a.same_roads or not a.passes) + ("distances",) * (not a.passes)
    if not a.keep.exists():
        roads = () if kept else (*of_drives(a.first, a.drives), *of_others(a.first, a.others))
        wet = *of_passes(a.first, a.passes), *of_passes(a.first, a.one_side, one_side=True)
        np.savez(a.keep, x=np.array((*wet, *roads, *of_others(a.first, a.others, one_side=True))))
    tables, n = learn(np.load(a.keep)["x"], kept)
    before = f", {' and '.join(kept)} of before" if kept else ""
    write(tables, f"{n:,} windows{before}")


if __name__ == "__main__":
    main()
