"""How well `aqualog diagnose` does on sealed cases of any world.

`python -m tests.blind.judge RUN DIR... [--jobs 2] [--only-score] [--rivals] [--json FILE]` diagnoses each case of each DIR in a
process of its own, opens the truths, and prints the figures. RUN keeps the verdicts: a run that was killed goes on from there.
With `--rivals` PySINDy, BIC and LASSO work on the same cases, and a table stands them beside aqualog.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.blind.judging.answers import Answer, read_answer
from tests.blind.judging.cases import Judged, judge
from tests.blind.judging.figures import figures, misses_text, of_worlds, reliability_text, risk_coverage
from tests.blind.judging.run import Place, diagnose_all, places
from tests.blind.metrics.table import curve_text, measures_text
from tests.blind.sealed import LEDGER, open_truth, reopened

__all__ = ["answer_in", "main", "score"]


def score(done: Sequence[Place]) -> list[Judged]:
    """Open the truths of cases that have a verdict, and judge them."""
    out = []
    for place in done:
        sealed = place.out / "truth.bin"
        shutil.copyfile(place.case / "truth.bin", sealed)
        truth = open_truth(place.out)
        clean = truth.get("clean")
        own = None if clean is None else answer_in(place.out.parent / clean)
        if clean is not None and own is None:
            print(f"left out: {place.out.name}: no verdict yet on its clean drive {clean}", file=sys.stderr)
            continue
        answer, cost = answer_in(place.out), _read(place.out / "cost.json")
        assert answer is not None
        out.append(judge(f"{place.out.parent.name}/{place.out.name}", answer, truth, clean=own, cost=cost))
    return out


def answer_in(folder: Path) -> Answer | None:
    """Return the answer of a folder's verdict, None if there is none yet."""
    document = _read(folder / "verdict.json")
    return read_answer(document) if document else None


def _read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}


def main(arguments: Sequence[str] | None = None) -> int:
    """Diagnose, open, print; 1 if a target was missed."""
    given = _parsed(arguments)
    every = places(given.run, given.folders)
    if not given.only_score:
        if given.retry:
            for place in every:
                if _read(place.out / "verdict.json").get("verdict") == "failed":
                    (place.out / "verdict.json").unlink()
        diagnose_all(every, jobs=given.jobs, timeout_s=given.timeout)
    done = [p for p in every if p.is_done]
    cases = score(done)
    measures = figures(cases)
    clean = sum(c.is_baseline for c in cases)
    print(f"{len(cases) - clean} cases of {len(every) - clean}, {clean} measured drives as they are\n")
    print(measures_text(measures))
    worlds = of_worlds(cases)
    if len({c.world for c in cases}) > 1:
        print(f"\n{measures_text(worlds)}")
    for text in (
        reliability_text(cases),
        curve_text(curve) if (curve := risk_coverage(cases)) else "",
        misses_text(cases),
    ):
        if text:
            print(f"\n{text}")
    ledgers = {p.out.parent / LEDGER for p in every}
    if changed := [case for ledger in sorted(ledgers) for case in reopened(ledger)]:
        print(f"\nverdicts that changed after their truth was seen: {', '.join(changed)}")
    if given.rivals:
        from tests.blind.judging.rivals import all_claims, table  # needs the extra `blind`

        print(f"\n{table(cases, all_claims(done, jobs=given.jobs))}")
    if given.json:
        document = {"measures": [asdict(m) for m in (*measures, *worlds)], "cases": [_line(c) for c in cases]}
        given.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return int(any(m.reached is False for m in measures))


def _line(c: Judged) -> dict[str, Any]:
    row = c.row
    return {
        "case": row.key, "world": c.world, "kind": c.kind, "hidden": row.hidden, "z": [f.z for f in row.truth],
        "unknown": c.unknown, "verdict": row.verdict, "said": [x.key for x in row.causes],
        "forms": [[f.mechanisms, sorted(f.depends_on), f.probability] for f in c.forms], "first_is_right": c.first_is_right,
        "right_or_twins": c.is_right_or_twins, "in_answer": c.in_answer, "wrong": c.wrong,
        "form_is_right": c.form_is_right,
        "function_error": c.function_error if math.isfinite(c.function_error) else None, "error": row.error,
    }  # fmt: skip


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.blind.judge", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of the verdicts")
    parser.add_argument("folders", type=Path, nargs="+", metavar="DIR", help="folders of cases")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--timeout", type=float, default=3600.0, help="seconds after which a case has failed")
    parser.add_argument("--only-score", action="store_true", help="judge the verdicts that there are")
    parser.add_argument("--retry", action="store_true", help="diagnose cases that failed once more")
    parser.add_argument("--rivals", action="store_true", help="other methods beside aqualog (extra `blind`)")
    parser.add_argument("--json", type=Path, help="figures and cases as a document")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
