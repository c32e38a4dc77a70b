"""Citations in text, what they name, and the page of all sources.

`docs/sources.toml` is the only home of sources. A text cites a work by its key, `[gustafsson1997]`; a reference of the
thesis by its number, `[14]`; a finding of the audit of its equations as `E5`; one of its claims as `C57`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from aqualog.book.topics import DOCS

__all__ = [
    "KINDS", "Citation", "Reference", "Register", "Source", "citations", "faults", "linked", "names_without_key",
    "read", "register", "sources_page",
]  # fmt: skip

KINDS = {
    "paper": "Papers and books",
    "book": "Papers and books",
    "report": "Papers and books",
    "thesis": "Papers and books",
    "patent": "Papers and books",
    "standard": "Standards, formats and data",
    "format": "Standards, formats and data",
    "data": "Standards, formats and data",
    "software": "Standards, formats and data",
}
"""Kinds of source, and the section of the page that each stands in."""

_KEY = r"[a-z][a-z0-9_]*(?:1[89]|20)\d\d[a-z]?"
_DOI = re.compile(r"10\.\d{4,9}/[^\s\"<>]+[^\s\"<>.,;]")
_CITED = re.compile(
    rf"(?<![\w)\]])\[(?P<keys>{_KEY}(?:, {_KEY})*)\](?!\()"
    r"|(?<![\w)\]])(?P<numbers>(?:\[\d{1,2}\])+)(?:(?:-|–|\.\.\.| to )\[(?P<number_to>\d{1,2})\])?(?![\w(])"
    r"|(?<![\w.$#\"'=^&{\-–])(?:(?<!/)|(?<=\d/))(?<!BMW )(?P<letter>E(?! ?\d{3})|C)"
    r"(?:(?P<first>\d{1,3})| (?P<apart>\d{1,3}))(?![\w^=(\[]|\.\d)"
    r"(?:(?:-|–| to )(?P=letter) ?(?P<to>\d{1,3})(?!\w))?"
)
_CODE = re.compile(r"^(\s*)(```+|~~~+).*?^\1\2\s*$|``.*?``|`[^`\n]*`|<!--.*?-->|https?://\S+", re.S | re.M)
_LINK = re.compile(r"!?\[[^\]]*\]\([^)]*\)|^#.*$", re.M)


@dataclass(frozen=True, slots=True)
class Source:
    """A work that code or a page leans on.

    `used` is what aqualog takes from it, `checked` how its title, numbers and DOI were looked at, `names` words by
    which a text can name it. `doi` and `url` are empty where missing or not confirmed.
    """

    key: str
    kind: str
    authors: tuple[str, ...]
    year: int
    title: str
    published: str
    used: str
    checked: str
    doi: str = ""
    url: str = ""
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reference:
    """A reference of the thesis, whose list is not at hand.

    `says` is what the thesis says of it. `source` is the key of the work where it is known, `likely` that of one that
    fits; both may be empty.
    """

    number: int
    says: str
    known: bool
    source: str = ""
    likely: str = ""


@dataclass(frozen=True, slots=True)
class Register:
    """All sources by key, references of the thesis by number, audit findings and claims by their names."""

    sources: dict[str, Source]
    references: dict[int, Reference]
    equations: dict[str, str]
    claims: dict[str, str]

    def __contains__(self, key: str) -> bool:
        """Whether a citation leads somewhere: `gustafsson1997`, `14`, `E5`, `C57`."""
        number = int(key) if key.isdigit() else -1
        return key in self.sources or number in self.references or key in self.equations or key in self.claims


@dataclass(frozen=True, slots=True)
class Citation:
    """One citation: its key as in the register, and the line of the text that it stands in, from 1."""

    key: str
    line: int


def read(text: str) -> Register:
    """The register of a TOML text."""
    raw = tomllib.loads(text)
    return Register(
        {key: _source(key, table) for key, table in raw["sources"].items()},
        {int(n): Reference(int(n), **table) for n, table in raw["references"].items()},
        dict(raw["equations"]),
        dict(raw["claims"]),
    )


@cache
def register() -> Register:
    """The register of aqualog."""
    return read((DOCS / "sources.toml").read_text(encoding="utf-8"))


def _source(key: str, table: dict[str, Any]) -> Source:
    lists: dict[str, Any] = {name: tuple(table[name]) for name in ("authors", "names") if name in table}
    return Source(key, **{**table, **lists})


def citations(text: str) -> list[Citation]:
    """Citations in a text, in its order; what stands in code is not read, and a range counts with all its members."""
    prose = _blanked(text, _CODE)
    return [Citation(key, prose.count("\n", 0, m.start()) + 1) for m in _CITED.finditer(prose) for key in _keys(m)]


def _keys(found: re.Match[str]) -> Iterator[str]:
    if found["keys"]:
        yield from found["keys"].split(", ")
    elif found["numbers"]:
        numbers = [int(n) for n in re.findall(r"\d+", found["numbers"])]
        yield from (str(n) for n in numbers)
        if found["number_to"]:
            yield from (str(n) for n in range(numbers[-1] + 1, int(found["number_to"]) + 1))
    else:
        first = int(found["first"] or found["apart"])
        last = int(found["to"]) if found["to"] else first
        yield from (f"{found['letter']}{n}" for n in range(first, max(first, last) + 1))


def _blanked(text: str, what: re.Pattern[str]) -> str:
    """The text with blanks in place of matches; lines and positions stay."""
    return what.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)


def names_without_key(text: str) -> list[Citation]:
    """Names of sources in a text that cites no work of that name; `key` is the name. Headings and links are free."""
    prose, cited = _blanked(_blanked(text, _CODE), _LINK), {c.key for c in citations(text)}
    missing = []
    for name, keys in _names().items():
        if name in prose and not cited & keys:
            found = re.search(rf"(?<!\w){re.escape(name)}(?!\w)", prose)
            missing += [Citation(name, prose.count("\n", 0, found.start()) + 1)] if found else []
    return missing


@cache
def _names() -> dict[str, set[str]]:
    """Names, and the sources that each can mean; a work that a cited reference of the thesis is counts too."""
    known = register()
    names: dict[str, set[str]] = {}
    for source in known.sources.values():
        numbers = {str(r.number) for r in known.references.values() if r.known and r.source == source.key}
        people = {a.split()[-1] for a in source.authors}
        for name in source.names:
            alike = {s.key for s in known.sources.values() if name in people and name in " ".join(s.authors)}
            names.setdefault(name, set()).update({source.key}, numbers, alike)
    return names


def linked(text: str, to: str = "sources.md") -> str:
    """A Markdown text whose citations are links to the page of sources; code, links, headings and the unknown stay."""
    free = _blanked(_blanked(text, _CODE), _LINK)
    parts, end = [], 0
    for found in _CITED.finditer(free):
        parts += [text[end : found.start()], _link(found, to)]
        end = found.end()
    return "".join([*parts, text[end:]])


def _link(found: re.Match[str], to: str) -> str:
    def one(shown: str, key: str) -> str:
        return f"[{shown}]({to}#{key.lower()})" if key in register() else shown.replace("\\", "")

    def number(n: str) -> str:
        return one(rf"\[{n}\]", n)

    if found["keys"]:
        return ", ".join(one(rf"\[{key}\]", key) for key in found["keys"].split(", "))
    if found["numbers"]:
        shown = "".join(number(n) for n in re.findall(r"\d+", found["numbers"]))
        return shown + (f" to {number(found['number_to'])}" if found["number_to"] else "")
    first = f"{found['letter']}{found['first'] or found['apart']}"
    last = f"{found['letter']}{found['to']}" if found["to"] else ""
    return one(first, first) + (f" to {one(last, last)}" if last else "")


def faults(known: Register) -> list[str]:
    """What is wrong with a register, in words: no title, a malformed DOI or key, a reference to an unknown source."""
    found = []
    for key, s in known.sources.items():
        found += [f"{key}: no {f}" for f in ("authors", "title", "published", "used", "checked") if not getattr(s, f)]
        found += [f"{key}: a key is lower case and ends in a year"] if not re.fullmatch(_KEY, key) else []
        found += [f"{key}: not of {s.year}"] if str(s.year) not in key else []
        found += [f"{key}: unknown kind {s.kind}"] if s.kind not in KINDS else []
        found += [f"{key}: malformed DOI {s.doi}"] if s.doi and not _DOI.fullmatch(s.doi) else []
    dois = [s.doi.lower() for s in known.sources.values() if s.doi]
    found += [f"{doi}: the DOI of two sources" for doi in sorted({d for d in dois if dois.count(d) > 1})]
    for n, r in known.references.items():
        found += [f"[{n}]: no source {key}" for key in (r.source, r.likely) if key and key not in known.sources]
        found += [f"[{n}]: known, but without a source"] if r.known and not r.source else []
        found += [f"[{n}]: {r.source} without being known"] if r.source and not r.known else []
    lines = {**known.equations, **known.claims, **{f"[{n}]": r.says for n, r in known.references.items()}}
    found += [f"{key}: {len(line.split())} words" for key, line in lines.items() if not 0 < len(line.split()) <= 25]
    return found


def sources_page() -> str:
    """The page of sources, Markdown: a heading per entry, which links lead to."""
    known = register()
    parts = [_HEAD]
    for section in dict.fromkeys(KINDS.values()):
        entries = [s for s in known.sources.values() if KINDS[s.kind] == section]
        parts += _section(section, {s.key: _of_source(s) for s in sorted(entries, key=lambda s: s.key)})
    by_number = {f"[{n}]": _of_reference(known, r) for n, r in sorted(known.references.items())}
    parts += _section("References of the thesis", by_number, _ON_REFERENCES)
    parts += _section("Audit of the thesis' equations", known.equations, _ON_EQUATIONS)
    places = tomllib.loads((DOCS.parent / "thesis" / "claims.toml").read_text(encoding="utf-8"))
    claims = {key: _of_claim(line, places[key]["where"]) for key, line in known.claims.items()}
    return "\n\n".join([*parts, *_section("Claims of the thesis", claims, _ON_CLAIMS)]) + "\n"


_HEAD = """# Sources

