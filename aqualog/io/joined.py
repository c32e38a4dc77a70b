"""Join the files into which a logger has split one recording, by size or time, to one reader.

Parts of a recording have the same channels, and the times of each go on where those of the part before have ended.
Drives of their own do not: between them the car stands, or both begin at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aqualog.core.records import Channel, ChannelInfo
from aqualog.io.reader import Closing, Part, Reader, part_of

__all__ = ["PAUSE_S", "Joined", "Split", "split_of"]

PAUSE_S = 1.0
"""The longest pause beyond a sample step while a logger changes its file: within it a car hardly changes its speed."""

_ALIKE = 0.5  # least share of channels that two parts have in common: a message that is sent rarely may lack in one
_Id = tuple[str, str]


class _Span(NamedTuple):
    """First and last stamp of a time base of one file, its mean step [ns], and whether it counts from 1970."""

    first: int
    last: int
    step: float
    absolute: bool


_Spans = Mapping[str, _Span]  # by the paths of the channels


@dataclass(frozen=True, slots=True)
class Split:
    """Which files of a drive are one recording: their numbers in order of time, with the pauses between them [s].

    `apart`: why files with the same channels are not joined.
    """

    chains: tuple[tuple[int, ...], ...]
    pauses: tuple[tuple[float, ...], ...]
    apart: str = ""

    def note(self, names: Sequence[str], first: int) -> str:
        """Return the sentence on the recording that a file begins; empty if it is whole in this file."""
        chain, pauses = next(((c, p) for c, p in zip(self.chains, self.pauses, strict=True) if c[0] == first), ((), ()))
        if len(chain) < 2:
            return ""
        rest = ", ".join(names[i] for i in chain[1:])
        return f"{names[first]}: goes on in {rest}; joined to one recording (longest pause {max(pauses):.2f} s)"


def split_of(
    paths: Sequence[Path], readers: Sequence[Reader], own_clocks: Iterable[str], opened: Callable[[Path], Reader]
) -> Split:
    """Find the parts of one recording among the files of a drive.

    Parameters
    ----------
    paths, readers
        The files and their readers.
    own_clocks
        Names or patterns of files whose clock the user corrects: such a file is joined to none that has another one.
    opened
        Opens a file once more; the times are read there, so that a loss is not counted twice.
    """
    whole = Split(tuple((i,) for i in range(len(paths))), tuple(() for _ in paths))
    channels = [frozenset((c.path, c.unit) for c in r.channels()) for r in readers] if len(paths) > 1 else []
    patterns = tuple(own_clocks)
    clocks = [next((p for p in patterns if fnmatchcase(f.name, p) or f.stem == p), "") for f in paths]
    kinds: list[list[int]] = []
    for i, own in enumerate(channels):
        kind = next((k for k in kinds if _are_alike(channels[k[0]], own)), None)
        if kind is None:
            kinds.append([i])
        else:
            kind.append(i)
    if all(len(k) < 2 for k in kinds):
        return whole
    chains: list[tuple[int, ...]] = []
    pauses: list[tuple[float, ...]] = []
    apart = ""
    for kind in kinds:
        spans = {i: _spans(paths[i], opened) for i in kind} if len(kind) > 1 else {}
        order = sorted(kind, key=lambda i: min((s.first for s in spans.get(i, {}).values()), default=0))
        chains.append((order[0],))
        pauses.append(())
        for before, after in pairwise(order):
            pause, reason = _pause(spans[before], spans[after])
            if clocks[after] not in ("", clocks[chains[-1][0]]):
                reason = reason or "the signal map gives {after} a clock of its own"
            if reason:
                apart = apart or reason.format(before=paths[before].name, after=paths[after].name)
                chains.append((after,))
                pauses.append(())
            else:
                chains[-1] += (after,)
                pauses[-1] += (pause,)
    return Split(tuple(chains), tuple(pauses), apart)


def _are_alike(one: frozenset[_Id], other: frozenset[_Id]) -> bool:
    common = one & other
    in_conflict = {p for p, _ in one} & {p for p, _ in other} != {p for p, _ in common}
    return not in_conflict and bool(common) and len(common) >= _ALIKE * len(one | other)


def _spans(path: Path, opened: Callable[[Path], Reader]) -> _Spans:
    """Read the times of a file piece by piece, of one channel of each time base."""
    spans: dict[str, _Span] = {}
    with opened(path) as reader:
        bases = [sorted(p for _, p in part.channels) for part in reader.parts(list(reader.channels()))]
        infos = {c.path: c for c in reader.channels()}
        for base in bases:
            first = last = count = 0
            absolute = False
            for part in reader.parts([infos[base[0]]]):
                for channel in (c for piece in part.pieces for c in piece if c.t_ns.size):
                    low, high = int(channel.t_ns.min()), int(channel.t_ns.max())
                    first, last = (min(first, low), max(last, high)) if count else (low, high)
                    count += channel.t_ns.size
                    absolute = channel.absolute
            if count:
                spans |= dict.fromkeys(base, _Span(first, last, (last - first) / max(count - 1, 1), absolute))
    return spans


def _pause(before: _Spans, after: _Spans) -> tuple[float, str]:
    """Return the pause between two files [s], and why the second does not go on with the first (empty if it does).

    Time bases are compared each with its own: a slow message may end earlier than the rest.
    """
    pairs = {(before[p], after[p]) for p in before.keys() & after.keys()}
    if not pairs:
        return 0.0, "{after} and {before} share no channel with samples"
    a, b = min(pairs, key=lambda pair: pair[1].first - pair[0].last)
    if any(a.absolute != b.absolute for a, b in pairs):
        return 0.0, "only one of {before} and {after} has a date"
    if b.first < a.last:
        if not b.absolute:
            return 0.0, (
                "the times of {before} and {after} have no date and do not go on from one to the next. "
                "Export them with date and time, or as one file, if they are one recording"
            )
        return 0.0, f"{{after}} begins {(a.last - b.first) * 1e-9:.1f} s before {{before}} ends"
    pause = max((b.first - a.last - min(a.step, b.step)) * 1e-9, 0.0)
    if pause > PAUSE_S:
        return pause, (
            f"{{after}} begins {(b.first - a.last) * 1e-9:.1f} s after {{before}} ends, parts of one recording at most "
            f"{PAUSE_S:g} s; each is judged as a drive of its own"
        )
    return pause, ""


class Joined(Closing):
    """Readers of the parts of one recording as one reader, in order of time. Channels bear the name of the first file.

    A channel that a part lacks has no samples in it.
    """

    def __init__(self, name: str, readers: Sequence[Reader]) -> None:
        self._name, self._readers = name, tuple(readers)
        self.format = readers[0].format

    def channels(self) -> list[ChannelInfo]:
        """Channels of all parts, each once."""
        found: dict[str, ChannelInfo] = {}
        for reader in self._readers:
            for info in reader.channels():
                count = found[info.path].count if info.path in found else 0
                found[info.path] = replace(found.get(info.path, info), count=count + info.count, file=self._name)
        return list(found.values())

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Decode these channels, part after part."""
        asked = list(wanted)
        pieces: dict[str, list[Channel]] = {w.path: [] for w in asked}
        for reader in self._readers:
            for channel in reader.read(_own(reader, asked)):
                pieces[channel.info.path].append(channel)
        return [_whole(w, pieces[w.path]) for w in asked]

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece, in the time bases of the first part that has a channel."""
        left = {w.path: w for w in wanted}
        found: list[Part] = []
        for i, reader in enumerate(self._readers):
            for base in reader.parts(_own(reader, left.values())) if left else []:
                infos = [left.pop(path) for _, path in base.channels]
                found.append(part_of(infos, self._pieces(base, infos, self._readers[i + 1 :])))
        return found

    def _pieces(self, base: Part, infos: Sequence[ChannelInfo], later: Sequence[Reader]) -> Iterator[Sequence[Channel]]:
        by_path = {info.path: info for info in infos}
        streams = [base.pieces, *(p.pieces for r in later for p in _parts_later(r, infos))]
        for stream in streams:
            for piece in stream:
                yield [replace(c, info=by_path[c.info.path]) for c in piece]


def _parts_later(reader: Reader, infos: Sequence[ChannelInfo]) -> list[Part]:
    own = _own(reader, infos)
    return reader.parts(own) if own else []


def _own(reader: Reader, wanted: Iterable[ChannelInfo]) -> list[ChannelInfo]:
    own = {c.path: c for c in reader.channels()}
    return [own[w.path] for w in wanted if w.path in own]


def _whole(info: ChannelInfo, pieces: Sequence[Channel]) -> Channel:
    return Channel(
        info,
        np.concatenate([p.t_ns for p in pieces]),
        np.concatenate([p.values for p in pieces]),
        pieces[0].absolute,
    )
