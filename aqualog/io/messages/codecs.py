"""Codecs: how the bytes of one message type become numbers."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np
from google.protobuf.message import Message as ProtobufMessage
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype
from rosbags.typesys.store import Typestore

from aqualog.io.messages.ros_types import MAX_TEXT, Layout, RefusedError, checked, ros_layout

__all__ = ["Codec", "FieldPath", "Getter", "Leaf", "UndecodableError", "brief", "codec_for"]

_MAX_ELEMENTS = 16
MAX_DEPTH = 12
"""Levels of nested fields that are looked at."""

FieldPath = tuple[str | int, ...]
Getter = Callable[[Any], Any]


class UndecodableError(Exception):
    """A topic's encoding or type is not known; its text is the reason."""


@dataclasses.dataclass(frozen=True, slots=True)
class Leaf:
    """One numeric field of a message type."""

    path: FieldPath
    unit: str = ""
    comment: str = ""

    @property
    def text(self) -> str:
        """Path as written: `pose.position.x`, `ranges[3]`."""
        return "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in self.path).removeprefix(".")

    @property
    def name(self) -> str:
        """Last field name, with its index if it is an array: `x`, `ranges[3]`."""
        return self.text.rpartition(".")[2]


class Codec:
    """How the bytes of one message type become numbers; `decode` makes an object of one message."""

    decode: Callable[[bytes], Any]

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        """Fields of an object or elements of an array; empty for anything else."""
        raise NotImplementedError

    def getter(self, path: FieldPath) -> Getter:
        """Fast access to one field. Raises an error of Python or gives None if a message lacks it."""
        raise NotImplementedError

    def declared(self) -> Iterable[Leaf]:
        """Leaves that the schema names, before any message is seen."""
        return ()

    def describe(self, path: FieldPath) -> tuple[str, str]:
        """Unit and comment of a leaf."""
        return "", ""

    def layout(self, data: bytes, /) -> Layout | None:
        """Where the fields of messages like this one lie; None if that cannot be said without decoding each."""
        return None


def _elements(value: Any) -> Iterable[tuple[int, Any]]:
    """Elements of a short array; a long one is an image or a point cloud and no signal."""
    return enumerate(value) if len(value) <= _MAX_ELEMENTS else ()


class _JsonCodec(Codec):
    def __init__(self, schema: Mapping[str, Any]) -> None:
        self._schema = schema
        self.decode = json.loads

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        if isinstance(value, dict):
            return value.items()
        return _elements(value) if isinstance(value, list) else ()

    def getter(self, path: FieldPath) -> Getter:
        if len(path) == 1:
            return itemgetter(path[0])

        def get(value: Any) -> Any:
            for step in path:
                value = value[step]
            return value

        return get

    def declared(self) -> Iterable[Leaf]:
        for path, _ in _schema_leaves(self._schema, (), 0):
            yield Leaf(path, *self.describe(path))

    def describe(self, path: FieldPath) -> tuple[str, str]:
        node: Any = self._schema
        for step in path:
            node = _mapping(node.get("items")) if isinstance(step, int) else _mapping(_properties(node).get(step))
        comment = node.get("description")
        comment = comment if isinstance(comment, str) else ""
        unit = node.get("unit")
        return (unit if isinstance(unit, str) else _bracket_unit(comment)), comment


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _properties(node: Mapping[str, Any]) -> Mapping[str, Any]:
    return _mapping(node.get("properties"))


def _schema_leaves(node: Mapping[str, Any], path: FieldPath, depth: int) -> Iterator[tuple[FieldPath, Any]]:
    for name, child in _properties(node).items():
        if not isinstance(child, dict) or depth > MAX_DEPTH:
            continue
        kinds = child.get("type")
        kinds = kinds if isinstance(kinds, list) else [kinds]
        if any(kind in ("number", "integer", "boolean") for kind in kinds):
            yield (*path, name), child
        else:
            yield from _schema_leaves(child, (*path, name), depth + 1)


def _bracket_unit(comment: str) -> str:
    """Return the unit at the end of a description, `speed [km/h]`; a range `[0, 1]` or an index `[2]` is no unit."""
    found = re.search(r"\[\s*([^\[\]\s,;:]{1,16})\s*\]\s*\.?\s*$", comment)
    if found is None or not (re.search(r"[^\W\d_]|[%°]", found[1]) or found[1] == "-"):
        return ""
    return found[1]


