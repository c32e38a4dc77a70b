"""Measured drives as columns of canonical signals on one grid, with the car's file.

- `bmw`: BMW i3, 10 Hz: velocity, accelerometer, motor torque times the reduction (rear axle). No wheel speeds; friction
  brakes are not logged.
- `porsche`: Porsche 981 GT4 on a track, 10 Hz: all wheels, accelerometers, yaw rate, steering, GPS velocity moved onto the
  clock of the wheels. The wheel torque is derived: torque of the engine's controller less its losses, times the ratio of
  engine and rear wheel speed; that of the brakes is `BRAKE` times the pressure, 60 % in front, a fit to this same log.
- `rav4`: Toyota RAV4, 60 s of motorway: all wheels, accelerometer, yaw rate, steering, GNSS velocity moved onto the wheels'
  clock. No torque.

The car files: two for the BMW, each calibrated by `aqualog calibrate --fix mass=1375 --accept` on four other trips than it
is used for. The only logs of the Porsche and the RAV4 are those that are diagnosed: their files are fitted to the same
log, as their heads say, which leaves less to find than an engineer would meet.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.align.load import load_signals
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle

__all__ = ["TRIPS", "UNITS", "Drive", "filled", "measured", "real_folder", "window", "write_drive"]

HERE = Path(__file__).parent
MAPS = HERE.parents[1] / "real"
REDUCTION = 9.665  # BMW i3, motor to wheels
BRAKE = (
    119.0  # [N m/bar] of all wheels of the Porsche, so that the brakes decelerate it; before its torque gain of 0.835
)
FRONT_BRAKE = 0.6
_UNLIKELY = 1000.0  # [N m] 1022 and 1023 are error codes of the engine's controller
_FIRST, _SECOND = ("A05", "A11", "A15", "B26"), ("A10", "A12", "A16", "A17", "B24")
TRIPS: Mapping[str, tuple[str, ...]] = {"bmw": (*_SECOND, *_FIRST), "porsche": ("track",), "rav4": ("motorway",)}
_FILES = {"porsche": "porsche", "rav4": "toyota"}  # by which the maps turn km/h into wheel speeds
WHEELS = ("fl", "fr", "rl", "rr")
UNITS = {
    "t": "s", "v_x": "m/s", "a_x": "m/s^2", "a_y": "m/s^2", "yaw_rate": "rad/s", "steer_angle": "rad", "torque_f": "N*m",
    "torque_r": "N*m", **{f"omega_{w}": "rad/s" for w in WHEELS}, **{f"torque_{w}": "N*m" for w in WHEELS},
}  # fmt: skip

Columns = dict[str, FloatArray]


@dataclass(frozen=True)
class Drive:
    """`columns`: `t` [s] from nought at a constant step, and what was measured, NaN where a sample is missing."""

    car: str
    trip: str
    columns: Columns
    vehicle: Vehicle
    vehicle_file: Path

    @property
    def dt(self) -> float:
        return float(np.median(np.diff(self.columns["t"])))


def real_folder() -> Path | None:
    """Folder of the measured drives: `AQUALOG_REAL_LOGS`, else beside the checkout; None if there is none."""
    beside = HERE.parents[2].parent / "shared" / "real_logs"
    folder = Path(os.environ.get("AQUALOG_REAL_LOGS") or beside)
    return folder if folder.is_dir() else None


def measured(car: str, trip: str, folder: Path) -> Drive:
    """A whole drive."""
    columns = {"bmw": _bmw, "porsche": _porsche, "rav4": _rav4}[car](folder, trip)
    file = HERE / (f"bmw_{1 if trip in _SECOND else 2}.toml" if car == "bmw" else f"{car}.toml")
    return Drive(car, trip, columns, load_vehicle(file), file)


def window(drive: Drive, start_s: float, duration_s: float) -> Drive:
    """A part of a drive, with its own time."""
    t = drive.columns["t"]
    keep = (t >= start_s) & (t < start_s + duration_s)
    columns = {n: x[keep] for n, x in drive.columns.items()}
    columns["t"] = columns["t"] - columns["t"][0]
    return Drive(drive.car, drive.trip, columns, drive.vehicle, drive.vehicle_file)


def filled(x: FloatArray) -> FloatArray:
    """Missing samples on the line between their neighbours."""
    known = np.isfinite(x)
    if known.all() or not known.any():
        return x
    i = np.arange(x.size)
    return np.interp(i, i[known], x[known])


def write_drive(columns: Mapping[str, FloatArray], path: Path) -> None:
    """Write canonical signals with their units, so that nobody needs a map."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frame = pl.DataFrame({f"{n} [{UNITS[n]}]": pl.Series(np.asarray(x)).fill_nan(None) for n, x in columns.items()})
    frame.write_parquet(path)


