"""What is expensive and always the same is made once for all workers of a run of the tests."""

import os
import pickle
from collections import OrderedDict
from pathlib import Path
from threading import Lock

FOLDER: Path | None = None  # of the whole run; without workers each process makes its own
MOST_KEPT = 150  # drives of some MB


def once(name, make):
    """What `make()` returns, or what another worker has made of it; picklable, and read only for tests."""
    if FOLDER is None:
        return make()
    import fcntl

    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / f"{name}.pickle"
    with (FOLDER / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            half = path.with_suffix(".half")
            half.write_bytes(pickle.dumps(make()))
            half.rename(path)
    return pickle.loads(path.read_bytes())


def simulated_once(run):
    """The simulator along a drive, `led_truth`, which keeps what it made last: the same inputs give the same truth."""
    kept, lock = OrderedDict(), Lock()

    def once_run(setup, course, **kwargs):
        key = hash(pickle.dumps((setup, course, kwargs), 5))
        with lock:
            truth = kept.pop(key, None)
        if truth is None:
            truth = run(setup, course, **kwargs)
        with lock:
            kept[key] = truth
            while len(kept) > MOST_KEPT:
                kept.popitem(last=False)
        return truth

    return once_run


def is_second_worker():
    """Whether this worker takes what several have to make from the other end."""
    return os.environ.get("PYTEST_XDIST_WORKER", "gw0") != "gw0"
