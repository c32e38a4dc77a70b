"""What an engineer writes in an afternoon: `python -m tests.bench.script LOG` prints spin-downs and resistance as JSON.

asammdf's frame, NumPy for features, pandas for low-passes, plain loops for the sums. The peer of `aqualog detect`: its
thresholds, not its code. It takes names, units and an even raster for granted, needs a velocity reference, learns no
radii while driving, takes one offset of the resistance for the whole drive, and knows of no other detector.
"""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import asammdf
import numpy as np
import pandas as pd

DT = 0.01
G = 9.80665
WHEELS = {"fl": ("f", 0.5), "fr": ("f", -0.5), "rl": ("r", 0.5), "rr": ("r", -0.5)}


def lowpass(x, tau):
    return pd.Series(x).ewm(alpha=1.0 - np.exp(-DT / tau), adjust=False).mean().to_numpy()


def spin_down(a, dv, v):
    """Sum of the deceleration beyond 3 m/s^2; the speed difference opens the gate and resets."""
    g, active, held = 0.0, False, []
    for a_i, dv_i, v_i in zip((-a).tolist(), (-dv).tolist(), v.tolist(), strict=True):
        limit = max(0.5, 0.03 * v_i)
        g = min(3.0, max(0.0, g + (a_i - 3.0) * DT))
        if dv_i < -0.25 * limit or v_i < 5.0:
            g = 0.0
        if active:
            if dv_i < 0.5 * limit:
                active, g = False, 0.0
        elif dv_i > limit and g > 0.6:
            active = True
        held.append(max(g, 1e-9) if active else 0.0)
    return np.array(held)


def resistance(x):
    """Sum of the resistance beyond 0.1 m/s^2; on above 0.2 m/s, off below 0.1."""
    g, active, held = 0.0, False, []
    for x_i in x.tolist():
        g = min(0.3, max(0.0, g + (x_i - 0.1) * DT))
        active = g > (0.1 if active else 0.2)
        held.append(max(g, 1e-9) if active else 0.0)
    return np.array(held)


def events(held, detector, wheel):
    edges = np.flatnonzero(np.diff(np.r_[False, held > 0.0, False].astype(int))).reshape(-1, 2).tolist()
    found = [{"start_s": a * DT, "end_s": b * DT, "peak": float(held[a:b].max())} for a, b in edges]
    return [{"detector": detector, "wheel": wheel, **x} for x in found]


def detect(path: Path, car: dict[str, Any]) -> list[dict[str, Any]]:
    with asammdf.MDF(path) as log:
        frame = log.to_dataframe().ffill().bfill()  # what starts late or is missing keeps its neighbour
    s = {n: frame[n].to_numpy() for n in frame.columns}
    tyres, v, yaw = car["wheels"], s["v_x"], lowpass(s["yaw_rate"], 0.05)
    a_ref = lowpass(np.gradient(lowpass(v, 0.1), DT), 0.03)
    found = []
    omega_dot = {}
    for wheel, (axle, side) in WHEELS.items():
        steer = s["steer_angle"] if axle == "f" else 0.0
        rim = s[f"omega_{wheel}"] * tyres[f"r_e_{axle}"]
        w = (rim - yaw * (car["l_f"] + car["l_r"]) * np.sin(steer)) / np.cos(steer) + yaw * side * car["track"]
        w = w * np.median(v / w)
        a_w = np.gradient(lowpass(w, 0.03), DT)
        omega_dot[wheel] = a_w / tyres[f"r_e_{axle}"]
        found += events(spin_down(a_w - a_ref, w - v, v), "spin_down", wheel)
    middle = np.sort(list(omega_dot.values()), axis=0)[1:3].mean(axis=0)
    force = -0.5 * car["drag_area"] * car["air_density"] * v**2 - car["rolling_resistance"] * car["mass"] * G
    for wheel, (axle, _) in WHEELS.items():
        spinning = np.maximum(omega_dot[wheel], middle)
        force = force + (s[f"torque_{wheel}"] - tyres[f"inertia_{axle}"] * spinning) / tyres[f"r_l_{axle}"]
    delta = force / car["mass"] - s["a_x"]
    delta -= np.median(delta)
    delta = np.where(v > 14.0, np.clip(delta, -0.8, 0.8), 0.0)
    delta = np.where(s["brake_pressure"] > 3e5, -0.8, delta)
    return found + events(resistance(delta), "resistance", None)


if __name__ == "__main__":
    json.dump(detect(Path(sys.argv[1]), tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))), sys.stdout)
