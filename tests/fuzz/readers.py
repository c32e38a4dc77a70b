"""What may come of a log with any content: what was recorded, or an error that says what is wrong."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, FileFaults
from aqualog.io.mdf import columns as mdf_columns
from aqualog.io.mdf import reader as mdf
from aqualog.io.messages import batches
from aqualog.io.messages import reader as messages
from aqualog.io.open_log import open_log
from aqualog.io.reader import ReadOptions
from aqualog.io.tables import csv, parquet
from aqualog.io.tables import csv_text as text_file

T0_NS = 1_700_000_000 * 10**9
LONGEST_LINE = 2000
_SMALL = (
    (messages, "_PIECE", 50), (batches, "_ENOUGH", 1000), (mdf, "_PIECE", 25), (mdf_columns, "_PIECE", 400),
    (parquet, "_PIECE", 60), (text_file, "LARGE", 1), (text_file, "_BLOCK", 333), (csv, "PIECE", 200),
)  # fmt: skip


class Outcome(NamedTuple):
    """Channels and what was lost, or the line of the error."""

    channels: tuple[Channel, ...] = ()
    faults: FileFaults = FileFaults()
    refusal: str = ""


def outcome(data: bytes, name: str, *, dbc: bytes | None = None, named: str = "") -> Outcome:
    """What a file with this content and name says.

    Fails unless all of this holds: it is read or refused with one line that names it; each channel has as many times as
    values; read in pieces, or one channel alone, it says the same; and the file stays as it was. `named` is what an error
    has to name, the file by default.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(data)
        options = ReadOptions()
        if dbc is not None:
            Path(folder, "a.dbc").write_bytes(dbc)
            options = ReadOptions(dbc=(Path(folder, "a.dbc"),))
        whole = _tried(_whole, path, options, len(data))
        with _small_pieces():
            pieces = _tried(_pieces, path, options, len(data))
        assert path.read_bytes() == data, "the file was changed"
    _check_form(whole, named or name)
    _check_form(pieces, named or name)
    _check_same(whole, pieces)
    return whole


def _tried(read: Callable[[Path, ReadOptions, int], Outcome], path: Path, options: ReadOptions, number: int) -> Outcome:
    try:
        return read(path, options, number)
    except LogError as error:
        return Outcome(refusal=error.line())


def _whole(path: Path, options: ReadOptions, number: int) -> Outcome:
    with open_log(path, options) as reader:
        infos = reader.channels()
        found = reader.read(infos)
        assert [c.info for c in found] == list(infos), "other channels than asked for"
        faults = reader.faults
        if found:
            one = found[number % len(found)]
            alone = reader.read([one.info])[0]
            # other channels of its messages may be what makes them wrong
            if len(alone.t_ns) == len(one.t_ns):
                assert _is_same(alone, one), f"{one.info.path} alone is another"
            else:
                assert np.isin(one.t_ns, alone.t_ns).all(), f"{one.info.path} alone has other times"
    return Outcome(tuple(found), faults)


@contextmanager
def _small_pieces() -> Iterator[None]:
    """Small files come in many pieces, as long logs do."""
    with ExitStack() as stack:
        for module, name, size in _SMALL:
            stack.enter_context(mock.patch.object(module, name, size))
        yield


def _pieces(path: Path, options: ReadOptions, _: int) -> Outcome:
    with open_log(path, options) as reader:
        infos = reader.channels()
        if not hasattr(reader, "parts"):
            found = reader.read(infos)
            return Outcome(tuple(found), reader.faults)
        if not infos:
            return Outcome(faults=reader.faults)
        by_path: dict[tuple[str, str], list[Channel]] = {(i.file, i.path): [] for i in infos}
        for part in reader.parts(infos):
            for piece in part.pieces:
                for c in piece:
                    by_path[c.info.file, c.info.path].append(c)
        return Outcome(tuple(_joined(p) for p in by_path.values() if p), reader.faults)


def _joined(pieces: list[Channel]) -> Channel:
    if len(pieces) == 1:
        return pieces[0]
    last = pieces[-1]
    return Channel(
        last.info, np.concatenate([p.t_ns for p in pieces]), np.concatenate([p.values for p in pieces]), last.absolute
    )  # fmt: skip


def _is_same(a: Channel, b: Channel) -> bool:
    return np.array_equal(a.t_ns, b.t_ns) and np.array_equal(a.values, b.values, equal_nan=True)


def _check_form(found: Outcome, name: str) -> None:
    assert name in (found.refusal or name), f"the file is not named: {found.refusal}"
    assert "\n" not in found.refusal
    assert len(found.refusal) < LONGEST_LINE, "a long error"
    assert isinstance(found.faults.lost_samples, int)
    assert found.faults.lost_samples >= 0, f"{found.faults.lost_samples} samples lost"
    for c in found.channels:
        assert c.t_ns.shape == c.values.shape, f"{c.info.path}: {c.t_ns.shape} times, {c.values.shape} values"
        assert (c.t_ns.dtype, c.values.dtype) == (np.int64, np.float64), f"{c.info.path}: {c.t_ns.dtype}"


def _check_same(whole: Outcome, pieces: Outcome) -> None:
    assert bool(whole.refusal) == bool(pieces.refusal), f"in one: {whole.refusal!r}; in pieces: {pieces.refusal!r}"
    by_path = {c.info.path: c for c in pieces.channels}
    for c in whole.channels:
        other = by_path.get(c.info.path)
        if other is None:
            assert not c.t_ns.size, f"{c.info.path} is not in pieces"
        else:
            assert _is_same(c, other), (
                f"{c.info.path} is another in pieces: {len(c.t_ns)} and {len(other.t_ns)} samples"
            )
    if not whole.channels:  # nothing is gone through in pieces
        return
    assert whole.faults.lost_samples == pieces.faults.lost_samples, (
        f"{whole.faults.lost_samples} samples lost in one, {pieces.faults.lost_samples} in pieces"
    )


def check_samples(channels: Sequence[Channel], time_of: Callable[[np.ndarray], np.ndarray]) -> None:
    """Values that are told are those that were recorded at that time."""
    for c in channels:
        told = np.isfinite(c.values)
        assert (c.values[told] == np.rint(c.values[told])).all(), f"{c.info.path} has values that were not recorded"
        times = time_of(c.values[told].astype(np.int64))
        assert np.array_equal(c.t_ns[told], times), f"{c.info.path} has values at times at which they were not recorded"
