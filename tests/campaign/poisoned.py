"""A long batch with poison in it, killed again and again: python -m tests.campaign.poisoned DIR [--logs N].

N short logs in four formats, one in a hundred of which breaks its reader or is no log. A batch that nobody disturbs
stands beside one that is ended by SIGKILL, SIGINT and SIGTERM at random moments and begun again; with --cluster one more
on two workers of dask. Prints times, memory over the logs and what was left behind; ends with an error unless the
stores are the same, byte for byte, with the same errors.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil

from aqualog.core.vehicle import vehicle_toml
from aqualog.model.log import write_simulation
from aqualog.model.programme import SEDAN
from aqualog.model.simulate import simulate
from tests.campaign.dask_here import cluster
from tests.campaign.made import pass_of
from tests.campaign.poison import HOOKED, HOSTILE_NAMES, hooked, real_poison

SUFFIXES = (".mf4", ".parquet", ".csv", ".mcap")
HEAD = ("log", "tyre", "water_depth_mm", "pressure_front_bar", "pressure_rear_bar", "lane_start_s", "lane_end_s")
LIMITS = {"S": 15, "MB": 1500, "FILE_MB": 50}
LOOK_S = 0.5


def make(
    folder: Path,
    count: int,
    *,
    contents: int = 96,
    hooks: Sequence[str] = HOOKED,
    seed: int = 1,
    are_bombs: bool = True,
) -> Path:
    """A campaign of `count` logs at random places of which the poison lies; returns its file.

    The good ones are copies of `contents` ones, each of which is read and measured by itself: a name is in the key.
    """
    logs = folder / "logs"
    logs.mkdir(parents=True)
    (folder / "car.toml").write_text(vehicle_toml(SEDAN))
    base = []
    for i in range(contents):
        suffix = SUFFIXES[i % len(SUFFIXES)]
        base.append(folder / f"base_{i}{suffix}")
        scenario = pass_of(60 + 5 * (i % 12), i, duration=5.0, lane=(1.5, 4.0))
        write_simulation(base[-1], simulate(scenario), suffix=suffix, comment="made")
    good = {p.suffix: p for p in base}
    poison = [logs / f"poison_{name}" for name in hooks]
    for path in poison:
        shutil.copy(good[path.suffix], path)
    poison += real_poison(logs, good, are_bombs=are_bombs)
    paths = [logs / n for n in HOSTILE_NAMES]
    for path in paths:
        shutil.copy(good[path.suffix], path)
    for i in range(count - len(poison) - len(paths)):
        source = base[i % contents]
        paths.append(logs / f"run_{i:05d}{source.suffix}")
        shutil.copy(source, paths[-1])
    for path in base:
        path.unlink()
    paths += poison
    random.Random(seed).shuffle(paths)
    with (folder / "runs.csv").open("w", newline="") as table:
        rows = csv.writer(table)
        rows.writerow(HEAD)
        rows.writerows((f"logs/{p.name}", "worn_summer", 1.3, 1.9, 1.9, 1.5, 4.0) for p in paths)
    (folder / "campaign.toml").write_text('name = "poisoned"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    return folder / "campaign.toml"


class Watched(NamedTuple):
    """A batch that has ended: exit code, its document if it wrote one, stderr, seconds, and (process, logs done, byte)."""

    code: int
    document: dict
    error: str
    seconds: float
    memory: list[tuple[int, int, int]]
    parent: int


def done_in(store: Path) -> int:
    return sum(sum(1 for _ in f.iterdir()) for n in ("samples", "failed") if (f := store / n).is_dir())


def private(number: int) -> int:
    """Memory that is nobody else's. [byte]"""
    try:
        lines = Path(f"/proc/{number}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("RssAnon:")), 0)


def batch(
    campaign: Path, store: Path, env: dict[str, str], *more: str, end: tuple[int, signal.Signals] | None = None
) -> Watched:
    """Run it; with `end` send that signal when so many logs are done, to all as a terminal does or, SIGTERM, to one."""
    command = [sys.executable, "-m", "aqualog", "batch", str(campaign), "-o", str(store), "--json", "--progress", "off"]
    began = time.monotonic()
    memory = []
    with subprocess.Popen(
        [*command, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env, start_new_session=True
    ) as process:
        own = psutil.Process(process.pid)
        family: dict[int, psutil.Process] = {process.pid: own}
        looked = -LOOK_S
        while process.poll() is None:
            done = done_in(store)
            if time.monotonic() - looked > LOOK_S:
                looked = time.monotonic()
                family |= {p.pid: p for p in _children(own)}
                memory += [(n, done, size) for n, p in family.items() if (size := private(n))]
            if end is not None and done >= end[0]:
                os.kill(process.pid, end[1]) if end[1] == signal.SIGTERM else os.killpg(process.pid, end[1])
                end = None
            time.sleep(0.05)
        out, error = process.communicate()
        _, alive = psutil.wait_procs([p for n, p in family.items() if n != process.pid], timeout=10)
        assert not alive, f"outlived the batch: {alive}"
    seconds = time.monotonic() - began
    return Watched(process.returncode, json.loads(out) if out else {}, error, seconds, memory, process.pid)


def _children(process: psutil.Process) -> list[psutil.Process]:
    try:
        return process.children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def growth(memory: Sequence[tuple[int, int, int]], least: int) -> list[tuple[int, int, float, float]]:
    """Of each process that saw `least` logs or more: process, logs seen, MB at the end, MB per 1,000 logs.

    A line by least squares, without the first fifth, in which libraries are imported, and without moments at which a
    process held half as much again as it mostly does: a bomb, which is given back.
    """
    found = []
    for number in dict.fromkeys(n for n, _, _ in memory):
        done, size = np.array([(d, s) for n, d, s in memory if n == number], dtype=float).T
        late = (done >= done[0] + 0.2 * (done[-1] - done[0])) & (size < 1.5 * np.median(size))
        if done[-1] - done[0] >= least and np.unique(done[late]).size > 2:
            slope = np.polyfit(done[late], size[late], 1)[0]
            found.append((number, int(done[-1] - done[0]), size[-1] / 1e6, slope * 1e3 / 1e6))
    return found


def left_in(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))


def files_of(store: Path) -> dict[str, bytes]:
    return {
        p.relative_to(store).as_posix(): p.read_bytes() for p in store.rglob("*") if p.is_file() and p.name != "lock"
    }


def reasons(document: dict) -> dict[str, str]:
    return {f["log"]: f["reason"] for f in document["failed"]}


def disturbed(
    campaign: Path,
    store: Path,
    env: dict[str, str],
    count: int,
    seed: int,
    signals: Sequence[signal.Signals],
    *more: str,
) -> Watched:
    """A batch that is ended by each of the signals in turn, and then let go on to its end."""
    chance = random.Random(seed)
    moments = sorted(chance.sample(range(count // 20, min(count * 9 // 10, count - 20)), len(signals)))
    for moment, number in zip(moments, chance.sample(signals, len(signals)), strict=True):
        found = batch(campaign, store, env, *more, end=(moment, number))
        lines = [line for line in found.error.splitlines() if not line.startswith(("error: ", "note: "))]
        print(
            f"  {number.name} at {moment}: code {found.code}, {done_in(store)} done after {found.seconds:.1f} s, {lines}"
        )
        assert found.code == (-signal.SIGKILL if number == signal.SIGKILL else 130)
        assert "Traceback" not in found.error
    return batch(campaign, store, env, *more)


def unlike(a: Path, b: Path) -> list[str]:
    here, there = files_of(a), files_of(b)
    return sorted(n for n in here.keys() | there.keys() if here.get(n) != there.get(n))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--logs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cluster", action="store_true")
    given = parser.parse_args()
    folder = given.folder.absolute()
    began = time.monotonic()
    campaign = make(folder / "campaign", given.logs, seed=given.seed)
    print(f"{given.logs} logs made in {time.monotonic() - began:.0f} s; seed {given.seed}, limits {LIMITS}", flush=True)
    env = {**hooked(folder, **LIMITS), "TMPDIR": str(folder / "tmp")}
    (folder / "tmp").mkdir()

    plain = batch(campaign, folder / "plain", env)
    assert plain.code == 3, plain.error
    failed = reasons(plain.document)
    print(f"undisturbed: {plain.seconds:.1f} s, {plain.document['made']} made, {len(failed)} failed:")
    for name, reason in sorted(failed.items()):
        print(f"  {name}: {reason}")
    for number, logs, last, slope in growth(plain.memory, 100):
        who = "command" if number == plain.parent else "process"
        print(f"  {who} {number} over {logs} logs: {last:.0f} MB at the end, {slope:+.2f} MB per 1,000 logs")
    print(f"  left in the temporary folder: {left_in(folder / 'tmp')}", flush=True)

    began = time.monotonic()
    all_signals = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
    again = disturbed(campaign, folder / "killed", env, given.logs, given.seed, all_signals)
    print(f"killed three times: {time.monotonic() - began:.1f} s in all, the last time {again.document['made']} made")
    print(f"  left in the temporary folder: {left_in(folder / 'tmp')}", flush=True)
    ends = [("killed", again)]
    if given.cluster:
        with ExitStack() as stack:
            address, _ = stack.enter_context(cluster(folder, env=env))
            ends.append(("cluster", batch(campaign, folder / "cluster", env, "--cluster", address)))
        print(f"on two workers of dask: {ends[-1][1].seconds:.1f} s, {ends[-1][1].document['made']} made")
        print(f"  left in the temporary folder: {left_in(folder / 'tmp')}", flush=True)
    for name, end in ends:
        assert not unlike(folder / "plain", folder / name), unlike(folder / "plain", folder / name)
        told = reasons(end.document)
        other = {n: (failed.get(n), told.get(n)) for n in failed.keys() | told.keys() if failed.get(n) != told.get(n)}
        assert not other, other
        print(f"{name}: {len(files_of(folder / name))} files and {len(told)} errors are the same")


if __name__ == "__main__":
    main()
