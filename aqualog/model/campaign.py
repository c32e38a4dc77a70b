"""Write a whole programme of simulated drives into a folder: logs, vehicle files, campaign file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from aqualog.core.errors import AqualogError, ConfigError
from aqualog.core.vehicle import Vehicle, vehicle_toml
from aqualog.guard.worker import Crashed, work_on
from aqualog.io.atomic_write import write_text, write_whole
from aqualog.model.log import write_simulation
from aqualog.model.programme import PROGRAMMES, WEAR, Run
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import simulate

__all__ = ["CampaignOutcome", "simulate_campaign"]

STATE = "simulated.jsonl"  # one line per finished log, so that an interrupted run can be continued
_COLUMNS = (
    "log", "tyre", "tread_depth_mm", "wear", "pressure_front_bar", "pressure_rear_bar", "water_depth_mm",
    "water_depth_left_mm", "load_front_kg", "load_rear_kg", "manoeuvre", "vehicle", "lane_start_s", "lane_end_s",
    "x_speed_kmh", "x_seed", "x_figures",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Done:
    """A finished log: `lane_start_s` and `lane_end_s` are NaN on a dry road."""

    name: str
    digest: str
    size: int  # [byte] of the log
    lane_start_s: float
    lane_end_s: float


@dataclass(frozen=True, slots=True)
class CampaignOutcome:
    """Outcome of a programme: logs made now, logs kept from before, and name -> reason of those that failed."""

    made: int
    kept: int
    failed: dict[str, str]


def simulate_campaign(
    programme: str, folder: Path, *, jobs: int, force: bool, report: Callable[[int, int], None]
) -> CampaignOutcome:
    """Simulate a programme into a folder.

    Parameters
    ----------
    programme : str
        Name in `PROGRAMMES`.
    folder : Path
        Created if missing. A folder in which the same programme was begun is completed: logs whose scenario and
        simulation have not changed are kept.
    jobs : int
        Processes.
    force : bool
        Make all logs again.
    report : callable
        Called with logs done and logs in all.

    Raises
    ------
    ConfigError
        If there is no such programme, or the folder holds other files.
    """
    if programme not in PROGRAMMES:
        raise ConfigError(f'no programme "{programme}"', expected=", ".join(PROGRAMMES))
    runs = PROGRAMMES[programme]()
    _own(folder)
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    stamp = _code_stamp()
    # all inputs of a run, the same in every process: sets of names, as in a vehicle, have no order of their own
    believed = {r.name: "" if r.vehicle is None else vehicle_toml(r.vehicle) for r in runs}
    inputs = {r.name: f"{stamp}{replace(r, vehicle=None)!r}{believed[r.name]}" for r in runs}
    digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in inputs.items()}
    known = {} if force else _finished(folder, digests)
    # a torn last line would swallow the next one
    write_text(folder / STATE, "".join(_line(done) for done in known.values()))
    todo = [r for r in runs if r.name not in known]
    for run in todo:  # half-written files that a killed process has left, by the names that `write_whole` gives
        for orphan in (folder / "logs").glob(f".{run.name[:40]}-{'?' * 8}.mf4.tmp"):
            orphan.unlink(missing_ok=True)
    report(len(known), len(runs))
    failed: dict[str, str] = {}
    made: dict[str, Done] = {}

    def record(name: str, outcome: Done | str) -> None:
        if isinstance(outcome, Done):
            made[name] = outcome
            with (folder / STATE).open("a", encoding="utf-8") as file:
                file.write(_line(outcome))
        else:
            failed[name] = outcome
        report(len(known) + len(made) + len(failed), len(runs))

    _work(todo, folder, digests, jobs=jobs, record=record)
    _write_campaign(folder, programme, [r for r in runs if r.name not in failed], known | made)
    return CampaignOutcome(len(made), len(known), failed)


def _own(folder: Path) -> None:
    """Refuse a folder that holds anything but an earlier state of a campaign."""
    if folder.exists() and not folder.is_dir():
        raise ConfigError("is a file", where=str(folder), expected="a folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / STATE).exists():
        raise ConfigError("holds other files", where=str(folder), expected="an empty folder, or one of this command")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / STATE).touch()


def _finished(folder: Path, digests: dict[str, str]) -> dict[str, Done]:
    """Return complete logs of the same scenario by the same code; a damaged line counts as not made."""
    done: dict[str, Done] = {}
    for line in (folder / STATE).read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            raw = json.loads(line)
            texts, size = (str(raw["name"]), str(raw["digest"])), int(raw["size"])
            entry = Done(*texts, size, float(raw["lane_start_s"]), float(raw["lane_end_s"]))
        except (ValueError, TypeError, KeyError, RecursionError):
            continue
        log = _log(folder, entry.name)
        if digests.get(entry.name) == entry.digest and log.is_file() and log.stat().st_size == entry.size:
            done[entry.name] = entry
    return done


def _line(done: Done) -> str:
    return json.dumps(asdict(done)) + "\n"


def _log(folder: Path, name: str) -> Path:
    return folder / "logs" / f"{name}.mf4"


def _code_stamp() -> str:
    """Return a hash of the simulation's own sources: another equation makes other logs."""
    package = Path(__file__).resolve().parents[1]
    content = hashlib.sha256()
    for path in sorted([*(package / "physics").glob("*.py"), *(package / "model").glob("*.py")]):
        content.update(path.read_bytes())
    return content.hexdigest()


