"""A thousand short logs, five of them broken, on a dask scheduler with two workers, one of which is killed half way.

python -m tests.campaign.thousand_on_cluster DIR [--count N]. Scheduler, workers and batch are processes of
their own. Ends with an error unless the store is that of a local batch of the same logs, file by file.
"""

import argparse
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.campaign.dask_here import cluster, with_children
from tests.campaign.poisoned import files_of
from tests.campaign.thousand import BROKEN, make


def start(campaign: Path, store: Path, *more: str) -> subprocess.Popen:
    command = [sys.executable, "-m", "aqualog", "batch", str(campaign), "-o", str(store), "--json", "-q", *more]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def made(store: Path) -> int:
    return sum(1 for _ in (store / "samples").glob("*.parquet")) if (store / "samples").is_dir() else 0


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=1000)
    given = parser.parse_args()
    folder = given.folder.absolute()
    campaign = folder / "campaign.toml"
    if not campaign.exists():
        make(folder, given.count)
    began = time.monotonic()
    with start(campaign, folder / "local", "--jobs", "2") as process:
        text = process.stdout.read()
    print(
        f"local, 2 processes: {time.monotonic() - began:.1f} s, code {process.returncode}, {json.loads(text)['made']} made"
    )
    with cluster(folder) as (address, (_, first, _)):
        began = time.monotonic()
        with start(campaign, folder / "on_cluster", "--cluster", address) as process:
            while made(folder / "on_cluster") < given.count // 2:
                time.sleep(0.1)
            with_children(first, signal.SIGKILL)
            there, killed = made(folder / "on_cluster"), time.monotonic() - began
            text = process.stdout.read()
    document = json.loads(text)
    print(f"cluster, 2 workers: one killed after {killed:.1f} s with {there} done; {time.monotonic() - began:.1f} s, "
          f"code {process.returncode}, {document['made']} made, {len(document['failed'])} failed")  # fmt: skip
    assert document["made"] == given.count - len(BROKEN)
    assert process.returncode == 3
    here, elsewhere = files_of(folder / "local"), files_of(folder / "on_cluster")
    assert here.keys() == elsewhere.keys(), here.keys() ^ elsewhere.keys()
    unlike = [n for n in here if here[n] != elsewhere[n]]
    assert not unlike, unlike
    print(f"{len(here)} files are the same, {sum(map(len, here.values()))} byte")


if __name__ == "__main__":
    main()
