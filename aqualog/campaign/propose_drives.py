"""Logs of a folder, grouped by drive.

Files of different drives hold the same channels, files of one drive (a logger each) hold different ones. So files are
sorted into kinds by their channels; the parts of the names that vary within a kind distinguish drives, and files of
different kinds that share these words form one drive.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from aqualog.align.propose_map import LogFile
from aqualog.campaign.definition import GROUP_NAMES
from aqualog.campaign.store import MARK
from aqualog.core.errors import AqualogError
from aqualog.io.open_log import LOG_SUFFIXES, open_log, sniff
from aqualog.io.reader import ReadOptions

__all__ = [
    "Drive", "Found", "broken_logs", "drive_name", "group_drives", "is_run_table", "kinds_of", "scan", "tokens",
    "without_twins",
]  # fmt: skip

_RUN_COLUMNS = {k for keys in GROUP_NAMES.values() for k in keys} | {
    "", "log", "labels", "lane_start_s", "lane_end_s", "water_depth_left_mm",
}  # fmt: skip
_WORD = re.compile(r"[A-Za-z0-9À-ÿ.,+]+")
ALIKE = 0.5  # share of common channels from which two files hold the same things
APART = 0.2  # share up to which they may be loggers of one drive: a speed or a temperature is in both (K)


@dataclass(frozen=True, slots=True)
class Found:
    """Content of a folder: logs, unreadable files with the reason, and labels files."""

    logs: tuple[LogFile, ...]
    bad: tuple[tuple[str, str], ...]
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Drive:
    """Files of one drive; `kinds` are indices into the kinds of files."""

    files: tuple[LogFile, ...]
    kinds: tuple[int, ...]


def scan(
    folder: Path, *, options: ReadOptions | None = None, leave_out: Iterable[Path] = (),
    report: Callable[[str], None] = lambda _: None,
) -> Found:  # fmt: skip
    """All logs in a folder and below it, by suffix and content.

    Hidden files, links to folders and stores of results are left out.

    A folder that is a ROS 2 bag is one log. Names that a table of runs cannot hold are reported as unreadable.
    """
    own = {os.path.realpath(p) for p in leave_out}
    logs: list[LogFile] = []
    bad: list[tuple[str, str]] = []
    labels: list[str] = []
    paths = [p for p in _walk(folder) if os.path.realpath(p) not in own]
    for index, path in enumerate(paths):
        report(f"looking at {index + 1} of {len(paths)} files")
        name = path.relative_to(folder).as_posix()
        if path.suffix.lower() in (".csv", ".tsv") and (kind := _table_kind(path)):
            if kind == "labels":
                labels.append(name)
            continue
        if not name.isprintable() or ";" in name or any(part != part.strip() for part in (name, path.name)):
            told = "".join(c if c.isprintable() else "\ufffd" for c in name)
            bad.append((told, "; or signs that do not print or blanks at the end in its name: rename it"))
            continue
        try:
            with open_log(path, options) as log:
                channels, notes = tuple(log.channels()), log.faults.notes
        except AqualogError as error:
            bad.append((name, error.what))
            continue
        if channels:
            logs.append(LogFile(path, name, channels))
        else:
            # raw frames, for example, that no database decodes
            frames = next((n.removeprefix(f"{path.name}: ") for n in notes if "raw CAN frames" in n), "")
            bad.append((name, f"no channel in it; {frames}" if frames else "no channel in it"))
    return Found(tuple(logs), tuple(bad), tuple(labels))


def _walk(folder: Path) -> list[Path]:
    found: list[Path] = []
    for where, folders, names in os.walk(folder):
        here = Path(where)
        folders[:] = sorted(f for f in folders if not f.startswith(".") and not (here / f / MARK).exists())
        bags = [f for f in folders if (here / f / "metadata.yaml").exists() and sniff(here / f) == "ros"]
        found += [here / f for f in bags]
        folders[:] = [f for f in folders if f not in bags]
        found += [here / n for n in sorted(names) if not n.startswith(".") and Path(n).suffix.lower() in LOG_SUFFIXES]
    return sorted(found)


def _first_line(path: Path) -> bytes:
    if not path.is_file():  # a pipe would never end
        return b""
    try:
        with path.open("rb") as file:
            return file.readline(4096)
    except OSError:
        return b""


def _table_kind(path: Path) -> str:
    """`labels` or `runs` for tables that are not logs, else empty."""
    head = _first_line(path).decode("utf-8-sig", errors="replace")
    names = {cell.strip(' "\r\n') for cell in re.split(r"[,;\t]", head)}
    if {"start_s", "end_s", "effect"} <= names:
        return "labels"
    return "runs" if "log" in names and all(n in _RUN_COLUMNS or n.startswith("x_") for n in names) else ""


def is_run_table(path: Path) -> bool:
    """Whether the heading of a CSV file shows a table of runs instead of a log."""
    return _table_kind(path) == "runs"


def kinds_of(logs: Sequence[LogFile]) -> tuple[tuple[int, ...], int]:
    """Kind of each log by its channels, and the number of kinds; the most frequent kind is 0."""
    signatures = list(dict.fromkeys(log.signature for log in logs))
    parent = list(range(len(signatures)))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for i, a in enumerate(signatures):
        for j in range(i):
            if root(i) != root(j) and _overlap(a, signatures[j]) >= ALIKE:
                parent[root(i)] = root(j)
    index = {s: root(i) for i, s in enumerate(signatures)}
    raw = [index[log.signature] for log in logs]
    order = sorted(set(raw), key=lambda k: (-raw.count(k), raw.index(k)))
    return tuple(order.index(k) for k in raw), len(order)


def _overlap(a: frozenset[tuple[str, str]], b: frozenset[tuple[str, str]]) -> float:
    return len(a & b) / len(a | b)


def tokens(name: str) -> tuple[str, ...]:
    """Words and numbers of a path without its suffix, lower case, in order."""
    stem = name.rsplit(".", 1)[0] if "." in name.rsplit("/", 1)[-1] else name
    return tuple(t.lower() for t in _WORD.findall(stem))


def group_drives(
    logs: Sequence[LogFile], kinds: Sequence[int], rivals: Callable[[int, int], bool]
) -> tuple[tuple[Drive, ...], tuple[str, ...]]:
    """Drives in the order of their names, and notes on files that were joined or left out.

    Parameters
    ----------
    logs, kinds : sequences of equal length
    rivals : function (kind, kind) -> bool
        Whether files of the two kinds cannot be of one drive, as both measure the wheels.
    """
    words = [tokens(log.name) for log in logs]
    common: dict[int, set[str]] = {}
    for kind, own in zip(kinds, words, strict=True):
        common[kind] = common[kind] & set(own) if kind in common else set(own)
    telling = {w for kind, own in zip(kinds, words, strict=True) for w in own if w not in common[kind]}
    by_key: dict[tuple[str, ...], list[int]] = {}
    notes: list[str] = []
    for i, own in enumerate(words):
        by_key.setdefault(tuple(w for w in own if w in telling), []).append(i)
    if len(by_key) > 1:  # their names do not distinguish them: at most, files of one folder form one drive
        rest = by_key.pop((), [])
        alone = not _share_a_word(words[i] for i in rest)
        for i in rest:
            by_key.setdefault(("", logs[i].name if alone else logs[i].name.rpartition("/")[0]), []).append(i)
    drives: list[Drive] = []
    for members in by_key.values():
        kept = _without_copies(members, logs, kinds, rivals, notes)
        names = [logs[i].path.name for i in kept]
        is_one = (
            len(kept) > 1 and len({kinds[i] for i in kept}) == len(kept) and _are_partners(kept, logs, kinds, rivals)
        )
        if is_one and len(set(names)) < len(names):
            notes.append(f"{', '.join(logs[i].name for i in kept)} may be one drive, but have one name: rename them")
            is_one = False
        if is_one and not _share_a_word(words[i] for i in kept):
            told = ", ".join(logs[i].name for i in kept)
            notes.append(
                f"{told} are treated as one drive because of their channels, although their names share no word. If "
                "they are several drives, give each a line in the table of runs"
            )
        for several in [kept] if is_one else [[i] for i in kept]:
            ordered = sorted(several, key=lambda i: (kinds[i], logs[i].name))
            drives.append(Drive(tuple(logs[i] for i in ordered), tuple(kinds[i] for i in ordered)))
    return tuple(sorted(drives, key=lambda d: d.files[0].name)), tuple(notes)


def drive_name(drive: Drive) -> str:
    """A name for a drive: its file's, of several files the words that all of their names share."""
    first = drive.files[0].name
    if len(drive.files) == 1:
        return first
    shared = set.intersection(*(set(tokens(f.name)) for f in drive.files))
    stem = first.rsplit(".", 1)[0] if "." in first.rsplit("/", 1)[-1] else first
    return _WORD.sub(lambda m: m[0] if m[0].lower() in shared else "", stem).strip("/_- ") + "."


