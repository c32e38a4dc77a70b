"""What aqualog makes of a damaged log, beside the sound one."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FileFaults
from tests.damaged.damage import Damage

# Formats whose samples stand behind no checksum: that one of them is another number cannot be seen.
UNCHECKED = (
    "MF4",
    "MF4 unfinished",
    "MDF 3",
    "ROS 1 bag",
    "ROS 2 database",
    "CSV",
    "CSV, UTF-16, comma",
    "Parquet, plain",
)
USUAL = "file was not finalised by the logger; aqualog completes it while reading"  # no word of a damage
CODES = (0, 1, 3, 4)

Samples = dict[str, tuple[np.ndarray, np.ndarray]]


OUTCOMES = (
    "right", "part, told", "refused", "samples changed, told", "samples changed", "wrong, told", "PART IN SILENCE",
    "WRONG IN SILENCE", "traceback", "over limit",
)  # fmt: skip
"""What may become of a damaged log, in the order of a table; what is in capitals and behind must not be."""

LEGEND = """- right: every sample of the sound log and no other (the damage hit what is not needed)
- part, told: samples are missing, none is another; what was lost is told (exit code 3)
- refused: one line says what is wrong (exit code 1 or 4)
- samples changed: no more samples are other numbers than the damaged bytes can hold, or those of one channel. In plain
  numbers and text without a checksum (MF4, MDF 3, ROS 1 bags, databases, CSV, Parquet), and in what was packed without one
  (Parquet, lz4 in bags), a bit that has flipped makes another number, and nothing in the file can show it; what goes beyond a signal's range or a column's bounds is told
- wrong, told: more than that is wrong, and a loss is told
- IN SILENCE: samples are missing or wrong and nothing is told; over limit: 30 s or 2 GB"""


class Seen(NamedTuple):
    """Of one log: the exit code of `detect --json`, its last words, and what was read; `told` if a loss is told.

    `lost` are the samples that the reader counts as lost, None where it says that more may be.
    """

    code: int
    words: str
    told: bool
    samples: Samples
    lost: int | None = None


def missing(sound: Samples, seen: Seen) -> int:
    """How many rows or messages of the sound log were not read: the most samples that a channel lacks."""
    return max(len(t) - len(seen.samples.get(path, (t[:0],))[0]) for path, (t, _) in sound.items())


def outcome(found: str) -> str:
    """The column of the table that a verdict belongs to."""
    if not found.startswith("!"):
        return found
    silent = {"! part in silence": "PART IN SILENCE", "! wrong in silence": "WRONG IN SILENCE"}
    return silent.get(found, "over limit" if found.startswith("! over") else "traceback")


def samples_of(path: Path) -> tuple[Samples, FileFaults]:
    """Stamps [ns] and finite values of every channel, and what the reader tells of."""
    from aqualog.io.open_log import open_log

    with open_log(path) as reader:
        found = reader.read(reader.channels())
        faults = reader.faults
    keep = {c.info.path: np.isfinite(c.values) for c in found}
    return {c.info.path: (c.t_ns[keep[c.info.path]], c.values[keep[c.info.path]]) for c in found}, faults


def look(path: Path) -> Seen:
    """Run `detect` on a log and read it; what is expected of a damaged log comes back, anything else is raised."""
    from aqualog.cli.main import app
    from aqualog.core.errors import AqualogError

    code, out, words = 0, io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(words):
        try:
            app(["detect", str(path), "--json", "--progress", "off"])
        except SystemExit as leave:
            code = int(leave.code or 0)
    if code in (0, 3):
        json.loads(out.getvalue())
    last = (words.getvalue().strip().splitlines() or [""])[-1]
    try:
        samples, faults = samples_of(path)
    except AqualogError as error:
        return Seen(code, last or str(error), True, {})
    told = faults.truncated or faults.lost_samples > 0 or any(n != USUAL for n in faults.notes) or code == 3
    return Seen(code, last, told, samples, None if faults.truncated else faults.lost_samples)


def attempt(path: Path) -> Seen | str:
    """`look`, with what nothing may raise as a text."""
    try:
        return look(path)
    except Exception as error:
        return f"! {type(error).__name__}: {error}"


def verdict(name: str, damage: Damage, sound: Samples, seen: Seen) -> str:
    """What became of a log, in a word or two; what begins with `!` must not be.

    Bytes that no checksum covers can turn a sample into another number, or all of a channel, where they tell its name
    or factor: no more than what lies in them may be wrong in silence.
    """
    if seen.code not in CODES:
        return f"! exit code {seen.code}"
    if seen.code in (1, 4):
        return "refused" if seen.words.startswith("error:") else "! refused without a word"
    lost, wrong = 0, {}
    for path, (t_ns, values) in sound.items():
        have = seen.samples.get(path, (t_ns[:0], values[:0]))
        known = dict(zip(t_ns.tolist(), values.tolist(), strict=True))
        off = {t for t, x in zip(have[0].tolist(), have[1].tolist(), strict=True) if known.get(t) != x}
        lost += max(0, len(t_ns) - len(have[0]))
        if off:
            wrong[path] = off
    told = ", told" if seen.told else ""
    if not wrong:
        return "right" if not lost else f"part{told}" if told else "! part in silence"
    in_bytes = name in UNCHECKED and 0 < len(set().union(*wrong.values())) <= damage.touched
    in_name = len(wrong) == 1 and damage.touched
    if in_bytes or in_name:
        return "samples changed" + told
    return f"wrong{told}" if told else "! wrong in silence"
