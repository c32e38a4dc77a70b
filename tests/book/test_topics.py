"""Pages are found by name and by word."""

from pathlib import Path

import pytest

from aqualog.book.topics import DOCS, SECTIONS, find, nearest, plain, search, topics


@pytest.fixture
def book(tmp_path: Path) -> Path:
    pages = {
        "index.md": "# The book\n\nStart here.\n",
        "guide/campaign.md": "# A campaign\n\nMany drives,\nin one go. More of it.\n\n## Steps\n\nA slip slope.\n",
        "reference/campaign.md": "# Keys of a campaign\n\nEvery `key`.\n\n| key | unit |\n|---|---|\n| `slope_key` | m |\n",
        "method/slip_slope.md": "<!-- x -->\n# Slip slope\n\n![A *picture*](../pictures/a.png)\n\nThe [slope](x.md) of it.\n",
        "decisions/index.md": "# Decisions\n\nWhy.\n",
    }
    for name, text in pages.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_titles_and_summaries(book):
    pages = {p.address: p for p in topics(book)}
    assert (pages["guide/campaign"].title, pages["guide/campaign"].summary) == (
        "A campaign",
        "Many drives, in one go. More of it.",
    )
    assert pages["method/slip_slope"].title == "Slip slope"
    assert pages["method/slip_slope"].summary == "The slope of it."


@pytest.mark.parametrize(
    ("name", "address"),
    [
        ("campaign", "guide/campaign"),
        ("Campaign.md", "guide/campaign"),
        ("reference/campaign", "reference/campaign"),
        ("slip-slope", "method/slip_slope"),
        ("slip slope", "method/slip_slope"),
        ("index", "index"),
        ("decisions", "decisions/index"),
    ],
)
def test_names(book, name, address):
    assert find(name, topics(book)).address == address


def test_a_page_of_decisions_hides_no_command(book):
    (book / "decisions" / "detect.md").write_text("# Decisions: detect\n\nWhy.\n")
    assert find("detect", topics(book)) is None
    assert find("decisions/detect", topics(book)).title == "Decisions: detect"


def test_lines_of_code_stand_behind_what_explains_them(book):
    (book / "guide" / "x.md").write_text(
        "# X\n\nIt is.\n\n```console\n$ odd 1\n$ odd 2\n$ odd 3\n```\n\nAn odd word.\n"
    )
    assert search(["odd"], topics(book))[0].lines == ("$ odd 1", "$ odd 2", "An odd word.")


def test_no_such_page(book):
    assert find("nothing", topics(book)) is None
    assert nearest("slipslope", [p.name for p in topics(book)]) == ["slip_slope"]


def test_search_sets_the_page_of_that_title_first(book):
    hits = search(["slope"], topics(book))
    assert [h.topic.address for h in hits] == ["method/slip_slope", "guide/campaign", "reference/campaign"]
    assert hits[1].lines == ("Steps: A slip slope.",)
    assert hits[2].lines == ("slope_key  m",)


def test_all_words_must_be_there(book):
    assert [h.topic.address for h in search(["SLIP", "drives"], topics(book))] == ["guide/campaign"]
    assert search(["slip", "nowhere"], topics(book)) == []


def test_signs_of_markdown():
    assert plain("**a** `b_c_d` [c](d.md) ![e](f.png) *g* 2 * 3 * 4") == "a b_c_d c e g 2 * 3 * 4"


@pytest.mark.parametrize("page", topics(), ids=lambda p: p.address)
def test_every_page_has_a_title_and_a_summary(page):
    assert page.text().count("\n# ") + page.text().startswith("# ") >= 1
    assert page.summary


def test_every_page_is_in_a_section():
    assert {p.path for p in topics()} == set(DOCS.rglob("*.md"))
    assert set(SECTIONS) >= {p.section for p in topics()}


def test_every_command_and_detector_has_a_page():
    from aqualog.cli.commands import COMMANDS
    from aqualog.detect.registry import DETECTORS

    pages = topics()
    assert [d for d in DETECTORS if find(f"method/{d}", pages) is None] == []
    guide = "\n".join(p.text() for p in pages if p.section == "guide")
    assert [c for c in COMMANDS if f"aqualog {c}" not in guide and c != "help"] == []
