"""The commands by name. A module is imported when its command is asked for, not to list it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

__all__ = ["COMMANDS", "Command", "Commands", "loaded"]


class Command(NamedTuple):
    """A command: where it is, and the first paragraph of its help.

    `module` of `aqualog.cli` and `function` in it, or a `typer.Typer` with commands of its own; empty: it is named as
    the command is. `runs_bare`: without arguments it does something else than to show its help.
    """

    module: str
    line: str
    function: str = ""
    runs_bare: bool = False

    def load(self, name: str) -> Any:
        """The function or the `typer.Typer` of the command of that name."""
        return getattr(import_module(f"aqualog.cli.{self.module}"), self.function or name.replace("-", "_"))


COMMANDS = {
    "detect": Command("drive", "Detect aquaplaning in one drive."),
    "inspect": Command(
        "logs",
        "List what a log holds, and propose which channel is which signal; of a campaign file, show the test matrix.",
    ),
    "init": Command(
        "logs", "Begin with one drive: write its signal map and a vehicle file to fill in, and print what to do next."
    ),
    "doctor": Command("logs", "Report what is wrong with a log, what was lost of it, and what to do."),
    "convert": Command(
        "logs", "Write the aligned signals of one drive as one log, in SI units and with canonical names."
    ),
    "align": Command("logs", "Find the clock offset (and drift) between sources from a quantity that both carry."),
    "slip-slope": Command(
        "drive", "Estimate the slip slope C_s/F_z of each driven wheel, its interval, and whether it stayed the same."
    ),
    "batch": Command("campaign", "Run every log of a campaign through the detectors and keep the results."),
    "plan": Command(
        "campaign", "Estimate what `aqualog batch` on a campaign will cost: time, memory, room in the store, shards."
    ),
    "bin-slipslope": Command(
        "campaign", "Slip slope over speed for each configuration, and the speed of full aquaplaning."
    ),
    "bin-resistance": Command("campaign", "Mean resistance measure over speed for each configuration."),
    "report": Command(
        "campaign",
        "Make the page of a campaign: quality, test matrix, slip slope and resistance over speed, detections, all "
        "runs.",
    ),
    "calibrate": Command(
        "drives",
        "Estimate what detectors must know of a car from its dry drives, with intervals and what cannot be determined.",
    ),
    "diagnose": Command(
        "drives",
        "Find what the simulation gets wrong on measured drives: the cause, its size and interval, and the gain.",
    ),
    "validate": Command(
        "drives", "Judge whether the simulation of a car is valid on measured drives: in one sentence, and why not."
    ),
    "evaluate": Command(
        "drives", "Compare what the detectors find with what was there: recall, latency, false alarms, confusion."
    ),
    "test": Command(
        "trade",
        "Tyre tests as the trade publishes them: straight and curved aquaplaning, wet braking.",
        function="test_app",
    ),
    "watch": Command(
        "trade",
        "Measure the runs of a tyre test as their logs arrive in a folder: a line and a page that renews itself.",
    ),
    "simulate": Command("thesis", "Simulate one drive of a scenario file, or the drives of a measuring campaign."),
    "figures": Command("thesis", "Make figures of the thesis again, from runs, with what they say about its claims."),
    "reproduce": Command(
        "thesis", "Reproduce the thesis: simulate its campaign, run everything, and judge each of its claims."
    ),
    "cache": Command("logs", "Show or empty the folder in which aligned signals are kept.", runs_bare=True),
    "campaign": Command("campaign", "Campaign files: many drives in known configurations.", function="campaign_app"),
    "help": Command(
        "help",
        "Show the documents: topics, one page, or the pages that hold a word.",
        function="help_pages",
        runs_bare=True,
    ),
}


def loaded() -> dict[str, Any]:
    """Every command as the command line has it, imported: for the reference."""
    return {name: _made(name, command) for name, command in COMMANDS.items()}


class _Light:
    """A command that reads texts and paths without pydantic, which typer loads for them in a tenth of a second."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters."""
        found: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for parameter in found:
            if getattr(parameter, "_runtime_param", self) is None:  # typer's own attribute: without it, its way holds
                parameter._runtime_param = _Read()
        return found


