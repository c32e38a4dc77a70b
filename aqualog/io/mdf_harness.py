"""Switch off the side effects of asammdf, and limit the size of what it inflates."""

from __future__ import annotations

import io
import logging
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from functools import partial
from pathlib import Path
from typing import Any

import asammdf
import lz4.frame
import zstandard
from asammdf.blocks import mdf_v3, mdf_v4, utils, v2_v3_blocks, v4_blocks

from aqualog.io.mdf_blocks import inflated

__all__ = ["disarm_asammdf", "unpacked"]

_PLAIN, _LZ4, _ZSTD = (0,), (3, 4), (5, 6)  # asammdf's kinds of blocks; the others are deflated
_SAMPLE = 512  # [bytes] of a text that its encoding is told from; asammdf would take all of it, which takes minutes
_guess_encoding: Callable[[bytes], Any] = utils.detect


def disarm_asammdf() -> None:
    """Once for all files of this process."""
    v4_blocks.lambdify = None  # sympy.lambdify executes the text of a formula
    v2_v3_blocks.lambdify = None
    # a block that the cut went through is left out instead of the whole file
    asammdf.set_global_option("raise_on_incomplete_blocks", value=False)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # faults are reported by the reader, once
    for kind in (mdf_v4.MDF4, mdf_v3.MDF3):
        kind.__del__ = _quiet_del  # the original raises, onto stderr, when its constructor has failed
    for module in (mdf_v4, mdf_v3, v4_blocks, v2_v3_blocks, utils):
        module.print = _nothing  # reports of speed and tracebacks, into the middle of a JSON document
    utils.detect = _encoding
    mdf_v4.MDF4._extract_attachment = _no_attachment
    mdf_v4.DECOMPRESS_FUNC_MAP = _Inflaters()
    for name in ("DataBlockInfo", "SignalDataBlockInfo", "InvalidationBlockInfo"):
        setattr(mdf_v4, name, _measured(getattr(mdf_v4, name)))


class _Kind(int):
    """A kind of block that knows what the block inflates to. [bytes]"""

    size: int


class _Inflaters(dict[int, Callable[[bytes], bytes | bytearray]]):
    """asammdf asks by kind and hands over the data alone; the kind says how much there may be."""

    def __getitem__(self, kind: int) -> Callable[[bytes], bytes | bytearray]:
        return partial(_inflated, kind)


def _inflated(kind: int, data: bytes) -> bytes | bytearray:
    size = kind.size if isinstance(kind, _Kind) else None
    if size is None:
        raise ValueError("a data block without a size")
    return unpacked(kind, data, size)


def unpacked(kind: int, data: bytes, size: int) -> bytes | bytearray:
    """Content of a block of one of asammdf's kinds, which is to have so many bytes; not yet turned round.

    Raises
    ------
    Exception
        Whatever its library raises if it is damaged; ValueError if it has another size.
    """
    if kind in _PLAIN:
        return data
    out: bytes | bytearray
    if kind in _LZ4:
        out = lz4.frame.LZ4FrameDecompressor().decompress(bytes(data), max_length=size + 1)
    elif kind in _ZSTD:
        out = zstandard.ZstdDecompressor().stream_reader(bytes(data)).read(size + 1)
    else:
        out = inflated(data, size)
    if len(out) != size:
        raise ValueError(f"a data block inflates to another size than the {size} bytes that it declares")
    return out


def _measured(base: type[Any]) -> type[Any]:
    """The same description of a block, whose kind knows the size."""

    class Measured(base):  # type: ignore[misc]
        __slots__ = ()

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            kind = _Kind(self.block_type)
            kind.size = int(self.original_size)
            object.__setattr__(self, "block_type", kind)

    Measured.__name__ = base.__name__
    return Measured


def _encoding(text: bytes) -> Any:
    return _guess_encoding(text[:_SAMPLE])


def _nothing(*_: object, **__: object) -> None:
    """Stands in for `print`."""


def _no_attachment(*_: object, **__: object) -> tuple[bytes, Path, bytes]:
    """Stands in for asammdf's extraction, which opens any path that the file names."""
    return b"", Path(), b""


def _quiet_del(self: Any) -> None:
    with suppress(Exception), redirect_stdout(io.StringIO()):
        self.close()
