"""Folders of the user that aqualog writes to by default."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["code_folder", "has_kept_code", "user_cache"]


def user_cache() -> Path:
    """Return the folder of aqualog in the user's cache; it need not exist.

    Raises
    ------
    RuntimeError
        If the user has no home folder.
    """
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(base) if base else Path.home() / ".cache") / "aqualog"


def code_folder() -> Path:
    """Return the folder for machine code that is kept from process to process; it need not exist.

    Raises
    ------
    RuntimeError
        If the user has no home folder.
    """
    return user_cache() / "compiled"


def has_kept_code() -> bool:
    """Return whether any machine code is kept; without it the first drive waits for the compiler."""
    try:
        return any(code_folder().rglob("*.nbi"))
    except (OSError, RuntimeError):
        return False
