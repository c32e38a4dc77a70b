"""Cases that have found something: `[maker, damages]` in JSON, one a line of `corpus/TARGET.txt`."""

import json
from pathlib import Path

HERE = Path(__file__).parent / "corpus"


def cases(target: str) -> list[tuple[str, tuple]]:
    """Makers and damages."""
    lines = (HERE / f"{target}.txt").read_text(encoding="utf-8").splitlines()
    found = [json.loads(line.split("#")[0]) for line in lines if line.split("#")[0].strip()]
    return [(name, tuple(tuple(d) for d in damages)) for name, damages in found]
