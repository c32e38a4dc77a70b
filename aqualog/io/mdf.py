"""MDF 3 and 4: measured channels, and raw CAN frames decoded by a DBC.

asammdf parses the blocks after a walk through them has found them sound (see `mdf_survey`). `mdf_harness` limits its
side effects. It never evaluates a formula, never opens an attachment, and inflates nothing beyond the declared size.
It writes only into a folder of our own, and prints nothing.
"""

from __future__ import annotations

import io
import itertools
import re
import shutil
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import asammdf
import numpy as np
from asammdf.blocks.utils import extract_xml_comment
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray, Channel, ChannelInfo, FileFaults, TimeArray
from aqualog.io.base import FaultLog, Part, ReadOptions, part_of
from aqualog.io.can import BitField, Dbc, decode_signal, is_decodable, load_dbc, pgn, selected
from aqualog.io.mdf3_survey import survey3
from aqualog.io.mdf4_survey import survey4
from aqualog.io.mdf_blocks import Raw, let_go, raw_columns, raw_pieces
from aqualog.io.mdf_conversion import formula_text, is_text_only, physical, refusal
from aqualog.io.mdf_harness import disarm_asammdf
from aqualog.io.mdf_salvage import damaged_blocks
from aqualog.io.mdf_survey import Survey, mapped
from aqualog.io.memory import bytes_text, free_memory
from aqualog.io.patched_file import PatchedFile

__all__ = ["MdfReader"]

_Array = NDArray[Any]


disarm_asammdf()

_VIRTUAL = (3, 6)  # channel types without bytes in the record
_VARIABLE_LENGTH = 1
_PIECE = 1 << 15  # records of a piece
_FRAGMENT = 1 << 25  # [bytes] of records that asammdf gives at a time
_LONGEST_RECORD = 1 << 30
_LONGEST_PAYLOAD = 64
_NUMERIC_V4_CHANNELS = (0, 6)  # fixed length, virtual
_NUMERIC_V4_DATA = range(6)  # unsigned, signed, float; both byte orders
_NUMERIC_V3_DATA = (0, 1, 2, 3, *range(9, 17))
_CHANNEL_ALL_INVALID = 1
_GROUP_BUS_EVENT, _GROUP_REMOTE_MASTER, _GROUP_VLSD = 0x2, 0x8, 0x1
_BUS_EVENT_NAME = re.compile(r"(CAN|LIN|FLX|FLEXRAY|ETH|MOST|K_LINE)_\w+(\.|$)")
_FRAME = "CAN_DataFrame."
_ARCHIVES = (".bz2", ".gzip", ".mf4z", ".zip")  # asammdf unpacks these by suffix, and deletes the file it then reads
_DLC_LENGTH = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64])
_EXTENDED = np.uint64(1 << 32)  # in a frame code: id in bits 0-28, IDE in bit 32, bus from bit 33
_EMPTY = np.uint64(2**63)  # no bus and no id
_OLDEST = int(datetime(1990, 1, 1, tzinfo=UTC).timestamp()) * 10**9
_LARGEST_XML = 1 << 20
_PER_SAMPLE = 24  # [bytes] of a sample while a channel is read as a whole: raw, physical, time
_LATEST_S = 9.0e9  # int64 nanoseconds end in the year 2262
_SHOWN = 8  # ids listed in a note


@dataclass(frozen=True, slots=True)
class _Measured:
    """Address of a measured channel."""

    group: int
    index: int


@dataclass(frozen=True, slots=True)
class _Signal:
    """Address of a DBC signal on one bus."""

    code: int
    message: Any
    name: str


@dataclass(frozen=True, slots=True)
class _FrameGroup:
    """A group of raw CAN frames: where its members are and the code (bus, IDE, id) of each frame."""

    index: int
    members: dict[str, int]
    codes: NDArray[np.uint64]


@dataclass(frozen=True, slots=True)
class _Entry:
    """A channel on its way into the list; `sources` may make its path unique."""

    info: ChannelInfo
    sources: tuple[str, ...]


