"""Cases that have found something, and cases drawn: what a file was and what has happened to it, a line of JSON each."""

import base64
import json
from pathlib import Path
from typing import NamedTuple

from tests.fuzz.damage import damaged
from tests.fuzz.registry import Target

HERE = Path(__file__).parent / "corpus"


class Case(NamedTuple):
    """A seed with damages, or, where `seed` is empty, a content of its own."""

    seed: str
    damages: tuple = ()
    data: bytes = b""

    def content(self, target: Target) -> bytes:
        """The bytes of the file."""
        return damaged(target.seeds()[self.seed], self.damages) if self.seed else self.data

    def line(self) -> str:
        """As a line of `corpus/TARGET.txt`."""
        if self.seed:
            return json.dumps([self.seed, self.damages])
        try:
            return json.dumps({"text": self.data.decode("utf-8")})
        except UnicodeDecodeError:
            return json.dumps({"bytes": base64.b64encode(self.data).decode()})


def case_of(line: str) -> Case:
    """A case from its line; what stands behind it is a remark."""
    found, _ = json.JSONDecoder().raw_decode(line)
    if isinstance(found, dict):
        return Case("", (), base64.b64decode(found["bytes"]) if "bytes" in found else found["text"].encode("utf-8"))
    return Case(found[0], tuple(tuple(d) for d in found[1]))


def cases(target: str) -> list[Case]:
    """All cases of a target; none if nothing has been found."""
    path = HERE / f"{target}.txt"
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [case_of(line) for line in lines if line.strip() and not line.startswith("#")]
