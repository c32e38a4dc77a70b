"""A campaign of many short logs with five broken ones, killed half way: python -m tests.campaign.thousand DIR.

Prints what each step did and how long it took; ends with an error if a step did not do what it must.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

from aqualog.core.vehicle import vehicle_toml
from aqualog.model.log import write_simulation
from aqualog.model.programme import SEDAN
from aqualog.model.simulate import simulate
from tests.campaign.made import pass_of

SUFFIXES = (".mf4", ".parquet", ".csv", ".mcap")
BROKEN = (100, 201, 302, 403, 504)  # of the logs: cut in half, empty, no table, cut in its head, zeros


def make(folder: Path, count: int) -> None:
    (folder / "logs").mkdir(parents=True)
    (folder / "car.toml").write_text(vehicle_toml(SEDAN))
    rows = ["log,tyre,water_depth_mm,pressure_front_bar,pressure_rear_bar,lane_start_s,lane_end_s"]
    for i in range(count):
        suffix = SUFFIXES[i % len(SUFFIXES)]
        path = folder / "logs" / f"run_{i:04d}{suffix}"
        scenario = pass_of(60 + 5 * (i % 12), i, duration=5.0, lane=(1.5, 4.0))
        write_simulation(path, simulate(scenario), suffix=suffix, comment="made")
        rows.append(f"logs/{path.name},worn_summer,1.3,1.9,1.9,1.5,4.0")
    (folder / "runs.csv").write_text("\n".join(rows) + "\n")
    (folder / "campaign.toml").write_text('name = "many"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    logs = sorted((folder / "logs").iterdir())
    cut, empty, table, head, zeros = (logs[i] for i in BROKEN)
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
    empty.write_bytes(b"")
    table.write_text("hello;world\n1;2;x\nfoo\n")
    head.write_bytes(head.read_bytes()[:37])
    zeros.write_bytes(bytes(5000))


def batch(folder: Path, *, kill_at: int | None = None) -> tuple[int, dict, float]:
    """Exit code, JSON document and seconds; with `kill_at` killed as soon as so many logs are done."""
    command = [sys.executable, "-m", "aqualog", "batch", str(folder / "campaign.toml"), "--json", "-q"]
    began = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if kill_at is not None:
        while done(folder) < kill_at:
            time.sleep(0.1)
        process.kill()
        process.communicate()
        return process.returncode, {}, time.monotonic() - began
    text, _ = process.communicate()
    return process.returncode, json.loads(text), time.monotonic() - began


def done(folder: Path) -> int:
    samples = folder / "campaign.store" / "samples"
    return sum(p.suffix == ".parquet" for p in samples.iterdir()) if samples.is_dir() else 0


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=1000)
    given = parser.parse_args()
    make(given.folder, given.count)
    code, _, seconds = batch(given.folder, kill_at=given.count // 2)
    there = done(given.folder)
    print(f"killed after {seconds:.1f} s with {there} of {given.count} done (code {code})")
    code, document, seconds = batch(given.folder)
    print(
        f"again: {document['made']} made, {document['kept']} kept, {len(document['failed'])} failed, code {code}, {seconds:.1f} s"
    )
    for one in document["failed"]:
        print(f"  {one['log']}: {one['reason']}")
    assert code == 3
    assert document["kept"] >= there
    assert document["made"] + document["kept"] == given.count - len(BROKEN)
    code, document, seconds = batch(given.folder)
    print(f"third: {document['made']} made, {document['kept']} kept, code {code}, {seconds:.1f} s")
    assert (code, document["made"]) == (3, 0)
    assert seconds < 5.0


if __name__ == "__main__":
    main()
