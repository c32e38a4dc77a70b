"""Values of written files: documents as they are, tables by column, logs by their samples."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import tomllib
from collections.abc import Iterable
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import polars as pl
from asammdf import MDF
from mcap.reader import make_reader

SMALL = 5000  # cells: a table with more is kept as a digest per column
_KEY = re.compile(r"(?<![\w.])(?=[0-9]*[a-f])[0-9a-f]{20,}\b")  # no decimals of a number
_NAMED = {".html", ".js", ".css", ".png", ".svg", ""}  # listed, not read


def masked(text: str) -> str:
    """Keys made of content and code, which change with every version, taken out."""
    return _KEY.sub("KEY", text)


_STAMPS = {"contents.json"}  # places and times of change


def values_below(folder: Path, keep: str) -> dict[str, Any]:
    """Name -> values of every file in a folder."""
    files = sorted(p for p in folder.glob(keep) if p.is_file() and p.name not in _STAMPS)
    logs = _logs_of_keys(folder)
    return {masked(_named(p.relative_to(folder).as_posix(), logs)): values_of(p) for p in files}


def values_of(path: Path) -> Any:
    """Values of one file: a document, rows, or digests; null where it is only listed."""
    if path.suffix in _NAMED:
        return None
    data = path.read_bytes()
    match path.suffix:
        case ".json":
            return json.loads(masked(data.decode()))
        case ".jsonl":
            return sorted((json.loads(line) for line in data.decode().splitlines()), key=json.dumps)
        case ".toml":
            return tomllib.loads(data.decode())
        case ".csv":
            return _table(_csv_columns(data.decode("utf-8-sig")))
        case ".parquet":
            return _table(pl.read_parquet(BytesIO(data)).to_dict(as_series=False))
        case ".mf4":
            return _mdf(path)
        case ".mcap":
            return _mcap(data)
    return {"bytes": digest([data])}


def _csv_columns(text: str) -> dict[str, list[str]]:
    head = text.partition("\n")[0]
    rows = list(csv.reader(StringIO(text), delimiter=";" if head.count(";") > head.count(",") else ","))
    return {f"{i} {name}": [r[i] if i < len(r) else "" for r in rows[1:]] for i, name in enumerate(rows[0])}


def _table(columns: dict[str, list[Any]]) -> dict[str, Any]:
    """Columns with their cells, or with a digest of them."""
    rows = max(map(len, columns.values()), default=0)
    if rows * len(columns) <= SMALL:
        return json.loads(masked(json.dumps({"rows": rows, "cells": columns}, default=str)))
    return {"rows": rows, "digests": {n: digest(masked(repr(x)).encode() for x in c) for n, c in columns.items()}}


def _mdf(path: Path) -> dict[str, str]:
    """Digests of every channel's samples and times."""
    with MDF(path) as log:
        return {
            f"{s.name} [{s.unit}]": digest((s.timestamps.tobytes(), s.samples.tobytes())) for s in log.iter_channels()
        }


def _mcap(data: bytes) -> dict[str, str]:
    """Digests of every topic's messages."""
    topics: dict[str, list[bytes]] = {}
    for _, channel, message in make_reader(BytesIO(data)).iter_messages():
        topics.setdefault(channel.topic, []).append(str(message.log_time).encode() + message.data)
    return {name: digest(messages) for name, messages in sorted(topics.items())}


def digest_of(document: Any) -> str:
    """One digest of a document."""
    return digest([masked(json.dumps(document, sort_keys=True)).encode()])


def digest(parts: Iterable[bytes]) -> str:
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "big") + part)
    return total.hexdigest()[:16]


def _logs_of_keys(folder: Path) -> dict[str, str]:
    """Key -> log of the stores in a folder: their files are named after content and code."""
    documents = [json.loads(p.read_text()) for p in folder.rglob("manifest.json")]
    return {e["key"]: Path(e["log"]).stem for d in documents for e in d["logs"] if e.get("key")}


def _named(name: str, logs: dict[str, str]) -> str:
    return _KEY.sub(lambda found: logs.get(found[0], found[0]), name)
