"""A stand-in for the engine of the diagnosis, and a folder with drives that it is asked about."""

from dataclasses import replace

import polars as pl

from aqualog.core.vehicle import Vehicle, vehicle_toml
from tests.report.diagnosis_case import cases, views_of


class Engine:
    """Keeps what it was asked, answers with the diagnosis of a verdict."""

    def __init__(self):
        self.verdict = "named"
        self.asked = []
        self.faults = {}

    def __call__(self, drives, vehicle, *, model=None, holdout=(), options=None, progress=None):
        self.asked.append(([n for n, _ in drives], [n for n, _ in holdout], vehicle, model, options))
        for name, fault in self.faults.items():
            if name in (None, *(n for n, _ in drives)):
                raise fault
        for i in range(101):
            progress("searching", i / 100)
        found = replace(cases()[self.verdict], drives=tuple(n for n, _ in drives))
        return replace(found, views=views_of(self.verdict) if options.views else ())


def write_drives(folder):
    """Three logs of 20 s, a vehicle file and a campaign file."""
    n = 200
    frame = pl.DataFrame(
        {"t": [i / 10 for i in range(n)], "v_x": [20.0] * n, "a_x": [0.0] * n}
        | {f"omega_{w}": [63.0] * n for w in ("fl", "fr", "rl", "rr")}
    )
    for name in "abc":
        frame = frame.with_columns(a_x=pl.col("a_x") + 1e-6)  # a copy is no drive of its own
        frame.write_parquet(folder / f"{name}.parquet")
    (folder / "car.toml").write_text(vehicle_toml(Vehicle(name="car")), encoding="utf-8")
    (folder / "campaign.toml").write_text(
        'name = "c"\nvehicle = "car.toml"\n[[run]]\nlog = "a.parquet"\nwater_depth_mm = 1.3\n', encoding="utf-8"
    )
    return folder
