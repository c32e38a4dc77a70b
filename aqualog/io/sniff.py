"""Find the format of a file by its content; the suffix does not count."""

from __future__ import annotations

import re
from pathlib import Path

from aqualog.core.errors import LogError
from aqualog.io.csv_format import csv_hint

__all__ = ["sniff"]

_HEAD = 4096
_MCAP = b"\x89MCAP0\r\n"


def sniff(path: Path, *, any_text: bool = False) -> str:
    """Format of a log: `mdf`, `mcap`, `ros`, `parquet` or `csv`; with `any_text` all that is no other is `csv`.

    Raises
    ------
    LogError
        If the file is missing or empty, or its content is of no known format.
    """
    if path.is_dir():
        if (path / "metadata.yaml").exists() or _is_recording(path):
            return "ros"
        raise LogError("is a folder without a ROS 2 bag", where=str(path), expected="a log file", hint="name the files")
    if path.exists() and not path.is_file():
        raise LogError("is no regular file", where=str(path), expected="a log file")
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except FileNotFoundError as error:
        raise LogError("no such file", where=str(path), hint="check the path") from error
    except OSError as error:
        raise LogError(f"cannot be opened: {error.strerror}", where=str(path)) from error
    if not head:
        raise LogError("is empty", where=str(path), expected="a log")
    for magic, name in _MAGIC:
        if head.startswith(magic):
            return name
    if any_text or _is_text(head):
        return "csv"
    if _is_text(head.replace(b"\0", b"")):
        line = head.count(b"\n", 0, head.index(0)) + 1
        raise LogError(
            f"is text with NUL bytes (first at line {line})",
            where=str(path), expected="CSV in UTF-8, or in UTF-16 with its byte order mark",
            hint=f"export it as UTF-8, or {csv_hint('encoding')}; a power cut leaves NULs, too",
        )  # fmt: skip
    raise LogError(
        f"unknown format (starts with {head[:8]!r})",
        where=str(path),
        expected="MDF 3/4, MCAP, ROS 1 bag, ROS 2 bag, Parquet or CSV",
    )


def _is_recording(folder: Path) -> bool:
    """Whether a folder without metadata holds one ROS 2 recording and no other log: one file, or parts counted from 0,
    as ROS names them. A folder of drives, each in a file of its own, would otherwise be read as one.
    """
    logs = [p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES]
    if len(logs) == 1:
        return logs[0].suffix.lower() in (".db3", ".mcap")
    parts = [_PART.fullmatch(p.name) for p in logs]
    found = [(m[1], m[3], int(m[2])) for m in parts if m]
    return (
        bool(found)
        and len(found) == len(logs)
        and len({(stem, suffix) for stem, suffix, _ in found}) == 1
        and sorted(n for _, _, n in found) == list(range(len(found)))
    )


_SUFFIXES = (".mf4", ".mdf", ".dat", ".mcap", ".bag", ".db3", ".csv", ".tsv", ".parquet")
_PART = re.compile(r"(.*)_(\d{1,6})\.(db3|mcap)", re.DOTALL)

_MAGIC = (
    (b"MDF     ", "mdf"),
    (b"UnFinMF ", "mdf"),
    (_MCAP, "mcap"),
    (b"#ROSBAG V", "ros"),
    (b"SQLite format 3\x00", "ros"),
    (b"PAR1", "parquet"),
)


def _is_text(head: bytes) -> bool:
    if head.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")):
        return True
    control = sum(b < 32 and b not in (9, 10, 12, 13, 27) for b in head)
    return control == 0
