"""The installed command's first step: an interrupt while it loads is one line, too."""

from __future__ import annotations

import os
import sys
import warnings

from aqualog.guard.streams import open_streams

__all__ = ["run"]


def run() -> None:
    """Entry point of the installed command."""
    open_streams()
    # commands have threads and processes of their own, in which those of a product of matrices wait for each other
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if not sys.warnoptions:  # a user has no use for what Python remarks, here or in other processes
        sys.warnoptions.append("ignore")
        warnings.simplefilter("ignore")
    try:
        from aqualog.cli.main import run as begin

        begin()
    except KeyboardInterrupt:  # nothing has been begun: end at once
        sys.stderr.write("interrupted\n")
        sys.stderr.flush()
        os._exit(130)
