"""The book's table of benchmarks: between its two marks, and nothing else of the page."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from tests.bench.child import ROOT
from tests.bench.compare import HEAD

__all__ = ["BEGIN", "END", "PAGE", "conditions", "put"]

PAGE = ROOT / "aqualog" / "docs" / "validation" / "benchmarks.md"
BEGIN, END = "<!-- benchmarks -->", "<!-- /benchmarks -->"
PEERS = ("asammdf", "rosbags", "pandas", "scipy", "filterpy", "plotly", "polars", "numba")
BUSY = 0.3  # load per processor, before anything was run, from which on a machine is not idle


def conditions() -> str:
    """Where and when: call it before anything is run, for the load is that of others then."""
    cores = os.cpu_count() or 1
    load = os.getloadavg()[0]
    state = f"busy with other work (load {load:.1f})" if load > BUSY * cores else "idle otherwise"
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    found = ", ".join(f"{n} {v}" for n in PEERS if (v := _version(n)))
    return (
        f"Measured on {datetime.now(UTC):%Y-%m-%d} on {cores} {platform.machine()} processors with {memory:.0f} GB, {state}. "
        f"Python {platform.python_version()}. Libraries: {found}."
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def put(page: Path, about: str, lines: Sequence[str]) -> None:
    """Replace what stands between the marks by `about` and the rows.

    Raises
    ------
    ValueError
        If the file has not both marks, once each.
    """
    text = page.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise ValueError(f"{page.name} must have {BEGIN} and {END}, once each")
    head, rest = text.split(BEGIN)
    table = "\n".join([HEAD, *lines])
    whole = f"{head}{BEGIN}\n{about}\n\n{table}\n{END}{rest.split(END)[1]}"
    draft = page.with_name(page.name + ".new")
    draft.write_text(whole, encoding="utf-8")
    draft.replace(page)
