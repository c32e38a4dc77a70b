"""Folders of the user's that aqualog writes to without being told."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["code_folder", "has_kept_code", "user_cache"]


def user_cache() -> Path:
    """Folder of aqualog in the user's cache; it need not exist.

    Raises
    ------
    RuntimeError
        If there is no home folder.
    """
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(base) if base else Path.home() / ".cache") / "aqualog"


def code_folder() -> Path:
    """Folder for machine code that is kept from process to process; it need not exist.

    Raises
    ------
    RuntimeError
        If there is no home folder.
    """
    return user_cache() / "compiled"


def has_kept_code() -> bool:
    """Whether some machine code is kept; without it the first drive waits for the compiler."""
    try:
        return any(code_folder().rglob("*.nbi"))
    except (OSError, RuntimeError):
        return False
