"""One case in a process of its own: `python -m tests.blind.judging.work CASE OUT` writes `OUT/verdict.json`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

__all__ = ["log_of", "main"]

_LOGS = (".parquet", ".mf4", ".mcap", ".csv")


def log_of(case: Path, stem: str) -> Path | None:
    """Return `drive.*` or `held.*` of a case."""
    return next((p for s in _LOGS if (p := case / f"{stem}{s}").is_file()), None)


def main(arguments: Sequence[str]) -> int:
    """Diagnose one case through the Python face."""
    import aqualog as aq

    case, out = Path(arguments[0]), Path(arguments[1])
    drive, held = log_of(case, "drive"), log_of(case, "held")
    if drive is None:
        raise FileNotFoundError(f"{case}: no drive.* ({', '.join(_LOGS)})")
    found = aq.diagnose(drive, case / "vehicle.toml", holdout=() if held is None else held, views=False)
    out.mkdir(parents=True, exist_ok=True)
    unfinished = out / "verdict.json.tmp"
    unfinished.write_text(found.to_json() + "\n", encoding="utf-8")
    unfinished.rename(out / "verdict.json")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
