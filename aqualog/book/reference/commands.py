"""Every command with its help, options and examples."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from typing import Any

from aqualog.book.markdown import code, fence, page, table
from aqualog.book.reference.machine import MEANINGS

__all__ = ["commands_page"]

_SUMMARY = "Every command with its options and examples."
_HOW = """
A LOG is a file, a folder, a glob or `@list.txt`. Data goes to stdout or to `-o`, everything else to stderr. `--json`
prints one [JSON document](documents.md). Results are written to a temporary name and then renamed, so that each is
whole or not there. No file is overwritten without `--force`, and a file that the command reads not even with it.
"""
_PARAGRAPH = "\b"


def commands_page(commands: Mapping[str, Any]) -> str:
    """The page; `commands` as the command line has them, by name."""
    listed = [(f"[`{n}`](#aqualog-{n})", " ".join(c.help.split("\n\n")[0].split())) for n, c in commands.items()]
    codes = "; ".join(f"{int(c)} {meaning}" for c, (meaning, _) in MEANINGS.items())
    return page(
        "Commands",
        _SUMMARY,
        _HOW,
        f"Exit codes: {codes}. See [exit codes](exit_codes.md).",
        table(("command", "what it does"), listed),
        *(part for name, command in _with_subcommands(commands) for part in _command(name, command)),
    )


def _with_subcommands(commands: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    for name, command in commands.items():
        yield name, command
        yield from ((f"{name} {n}", c) for n, c in getattr(command, "commands", {}).items())


def _command(name: str, command: Any) -> list[str]:
    about, examples = _split(inspect.cleandoc(command.help or ""))
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
    names = " ".join(_argument(p) for p in arguments)
    usage = f"aqualog {name} {names} [OPTIONS]".replace("  ", " ")
    if getattr(command, "commands", None):
        usage = f"aqualog {name} COMMAND"
    parts = [f"## `aqualog {name}`", about, fence(usage, "text")]
    if arguments:
        rows = [(code(p.metavar or p.name.upper()), "yes" if p.required else "no", p.help or "") for p in arguments]
        parts.append(table(("argument", "must be given", "meaning"), rows))
    if options:
        parts.append(table(("option", "value", "default", "meaning"), map(_option, options)))
    if examples:
        parts += ["Examples:", fence(examples, "sh")]
    return parts


def _split(text: str) -> tuple[str, str]:
    """The help as Markdown, and its examples."""
    about, _, examples = text.partition(f"{_PARAGRAPH}\nExamples:\n")
    return about.replace(_PARAGRAPH, "").strip(), inspect.cleandoc(examples)


def _argument(param: Any) -> str:
    name = param.metavar or param.name.upper()
    return name if param.required else f"[{name}]"


def _option(param: Any) -> tuple[str, str, str, str]:
    names = ", ".join(map(code, sorted(param.opts, key=len)))
    if param.secondary_opts:
        names += ", " + ", ".join(map(code, param.secondary_opts))
    must = "must be given" if param.required else ""
    return names, "" if param.is_flag else _value(param), must or _default(param), param.help or ""


def _value(param: Any) -> str:
    kind = param.metavar or str(param.bare_type())
    kind = {"float": "number", "int": "whole number", "str": "TEXT"}.get(kind, kind)
    low, high = param.min, param.max
    bounds = [f"{low:g} or more" if high is None else f"{low:g} ... {high:g}"] if low is not None else []
    return " ".join([kind, *(f"({b})" for b in bounds), *(["(several)"] if param.multiple else [])])


def _default(param: Any) -> str:
    value = param.default
    if value is None or value is False or value == () or callable(value):
        return ""
    if isinstance(value, list | tuple):
        return code(" ".join(map(str, value)))
    return "on" if value is True else code(str(value))
