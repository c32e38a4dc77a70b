"""Watches over a process that fuzzes: one that dies or stands still is told with its case, and another goes on."""

import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from tests.fuzz.registry import SECONDS

ROOT = Path(__file__).resolve().parents[2]
STILL = "never comes back"
START_S = 600.0  # before the first one: instrumenting takes a minute of an idle processor
STILL_S = 12 * SECONDS  # without another case; wall-clock, for a machine that is busy


def watched(
    name: str, seconds: float, seed: int, *, guided: bool, may_end: bool, tell: Callable[[str], None]
) -> dict[str, float]:
    """Fuzz for so long; findings go to `tell` as lines of the corpus.

    Returns cases, wrong, faults, slowest_s, peak_mb; `ended`: how often a case has ended the process.
    """
    total: dict[str, float] = {"cases": 0, "wrong": 0, "faults": 0, "slowest_s": 0.0, "peak_mb": 0, "ended": 0}
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as folder:
        while (left := end - time.monotonic()) > 0.0:
            journal = Path(folder, "case")
            journal.unlink(missing_ok=True)
            done, why = _turn(name, left, seed, journal, guided=guided, tell=tell)
            for key in ("cases", "wrong", "faults"):
                total[key] += done.get(key, 0)
            for key in ("slowest_s", "peak_mb"):
                total[key] = max(total[key], done.get(key, 0.0))
            if why:
                total["ended"] += 1
                if may_end and why != STILL:
                    seed += 1
                    continue
                total["wrong"], total["faults"] = total["wrong"] + 1, total["faults"] + 1
                tell(f"{journal.read_text().strip() if journal.exists() else '(before the first case)'}  # {why}")
                if not journal.exists():
                    break
            seed += 1
    return total


def _turn(
    name: str, seconds: float, seed: int, journal: Path, *, guided: bool, tell: Callable[[str], None]
) -> tuple[dict[str, float], str]:
    """One process: what it counted, and what ended it before its time."""
    command = [sys.executable, "-m", "tests.fuzz.work", name, str(seconds), str(seed), str(journal)]
    # what libraries write to stderr is noise here
    child = subprocess.Popen(
        [*command, *(["guided"] if guided else [])], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )  # fmt: skip
    done: dict[str, float] = {}

    def listen() -> None:
        for line in child.stdout or ():
            if line.startswith("done "):
                done.update(json.loads(line[5:]))
            elif line.startswith(("[", "{")):
                tell(line.rstrip("\n"))

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    begin, still = time.time(), False
    try:
        while child.poll() is None and not still:
            try:
                child.wait(timeout=2.0)
            except subprocess.TimeoutExpired:
                has_begun = journal.exists()
                last = journal.stat().st_mtime if has_begun else begin
                still = time.time() - max(last, begin) > (STILL_S if has_begun else START_S)
    finally:
        if child.poll() is None:
            child.kill()
            child.wait()
    listener.join(5.0)
    if still:
        return done, STILL
    return done, "" if done.get("over") else f"ends the process (exit {child.returncode})"
