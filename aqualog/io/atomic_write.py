"""Write results whole or not at all, and lock folders for one writing process at a time."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Lock

from aqualog.guard.reading import unfinished

__all__ = ["folder_within", "move_together", "only_here", "write_text", "write_together", "write_whole"]

_ASKING = Lock()


def write_whole(path: Path, write: Callable[[Path], object], *, makes_folder: bool = True) -> None:
    """Let `write` make a file under a temporary name beside its place, then rename it.

    Whatever goes wrong, the old file is still there or the new one is complete. The folder is made if it is not there,
    or, without `makes_folder`, an OSError.
    """
    if makes_folder:
        path.parent.mkdir(parents=True, exist_ok=True)
    with _finished(path, write) as temporary:
        temporary.replace(path)


def write_together(files: Mapping[Path, Callable[[Path], object]]) -> None:
    """Write files as `write_whole` does, and rename none before all are complete; new folders go if one fails."""
    with _folders(path.parent for path in files), ExitStack() as stack:
        move_together([(stack.enter_context(_finished(path, write)), path) for path, write in files.items()])


@contextmanager
def folder_within(folder: Path) -> Iterator[Path]:
    """A folder for files that are to move into `folder` once all are there; new folders go if the block fails."""
    with _folders([folder]):
        temporary = Path(tempfile.mkdtemp(prefix=".", suffix=".tmp", dir=folder))
        with unfinished(temporary):
            try:
                yield temporary
            finally:
                shutil.rmtree(temporary, ignore_errors=True)


def move_together(files: Sequence[tuple[Path, Path]], gone: Sequence[Path] = (), *, again: bool = False) -> None:
    """Move files to their places in this order, and remove others. An interrupt waits: it would leave a mixture."""
    try:
        for made, path in files:
            path.parent.mkdir(exist_ok=True)
            if not again or made.exists():
                made.replace(path)
        for path in gone:
            path.unlink(missing_ok=True)
    except KeyboardInterrupt:
        move_together(files, gone, again=True)
        raise


@contextmanager
def _folders(folders: Iterable[Path]) -> Iterator[None]:
    """Make folders; those that are new go if the block fails."""
    made: list[Path] = []
    try:
        for folder in folders:
            made += [p for p in (folder, *folder.parents) if not p.exists()]
            folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for folder in made:  # the innermost first; one that holds anything stays
            with suppress(OSError):
                folder.rmdir()
        raise


@contextmanager
def _finished(path: Path, write: Callable[[Path], object]) -> Iterator[Path]:
    """Let `write` make a file under a temporary name beside its place; it is gone at the end if it is not renamed."""
    handle, name = tempfile.mkstemp(prefix=f".{path.stem[:40]}-", suffix=f"{path.suffix}.tmp", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    with unfinished(temporary):
        try:
            write(temporary)
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            with _ASKING:  # to ask is to set it for a moment
                mask = os.umask(0)
                os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            yield temporary
        finally:
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """A text file, there whole or not at all."""
    write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


@contextmanager
def only_here(lock: Path, *, together: bool = False) -> Iterator[None]:
    """Hold a lock file. The system releases it when the process ends, however it does, where there is `flock`.

    `together`: beside others that do so, and not beside one that does not; without `flock` that is not looked after.

    Raises
    ------
    BlockingIOError
        If another process holds it; its `strerror` is that process's number.
    OSError
        If the file cannot be written.
    """
    try:
        import fcntl
    except ImportError:
        if together:
            yield
            return
        handle = _made_here(lock)
    else:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, (fcntl.LOCK_SH if together else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except OSError as error:
            holder = os.read(handle, 20).decode("ascii", "replace").strip()
            os.close(handle)
            if isinstance(error, BlockingIOError):
                raise BlockingIOError(error.errno, holder, str(lock)) from error
            raise
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()}\n".encode())
        yield
    finally:
        os.close(handle)
        if os.name == "nt":
            lock.unlink(missing_ok=True)


def _made_here(lock: Path) -> int:
    """A lock where there is no `flock`: the file itself, which a killed process leaves behind."""
    try:
        return os.open(lock, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    except FileExistsError as error:
        holder = lock.read_text(encoding="ascii", errors="replace").strip()
        raise BlockingIOError(errno.EAGAIN, f"{holder}; if it has ended, remove {lock}", str(lock)) from error