class MdfReader:
    """One open MDF file.

    Parameters
    ----------
    path : Path
        The file; only ever read.
    options : ReadOptions
        `dbc` decodes raw CAN frames.

    Raises
    ------
    LogError
        If the file cannot be read.
    """

    format = "mdf"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self._path = path
        self._faults = FaultLog()
        self._mdf: Any = None
        self._patched: PatchedFile | None = None
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        self._survey = Survey(0)
        self._damaged: frozenset[int] = frozenset()
        self._channels: tuple[ChannelInfo, ...] = ()
        try:
            dbc = load_dbc(options.dbc) if options.dbc else None
            try:
                self._describe(dbc)
            except LogError as error:
                self._find_damaged(error)
                self._faults, self._survey = FaultLog(), Survey(0)
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
        return [*out, part_of(signals, (self.read(signals) for _ in range(1)))] if signals else out

    def _pieces(self, group: int, infos: Sequence[ChannelInfo]) -> Iterator[Sequence[Channel]]:
        n = n_bad = 0
        indexes = [i.key.index for i in infos]
        opened, pieces = self._inner, self._in_pieces(group, indexes)
        while True:
            try:
                with self._guard("cannot be decoded"):
                    piece = next(pieces, None)
            except LogError as error:
                if opened is self._inner:  # else another group's pieces have found it
                    self._go_on_without_damaged(error)
                opened, pieces = self._inner, _behind(self._in_pieces(group, indexes), n)
                continue
            if piece is None:
                break
            t, columns = piece
            t_ns, usable = self._nanoseconds(t)
            n, n_bad = n + len(t), n_bad + len(t) - len(t_ns)
            yield [Channel(i, t_ns, _where(usable, columns[i.key.index]), self._absolute) for i in infos]
        self._count_records(group, n, n_bad)

    @property
    def faults(self) -> FileFaults:
        """What was lost so far."""
        return self._faults.freeze()

    def close(self) -> None:
        """Release the file and the temporary copy, if there is one."""
        if self._mdf is not None:
            with suppress(Exception):
                self._mdf.close()
            self._mdf = None
        if self._patched is not None:
            self._patched.close()
            self._patched = None
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- opening ---

    @contextmanager
    def _guard(self, what: str) -> Iterator[None]:
        """Turn any exception of asammdf on a damaged file into a `LogError`."""
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
        if self._damaged or not self._survey.deflated:
            raise error
        self._damaged = damaged_blocks(self._path, self._survey.deflated)
        if not self._damaged:
            raise error

    def _go_on_without_damaged(self, error: LogError) -> None:
        """Open the file anew without damaged blocks and what follows them; raise the error if that does not help."""
        self._find_damaged(error)
        with self._guard("cannot be decoded"):
            self._open()
        self._check_left(error)

    def _check_left(self, error: LogError) -> None:
        if not any(int(group.channel_group.cycles_nr) for group in self._inner.groups):
            raise error

    def _open(self) -> None:
        self.close()
        if self._path.suffix.lower() in _ARCHIVES:
            raise LogError("is named as an archive", where=str(self._path), hint="unpack or rename it to .mf4")
        with mapped(self._path) as data:
            self._version4 = bytes(data[8:10]) >= b"4."
            survey = survey4(data, self._path, self._damaged) if self._version4 else survey3(data, self._path)
        before, self._survey = self._survey, survey
        self._tell(survey, before)
        self._scratch = tempfile.TemporaryDirectory(prefix="aqualog-", ignore_cleanup_errors=True)
        self._check_space()
        source: Any = str(self._path)
        if self._survey.patches:
            source = self._patched = PatchedFile(self._path, self._survey.patches)
        with redirect_stdout(io.StringIO()):  # asammdf prints tracebacks
            opened = asammdf.MDF(
                source, temporary_folder=self._scratch.name, process_bus_logging=False,
                raise_on_multiple_occurrences=False,
            )  # fmt: skip
        self._mdf = opened
        self._inner = opened._mdf
        self._recount()
        let_go(self._inner)
        self._start_ns, self._absolute = self._start()

    def _tell(self, survey: Survey, before: Survey) -> None:
        """Report the findings of a walk that one before did not have."""
        self._faults.truncated |= survey.truncated
        self._faults.unfinalised = survey.finalised
        self._faults.lost_samples += survey.lost_samples - before.lost_samples
        self._faults.notes += [note for note in survey.notes if note not in before.notes]

    def _list_attachments(self) -> None:
        names = self._survey.attachments
        if names:
            told = ", ".join(f"{n!r}" for n in names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")
            self._faults.notes.append(f"{len(names)} attachments are never opened: {told}")

    def _check_space(self) -> None:
        """Records of several kinds in a row are sorted in a temporary file."""
        assert self._scratch is not None
        need, free = self._survey.unsorted, shutil.disk_usage(self._scratch.name).free
        if need > free:
            raise LogError(
                "has records of several kinds in a row, and there is no space to sort them", where=str(self._path),
                expected=f"{bytes_text(need)} in {tempfile.gettempdir()}, {bytes_text(free)} are free",
                hint="set TMPDIR to a folder with more space",
            )  # fmt: skip

    def _check_memory(self, group: int, channels: int) -> None:
        """Refuse a group whose declared size cannot be held; nothing of it has been inflated."""
        channel_group = self._inner.groups[group].channel_group
        declared = self._survey.inflated.get(int(channel_group.address), 0)
        records = min(int(channel_group.cycles_nr), declared // max(int(channel_group.samples_byte_nr), 1))
        need, free = records * (channels + 1) * _PER_SAMPLE, free_memory()
        if need > free:
            raise LogError(
                f"{channels} channels of the group {self._group_name(group)} have {records} samples each and would "
                f"take {bytes_text(need)}", where=str(self._path), expected=f"at most {bytes_text(free)} that are free",
                hint="give fewer channels in a signal map, or a machine with more memory",
            )  # fmt: skip

    def _recount(self) -> None:
        """Numbers of records of an unfinished file, now that records of several kinds have been sorted."""
        for index, group in enumerate(self._inner.groups):
            channel_group = group.channel_group
            if int(channel_group.address) in self._survey.recount:
                size = int(channel_group.samples_byte_nr) + int(channel_group.invalidation_bytes_nr)
                held = sum(int(b.original_size) for b in group.get_data_blocks()) if group.sorted else 0
                is_sorted = group.data_location != 0
                channel_group.cycles_nr = held // size if size and is_sorted else 0
                self._inner.virtual_groups[index].cycles_nr = channel_group.cycles_nr
        kinds: dict[int, list[Any]] = defaultdict(list)
        for group in self._inner.groups:
            kinds[int(group.data_group.address)].append(group)
        for groups in kinds.values():
            if not self._channels and any(int(g.channel_group.address) in self._survey.recount for g in groups):
                self._count_unsorted(groups)

    def _count_unsorted(self, groups: Sequence[Any]) -> None:
        """Report records of an unfinished file that were not sorted: asammdf stops at a record of unknown kind."""
        there = max(self._survey.inflated.get(int(g.channel_group.address), 0) for g in groups)
        zeros = max(self._survey.zeros.get(int(g.channel_group.address), 0) for g in groups)
        count, taken, longest = 0, 0, 1
        for group in groups:
            about = group.channel_group
            own = int(group.data_group.record_id_len)
            if about.flags & _GROUP_VLSD:
                n, size = self._values_of(about)
                longest = max(longest, own + size // max(n, 1))
            else:
                n = int(about.cycles_nr)
                record = int(about.samples_byte_nr) + int(about.invalidation_bytes_nr)
                size, longest = n * record, max(longest, own + record)
            count, taken = count + n, taken + n * own + size
        lost = there - taken - zeros
        if lost <= 0:
            return
        self._faults.truncated = True
        if lost < longest:
            self._faults.lost_samples += 1
            self._faults.notes.append("the last record is incomplete, and left out")
        else:
            about_lost = max(1, round(lost * count / taken)) if taken else lost // longest
            self._faults.lost_samples += about_lost
            self._faults.notes.append(
                f"{lost} of {there} bytes of records, about {about_lost} records, are lost: what precedes them is a "
                "record of no known kind"
            )

    def _values_of(self, about: Any) -> tuple[int, int]:
        """Return the number of values of variable length in a group of such values alone, and their size. [bytes]"""
        owner = self._inner._cn_data_map.get(about.address)
        if owner is None:
            return 0, 0
        blocks = self._inner.groups[owner[0]].signal_data[owner[1]] or ()
        data = self._inner._load_signal_data(group=self._inner.groups[owner[0]], index=owner[1]) if blocks else b""
        n = at = 0
        while at + 4 <= len(data):
            at += 4 + int.from_bytes(data[at : at + 4], "little")
            n += 1
        return n, len(data)

    def _start(self) -> tuple[int, bool]:
        """Start time in ns and whether it is a real one; loggers without a clock write 1970 or 1980."""
        header = self._inner.header
        start = int(getattr(header, "abs_time", 0) or 0)
        if not self._version4 and not start:
            with suppress(ValueError, UnicodeDecodeError):
                text = f"{header.date.decode('ascii')} {header.time.decode('ascii')}".replace("\0", "").strip()
                moment = datetime.strptime(text, "%d:%m:%Y %H:%M:%S").replace(tzinfo=UTC)
                start = int(moment.timestamp()) * 10**9
        if not _OLDEST <= start < int(_LATEST_S * 1e9):
            return 0, False
        if self._version4 and header.time_flags & 1:
            self._faults.notes.append("start time is local time without a time zone; taken as UTC")
        return start, True

    # --- listing ---

    def _listed(self, dbc: Dbc | None) -> list[_Entry]:
        entries: list[_Entry] = []
        frames: list[_FrameGroup] = []
        for index, group in enumerate(self._inner.groups):
            if not group.channel_group.cycles_nr or (self._version4 and group.channel_group.flags & _GROUP_VLSD):
                continue
            obstacle = self._no_time(index)
            if obstacle:
                self._faults.notes.append(f"group {self._group_name(index)} is left out: {obstacle}")
                continue
            members = _frame_members(group) if self._version4 else {}
            if members:
                frames.append(_FrameGroup(index, members, self._codes(index, members)))
            entries += self._measured(index)
        self._frames = frames
        self._describe_frames(dbc)
        return [*entries, *(self._signals(dbc) if dbc is not None else ())]

    def _no_time(self, index: int) -> str | None:
        """Why the samples of a group have no time, or None."""
        group = self._inner.groups[index]
        if self._version4 and group.channel_group.flags & _GROUP_REMOTE_MASTER:
            index = int(group.channel_group.cg_master_index)
            group = self._inner.groups[index]
        master = self._inner.masters_db.get(index)
        if master is None:
            return "it has no time channel"
        channel = group.channels[master]
        if self._version4 and channel.sync_type not in (0, 1):
            return "its samples are over angle, distance or index, not over time"
        if not _fits(group, channel, version4=self._version4):
            return "its time channel lies outside the record"
        if formula_text(channel.conversion, version4=self._version4) is not None:
            return "its time channel has a conversion formula"
        reason = self._survey.refused.get(int(channel.address)) or self._refusal(channel)
        if reason is not None:
            return f"its time channel cannot be read, {reason}"
        if int(group.channel_group.address) in self._survey.inferred:
            t = _joined([t for t, _ in self._columns(index, [])])
            if not (np.isfinite(t).all() and (np.diff(t) >= 0).all()):
                return "its records cannot be reconstructed from its channels, their time does not go up"
        return None

    def _group_name(self, index: int) -> str:
        name = self._inner.groups[index].channel_group.acq_name if self._version4 else ""
        return " ".join(str(name or "").split()) or f"group{index}"

    def _measured(self, index: int) -> Iterator[_Entry]:
        group = self._inner.groups[index]
        prefix = self._group_name(index)
        is_bus = self._version4 and bool(group.channel_group.flags & _GROUP_BUS_EVENT)
        for number, channel in enumerate(group.channels):
            full = str(channel.name)
            if not self._is_number(group, number) or (is_bus and _BUS_EVENT_NAME.match(full)):
                continue
            if full.startswith(_FRAME):
                continue
            name, _, device = full.partition("\\")
            damage = self._survey.refused.get(int(channel.address))
            reason = damage or self._refusal(channel)
            if not _fits(group, channel, version4=self._version4):
                reason = damage = "it lies outside the record"
            if reason is not None:
                self._faults.notes.append(f"channel {prefix}.{name} is left out: {reason}")
                self._faults.lost_samples += int(group.channel_group.cycles_nr) if damage else 0
                continue
            if "log" in (formula_text(channel.conversion, version4=self._version4) or "").replace("log10", ""):
                self._faults.notes.append(f"channel {prefix}.{name}: log is taken as the natural logarithm")
            info = ChannelInfo(
                f"{prefix}.{name}", name, _unit(channel), int(group.channel_group.cycles_nr), self._path.name,
                _Measured(index, number), _comment(channel),
            )  # fmt: skip
            yield _Entry(info, (*_sources(group, channel), device))

    def _refusal(self, channel: Any) -> str | None:
        if channel.conversion is None and channel.conversion_addr:
            return "its conversion cannot be read"  # asammdf gives raw numbers then
        return refusal(channel.conversion, version4=self._version4)

    def _is_number(self, group: Any, index: int) -> bool:
        channel = group.channels[index]
        if group.channel_dependencies[index]:  # a structure or an array
            return False
        if not self._version4:
            known = channel.data_type in _NUMERIC_V3_DATA and 0 < channel.bit_count <= 64
            return known and channel.channel_type != 1
        known = channel.data_type in _NUMERIC_V4_DATA and channel.channel_type in _NUMERIC_V4_CHANNELS
        return known and channel.bit_count <= 64 and not is_text_only(channel.conversion, version4=True)

    # --- records ---

    def _columns(self, group: int, indexes: Sequence[int]) -> Iterator[tuple[_Array, dict[int, _Array]]]:
        """Time stamps [s] and physical values of some channels, a stretch of records at a time.

        `MDF.select` is not used: where records are missing behind a cut it returns uninitialised memory.
        """
        whole = self._whole(group, indexes)
        if whole is not None:
            yield whole
            return
        yield from self._fragments(group, indexes)

    def _fragments(self, group: int, indexes: Sequence[int]) -> Iterator[tuple[_Array, dict[int, _Array]]]:
        inner = self._inner
        for fragment in self._stored(group):
            if self._version4:
                t = inner.get_master(group, fragment, one_piece=True)
            else:
                t = inner.get_master(group, fragment)
            yield t.astype(np.float64), {i: self._values(group, i, fragment, len(t)) for i in indexes}
        with suppress(AttributeError):
            inner._invalidation_cache.clear()

    def _stored(self, group: int) -> Iterator[Any]:
        """Stretches of records, to the end of a file that was cut."""
        stretches = self._inner._load_data(self._inner.groups[group])
        may_end = not self._version4 and self._faults.truncated
        for n in itertools.count():
            try:
                fragment = next(stretches, None)
            except ValueError:  # asammdf goes on behind the end, where a file in memory has nothing to go to
                if not may_end:
                    raise
                return
            # elsewhere it goes on with nothing, up to as many records as are declared
            if fragment is None or (may_end and n and not fragment[0]):
                return
            yield fragment

    def _whole(self, group: int, indexes: Sequence[int]) -> tuple[_Array, dict[int, _Array]] | None:
        """The same of all records at once where blocks are plain and sound; asammdf says what is wrong otherwise."""
        master = self._inner.masters_db.get(group)
        if not self._version4 or master is None:
            return None
        try:
            raw = raw_columns(self._path, self._inner, group, [*indexes, master])
        except Exception:
            return None
        return None if raw is None else self._converted(group, indexes, raw)

    def _converted(self, group: int, indexes: Sequence[int], raw: Raw) -> tuple[_Array, dict[int, _Array]]:
        """Time stamps [s] and physical values of raw samples; the time is among them."""
        master = self._inner.masters_db[group]
        channels = self._inner.groups[group].channels
        clock = channels[master].conversion
        t = raw.samples[master] if clock is None else clock.convert(raw.samples[master])
        columns = {}
        for i in indexes:
            is_nothing = channels[i].flags & _CHANNEL_ALL_INVALID
            columns[i] = (
                np.full(len(t), np.nan)
                if is_nothing
                else physical(channels[i].conversion, raw.samples[i], version4=True)
            )
            if i in raw.invalid:
                columns[i] = np.where(raw.invalid[i], np.nan, columns[i])
        return np.asarray(t, dtype=np.float64), columns

    def _in_pieces(self, group: int, indexes: Sequence[int]) -> Iterator[tuple[_Array, dict[int, _Array]]]:
        """`_columns` a stretch of records at a time wherever the blocks are; what is unsound goes on with asammdf."""
        done = 0
        master = self._inner.masters_db.get(group)
        if self._version4 and master is not None:
            with suppress(Exception):
                pieces = raw_pieces(self._path, self._inner, group, [*indexes, master], _PIECE)
                for raw in pieces if pieces is not None else ():
                    converted = self._converted(group, indexes, raw)
                    yield converted
                    done += len(converted[0])
        if done == int(self._inner.groups[group].channel_group.cycles_nr):
            return
        self._mdf.configure(read_fragment_size=_FRAGMENT)
        yield from _behind(self._fragments(group, indexes), done)

    def _raw(self, group: int, index: int, fragment: Any) -> tuple[_Array, _Array | None]:
        raw, invalid = self._inner.get(
            group=group, index=index, data=fragment, samples_only=True, raw=True, ignore_invalidation_bits=True
        )
        return raw, invalid

    def _values(self, group: int, index: int, fragment: Any, n: int) -> _Array:
        channel = self._inner.groups[group].channels[index]
        raw, invalid = self._raw(group, index, fragment)
        if len(raw) != n or (self._version4 and channel.flags & _CHANNEL_ALL_INVALID):
            return np.full(n, np.nan)
        values = physical(channel.conversion, np.asarray(raw), version4=self._version4)
        if invalid is not None:
            values = np.where(np.asarray(invalid, dtype=np.bool_), np.nan, values)
        return values

    def _nanoseconds(self, t: _Array) -> tuple[TimeArray, BoolArray]:
        """Time stamps in ns, and which of them are times at all."""
        usable = np.isfinite(t) & (np.abs(t) < _LATEST_S - self._start_ns * 1e-9)
        return np.round(t[usable] * 1e9).astype(np.int64) + self._start_ns, usable

    def _count_records(self, group: int, n: int, n_bad: int) -> None:
        declared = int(self._inner.groups[group].channel_group.cycles_nr)
        name = self._group_name(group)
        if n < declared:
            self._faults.truncated = True
            self._faults.lost_samples += declared - n
            self._faults.notes.append(f"group {name} is cut: {n} of {declared} records are there")
        self._count_bad_times(group, n_bad)

    def _count_bad_times(self, group: int, n_bad: int) -> None:
        if n_bad:
            name = self._group_name(group)
            self._faults.lost_samples += n_bad
            self._faults.notes.append(f"group {name}: {n_bad} records without a usable time stamp are left out")

    def _read_measured(self, wanted: Sequence[ChannelInfo]) -> dict[str, Channel]:
        by_group: dict[int, list[ChannelInfo]] = defaultdict(list)
        for info in wanted:
            by_group[info.key.group].append(info)
        found: dict[str, Channel] = {}
        for group, infos in by_group.items():
            self._check_memory(group, len(infos))
            pieces = list(self._columns(group, [i.key.index for i in infos]))
            t = _joined([p[0] for p in pieces])
            t_ns, usable = self._nanoseconds(t)
            self._count_records(group, len(t), len(t) - len(t_ns))
            for info in infos:
                values = _joined([p[1][info.key.index] for p in pieces])
                found[info.path] = Channel(info, t_ns, _where(usable, values), self._absolute)
        return found

    # --- raw CAN frames ---

    def _codes(self, group: int, members: dict[str, int]) -> NDArray[np.uint64]:
        """Code of each frame: bus, IDE flag and id in one integer."""
        heads = [members[m] for m in ("ID", "IDE", "BusChannel") if m in members]
        self._check_memory(group, len(heads))
        default_bus = _bus_number(self._inner.groups[group])
        codes = []
        empty, latest = 0, 0.0
        for t, columns in self._columns(group, heads):
            ids = columns[members["ID"]].astype(np.uint64)
            ide = np.zeros(len(t)) if "IDE" not in members else columns[members["IDE"]]
            extended = (ide != 0) | (ids >> np.uint64(31) != 0)
            if "IDE" not in members:
                extended |= ids > np.uint64(0x7FF)
            bus = np.full(len(t), default_bus) if "BusChannel" not in members else columns[members["BusChannel"]]
            ids &= np.uint64(0x1FFFFFFF)
            code = ids + _EXTENDED * extended.astype(np.uint64) + _EXTENDED * np.uint64(2) * bus.astype(np.uint64)
            # a page of the file that was never written is records of zeros: no frame, and a time gone by long ago
            before = np.maximum.accumulate(np.concatenate([[latest], np.nan_to_num(t)]))
            is_empty = (t == 0.0) & (ids == 0) & ~extended & (before[:-1] > 0.0)
            empty, latest = empty + int(is_empty.sum()), float(before[-1])
            codes.append(np.where(is_empty, _EMPTY, code))
        found = _joined(codes).astype(np.uint64)
        self._count_records(group, len(found), 0)
        if empty:
            name = self._group_name(group)
            self._faults.lost_samples += empty
            self._faults.notes.append(f"group {name}: {empty} records are empty (zeros in place of a frame); left out")
        return found

    def _describe_frames(self, dbc: Dbc | None) -> None:
        self._census: Counter[int] = Counter()
        for group in self._frames:
            for code, count in zip(*np.unique(group.codes, return_counts=True), strict=True):
                self._census[int(code)] += int(count) if code != _EMPTY else 0
        self._census = +self._census
        if not self._census:
            if dbc is not None:
                self._faults.notes.append("holds no raw CAN frames; --dbc has no effect on it")
            return
        buses = sorted({_bus(c) for c in self._census})
        where = f"bus {buses[0]}" if len(buses) == 1 else "buses " + ", ".join(map(str, buses))
        ids = len({_frame_key(c) for c in self._census})
        total = f"{self._census.total()} raw CAN frames with {ids} ids on {where}"
        if dbc is None:
            self._faults.notes.append(f"holds {total}; give --dbc FILE to decode them")
        else:
            self._faults.notes += [*dbc.notes, *_match_notes(self._census, dbc, total)]

    def _signals(self, dbc: Dbc) -> Iterator[_Entry]:
        buses_of: dict[tuple[int, bool], set[int]] = defaultdict(set)
        for code in self._census:
            buses_of[_frame_key(code)].add(_bus(code))
        for code in sorted(self._census, key=lambda c: (_bus(c), c)):
            message = dbc.messages.get(_frame_key(code))
            if message is None:
                continue
            prefix = f"CAN{_bus(code)}." if len(buses_of[_frame_key(code)]) > 1 else ""
            for signal in message.signals:
                if not is_decodable(signal):
                    self._faults.notes.append(f"{message.name}.{signal.name} has {signal.length} bits and is left out")
                    continue
                info = ChannelInfo(
                    f"{prefix}{message.name}.{signal.name}", signal.name, signal.unit or "", self._census[code],
                    self._path.name, _Signal(code, message, signal.name), _short(signal.comment or ""),
                )  # fmt: skip
                yield _Entry(info, (f"CAN{_bus(code)}",))

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
            short: list[tuple[ChannelInfo, int]] = []
            for info in infos:
                carried, values = decode_signal(info.key.message, info.key.name, data, length)
                # frames that select the signal but are too short for it
                signal = info.key.message.get_signal_by_name(info.key.name)
                missed = int(selected(info.key.message, signal, data, length).sum()) - int(carried.sum())
                short += [(info, missed)] if missed else []
                found[info.path] = Channel(info, t_ns[carried], values, self._absolute)
            self._tell_short(short)
        return found

    def _tell_short(self, short: Sequence[tuple[ChannelInfo, int]]) -> None:
        """Count the frames of one message that are too short for some of its signals; report them in one line."""
        self._faults.lost_samples += max((n for _, n in short), default=0)
        if len(short) == 1:
            info, n = short[0]
            need = BitField.of(info.key.message.get_signal_by_name(info.key.name)).needed
            self._faults.notes.append(f"{info.path}: {n} frames are shorter than the {need} bytes it needs; left out")
        elif short:
            most, first = max(n for _, n in short), short[0][0]
            self._faults.notes.append(
                f"{first.path.removesuffix(f'.{first.key.name}')}: {most} frames are shorter than {len(short)} of its "
                f"signals need ({first.name}, ...), cut off or without payload; left out"
            )

    def _payloads(self, wanted: set[int]) -> dict[int, tuple[TimeArray, _Array, _Array]]:
        """Time stamps, payloads and payload lengths of the wanted frames."""
        parts: dict[int, list[tuple[TimeArray, _Array, _Array]]] = defaultdict(list)
        codes = np.array(sorted(wanted), dtype=np.uint64)
        for group in self._frames:
            if not np.isin(codes, group.codes).any():
                continue
            t_ns, own, data, length = self._frame_rows(group, codes)
            for code in np.unique(own):
                rows = own == code
                parts[int(code)].append((t_ns[rows], data[rows], length[rows]))
        return {code: _merged(p) for code, p in parts.items()}

    def _frame_rows(self, group: _FrameGroup, codes: NDArray[np.uint64]) -> tuple[TimeArray, _Array, _Array, _Array]:
        members = group.members
        size = members.get("DataLength", members.get("DLC"))
        inner, at = self._inner, 0
        kept: list[tuple[_Array, _Array, _Array, _Array]] = []
        for fragment in inner._load_data(inner.groups[group.index]):
            t = inner.get_master(group.index, fragment, one_piece=True).astype(np.float64)
            own = group.codes[at : at + len(t)]
            at += len(t)
            rows = np.isin(own, codes)
            data, stored = self._payload_bytes(group.index, members["DataBytes"], fragment, len(t))
            length = stored
            if size is not None:
                length = self._values(group.index, size, fragment, len(t)).astype(np.int64)
                if "DataLength" not in members:
                    length = _DLC_LENGTH[np.clip(length, 0, 15)]
            # the frame tells what was sent; what the file has lost of it is filled up with zeros and no value
            length = np.minimum(length, stored)
            kept.append((t[rows], own[rows], data[rows], length[rows]))
        t = _joined([k[0] for k in kept])
        t_ns, usable = self._nanoseconds(t)
        # records behind a cut were counted when the ids were read
        self._count_bad_times(group.index, len(t) - len(t_ns))
        own, length = _joined([k[1] for k in kept]), _joined([k[3] for k in kept])
        return t_ns, own[usable], _stacked([k[2] for k in kept])[usable], length[usable]

    def _payload_bytes(
        self, group: int, index: int, fragment: Any, n: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Payloads (n, width), filled up with zeros, and how many bytes of each the file holds (n,)."""
        owner = self._inner.groups[group]
        channel = owner.channels[index]
        if channel.channel_type != _VARIABLE_LENGTH:
            data = _octets(self._raw(group, index, fragment)[0], n)
            return data, np.full(n, data.shape[1], dtype=np.int64)
        # asammdf's C code follows the offsets of a damaged file out of the memory, so they are followed here
        at = self._inner._get_scalar(
            channel, owner, group, index, None, None, fragment, True, 0, None, False, skip_vlsd=True  # noqa: FBT003
        )[0].astype(np.int64)  # fmt: skip
        if not n or not np.all(at >= at[0]):
            return np.zeros((n, 0), dtype=np.uint8), np.zeros(n, dtype=np.int64)
        stored = self._inner._load_signal_data(group=owner, index=index, offsets=(int(at[0]), int(at[-1])))
        return _variable(np.frombuffer(stored, dtype=np.uint8), at - at[0])


# --- single facts about blocks ---


def _fits(group: Any, channel: Any, *, version4: bool) -> bool:
    """Whether a channel lies inside its record; asammdf's C code reads outside the memory where it does not."""
    size = int(group.channel_group.samples_byte_nr)
    if version4:
        if channel.channel_type in _VIRTUAL:
            return True
        begin, bits = int(channel.byte_offset), int(channel.bit_offset) + int(channel.bit_count)
    else:
        begin, bits = int(channel.additional_byte_offset), int(channel.start_offset) + int(channel.bit_count)
    return 0 < size < _LONGEST_RECORD and channel.bit_count > 0 and begin + (bits + 7) // 8 <= size


def _frame_members(group: Any) -> dict[str, int]:
    """Channel index by member of the CAN data frame (`ID`, `DataBytes`, ...), or nothing."""
    members = {
        str(c.name).removeprefix(_FRAME): i
        for i, c in enumerate(group.channels)
        if str(c.name).startswith(_FRAME) and _fits(group, c, version4=True)
    }
    return members if {"ID", "DataBytes"} <= members.keys() else {}


def _bus_number(group: Any) -> int:
    """Bus by the name of the group or its source (`CAN2`), for loggers that do not record it per frame."""
    source = group.channel_group.acq_source
    for name in (source.name if source else "", source.path if source else "", group.channel_group.acq_name):
        number = re.search(r"(\d+)", str(name or ""))
        if number:
            return int(number[1])
    return 0


def _sources(group: Any, channel: Any) -> tuple[str, ...]:
    sources = (channel.source, getattr(group.channel_group, "acq_source", None))
    return tuple(str(s.name or s.path) for s in sources if s is not None)


def _unit(channel: Any) -> str:
    unit = (channel.conversion.unit if channel.conversion is not None else "") or getattr(channel, "unit", "") or ""
    text = unit.decode("latin-1") if isinstance(unit, bytes) else str(unit)
    return (_xml_text(text) if text.startswith("<") else text).strip("\0 \t\r\n")


def _comment(channel: Any) -> str:
    text = str(channel.comment or "")
    if text.startswith("<"):
        text = _xml_text(text)
    description = getattr(channel, "description", b"")
    if not text and isinstance(description, bytes):
        text = description.split(b"\0")[0].decode("latin-1")
    return _short(text)


def _xml_text(text: str) -> str:
    """Return the content of an XML comment; empty if it is no XML, has definitions of its own, or is too long."""
    if len(text) > _LARGEST_XML or "<!" in text.replace("<![CDATA[", "").replace("<!--", ""):
        return ""
    found = str(extract_xml_comment(text))
    return "" if found.startswith("<") else found


def _short(text: str) -> str:
    return " ".join(text.strip().split("\n")[0].split())[:120]


# --- frames ---


def _frame_key(code: int) -> tuple[int, bool]:
    return code & 0x1FFFFFFF, bool(code >> 32 & 1)


def _bus(code: int) -> int:
    return code >> 33


def _match_notes(census: Counter[int], dbc: Dbc, total: str) -> list[str]:
    """Return notes on what the DBC decodes and what it does not, with the reason where known."""
    seen = sorted({_frame_key(c) for c in census})
    missed = [k for k in seen if k not in dbc.messages]
    frames = sum(n for c, n in census.items() if _frame_key(c) in dbc.messages)
    text = f"{total}: {len(seen) - len(missed)} ids ({frames} frames) are in {', '.join(dbc.names)}"
    if missed:
        more = ", ..." if len(missed) > _SHOWN else ""
        text += f", {len(missed)} are not: " + ", ".join(_id_text(k) for k in missed[:_SHOWN]) + more
    groups = {pgn(i): m.name for (i, extended), m in dbc.messages.items() if extended}
    same_group = [k for k in missed if k[1] and pgn(k[0]) in groups]
    notes = [text]
    if same_group:
        names = ", ".join(f"{_id_text(k)} ({groups[pgn(k[0])]})" for k in same_group[:_SHOWN])
        notes.append(f"same J1939 parameter group but another sender or priority, not decoded: {names}")
    twins = [k for k in missed if (k[0], not k[1]) in dbc.messages]
    if twins:
        notes.append(
            f"the DBC has these ids with the other id length: {', '.join(_id_text(k) for k in twins[:_SHOWN])}"
        )
    return notes


def _id_text(key: tuple[int, bool]) -> str:
    return f"0x{key[0]:X}" + ("x" if key[1] else "")


def _octets(raw: _Array, n: int) -> NDArray[np.uint8]:
    """Payloads as a matrix of bytes. Shape (n, width)."""
    data = np.ascontiguousarray(raw)
    if data.dtype.kind == "S" or data.ndim == 1:
        data = data.view(np.uint8)
    return data.reshape(n, -1).astype(np.uint8, copy=False)


def _variable(stored: NDArray[np.uint8], at: TimeArray) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Payloads of variable length; each is stored as its length in 4 bytes, then its bytes.

    Returns them filled up with zeros (n, width), and how many bytes of each are stored (n,): none behind a cut.
    """
    padded = np.concatenate([stored, np.zeros(4 + _LONGEST_PAYLOAD, dtype=np.uint8)])
    at = np.minimum(at, len(stored))  # the zeros behind the end are an empty payload
    length = padded[at[:, None] + np.arange(4)].astype(np.int64) @ (1 << 8 * np.arange(4))
    width = int(min(length.max(initial=0), _LONGEST_PAYLOAD))
    octet = np.arange(width)
    payload: NDArray[np.uint8] = np.where(octet < length[:, None], padded[at[:, None] + 4 + octet], 0).astype(np.uint8)
    return payload, np.clip(length, 0, np.minimum(width, np.maximum(len(stored) - at - 4, 0)))


def _stacked(parts: Sequence[_Array]) -> _Array:
    """Payload matrices below each other, filled up to the widest."""
    width = max((p.shape[1] for p in parts), default=0)
    return np.concatenate([np.pad(p, ((0, 0), (0, width - p.shape[1]))) for p in parts] or [np.zeros((0, 0), np.uint8)])


def _merged(parts: Sequence[tuple[TimeArray, _Array, _Array]]) -> tuple[TimeArray, _Array, _Array]:
    """Frames of one message out of several groups, by time where each group is in order."""
    t_ns, data, length = _joined([p[0] for p in parts]), _stacked([p[1] for p in parts]), _joined([p[2] for p in parts])
    if len(parts) > 1 and all(np.all(np.diff(p[0]) >= 0) for p in parts):
        order = np.argsort(t_ns, kind="stable")
        return t_ns[order], data[order], length[order]
    return t_ns, data, length


def _behind(
    pieces: Iterator[tuple[_Array, dict[int, _Array]]], records: int
) -> Iterator[tuple[_Array, dict[int, _Array]]]:
    """Pieces without the first so many records."""
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


# --- names ---


def _unique(entries: Sequence[_Entry]) -> tuple[ChannelInfo, ...]:
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
