"""What the walks through MDF 3 and MDF 4 have in common.

A walk checks every block that it follows: whether it is there, is what its link says, and is linked once. What is cut
or damaged is left out as if nothing had led to it, and noted.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from aqualog.core.errors import LogError
from aqualog.io.mdf.records import FileHead, Group

__all__ = ["BlockError", "Survey", "Walk", "mapped", "plain_text", "short"]

_COMPLETE = "a complete MDF file"
_COPY_AGAIN = "copy it from the logger again or stop the recording properly"
_OWN_TOOL = "check it with the logger's own tool"
_MOST_NOTES = 30
_LARGEST_XML = 1 << 20


class BlockError(Exception):
    """A block that cannot be read.

    Parameters
    ----------
    kind : str
        Of the block, as MDF names it (`CG`).
    at : int
        Where it is, or should be. [bytes]
    why : str
        What is wrong with it.
    is_cut : bool
        Whether the file ends before it does.
    """

    def __init__(self, kind: str, at: int, why: str, *, is_cut: bool = False) -> None:
        self.kind, self.at, self.why, self.is_cut = kind, at, why, is_cut
        super().__init__(f"its {kind} block at byte {at} {why}")


@dataclass(slots=True)
class Survey:
    """What a walk has found: the groups that can be read, and lost parts in words.

    `deflated`: addresses of packed blocks of data. `unsorted`: size of records of several kinds in a row. [bytes]
    """

    groups: list[Group] = field(default_factory=list)
    head: FileHead = field(default_factory=FileHead)
    deflated: list[int] = field(default_factory=list)
    unsorted: int = 0
    notes: list[str] = field(default_factory=list)
    truncated: bool = False
    finalised: bool = False
    lost_samples: int = 0

    def lost(self, what: str, broken: BlockError, samples: int = 0) -> None:
        """Note a part that is left out because of a block."""
        self.truncated = True
        self.lost_samples += samples
        self.remark(f"{what} is lost: {broken}")

    def remark(self, note: str) -> None:
        """A note; of very many the first ones are enough."""
        if len(self.notes) < _MOST_NOTES:
            self.notes.append(note)
        elif len(self.notes) == _MOST_NOTES:
            self.notes.append("more blocks are damaged than are listed here")

    def hopeless(self, path: Path, broken: BlockError) -> LogError:
        """Return the error for a file without any readable part."""
        if broken.is_cut:
            return LogError(f"file is cut: {broken}", where=str(path), expected=_COMPLETE, hint=_COPY_AGAIN)
        return LogError(f"file is damaged: {broken}", where=str(path), hint=_OWN_TOOL)


class Walk:
    """The file, what is found, and which blocks were seen.

    Parameters
    ----------
    data : bytes or mmap
    path : Path
    """

    def __init__(self, data: Any, path: Path) -> None:
        self._data, self._path, self._size = data, path, len(data)
        self._found = Survey()
        self._linked: set[int] = set()  # blocks that one link alone may lead to
        self._begins: set[int] = set()  # of all blocks seen

    def _block_head(self, name: str, at: int, layout: struct.Struct, mark: bytes) -> tuple[int, ...]:
        """Numbers behind the mark of a block, which must be the right one and inside the file."""
        if at + layout.size > self._size:
            raise BlockError(name, at, f"is missing, the file ends at byte {self._size}", is_cut=True)
        found, *numbers = layout.unpack_from(self._data, at)
        if found != mark:
            raise BlockError(name, at, f"is not there, the file holds {found!r}")
        return tuple(numbers)

    def _seen(self, name: str, at: int, size: int) -> None:
        """A block of a size, which must lie inside the file."""
        if at + size > self._size:
            raise BlockError(name, at, f"is incomplete, the file ends at byte {self._size}", is_cut=True)
        self._begins.add(at)

    def _link_once(self, name: str, at: int) -> None:
        """A block of which there must be one link only: no cycles, and no tree that grows without end."""
        if at in self._linked:
            raise BlockError(name, at, "is linked twice")
        self._linked.add(at)


@contextmanager
def mapped(path: Path) -> Iterator[Any]:
    """The bytes of a file, without reading them."""
    with path.open("rb") as file:
        if file.seek(0, 2) == 0:
            yield b""
            return
        view = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        try:
            yield view
        finally:
            view.close()


def plain_text(text: str) -> str:
    """Content of a text that may be an XML comment; empty if that has definitions of its own, or is too long."""
    if not text.startswith("<"):
        return text
    if len(text) > _LARGEST_XML or "<!" in text.replace("<![CDATA[", "").replace("<!--", ""):
        return ""
    try:
        root = ElementTree.fromstring(text.replace(' xmlns="http://www.asam.net/mdf/v4"', ""))
    except ElementTree.ParseError:
        return ""
    content = root.find(".//TX")
    if content is not None:
        found = content.text or ""
    else:
        properties = root.find(".//common_properties")
        found = "\n".join(f"{e.get('name')}: {e.text}" for e in (() if properties is None else properties))
    return "" if found.startswith("<") else found


def short(text: str) -> str:
    """The first line of a comment, at most 120 characters."""
    return " ".join(text.strip().split("\n")[0].split())[:120]
