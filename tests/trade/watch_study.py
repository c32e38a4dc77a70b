"""Logs that arrive in pieces under a watch: rows, copies, and what memory grows by.

python -m tests.trade.watch_study --logs 50 --every 1 --damaged 2
"""

from __future__ import annotations

import argparse
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from threading import Thread

import aqualog as aq
from aqualog.core.vehicle import vehicle_toml
from tests.trade.made import FWD, signals, straight

PIECES = 4


def write_logs(folder: Path, count: int) -> list[Path]:
    """Runs of two tyres, each with a speed of 15 % slip of its own."""
    folder.mkdir(parents=True)
    logs = []
    for i in range(count):
        log = folder / f"run_{i:02d}.mf4"
        made = signals(straight(v_15=74.0 + 0.1 * i + (3.0 if i % 2 else 0.0)))
        aq.convert(made, log, FWD)
        logs.append(log)
    return logs


def write_campaign(folder: Path, logs: list[Path]) -> Path:
    """Half of the runs are on either tyre."""
    (folder / "car.toml").write_text(vehicle_toml(FWD), encoding="utf-8")
    rows = [f"logs/{log.name},{'Alpha' if i % 2 else 'Beta'}" for i, log in enumerate(logs)]
    (folder / "runs.csv").write_text("log,tyre\n" + "\n".join(rows) + "\n", encoding="utf-8")
    path = folder / "campaign.toml"
    path.write_text('name = "monday"\nvehicle = "car.toml"\nruns = "runs.csv"\n', encoding="utf-8")
    return path


def copy_in_pieces(data: bytes, target: Path, seconds: float) -> None:
    """As a slow network does: the file is there from the first piece on."""
    size = -(-len(data) // PIECES)
    with target.open("wb") as file:
        for i in range(PIECES):
            file.write(data[i * size : (i + 1) * size])
            file.flush()
            time.sleep(seconds / PIECES)


def memory_of(pid: int) -> dict[int, int]:
    """Resident memory of a process and all below it, by process. [kB]"""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
            parents[int(stat.parent.name)] = int(fields[1])
        except OSError:
            continue
    own = {pid}
    while grown := {p for p, up in parents.items() if up in own} - own:
        own |= grown
    out = {}
    for p in own:
        try:
            lines = (Path("/proc") / str(p) / "status").read_text().splitlines()
        except OSError:
            continue
        out[p] = next((int(x.split()[1]) for x in lines if x.startswith("VmRSS")), 0)
    return out


def main() -> int:
    """Print the lines of the watch, its rows and the growth of its memory."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--logs", type=int, default=50)
    parser.add_argument("--damaged", type=int, default=2)
    parser.add_argument("--every", type=float, default=1.0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = write_logs(folder / "stock", asked.logs)
        campaign = write_campaign(folder, logs)
        (folder / "logs").mkdir()
        command = [sys.executable, "-m", "aqualog", "watch", str(folder / "logs"), "--campaign", str(campaign)]
        watch = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        lines: list[tuple[float, str]] = []
        reader = Thread(target=lambda: lines.extend((time.monotonic(), x) for x in watch.stdout), daemon=True)
        reader.start()
        seen: list[dict[int, int]] = []
        whole: dict[str, float] = {}
        for i, log in enumerate(logs):
            data = log.read_bytes()
            if i in range(10, 10 + asked.damaged):  # the first cut, the next not a log at all
                data = data[: len(data) // 2] if i == 10 else b"MDF     4.10" + bytes(5000)
            copy_in_pieces(data, folder / "logs" / log.name, asked.every)
            whole[log.name] = time.monotonic()
            seen.append(memory_of(watch.pid))
        shutil.copy(logs[0], folder / "logs" / "again.mf4")
        time.sleep(12.0)
        seen.append(memory_of(watch.pid))
        page = (folder / "campaign.watch.html").read_text(encoding="utf-8")
        watch.send_signal(signal.SIGINT)
        err = watch.stderr.read()
        watch.wait(60)
        reader.join()
        out = "".join(x for _, x in lines)
        late = sorted(t - whole[x.split(":")[0]] for t, x in lines if x.split(":")[0] in whole and "valid; " in x)
        renews = 'http-equiv="refresh"' in page
        sys.stdout.write(f"{out}\n--- stderr\n{err}\n")
        rows = [
            line for line in out.splitlines() if line.startswith(("run_", "again")) and "valid" in line and ": " in line
        ]
        total = [sum(s.values()) / 1e3 for s in seen]
        early = total[min(15, len(total) - 1)]
        sys.stdout.write(
            f"exit {watch.returncode}; rows {len(rows)}; logs in them {len({r.split(':')[0] for r in rows})}; "
            f"page {len(page) / 1e3:.0f} kB, refresh {renews}\n"
            f"from the last piece to the line: median {late[len(late) // 2]:.1f} s, most {late[-1]:.1f} s\n"
            f"memory of all its processes: {early:.0f} MB after 15 logs, {total[-1]:.0f} MB at the end, "
            f"most {max(total):.0f} MB; by process at the end {[round(x / 1e3) for x in seen[-1].values()]}, "
            f"after 15 {[round(x / 1e3) for x in seen[min(15, len(seen) - 1)].values()]}\n"
        )  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
