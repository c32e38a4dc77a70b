"""Files of a folder that are not drives: byte-identical copies, and logs that cannot be read."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from aqualog.campaign.propose_drives import LogFile

__all__ = ["broken_logs", "without_twins"]


def without_twins(logs: Sequence[LogFile]) -> tuple[tuple[LogFile, ...], tuple[str, ...]]:
    """Logs without byte-identical copies, in their order, and a note on each that is left out.

    Of twins the one with the shorter name stays, as `a - Copy.mf4` stands before `a.mf4` by its letters. Only files of
    one size are read for their hash; folders (bags) are not compared.
    """
    by_size: dict[int, list[LogFile]] = {}
    for log in logs:
        if log.path.is_file():
            by_size.setdefault(log.path.stat().st_size, []).append(log)
    twin_of: dict[str, str] = {}
    for same in by_size.values():
        if len(same) == 1:
            continue
        first: dict[bytes, str] = {}
        for log in sorted(same, key=lambda f: (len(f.name), f.name)):
            original = first.setdefault(_digest(log.path), log.name)
            if original != log.name:
                twin_of[log.name] = original
    notes = tuple(f"{f.name} is left out: byte for byte {twin_of[f.name]}" for f in logs if f.name in twin_of)
    return tuple(f for f in logs if f.name not in twin_of), notes


def _digest(path: Path) -> bytes:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").digest()


def broken_logs(folder: Path, bad: Sequence[tuple[str, str]]) -> tuple[LogFile, ...]:
    """Of the files that could not be read those that a table of runs can hold and that look like logs.

    Not so are pipes, names that a table cannot hold, and texts called .csv whose first line has one cell only.
    """
    found = []
    for name, _ in bad:
        path = folder / name
        if ";" not in name and name == name.strip() and (path.is_dir() or (path.is_file() and not _is_text(path))):
            found.append(LogFile(path, name, ()))
    return tuple(found)


def _is_text(path: Path) -> bool:
    if path.suffix.lower() not in (".csv", ".tsv"):
        return False
    try:
        with path.open("rb") as file:
            head = file.readline(4096)
    except OSError:
        return False
    return bool(head.strip()) and not any(sign in head for sign in b",;\t")
