"""Documents, messages and docstrings are plain English: no banned phrase, one spelling of a unit, short sentences."""

import pytest

from tests.book.words import CHECKS, Fault, faults, length, of_document, of_javascript, of_python, of_toml, sentences
from tests.conftest import ROOT

PACKAGE = ROOT / "aqualog"
AWAITED: frozenset[str] = frozenset()
"""Packages whose words are not mended yet: each is taken off when it is, and the list ends empty."""


def packages():
    """What is checked: each package, each module at the root, each document."""
    parts = {p.relative_to(PACKAGE).parts[0] for s in CHECKS for p in PACKAGE.rglob(f"*{s}")} - {"docs"}
    documents = [str(p.relative_to(ROOT)) for p in sorted((PACKAGE / "docs").rglob("*.md"))]
    return ["README.md", *documents, *sorted(p for p in parts if not p.endswith(".md"))]


def files(name):
    if name.endswith(".md"):
        return [ROOT / name]
    path = PACKAGE / name
    return [path] if path.is_file() else sorted(p for s in CHECKS if s != ".md" for p in path.rglob(f"*{s}"))


def complaints(name):
    return [
        f'{path.relative_to(ROOT)}:{fault.line}: "{fault.phrase}"; write instead: {fault.instead}'
        for path in files(name)
        for fault in faults(path)
    ]


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.xfail(strict=True)] if n in AWAITED else []) for n in packages()]
)
def test_words(name):
    found = complaints(name)
    assert not found, "\n" + "\n".join(found)


def test_awaited_packages_exist():
    assert set(packages()) >= AWAITED


def test_a_banned_phrase_names_its_line():
    source = '"""First.\n\nNothing tells of it.\n"""\n\nX = "a key"\nMESSAGE = (\n    f"{X} is read; "\n    f"it is told {X} here"\n)\n'
    assert [(f.line, f.phrase) for f in of_python(source)] == [(3, "tells"), (9, "told")]
    assert "cannot distinguish" in of_python(source)[0].instead


@pytest.mark.parametrize(
    "source",
    [
        '"""Calls `tell` and `told`."""',
        '"""What.\n\nParameters\n----------\ntell : callable\n    Called.\n"""',
        'X = {"told": "cannot tell", "unit": "m/s^2"}',
        'X = "a_x [m/s^2]"',
        "told = tell(1)  # tells",
    ],
)
def test_names_keys_and_verdicts_are_free(source):
    assert not of_python(source)


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("4 m/s^2", "m/s²"), ("a jerk of 4 m/s^3", "m/s³"), ("2 kg m^2", "kg·m²"), ("50 N m", "N·m"), ("50 Nm", "N·m"),
        ("3 +- 1", "±"), ("in rad/s^2", "rad/s²"), ("in [N m]", "N·m"),
    ],
)  # fmt: skip
def test_units_are_written_one_way(text, right):
    assert [f.instead for f in of_python(f'"""A value of {text}."""')] == [f'"{right}"']
    assert [f.instead for f in of_document(f"A value of {text}.\n")] == [f'"{right}"']
    assert not of_document(f"A value of `{text}`.\n\n```console\n$ {text}\n```\n")


def test_terms_of_a_trade_are_explained_once():
    assert [f.phrase for f in of_document("The chord of the curve.\n")] == ["chord"]
    assert not of_document("The chord (line between two points) is less. Another chord is more.\n")


def test_sentences_of_a_document():
    text = (
        "# A title of many words that counts for nothing\n\nOne two three, e.g. four `x y z`. Two words\nfollow on. Last [one](a.md).\n\n"
        "| a cell | A sentence in a cell. |\n|---|---|\n\n- an item\n- another item. With two.\n\n```\nIn a fence. Not.\n```\n"
    )
    assert [(line, length(s), ends) for line, s, ends in sentences(text)] == [
        (3, 6, True), (3, 4, True), (4, 2, True), (6, 5, True), (9, 2, False), (10, 2, True), (10, 2, True),
    ]  # fmt: skip


def test_long_sentences_and_long_documents():
    long = " ".join(["word"] * 41) + "."
    assert [(f.line, "41 words" in f.instead) for f in of_document(f"Short. Short.\n\n{long}\n")] == [(3, True)]
    middling = " ".join(["word"] * 19) + "."
    assert of_document(f"{middling}\n") == [
        Fault(1, "the whole document", "a median of at most 18 words a sentence, not 19")
    ]


def test_scripts_and_tables_of_keys():
    assert [(f.line, f.phrase) for f in of_javascript('const told = "tell";\nsay("it tells more");')] == [(2, "tells")]
    assert [(f.line, f.phrase) for f in of_toml('[told]\ntell = "x"\ntext = "what the other drive tells"\n')] == [
        (3, "tells")
    ]
