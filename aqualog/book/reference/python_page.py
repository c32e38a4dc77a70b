"""The names of `import aqualog`."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from types import ModuleType
from typing import Any

import aqualog
from aqualog.book.markdown import code, fence, page, table

__all__ = ["text"]

_SUMMARY = "The names that `import aqualog` offers, with their signatures."
_HOW = """
```python
import aqualog as aq
```

Every command is argument parsing around one function here. A path may be text or a `Path`, and where several fit, a
list. Faults are exceptions, see [exit codes](exit_codes.md). Nothing is limited as it is in a command: a log that
crashes its reader ends your process.
"""


def text() -> str:
    """The page."""
    names = sorted(n for n in aqualog.__all__ if not n.startswith("__"))
    shown = [(n, getattr(aqualog, n)) for n in names]
    listed = [(code(f"aq.{n}"), _kind(x), _first(x)) for n, x in shown]
    parts = [p for name, x in shown for p in _entry(name, x)]
    return page("Python", _SUMMARY, _HOW, table(("name", "kind", "meaning"), listed) if listed else "", *parts)


def _kind(x: Any) -> str:
    if isinstance(x, ModuleType):
        return "module"
    return "class" if inspect.isclass(x) else "function" if callable(x) else "value"


def _first(x: Any) -> str:
    return _line(inspect.getdoc(x) or "") if _kind(x) != "value" else ""


def _line(doc: str) -> str:
    return " ".join(doc.split("\n\n")[0].split())


def _entry(name: str, x: Any) -> list[str]:
    if _kind(x) in ("module", "value"):
        return []
    doc = (inspect.getdoc(x) or "").split("\nParameters\n")[0].split("\nRaises\n")[0].split("\nReturns\n")[0].strip()
    parts = [f"## `aq.{name}`", fence(f"aq.{name}{_signature(x)}", "text"), doc]
    if inspect.isclass(x):
        rows = list(_members(x))
        parts.append(table(("member", "meaning"), rows) if rows else "")
    return parts


def _members(x: type) -> Iterable[tuple[str, str]]:
    """Public methods and properties of aqualog's own, with their first paragraph."""
    for name, member in inspect.getmembers(x):
        value = member.fget if isinstance(member, property) else member
        if name.startswith("_") or not (inspect.isfunction(value) or inspect.ismethod(value)):
            continue
        if not value.__module__.startswith("aqualog"):
            continue
        shown = name if isinstance(member, property) else f"{name}{_signature(member, without_self=True)}"
        yield code(shown), _line(inspect.getdoc(value) or "")


def _signature(x: Any, *, without_self: bool = False) -> str:
    try:
        signature = inspect.signature(x)
    except (ValueError, TypeError):
        return "()"
    parameters = [p for n, p in signature.parameters.items() if not (without_self and n == "self")]
    return str(signature.replace(parameters=parameters)).replace("'", "")