def _bmw(folder: Path, trip: str) -> Columns:
    lines = (folder / "bmw_i3" / f"Trip{trip}.csv").read_text(encoding="latin1").splitlines()[1:]
    rows = np.array([[float(x or "nan") for x in line.split(";")[:6]] for line in lines])
    t = np.round(np.arange(0.0, rows[-1, 0], 0.1), 3)
    v, torque, a = (np.interp(t, rows[:, 0], rows[:, i]) for i in (1, 4, 5))
    return {"t": t, "v_x": v / 3.6, "a_x": a, "torque_r": torque * REDUCTION}


def _mapped(paths: list[Path], car: str, signal_map: str, dbc: tuple[Path, ...] = ()) -> Columns:
    signals = load_signals(
        paths,
        vehicle=load_vehicle(MAPS / f"{_FILES[car]}.toml"),
        signal_map=load_signal_map(MAPS / signal_map),
        dbc=dbc,
    )
    names = [c for c in signals.frame.columns if c in UNITS]
    return {c: signals.frame[c].cast(pl.Float64).fill_null(float("nan")).to_numpy().copy() for c in names}


def _porsche(folder: Path, _: str) -> Columns:
    own = folder / "porsche_981"
    columns = _mapped(sorted(own.glob("*.csv")), "porsche", "porsche_slope_map.toml")
    t, r = columns["t"], 0.338
    first = min(float(pl.read_csv(p)["t_ms"][0]) for p in own.glob("*.csv")) / 1e3

    def channel(file: str, name: str) -> FloatArray:
        d = pl.read_csv(own / file).select("t_ms", name).drop_nulls()
        x = d[name].cast(pl.Float64).to_numpy()
        good = np.abs(x) < _UNLIKELY if name.startswith("TRQ") else np.isfinite(x)
        return np.interp(t, d["t_ms"].to_numpy()[good] / 1e3 - first, x[good])

    rear = 0.5 * (filled(columns["omega_rl"]) + filled(columns["omega_rr"]))
    rpm = channel("engine_10Hz.csv", "RPM") * 2.0 * np.pi / 60.0
    # below 20 km/h the clutch slips and the ratio is not that of a gear
    ratio = np.where(rear * r > 5.5, np.clip(rpm / np.maximum(rear, 1.0), 2.5, 14.0), 0.0)
    drive = (channel("torque_b.csv", "TRQ_APPLY") - channel("torque_a.csv", "TRQ_LOSS")) * ratio
    brake = BRAKE * np.maximum(channel("brake.csv", "BRK_PRESS"), 0.0)
    columns["torque_f"] = -FRONT_BRAKE * brake
    columns["torque_r"] = drive - (1.0 - FRONT_BRAKE) * brake
    speed = channel("gps_10Hz.csv", "GPS Speed")
    columns["v_x"] = _onto(speed, t, t, 0.5 * (filled(columns["omega_fl"]) + filled(columns["omega_fr"])))
    return columns


def _rav4(folder: Path, _: str) -> Columns:
    own = folder / "toyota_rav4"
    columns = _mapped([own / "can_bus.mf4"], "rav4", "toyota_map.toml", (own / "toyota_2017.dbc",))
    d = pl.read_csv(own / "gnss.csv")
    at, speed = d["t [s]"].to_numpy(), d["speed [m/s]"].to_numpy()
    wheels = np.mean([filled(columns[f"omega_{w}"]) for w in WHEELS], axis=0)
    columns["v_x"] = _onto(speed, at - at[0], columns["t"], wheels)
    return columns


def _onto(x: FloatArray, at: FloatArray, t: FloatArray, like: FloatArray) -> FloatArray:
    """`x` at times `at` moved onto the clock of `like` at `t`: of all shifts that at which the accelerations over a second agree best."""
    dt = float(np.median(np.diff(t)))
    window = np.hanning(round(1.0 / dt) + 2)[1:-1]

    def slope(y: FloatArray) -> FloatArray:
        return np.gradient(np.convolve(y, window / window.sum(), "same"))

    shifts = np.arange(-3.0, 3.0, 0.01)
    inner = (t > 5.0) & (t < t[-1] - 5.0)
    own = slope(like)[inner]
    best = float(max(shifts, key=lambda s: np.corrcoef(slope(np.interp(t + s, at, x))[inner], own)[0, 1]))
    moved: FloatArray = np.interp(t + best, at, x, left=np.nan, right=np.nan)
    return moved
