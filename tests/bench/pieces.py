"""Events of a drive of many hours in one file beside those of its pieces: `python -m tests.bench.pieces FOLDER`.

The long file goes through `detect` in windows, each piece as a whole in one pass. A piece begins an hour early, since the
detectors come from somewhere; of its events those count that begin after that hour.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from tests.bench.child import ROOT
from tests.bench.logs import CAR, PERIOD_S, RATE, drive, one_log

LEAD_H = 1.0
RTOL, ATOL = 1e-8, 1e-9  # the document has nine digits
ONE_PASS = (
    "import sys; from aqualog.align import load as l; l.LONG = 10**12\n"
    "from aqualog.cli.main import run; run()"
)  # fmt: skip


def pieces_of(hours: float, piece_h: float) -> list[tuple[int, int, int]]:
    """First row, first row that counts, row after the last, of each piece."""
    n, step, lead = (round(h * 3600.0 * RATE) for h in (hours, piece_h, LEAD_H))
    return [(max(0, k - lead), k, min(n, k + step)) for k in range(0, n, step)]


def write_piece(path: Path, begin: int, end: int) -> Path:
    """Rows begin to end of what `one_log` writes, as a file of its own."""
    from aqualog.core.notation import SYMBOLS
    from aqualog.io.write_log import LogGroup, write_log

    found = drive(PERIOD_S)
    rows = np.arange(begin, end) % next(iter(found.values())).size
    group = LogGroup("drive", {k: (SYMBOLS[k].unit, SYMBOLS[k].meaning, x[rows]) for k, x in found.items()})
    write_log(path, np.arange(end - begin) * round(1e9 / RATE), [group], suffix=".mf4", start_ns=None)
    return path


def events(path: Path, *, one_pass: bool) -> list[dict[str, Any]]:
    """What `aqualog detect --json` tells of a log, in the process limits of a user."""
    command = ["-c", ONE_PASS] if one_pass else ["-m", "aqualog"]
    told = subprocess.run(
        [sys.executable, *command, "detect", str(path), "--vehicle", str(CAR), "--json", "-q"],
        cwd=ROOT, capture_output=True, check=True,
    )  # fmt: skip
    found: list[dict[str, Any]] = json.loads(told.stdout)["events"]
    return found


def shifted(event: Mapping[str, Any], begin: int) -> dict[str, Any]:
    """An event of a piece in the time of the whole."""
    return {k: round(x + begin / RATE, 6) if k in ("start_s", "end_s") else x for k, x in event.items()}


def alike(one: Any, other: Any) -> bool:
    """Whether two events, or what they hold, are equal: numbers to RTOL of themselves or ATOL."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(alike(one[k], other[k]) for k in one)
    if isinstance(one, float) and isinstance(other, float):
        return bool(np.isclose(one, other, rtol=RTOL, atol=ATOL))
    return bool(one == other)


def compare(whole: Sequence[Mapping[str, Any]], pieces: Sequence[Mapping[str, Any]]) -> list[str]:
    """What one has and the other has not, a line each."""
    left = list(pieces)
    out = []
    for event in whole:
        found = next((i for i, other in enumerate(left) if alike(event, other)), None)
        if found is None:
            out.append(f"only in the whole: {json.dumps(event)}")
        else:
            left.pop(found)
    return out + [f"only in a piece: {json.dumps(e)}" for e in left]


def main(
    folder: Annotated[Path, typer.Argument(help="For the logs; needs 6 GB at 100 h.")],
    hours: float = 100.0,
    piece_h: float = 10.0,
) -> None:
    """Compare them; exit code 1 if they differ."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"whole_{hours:g}h.mf4"
    if not path.exists():
        one_log(path, hours * 3600.0)
    print(f"{path.name}: {path.stat().st_size / 1e9:.2f} GB", flush=True)
    whole = [shifted(e, 0) for e in events(path, one_pass=False)]
    print(f"in windows: {len(whole)} events", flush=True)
    parts: list[dict[str, Any]] = []
    for begin, counted, end in pieces_of(hours, piece_h):
        piece = write_piece(folder / "piece.mf4", begin, end)
        found = [shifted(e, begin) for e in events(piece, one_pass=True)]
        parts += [e for e in found if counted / RATE <= e["start_s"] < end / RATE]
        print(f"rows {counted} to {end}: {len(parts)} events so far", flush=True)
        piece.unlink()
    apart = compare(whole, parts)
    print("\n".join([*apart[:20], f"{len(whole)} events, {len(parts)} in pieces, {len(apart)} lines apart"]))
    raise typer.Exit(1 if apart else 0)


if __name__ == "__main__":
    typer.run(main)
