"""What blocks of MDF 4 say of others: texts, sources and conversions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aqualog.core.errors import LogError
from aqualog.guard.system import bytes_text
from aqualog.io.mdf.chains4 import HEAD, Block, BlockWalk
from aqualog.io.mdf.records import Conversion, ConversionKind
from aqualog.io.mdf.walk import BlockError

__all__ = ["DescriptionWalk"]

_LARGEST_TEXT = 1 << 24
_MOST_TEXT = 1 << 28  # [bytes] of all texts together, as often as they are linked
_ENCODING_SAMPLE = 512  # [bytes] of a text by which its encoding is guessed; all of it would take minutes
_DEEPEST = 16  # conversions in conversions
_MOST_CONVERSIONS = 10_000  # that one channel leads to
_RANGES, _ALGEBRAIC = 8, 3  # types of conversions
_CONVERSIONS: tuple[ConversionKind, ...] = (
    "same", "linear", "rational", "formula", "interpolated", "nearest", "ranges", "texts", "texts of ranges",
    "from text", "from text", "same",
)  # fmt: skip


class DescriptionWalk(BlockWalk):
    """A walk that knows the texts and conversions it has seen, and why channels are refused, by address."""

    def __init__(self, data: Any, path: Path) -> None:
        super().__init__(data, path)
        self._refused: dict[int, str] = {}
        self._sizes: dict[int, int] = {}  # of texts
        self._decoded: dict[int, str] = {}
        self._text_bytes = 0
        self._conversions: dict[int, Conversion | str] = {}

    def _described(self, block: Block, index: int, what: str) -> BlockError | None:
        """Look at the text that a link leads to; one that is damaged or without measure is not followed."""
        at = block.links[index]
        if not at:
            return None
        if at in self._sizes:
            size = self._sizes[at]
        else:
            try:
                mark = self._mark(at)
                if mark not in (b"TX", b"MD"):
                    raise BlockError("TX", at, "is no text block")
                size = self._block(at, mark, 0, HEAD).length
                if size > _LARGEST_TEXT:
                    raise BlockError(mark.decode(), at, f"has {bytes_text(size)} of text")
            except BlockError as broken:
                self._found.remark(f"{what} is left out: {broken}")
                self._found.truncated |= broken.is_cut
                return broken
            self._sizes[at] = size
        self._text_bytes += size
        if self._text_bytes > _MOST_TEXT:
            raise LogError(
                f"its names and comments take more than {bytes_text(_MOST_TEXT)} as often as they are linked",
                where=str(self._path), hint="check it with the logger's own tool",
            )  # fmt: skip
        return None

    def _text(self, at: int) -> str:
        """The text at a place, which `_described` has found sound; empty for any other."""
        if at not in self._sizes:
            return ""
        if at not in self._decoded:
            raw = bytes(self._data[at + HEAD : at + self._sizes[at]]).split(b"\0", 1)[0].strip(b" \r\t\n")
            try:
                self._decoded[at] = raw.decode("utf-8")
            except UnicodeDecodeError:
                self._decoded[at] = raw.decode(_encoding(raw[:_ENCODING_SAMPLE]), "ignore")
        return self._decoded[at]

    def _source(self, block: Block, index: int) -> tuple[str, ...]:
        """Name and path of a source; nothing without one."""
        at = block.links[index]
        if not at:
            return ()
        try:
            source = self._block(at, b"SI", 3, 56)
        except BlockError as broken:
            self._found.remark(f"the description of a source is left out: {broken}")
            return ()
        for text in range(3):
            self._described(source, text, "the name of a source")
        return self._text(source.links[0]), self._text(source.links[1])

    def _conversion_of(self, block: Block) -> Conversion | None:
        """The conversion of a channel; where it cannot be read the channel is refused."""
        at = block.links[4]
        if not at:
            return None
        if at not in self._conversions:
            try:
                self._conversions[at] = self._conversion(at, 0, [_MOST_CONVERSIONS])
            except BlockError as broken:
                self._conversions[at] = f"its conversion cannot be read, {broken}"
        found = self._conversions[at]
        if isinstance(found, Conversion):
            return found
        self._refused[block.at] = found
        return None

    def _conversion(self, at: int, depth: int, budget: list[int]) -> Conversion:
        block = self._block(at, b"CC", 4, HEAD + 32 + 24)
        budget[0] -= 1
        if depth > _DEEPEST or budget[0] < 0:
            raise BlockError("CC", at, "leads to conversions without end")
        kind, numbers = self._conversion_numbers(block)
        if self._described(block, 1, f"the unit of the conversion at byte {at}") is not None:
            raise BlockError("CC", at, "has lost its unit")
        for link in (0, 2):
            self._described(block, link, f"a text of the conversion at byte {at}")
        if kind == _RANGES and any(a and self._mark(a) == b"CC" for a in block.links[4:]):
            ranges = list(zip(numbers[::2], numbers[1::2], strict=True))
            if len(set(ranges)) < len(ranges):
                raise BlockError("CC", at, "is damaged, it has a range twice")
        references: list[Conversion | bytes | None] = []
        for index in range(4, len(block.links)):
            link = block.links[index]
            if not link:
                references.append(None)
            elif self._mark(link) == b"CC" and kind != _ALGEBRAIC:
                references.append(self._conversion(link, depth + 1, budget))
            elif self._described(block, index, f"a text of the conversion at byte {at}") is not None:
                raise BlockError("CC", at, "has lost one of its texts")
            else:
                references.append(b"")
        formula = self._text(block.links[4]) if kind == _ALGEBRAIC else ""
        return Conversion(_CONVERSIONS[kind], self._text(block.links[1]), numbers, tuple(references), formula)

    def _conversion_numbers(self, block: Block) -> tuple[int, tuple[float, ...]]:
        """Type of a conversion and its numbers, of which there must be as many as its type needs."""
        if block.data + 24 > block.at + block.length:
            raise BlockError("CC", block.at, f"is damaged, it has {len(block.links)} links")
        kind, references, count = self._numbers("<B3xHH", block.data)
        if len(block.links) != 4 + references or block.data + 24 + 8 * count > block.at + block.length:
            what = f"is damaged, it has {len(block.links)} links for {references} references"
            raise BlockError("CC", block.at, what)
        is_whole = {
            0: True, 1: count == 2, 2: count == 6, 3: references == 1, 4: count >= 2 and count % 2 == 0,
            5: count >= 2 and count % 2 == 0, 6: count % 3 == 1, 7: references == count + 1,
            8: 2 * (references - 1) == count, 9: count == references + 1, 10: references % 2 == 1,
            11: references == count,
        }.get(kind)  # fmt: skip
        if not is_whole:
            what = f"is damaged, type {kind} has {count} numbers and {references} references"
            raise BlockError("CC", block.at, what)
        return kind, self._numbers(f"<{count}d", block.data + 24)


def _encoding(sample: bytes) -> str:
    """Of a text that is not UTF-8 as it should be."""
    from charset_normalizer import from_bytes

    best = from_bytes(sample).best()
    return "latin-1" if best is None else best.encoding