Every citation in aqualog's code and pages leads to an entry of this page.

A work is cited by its key in square brackets. A reference of the thesis is cited by its number, such as [15]. A finding
of the audit of its equations reads E5, and one of its claims C57. A DOI stands here only where it was confirmed; each
entry says how it was checked. K marks general knowledge that was not looked up."""
_ON_REFERENCES = (
    "The list of references was not part of the text that aqualog was built from. Each entry reports what the thesis "
    "says of the work. Most works cannot be identified; some have a likely candidate."
)
_ON_EQUATIONS = (
    "What an audit of the printed equations found. A docstring names each departure from print by its number."
)
_ON_CLAIMS = (
    "Statements of the thesis that can be checked, each with its place. `aqualog reproduce` checks them one by one."
)


def _section(title: str, entries: dict[str, str], words: str = "") -> list[str]:
    return [f"## {title}", *([words] if words else []), *(f"### {key}\n\n{text}" for key, text in entries.items())]


def _of_source(s: Source) -> str:
    address = f"[{s.doi}](https://doi.org/{s.doi})" if s.doi else ""
    url = f"<{s.url}>" if s.url and s.url != s.published else ""
    published = f"<{s.published}>" if s.published.startswith("http") else s.published
    rows: list[tuple[str, str]] = [
        ("Authors", ", ".join(s.authors)), ("Year", str(s.year)), ("Title", f"*{s.title}*"), ("Published", published),
        ("DOI", address), ("Address", url), ("Used", s.used), ("Checked", s.checked),
    ]  # fmt: skip
    return "\n".join(f"- {name}: {value}" for name, value in rows if value)


def _of_reference(known: Register, r: Reference) -> str:
    of: Callable[[str], str] = lambda key: f"[{key}](#{key}), {known.sources[key].title}"  # noqa: E731
    if r.known:
        what = f"Known: {of(r.source)}."
    elif r.likely:
        what = f"Not identified; likely {of(r.likely)}."
    else:
        what = "Not identified."
    return f"{r.says}\n\n{what}"


def _of_claim(line: str, where: str) -> str:
    place = f"Section {where}" if where[0].isdigit() else where
    return line if place in line else f"{line} ({place})"
