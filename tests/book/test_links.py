"""Links of the documents lead somewhere, pictures are there, rows stand in tables; the site builds strictly, works offline."""

import re
import unicodedata
from pathlib import Path
from urllib.parse import urlparse

import pytest

from aqualog.book.site import build, configuration, navigation
from aqualog.book.topics import DOCS, topics
from aqualog.core.errors import AqualogError, ConfigError
from tests.conftest import ROOT

PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md"]


def outside_of_code(text):
    text = re.sub(r"^( *)(```|~~~).*?^\1\2", "", text, flags=re.M | re.S)
    return re.sub(r"`[^`\n]*`", "", text)


def slug(heading):
    """As python-markdown and GitHub make it of a heading."""
    words = unicodedata.normalize("NFKC", re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading))
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", words).strip().lower())


def anchors(text):
    headings = re.findall(r"^#+ (.+)$", re.sub(r"^( *)(```|~~~).*?^\1\2", "", text, flags=re.M | re.S), re.M)
    return {slug(h.replace("`", "")) for h in headings} | set(re.findall(r"<a (?:name|id)=\"([^\"]+)\"", text))


@pytest.mark.parametrize("path", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_and_pictures_lead_somewhere(path):
    text = path.read_text(encoding="utf-8")
    dead = []
    for target in re.findall(r"\]\(<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\)", outside_of_code(text)):
        if urlparse(target).scheme:
            continue
        file, _, anchor = target.partition("#")
        there = path.parent / file if file else path
        if not there.exists() or (
            anchor and there.suffix == ".md" and anchor not in anchors(there.read_text(encoding="utf-8"))
        ):
            dead.append(target)
    assert dead == []


@pytest.mark.parametrize("path", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_row_stands_in_a_table(path):
    blocks = re.findall(r"(?:^\|.*\n?)+", path.read_text(encoding="utf-8"), re.M)
    assert [b[:60] for b in blocks if not re.match(r".*\n\|[-:| ]+\n", b)] == []


def test_every_picture_is_shown():
    shown = {
        (p.parent / t).resolve()
        for p in PAGES
        for t in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", p.read_text(encoding="utf-8"))
    }
    assert [p.name for p in (DOCS / "pictures").glob("*.png") if p.resolve() not in shown] == []


def test_navigation_has_every_page_once():
    def files(entry):
        if isinstance(entry, str):
            return [entry]
        return [f for x in (entry.values() if isinstance(entry, dict) else entry) for f in files(x)]

    found = files(navigation(topics()))
    assert sorted(found) == sorted(str(p.relative_to(DOCS).as_posix()) for p in DOCS.rglob("*.md"))
    tabs = [next(iter(t)) for t in navigation(topics())]
    wanted = ["Guide", "Method", "Reference", "Validation", "Glossary", "Sources", "Decisions", "Changelog"]
    assert [t for t in tabs if t in wanted] == wanted


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("material")
    out = tmp_path_factory.mktemp("site") / "html"
    build(out)
    return out


def test_the_site_builds_without_a_warning_and_has_every_page(site):
    assert all((site / p.file).with_suffix(".html").is_file() for p in topics())


def test_citations_lead_to_their_sources(site):
    page = (site / "method" / "minor_spin_down.html").read_text(encoding="utf-8")
    sources = (site / "sources.html").read_text(encoding="utf-8")
    cited = set(re.findall(r'href="../sources.html#([^"]+)"', page))
    assert {"e4", "c32", "fichtinger2024", "35"} <= cited
    assert all(f'id="{key}"' in sources for key in cited)


def test_pages_of_the_site_load_nothing_from_elsewhere(site):
    loaded = r"<(?:script|img|iframe|source)[^>]+src=[\"']?([^\"'\s>]+)|<link[^>]+href=[\"']?([^\"'\s>]+)"
    for path in site.rglob("*.html"):
        for script, link in re.findall(loaded, path.read_text(encoding="utf-8")):
            target = script or link
            assert target.startswith("data:") or not urlparse(target).netloc, f"{path}: {target}"
    for path in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(?:https?:)?//", path.read_text(encoding="utf-8"))


def test_search_works_from_files(site):
    """A page that is opened as a file may not fetch an index: it is a script."""
    assert (site / "search" / "search_index.js").is_file()


@pytest.mark.browser
def test_search_finds_a_page_that_is_opened_as_a_file(site, browser):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    browser.get((site / "guide" / "campaign.html").as_uri())
    browser.find_element(By.NAME, "query").send_keys("aquaplaning")
    results = WebDriverWait(browser, 20).until(lambda b: b.find_elements(By.CSS_SELECTOR, ".md-search-result__link"))
    assert any("aquaplaning" in r.get_attribute("href") for r in results)


def test_a_dead_link_is_an_error(tmp_path):
    pytest.importorskip("material")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("# Home\n\nSee [this](nowhere.md).\n")
    with pytest.raises(AqualogError, match=r"nowhere\.md"):
        build(tmp_path / "site", docs=tmp_path / "docs")


def test_a_folder_with_other_files_is_not_emptied(tmp_path):
    pytest.importorskip("material")
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(ConfigError, match="other files"):
        build(tmp_path)
    assert (tmp_path / "thesis.txt").exists()


def test_the_site_asks_no_font_and_no_script_of_others():
    settings = configuration(topics(), docs=DOCS, out=Path("site"))
    assert settings["strict"] is True
    assert settings["theme"]["font"] is False
