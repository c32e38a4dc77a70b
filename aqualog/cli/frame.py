"""What every command has in common: a command names its options, calls the face once, and says what it prints."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from aqualog.cli.options import OPTIONS

if TYPE_CHECKING:
    from aqualog.align.cache import SignalCache
    from aqualog.cli.console import Console, Heard
    from aqualog.face.campaign import Campaign
    from aqualog.face.campaign_runs import CampaignRuns
    from aqualog.face.drive import Drive
    from aqualog.face.result import Result

__all__ = ["BATCH_BROKEN_OFF", "Output", "Run", "command", "files_at"]

_GROUPS = {"data": ("csv", "decimal_comma:tables", "json")}
"""Options that stand together: in which forms a command gives its result."""

Files = Mapping[Path, Callable[[Path], None]]

BATCH_BROKEN_OFF = "the logs that are done are kept, the same command goes on with the rest"


@dataclass(frozen=True, slots=True)
class Output:
    """What a command leaves on stdout and stderr, its exit code, and files to write, all with the tables or none.

    `text` stands for a reader in place of the result's own; `notes` come after it, `details` with -v after those.
    Without `code` it is 3 where the result has a loss, else 0.
    """

    result: Result | None = None
    notes: Sequence[str] = ()
    details: Sequence[str] = ()
    text: str | None = None
    code: int | None = None
    files: Files = field(default_factory=dict)


def files_at(result: Result, places: Mapping[str, Path | None]) -> Files:
    """Return the files of a result that have a place, by it."""
    return {path: result.files()[name] for name, path in places.items() if path is not None}


@dataclass(frozen=True, slots=True)
class Run:
    """What a command was given: each field is the shared option of that name, `logs` as they were typed."""

    console: Console
    logs: tuple[str, ...] = ()
    vehicle: Path | None = None
    signals: Path | None = None
    dbc: tuple[Path, ...] = ()
    rate: float | None = None
    correct_offsets: bool = False
    cache: bool | None = False
    store: str | None = None
    thresholds: Path | None = None
    jobs: int | None = None
    model: Path | None = None
    csv: Path | None = None
    decimal_comma: bool = False
    json: bool = False
    force: bool = False

    def need_vehicle(self, why: str) -> None:
        """Refuse to work with a default car, which would make the result wrong.

        Raises
        ------
        ConfigError
        """
        from aqualog.core.errors import ConfigError
        from aqualog.face.arguments import VEHICLE_HINT

        if self.vehicle is None:
            raise ConfigError("no --vehicle", expected=f"a vehicle file: {why}", hint=VEHICLE_HINT)

    @contextmanager
    def hearing(self, interrupted: str = "") -> Iterator[Heard]:
        """Show what a call of the face is doing; `interrupted` says what an interrupt within leaves behind."""
        from aqualog.cli.console import told_if_interrupted

        with self.console.hearing() as hear, told_if_interrupted(interrupted):
            yield hear

    def drive(self, targets: Iterable[Path] = (), *, others: Sequence[Path] = (), all_files: bool = True) -> Drive:
        """Return the drive of all logs, after all checks that need no log to be opened.

        Neither logs, settings nor `others` may be among the files to be written, the `targets`. Unless `all_files` is
        False, the map may say nothing of a file that is not among the logs and `others`.

        Raises
        ------
        ConfigError, LogError
        """
        from aqualog.align.mapping import SignalMap
        from aqualog.config.signal_map import check_files, load_signal_map
        from aqualog.core.vehicle import Vehicle
        from aqualog.face.arguments import expand, list_files, refuse_existing
        from aqualog.face.drive import Drive
        from aqualog.io.fingerprint import state_of

        paths = expand(self.logs)
        before = state_of(paths)
        own = (*paths, *list_files(self.logs), *self.dbc, *(p for p in (self.signals, self.vehicle) if p))
        refuse_existing(targets, force=self.force, sources=(*own, *others))
        signal_map = load_signal_map(self.signals) if self.signals else SignalMap()
        if all_files:
            check_files(signal_map, (*paths, *others))
        return Drive(
            tuple(paths),
            signal_map,
            self.dbc,
            self.rate,
            Vehicle.read(self.vehicle) if self.vehicle else Vehicle(),
            self._cache(),
            own,
            before,
            correct_offsets=self.correct_offsets,
        )

    def _cache(self) -> SignalCache | None:
        """Return the cache if signals are to be kept and there is a place for them."""
        if not (bool(os.environ.get("AQUALOG_CACHE")) if self.cache is None else self.cache):
            return None
        from aqualog.face.cache import NoCacheFolderError, cache_of_user

        say = self.console.note if self.cache else self.console.detail
        try:
            return cache_of_user(tell=say)
        except NoCacheFolderError:
            say("there is no home folder to keep signals in; AQUALOG_CACHE names another")
            return None

    def campaign(self, inputs: Sequence[str] = ()) -> Campaign:
        """Read and check a campaign completely: `inputs`, or the logs as they were typed.

        Raises
        ------
        ConfigError
            With all faults in one message; also for a store that would end with this process.
        """
        from aqualog.core.errors import ConfigError
        from aqualog.face.campaign import Campaign
        from aqualog.guard.command import is_command

        if self.store is not None and is_command():
            from aqualog.campaign.place import is_of_process

            if is_of_process(self.store):
                raise ConfigError(
                    "is in the memory of this command and would end with it", where=self.store,
                    expected="a folder or a URL",
                )  # fmt: skip
        return Campaign(
            inputs or self.logs, vehicle=self.vehicle, map=self.signals, dbc=self.dbc, thresholds=self.thresholds,
            store=self.store,
        )  # fmt: skip

    def measured(self, campaign: Campaign, **options: Any) -> CampaignRuns:
        """Measure what is new, as `aqualog batch` does; every log that gives no result is reported on stderr."""
        with self.hearing(BATCH_BROKEN_OFF) as hear:
            return campaign.run(jobs=self.jobs, progress=hear, **options)

    def of_runs(self, runs: CampaignRuns, **output: Any) -> Output:
        """Return the output of a command on a campaign, with the exit code for what came of its logs."""
        from aqualog.core.errors import ExitCode

        has_some, lost = bool(runs.outcome.done), ExitCode.PARTIAL if runs.has_loss else ExitCode.DONE
        return Output(**output, code=int(lost if has_some else ExitCode.NOTHING_USABLE))

    def check_csv(self, others: Iterable[Any]) -> None:
        """Refuse a --csv that could not be written, before any work; `others` are the values of all other options.

        Raises
        ------
        ConfigError
        """
        from aqualog.core.errors import ConfigError
        from aqualog.face.arguments import refuse_existing
        from aqualog.face.result import check_csv

        if self.csv is not None:
            check_csv(self.csv)
            named = [
                p for o in others for p in (o if isinstance(o, list | tuple) else (o,)) if isinstance(p, str | Path)
            ]
            refuse_existing([self.csv], force=self.force, sources=[Path(p) for p in named if p])
        elif self.decimal_comma:
            raise ConfigError("--decimal-comma without --csv", expected="--csv FILE.csv, the tables that it is for")

    def finish(self, output: Output, *, has_files: bool = False) -> int:
        """Write what was asked for, unless it `has_files`, print what a command leaves, and return its exit code."""
        from aqualog.core.errors import AqualogError, ExitCode
        from aqualog.face.arguments import refuse_existing, write_together
        from aqualog.guard.streams import CLOSED

        result = output.result
        tables: Files = {}
        if result is not None and self.csv is not None:
            tables = result.csv_files(self.csv, decimal_comma=self.decimal_comma, force=self.force)
        refuse_existing([*output.files, *tables], force=True)  # no two results with one name
        write_together({**output.files, **tables})
        if result is not None:
            if 1 in CLOSED and not (has_files or output.files or tables):
                raise AqualogError("standard output is closed", hint="a place for the output, or a file for the result")
            self.console.data(result, as_json=self.json, text=output.text)
        for text in (*output.notes, *([f"tables: {', '.join(map(str, tables))}"] if tables else [])):
            self.console.note(text)
        for text in output.details:
            self.console.detail(text)
        if output.code is not None:
            return output.code
        return int(ExitCode.PARTIAL if result is not None and result.has_loss else ExitCode.DONE)


def command(
    takes: str, *, has_steps: bool = True, reads_logs: bool = True
) -> Callable[[Callable[..., Output]], Callable[..., None]]:
    """Make a command of its body.

    The body takes the `Run` and the options that it has as parameters. An error within becomes one line and an exit
    code, and its output is printed.

    Parameters
    ----------
    takes : str
        Names of the options in the order of the help.
    has_steps : bool
        Whether it takes -q, -v and --progress, too.
    reads_logs : bool
        Whether it works in a process of its own, which a log may end.
    """

    def made(body: Callable[..., Output]) -> Callable[..., None]:
        own = inspect.signature(body).parameters
        taken = [n for name in takes.split() for n in _GROUPS.get(name, (name,))]
        names = [*taken, *(("quiet", "verbose", "progress") if has_steps else ()), "debug"]
        options = [_parameter(name) for name in names]

        def work(**given: Any) -> None:
            from aqualog.cli.console import guarded
            from aqualog.guard.command import unsupervised

            if not reads_logs:
                unsupervised()
            with guarded(debug=given["debug"]):
                run = _run(given)
                if "csv" in given:
                    run.check_csv(v for n, v in given.items() if n != "csv")
                output = body(run, **{n: given[n] for n in own if n != "run"})
                is_kept = bool({"store:out", "out:watch"} & {*taken})  # these commands always write their result
                has_files = is_kept or any(given.get(n) is not None for n in ("out", "write"))
                code = run.finish(output, has_files=has_files)
            if code:
                raise typer.Exit(code)

        work.__name__, work.__doc__, work.__module__ = body.__name__, body.__doc__, body.__module__
        work.__annotations__ = {p.name: p.annotation for p in options}
        vars(work)["__signature__"] = inspect.Signature(options)
        return work

    return made


def _parameter(name: str) -> inspect.Parameter:
    """Return an option as a parameter for typer."""
    kind, default = OPTIONS[name]
    return inspect.Parameter(
        name.partition(":")[0], inspect.Parameter.KEYWORD_ONLY, annotation=kind,
        default=inspect.Parameter.empty if default is ... else default,
    )  # fmt: skip


def _run(given: Mapping[str, Any]) -> Run:
    from aqualog.cli.console import Console

    console = Console.make(
        quiet=given.get("quiet", False), verbose=given.get("verbose", False), progress=given.get("progress", "auto")
    )
    fields: dict[str, Any] = {n: given[n] for n in Run.__slots__ if n in given}
    fields |= {n: tuple(fields.get(n) or ()) for n in ("logs", "dbc")}
    return Run(console, **fields)
