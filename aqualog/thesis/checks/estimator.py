"""Rules of the slip-slope estimator: each checked under noise, with the rule and without it."""

from __future__ import annotations

import numpy as np

from aqualog.core.intervals import wilson
from aqualog.detect import cusum
from aqualog.detect.slip_slope import activation
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.physics.tyre_brush import brush_force
from aqualog.thesis.claims import Check, judge
from aqualog.thesis.evidence import half_car
from aqualog.thesis.evidence.seeds import Maker, Plan, bootstrap, ratio_of_counts, share

__all__ = ["CHECKS"]


def _linear_tyre(plan: Plan) -> Check:
    """Error of the line of 3.14 on the brush, and the purpose of its offset."""
    mu = np.linspace(-0.2, 0.2, 401)
    s = np.linspace(-0.03, 0.03, 20001)
    force = brush_force(s, np.ones(1), mu=1.0, C_s=half_car.HIGH_SLOPE)
    slip = np.interp(mu, force, s)
    line = np.linalg.lstsq(np.column_stack([mu, np.ones_like(mu)]), slip, rcond=None)[0]
    left = float(np.abs(slip - line[0] * mu - line[1]).max())
    rng = np.random.default_rng(plan.seeds[0])
    errors: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(len(plan.seeds)):
        x = rng.uniform(0.02, 0.15, 200)
        y = x / half_car.HIGH_SLOPE + rng.normal(0.0, 3e-3) + half_car.ROAD_NOISE * rng.standard_normal(200)
        for free in (True, False):
            design = np.column_stack([x, np.ones(200)]) if free else x[:, None]
            errors[free].append(1.0 / float(np.linalg.lstsq(design, y, rcond=None)[0][0]) / half_car.HIGH_SLOPE - 1.0)
    spread = {free: 0.5 * float(np.subtract(*np.quantile(e, [0.84, 0.16]))) for free, e in errors.items()}
    fits = left < half_car.ROAD_NOISE
    whole = fits and spread[True] < 0.1 < spread[False]
    outcome = (
        f"at most {left:.1e} of slip left; slope within {100 * spread[True]:.1f} % with the offset, "
        f"{100 * spread[False]:.0f} % without ({len(plan.seeds)} runs of 200 points)"
    )
    ci95 = bootstrap(errors[True], lambda e: 0.5 * float(np.subtract(*np.quantile(e, [0.84, 0.16]))))
    return judge("C83.half_car", outcome, whole=whole, part=fits, value=spread[True], ci95=ci95)


def _common_drop(plan: Plan) -> Check:
    """C85: purpose of a slow ratio, shown with a ratio as fast as the slope."""
    found: dict[str, list[tuple[float, float, float]]] = {"slow": [], "fast": []}
    # as free as the slope: neither slowed by its process noise nor held where the data do not determine it
    fast = TUNING._replace(q_beta=1e-4, sd_beta=0.3, told_beta=np.inf)
    d = half_car.drive(half_car.Case("sine", 0.05, "mu", 4.0, a_x=0.3, nu=0.3, low_mu=1.0))
    s_delta, mu_i, rho_mu_j = half_car.inputs(d)
    true_beta = 1.0
    seeds = plan.first(40)
    for seed in seeds:
        y = s_delta + half_car.noise(np.random.default_rng([seed, 85]), d.t.size)
        for name, tuning in (("slow", TUNING), ("fast", fast)):
            e = half_car.estimated(tuning, y, mu_i, rho_mu_j)
            late = d.t > 4.0
            off = float(np.abs(e.beta - true_beta)[late].max())
            found[name].append((half_car.first_alarm(d, e), off, float(np.median(e.slope[late]))))
    table = {n: np.array(rows) for n, rows in found.items()}
    right = {n: int(np.sum(np.abs(x[:, 2] / half_car.LOW_SLOPE - 1.0) < 0.15)) for n, x in table.items()}
    soon = int(np.sum(table["slow"][:, 0] < 4.0))
    moved = {n: float(np.median(x[:, 1])) for n, x in table.items()}
    n = len(seeds)
    whole = soon >= 0.95 * n and right["slow"] >= 0.95 * n and moved["slow"] < 0.5 * moved["fast"]
    outcome = (
        f"found within 4 s in {share(soon, n)}, slope right in {share(right['slow'], n)} ({right['fast']} with "
        f"the fast ratio); ratio off by {moved['slow']:.3f} (slow) and {moved['fast']:.3f} (fast)"
    )
    part = soon >= 0.95 * n and right["slow"] >= 0.95 * n
    return judge("C85.half_car", outcome, whole=whole, part=part, value=soon / n, ci95=wilson(soon, n))


