"""`aq.simulate`: one drive of a scenario."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import file_of, whole_number
from aqualog.face.detect import model_of
from aqualog.face.drive import Drive
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, document_head

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.core.records import Signals
    from aqualog.model.scenario import Scenario
    from aqualog.model.simulate import Simulation as Made
    from aqualog.model.term import Model

__all__ = ["Simulation", "simulate"]


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Result):
    """A simulated drive: what a car's sensors see, and the truth.

    `made` holds the records, `factor` how many times faster than real it was simulated, `log` the file that the
    document names, `comment` what a written log says of its origin.
    """

    made: Made
    factor: float
    name: str
    comment: str
    log: str

    @property
    def scenario(self) -> Scenario:
        """What was driven and how it was measured, with the model's effects in it."""
        return self.made.setup.scenario

    @property
    def vehicle(self) -> Vehicle:
        """The car of the scenario."""
        return self.scenario.vehicle

    @cached_property
    def drive(self) -> Drive:
        """The drive, which `detect` and the others take; its signals are those of the written log (.mf4)."""
        from aqualog.model.log import signals_of

        given = signals_of(self.made, self.vehicle, Path(self.log).name)
        return Drive((), given=given, vehicle=self.vehicle, label=Path(self.log).name)

    @property
    def signals(self) -> Signals:
        """The signals on one time base, SI, as they are read from the log."""
        return self.drive.signals

    @property
    def truth(self) -> pl.DataFrame:
        """What no sensor sees: `t` [s] and the columns `true_...`, at the rate of the scenario."""
        import polars as pl

        from aqualog.model.log import grid_of, table_of

        groups = table_of(self.made)
        columns = {n: x for g in groups for n, (_, _, x) in g.columns.items() if n.startswith("true_")}
        return pl.DataFrame({"t": grid_of(self.made) * 1e-9, **columns}).fill_nan(None)

    @property
    def channels(self) -> list[str]:
        """Signals of the log, the truth among them."""
        return [n for g in self.made.measured for n in g.columns]

    @cached_property
    def document(self) -> dict[str, Any]:
        return {
            **document_head(),
            "log": self.log,
            "duration_s": self.scenario.duration_s,
            "sample_rate_hz": self.scenario.rate_hz,
            "seed": self.made.seed,
            "signals": self.channels,
            "real_time_factor": float(f"{self.factor:.4g}"),
        }

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`signals` and `truth`."""
        return {"signals": self.signals.frame, "truth": self.truth}

    def headline(self) -> str:
        s = self.scenario
        lanes = f"{len(s.lanes)} lane{'s' if len(s.lanes) != 1 else ''} with water or another surface"
        return "\n".join(
            [
                f"{self.name}, {s.vehicle.name}: {s.duration_s:g} s at {s.rate_hz:g} Hz, seed {self.made.seed}",
                f"  {len(self.channels)} signals, the truth among them; {lanes}",
                *(f"  note: {n}" for n in self.notes),
            ]
        )

    def plot(self) -> go.Figure:
        """Return the signals over time, a row for each unit."""
        return self.drive.plot()

    def files(self) -> Writers:
        """Return `simulation.json`, and the drive as an MDF log under the scenario's name."""
        return {f"{self.name}.mf4": lambda path: self._write(path, ".mf4"), "simulation.json": self._json_file()}

    def save(self, folder: PathLike, *, force: bool = False) -> tuple[Path, ...]:
        """Write log and document into a folder; the document names the log there."""
        return super(Simulation, self.naming(Path(folder) / f"{self.name}.mf4")).save(folder, force=force)

    def naming(self, path: PathLike) -> Simulation:
        """Return the same with `path` as the log that the document names."""
        return replace(self, log=str(path))

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the drive as a log: .mf4, .mcap, .csv or .parquet."""
        from aqualog.io.write_log import check_suffix

        suffix = check_suffix(file_of(path, "path"))
        return self._write_to(path, lambda p: self._write(p, suffix), force=force)

    def _write(self, path: Path, suffix: str) -> None:
        from aqualog.model.log import write_simulation

        write_simulation(path, self.made, suffix=suffix, comment=self.comment)


def simulate(
    scenario: PathLike | Scenario,
    *,
    model: PathLike | Model | None = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Simulation:
    """Simulate one drive.

    The same scenario, model and seed give the same drive. A whole programme: `aq.Campaign.simulate`.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Scenario file (TOML), or its record.
    model : Model, str or Path, optional
        Effects on top of the base, as `aq.diagnose` finds them.
    seed : int, optional
        In place of the scenario's.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    ConfigError
        Also if scenario or model ask for what the car cannot do.

    Examples
    --------
    >>> sim = aq.simulate("scenario.toml", seed=7)
    >>> aq.detect(sim.drive, sim.vehicle).events
    >>> sim.truth["true_contact_fl"], sim.write("drive.mf4")
    """
    hear = listener(progress)
    hear("reading")
    from aqualog.model.scenario import Scenario
    from aqualog.model.term import Model

    sources: list[Path] = []
    name = "simulated"

    if not isinstance(scenario, Scenario):
        from aqualog.config.scenario import load_scenario, vehicle_of

        path = file_of(scenario, "scenario", "a Scenario")
        sources += [path, *vehicle_of(path)]
        scenario, name = load_scenario(path), path.stem
    if seed is not None:
        scenario = replace(scenario, seed=whole_number(seed, "seed", 0, 2**63 - 1))
    known = model_of(model, scenario.vehicle, hear) or Model()
    named = ""
    if isinstance(model, str | Path):
        sources.append(Path(model))
        named = f", model {Path(model).stem}"
    hear("preparing")
    with hear.slow("the simulation"):  # without the compiling that a first run needs
        from aqualog.model.simulate import simulate as run

        run(replace(scenario, duration_s=min(scenario.duration_s, 0.2)))
    hear(f"simulating {scenario.duration_s:g} s")
    start = time.perf_counter()
    made = run(scenario, known)
    factor = scenario.duration_s / max(time.perf_counter() - start, 1e-9)
    for group in made.measured:
        hear.detail(f"  {group.name}: {group.t.size} samples")
    version, end = document_head()["tool_version"], made.setup.scenario.duration_s
    comment = f"simulated by aqualog {version}: scenario {name}{named}, seed {scenario.seed}"
    notes = tuple(
        f"the lane from {lane.start:g} s begins after the drive, which ends at {end:g} s"
        for lane in made.setup.scenario.lanes
        if not lane.in_metres and lane.start >= end
    )
    return Simulation(made, factor, name, comment, f"{name}.mf4", notes=notes, sources=tuple(sources))
