"""A command in a process of its own, and what that process took."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

__all__ = ["ROOT", "Child", "run"]

ROOT = Path(__file__).resolve().parents[2]
SHARE = 0.6  # of the machine's memory: what wants more fails, and the machine goes on

# a process of its own between: a child's peak memory is never told below that of the process that made it
_LAUNCHER = """
import json, os, resource, sys, time
most, out, *command = sys.argv[1:]
resource.setrlimit(resource.RLIMIT_DATA, (int(most), int(most)))
sink = os.open(out, os.O_WRONLY)
begin = time.perf_counter()
child = os.posix_spawn(command[0], command, os.environ, file_actions=[(os.POSIX_SPAWN_DUP2, sink, 1)])
_, status, used = os.wait4(child, 0)
wall = time.perf_counter() - begin
print(json.dumps([os.waitstatus_to_exitcode(status), wall, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


@dataclass(frozen=True)
class Child:
    """What it wrote to stdout, and wall and CPU time (with its own children's) [s], peak of its memory [MB]."""

    stdout: str
    wall_s: float
    cpu_s: float
    peak_mb: float


def run(*arguments: str | Path) -> Child:
    """`python ARGUMENTS` from the checkout.

    Raises
    ------
    RuntimeError
        If it ends with anything but 0.
    """
    command = [sys.executable, *map(str, arguments)]
    most = int(SHARE * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    with tempfile.NamedTemporaryFile() as out:
        done = subprocess.run(
            [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(most), out.name, *command], capture_output=True,
            text=True, check=False, cwd=ROOT,
        )  # fmt: skip
        stdout = Path(out.name).read_text(encoding="utf-8")
    if done.returncode:
        raise RuntimeError(done.stderr.strip()[-300:])
    code, wall, cpu, peak = json.loads(done.stdout)
    if code:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        raise RuntimeError(f"{' '.join(map(str, arguments[:3]))} ended with {code}: {last[:200]}")
    return Child(stdout, wall, cpu, peak * (1e-6 if sys.platform == "darwin" else 1024e-6))