def _change_detection(plan: Plan) -> Check:
    """C89: identity of the sums, and purpose of the detection, shown without it."""
    rng = np.random.default_rng(plan.seeds[0])
    nu = rng.normal(0.0, 2e-3, 3000) + np.where(np.arange(3000) > 1500, 3e-3, -2e-3)
    p = cusum.CusumParams(1e-3, np.inf, np.inf, half_car.DT)
    worst = 0.0
    for sign in (1.0, -1.0):
        # clamped sum as the rise of the walk above its running minimum
        walk = np.concatenate([[0.0], np.cumsum((sign * nu - 1e-3) * half_car.DT)])
        rise = (walk - np.minimum.accumulate(walk))[1:]
        worst = max(worst, float(np.abs(cusum.scan(p, cusum.initial_state(), sign * nu)[0] - rise).max()))
    d = half_car.drive(half_car.Case("sine", 0.05, "mu", 4.0, a_x=0.3, nu=0.3, low_mu=1.0))
    s_delta, mu_i, rho_mu_j = half_car.inputs(d)
    seeds = plan.first(40)
    settled: dict[str, list[float]] = {"with": [], "without": []}
    for seed in seeds:
        y = s_delta + half_car.noise(np.random.default_rng([seed, 89]), d.t.size)
        for name, tuning in (("with", TUNING), ("without", TUNING._replace(h=1e9))):
            e = half_car.estimated(tuning, y, mu_i, rho_mu_j)
            near = np.abs(e.slope / half_car.LOW_SLOPE - 1.0) < 0.2
            after = np.flatnonzero(~near & (d.t > 0.0))
            settled[name].append(float(d.t[min(after[-1] + 1, d.t.size - 1)]) if after.size else 0.0)
    t = {n: float(np.median(x)) for n, x in settled.items()}
    right = worst < 1e-12 and t["with"] < 0.5 * t["without"]
    outcome = (
        f"largest deviation {worst:.1e} over 6000 samples; settled after {t['with']:.1f} s with, "
        f"{t['without']:.1f} s without (median of {len(seeds)} runs, {d.t[-1]:.0f} s at most)"
    )
    both = np.array([settled["with"], settled["without"]]).T
    ci95 = bootstrap(both, lambda x: float(np.median(x[:, 0]) / np.median(x[:, 1])))
    return judge("C89.half_car", outcome, whole=False, part=right, value=t["with"] / t["without"], ci95=ci95)


def _activation(plan: Plan) -> Check:
    """C91: purpose of the gates, shown without them: a spinning wheel, hard traction, braking, standing still."""
    seeds = plan.first(60)
    wrong = {"with": 0, "without": 0}
    off: dict[str, list[float]] = {"with": [], "without": []}
    n = 6000
    t = np.arange(n) * half_car.DT
    for seed in seeds:
        rng = np.random.default_rng([seed, 91])
        mu = 0.08 * np.sin(2.0 * np.pi * t / rng.uniform(3.0, 8.0)) + 0.02
        v, a = np.full(n, 22.0), np.zeros(n)
        braking, spins = np.zeros(n, dtype=bool), np.zeros(n)
        hard, brake, spin, slow = rng.permutation([12.0, 24.0, 36.0, 48.0])
        is_hard, braking, is_spin, is_slow = ((t >= t0) & (t < t0 + 3.0) for t0 in (hard, brake, spin, slow))
        mu = np.where(is_hard, 0.55, np.where(braking, -0.5, np.where(is_spin, 0.05, mu)))
        a = np.where(is_hard, 4.5, np.where(braking, -4.5, 0.0))
        v = np.where(is_slow, 3.0, v)
        spins = np.where(is_spin, 15.0, 0.0)
        # the brush's slip, water-thin ice for the spin, a tooth of the pick-up at walking pace
        slip = 3.0 / half_car.HIGH_SLOPE * np.sign(mu) * (1.0 - np.cbrt(1.0 - np.abs(mu)))
        y = slip + np.where(is_spin, 0.2, 0.0) + half_car.noise(rng, n) * np.where(is_slow, 20.0, 1.0)
        reason = activation.inactive_reason(
            v_x=v, a_x=a, a_y=np.zeros(n), yaw_rate=np.zeros(n), a_w_delta=spins, is_braking=braking
        )
        open_ = TUNING._replace(mu_min=0.0, mu_max=1.0, s_max=1.0)
        for name, tuning, active in (("with", TUNING, reason == 0), ("without", open_, np.ones(n, dtype=np.bool_))):
            e = half_car.estimated(tuning, y, mu, np.zeros(n), active=active)
            wrong[name] += int(np.count_nonzero(e.alarm))
            calm = reason == 0
            off[name].append(float(np.sqrt(np.mean((e.slope[calm] / half_car.HIGH_SLOPE - 1.0) ** 2))))
    rms = {k: float(np.median(v)) for k, v in off.items()}
    whole = wrong["with"] <= 0.1 * wrong["without"] and wrong["without"] > 0 and rms["with"] < 0.5 * rms["without"]
    outcome = (
        f"{wrong['with']} changes reported with the gates, {wrong['without']} without, in {len(seeds)} drives of "
        f"60 s in which nothing changed; rms error of the slope {100 * rms['with']:.1f} and "
        f"{100 * rms['without']:.0f} % (medians)"
    )
    ci95 = ratio_of_counts(wrong["with"], wrong["without"])
    part, value = (
        wrong["with"] < wrong["without"] and rms["with"] < rms["without"],
        wrong["with"] / max(wrong["without"], 1),
    )
    return judge("C91.half_car", outcome, whole=whole, part=part, value=value, ci95=ci95)


