"""Damages small files until something is wrong: a wrong value, another error than aqualog's own, a hang, much memory.

Each finding is a line for tests/fuzz/corpus/TARGET.txt, which the tests try again from then on.
"""

import argparse
import importlib.util
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.fuzz.corpus import Case, case_of
from tests.fuzz.registry import Target, all_targets
from tests.fuzz.turn import judged, limited_meanwhile
from tests.fuzz.watch import watched
from tests.fuzz.work import warmed

EXAMPLES = """examples:
  python -m tests.fuzz mdf --seconds 600            damages drawn by chance, ten minutes
  python -m tests.fuzz mdf --seconds 600 --guided   led by coverage (pip install -e '.[fuzz]', Python 3.11 to 3.13)
  python -m tests.fuzz all --seconds 60             every target, a minute each
  python -m tests.fuzz map --case '["full", [["cut", 9]]]' --debug     one case again, with its traceback
"""


def main(arguments: list[str] | None = None) -> int:
    """Exit code 1 if something was found, 2 if it could not run."""
    targets = all_targets()
    about = "\n".join(f"  {name:<11} {target.about}" for name, target in targets.items())
    options = argparse.ArgumentParser(
        prog="python -m tests.fuzz", description=f"{__doc__}\ntargets:\n{about}", epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    options.add_argument("target", choices=[*targets, "all"], metavar="TARGET")
    options.add_argument("--seconds", type=float, default=60.0, help="how long, per target (60)")
    options.add_argument("--seed", type=int, default=None, help="of chance; the time by default")
    options.add_argument("--guided", action="store_true", help="led by coverage, with atheris")
    options.add_argument("--case", default=None, metavar="LINE", help="judge this one case of a corpus")
    options.add_argument("--debug", action="store_true", help="with --case: the traceback")
    asked = options.parse_args(arguments)
    if asked.case is not None:
        if asked.target == "all":
            options.error("--case is one of a target, not of all")
        try:
            case = case_of(asked.case)
        except (ValueError, KeyError, TypeError, IndexError):
            options.error(f"--case {asked.case[:40]!r} is no line of a corpus")
        return _again(targets[asked.target], case, debug=asked.debug)
    if asked.guided and importlib.util.find_spec("atheris") is None:
        print("--guided needs atheris, which is not installed. Try: pip install -e '.[fuzz]'", file=sys.stderr)
        return 2
    seed = int(time.time()) if asked.seed is None else asked.seed
    wrong = 0.0
    for name in targets if asked.target == "all" else [asked.target]:
        begin = time.monotonic()
        total = watched(
            name, asked.seconds, seed, guided=asked.guided, may_end=targets[name].may_end,
            tell=lambda line: print(line, flush=True),
        )  # fmt: skip
        wrong += total["wrong"]
        counts = ", ".join(f"{value:g} {key}" for key, value in total.items())
        print(f"{name}: {counts}, seed {seed}, {(time.monotonic() - begin) / 60.0:.1f} min", file=sys.stderr)
    return int(wrong > 0)


def _again(target: Target, case: Case, *, debug: bool) -> int:
    if debug:
        data = case.content(target)
        known = target.known if case.seed else None
        _ = target.one(data) if known is None else known(case.seed, case.damages, data)
        return 0
    with limited_meanwhile():
        warmed(target)
        verdict = judged(target, case)
    print(verdict or "right")
    return int(verdict is not None)


if __name__ == "__main__":
    sys.exit(main())
