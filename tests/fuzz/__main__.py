"""`python -m tests.fuzz mdf --seconds 600`: damage small files by chance until something is wrong.

What is found is printed as a line for `tests/fuzz/corpus/NAME.txt`; a case that ends the process itself is the last line
of the file that `--log` names.
"""

import argparse
import json
import signal
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from tests.fuzz import mdf  # noqa: F401 - adds itself to the registry
from tests.fuzz.damage import damaged, drawn
from tests.fuzz.registry import MEGABYTES, SECONDS, TARGETS


class Slow(BaseException):
    """No `Exception`: a reader must not take it for a fault of the file."""


def peak() -> float:
    """Peak of this process' memory so far. [MB]"""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("target", choices=sorted(TARGETS))
    options.add_argument("--seconds", type=float, default=60.0)
    options.add_argument("--seed", type=int, default=None)
    options.add_argument("--log", type=Path, default=None, help="the case at hand, for crashes of the process")
    asked = options.parse_args()
    target = TARGETS[asked.target]()
    seed = int(time.time()) if asked.seed is None else asked.seed
    rng = np.random.default_rng(seed)
    n = wrong = 0
    slowest = 0.0

    def stop(*_: object) -> None:
        raise Slow

    signal.signal(signal.SIGALRM, stop)
    with tempfile.TemporaryDirectory() as folder:
        names = sorted(target.makers)
        whole = {name: target.makers[name](Path(folder)) for name in names}
        for name in names:  # what is loaded once is no memory of a case
            (Path(folder) / f"first{target.suffix}").write_bytes(whole[name])
            target.judge(name, (("flip", 0, 0),), Path(folder) / f"first{target.suffix}")
        end = time.monotonic() + asked.seconds
        while time.monotonic() < end:
            name = names[int(rng.integers(len(names)))]
            damages = drawn(rng, len(whole[name]))
            case = json.dumps([name, damages])
            if asked.log is not None:
                asked.log.write_text(case + "\n")
            path = Path(folder) / f"case{target.suffix}"
            path.write_bytes(damaged(whole[name], damages))
            before, begin = peak(), time.monotonic()
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
            try:
                verdict = target.judge(name, damages, path)
            except Slow:
                verdict = "hangs"
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
            slowest = max(slowest, time.monotonic() - begin)
            if verdict is None and peak() - before > MEGABYTES:
                verdict = f"takes {peak() - before:.0f} MB"
            n += 1
            if verdict is not None:
                wrong += 1
                print(f"{case}  # {verdict}", flush=True)
    print(f"{n} cases with seed {seed}, {wrong} wrong, slowest {slowest:.2f} s, peak {peak():.0f} MB", file=sys.stderr)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
