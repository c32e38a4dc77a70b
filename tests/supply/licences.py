"""Licences of everything that an installation brings along: `python -m tests.supply.licences` writes the list anew."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

LIST = Path(__file__).resolve().parents[2] / "aqualog" / "LICENCES.md"
BEGIN = "| package | licence | with |\n|---|---|---|\n"
EXTRAS = ("", "images", "cluster")
# Words of licences under which a program under MIT may use, unchanged and as a package of its own, what bears them.
FREE = re.compile(
    r"\b(MIT|MIT-CMU|0BSD|BSD|BSD-[23]-Clause|ISC|Apache|PSF|Python Software Foundation|MPL|Mozilla|Zlib|CC0|Unlicense|"
    r"LGPL|LGPLv3\+|LGPL-3\.0-only|Lesser General Public|any-OSI|HPND)\b",
    re.IGNORECASE,
)
BINDING = re.compile(r"(?<!Lesser )\b(A?GPL|(Affero )?General Public License|proprietary|commercial)\b", re.IGNORECASE)


def licence(found: Distribution) -> str:
    """What a package says of its licence, in a line."""
    told = found.metadata
    kinds = [c.split(" :: ")[-1] for c in told.get_all("Classifier") or [] if c.startswith("License ::")]
    text = told.get("License-Expression") or "; ".join(kinds) or (told.get("License") or "").strip().split("\n")[0]
    return text[:80]


def needed(name: str, extra: str = "", seen: set[str] | None = None) -> Iterator[Distribution]:
    """A package's requirements here, and theirs; what is not installed (another system's, another extra's) is left out."""
    seen = set() if seen is None else seen
    for text in distribution(name).requires or []:
        wanted = Requirement(text)
        key = plain(wanted.name)
        if key in seen or not (wanted.marker is None or wanted.marker.evaluate({"extra": extra})):
            continue
        seen.add(key)
        try:
            found = distribution(wanted.name)
        except PackageNotFoundError:
            continue
        yield found
        yield from needed(wanted.name, seen=seen)


def plain(name: str) -> str:
    """A package's name as it is listed."""
    return re.sub(r"[-_.]+", "-", name).lower()


def asked() -> list[str]:
    """Names of what aqualog itself requires, on any system."""
    wanted = [Requirement(text) for text in distribution("aqualog").requires or []]
    of_users = [
        w for w in wanted
        if w.name != "aqualog" and (w.marker is None or any(w.marker.evaluate({"extra": e}) for e in EXTRAS))
    ]  # fmt: skip
    return sorted({plain(w.name) for w in of_users})


def packages() -> dict[str, tuple[str, str]]:
    """Licence and extra ("" for all installations) by name."""
    out: dict[str, tuple[str, str]] = {}
    for extra in EXTRAS:
        for found in needed("aqualog", extra):
            out.setdefault(plain(found.metadata["Name"]), (licence(found), extra))
    return out


def table() -> str:
    """The rows below BEGIN."""
    return "".join(f"| {n} | {told} | {extra} |\n" for n, (told, extra) in sorted(packages().items()))


if __name__ == "__main__":
    head, _ = LIST.read_text(encoding="utf-8").split(BEGIN)
    LIST.write_text(head + BEGIN + table(), encoding="utf-8")
