"""Fuzzing led by coverage, with atheris: of aqualog's own code, and of that only what reads and checks."""

import os
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.fuzz.corpus import Case, cases
from tests.fuzz.damage import damaged, drawn

PACKAGE = Path(__file__).resolve().parents[2] / "aqualog"
# what is compiled cannot be instrumented, and no input decides what it does
LED_BY = ("io", "config", "align", "campaign", "evaluate", "units", "notation", "vehicle")
LARGEST = 100_000  # [byte]


def not_led_by() -> list[str]:
    """Modules that are left as they are."""
    out = []
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        if parts[0] not in LED_BY or parts == ("campaign", "moments"):
            out.append(".".join(("aqualog", *(p for p in parts if p != "__init__"))))
    return out


def by_coverage(name: str, seconds: float, seed: int, journal: Path) -> None:
    """Fuzz until the time is over; ends the process."""
    import atheris

    with atheris.instrument_imports(include=["aqualog"], exclude=not_led_by()):
        from tests.fuzz.registry import all_targets

        target = all_targets()[name]
    from tests.fuzz.turn import judged, limited
    from tests.fuzz.work import Journal, Told, warmed

    limited()
    warmed(target)
    note, told = Journal(journal).note, Told()
    end = time.monotonic() + seconds

    def one(data: bytes) -> None:
        if time.monotonic() > end:
            told.tell(over=True)
            sys.stdout.flush()
            leave()
        case = Case("", (), data)
        note(case)
        begin = time.monotonic()
        verdict = judged(target, case)
        told.add(case, verdict, time.monotonic() - begin)

    def mutated(data: bytes, most: int, chance: int) -> bytes:
        rng = np.random.default_rng(chance)
        if not data or rng.random() < 0.3:
            return bytes(atheris.Mutate(data, most))
        return damaged(data, drawn(rng, data, is_text=target.is_text))[:most]

    with tempfile.TemporaryDirectory() as folder:
        contents = [*target.seeds().values(), *(case.content(target) for case in cases(name))]
        for n, data in enumerate(contents):
            Path(folder, f"{n:04d}").write_bytes(data)

        def leave() -> None:
            shutil.rmtree(folder)
            os.kill(os.getpid(), signal.SIGKILL)  # any other end the library takes for a finding

        # its limits are those of `turn`; it would end at the first finding
        quiet = ["-timeout=100000", "-rss_limit_mb=0", "-malloc_limit_mb=0", "-print_final_stats=0", "-verbosity=0"]
        flags = [*quiet, f"-seed={seed % 2**31 or 1}", f"-max_len={LARGEST}", f"-max_total_time={int(seconds) + 60}"]
        flags.append(f"-artifact_prefix={folder}/")
        atheris.Setup(["fuzz", *flags, folder], one, custom_mutator=mutated)
        atheris.Fuzz()
