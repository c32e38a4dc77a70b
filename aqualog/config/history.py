"""Keep the history of the dry slip slope in a JSON file between drives."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from aqualog.config.reader import DEEPEST
from aqualog.core.errors import ConfigError
from aqualog.detect.slip_slope.history import History, history_from_json, history_to_json
from aqualog.io.atomic_write import write_text
from aqualog.io.user_file import read_small

__all__ = ["check_history_file", "load_history", "save_history", "update_history"]

MAX_BYTES = 50_000_000  # ten thousand configurations


def check_history_file(path: Path) -> None:
    """Refuse a file that can be read but not written back at the end of the work.

    Raises
    ------
    ConfigError
    """
    if path.exists() and not os.access(path, os.W_OK):
        raise ConfigError("cannot be written", where=str(path), hint="its permissions")


def load_history(path: Path) -> History:
    """Read a history; a missing file is an empty one.

    Raises
    ------
    ConfigError
        If the file exists and is no history.
    """
    if not path.exists():
        return History()
    data = read_small(path, what="slip-slope history", expected="a JSON file that aqualog wrote", largest=MAX_BYTES)
    try:
        document = json.loads(data)
    except RecursionError as error:
        raise ConfigError(f"is nested deeper than {DEEPEST} levels", where=str(path)) from error
    except ValueError as error:
        raise ConfigError(f"is no JSON ({str(error)[:100]})", where=str(path)) from error
    return history_from_json(document, where=str(path))


def save_history(path: Path, history: History) -> None:
    """Write a history, whole or not at all; through a link, to the file that it points to.

    Raises
    ------
    ConfigError
        If it has become too large to be read again; the file stays as it was.
    """
    text = json.dumps(history_to_json(history), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    if len(text.encode("utf-8")) > MAX_BYTES:
        raise ConfigError(f"would grow beyond {MAX_BYTES // 10**6} MB", where=str(path), hint="a history per car")
    write_text(path.resolve(), text)


def update_history(path: Path, change: Callable[[History], History]) -> None:
    """Read, change and write a history under a lock, so that parallel runs lose nothing."""
    with _alone(path.resolve().parent):
        save_history(path, change(load_history(path)))


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the folder's lock, where the system has one; it leaves no file behind."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
