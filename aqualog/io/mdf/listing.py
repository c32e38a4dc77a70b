"""Give every channel of a file a path of its own."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from aqualog.core.records import ChannelInfo

__all__ = ["Entry", "unique"]


@dataclass(frozen=True, slots=True)
class Entry:
    """A channel on its way into the list; `sources` may make its path unique."""

    info: ChannelInfo
    sources: tuple[str, ...]


def unique(entries: Sequence[Entry]) -> tuple[ChannelInfo, ...]:
    """Give every channel a path of its own: with its source in front if sources differ, else with a number behind."""
    infos = [e.info for e in entries]
    for level in range(max((len(e.sources) for e in entries), default=0)):
        count = Counter(i.path for i in infos)
        candidates = [
            _prefixed(i, e, level) if count[i.path] > 1 else i.path for i, e in zip(infos, entries, strict=True)
        ]
        apart: dict[str, set[str]] = defaultdict(set)
        for info, candidate in zip(infos, candidates, strict=True):
            apart[info.path].add(candidate)
        infos = [
            replace(i, path=c) if len(apart[i.path]) > 1 else i for i, c in zip(infos, candidates, strict=True)
        ]  # a source that all of them share says nothing
    return tuple(_numbered(infos))


def _prefixed(info: ChannelInfo, entry: Entry, level: int) -> str:
    source = entry.sources[level] if level < len(entry.sources) else ""
    return f"{source}.{info.path}" if source and not info.path.startswith(f"{source}.") else info.path


def _numbered(infos: Sequence[ChannelInfo]) -> Iterator[ChannelInfo]:
    last: dict[str, int] = {}  # number by path: where the search goes on, also of thousands of the same name
    for info in infos:
        path, k = info.path, last.get(info.path, 1)
        while path in last:
            k += 1
            path = f"{info.path}#{k}"
        last[info.path] = k
        last.setdefault(path, 1)
        yield info if path == info.path else replace(info, path=path)
