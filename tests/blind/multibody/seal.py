"""Sealed truths: nobody reads what is hidden before the verdict stands."""

from __future__ import annotations

import hashlib
import json
import zlib
from pathlib import Path
from typing import Any

__all__ = ["LEDGER", "SealError", "judged_truth", "open_truth", "seal_truth"]

LEDGER = "ledger.jsonl"
TRUTH = "truth.bin"
SIZE = 4096  # [bytes] of every sealed file, so that its length says nothing


class SealError(Exception):
    """A truth may not be opened, or is no truth."""


def seal_truth(folder: Path, truth: dict[str, object]) -> None:
    """Write the truth of a case into its folder, whose name ends in the number of the case."""
    packed = zlib.compress(json.dumps(truth, sort_keys=True).encode(), 9)
    if len(packed) + 4 > SIZE:
        raise SealError(f"{len(packed)} bytes of truth do not fit into {SIZE}")
    whole = len(packed).to_bytes(4, "big") + packed
    (folder / TRUTH).write_bytes(_mixed(whole.ljust(SIZE, b"\0"), _number(folder)))


def open_truth(folder: Path, verdict_path: Path) -> dict[str, object]:
    """What is hidden in a case whose verdict stands beside it; the ledger beside the folder gets both hashes.

    Raises
    ------
    SealError
        Without a verdict: a JSON document with `verdict`, in the folder of the case. Or if the truth was opened before
        for another verdict.
    """
    folder, verdict_path = folder.resolve(), verdict_path.resolve()
    if verdict_path.parent != folder or not verdict_path.is_file():
        raise SealError(f"{verdict_path} is no verdict in {folder}: diagnose first, and write the JSON there")
    said = verdict_path.read_bytes()
    try:
        verdict = json.loads(said)
    except ValueError as error:
        raise SealError(f"{verdict_path} is no JSON: {error}") from None
    if not isinstance(verdict, dict) or not isinstance(verdict.get("verdict"), str):
        raise SealError(f'{verdict_path} has no "verdict"')
    sealed = (folder / TRUTH).read_bytes()
    line = {
        "case": folder.name, "verdict_sha256": hashlib.sha256(said).hexdigest(),
        "truth_sha256": hashlib.sha256(sealed).hexdigest(),
    }  # fmt: skip
    ledger = folder.parent / LEDGER
    lines = ledger.read_text(encoding="utf-8").splitlines() if ledger.is_file() else []
    before = [x for x in map(json.loads, lines) if x["case"] == line["case"]]
    if any(x != line for x in before):
        raise SealError(f"{folder.name} was opened before for another verdict, or its truth has changed")
    if not before:
        with ledger.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    return _opened(sealed, folder)


def judged_truth(sealed: bytes, folder: Path) -> dict[str, object]:
    """The truth in the words of `tests.blind.sealed`; whoever calls has checked that a verdict stands."""
    truth = _opened(sealed, folder)
    hidden = truth["hidden"]
    form = next((h for h in hidden if not h["known"]), None)
    unknown = None if form is None else {
        "mechanism": form["channel"], "depends_on": form["depends_on"], "kind": form["effect"],
        "held_back": form["held_back"], "accepts": form["accepts"], "parameters": form["values"],
        "points": form.get("points"),
    }  # fmt: skip
    effects = [
        {"effect": h["effect"], "where": h["where"], "parameters": h["values"], "detectability": h.get("z")}
        for h in hidden if h["known"]
    ]  # fmt: skip
    kind = "unknown" if form else ("null", "known", "compound")[min(len(effects), 2)]
    return {
        "world": "multibody", "seed": truth["seed"], "kind": kind, "drive_type": truth["programme"],
        "noise": truth["noise"], "effects": effects, "unknown": unknown,
    }  # fmt: skip


def _opened(sealed: bytes, folder: Path) -> dict[str, Any]:
    whole = _mixed(sealed, _number(folder))
    try:
        return dict(json.loads(zlib.decompress(whole[4 : 4 + int.from_bytes(whole[:4], "big")])))
    except (ValueError, zlib.error):
        raise SealError(f"{folder / TRUTH} does not belong to case {_number(folder)}") from None


def _number(folder: Path) -> int:
    digits = folder.name.rpartition("_")[2]
    if not digits.isdigit():
        raise SealError(f"{folder.name} does not end in the number of a case, as case_0007 does")
    return int(digits)


def _mixed(data: bytes, number: int) -> bytes:
    blocks = (hashlib.sha256(f"multibody {number} {k}".encode()).digest() for k in range(-(-len(data) // 32)))
    return bytes(a ^ b for a, b in zip(data, b"".join(blocks), strict=False))