def _work(
    runs: Sequence[Run], folder: Path, digests: dict[str, str], *, jobs: int, record: Callable[[str, Done | str], None]
) -> None:
    """Record each run's outcome as it comes; a failed run does not stop the others, an interrupt loses none."""
    if not runs:
        return
    simulate(Scenario(Vehicle(), duration_s=0.2))  # compiles once, before several processes do
    tasks = {r.name: (r, str(_log(folder, r.name)), digests[r.name]) for r in runs}

    def recorded(name: str, outcome: Done | str | Crashed) -> None:
        record(name, "its process ended: out of memory, or killed" if isinstance(outcome, Crashed) else outcome)

    work_on(tasks, _one, jobs=jobs, record=recorded)


def _one(run: Run, path: str, digest: str) -> Done | str:
    try:
        simulation = simulate(run.scenario, run.model)
        comment = f"simulated: {run.name}, seed {run.scenario.seed}"
        write_whole(Path(path), lambda p: write_simulation(p, simulation, suffix=".mf4", comment=comment))
    except (AqualogError, OSError) as error:
        return str(error)
    size = Path(path).stat().st_size
    on_water = simulation.truth.columns.get("on_water")
    if on_water is None or not on_water.any():
        return Done(run.name, digest, size, float("nan"), float("nan"))
    wet = simulation.truth.t[on_water > 0.5]
    return Done(run.name, digest, size, round(float(wet[0]), 3), round(float(wet[-1]), 3))


def _write_campaign(folder: Path, programme: str, runs: Sequence[Run], done: dict[str, Done]) -> None:
    """Write vehicle files, the table of runs, and last the campaign file that joins them."""
    vehicles: dict[str, Vehicle] = {_vehicle_file(r): r.vehicle or r.scenario.vehicle for r in runs}
    for name, vehicle in vehicles.items():
        write_text(folder / name, vehicle_toml(vehicle))
    rows = [_row(r, done[r.name]) for r in runs]
    table = "\n".join([",".join(_COLUMNS), *(",".join(row) for row in rows)]) + "\n"
    write_text(folder / "runs.csv", table)
    first = next(iter(vehicles), "vehicle.toml")
    write_text(
        folder / "campaign.toml",
        f'# Simulated, not measured.\nname = "{programme}"\nvehicle = "{first}"\nruns = "runs.csv"\n',
    )


def _vehicle_file(run: Run) -> str:
    if run.vehicle is not None:
        return f"vehicle_{run.name}.toml"
    stem = "".join(c if c.isalnum() else "_" for c in run.scenario.vehicle.name.lower()).strip("_")
    return f"vehicle_{'_'.join(part for part in stem.split('_') if part)}.toml"


def _row(run: Run, done: Done) -> list[str]:
    s = run.scenario
    lane = s.lanes[0] if s.lanes else None
    middle = np.interp(0.5 * s.duration_s, [p[0] for p in s.speed], [p[1] for p in s.speed]) * 3.6
    values = {
        "log": f"logs/{run.name}.mf4",
        "tyre": s.tyre_front.name,
        "tread_depth_mm": f"{s.tyre_front.tread_depth * 1e3:.2f}",
        "wear": WEAR.get(s.tyre_front.name, "worn"),
        "pressure_front_bar": f"{s.p_front * 1e-5:.2f}",
        "pressure_rear_bar": f"{s.p_rear * 1e-5:.2f}",
        "water_depth_mm": f"{run.water_depth * 1e3:.2f}",
        "water_depth_left_mm": f"{(lane.depth_left if lane else 0.0) * 1e3:.2f}",
        "load_front_kg": f"{s.load_front:.0f}",
        "load_rear_kg": f"{s.load_rear:.0f}",
        "manoeuvre": run.manoeuvre,
        "vehicle": _vehicle_file(run),
        "lane_start_s": "" if np.isnan(done.lane_start_s) else f"{done.lane_start_s:.3f}",
        "lane_end_s": "" if np.isnan(done.lane_end_s) else f"{done.lane_end_s:.3f}",
        "x_speed_kmh": f"{middle:.0f}",
        "x_seed": str(s.seed),
        "x_figures": run.figures.replace(",", " "),
    }
    return [values[name] for name in _COLUMNS]
