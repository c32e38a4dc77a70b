"""`aq.init`: a start for one drive: the signal map, a vehicle file to fill in, and what to do next."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import AqualogError, ExitCode, SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import expand, file_of, refuse_existing
from aqualog.face.drive import DriveLike, drive_of, sources_of
from aqualog.face.inspect import Contents, inspect, proposal_words
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, document_head, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.overview import ChannelOverview
    from aqualog.align.propose import Proposal
    from aqualog.campaign.propose_files import Fact

__all__ = ["Question", "Start", "init"]

_MAIN = ("v_x", "a_x", "omega_fl", "omega_fr", "omega_rl", "omega_rr")  # a wrong unit of these makes all wrong
_MOST_QUESTIONS = 2
_MOST_RATIO = 100.0


@dataclass(frozen=True, slots=True)
class Question:
    """What names and data cannot say. `choices` are the answers; without any it is a number up to 100."""

    key: str
    text: str
    choices: tuple[str, ...] = ()

    def takes(self, answer: str) -> bool:
        """Whether an answer is one of those that are asked for, or empty: not known."""
        if not answer or self.choices:
            return not answer or answer in self.choices
        try:
            return 0.0 < abs(float(answer)) <= _MOST_RATIO
        except ValueError:
            return False


@dataclass(frozen=True, eq=False, repr=False)
class Start(Result):
    """A signal map and a vehicle file for one drive, as guessed from names, units and data: read them before use.

    `proposals` with the answers in them; `marks` are lines of the map that wait for a value; `facts` what is known of
    the car. `car` is the vehicle file that was given; without one a file to fill in is written.
    """

    contents: Contents
    folder: Path
    proposals: Mapping[str, Proposal]
    marks: tuple[str, ...]
    facts: Mapping[str, Fact]
    answers: tuple[tuple[Question, str], ...]
    car: Path | None = None

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the command."""
        return ExitCode.PARTIAL if self.has_loss else ExitCode.DONE

    @property
    def _needs_map(self) -> bool:
        from aqualog.align.propose import CANONICAL

        return bool(self.marks) or any(p.reason != CANONICAL for p in self.proposals.values())

    @property
    def unmapped(self) -> tuple[str, ...]:
        """The channels, `name [unit]`, that are no signal."""
        named = {p.entry.channel[0] for p in self.proposals.values()}
        return tuple(n for n in self.contents.unmapped if n.rpartition(" [")[0] not in named)

    @property
    def to_set(self) -> tuple[str, ...]:
        """Keys of the vehicle file that wait for a value."""
        from aqualog.campaign.propose_files import NEEDED

        known = [k for k, f in self.facts.items() if f.is_sure]
        return () if self.car is not None else tuple(k for k in NEEDED if k not in known)

    @cached_property
    def document(self) -> dict[str, Any]:
        return {
            **document_head(),
            "folder": str(self.folder),
            "written": [str(self.folder / n) for n in self.files()],
            "signals": {
                s: {"channel": p.entry.channel[0], "unit": p.entry.unit, "scale": p.entry.scale, "reason": p.reason,
                    "doubt": list(p.doubt)}
                for s, p in self.proposals.items()
            },
            "unmapped": list(self.unmapped),
            "questions": [{"key": q.key, "text": q.text, "answer": a or None} for q, a in self.answers],
            "set": list(self.to_set),
            "next": list(self.next_commands),
            "notes": list(self.notes),
        }  # fmt: skip

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`signals`: a row for each that is proposed."""
        own = self.document["signals"].items()
        return {"signals": rows_table({"signal": s, **p, "doubt": ", ".join(p["doubt"])} for s, p in own)}

    @property
    def next_commands(self) -> tuple[str, ...]:
        """The commands that come next, with these files; only what this log has the signals for."""
        given = self.contents.drive
        folder = {p.parent for p in given.paths}
        is_folder = len(given.paths) > 1 and len(folder) == 1 and expand([str(next(iter(folder)))]) == [*given.paths]
        names = [str(next(iter(folder)))] if is_folder else [str(p) for p in given.paths]
        logs = " ".join(shlex.quote(n) for n in names)
        more = [f"--signals {shlex.quote(str(self.folder / 'map.toml'))}"] if self._needs_map else []
        more += [f"--vehicle {shlex.quote(str(self.car or self.folder / 'vehicle.toml'))}"]
        more += [f"--dbc {shlex.quote(str(d))}" for d in given.dbc]
        options = " ".join(more)

        def own(name: str) -> str:
            return shlex.quote(str(self.folder / name))

        if any(s.startswith("torque_") for s in self.proposals):
            third = f"aqualog calibrate {logs} {options} -o {own('calibrated.toml')}"
        elif {"a_x", *(f"omega_{w}" for w in WHEELS)} <= set(self.proposals):
            third = f"aqualog slip-slope {logs} {options} --traction accelerometer -o {own('slip_slope')}"
        else:
            third = f"aqualog convert {logs} {options} -o {own('drive.mf4')}"
        second = []
        if any(s.startswith("omega_") for s in self.proposals):
            second = [f"aqualog detect {logs} {options} -o {own('out')}"]
        elif {"v_x", "a_x"} <= set(self.proposals):
            second = [f"aqualog diagnose {logs} {options} --page {own('diagnosis.html')}"]
        return (f"aqualog doctor {logs} {options}", *second, third)

    def text(self) -> str:
        from aqualog.report.values import NOTE, cut

        doubtful = [s for s, p in self.proposals.items() if p.doubt]
        found = f"{len(self.proposals)} signals found, {len(self.unmapped)} channels not mapped"
        lines = [f"{self.contents.drive.title}: {found}", "", "signals:"]
        lines += [f"  {s} = {proposal_words(p)}" for s, p in self.proposals.items()]
        todo = [f"  map.toml: {m}" for m in self.marks]
        todo += [f"  map.toml: the unit of {', '.join(doubtful)} (marked CHECK THE UNIT)"] if doubtful else []
        todo += [f"  vehicle.toml: {', '.join(self.to_set)} (marked SET)"] if self.to_set else []
        lines += ["", "to fill in or check:", *todo] if todo else []
        lines += ["", "notes:", *(f"  {cut(n, NOTE)}" for n in self.notes)] if self.notes else []
        lines += ["", f"written: {', '.join(str(self.folder / n) for n in self.files()) or 'nothing, all is there'}"]
        lines += ["next:", *(f"  {i}. {c}" for i, c in enumerate(self.next_commands, 1))]
        return "\n".join(lines) + "\n"

    def headline(self) -> str:
        lines = self.text().splitlines()
        return "\n".join([lines[0], *lines[-4:]])

    def plot(self) -> go.Figure:
        """Return over which time each channel has samples."""
        return self.contents.plot()

    def files(self) -> Writers:
        """Return `map.toml`, where the log needs one, and `vehicle.toml`, where none was given."""
        from aqualog.campaign.propose_files import vehicle_text

        name = self.contents.drive.paths[0].parent.resolve().name or "car"
        own = {"vehicle.toml": text_file(lambda: vehicle_text(name, self.facts))} if self.car is None else {}
        return {"map.toml": text_file(self._map_text), **own} if self._needs_map else own

    def _map_text(self) -> str:
        from aqualog.config.signal_map import map_text

        drive = self.contents.drive
        comments = [f"proposed for {', '.join(p.name for p in drive.paths)}: check every line"]
        entries = {s: p.entry for s, p in self.proposals.items()}
        return map_text(
            replace(drive.signal_map, entries=entries), comments=comments,
            remarks={s: p.remark for s, p in self.proposals.items()}, unmapped=self.unmapped, waiting=self.marks,
        )  # fmt: skip

    def write_files(self, *, force: bool = False) -> tuple[Path, ...]:
        """Write the files into the folder that `init` was given: all of them or none."""
        return self.save(self.folder, force=force)


def init(
    drive: DriveLike,
    folder: PathLike,
    vehicle: PathLike | None = None,
    *,
    ask: Callable[[Question], str] | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Start:
    """Propose a signal map and a vehicle file for one drive; `Start.write_files` writes them.

    Parameters
    ----------
    drive : Drive, str, Path or several
        From `aq.read`, or files of ONE drive.
    folder : str or Path
        Where the files are to be; nothing is written yet.
    vehicle : str or Path, optional
        The vehicle file, if there is one already.
    ask : callable, optional
        Called with at most two questions that names and data leave open; it returns the answer, or an empty text.
        Without it the files are marked there.
    force : bool
        Whether files that exist in the folder may be replaced.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    ConfigError
        If a file exists, or the vehicle file is wrong.
    LogError, SignalError
        If nothing can be read, or no channel is a signal.

    Examples
    --------
    >>> start = aq.init("drive.mf4", "work")
    >>> start.write_files()
    """
    one, out, hear = drive_of(drive), file_of(folder, "folder"), listener(progress)
    car = None if vehicle is None else file_of(vehicle, "vehicle")
    known = None if car is None else Vehicle.read(car)
    targets = [out / "map.toml", *([] if car is not None else [out / "vehicle.toml"])]
    sources = sources_of(one.sources, car)
    refuse_existing(targets, force=force, sources=sources)
    from aqualog.align.propose_map import check_one_drive, lacking_notes

    contents = inspect(one, progress=hear)
    check_one_drive([(o.file, o.path) for o in contents.overviews], contents.proposals.values())
    proposals, facts = dict(contents.proposals), _radii(contents)
    if not proposals:
        told = next((f" ({n})" for n in contents.notes if "CAN frames" in n), "")
        raise SignalError(
            f"none of {len(contents.overviews)} channels looks like a signal{told}", where=one.title,
            expected="speeds, accelerations, torques", hint="`aqualog inspect LOG` lists what is in it; --dbc for CAN",
        )  # fmt: skip
    answers: list[tuple[Question, str]] = []
    for question in _questions(contents, proposals, facts, known):
        if ask is None or len(answers) == _MOST_QUESTIONS:
            break
        answer = ask(question).strip()
        if not question.takes(answer):
            answer = ""
        answers.append((question, answer))
        _answered(question, answer, contents, proposals, facts)
    marks = tuple(_marks(contents, proposals))
    notes = [*contents.notes, *lacking_notes(proposals, contents.unmapped), *_codes(contents, proposals)]
    return Start(
        contents, out, proposals, marks, facts, tuple(answers), car, notes=tuple(dict.fromkeys(notes)),
        has_loss=contents.has_loss, sources=sources,
    )  # fmt: skip


# --- what names and data leave open ----------------------------------------------------------------------------------


def _questions(
    contents: Contents, proposals: Mapping[str, Proposal], facts: Mapping[str, Fact], car: Vehicle | None
) -> Iterator[Question]:
    """Yield what is worth asking, the most important first; what was answered before is known by then."""
    if car is None:
        yield Question("vehicle.drivetrain", "Which axle is driven?", tuple(_DRIVEN))
    doubtful = next((s for s in _MAIN if s in proposals and proposals[s].doubt), None)
    if doubtful is not None:
        p = proposals[doubtful]
        names = ", ".join(proposals[s].entry.channel[0] for s in _alike(proposals, doubtful))
        yield Question(f"map.{doubtful}.unit", f"In which unit is {names}?", (p.entry.unit or "", *p.doubt))
    motor, driven = _motor_torque(contents, proposals), _driven(facts, car)
    if motor is not None and driven:
        text = (
            f'Of "{motor.path}": how often does the motor turn for one turn of the wheels? Only if that never changes'
        )
        yield Question(f"map.{driven}.scale", text)


_DRIVEN = {"rwd": "torque_r", "fwd": "torque_f", "awd": ""}  # axle torque that a motor's is, times its ratio


def _driven(facts: Mapping[str, Fact], car: Vehicle | None) -> str:
    if car is not None:
        return _DRIVEN[car.drivetrain] if "drivetrain" in car.given else ""
    return _DRIVEN[facts["drivetrain"].value.strip('"')] if "drivetrain" in facts else ""


def _alike(proposals: Mapping[str, Proposal], symbol: str) -> list[str]:
    """Return the signals whose unit is open in the same way; of wheels all."""
    own, stem = proposals[symbol], symbol.partition("_")[0]
    return [s for s, p in proposals.items()
            if s.partition("_")[0] == stem and (p.entry.unit, p.doubt) == (own.entry.unit, own.doubt)]  # fmt: skip


def _answered(
    question: Question, answer: str, contents: Contents, proposals: dict[str, Proposal], facts: dict[str, Fact]
) -> None:
    """Put an answer where it belongs."""
    from aqualog.align.mapping import Entry
    from aqualog.align.propose import Proposal
    from aqualog.campaign.propose_files import Fact

    where, _, key = question.key.partition(".")
    symbol, _, part = key.partition(".")
    if not answer:
        return
    if where == "vehicle":
        facts[key] = Fact(f'"{answer}"', "as you said", is_sure=True)
    elif part == "unit":
        for s in _alike(proposals, symbol):
            p = proposals[s]
            proposals[s] = replace(
                p, entry=replace(p.entry, unit=answer), doubt=(), reason=f"name; {answer}, as you said"
            )
    else:
        motor = _motor_torque(contents, proposals)
        assert motor is not None
        entry = Entry(symbol, (motor.path,), motor.unit, scale=float(answer))
        proposals[symbol] = Proposal(entry, "name and unit; ratio as you said, losses not counted", 1.0)


def _motor_torque(contents: Contents, proposals: Mapping[str, Proposal]) -> ChannelOverview | None:
    """Return the torque of a motor that is in the log, where no torque of wheels is."""
    from aqualog.align.propose import words_of
    from aqualog.align.propose_map import MOTOR
    from aqualog.core.units import is_unit, parse_unit

    if any(s.startswith("torque_") for s in proposals):
        return None
    torques = (o for o in contents.overviews if is_unit(o.unit) and parse_unit(o.unit).dimension == "torque")
    return next((o for o in torques if MOTOR & set(words_of(o.name)) and o.low < o.high), None)


def _marks(contents: Contents, proposals: Mapping[str, Proposal]) -> Iterator[str]:
    """Yield lines for the map that wait for a value."""
    from aqualog.align.mapping import quoted

    motor = _motor_torque(contents, proposals)
    if motor is not None:
        yield (
            f"SET torque_r = {{ channel = {quoted(motor.path)}, scale = ... }}: turns of the motor for one turn of the "
            "wheels, if that never changes; torque_f for a driven front axle"
        )


def _codes(contents: Contents, proposals: Mapping[str, Proposal]) -> Iterator[str]:
    """Yield remarks on values that are perhaps error codes, of mapped channels."""
    used = {p.entry.channel[0] for p in proposals.values()}
    for o in contents.overviews:
        if {o.path, f"{o.file}:{o.path}"} & used and "invalid = " in o.remark:
            yield f"{o.path}: {o.remark}"


def _radii(contents: Contents) -> dict[str, Fact]:
    """Return the rolling radii by the reference velocity, where the wheels give their turning."""
    import numpy as np

    from aqualog.align.load import load_signals
    from aqualog.campaign.propose_files import Fact
    from aqualog.core.units import parse_unit

    drive = contents.drive
    try:
        signals = load_signals(drive.paths, vehicle=Vehicle(), signal_map=contents.map, dbc=drive.dbc)
    except AqualogError:
        return {}
    v, found = signals.array("v_x"), {}
    for axle in ("f", "r"):
        pair = [f"omega_{axle}{side}" for side in "lr"]
        units = [signals.origins[w].unit for w in pair if w in signals.origins]
        if len(units) < len(pair) or any(parse_unit(u).dimension != "angular_speed" for u in units):
            continue
        omega = 0.5 * (signals.array(pair[0]) + signals.array(pair[1]))
        rolls = (v > _ROLLS) & (omega > 0.0)
        if rolls.sum() >= _LEAST:
            radius = float(np.median(v[rolls] / omega[rolls]))
            found[f"wheels.r_e_{axle}"] = Fact(f"{radius:.4g}", "guessed: v_x over the wheel speeds of this log")
    return found


_ROLLS = 8.0  # [m/s]
_LEAST = 200  # samples
