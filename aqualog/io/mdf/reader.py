"""MDF 3 and 4: measured channels, and raw CAN frames decoded by a DBC."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray, Channel, ChannelInfo, TimeArray
from aqualog.io.can import BitField, Dbc, decode_signal, is_decodable, load_dbc, selected
from aqualog.io.mdf import frames as can
from aqualog.io.mdf.blocks import Channel as MdfChannel
from aqualog.io.mdf.blocks import Group, Survey, short
from aqualog.io.mdf.columns import damaged_blocks, is_sound_field
from aqualog.io.mdf.conversion import refusal
from aqualog.io.mdf.groups import Columns, GroupReader
from aqualog.io.reader import FaultLog, Part, ReadOptions, one_piece, part_of

__all__ = ["MdfReader"]


@dataclass(frozen=True, slots=True)
class _Entry:
    """A channel on its way into the list; `sources` may make its path unique."""

    info: ChannelInfo
    sources: tuple[str, ...]


def _unique(entries: Sequence[_Entry]) -> tuple[ChannelInfo, ...]:
    """Give every channel a path of its own: with its source in front if sources differ, else with a number behind."""
    infos = [e.info for e in entries]
    for level in range(max((len(e.sources) for e in entries), default=0)):
        count = Counter(i.path for i in infos)
        candidates = [
            _prefixed(i, e, level) if count[i.path] > 1 else i.path for i, e in zip(infos, entries, strict=True)
        ]
        variants: dict[str, set[str]] = defaultdict(set)
        for info, candidate in zip(infos, candidates, strict=True):
            variants[info.path].add(candidate)
        infos = [
            replace(i, path=c) if len(variants[i.path]) > 1 else i for i, c in zip(infos, candidates, strict=True)
        ]  # a source that all of them share says nothing
    return tuple(_numbered(infos))


def _prefixed(info: ChannelInfo, entry: _Entry, level: int) -> str:
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


_Array = NDArray[Any]

_PIECE = 1 << 15  # records of a piece
_BUS_EVENT_NAME = ("CAN_", "LIN_", "FLX_", "FLEXRAY_", "ETH_", "MOST_", "K_LINE_")
_SHOWN = 8  # attachments listed in a note


@dataclass(frozen=True, slots=True)
class _Measured:
    group: int
    index: int


@dataclass(frozen=True, slots=True)
class _Signal:
    code: int
    message: Any
    name: str


class MdfReader(GroupReader):
    """One open MDF file, only ever read; `dbc` of the options decodes raw CAN frames.

    Raises
    ------
    LogError
        If the file cannot be read.
    """

    format = "mdf"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path)
        try:
            dbc = load_dbc(options.dbc) if options.dbc else None
            try:
                self._describe(dbc)
            except LogError as error:
                self._find_damaged(error)
                self._faults, self._survey = FaultLog(), Survey()
                self._describe(dbc)
                self._check_left(error)
            self._list_attachments()
        except BaseException:
            self.close()
            raise

    def channels(self) -> Sequence[ChannelInfo]:
        """All channels: measured ones in file order, then the signals of the DBC."""
        return self._channels

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Decode these channels; each group of records is gone through once."""
        wanted = list(wanted)
        before = replace(self._faults, notes=[*self._faults.notes])
        try:
            return self._decoded(wanted)
        except LogError as error:
            self._faults = before
            self._go_on_without_damaged(error)
            return self._decoded(wanted)

    def _decoded(self, wanted: Sequence[ChannelInfo]) -> list[Channel]:
        with self._guard("cannot be decoded"):
            found = self._read_measured([w for w in wanted if isinstance(w.key, _Measured)])
            found |= self._read_signals([w for w in wanted if isinstance(w.key, _Signal)])
        return [found[w.path] for w in wanted]

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece: a part for each group of records; signals of a DBC are one piece."""
        wanted = list(wanted)
        by_group: dict[int, list[ChannelInfo]] = defaultdict(list)
        for info in wanted:
            if isinstance(info.key, _Measured):
                by_group[info.key.group].append(info)
        out = [part_of(infos, self._pieces(group, infos)) for group, infos in by_group.items()]
        signals = [w for w in wanted if isinstance(w.key, _Signal)]
        return [*out, one_piece(signals, self.read)] if signals else out

    def _pieces(self, group: int, infos: Sequence[ChannelInfo]) -> Iterator[Sequence[Channel]]:
        n = n_bad = 0
        indexes = [i.key.index for i in infos]
        opened, pieces = self._opened, self._columns(group, indexes, _PIECE)
        while True:
            try:
                with self._guard("cannot be decoded"):
                    piece = next(pieces, None)
            except LogError as error:
                if opened == self._opened:  # else another group's pieces have found it
                    self._go_on_without_damaged(error)
                opened, pieces = self._opened, _behind(self._columns(group, indexes, _PIECE), n)
                continue
            if piece is None:
                break
            t, columns = piece
            t_ns, usable = self._nanoseconds(t)
            n, n_bad = n + len(t), n_bad + len(t) - len(t_ns)
            yield [Channel(i, t_ns, _where(usable, columns[i.key.index]), self._absolute) for i in infos]
        self._count_records(group, n, n_bad)

    # --- opening ---

    @contextmanager
    def _guard(self, what: str) -> Iterator[None]:
        """Turn any exception that a damaged file leads to into a `LogError`."""
        try:
            with np.errstate(all="ignore"):  # numbers of a damaged file may be any; what is no number is counted
                yield
        except LogError:
            raise
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            if why.startswith("DeflateError") or type(error).__module__ == "zlib":
                why = "a compressed block is damaged or not of the size that it declares"
            reason = f"{what} ({why})"
            raise LogError(reason, where=str(self._path), hint="check it with the logger's own tool") from error

    def _describe(self, dbc: Dbc | None) -> None:
        with self._guard("cannot be read as MDF"):
            self._open()
            self._channels = _unique(self._listed(dbc))

    def _find_damaged(self, error: LogError) -> None:
        """Seek packed blocks that make the file unreadable; raise the error if there is no such block."""
        if self._damaged or not self._survey.packed:
            raise error
        self._damaged = damaged_blocks(self._path, self._survey.packed)
        if not self._damaged:
            raise error

    def _go_on_without_damaged(self, error: LogError) -> None:
        """Open the file anew without damaged blocks and what follows them; raise the error if that does not help."""
        self._find_damaged(error)
        with self._guard("cannot be decoded"):
            self._open()
        self._check_left(error)

    def _check_left(self, error: LogError) -> None:
        if not any(group.cycles for group in self._groups):
            raise error

    def _list_attachments(self) -> None:
        names = self._survey.head.attachments
        if names:
            shown = ", ".join(f"{n!r}" for n in names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")
            self._faults.notes.append(f"{len(names)} attachments are never opened: {shown}")

    # --- listing ---

    def _listed(self, dbc: Dbc | None) -> list[_Entry]:
        entries: list[_Entry] = []
        self._frames: list[can.FrameGroup] = []
        for index, group in enumerate(self._groups):
            if not group.cycles or group.is_variable:
                continue
            obstacle = self._no_time(index)
            if obstacle:
                self._faults.notes.append(f"group {self._name(index)} is left out: {obstacle}")
                continue
            members = can.frame_members(group) if self._version4 else {}
            if members:
                self._frames.append(can.FrameGroup(index, members, self._codes(index, members)))
            entries += self._measured(index)
        self._census = can.census_of(self._frames)
        self._faults.notes += can.frame_notes(self._census, dbc)
        return [*entries, *(self._signals(dbc) if dbc is not None and self._census else ())]

    def _no_time(self, index: int) -> str | None:
        """Why the samples of a group have no time, or None."""
        owner = self._clock_of(index)
        group = None if owner is None else self._groups[owner]
        master = None if group is None else group.master
        if group is None or master is None:
            return "it has no time channel"
        channel = group.channels[master]
        if not channel.is_time:
            return "its samples are over angle, distance or index, not over time"
        if not _fits(group, channel):
            return "its time channel lies outside the record"
        if channel.conversion is not None and channel.conversion.kind == "formula":
            return "its time channel has a conversion formula"
        reason = channel.refused or refusal(channel.conversion)
        if reason:
            return f"its time channel cannot be read, {reason}"
        if self._groups[index].is_inferred:
            t = np.concatenate([np.zeros(0), *(t for t, _ in self._columns(index, []))])
            if not (np.isfinite(t).all() and (np.diff(t) >= 0).all()):
                return "its records cannot be reconstructed from its channels, their time does not go up"
        return None

    def _measured(self, index: int) -> Iterator[_Entry]:
        group, prefix = self._groups[index], self._name(index)
        for number, channel in enumerate(group.channels):
            if not channel.is_number or channel.name.startswith(can.FRAME):
                continue
            if group.is_bus_event and channel.name.startswith(_BUS_EVENT_NAME):
                continue
            name, _, device = channel.name.partition("\\")
            damage = channel.refused or ("" if _fits(group, channel) else "it lies outside the record")
            reason = damage or refusal(channel.conversion)
            if reason:
                self._faults.notes.append(f"channel {prefix}.{name} is left out: {reason}")
                self._faults.lost_samples += group.cycles if damage else 0
                continue
            formula = channel.conversion.formula if channel.conversion is not None else ""
            if "log" in formula.replace("log10", ""):
                self._faults.notes.append(f"channel {prefix}.{name}: log is taken as the natural logarithm")
            info = ChannelInfo(
                f"{prefix}.{name}", name, channel.unit, group.cycles, self._path.name, _Measured(index, number),
                channel.comment,
            )  # fmt: skip
            yield _Entry(info, (*channel.sources, device))

    # --- records ---

    def _read_measured(self, wanted: Sequence[ChannelInfo]) -> dict[str, Channel]:
        by_group: dict[int, list[ChannelInfo]] = defaultdict(list)
        for info in wanted:
            by_group[info.key.group].append(info)
        found: dict[str, Channel] = {}
        for index, infos in by_group.items():
            self._check_memory(index, len(infos))
            pieces = list(self._columns(index, [i.key.index for i in infos]))
            t = _joined([p[0] for p in pieces])
            t_ns, usable = self._nanoseconds(t)
            self._count_records(index, len(t), len(t) - len(t_ns))
            for info in infos:
                values = _joined([p[1][info.key.index] for p in pieces])
                found[info.path] = Channel(info, t_ns, _where(usable, values), self._absolute)
        return found

    # --- raw CAN frames ---

    def _codes(self, index: int, members: dict[str, int]) -> NDArray[np.uint64]:
        heads = [members[m] for m in ("ID", "IDE", "BusChannel") if m in members]
        self._check_memory(index, len(heads))
        codes, empty = can.codes_of(self._groups[index], members, self._columns(index, heads))
        self._count_records(index, len(codes), 0)
        if empty:
            self._faults.lost_samples += empty
            what = f"{empty} records are empty (zeros in place of a frame); left out"
            self._faults.notes.append(f"group {self._name(index)}: {what}")
        return codes

    def _signals(self, dbc: Dbc) -> Iterator[_Entry]:
        buses = can.buses_of(self._census)
        for code in sorted(self._census, key=lambda c: (can.bus_of(c), c)):
            message = dbc.messages.get(can.frame_key(code))
            if message is None:
                continue
            bus = f"CAN{can.bus_of(code)}"
            prefix = f"{bus}." if len(buses[can.frame_key(code)]) > 1 else ""
            for signal in message.signals:
                if not is_decodable(signal):
                    self._faults.notes.append(f"{message.name}.{signal.name} has {signal.length} bits and is left out")
                    continue
                info = ChannelInfo(
                    f"{prefix}{message.name}.{signal.name}", signal.name, signal.unit or "", self._census[code],
                    self._path.name, _Signal(code, message, signal.name), short(signal.comment or ""),
                )  # fmt: skip
                yield _Entry(info, (bus,))

    def _read_signals(self, wanted: Sequence[ChannelInfo]) -> dict[str, Channel]:
        by_code: dict[int, list[ChannelInfo]] = defaultdict(list)
        for info in wanted:
            by_code[info.key.code].append(info)
        frames = self._payloads(set(by_code))
        found: dict[str, Channel] = {}
        for code, infos in by_code.items():
            if code not in frames:  # none of them has a time
                no_t, no_x = np.zeros(0, dtype=np.int64), np.zeros(0)
                found |= {i.path: Channel(i, no_t, no_x, self._absolute) for i in infos}
                continue
            t_ns, data, length = frames[code]
            too_short: list[tuple[ChannelInfo, int]] = []
            for info in infos:
                carried, values = decode_signal(info.key.message, info.key.name, data, length)
                # frames that select the signal but are too short for it
                signal = info.key.message.get_signal_by_name(info.key.name)
                missed = int(selected(info.key.message, signal, data, length).sum()) - int(carried.sum())
                too_short += [(info, missed)] if missed else []
                found[info.path] = Channel(info, t_ns[carried], values, self._absolute)
            self._note_short(too_short)
        return found

    def _note_short(self, too_short: Sequence[tuple[ChannelInfo, int]]) -> None:
        """Count the frames of one message that are too short for some of its signals; report them in one line."""
        self._faults.lost_samples += max((n for _, n in too_short), default=0)
        if len(too_short) == 1:
            info, n = too_short[0]
            need = BitField.of(info.key.message.get_signal_by_name(info.key.name)).needed
            self._faults.notes.append(f"{info.path}: {n} frames are shorter than the {need} bytes it needs; left out")
        elif too_short:
            most, first = max(n for _, n in too_short), too_short[0][0]
            self._faults.notes.append(
                f"{first.path.removesuffix(f'.{first.key.name}')}: {most} frames are shorter than {len(too_short)} of "
                f"its signals need ({first.name}, ...), cut off or without payload; left out"
            )

    def _payloads(self, wanted: set[int]) -> dict[int, tuple[TimeArray, _Array, _Array]]:
        parts: dict[int, list[tuple[TimeArray, _Array, _Array]]] = defaultdict(list)
        codes = np.array(sorted(wanted), dtype=np.uint64)
        for group in self._frames:
            if not np.isin(codes, group.codes).any():
                continue
            own, (t_ns, data, length) = self._frame_rows(group, codes)
            for code in np.unique(own):
                rows = own == code
                parts[int(code)].append((t_ns[rows], data[rows], length[rows]))
        return {code: can.merged(p, by_time=True) for code, p in parts.items()}

    def _frame_rows(
        self, frames: can.FrameGroup, codes: NDArray[np.uint64]
    ) -> tuple[NDArray[np.uint64], tuple[TimeArray, _Array, _Array]]:
        """Codes of the wanted frames of a group; their times, payloads and lengths."""
        group, members = self._groups[frames.index], frames.members
        at, size = members["DataBytes"], members.get("DataLength", members.get("DLC"))
        wanted = [at, *([] if size is None else [size])]
        kept: list[tuple[TimeArray, _Array, _Array]] = []
        own, n_bad = [], 0
        for raw in self._raw(frames.index, [*wanted, group.master or 0], _PIECE):
            t_ns, usable = self._nanoseconds(self._times(frames.index, raw.samples[group.master or 0]))
            n_bad += raw.records - len(t_ns)
            data, length = self._payload_bytes(group, group.channels[at], raw.samples[at])
            if size is not None:
                declared = self._values(frames.index, [size], raw)[size]
                length = can.lengths_of(declared, length, is_code="DataLength" not in members)
            code = frames.codes[raw.first : raw.first + raw.records][usable]
            rows = np.isin(code, codes)
            own.append(code[rows])
            kept.append((t_ns[rows], data[usable][rows], length[usable][rows]))
        # records behind a cut were counted when the ids were read
        self._count_bad_times(frames.index, n_bad)
        return _joined(own), can.merged(kept, by_time=False)

    def _payload_bytes(
        self, group: Group, channel: MdfChannel, raw: _Array
    ) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Payloads (n, width), filled up with zeros, and how many bytes of each the file holds (n,)."""
        if not channel.is_variable:
            data = raw if raw.ndim == 2 else np.ascontiguousarray(raw).view(np.uint8).reshape(len(raw), -1)
            return data, np.full(len(data), data.shape[1], dtype=np.int64)
        values, path = channel.values, self._path
        if isinstance(values, int):
            owner = self._index.get(values)
            values, path = (() if owner is None else self._groups[owner].data), self._sorted if group.id_size else path
        return can.variable_payloads(path, values, raw.astype(np.int64))


def _fits(group: Group, channel: MdfChannel) -> bool:
    return channel.is_virtual or is_sound_field(channel.field, group.size)


def _behind(pieces: Iterator[Columns], records: int) -> Iterator[Columns]:
    for t, columns in pieces:
        new = slice(min(records, len(t)), None)
        records -= min(records, len(t))
        yield t[new], {i: x[new] for i, x in columns.items()}


def _joined(parts: Sequence[_Array]) -> _Array:
    if len(parts) == 1:  # most often there is but one: no copy
        return parts[0]
    return np.concatenate(parts) if parts else np.zeros(0)


def _where(usable: BoolArray, values: _Array) -> _Array:
    return values if usable.all() else values[usable]
