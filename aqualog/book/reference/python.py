"""The names of `import aqualog`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from types import FunctionType, ModuleType
from typing import Any

import aqualog
from aqualog import face
from aqualog.book.markdown import code, fence, page, table
from aqualog.face import thesis
from aqualog.face.result import Result

__all__ = ["python_page"]

_SUMMARY = "The names that `import aqualog` offers, with their signatures."
_HOW = """
```python
import aqualog as aq
```

Every command is argument parsing around one function here. A path may be text or a `Path`, and where several fit, a
list. Faults are exceptions, see [exit codes](exit_codes.md). A command reads logs in a process of its own, with limits;
from Python nothing is limited, and a log that crashes its reader ends your process.
"""
_MOST = 90  # characters of a signature on one line
_COMMON = frozenset(code(n) for n in ("has_loss", "notes", "sources", "document", "headline() -> str", "text() -> str"))
"""Members that mean the same for every result."""
_SECTION = re.compile(r"^(Parameters|Returns|Raises|Yields|Examples|Notes)\n-{3,}\n", re.M)
_ITEM = re.compile(r"^(\S.*?)(?: : (.*))?$\n((?:^(?:    .*)?$\n?)*)", re.M)


def python_page() -> str:
    """The page."""
    names = sorted(n for n in aqualog.__all__ if not n.startswith("__"))
    shown = [(n, getattr(aqualog, n)) for n in names]
    listed = [
        (code(f"aq.{n}"), k := _kind(x), "" if k == "value" else _line(inspect.getdoc(x) or "")) for n, x in shown
    ]
    parts = [p for name, x in shown for p in _entry(name, x)]
    parts += [p for name in thesis.FUNCTIONS for p in _entry(f"thesis.{name}", getattr(thesis, name))]
    parts += _results()
    return page("Python", _SUMMARY, _HOW, table(("name", "kind", "meaning"), listed) if listed else "", *parts)


def _kind(x: Any) -> str:
    if isinstance(x, ModuleType):
        return "module"
    return "class" if inspect.isclass(x) else "function" if callable(x) else "value"


def _line(doc: str) -> str:
    return " ".join(doc.split("\n\n")[0].split())


def _entry(name: str, x: Any) -> list[str]:
    if _kind(x) in ("module", "value"):
        return []
    parts = [f"## `aq.{name}`", fence(f"aq.{name}{_signature(x)}", "text"), *_doc(inspect.getdoc(x) or "")]
    if inspect.isclass(x):
        rows = list(_members(x))
        parts.append(table(("member", "meaning"), rows) if rows else "")
    return parts


def _results() -> list[str]:
    """What every result offers, and what each adds of its own."""
    kinds = sorted(_classes(), key=lambda c: c.__name__)
    common = dict(_members(Result))
    parts = ["## Results", *_doc(inspect.getdoc(Result) or ""), table(("member", "meaning"), list(common.items()))]
    for kind in kinds:
        own = [(n, said) for n, said in _members(kind) if n not in _COMMON and common.get(n) != said]
        parts += [f"### `{kind.__name__}`", *_doc(inspect.getdoc(kind) or "")]
        parts.append(table(("member", "meaning"), own) if own else "")
    return parts


def _classes() -> Iterable[type[Result]]:
    """The results of the face, by module."""
    for module in iter_modules(face.__path__, f"{face.__name__}."):
        for found in vars(import_module(module.name)).values():
            is_result = inspect.isclass(found) and issubclass(found, Result) and found is not Result
            if is_result and found.__module__ == module.name and not found.__name__.startswith("_"):
                yield found


def _doc(doc: str) -> list[str]:
    """Paragraphs of a docstring, and its sections as tables."""
    about, *sections = _SECTION.split(f"{doc}\n")
    parts = [about.strip()]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        if title in ("Examples", "Notes"):
            parts.append(fence(inspect.cleandoc(body), "text") if title == "Examples" else body.strip())
            continue
        rows = [
            (n if title == "Returns" else code(n), (kind or "").strip(), _line(said))
            for n, kind, said in _ITEM.findall(body)
        ]
        heading = {"Parameters": "parameter", "Returns": "returns", "Yields": "yields", "Raises": "raises"}[title]
        parts.append(table((heading, "type", "meaning"), rows))
    return parts


def _members(x: type) -> Iterable[tuple[str, str]]:
    """Public methods and properties of aqualog's own, with their first paragraph."""
    for name, member in inspect.getmembers(x):
        value = member.fget if isinstance(member, property) else member
        if name.startswith("_") or not (inspect.isfunction(value) or inspect.ismethod(value)):
            continue
        if not value.__module__.startswith("aqualog"):
            continue
        shown = name if isinstance(member, property) else f"{name}{_signature(member, most=1000)}"
        yield code(shown), _line(inspect.getdoc(value) or "")


def _signature(x: Any, most: int = _MOST) -> str:
    """Parameters with their types as they stand in the code; one a line where they are long."""
    try:
        signature = inspect.signature(x)
    except (ValueError, TypeError):
        return "()"
    parts: list[str] = []
    has_star = False
    for name, p in signature.parameters.items():
        if name == "self" or name.startswith("_"):
            continue
        if p.kind is p.KEYWORD_ONLY and not has_star:
            parts.append("*")
        has_star = has_star or p.kind in (p.KEYWORD_ONLY, p.VAR_POSITIONAL)
        star = "*" if p.kind is p.VAR_POSITIONAL else "**" if p.kind is p.VAR_KEYWORD else ""
        parts.append(f"{star}{name}{_annotation(p.annotation, ': ')}{_default(p.default)}")
    end = "" if inspect.isclass(x) else _annotation(signature.return_annotation, " -> ")
    line = f"({', '.join(parts)}){end}"
    return line if len(line) <= most else "(\n" + "".join(f"    {p},\n" for p in parts) + f"){end}"


def _annotation(annotation: Any, sign: str) -> str:
    if annotation is inspect.Parameter.empty:
        return ""
    return sign + (annotation if isinstance(annotation, str) else inspect.formatannotation(annotation))


def _default(value: Any) -> str:
    if value is inspect.Parameter.empty:
        return ""
    is_made = isinstance(value, FunctionType) or repr(value).startswith("<")
    return " = ..." if is_made else f" = {value!r}"
