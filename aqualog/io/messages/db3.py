"""Read sqlite3 files of ROS 2 recordings in the order of their rows.

Rows on damaged pages are left out and counted by the gap in their numbers; those behind them are read. Nothing in the
file is executed: tables are read as tables, without views, computed columns and indices. SQLite has no checksums: an
altered value within a row cannot be detected.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import zstandard
from rosbags.typesys import Stores

from aqualog.core.errors import LogError
from aqualog.io.decompress import Allowance, DamagedError, unpack
from aqualog.io.messages.batches import Batch, Message, batched
from aqualog.io.messages.codecs import Codec, codec_for
from aqualog.io.messages.streams import SAMPLES, Stream
from aqualog.io.messages.walk import MessageSource

__all__ = ["Db3Source", "release_of"]

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_LAST_ROW = (1 << 63) - 1
_MOST_GAPS = 1000  # beyond, a file is no longer worth the search
_LEAST_ROW = 8  # [byte]
_LEAST_LIMIT = 1 << 20  # [byte] of a row, for the smallest of files


def release_of(distro: str) -> Stores:
    """Types of a ROS 2 release; those of Humble if it is not known."""
    return Stores.__members__.get(f"ROS2_{distro.upper()}", Stores.ROS2_HUMBLE)


class Db3Source(MessageSource):
    """One sqlite3 file of a ROS 2 recording as a source of messages."""

    missing = "topics"

    def __init__(self, path: Path, release: Stores) -> None:
        super().__init__(path)
        self._release = release
        log = path.with_name(path.name + "-wal")
        if log.exists() and log.stat().st_size:
            # Reading it would write to the folder, and a log is never changed.
            self._notes.append(f"{path.name}: the recording was not closed; messages in {log.name} are not read")
            self.truncated = True

    def _connect(self) -> closing[sqlite3.Connection]:
        base = sqlite3.connect(f"{self.path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        base.text_factory = lambda text: text.decode(errors="replace")
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(self.path.stat().st_size, _LEAST_LIMIT))
        base.execute("PRAGMA trusted_schema = OFF")
        # SQLite refuses a file that is shorter than its head says, unless it is set to tolerate damage.
        base.execute("PRAGMA writable_schema = ON")
        return closing(base)

    def streams(self) -> Sequence[Stream]:
        """All topics with messages that can be decoded."""
        try:
            with self._connect() as base:
                for table in ("topics", "messages"):
                    if not _is_plain(base, table):
                        what = f'"{table}" is no plain table'
                        raise LogError(what, where=str(self.path), expected="a recording of rosbag2")
                topics = base.execute("SELECT id, name, type, serialization_format FROM topics NOT INDEXED").fetchall()
                definitions = _definitions(base)
                release = _db3_release(base) or self._release
                samples = self._scan(base)
        except sqlite3.Error as error:
            what = f"is damaged ({error})"
            raise LogError(what, where=str(self.path), hint="sqlite3 .recover on a copy of the file") from error
        known = {t[0]: t[1:] for t in sorted((t for t in topics if isinstance(t[0], int)), key=lambda t: t[0])}
        self._count_strays(known.__contains__)

        def codec(topic_id: int) -> Codec:
            _, msgtype, serialization = known[topic_id]
            encoding, definition = definitions.get(str(msgtype), ("", b""))
            return codec_for(str(serialization), encoding, str(msgtype), definition, release)

        return self._listed(((i, str(name)) for i, (name, _, _) in known.items()), codec, samples)

    def _scan(self, base: sqlite3.Connection) -> dict[int, list[bytes]]:
        """Count the messages of each topic and get its first ones."""
        firsts: dict[int, list[int]] = {}
        self._counts = {}
        for row, topic_id in _rows(base, "topic_id", self._note_gap):
            topic = topic_id if isinstance(topic_id, int) else -1  # a damaged row
            self._counts[topic] = self._counts.get(topic, 0) + 1
            kept = firsts.setdefault(topic, [])
            if len(kept) < SAMPLES:
                kept.append(row)
        return {topic_id: list(_messages_of(base, rows)) for topic_id, rows in firsts.items()}

    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """These topics' messages with their times of reception, in the order of recording."""
        return batched(self._messages(ids))

    def _messages(self, ids: frozenset[int]) -> Iterator[Message]:
        seen = dict.fromkeys(ids, 0)
        with self._connect() as base:
            for _, topic_id, t, data in _rows(base, "topic_id, timestamp, data", lambda *_: None):
                if isinstance(topic_id, int) and topic_id in ids:
                    seen[topic_id] += 1
                    yield topic_id, t if isinstance(t, int) and t > 0 else 0, _plain(data)
        self._lost = {i: max(0, self._counts.get(i, 0) - n) for i, n in seen.items()}

    def _note_gap(self, error: sqlite3.Error, last: int, following: int | None) -> None:
        """Rows behind `last` cannot be read; those from `following` on can."""
        most = self.path.stat().st_size // _LEAST_ROW
        if following is None or following - last > most:  # or its number is damaged, too
            self.truncated = True
            what = f"the file is cut off or damaged ({error}); what can be read is read"
        else:
            self.unassigned += following - last - 1
            what = f"is damaged ({error}); {following - last - 1} messages are left out, what stands behind is read"
        self._notes.append(f"{self.path.name}: {what}")


