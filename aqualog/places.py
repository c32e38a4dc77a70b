"""Folders of the user's that aqualog writes to without being told."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["user_cache"]


def user_cache() -> Path:
    """Folder of aqualog in the user's cache; it need not exist.

    Raises
    ------
    RuntimeError
        If there is no home folder.
    """
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(base) if base else Path.home() / ".cache") / "aqualog"
