"""Drives made up for tests of the page: everything that a result can hold, at any length."""

from dataclasses import replace

import numpy as np
import polars as pl

from aqualog.core.notation import WHEELS, side_of
from aqualog.core.records import DriveResult, Event, Origin, Quality, Signals, TimeFaults, Track, Unavailable
from aqualog.detect.verdict import judge

SPIKE = 0.371  # [m/s] an outlier of one sample


def _bump(t, start, end, depth):
    inside = (t >= start) & (t < end)
    return np.where(inside, depth * np.sin(np.pi * (t - start) / (end - start)) ** 2, 0.0)


def _speeds(t, rng, water):
    v_x = 26.0 + 4.0 * np.sin(2 * np.pi * t / 60.0) + np.cumsum(rng.normal(0.0, 2e-3, t.size))
    noise = {w: rng.normal(0.0, 0.03, t.size) for w in WHEELS}
    for a, b in water:
        noise["fl"] -= _bump(t, a + 1.0, a + 2.5, 9.0)
        for k in range(5):
            noise["fr"] -= _bump(t, a + 0.4 + 0.9 * k, a + 0.75 + 0.9 * k, 1.2)
        noise["rr"] += _bump(t, b - 1.5, b - 0.6, 2.4)
    return v_x, noise


def make_result(duration_s=30.0, rate_hz=100.0, *, every_s=300.0, seed=1):
    """A drive over a watered lane every `every_s`, with gaps, a one-sample bit and detectors without signals."""
    rng = np.random.default_rng(seed)
    dt = 1.0 / rate_hz
    n = round(duration_s * rate_hz)
    t = np.arange(n) * dt
    water = [(a + 8.0, a + 14.0) for a in np.arange(0.0, duration_s - 14.0, every_s)]
    on_water = np.zeros(n)
    for a, b in water:
        on_water[(t >= a) & (t < b)] = 1.0
    v_x, delta = _speeds(t, rng, water)
    gap = (t >= 20.0) & (t < 21.2)
    features = {"v_x_hat": v_x}
    for w in WHEELS:
        d = np.where(gap & (w in ("rl", "rr")), np.nan, delta[w])
        features |= {f"v_w_{w}": v_x + d, f"v_w_delta_{w}": d, f"a_w_delta_{w}": np.gradient(d, dt)}
    delta_a_x = rng.normal(0.0, 0.06, n) + 0.45 * on_water
    features["delta_a_x"] = delta_a_x
    tracks = _tracks(t, features, on_water, n)
    origins = {
        s: Origin(s, f"ESP_19.{s}", "drive.mf4", "km/h", rate_hz, n, missing_fraction=float(gap.mean()))
        for s in ("v_x", *(f"omega_{w}" for w in WHEELS), "a_x")
    }
    origins["a_x"] = replace(origins["a_x"], out_of_range=3, faults=TimeFaults(duplicates=2, pauses=1))
    frame = pl.DataFrame(
        {
            "t": t, "v_x": v_x, **{f"omega_{w}": features[f"v_w_{w}"] / 0.317 for w in WHEELS},
            "a_x": np.gradient(v_x, dt), "on_water": on_water, "water_depth_left": 1.1e-3 * on_water,
            "water_depth_right": 1.4e-3 * on_water,
        }
    )  # fmt: skip
    quality = Quality(
        dropped_samples=5, time_jumps=1, faults=TimeFaults(2, 0, 0, 0, 1), notes=("a_x: 3 samples out of range",)
    )
    signals = Signals(frame, round(1e9 / rate_hz), 1_700_000_000 * 10**9, origins, quality, ("drive.mf4",))
    result = DriveResult(
        signals, pl.DataFrame(features), tuple(tracks), tuple(_events(tracks, t, features)),
        (Unavailable("slip_slope_drop", ("torque_rl",)), Unavailable("tie_rod", ("tie_rod_fl", "tie_rod_fr"))),
        (Unavailable("spin_up", ("torque_rl", "torque_rr")),), "sedan RWD",
    )  # fmt: skip
    return judged(result)


def judged(result, *, can_judge=True):
    """The same result with the verdict that follows from its events."""
    ran = dict.fromkeys(t.detector for t in result.tracks) if can_judge else {"spin_down": 0}
    lacks = () if can_judge else (Unavailable("joint_cusum", ("torque_rl", "vehicle.mass")),)
    judgement = judge(
        result.events, (*result.unavailable, *lacks), list(ran), judged_s=result.signals.duration_s if can_judge else 0.0,
        way=lambda a, b: (26.0 * (b - a), b - a),
    )  # fmt: skip
    return replace(result, judgement=judgement)


def with_events(result, events, **how):
    """The same drive with other events."""
    return judged(replace(result, events=tuple(events)), **how)


def _tracks(t, features, on_water, n):
    tracks = []
    for w in WHEELS:
        d = features[f"v_w_delta_{w}"]
        tracks.append(Track("spin_down", w, side_of(w), "m/s", np.maximum(-d - 0.8, 0.0), 0.6, np.nan_to_num(d) < -1.6))
    for w in ("fl", "fr"):
        a = np.nan_to_num(features[f"a_w_delta_{w}"])
        variance = np.convolve(a**2, np.full(50, 0.02), "same") - 18.0
        tracks.append(Track("minor_spin_down", w, side_of(w), "(m/s^2)^2", variance, 5.0, variance > 5.0))
    for w in ("rl", "rr"):
        d = features[f"v_w_delta_{w}"]
        tracks.append(Track("spin_up", w, side_of(w), "m/s", np.maximum(d - 0.3, 0.0), 0.6, np.nan_to_num(d) > 0.9))
    active = np.convolve(on_water, np.full(80, 1 / 80), "same") > 0.7
    tracks.append(Track("resistance", None, None, "m/s", 0.5 * on_water, 0.2, active))
    count = sum(x.active.astype(float) for x in tracks[:8])
    tracks.append(Track("joint_criteria", None, None, "-", np.minimum(count, 3.0), 1.0, (count > 0) & (on_water > 0)))
    if n > 2800:
        tracks[2].active[2800] = True  # a detection of a single sample
        features["a_w_delta_rl"][1700] = SPIKE * 1000
    return tracks


def _events(tracks, t, features):
    dt = t[1] - t[0]
    for track in tracks:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], track.active, [False]]).astype(int)))
        for a, b in edges.reshape(-1, 2):
            evidence = {"v_x": float(features["v_x_hat"][a])}
            if track.wheel:
                slip = features[f"v_w_delta_{track.wheel}"][a:b] / features["v_x_hat"][a:b]
                evidence |= {"slip_min": float(np.nanmin(slip)), "braking": False}
            if track.detector == "joint_criteria":
                evidence |= {"criterion_1": True, "criterion_5": True, "full": False, "delta_a_x_max": 0.53}
            severity = "full" if evidence.get("slip_min", 0.0) < -0.25 else "partial"
            peak = float(np.nanmax(track.statistic[a:b]))
            yield Event(
                track.detector, track.wheel, track.side, float(a * dt), float(b * dt), severity, peak, track.threshold,
                evidence,
            )  # fmt: skip