def _is_plain(base: sqlite3.Connection, table: str) -> bool:
    """Whether it is a table, and all its columns are kept in it: no view or expression of the file is evaluated."""
    found = base.execute("SELECT type, rootpage FROM sqlite_master WHERE lower(name) = ?", (table,)).fetchall()
    if len(found) != 1 or found[0][0] != "table" or not isinstance(found[0][1], int) or found[0][1] <= 0:
        return False
    return not any(hidden for *_, hidden in base.execute(f"PRAGMA table_xinfo({table})"))


def _rows(
    base: sqlite3.Connection, columns: str, on_gap: Callable[[sqlite3.Error, int, int | None], None]
) -> Iterator[tuple[Any, ...]]:
    """Row number and columns of all messages that can be read."""
    query = f"SELECT rowid, {columns} FROM messages NOT INDEXED WHERE rowid > ? ORDER BY rowid"
    last = -1
    for _ in range(_MOST_GAPS):
        try:
            for row in base.execute(query, (last,)):
                last = max(last, row[0])
                yield row
            return
        except sqlite3.Error as error:
            fault, is_gap = error, False
        # The module asks for a row more than it gives, so the row before the damage is to be had by itself.
        try:
            row = base.execute(f"{query} LIMIT 1", (last,)).fetchone()
        except sqlite3.Error:
            row = _readable_behind(base, query, last)
            is_gap = True
        if row is None or row[0] <= last:
            on_gap(fault, last, None)
            return
        if is_gap:
            on_gap(fault, last, row[0])
        last = row[0]
        yield row
    on_gap(fault, last, None)


def _readable_behind(base: sqlite3.Connection, query: str, last: int) -> tuple[Any, ...] | None:
    """Return the next readable row behind an unreadable one; None if no row follows."""

    def first_from(start: int) -> tuple[Any, ...] | None:
        """Return the first row behind `start`, an empty one at the end; None if it cannot be read."""
        try:
            return tuple(base.execute(f"{query} LIMIT 1", (start,)).fetchone() or ())
        except sqlite3.Error:
            return None

    low, step = last, 1
    while (found := first_from(low + step)) is None:
        low, step = low + step, 2 * step
        if low + step >= _LAST_ROW:
            return None
    high = low + step
    while high - low > 1:
        middle = (low + high) // 2
        nearer = first_from(middle)
        low, high, found = (middle, high, found) if nearer is None else (low, middle, nearer)
    return found or None


def _messages_of(base: sqlite3.Connection, rows: Sequence[int]) -> Iterator[bytes]:
    for row in rows:
        try:
            data = base.execute("SELECT data FROM messages WHERE rowid = ?", (row,)).fetchone()
        except sqlite3.Error:
            return  # the pages of this message are beyond the cut
        if data is not None:
            yield _plain(data[0])


def _definitions(base: sqlite3.Connection) -> dict[str, tuple[str, bytes]]:
    """Message definitions by type, as far as they can be read; recordings before ROS 2 Iron have none."""
    found: dict[str, tuple[str, bytes]] = {}
    try:
        if not _is_plain(base, "message_definitions"):
            return {}
        rows = base.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions NOT INDEXED"
        )
        for kind, encoding, text in rows:
            if isinstance(text, str):
                found[str(kind)] = str(encoding), text.encode()
    except sqlite3.Error:  # what is missing then is looked up among the types of the release
        pass
    return found


def _db3_release(base: sqlite3.Connection) -> Stores | None:
    try:
        row = base.execute("SELECT ros_distro FROM schema").fetchone() if _is_plain(base, "schema") else None
    except sqlite3.Error:
        return None
    return release_of(row[0]) if row and isinstance(row[0], str) else None


def _plain(data: object) -> bytes:
    """A message that the recorder compressed by itself, unpacked. No CDR message begins like a zstd frame."""
    if not isinstance(data, bytes):
        return b""  # a damaged row; counted as a message that cannot be decoded
    if data[:4] != _ZSTD_MAGIC:
        return data
    try:
        return unpack(data, "zstd", max(zstandard.frame_content_size(data), 0), Allowance())
    except (DamagedError, zstandard.ZstdError):
        return data  # counted as a message that cannot be decoded
