"""History of the dry slip slope as a JSON file, kept between drives."""

from __future__ import annotations

import json
from pathlib import Path

from aqualog.detect.slip_slope.history import History, history_from_json, history_to_json
from aqualog.errors import ConfigError
from aqualog.io.whole import write_text

__all__ = ["load_history", "save_history"]

MAX_BYTES = 5_000_000  # a thousand configurations


def load_history(path: Path) -> History:
    """Read a history; one that is not there yet is empty.

    Raises
    ------
    ConfigError
        If the file is there and is no history.
    """
    if not path.exists():
        return History()
    if not path.is_file() or path.stat().st_size > MAX_BYTES:
        raise ConfigError("is no slip-slope history", where=str(path), expected="a JSON file that aqualog wrote")
    try:
        document = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"is no JSON ({str(error)[:100]})", where=str(path)) from error
    return history_from_json(document, where=str(path))


def save_history(path: Path, history: History) -> None:
    """Write a history, whole or not at all."""
    write_text(path, json.dumps(history_to_json(history), indent=1, allow_nan=False, ensure_ascii=False) + "\n")
