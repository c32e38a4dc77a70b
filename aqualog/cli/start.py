"""The installed command's first step: an interrupt while it loads is one line, too."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

from aqualog.guard.streams import open_streams

__all__ = ["interrupted", "run"]


def run() -> None:
    """Entry point of the installed command."""
    open_streams()
    try:
        from aqualog.cli.main import run as begin
    except KeyboardInterrupt:
        interrupted()
    begin()


def interrupted() -> NoReturn:
    """End at once: nothing has been begun."""
    sys.stderr.write("interrupted\n")
    sys.stderr.flush()
    os._exit(130)
