"""Detectors and rivals over simulated situations: recall, false alarms, the matrix of C78.

    python -m tests.evaluate.study --hours 100 --first 1000 --jobs 2 --rivals --out study
    python -m tests.evaluate.study --pool tuning --hours 10 --first 1 --roc --rivals --tune t.toml --out tuning
    python -m tests.evaluate.study --hours 100 --first 1000 --rivals --thresholds t.toml --out tuned

A chunk is one drive of every situation with one seed; it is one file in the folder, and the same command goes on where
it was broken off. A chunk of other code, thresholds or options is made again. `--tune` chooses from the curves of the
pool `tuning` and writes a thresholds file; the joint detectors see the single ones at the thresholds of this run, so a
second run with `--thresholds` of the first one refines them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import os
import pickle
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np

import aqualog
from aqualog.core.errors import AqualogError
from aqualog.core.notation import WHEELS
from tests.evaluate.rods import with_tie_rods

SOURCES = ("physics", "features", "calibrate", "detect", "rivals", "model", "evaluate")


def code_stamp() -> str:
    """Hash of everything that a record depends on."""
    package = Path(aqualog.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(p for name in SOURCES for p in (package / name).rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def margin_kmh(signals) -> str:
    """How far the speed was from floating, in steps of 10 km/h; empty without water.

    Of each wheel the median over the water, since an uneven lane is deep somewhere; of the wheels the largest.
    """
    best = -np.inf
    for w in WHEELS:
        full, film = signals.array(f"true_full_speed_{w}"), signals.array(f"true_film_{w}")
        with np.errstate(invalid="ignore"):
            on = np.isfinite(full) & (film > 0.0)
        if on.any():
            best = max(best, float(np.median((signals.array("true_v_x") - full)[on])) * 3.6)
    return "" if not np.isfinite(best) else f"{10.0 * np.floor(best / 10.0):g}"


def with_terms(scenario, seed: int):
    """The same drive on an uneven road, with rims that swing and friction of the steering."""
    front, rear = (replace(t, torsion_frequency=38.0) for t in (scenario.tyre_front, scenario.tyre_rear))
    road = (16e-6, 64e-6)[seed % 2]
    return replace(scenario, unevenness=road, steering_friction=150.0, tyre_front=front, tyre_rear=rear)


def made(name: str, seed: int, pool_name: str, *, terms: bool = False):
    """A drawn drive with its labels; `terms` of the simulator that are off by default."""
    from aqualog.evaluate.drives import Drive, labels_in
    from aqualog.model import situations
    from aqualog.model.log import as_signals
    from aqualog.model.simulate import simulate

    pool = {"tuning": situations.TUNING_POOL, "scoring": situations.SCORING_POOL}[pool_name]
    drawn = situations.draw(name, seed, pool)
    believed = with_tie_rods(drawn.believed, drawn.scenario)
    driven = with_terms(drawn.scenario, seed) if terms else drawn.scenario
    signals = as_signals(simulate(driven, drawn.model), vehicle=believed)
    lanes = [max(lane.depth_left, lane.depth_right) for lane in drawn.scenario.lanes]
    groups = {
        "manoeuvre": name,
        "kind": drawn.kind,
        "vehicle": drawn.scenario.vehicle.name,
        "drivetrain": drawn.scenario.vehicle.drivetrain,
        "tyre": drawn.scenario.tyre_front.name,
        "water_depth_mm": f"{max(lanes, default=0.0) * 1e3:g}",
        "margin_kmh": margin_kmh(signals),
        "seed": str(seed),
        "note": drawn.note,
    }
    return Drive(f"{name} {seed}", signals, believed, labels_in(signals), groups)


def chunk(seed: int, options: dict) -> dict:
    """One drive of each situation: records by factor."""
    from aqualog.config.thresholds import load_thresholds
    from aqualog.detect.thresholds import DEFAULT
    from aqualog.evaluate.judge import judge
    from aqualog.evaluate.sweep import FACTORS, records_at

    own, rivals = load_thresholds(Path(options["thresholds"])) if options["thresholds"] else (DEFAULT, {})
    asked = rivals if options["rivals"] else None
    drives, failed = [], {}
    for name in options["situations"]:
        try:
            drive = made(name, seed, options["pool"], terms=options["terms"])
            records = {1.0: judge(drive, thresholds=own, rivals=asked)}
            for factor in FACTORS if options["roc"] else ():
                if factor != 1.0:
                    records[factor] = records_at(drive, factor, thresholds=own, rivals=asked)
        except AqualogError as error:
            failed[f"{name} {seed}"] = error.line()
            continue
        drives.append(records)
    return {"options": options, "seed": seed, "drives": drives, "failed": failed}


def load(path: Path, options: dict) -> dict | None:
    try:
        found = pickle.loads(path.read_bytes())  # of this command alone
    except (OSError, ValueError, EOFError, pickle.UnpicklingError):
        return None
    return found if found.get("options") == options else None


def seconds_of(found: dict) -> float:
    """Driving outside aquaplaning situations. [s]"""
    return sum(d[1.0].duration_s for d in found["drives"] if d[1.0].groups["kind"] == "nuisance")


def collect(a, options: dict) -> list[dict]:
    a.out.mkdir(parents=True, exist_ok=True)
    began, done, seconds, seed = time.monotonic(), [], 0.0, a.first
    kept = 0
    while seconds < 3600.0 * a.hours and (found := load(a.out / f"chunk_{seed}.pickle", options)):
        done.append(found)
        seconds += seconds_of(found)
        seed += 1
        kept += 1
    print(f"{kept} chunks are there, {seconds / 3600.0:.2f} h", flush=True)
    if seconds >= 3600.0 * a.hours:
        return done
    os.environ["POLARS_MAX_THREADS"] = "1"
    warm = chunk(a.first, {**options, "situations": options["situations"][:1]})  # compiles once, before all do
    assert warm["drives"] or warm["failed"]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(a.jobs, mp_context=context) as pool:
        pending = {}

        def submit() -> None:
            nonlocal seed
            while (found := load(a.out / f"chunk_{seed}.pickle", options)) is not None:
                done.append(found)
                seed += 1
            pending[pool.submit(chunk, seed, options)] = seed
            seed += 1

        for _ in range(a.jobs):
            submit()
        while pending:
            future = next(as_completed(pending))
            number, found = pending.pop(future), future.result()
            temporary = a.out / f"chunk_{number}.tmp"
            temporary.write_bytes(pickle.dumps(found))
            temporary.replace(a.out / f"chunk_{number}.pickle")
            done.append(found)
            seconds = sum(seconds_of(f) for f in done)
            print(f"{seconds / 3600.0:.2f} h of {a.hours:g} h, {time.monotonic() - began:.0f} s", flush=True)
            if seconds + len(pending) * seconds / len(done) < 3600.0 * a.hours:
                submit()
    return sorted(done, key=lambda f: f["seed"])


def sentences(records) -> list[str]:
    """False alarms of each detector over all nuisances, and the situations that make them."""
    from aqualog.evaluate.score import detector_names, grouped, score

    lines = []
    quiet = [r for r in records if r.groups["kind"] == "nuisance"]
    for name in detector_names(records):
        s = score(quiet, name)
        if not s.runs:
            continue
        per = {key[0]: score(some, name) for key, some in grouped(quiet, ["manoeuvre"]).items()}
        worst = sorted(per.items(), key=lambda item: -item[1].false_alarms.count)
        told = ", ".join(f"{k} {x.false_alarms.count}" for k, x in worst[:6] if x.false_alarms.count)
        low, high = s.false_alarms.per_hour_ci95
        lines.append(
            f"{name}: {s.false_alarms.count} false alarms in {s.false_alarms.seconds / 3600:.2f} h and "
            f"{s.false_alarms.metres / 1e3:.0f} km of nuisances: {s.false_alarms.per_hour:.3g} per h "
            f"({low:.2g} ... {high:.2g}){': ' + told if told else ''}"
        )
    return lines


def by_margin(records) -> str:
    """Recall over how far the drive's fastest moment was from full aquaplaning."""
    from aqualog.evaluate.score import detector_names, grouped, score
    from aqualog.report.evaluation_words import recall_text
    from aqualog.report.text import table

    wet = [r for r in records if r.groups["margin_kmh"]]
    rows = []
    for key, some in grouped(wet, ["margin_kmh"]).items():
        for name in detector_names(records):
            s = score(some, name)
            if s.full.episodes or s.partial.episodes:
                rows.append((f"{key[0]} km/h", name, recall_text(s.full), recall_text(s.partial)))
    return table(("from full speed", "detector", "full", "partial"), rows)


