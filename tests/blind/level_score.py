"""`python -m tests.blind.level_score [--from 31000] [--each 5] [--json FILE]`: blind campaigns through the diagnosis on campaign level."""

import argparse
import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from aqualog.diagnose.campaign import diagnose_campaign
from aqualog.diagnose.run import Options
from tests.blind.level_world import CAR, CAR_AWD, Hidden, world

BOTH = ("f", "r")
CASES = {
    "null": (Hidden(), set(), {}),
    "contact_loss@f+r": (Hidden(contact=dict.fromkeys(BOTH, 2.4)), {"contact_loss"}, {"contact_loss": 2.4}),
    "contact_loss@r": (Hidden(contact={"r": 2.4}), {"contact_loss"}, {"contact_loss": 2.4}),
    "water_drag": (Hidden(drag=dict.fromkeys(BOTH, 2.4)), {"water_drag"}, {"water_drag": 2.4}),
    "slip_stiffness": (Hidden(stiffness=dict.fromkeys(BOTH, 0.8)), {"slip_stiffness"}, {"slip_stiffness": 0.8}),
    "track_clearing": (Hidden(track=3e-4), {"track_clearing"}, {"track_clearing": 3e-4}),
    "uneven_water": (Hidden(depth={"left": 0.6}), {"uneven_water"}, {"uneven_water": 0.6}),
    "drag+stiffness": (
        Hidden(drag=dict.fromkeys(BOTH, 2.4), stiffness=dict.fromkeys(BOTH, 0.8)), {"water_drag", "slip_stiffness"},
        {"water_drag": 2.4, "slip_stiffness": 0.8},
    ),
    "hump (in no library)": (Hidden(hump=0.08), None, {}),
}  # fmt: skip


def scored(truth, result):
    """`right`, `within` (truth in the set that cannot be told apart), `wrong`, or `none`."""
    names = {c.effect for c in result.causes}
    if truth is None:
        return "right" if result.verdict == "unexplained" else "none" if result.verdict == "no_effect" else "wrong"
    if not truth:
        return "right" if result.verdict == "no_effect" else "wrong"
    if result.verdict in ("named", "compound"):
        return "right" if names == truth else "wrong"
    if result.verdict == "cannot_tell":
        # the first of the sets that remain is not among the alternatives
        return "within" if truth <= names else "wrong"
    return "none"


def main():
    """Print a row per kind, and keep all of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--from", dest="first", type=int, default=31000)
    parser.add_argument("--each", type=int, default=5)
    parser.add_argument("--nulls", type=int, default=12)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    seed, rows = given.first, []
    for name, (hidden, truth, sizes) in CASES.items():
        for k in range(given.nulls if name == "null" else given.each):
            car = CAR_AWD if k % 3 == 2 else CAR
            data = world(seed, hidden, car=car)
            begin = time.perf_counter()
            r = diagnose_campaign(data, options=Options(seed=seed))
            first = {c.effect: next(iter(c.parameters.values())) for c in r.causes}
            covered = {e: first[e].low <= x <= first[e].high for e, x in sizes.items() if e in first}
            rows.append({
                "case": name, "seed": seed, "car": car.name, "verdict": r.verdict, "score": scored(truth, r),
                "causes": [c.key for c in r.causes], "covered": covered,
                "values": {e: [p.value, p.low, p.high] for e, p in first.items()},
                "sets": [[c.key for c in a.causes] for a in r.alternatives], "p": r.significance and r.significance.p_value,
                "left": [m.sentence for m in r.remainders], "gain": r.gain and [r.gain.log_score, r.gain.low],
                "seconds": round(time.perf_counter() - begin, 1),
            })  # fmt: skip
            print(json.dumps(rows[-1]), flush=True)
            seed += 1
    for name in CASES:
        mine = [r for r in rows if r["case"] == name]
        counts = {s: sum(r["score"] == s for r in mine) for s in ("right", "within", "none", "wrong")}
        hits = [x for r in mine for x in r["covered"].values()]
        print(f"{name:22s} {counts}  intervals that hold the truth: {sum(hits)}/{len(hits)}")
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
