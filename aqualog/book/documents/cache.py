"""`aqualog cache --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import HEAD, Document, count, flag, rows, several, text

__all__ = ["DOCUMENT"]

DOCUMENT = Document(
    "cache",
    "aqualog cache --json",
    "The cache of aligned signals: where it is, and what it holds.",
    (
        *HEAD,
        text("folder", "folder of the cache"),
        flag("is_default", "whether commands keep signals without `--cache`, because AQUALOG_CACHE is set"),
        count("limit_bytes", "most that is kept", "byte"),
        rows("drives", "drives in the cache, those longest unused first", (
            several("files", "files of the drive"),
            count("bytes", "size of the entry", "byte"),
            text("last_used", "time of the last use, UTC"),
            flag("usable", "whether this version of aqualog can take it"),
        )),
        count("bytes", "size of all entries", "byte"),
        count("usable", "entries that this version can take"),
        count("removed", "entries that `--clean` removed"),
    ),
    files=("cache.json",),
)  # fmt: skip