def _share_a_word(names: Iterable[Sequence[str]]) -> bool:
    found = [set(n) for n in names]
    return bool(found and set.intersection(*found))


def _rank(path: Path) -> int:
    """Formats with units and groups first; a bag's folder has no suffix."""
    return LOG_SUFFIXES.index(path.suffix.lower()) if path.suffix.lower() in LOG_SUFFIXES else 0


def _are_partners(
    members: Sequence[int], logs: Sequence[LogFile], kinds: Sequence[int], rivals: Callable[[int, int], bool]
) -> bool:
    return not any(
        _overlap(logs[i].signature, logs[j].signature) > APART or rivals(kinds[i], kinds[j])
        for n, i in enumerate(members)
        for j in members[:n]
    )


def _without_copies(
    members: Sequence[int], logs: Sequence[LogFile], kinds: Sequence[int], rivals: Callable[[int, int], bool],
    notes: list[str],
) -> list[int]:  # fmt: skip
    """The same drive in two formats counts once: names alike but for the suffix, and the wheels or all else in both."""
    kept: list[int] = []
    for i in sorted(members, key=lambda i: (_rank(logs[i].path), logs[i].name)):
        same = [j for j in kept if logs[j].path.with_suffix("") == logs[i].path.with_suffix("")]
        original = next((j for j in same if kinds[i] == kinds[j] or rivals(kinds[i], kinds[j])), None)
        if original is None:
            kept.append(i)
        else:
            notes.append(f"{logs[i].name} is left out: it looks like a copy of {logs[original].name}")
    return kept


# --- files that are no drives: byte-identical copies, and logs that cannot be read


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
            with log.path.open("rb") as file:
                original = first.setdefault(hashlib.file_digest(file, "sha256").digest(), log.name)
            if original != log.name:
                twin_of[log.name] = original
    notes = tuple(f"{f.name} is left out: byte for byte {twin_of[f.name]}" for f in logs if f.name in twin_of)
    return tuple(f for f in logs if f.name not in twin_of), notes


def broken_logs(folder: Path, bad: Sequence[tuple[str, str]]) -> tuple[LogFile, ...]:
    """Of the files that could not be read those that a table of runs can hold and that look like logs.

    Not so are pipes, names that a table cannot hold, and texts called .csv whose first line has one cell only.
    """

    def is_text(path: Path) -> bool:
        head = _first_line(path) if path.suffix.lower() in (".csv", ".tsv") else b""
        return bool(head.strip()) and not any(sign in head for sign in b",;\t")

    found = []
    for name, _ in bad:
        path = folder / name
        if ";" not in name and name == name.strip() and (path.is_dir() or (path.is_file() and not is_text(path))):
            found.append(LogFile(path, name, ()))
    return tuple(found)