class _Read:
    """How a parameter is read."""

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the value of a parameter as typer does; a number goes its way."""
        is_many = param.multiple or param.nargs == -1
        if value is None:
            return () if is_many else None
        kind = _PLAIN.get(param.type_descriptor.annotation)
        values = list(value) if is_many and isinstance(value, list | tuple) else [value]
        if kind is not None and all(isinstance(v, str | Path) and (kind is str or _is_readable(v)) for v in values):
            return [kind(v) for v in values] if is_many else kind(value)
        if not is_many and isinstance(value, float | int) and value == param.default:
            return value
        from typer._coercion import build_runtime_param

        return build_runtime_param(param.type_descriptor).coerce(value, param, ctx)


_PLAIN: dict[Any, Callable[[Any], Any]] = {str: str, list[str]: str, Path: Path, list[Path]: Path}


def _is_readable(name: str | Path) -> bool:
    """Return whether a path is free or can be read; of one that cannot, typer says so."""
    return "\0" not in str(name) and (os.access(name, os.R_OK) or not os.path.lexists(name))


class _Command(_Light, TyperCommand):
    """One command."""


class Commands(_Light, TyperGroup):
    """The group of all commands: each is its line of help until it is asked for."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = {n: TyperCommand(n, help=c.line) for n, c in COMMANDS.items()} | dict(self.commands)

    def make_context(self, *args: Any, **options: Any) -> Any:
        """Look at the arguments, for which libraries are loaded."""
        with _told_if_interrupted():
            return super().make_context(*args, **options)

    def invoke(self, ctx: Any) -> Any:
        """Load a command and run it."""
        with _told_if_interrupted():
            return super().invoke(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments begin with."""
        name = args[0]
        if name in COMMANDS:
            self.commands[name] = _made(name, COMMANDS[name])
            _refuse_empty(self.commands[name], args[1:])
        return super().resolve_command(ctx, args)


_PLACES = ("FILE", "DIR", "PATH", "LOG", "CAMPAIGN.toml")


def _refuse_empty(command: Any, args: list[str]) -> None:
    """Stop where a file or folder has no name: later it would be taken for the folder in which the user happens to be.

    `args` are what stands behind the command.
    """
    if args and (below := getattr(command, "commands", {}).get(args[0])) is not None:
        _refuse_empty(below, args[1:])
        return
    options = {o: p for p in command.params for o in p.opts if o.startswith("-") and not getattr(p, "is_flag", False)}
    before = ""
    for arg in args:
        name, is_joined, value = arg.partition("=")
        is_given = bool(is_joined) and name in options
        option = options.get(name if is_given else before)
        is_empty = not (value if is_given else arg).strip()
        if is_empty and (option is None or option.metavar in _PLACES):
            what = "a name" if option is None else name if is_given else before
            expected = "a file or folder" if option is None else "a folder" if option.metavar == "DIR" else "a file"
            sys.stderr.write(f"error: {what} is empty; expected {expected}. Try: check the shell's variables\n")
            raise typer.Exit(2)
        before = "" if is_given or before in options else arg


@contextmanager
def _told_if_interrupted() -> Iterator[None]:
    """Report an interrupt; typer would leave without a message. `console.guarded` reports one of a command at work."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        raise typer.Exit(130) from None


def _made(name: str, command: Command) -> Any:
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    target = command.load(name)
    if isinstance(target, typer.Typer):
        app.add_typer(target, name=name)
        return typer.main.get_group(app).commands[name]
    app.command(name, cls=_Command, no_args_is_help=not command.runs_bare)(target)
    return typer.main.get_command(app)
