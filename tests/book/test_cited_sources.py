"""Every citation leads to an entry of `docs/sources.toml`, and every entry can be found."""

import ast
import io
import re
import tokenize
from functools import cache

import pytest

from aqualog.book.sources import KINDS, citations, faults, linked, names_without_key, read, register, sources_page
from aqualog.book.topics import DOCS
from aqualog.thesis.claims import claims
from tests.conftest import ROOT

PACKAGE = ROOT / "aqualog"
HOME = DOCS / "sources.md"
FREE = frozenset({"thesis", "dissertation"})
"""Names that need no key: the work that all of aqualog is about."""


def parts():
    """Packages and modules at the root."""
    return sorted(p.name for p in PACKAGE.iterdir() if p.suffix == ".py" or (p.is_dir() and any(p.rglob("*.py"))))


def modules(part):
    path = PACKAGE / part
    return [path] if path.is_file() else sorted(path.rglob("*.py"))


def documents():
    return [ROOT / "README.md", *sorted(PACKAGE.rglob("*.md"))]


def docstrings(source):
    """Line and text of each docstring."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node, clean=False)
            if text:
                yield node.body[0].lineno, text


def words(source):
    """Line and text of docstrings, messages, tables and comments."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


@cache
def cited(path):
    """Line and key of each citation of a module."""
    text = [(line, c) for line, text in words(path.read_text()) for c in citations(text)]
    return [(line + c.line - 1, c.key) for line, c in text]


def lost(path, line, text):
    return [
        f"{path.relative_to(ROOT)}:{line + c.line - 1}: {c.key}" for c in citations(text) if c.key not in register()
    ]


def unnamed(path, line, text):
    found = [c for c in names_without_key(text) if c.key not in FREE]
    return [f"{path.relative_to(ROOT)}:{line + c.line - 1}: {c.key} without a key in brackets" for c in found]


@pytest.mark.parametrize("part", parts())
def test_citations_of_code_lead_to_an_entry(part):
    known = register()
    found = [
        f"{p.relative_to(ROOT)}:{line}: {key}" for p in modules(part) for line, key in cited(p) if key not in known
    ]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("part", parts())
def test_sources_named_in_docstrings_carry_a_key(part):
    found = [x for path in modules(part) for line, s in docstrings(path.read_text()) for x in unnamed(path, line, s)]
    assert not found, "\n" + "\n".join(found)


def test_citations_of_pages_and_templates_lead_to_an_entry():
    paths = [*documents(), *(p for s in ("*.j2", "*.js") for p in PACKAGE.rglob(s) if "plotly" not in p.name)]
    found = [x for path in paths for x in lost(path, 1, path.read_text(encoding="utf-8"))]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("path", documents(), ids=lambda p: str(p.relative_to(ROOT)))
def test_sources_named_in_documents_carry_a_key(path):
    if path != HOME:
        found = unnamed(path, 1, path.read_text(encoding="utf-8"))
        assert not found, "\n" + "\n".join(found)


def test_tables_of_keys_name_their_sources_by_key():
    from aqualog.core.vehicle import KEYS
    from aqualog.model.effects import EFFECTS
    from aqualog.model.scenario import SURFACES
    from aqualog.model.tyre import TYRE_KEYS

    tables = (KEYS, TYRE_KEYS, EFFECTS, SURFACES)
    rows = [row for table in tables for row in (table.values() if isinstance(table, dict) else table)]
    assert len(rows) > 70
    found = {row.source for row in rows if any(c.key not in FREE for c in names_without_key(row.source))}
    assert not found


