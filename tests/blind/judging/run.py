"""Diagnose the cases of folders, one process each; the run's own folder has the verdicts and what they cost.

A run keeps `RUN/<name of the folder>/<case>/verdict.json` and `cost.json`; the folders of the cases stay as they are, so
that several engines can be judged on the same ones.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tests.blind.judging.work import log_of

__all__ = ["Place", "diagnose_all", "places"]

_ROOT = Path(__file__).resolve().parents[3]
_INTERRUPTED = (-2, 130)


class Place(NamedTuple):
    """A case and the folder that its verdict goes to."""

    case: Path
    out: Path

    @property
    def is_done(self) -> bool:
        return (self.out / "verdict.json").is_file()


def places(run: Path, folders: Sequence[Path]) -> list[Place]:
    """All cases of these folders, in the order of their names; folders of one name have to be told apart by their own."""
    names = [f.resolve().name for f in folders]
    if len(set(names)) < len(names):
        raise SystemExit(f"error: two folders of one name among {', '.join(map(str, folders))}: rename one")
    out = []
    for folder, name in zip(folders, names, strict=True):
        cases = sorted(p.parent for p in folder.glob("*/truth.bin"))
        if not cases:
            raise SystemExit(f"error: {folder}: no case (a folder with drive.*, vehicle.toml, truth.bin) in it")
        out += [Place(c, run / name / c.name) for c in cases]
    return out


def diagnose_all(todo: Sequence[Place], *, jobs: int, timeout_s: float) -> None:
    """Diagnose those that have no verdict yet; a case that crashes gets a verdict `failed`, and the others go on."""
    left = [p for p in todo if not p.is_done]
    done = len(todo) - len(left)
    began, lock = time.monotonic(), threading.Lock()

    def one(place: Place) -> None:
        nonlocal done
        said = _diagnose(place, timeout_s)
        with lock:
            done += 1
            minutes = (time.monotonic() - began) / 60.0
            print(f"{done} of {len(todo)} cases after {minutes:.1f} min: {place.out.name} {said}", file=sys.stderr)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, left))


def _diagnose(place: Place, timeout_s: float) -> str:
    place.out.mkdir(parents=True, exist_ok=True)
    errors = place.out / "stderr.txt"
    began = time.monotonic()
    with errors.open("wb") as stderr:
        worker = subprocess.Popen(
            [sys.executable, "-m", "tests.blind.judging.work", str(place.case.resolve()), str(place.out.resolve())],
            cwd=_ROOT, env={**os.environ, "PYTHONPATH": str(_ROOT)}, stdout=subprocess.DEVNULL, stderr=stderr,
        )  # fmt: skip
        guard = threading.Timer(timeout_s, worker.kill)
        guard.start()
        try:
            _, status, used = os.wait4(worker.pid, 0)
        finally:
            guard.cancel()
    worker.returncode = code = os.waitstatus_to_exitcode(status)
    cost = {
        "seconds": round(time.monotonic() - began, 2), "cpu_seconds": round(used.ru_utime + used.ru_stime, 2),
        "peak_mb": round(used.ru_maxrss / 1024.0, 1), "exit_code": code, "log": str(log_of(place.case, "drive")),
    }  # fmt: skip
    if code in _INTERRUPTED:
        return "interrupted"
    (place.out / "cost.json").write_text(json.dumps(cost) + "\n", encoding="utf-8")
    if not place.is_done:
        last = errors.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1:] or [""]
        why = f"ended with {code} after {cost['seconds']:.0f} s: {last[0]}"
        (place.out / "verdict.json").write_text(
            json.dumps({"verdict": "failed", "error": why}) + "\n", encoding="utf-8"
        )
        return f"failed, {why}"
    errors.unlink()
    return f"done in {cost['seconds']:.0f} s, {cost['cpu_seconds']:.0f} s of CPU, {cost['peak_mb']:.0f} MB"
