"""Simulated drives as logs of any length: 15 signals at 100 Hz, noise and delays of series sensors, watered lanes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from aqualog.core.records import FloatArray
from tests.bench.child import ROOT

__all__ = ["CAR", "SIGNALS", "drive", "many_logs", "one_log"]

CAR = ROOT / "sample_logs" / "vehicle.toml"
RATE = 100.0
SIGNALS = (
    "v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "omega_fl", "omega_fr", "omega_rl", "omega_rr", "torque_fl",
    "torque_fr", "torque_rl", "torque_rr", "brake_pressure", "on_water",
)  # fmt: skip
PERIOD_S = 300.0  # longer logs repeat a drive of this length
PIECE_H = 10.0  # [h] that are held in memory at once while a log is made
DISTINCT = 10


@cache
def drive(seconds: float, seed: int = 1) -> Mapping[str, FloatArray]:
    """Signals (n,) of a simulated drive at 102 km/h; a lane of 8 s with 1.0 and 1.3 mm of water every minute."""
    from aqualog.config.vehicle import load_vehicle
    from aqualog.model.log import table_of
    from aqualog.model.scenario import Lane, Scenario
    from aqualog.model.simulate import simulate

    starts = np.arange(min(30.0, 0.4 * seconds), seconds - 1.0, 60.0)
    scenario = Scenario(
        load_vehicle(CAR), duration_s=seconds, rate_hz=RATE, seed=seed, p_front=1.9e5, p_rear=1.9e5,
        speed=((0.0, 102.0 / 3.6),),
        lanes=tuple(Lane(s, s + 8.0, depth_left=1.0e-3, depth_right=1.3e-3, irregularity_left=0.3) for s in starts),
    )  # fmt: skip
    columns = {n: x for g in table_of(simulate(scenario)) for n, (_, _, x) in g.columns.items()}
    return {n: columns[n] for n in SIGNALS}


def one_log(path: Path, seconds: float) -> Path:
    """A log of that length, transposed and deflated as aqualog writes MF4."""
    from aqualog.core.notation import SYMBOLS
    from aqualog.io.write_log import LogGroup, write_log

    n = round(seconds * RATE)
    columns = drive(min(seconds, PERIOD_S))
    if seconds > 3600.0 * PIECE_H:
        return _in_pieces(path, columns, n)
    group = LogGroup("drive", {k: (SYMBOLS[k].unit, SYMBOLS[k].meaning, np.resize(x, n)) for k, x in columns.items()})
    write_log(path, np.arange(n) * round(1e9 / RATE), [group], suffix=path.suffix, start_ns=None)
    return path


def _in_pieces(path: Path, columns: Mapping[str, FloatArray], n: int) -> Path:
    """The same with asammdf, which can take a file up piece by piece; `write_log` holds it as a whole."""
    import asammdf

    from aqualog.core.notation import SYMBOLS

    period = next(iter(columns.values())).size
    piece = period * max(1, round(PIECE_H * 3600.0 * RATE / period))
    out = asammdf.MDF(version="4.10")
    for begin in range(0, n, piece):
        size = min(piece, n - begin)
        t = (begin + np.arange(size)) / RATE
        found = {k: np.resize(x, size) for k, x in columns.items()}
        if begin:
            out.extend(0, [(t, None), *((x, None) for x in found.values())])
        else:
            signals = [asammdf.Signal(x, t, name=k, unit=SYMBOLS[k].unit) for k, x in found.items()]
            out.append(signals, common_timebase=True)
    out.save(path, compression=2, overwrite=True)
    out.close()
    return path


def many_logs(folder: Path, count: int, seconds: float) -> Path:
    """A folder of short logs. Names count where results are kept, so a few distinct drives serve under many names."""
    folder.mkdir()
    made: list[Path] = []
    for i in range(count):
        path = folder / f"log_{i:05d}.mf4"
        if i < DISTINCT:
            made.append(_short(path, seconds, seed=i + 1))
        else:
            os.link(made[i % DISTINCT], path)
    return folder


def _short(path: Path, seconds: float, seed: int) -> Path:
    from aqualog.core.notation import SYMBOLS
    from aqualog.io.write_log import LogGroup, write_log

    columns = drive(seconds, seed)
    group = LogGroup("drive", {k: (SYMBOLS[k].unit, SYMBOLS[k].meaning, x) for k, x in columns.items()})
    n = next(iter(columns.values())).size
    write_log(path, np.arange(n) * round(1e9 / RATE), [group], suffix=".mf4", start_ns=None)
    return path