def main() -> None:
    from aqualog.config.thresholds import load_thresholds, thresholds_text
    from aqualog.detect.thresholds import DEFAULT
    from aqualog.evaluate.run import Evaluation
    from aqualog.evaluate.sweep import applied, choose, curve_points
    from aqualog.model.situations import SITUATIONS
    from aqualog.report.evaluation import evaluation_document, evaluation_report
    from aqualog.report.page import report_page, write_page
    from aqualog.report.text import report_text

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=1.0, help="driving in nuisance situations")
    parser.add_argument("--first", type=int, required=True, help="first seed")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--pool", choices=("tuning", "scoring"), default="scoring")
    parser.add_argument("--rivals", action="store_true")
    parser.add_argument("--terms", action="store_true", help="with terms that are off by default, see `with_terms`")
    parser.add_argument("--roc", action="store_true", help="also at scaled thresholds; takes about ten times as long")
    parser.add_argument("--thresholds", default="", help="thresholds file")
    parser.add_argument("--tune", type=Path, help="choose thresholds from the curves and write them (pool tuning)")
    parser.add_argument("--situations", default="", help="names, separated by commas; default all")
    parser.add_argument("--out", type=Path, default=Path("study"))
    a = parser.parse_args()
    if a.tune and (a.pool != "tuning" or not a.roc):
        parser.error("--tune needs --pool tuning and --roc")
    options = {
        "code": code_stamp(),
        "pool": a.pool,
        "rivals": a.rivals,
        "terms": a.terms,
        "roc": a.roc,
        "thresholds": a.thresholds,
        "values": Path(a.thresholds).read_text(encoding="utf-8") if a.thresholds else "",
        "situations": a.situations.split(",") if a.situations else list(SITUATIONS),
    }
    found = collect(a, options)
    by_factor: dict[float, list] = {}
    for drive in (d for f in found for d in f["drives"]):
        for factor, record in drive.items():
            by_factor.setdefault(factor, []).append(record)
    failed = {name: reason for f in found for name, reason in f["failed"].items()}
    own, rivals = load_thresholds(Path(a.thresholds)) if a.thresholds else (DEFAULT, {})
    asked = rivals if a.rivals else None
    roc = curve_points(by_factor, thresholds=own, rivals=asked) if a.roc else ()
    evaluation = Evaluation(tuple(by_factor[1.0]), own, asked, roc, failed)
    print(f"pool {a.pool}, seeds {found[0]['seed']} ... {found[-1]['seed']}, code {options['code']}")
    print(report_text(evaluation_report(evaluation)))
    print("\n".join(sentences(evaluation.records)))
    print()
    print(by_margin(evaluation.records))
    for name, reason in failed.items():
        print(f"failed: {name}: {reason}")
    (a.out / "evaluation.json").write_text(
        json.dumps(evaluation_document(evaluation, by=["margin_kmh"]), indent=1, allow_nan=False) + "\n",
        encoding="utf-8",
    )
    page = report_page(evaluation_report(evaluation), title=f"situations, pool {a.pool}")
    write_page(a.out / "evaluation.html", page)
    if a.tune:
        choices = choose(roc)
        tuned, tuned_rivals = applied(choices, own, dict(rivals))
        about = f"chosen on situations of the pool {a.pool}, seeds {found[0]['seed']} to {found[-1]['seed']}"
        a.tune.write_text(thresholds_text(tuned, tuned_rivals if a.rivals else {}, comments=[about]), encoding="utf-8")
        for name, choice in choices.items():
            p = choice.point
            print(f"{name}: {p.threshold:.4g} ({p.factor:.3g} times), {choice.reason}, {p.false_alarms.count} alarms")


if __name__ == "__main__":
    main()
