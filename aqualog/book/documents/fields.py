"""Fields of documents as data: from one table come the reference and the JSON Schema."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

__all__ = [
    "HEAD", "Document", "Field", "Kind", "anything", "by_name", "count", "flag", "interval", "mapping", "maybe",
    "number", "obj", "or_null", "paths", "rows", "schema", "several", "text",
]  # fmt: skip

Kind = Literal["number", "whole number", "text", "true or false", "interval", "object", "list", "by name", "any"]

_JSON = {"number": "number", "whole number": "integer", "text": "string", "true or false": "boolean"}
DRAFT = "https://json-schema.org/draft/2020-12/schema"


@dataclass(frozen=True, slots=True)
class Field:
    """One field.

    `can_be_null`: null says that the value is not available or does not apply; `is_always`: it stands in every
    document of the kind; `values` are all texts that occur. `fields` are those of an object, of each row of a list, or
    of each entry by name; `item` is what a list or a table by name holds, where that is no object. `keys` are patterns
    of keys that are the user's own, with values of any plain kind.
    """

    name: str
    kind: Kind
    meaning: str
    unit: str = ""
    can_be_null: bool = False
    is_always: bool = True
    values: tuple[str, ...] = ()
    fields: tuple[Field, ...] = ()
    item: Field | None = None
    keys: tuple[str, ...] = ()

    @property
    def type(self) -> str:
        """The kind in words."""
        if self.kind == "list" and self.item is not None:
            return f"list of {self.item.type}"
        if self.kind == "by name" and self.item is not None:
            return f"{self.item.type} by name"
        return {"list": "list of objects", "by name": "object by name", "interval": "[low, high]"}.get(
            self.kind, self.kind
        )


@dataclass(frozen=True, slots=True)
class Document:
    """A JSON document: which command prints it (or which file holds it), and its fields."""

    name: str
    source: str
    summary: str
    fields: tuple[Field, ...]
    files: tuple[str, ...] = ()

    @property
    def heading(self) -> str:
        """The source without the option, which all of them have."""
        return self.source.removesuffix(" --json")


def number(name: str, unit: str, meaning: str, *, null: bool = False) -> Field:
    """A number; integers are numbers too."""
    return Field(name, "number", meaning, unit, null)


def count(name: str, meaning: str, unit: str = "", *, null: bool = False) -> Field:
    """A whole number."""
    return Field(name, "whole number", meaning, unit, null)


def text(name: str, meaning: str, values: Sequence[str] = (), *, null: bool = False) -> Field:
    """A text, one of `values` if they are given."""
    return Field(name, "text", meaning, can_be_null=null, values=tuple(values))


def flag(name: str, meaning: str) -> Field:
    """True or false."""
    return Field(name, "true or false", meaning)


def interval(name: str, unit: str, meaning: str, *, null: bool = False) -> Field:
    """Two numbers, each null where that end is open; `null`: the whole may be null."""
    return Field(name, "interval", meaning, unit, null)


def obj(name: str, meaning: str, fields: Sequence[Field], *, null: bool = False, keys: Sequence[str] = ()) -> Field:
    """An object with these fields."""
    return Field(name, "object", meaning, can_be_null=null, fields=tuple(fields), keys=tuple(keys))


def rows(name: str, meaning: str, fields: Sequence[Field], *, null: bool = False, keys: Sequence[str] = ()) -> Field:
    """A list of objects."""
    return Field(name, "list", meaning, can_be_null=null, fields=tuple(fields), keys=tuple(keys))


def several(name: str, meaning: str, item: Field | None = None, *, null: bool = False) -> Field:
    """A list of plain values, of texts unless `item` is given."""
    return Field(name, "list", meaning, item.unit if item else "", null, item=item or text("", ""))


def by_name(name: str, meaning: str, fields: Sequence[Field]) -> Field:
    """Objects by a name that is data."""
    return Field(name, "by name", meaning, fields=tuple(fields))


def mapping(name: str, meaning: str, item: Field, *, null: bool = False) -> Field:
    """Plain values by a name that is data."""
    return Field(name, "by name", meaning, item.unit, null, item=item)


def anything(name: str, meaning: str) -> Field:
    """A value of any kind."""
    return Field(name, "any", meaning)


def maybe(*fields: Field) -> tuple[Field, ...]:
    """The same fields, which need not be there."""
    return tuple(replace(f, is_always=False) for f in fields)


def or_null(*fields: Field) -> tuple[Field, ...]:
    """The same fields, each of which may be null."""
    return tuple(replace(f, can_be_null=True) for f in fields)


HEAD = (
    count("schema_version", "version of the document's form; it grows only when a field changes its meaning or goes"),
    text("tool_version", "version of aqualog"),
)
"""The first fields of every document."""


def paths(fields: Sequence[Field], before: str = "") -> Iterator[tuple[str, Field]]:
    """Every field with its path: `events[].wheel`, `signals.NAME.unit`."""
    for field in fields:
        path = f"{before}{field.name}"
        yield path, field
        inner: Field | None = field
        while inner is not None:
            path += {"list": "[].", "by name": ".NAME."}.get(inner.kind, ".")
            yield from paths(inner.fields, path)
            path, inner = path.removesuffix("."), inner.item


def schema(document: Document) -> dict[str, Any]:
    """The JSON Schema, in which a field that is not in the table is an error."""
    return {
        "$schema": DRAFT,
        "title": document.source,
        "description": document.summary,
        **_object(document.fields, ()),
    }


def _object(fields: Sequence[Field], keys: Sequence[str]) -> dict[str, Any]:
    made: dict[str, Any] = {
        "type": "object",
        "properties": {f.name: _described(f) for f in fields},
        "required": [f.name for f in fields if f.is_always],
        "additionalProperties": False,
    }
    if keys:
        made["patternProperties"] = {k: {"type": ["string", "number", "null"]} for k in keys}
    return made


def _described(field: Field) -> dict[str, Any]:
    about = {"description": field.meaning, "unit": field.unit} if field.unit else {"description": field.meaning}
    return {**_plain(field), **about}


def _plain(field: Field) -> dict[str, Any]:
    made = _kind(field)
    if field.can_be_null and "type" in made:
        made["type"] = [made["type"], "null"]
        if "enum" in made:
            made["enum"] = [*made["enum"], None]
    return made


def _kind(field: Field) -> dict[str, Any]:
    if field.kind in _JSON:
        return {"type": _JSON[field.kind], **({"enum": list(field.values)} if field.values else {})}
    if field.kind == "interval":
        return {"type": "array", "items": {"type": ["number", "null"]}, "minItems": 2, "maxItems": 2}
    if field.kind == "object":
        return _object(field.fields, field.keys)
    if field.kind == "any":
        return {}
    held = _plain(field.item) if field.item is not None else _object(field.fields, field.keys)
    if field.kind == "list":
        return {"type": "array", "items": held}
    return {"type": "object", "additionalProperties": held}
