"""Texts of the proposed files: table of runs, vehicle file without values, campaign."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from aqualog.campaign.propose_drives import Drive, tokens
from aqualog.campaign.propose_names import NameTable
from aqualog.core.vehicle import KEYS, POLYNOMIALS, SOURCES, Source

__all__ = ["NEEDED", "Fact", "blanks", "campaign_text", "labels_of", "relative", "runs_text", "vehicle_text"]

NEEDED = ("drivetrain", "mass", "l_f", "l_r", "wheels.r_e_f", "wheels.r_e_r")
"""Keys without which forces, loads or slip would be those of another car."""

_COLUMNS = (
    "log", "tyre", "wear", "tread_depth_mm", "pressure_front_bar", "pressure_rear_bar", "water_depth_mm",
    "load_front_kg", "load_rear_kg", "manoeuvre", "lane_start_s", "lane_end_s", "labels",
)  # fmt: skip
_NOT_TO_FILL = ("log", "lane_start_s", "lane_end_s", "labels")  # reported separately where they are needed
_IF_KNOWN = ("labels", "wear", "tread_depth_mm", "load_front_kg", "load_rear_kg")


def runs_text(drives: Sequence[Drive], table: NameTable, labels: Mapping[int, str], *, base: Path, folder: Path) -> str:
    """The table of runs, a line per drive; columns that names could not fill are there, but blank.

    `table` has a value per drive in each column, `labels` a labels file below the `folder` of the logs by index of the
    drive; `base` is the folder of the table.
    """
    columns = [c for c in _COLUMNS if c in table.columns or c not in _IF_KNOWN or (c == "labels" and labels)]
    columns += [c for c in table.columns if c not in columns]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for index, drive in enumerate(drives):
        row = {c: values[index] for c, values in table.columns.items()}
        row["log"] = ";".join(relative(f.path, base) for f in drive.files)
        if index in labels:
            row["labels"] = relative(folder / labels[index], base)
        writer.writerow([row.get(c, "") for c in columns])
    return text.getvalue()


def blanks(table: NameTable, count: int) -> dict[str, int]:
    """Number of blank cells of each key of the table of runs that has some, of `count` drives.

    Columns of words that no rule knows are left out: they are blank wherever a name is shorter.
    """
    keys = [c for c in _COLUMNS if c in table.columns or c not in (*_IF_KNOWN, *_NOT_TO_FILL)]
    keys += [c for c in table.columns if c not in keys and not c.startswith("x_part")]
    empty = {c: sum(not v for v in table.columns[c]) if c in table.columns else count for c in keys}
    return {c: n for c, n in empty.items() if n}


def relative(path: Path, base: Path) -> str:
    """A path as seen from a folder, with /; absolute on another drive letter.

    Links to folders are followed first: the parent of a link differs from the parent of its target folder. A name that
    a spreadsheet would take for a formula gets `./` before it.
    """
    real = Path(os.path.realpath(path.parent)) / path.name
    try:
        found = Path(os.path.relpath(real, os.path.realpath(base))).as_posix()
        return f"./{found}" if found[:1] in "=+-@\t\r" else found
    except ValueError:
        return real.as_posix()


def labels_of(drives: Sequence[Drive], labels: Sequence[str]) -> dict[int, str]:
    """Labels files of drives: those whose words are the drive's, with `label` or `labels` beside them at most."""
    by_words = {tuple(w for w in _words(name) if w not in ("label", "labels")): name for name in labels}
    found = {}
    for index, drive in enumerate(drives):
        name = next((by_words[w] for f in drive.files if (w := _words(f.name)) in by_words), None)
        if name is not None:
            found[index] = name
    return found


def _words(name: str) -> tuple[str, ...]:
    """Words of a path, also where points part them: `drive1.labels.csv`."""
    return tuple(w for t in tokens(name) for w in t.split(".") if w)


class Fact(NamedTuple):
    """What is known of a key: its value as TOML writes it, where it is from, and whether it needs no check.

    `source` is its word in the table `provenance`.
    """

    value: str
    origin: str
    is_sure: bool = False
    source: Source = "guess"


def vehicle_text(name: str, facts: Mapping[str, Fact] | None = None) -> str:
    """A vehicle file without values but those of `facts`: every key is there behind #, with unit, bounds and meaning.

    The defaults are not in it, so that none of them counts as a value given by the user. A fact that is not sure stays
    behind #, too.
    """
    known = facts or {}
    lines = [
        "# Remove the # before each key that you know and write its value. What stands behind a # is not used.",
        "# SET marks keys that slip, forces and loads need in order to be right. Missing keys get the value of a",
        "# mid-size car, and detectors that need them report that.",
        '# [provenance] at the end says where SET values come from. A key without a line there is "data_sheet";',
        "# without that table every value counts as exact.",
        f"name = {_quoted(name)}",
        _key_line("drivetrain", known.get("drivetrain"), '""', 'SET  "rwd", "fwd" or "awd"'),
    ]
    words = ", ".join(f'"{s}"' for s in SOURCES)
    section = ""
    for key in KEYS.values():
        if key.section != section:
            section = key.section
            lines += ["", f"[{section}]"]
        mark = "SET  " if key.path in NEEDED else ""
        about = f"{mark}[{key.unit}] {key.meaning}; {key.low:g} ... {key.high:g}"
        lines.append(_key_line(key.name, known.get(key.path), "", about))
    for section, meaning in POLYNOMIALS.items():
        lines += ["", f"# [{section}]  # {meaning}; `aqualog calibrate` writes it"]
    lines += ["", "[provenance]"]
    for path in (p for p in KEYS if p in NEEDED or p in known):
        # of a value that waits for a check, too: nobody has to think of it when the # goes
        lines.append(f'{path} = "{known[path].source}"' if path in known else f'# {path} = ""')
        lines[-1] = f"{lines[-1]:<30}# {words}"
    return "\n".join(lines) + "\n"


def _key_line(name: str, fact: Fact | None, blank: str, about: str) -> str:
    if fact is None:
        return f"{f'# {name} = {blank}'.rstrip():<30}# {about}"
    mark = "" if fact.is_sure else "# "
    about = about.removeprefix("SET  ") if fact.is_sure else about
    return f"{f'{mark}{name} = {fact.value}':<30}# {about}; {fact.origin}"


def campaign_text(name: str, vehicle: str, signals: str | None, runs: str) -> str:
    """The campaign file; paths are relative to it."""
    lines = [f"name = {_quoted(name)}", f"vehicle = {_quoted(vehicle)}"]
    if signals is not None:
        lines.append(f"signals = {_quoted(signals)}")
    return "\n".join([*lines, f"runs = {_quoted(runs)}"]) + "\n"


def _quoted(text: str) -> str:
    printable = "".join(c for c in text if c.isprintable())
    return json.dumps(printable, ensure_ascii=False)  # a JSON string is a TOML basic string