def test_each_equation_of_physics_names_its_source():
    for path in sorted((PACKAGE / "physics").glob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                text = ast.get_docstring(node) or ""
                assert citations(text) or "Source: " in text, f"{path.name}: {node.name}"


def test_the_register_is_whole():
    known = register()
    assert not faults(known)
    assert list(known.references) == list(range(1, 41))
    assert list(known.equations) == [f"E{n}" for n in range(1, 25)]
    assert list(known.claims) == list(claims())
    assert set(KINDS) == {s.kind for s in known.sources.values()}


def numbers(text):
    return set(re.findall(r"\d+(?:\.\d+)?", text))


@pytest.mark.parametrize("claim", claims().values(), ids=lambda c: c.id)
def test_claims_say_what_the_reproduction_checks(claim):
    assert numbers(register().claims[claim.id]) <= numbers(f"{claim.where} {claim.statement}")


def test_every_source_is_cited_or_a_candidate():
    keys = {c.key for path in documents() if path != HOME for c in citations(path.read_text(encoding="utf-8"))}
    keys |= {key for part in parts() for path in modules(part) for _, key in cited(path)}
    known = register()
    likely = {key for r in known.references.values() for key in (r.source, r.likely)}
    assert set(known.sources) - keys - likely <= BACKGROUND


BACKGROUND = frozenset({"fichtinger2021", "fichtinger2022", "fichtinger2022b", "fichtinger2023", "iso8601_2019"})
"""The papers of the thesis, and the standard behind dates: no text needs to cite them."""


def test_the_page_is_made_from_the_register():
    assert HOME.read_text(encoding="utf-8") == sources_page(), "run python -m aqualog.book"


def test_every_entry_has_a_heading():
    found = re.findall(r"^### (\S+)$", sources_page(), re.M)
    known = register()
    keys = [*known.sources, *(f"[{n}]" for n in known.references), *known.equations, *known.claims]
    assert sorted(found) == sorted(keys)


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("[gustafsson1997] and [horne1963, horne1986]", ["gustafsson1997", "horne1963", "horne1986"]),
        ("thesis [22]", ["22"]),
        ("[14], [17] and [39][40]", ["14", "17", "39", "40"]),
        ("[14]-[16]", ["14", "15", "16"]),
        ("E5, audit E 12 (E8)", ["E5", "E12", "E8"]),
        ("(C66, C67)", ["C66", "C67"]),
        ("C30-C32 or E1 to E3", ["C30", "C31", "C32", "E1", "E2", "E3"]),
        ("C53/C54", ["C53", "C54"]),
    ],
)
def test_forms_of_citations(text, keys):
    assert [c.key for c in citations(text)] == keys


@pytest.mark.parametrize(
    "text",
    [
        "`C57` and ``E5``", "```\nx [14] E5\n```", "x[14], f(x)[2], a[0][1]", "[m/s] [-] [s^2/m]", "BMW E90", "ASTM E524",
        "1E5 and 0xE5", "C_0, C1_x", "[text](page.md)", "https://x.org/E5", "1/C12.5", "<!-- E5 -->", "#C12C44", "E5=1",
    ],
)  # fmt: skip
def test_what_is_no_citation(text):
    assert not citations(text)


def test_a_citation_says_its_line():
    assert [(c.key, c.line) for c in citations("a\n```\nE1\n```\nb E5\n[14]")] == [("E5", 5), ("14", 6)]


def test_names_need_their_key():
    assert [(c.key, c.line) for c in names_without_key("x\nby Gengenbach")] == [("Gengenbach", 2)]
    assert not names_without_key("by Gengenbach [gengenbach1968]")
    assert not names_without_key("Gustafsson's filter [gustafsson2000]")
    assert not names_without_key("Gustafsson, reference [15]")
    assert not names_without_key("# By Gengenbach\n\n`Gengenbach`, [Gengenbach](a.md)")


def test_links():
    assert linked("E5, C1-C3.") == "[E5](sources.md#e5), [C1](sources.md#c1) to [C3](sources.md#c3)."
    assert linked("[gustafsson1997] [15]", "../sources.md") == (
        r"[\[gustafsson1997\]](../sources.md#gustafsson1997) [\[15\]](../sources.md#15)"
    )
    untouched = "# On E5\n\n`E5` [E5](a.md) C119 [nobody1900] [41]\n"
    assert linked(untouched) == untouched


GOOD = """
[sources.one1999]
kind = "paper"
authors = ["A. One"]
year = 1999
title = "One"
published = "There"
used = "That."
checked = "So."
doi = "10.1000/one(1)-2"
[references.1]
says = "What."
known = true
source = "one1999"
[equations]
E1 = "Short."
[claims]
C1 = "Short."
"""


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"One"', '""', "one1999: no title"),
        ("10.1000/one(1)-2", "doi.org/10.1000/one", "malformed DOI"),
        ("10.1000/one(1)-2", "10.1000/one.", "malformed DOI"),
        ("one1999]", "one]", "ends in a year"),
        ("year = 1999", "year = 2000", "not of 2000"),
        ('"paper"', '"song"', "unknown kind"),
        ('source = "one1999"', 'source = "two1999"', "no source two1999"),
        ("known = true", "known = false", "without being known"),
        ('source = "one1999"', "", "without a source"),
        ('E1 = "Short."', f'E1 = "{"word " * 26}"', "E1: 26 words"),
        ('C1 = "Short."', 'C1 = ""', "C1: 0 words"),
    ],
)
def test_faults_of_a_register(old, new, fault):
    assert not faults(read(GOOD))
    assert any(fault in f for f in faults(read(GOOD.replace(old, new))))