def _slow_and_sudden(plan: Plan) -> Check:
    """C115: radii and slope ratio that drift slowly raise nothing; a sudden drop does."""
    seeds = plan.first(40)
    n, minutes = 60_000, 10.0
    t = np.arange(n) * half_car.DT
    alarms = {"drift": 0, "sudden": 0}
    worst, delays = [], []
    for seed in seeds:
        rng = np.random.default_rng([seed, 115])
        mu_F = 0.05 * np.sin(2.0 * np.pi * t / 8.0) + rng.uniform(0.01, 0.05)
        mu_R = -0.05 * np.sin(2.0 * np.pi * t / 8.0) + rng.uniform(0.01, 0.05)
        radius = rng.choice([-1.0, 1.0]) * 3e-3 * t / (60.0 * minutes)  # 0.3 % in ten minutes
        ratio = 1.0 + rng.choice([-1.0, 1.0]) * 0.05 * t / (60.0 * minutes)
        blur = half_car.noise(rng, n)
        at = 60.0 * minutes - 20.0
        for name in alarms:
            C = np.where((t > at) & (name == "sudden"), half_car.LOW_SLOPE, half_car.HIGH_SLOPE)
            y = mu_F / C - mu_R / (C * ratio) + radius + blur
            e = half_car.estimated(TUNING, y, mu_F, mu_R)
            before = int(np.count_nonzero(e.alarm[t <= at]))
            if name == "drift":
                alarms[name] += int(np.count_nonzero(e.alarm) > 0)
                worst.append(float(np.abs(e.slope[2000:] / half_car.HIGH_SLOPE - 1.0).max()))
            else:
                found = t[(e.alarm > 0.0) & (t > at)] - at
                alarms[name] += int(found.size > 0 and found[0] < 5.0 and before == 0)
                delays.append(float(found[0]) if found.size else np.inf)
    m = len(seeds)
    whole = alarms["drift"] == 0 and alarms["sudden"] >= 0.95 * m
    outcome = (
        f"drift alone: alarms in {share(alarms['drift'], m)}, slope off by at most {100 * max(worst):.0f} %; "
        f"drop found in {share(alarms['sudden'], m)}, after {np.median(delays):.1f} s (median)"
    )
    ci95 = wilson(alarms["sudden"], m)
    part = alarms["drift"] <= 0.05 * m and alarms["sudden"] >= 0.8 * m
    return judge("C115.half_car", outcome, whole=whole, part=part, value=alarms["sudden"] / m, ci95=ci95)


CHECKS = (
    Maker(("C83",), _linear_tyre),
    Maker(("C85",), _common_drop),
    Maker(("C89",), _change_detection),
    Maker(("C91",), _activation),
    Maker(("C115",), _slow_and_sudden),
)
