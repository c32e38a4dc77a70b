"""The process that works on cases; `tests.fuzz.watch` starts it and is told by lines on stdout what it finds.

Before each case it writes it into a file, so that the one that ends the process, or never comes back, is known.
"""

import json
import os
import re
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from tests.fuzz.corpus import Case, cases
from tests.fuzz.damage import drawn
from tests.fuzz.registry import Target
from tests.fuzz.turn import judged, limited, peak


class Journal:
    """The case in hand, in a file."""

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)

    def note(self, case: Case) -> None:
        """Write it in place of the one before."""
        line = case.line().encode() + b"\n"
        os.pwrite(self._handle, line, 0)
        os.ftruncate(self._handle, len(line))


class Told:
    """Findings, each fault once: what differs in numbers and names is the same fault."""

    def __init__(self) -> None:
        self.n = self.wrong = 0
        self.slowest = 0.0
        self._kinds: dict[str, int] = {}

    def add(self, case: Case, verdict: str | None, seconds: float) -> None:
        """Count a case, and tell what is new."""
        self.n += 1
        self.slowest = max(self.slowest, seconds)
        if self.n % 50 == 0:  # the process may be ended by its next case
            self.tell()
        if verdict is None:
            return
        self.wrong += 1
        kind = re.sub(r"0x[0-9a-f]+|\d+(\.\d+)?|'[^']*'|/\S+", "_", re.sub(r"(\.py):(\d+)", r"\1 \2_", verdict))[:100]
        self._kinds[kind] = self._kinds.get(kind, 0) + 1
        if self._kinds[kind] == 1:
            print(f"{case.line()}  # {verdict}", flush=True)

    def tell(self, *, over: bool = False) -> None:
        """How it goes, as JSON."""
        about = {"cases": self.n, "wrong": self.wrong, "faults": len(self._kinds), "over": over}
        print(
            "done " + json.dumps({**about, "slowest_s": round(self.slowest, 2), "peak_mb": round(peak())}), flush=True
        )


def warmed(target: Target) -> None:
    """What is loaded and compiled once is no memory and no time of a case."""
    for data in target.seeds().values():
        with suppress(Exception):  # told as a case of its own
            target.one(data)


def by_chance(target: Target, name: str, seconds: float, seed: int, journal: Path) -> None:
    """All cases of the corpus, then damages by chance until the time is over."""
    limited()
    warmed(target)
    note, told = Journal(journal).note, Told()
    rng = np.random.default_rng(seed)
    seeds = target.seeds()
    names = sorted(seeds)

    def turn(case: Case) -> None:
        note(case)
        begin = time.monotonic()
        verdict = judged(target, case)
        told.add(case, verdict, time.monotonic() - begin)

    for case in [*(Case(n) for n in names), *cases(name)]:
        turn(case)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        of = names[int(rng.integers(len(names)))]
        turn(Case(of, drawn(rng, seeds[of], is_text=target.is_text)))
    told.tell(over=True)


def main() -> None:
    """`python -m tests.fuzz.work TARGET SECONDS SEED JOURNAL [guided]`."""
    name, seconds, seed, journal = sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])
    if sys.argv[5:]:
        from tests.fuzz.guided import by_coverage

        by_coverage(name, seconds, seed, journal)
    else:
        from tests.fuzz.registry import all_targets

        by_chance(all_targets()[name], name, seconds, seed, journal)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    main()