class _RosCodec(Codec):
    def __init__(self, store: Typestore, msgtype: str, *, cdr: bool) -> None:
        decode = store.deserialize_cdr if cdr else store.deserialize_ros1
        self.decode = lambda data: decode(data, msgtype)
        self._types = store.fielddefs
        self._msgtype = msgtype
        self._cdr = cdr

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        if dataclasses.is_dataclass(value):
            return [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
        return _elements(value) if isinstance(value, list | np.ndarray) else ()

    def getter(self, path: FieldPath) -> Getter:
        if all(isinstance(step, str) for step in path):
            return attrgetter(".".join(str(step) for step in path))

        def get(value: Any) -> Any:
            for step in path:
                value = value[step] if isinstance(step, int) else getattr(value, step)
            return value

        return get

    def layout(self, data: bytes, /) -> Layout | None:
        return ros_layout(self._types, self._msgtype, data, cdr=self._cdr)


class _ProtobufCodec(Codec):
    def __init__(self, decode: Callable[[bytes], Any]) -> None:
        self.decode = decode

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        if isinstance(value, ProtobufMessage):
            return _protobuf_fields(value)
        return _elements(value) if hasattr(value, "__len__") and not isinstance(value, str | bytes) else ()

    def getter(self, path: FieldPath) -> Getter:
        def get(value: Any) -> Any:
            for step in path:
                if isinstance(step, int):
                    value = value[step]
                    continue
                # A field that tracks its presence and is unset reads as 0, which would be a made-up sample.
                if value.DESCRIPTOR.fields_by_name[step].has_presence and not value.HasField(step):
                    return None
                value = getattr(value, step)
            return value

        return get


def _protobuf_fields(message: Any) -> Iterator[tuple[str, Any]]:
    for field in message.DESCRIPTOR.fields:
        kind = field.message_type
        if kind is not None and kind.GetOptions().map_entry:
            continue
        # An unset message may be of its own type, so it is not followed.
        if kind is not None and field.has_presence and not message.HasField(field.name):
            continue
        yield field.name, getattr(message, field.name)


@lru_cache(maxsize=512)
def codec_for(
    encoding: str, schema_encoding: str, name: str, definition: bytes, fallback: Stores = Stores.ROS2_HUMBLE
) -> Codec:
    """Codec of a message type.

    Parameters
    ----------
    encoding : str
        Of the messages: json, protobuf, ros1 or cdr.
    schema_encoding : str
        Of `definition`: jsonschema, protobuf, ros1msg, ros2msg, ros2idl or empty.
    name : str
        Name of the type.
    definition : bytes
        The schema as it stands in the file.
    fallback : Stores
        Where ROS types are looked up that the file does not define.

    Raises
    ------
    UndecodableError
        If messages of this type cannot be decoded.
    """
    try:
        if encoding == "json" and schema_encoding in ("jsonschema", ""):
            with suppress(ValueError, RecursionError):  # messages say what they hold without a schema too
                return _JsonCodec(_mapping(json.loads(definition)))
            return _JsonCodec({})
        if encoding == "protobuf" and schema_encoding == "protobuf":
            decode = DecoderFactory().decoder_for(
                "protobuf", Schema(id=1, name=name, encoding="protobuf", data=definition)
            )
            if decode is None:
                raise UndecodableError(f'protobuf type "{name}" is not in its own schema')
            return _ProtobufCodec(decode)
        if encoding == "ros1" and schema_encoding in ("ros1msg", ""):
            return _ros_codec(name, schema_encoding, definition, Stores.ROS1_NOETIC)
        if encoding == "cdr" and schema_encoding in ("ros2msg", "ros2idl", "omgidl", ""):
            return _ros_codec(name, schema_encoding, definition, fallback)
    except UndecodableError:
        raise
    except RefusedError as error:
        raise UndecodableError(f'the definition of type "{name}" is refused: {error}') from error
    except Exception as error:  # the parsers run on the file's text and raise whatever it leads them to
        raise UndecodableError(f'the definition of type "{name}" cannot be read ({brief(error)})') from error
    raise UndecodableError(f'encoding "{encoding}" with schema "{schema_encoding}" is not supported')


def _ros_codec(name: str, schema_encoding: str, definition: bytes, fallback: Stores) -> _RosCodec:
    msgtype = normalize_msgtype(name)
    if len(definition) > MAX_TEXT:
        raise UndecodableError(f'the definition of type "{name}" has {len(definition)} bytes, more than {MAX_TEXT}')
    types = _ros_types(msgtype, schema_encoding, definition.decode())
    # Recorders leave common types out of a definition, and old ROS 2 bags hold no definitions at all.
    known = get_typestore(Stores.EMPTY).fielddefs
    pending, reached = [msgtype], dict(known)
    while pending:
        wanted = pending.pop()
        if wanted in reached:
            continue
        if wanted not in types:
            common = get_typestore(fallback).fielddefs
            if wanted not in common:
                raise UndecodableError(f'message type "{wanted}" is not defined in the file and not known')
            types[wanted] = common[wanted]
        reached[wanted] = types[wanted]
        pending += [used for _, field in types[wanted][1] for used in _used_types(field)]
    store = get_typestore(Stores.EMPTY)
    store.register(checked(reached))
    return _RosCodec(store, msgtype, cdr=fallback is not Stores.ROS1_NOETIC)


def _ros_types(msgtype: str, schema_encoding: str, text: str) -> dict[str, Any]:
    if not text.strip():
        return {}
    if schema_encoding in ("ros1msg", "ros2msg"):
        return dict(get_types_from_msg(text, msgtype))
    ruler = "=" * 80 + "\n"
    if not text.startswith(f"{ruler}IDL: "):
        return dict(get_types_from_idl(text))
    types: dict[str, Any] = {}
    for part in text.split(ruler)[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def _used_types(field: Any) -> list[str]:
    kind, detail = field
    if kind == Nodetype.NAME:
        return [detail]
    return _used_types(detail[0]) if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else []


def brief(error: Exception) -> str:
    """The first line of an error."""
    if isinstance(error, RecursionError):
        return "they are nested deeper than 100 levels"
    return (str(error).splitlines() or [""])[0][:120] or type(error).__name__
