"""The truth of a blind case, sealed until there is a verdict.

A case is a folder: `drive.parquet` or `drive.mf4`, perhaps `held.*` (another drive with the same effects), `vehicle.toml`,
`truth.bin`. The seal is no secret, only a guard against seeing the truth by chance: compressed, and xor-ed with a stream
that begins with the hash of the truth, which is also its check.
"""

from __future__ import annotations

import hashlib
import json
import time
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.blind.multibody.seal import SIZE, judged_truth

__all__ = ["KINDS", "LEDGER", "SealError", "digest", "open_truth", "reopened", "seal"]

KINDS = ("null", "known", "unknown", "compound")
KEYS = ("world", "seed", "kind", "drive_type", "noise", "effects", "unknown")
EFFECT_KEYS = ("effect", "where", "parameters", "detectability")
UNKNOWN_KEYS = ("mechanism", "depends_on", "kind", "held_back")
LEDGER = "ledger.jsonl"
_HEAD = b"aqtruth1"


class SealError(Exception):
    """A truth that is not complete, not whole, or not to be opened yet."""


def seal(folder: Path, truth: Mapping[str, Any]) -> Path:
    """Write `truth.bin` of a case.

    `truth`: `world`, `seed`, `kind` (`KINDS`), `drive_type`, `noise`, `effects` (a list of tables with `effect`, `where`,
    `parameters` as name -> value, `detectability` or None), and `unknown` (a table with `mechanism`, `depends_on`, `kind`,
    `held_back`, or None). More keys are kept: `clean` names the folder beside it with the same drive without the effects.
    """
    _check(truth)
    plain = json.dumps(dict(truth), sort_keys=True).encode()
    key = hashlib.sha256(plain).digest()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "truth.bin"
    path.write_bytes(_HEAD + key + _xored(zlib.compress(plain, 9), key))
    return path


def open_truth(folder: Path, ledger: Path | None = None) -> dict[str, Any]:
    """Return the truth of a case that has its `verdict.json`; a line in the ledger says which verdict that was.

    `ledger`: default `ledger.jsonl` beside the folder.
    """
    verdict, sealed = folder / "verdict.json", folder / "truth.bin"
    if not verdict.is_file():
        raise SealError(f"{folder}: no verdict.json: the truth stays sealed until there is a verdict")
    raw = sealed.read_bytes()
    if not raw.startswith(_HEAD) and len(raw) == SIZE:
        _note(folder, ledger)
        return judged_truth(raw, folder)
    key, body = raw[len(_HEAD) : len(_HEAD) + 32], raw[len(_HEAD) + 32 :]
    try:
        plain = zlib.decompress(_xored(body, key))
    except zlib.error:
        plain = b""
    if not raw.startswith(_HEAD) or hashlib.sha256(plain).digest() != key:
        raise SealError(f"{sealed}: not a sealed truth, or changed since: make the case again")
    _note(folder, ledger)
    return dict(json.loads(plain))


def _note(folder: Path, ledger: Path | None) -> None:
    seals = {"truth": digest(folder / "truth.bin"), "verdict": digest(folder / "verdict.json")}
    with (ledger or folder.parent / LEDGER).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"case": folder.name, **seals, "time": round(time.time())}) + "\n")


def reopened(ledger: Path) -> tuple[str, ...]:
    """Cases whose verdict changed after their truth had been opened."""
    seen: dict[tuple[str, str], set[str]] = {}
    for line in ledger.read_text(encoding="utf-8").splitlines() if ledger.is_file() else ():
        row = json.loads(line)
        seen.setdefault((row["case"], row["truth"]), set()).add(row["verdict"])
    return tuple(sorted(case for (case, _), verdicts in seen.items() if len(verdicts) > 1))


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _xored(data: bytes, key: bytes) -> bytes:
    blocks = (hashlib.sha256(key + i.to_bytes(8, "big")).digest() for i in range(len(data) // 32 + 1))
    return bytes(a ^ b for a, b in zip(data, b"".join(blocks), strict=False))


def _check(truth: Mapping[str, Any]) -> None:
    _has(truth, KEYS, "truth")
    if truth["kind"] not in KINDS:
        raise SealError(f"truth: kind {truth['kind']!r}: expected one of {', '.join(KINDS)}")
    for row in truth["effects"]:
        _has(row, EFFECT_KEYS, "effect")
    if truth["unknown"] is not None:
        _has(truth["unknown"], UNKNOWN_KEYS, "unknown")
    if (truth["kind"] == "unknown") != (truth["unknown"] is not None):
        raise SealError("truth: `unknown` is given for the kind `unknown` and for no other")


def _has(table: Mapping[str, Any], keys: tuple[str, ...], what: str) -> None:
    if missing := [k for k in keys if k not in table]:
        raise SealError(f"{what}: without {', '.join(missing)}: give null where there is no value")
