"""Commands that are interrupted at random moments: python -m tests.campaign.interrupted DIR [--times N].

Each leaves either the whole result, the same as an undisturbed one, or none, nothing in the temporary folder, exit code
130 and one line. Prints what each left; ends with an error if one left anything else.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

from aqualog.model.log import write_simulation
from aqualog.model.simulate import simulate
from tests.campaign.made import make_campaign, pass_of

START = "from aqualog.cli.start import run; run()"
COMMANDS = {
    "detect": ("detect", "{log}", "--vehicle", "{car}", "-o", "{out}/found"),
    "write": ("detect", "{log}", "--vehicle", "{car}", "--write", "{out}/found.mf4"),
    "convert": ("convert", "{log}", "--vehicle", "{car}", "-o", "{out}/found.mcap"),
    "diagnose": ("diagnose", "{long}", "--vehicle", "{car}", "--no-bootstrap", "-o", "{out}/m.toml", "--page",
                 "{out}/m.html"),
    "figures": ("figures", "2.25", "--campaign", "{campaign}", "-o", "{out}/figures"),
    "report": ("report", "{campaign}", "-o", "{out}/report"),
    "batch": ("batch", "{campaign}", "-o", "{out}/store", "--jobs", "2"),
}  # fmt: skip


EARLY_S = 0.15


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def once(
    command: list[str], out: Path, env: dict[str, str], *, after: float | None = None, number: int = signal.SIGINT
) -> tuple[int, list[str], float]:
    """Exit code, lines of stderr, seconds; `out` is made anew."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    began = time.monotonic()
    with subprocess.Popen(
        [sys.executable, "-c", START, *command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env,
        start_new_session=True,
    ) as process:  # fmt: skip
        if after is not None:
            try:
                process.wait(after)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, number)
        error = process.stderr.read()
    return process.returncode, error.splitlines(), time.monotonic() - began


def wrong(name: str, code: int, lines: list[str], found: dict[str, bytes], whole: dict[str, bytes], tmp: Path) -> str:
    """What an interrupted command has left that it should not; empty if nothing."""
    if code not in (0, 130):
        return f"exit code {code}: {lines[-3:]}"
    if any("Traceback" in line for line in lines):
        return f"a traceback: {lines[-3:]}"
    is_whole = found.keys() == whole.keys()  # and the interrupt came while it left
    if code == 130 and not is_whole and sum("interrupted" in line for line in lines) != 1:
        return f"not one line that says so: {lines}"
    if left := sorted(str(p) for p in tmp.iterdir()):
        return f"in the temporary folder: {left}"
    if orphans := [n for n in found if n.endswith(".tmp") or "/." in n or n.startswith(".")]:
        return f"half-written: {orphans}"
    if name == "batch":  # a store holds what is done
        other = [n for n in found if n.startswith("store/samples") and found[n] != whole[n]]
        return f"other results: {other}" if other else ""
    if code == 0 or found:
        missing = sorted(whole.keys() - found.keys())
        other = sorted(n for n in found if found[n] != whole.get(n))
        return f"a part of the result: without {missing[:5]}, other {other[:5]}" if missing or other else ""
    return ""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=list(COMMANDS))
    given = parser.parse_args()
    folder = given.folder.absolute()
    campaign = make_campaign(folder / "c", speeds=(80, 100), repeats=3)
    (folder / "tmp").mkdir()
    env = {**os.environ, "TMPDIR": str(folder / "tmp"), "PYTHONHASHSEED": "0"}
    subprocess.run([sys.executable, "-c", START, "batch", str(campaign), "-q"], check=True, stdout=subprocess.DEVNULL)
    write_simulation(folder / "long.parquet", simulate(pass_of(90, 1, duration=40.0, lane=(10.0, 20.0))), suffix=".parquet",
                     comment="made")  # fmt: skip
    names = {"long": folder / "long.parquet", "log": campaign.parent / "logs" / "v100_0.parquet", "car": campaign.parent / "car.toml",
             "campaign": campaign, "out": folder / "out"}  # fmt: skip
    chance = random.Random(given.seed)
    faults = 0
    for name in given.only:
        command = [part.format(**names) for part in COMMANDS[name]]
        code, lines, seconds = once(command, folder / "out", env)
        assert code in (0, 3), (name, lines)
        whole = files_in(folder / "out")
        once(command, folder / "out", env)
        again = files_in(folder / "out")
        dated = {n for n in whole if whole[n] != again[n]}  # with the time at which they were written in them
        seen: Counter[str] = Counter()
        for _ in range(given.times):
            moment = chance.uniform(0.05, seconds)
            code, lines, _ = once(command, folder / "out", env, after=moment)
            found = {
                n: whole[n] if n in dated and len(d) == len(whole[n]) else d
                for n, d in files_in(folder / "out").items()
            }
            fault = wrong(name, code, lines, found, whole, folder / "tmp")
            seen[f"{code}, {'whole' if found.keys() >= whole.keys() else 'a part' if found else 'nothing'}"] += 1
            if code in (1, -signal.SIGINT) and not found and moment < EARLY_S:
                continue  # Python itself had hardly started, and says so in its own way
            faults += bool(fault)
            if fault:
                print(f"  {name} after {moment:.2f} of {seconds:.2f} s: {fault}")
            shutil.rmtree(folder / "tmp")
            (folder / "tmp").mkdir()
        print(f"{name}: {given.times} times within {seconds:.1f} s: {dict(seen)}", flush=True)
    assert not faults, faults


if __name__ == "__main__":
    main()
