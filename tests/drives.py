"""Simulated drives as signals, for tests of features and detectors."""

import polars as pl

from aqualog.core.records import Quality, Signals
from aqualog.core.vehicle import Vehicle
from tests.small_model import Drive, Lane, simulate

CAR = Vehicle(name="test car", given=frozenset({"drivetrain", "mass"}))
FWD = Vehicle(name="fwd car", drivetrain="fwd", torque_split_rear=0.0, given=frozenset({"drivetrain", "mass"}))
AWD = Vehicle(name="awd car", drivetrain="awd", torque_split_rear=0.6, given=frozenset({"drivetrain", "mass"}))


def as_signals(columns, rate_hz=100.0, drop=()):
    frame = pl.DataFrame({k: v for k, v in columns.items() if not k.startswith("true_") and k not in drop})
    return Signals(frame, round(1e9 / rate_hz), None, {}, Quality(), ("test",))


def lane(start=6.0, end=14.0, depth=1.3e-3):
    return Lane(start, end, 0.8 * depth, depth)


def drive(vehicle=CAR, drop=(), **kw):
    d = Drive(vehicle, **kw)
    columns = simulate(d)
    return as_signals(columns, d.rate_hz, drop), columns
