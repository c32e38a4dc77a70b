"""Groups of records of an open MDF file: times and physical values, as a whole or piece by piece."""

from __future__ import annotations

import shutil
import tempfile
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray, ChannelInfo, TimeArray
from aqualog.guard.system import bytes_text, free_memory
from aqualog.io.mdf.blocks import Group, Survey, mapped
from aqualog.io.mdf.columns import Kind, Raw, raw_pieces, sorted_groups
from aqualog.io.mdf.conversion import converted, physical, takes_floats
from aqualog.io.mdf.walk3 import survey3
from aqualog.io.mdf.walk4 import survey4
from aqualog.io.reader import OpenFile

__all__ = ["Columns", "GroupReader"]

_Array = NDArray[Any]
Columns = tuple[_Array, dict[int, _Array]]
"""Times [s] and values by channel."""

_ARCHIVES = (".bz2", ".gzip", ".mf4z", ".zip")
_OLDEST = int(datetime(1990, 1, 1, tzinfo=UTC).timestamp()) * 10**9
_PER_SAMPLE = 24  # [bytes] of a sample while a channel is read as a whole: raw, physical, time
_LATEST_S = 9.0e9  # int64 nanoseconds end in the year 2262


class GroupReader(OpenFile):
    """One open file, only ever read, and what was lost of it."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        self._survey = Survey()
        self._damaged: frozenset[int] = frozenset()  # packed blocks, by address
        self._groups: list[Group] = []
        self._channels: tuple[ChannelInfo, ...] = ()
        self._opened = 0  # how often

    def close(self) -> None:
        """Remove the temporary file, if there is one."""
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    def _open(self) -> None:
        self.close()
        self._opened += 1
        if self._path.suffix.lower() in _ARCHIVES:
            raise LogError("is named as an archive", where=str(self._path), hint="unpack or rename it to .mf4")
        with mapped(self._path) as data:
            self._version4 = bytes(data[8:10]) >= b"4."
            survey = survey4(data, self._path, self._damaged) if self._version4 else survey3(data, self._path)
        before, self._survey = self._survey, survey
        self._report(survey, before)
        self._groups = survey.groups
        if any(group.id_size for group in self._groups):
            self._sort()
        self._index = {group.at: i for i, group in enumerate(self._groups)}
        self._start_ns, self._absolute = self._start()

    def _report(self, survey: Survey, before: Survey) -> None:
        """Note the findings of a walk that one before did not have."""
        self._faults.truncated |= survey.truncated
        self._faults.unfinalised = survey.finalised
        self._faults.lost_samples += survey.lost_samples - before.lost_samples
        self._faults.notes += [note for note in survey.notes if note not in before.notes]

    def _start(self) -> tuple[int, bool]:
        """Start time in ns and whether it is a real one; loggers without a clock write 1970 or 1980."""
        head = self._survey.head
        if not _OLDEST <= head.start_ns < int(_LATEST_S * 1e9):
            return 0, False
        if head.is_local:
            self._faults.notes.append("start time is local time without a time zone; taken as UTC")
        return head.start_ns, True

    def _check_memory(self, index: int, channels: int) -> None:
        """Refuse a group whose declared size cannot be held; nothing of it has been unpacked."""
        group = self._groups[index]
        records = min(group.cycles, group.unpacked // max(group.size, 1))
        need, free = records * (channels + 1) * _PER_SAMPLE, free_memory()
        if need > free:
            raise LogError(
                f"{channels} channels of the group {self._name(index)} have {records} samples each and would "
                f"take {bytes_text(need)}", where=str(self._path), expected=f"at most {bytes_text(free)} that are free",
                hint="give fewer channels in a signal map, or a machine with more memory",
            )  # fmt: skip

    def _sort(self) -> None:
        """Sort them into a temporary file, and count those of an unfinished file."""
        self._scratch = tempfile.TemporaryDirectory(prefix="aqualog-", ignore_cleanup_errors=True)
        self._sorted = Path(self._scratch.name) / "records"
        need, free = self._survey.unsorted, shutil.disk_usage(self._scratch.name).free
        if need > free:
            raise LogError(
                "has records of several kinds in a row, and there is no space to sort them", where=str(self._path),
                expected=f"{bytes_text(need)} in {tempfile.gettempdir()}, {bytes_text(free)} are free",
                hint="set TMPDIR to a folder with more space",
            )  # fmt: skip
        by_owner: dict[int, list[Group]] = defaultdict(list)
        for group in self._groups:
            by_owner[group.owner].append(group)
        self._groups = []
        with self._sorted.open("xb") as file:
            for groups in by_owner.values():
                if not groups[0].id_size:
                    self._groups += groups
                    continue
                kinds = sorted_groups(self._path, groups, file)
                if not self._channels and groups[0].is_uncounted:
                    self._count_unsorted(groups, [k for _, k in kinds])
                self._groups += [replace(g, cycles=k.records) if g.is_uncounted else g for g, k in kinds]

    def _count_unsorted(self, groups: Sequence[Group], kinds: Sequence[Kind]) -> None:
        """Report records of an unfinished file that were not sorted: those behind a record of unknown kind."""
        there, id_size = groups[0].unpacked, groups[0].id_size
        zeros = max(g.zeros for g in groups)
        count = sum(k.records for k in kinds)
        taken = sum(k.records * id_size + k.size for k in kinds)
        longest = max(
            id_size + (k.size // max(k.records, 1) if g.is_variable else g.record)
            for g, k in zip(groups, kinds, strict=True)
        )
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

    def _clock_of(self, index: int) -> int | None:
        at = self._groups[index].master_at
        return self._index.get(at) if at else index

    def _name(self, index: int) -> str:
        return " ".join(self._groups[index].name.split()) or f"group{index}"

    def _columns(self, index: int, wanted: Sequence[int], records: int = 1 << 62) -> Iterator[Columns]:
        """Time stamps [s] and physical values of some channels, in pieces of at least so many records."""
        clock = self._clock_of(index)
        assert clock is not None
        master = self._groups[clock].master
        assert master is not None
        conversions = {i: self._groups[index].channels[i].conversion for i in wanted}
        floats = {i for i, conversion in conversions.items() if takes_floats(conversion)}
        if clock == index:
            for raw in self._raw(index, [*wanted, master], records, floats - {master}):
                yield self._times(clock, raw.samples[master]), self._values(index, wanted, raw)
            return
        t = np.concatenate([np.zeros(0), *(t for t, _ in self._columns(clock, []))])
        for raw in self._raw(index, wanted, records, floats):
            stamps = np.full(raw.records, np.nan)
            there = t[raw.first : raw.first + raw.records]
            stamps[: len(there)] = there
            yield stamps, self._values(index, wanted, raw)

    def _raw(self, index: int, wanted: Sequence[int], records: int, floats: Collection[int] = ()) -> Iterator[Raw]:
        """Raw samples, `floats` as float64; those of virtual channels are the numbers of their records."""
        group = self._groups[index]
        stored = [i for i in dict.fromkeys(wanted) if not group.channels[i].is_virtual]
        for raw in raw_pieces(self._sorted if group.id_size else self._path, group, stored, records, floats):
            numbers = np.arange(raw.first, raw.first + raw.records)
            yield raw._replace(samples=raw.samples | dict.fromkeys(set(wanted) - set(stored), numbers))

    def _times(self, index: int, raw: _Array) -> _Array:
        group = self._groups[index]
        assert group.master is not None
        clock = group.channels[group.master]
        if clock.is_virtual:
            raw = raw.astype(np.float64)
        conversion = clock.conversion
        if conversion is None or not (self._version4 or conversion.kind == "linear"):
            return raw.astype(np.float64, copy=False)
        exact = conversion.kind in ("ranges", "texts", "texts of ranges")
        return np.asarray(physical(conversion, raw) if exact else converted(conversion, raw), dtype=np.float64)

    def _values(self, index: int, wanted: Sequence[int], raw: Raw) -> dict[int, _Array]:
        found = {}
        for i in dict.fromkeys(wanted):
            channel = self._groups[index].channels[i]
            if channel.is_invalid:
                found[i] = np.full(raw.records, np.nan)
                continue
            found[i] = physical(channel.conversion, raw.samples[i], is_free=True)
            if i in raw.invalid:
                found[i] = np.where(raw.invalid[i], np.nan, found[i])
        return found

    def _nanoseconds(self, t: _Array) -> tuple[TimeArray, BoolArray]:
        """Time stamps in ns, and which of them are times at all."""
        latest = _LATEST_S - self._start_ns * 1e-9
        usable = (t > -latest) & (t < latest)
        exact = (t if usable.all() else t[usable]) * 1e9
        t_ns = np.round(exact, out=exact).astype(np.int64)
        t_ns += self._start_ns
        return t_ns, usable

    def _count_records(self, index: int, n: int, n_bad: int) -> None:
        declared = self._groups[index].cycles
        if n < declared:
            self._faults.truncated = True
            self._faults.lost_samples += declared - n
            self._faults.notes.append(f"group {self._name(index)} is cut: {n} of {declared} records are there")
        self._count_bad_times(index, n_bad)

    def _count_bad_times(self, index: int, n_bad: int) -> None:
        if n_bad:
            self._faults.lost_samples += n_bad
            what = f"{n_bad} records without a usable time stamp are left out"
            self._faults.notes.append(f"group {self._name(index)}: {what}")
