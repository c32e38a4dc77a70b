"""Read ROS logs: ROS 1 bags and ROS 2 recordings in sqlite3 or MCAP, a single file or a directory of splits.

A ROS 2 directory is read from its files; `metadata.yaml` only names and orders them, so one that lost it, or lost a
split, is still read. Messages are decoded with the definitions in the recording, or with those of its ROS release
where an old recording holds none.

Formats: http://wiki.ros.org/Bags/Format/2.0, https://github.com/ros2/rosbag2 [rosbag2010]
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

import zstandard
from rosbags.typesys import Stores

from aqualog.core.errors import LogError
from aqualog.io.decompress import FREE, RATIO
from aqualog.io.messages.bag import MAGIC as BAG_MAGIC
from aqualog.io.messages.bag import BagSource
from aqualog.io.messages.db3 import Db3Source, release_of
from aqualog.io.messages.mcap import McapSource
from aqualog.io.messages.reader import MessageReader, Source
from aqualog.io.reader import FaultLog, ReadOptions

__all__ = ["RosReader"]

_DB3_MAGIC = b"SQLite format 3\0"
_SPLIT = re.compile(r"\.(db3|mcap)(\.zstd)?$")
_MOST_METADATA = 1 << 20  # [byte]


class RosReader(MessageReader):
    """Reader of a ROS 1 bag, a ROS 2 file, or a ROS 2 directory."""

    format = "ros"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        faults = FaultLog()
        self._temporary: TemporaryDirectory[str] | None = None
        try:
            super().__init__(path, self._sources_of(path, faults), faults)
        except BaseException:
            self.close()
            raise

    def _sources_of(self, path: Path, faults: FaultLog) -> list[Source]:
        if not path.exists():
            raise LogError("does not exist", where=str(path), hint="check the path")
        if not path.is_dir():
            return [self._open(path, Stores.ROS2_HUMBLE)]
        release = _release(_metadata(path))
        sources: list[Source] = []
        for split in _splits(path, faults):
            try:
                sources.append(self._open(split, release))
            except LogError as error:
                faults.truncated = True
                faults.notes.append(f"a split is left out: {error.line()}")
        if not sources:
            raise LogError(
                "no split can be read",
                where=str(path),
                expected="a directory with .db3 or .mcap files",
                hint=faults.notes[0] if faults.notes else "name the file itself",
            )
        return sources

    def _open(self, path: Path, release: Stores) -> Source:
        if path.suffix == ".zstd":
            path = self._decompressed(path)
        with _opened(path) as file:
            magic = file.read(16)
        if magic.startswith(BAG_MAGIC):
            return BagSource(path)
        if magic == _DB3_MAGIC:
            return Db3Source(path, release)
        if magic.startswith(b"\x89MCAP"):
            return McapSource(path)
        what = "is no ROS recording" if magic else "is empty"
        raise LogError(what, where=str(path), expected="a ROS 1 bag (version 2.0), a .db3 or an .mcap file")

    def _decompressed(self, path: Path) -> Path:
        """A split that the recorder compressed as a whole, unpacked to a temporary file."""
        if self._temporary is None:
            self._temporary = TemporaryDirectory(prefix="aqualog-")
        target = Path(self._temporary.name, path.stem)
        on_disk = shutil.disk_usage(self._temporary.name).free // 2
        room = min(on_disk, FREE + RATIO * path.stat().st_size)
        try:
            with _opened(path) as packed, target.open("wb") as out:
                reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
                while block := reader.read(1 << 20):
                    room -= len(block)
                    if room < 0:
                        what = f"is not unpacked: {out.tell() + len(block)} bytes and more in {path.stat().st_size}"
                        raise LogError(what, where=str(path), hint="free space for temp files; or it is no recording")
                    out.write(block)
        except zstandard.ZstdError as error:
            what = f"cannot be unpacked ({error})"
            raise LogError(what, where=str(path), hint="copy it again from the vehicle") from error
        return target

    def close(self) -> None:
        """Release the file and remove what was unpacked."""
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None


# ---------------------------------------------------------------- directory


def _metadata(path: Path) -> str:
    try:
        with (path / "metadata.yaml").open("rb") as file:
            return file.read(_MOST_METADATA).decode(errors="replace")
    except OSError:
        return ""


def _release(metadata: str) -> Stores:
    found = re.search(r"^[ \t]*ros_distro:\s*['\"]?(\w+)", metadata, re.MULTILINE)
    return release_of(found[1] if found else "")


def _splits(path: Path, faults: FaultLog) -> list[Path]:
    """Files of a recording in the order of `metadata.yaml`, or in the order of their numbers."""
    present = {p.name: p for p in path.iterdir() if p.is_file() and _SPLIT.search(p.name)}
    # Only the bare name counts: a path in the metadata may point anywhere.
    listed = re.findall(
        r"^[ \t]*-[ \t]*['\"]?(?:[^\s'\"]*/)?([^\s/'\"]+\.(?:db3|mcap)(?:\.zstd)?)", _metadata(path), re.MULTILINE
    )
    listed = list(dict.fromkeys(listed))
    missing = [name for name in listed if name not in present]
    if missing:
        faults.truncated = True
        faults.notes.append(f"{path.name}: metadata.yaml names files that are missing: {', '.join(missing[:5])}")
    found = [present[name] for name in listed if name in present]
    return found or [present[name] for name in sorted(present, key=_split_number)]


def _split_number(name: str) -> tuple[str, int]:
    """`drive_10.db3` comes after `drive_9.db3`."""
    stem = _SPLIT.sub("", name)
    found = re.search(r"^(.*?)_(\d+)$", stem)
    return (found[1], int(found[2])) if found else (stem, -1)


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"cannot be opened ({error.strerror})", where=str(path), hint="check the path") from error
