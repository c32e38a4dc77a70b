"""One list of names that mean harm through every page: text stays text, the policy holds, nothing grows with a name."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import pytest

from aqualog.report.page import plotly_js
from tests.headless import requests, severe, wait_for
from tests.report.hostile_names import NAMES, PAGES

MOST = 1_500_000  # characters by which names make a page longer, whatever they are
TEXT_CONTENT = {"eventful drive", "campaign", "run"}  # whose script puts names in as text, and as text for plotly
OWN_TAGS = {"b", "br", "extra", "i", "sub", "sup"}  # that the program's own texts for plotly hold


class Elements(HTMLParser):
    """Elements with their attributes, and the texts of scripts."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.found, self.scripts, self._is_script = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self._is_script = tag == "script"

    def handle_endtag(self, _):
        self._is_script = False

    def handle_data(self, data):
        if self._is_script:
            self.scripts.append((self.found[-1][1], data))


def made(page, name, folder):
    """A page without the megabytes of plotly.js."""
    return PAGES[page](name, folder / str(len(list(folder.iterdir())))).replace(plotly_js(), "plotly")


def tags(elements):
    return {(t, frozenset(a)) for t, a in elements.found}


# that of the reproduction is long; the figures of it are a page of their own
_SLOW = {"reproduction": pytest.mark.nightly}


@pytest.mark.parametrize("page", [pytest.param(p, marks=_SLOW.get(p, ())) for p in PAGES])
def test_a_name_is_text(page, tmp_path):
    plain = made(page, "plain name", tmp_path)
    known = tags(Elements(plain))
    for kind, name in NAMES.items():
        text = made(page, name, tmp_path)
        elements = Elements(text)
        # nothing that a name has brought in: no element, no attribute
        assert tags(elements) <= known, kind
        assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", text), kind
        addresses = [v for _, a in elements.found for k, v in a.items() if k in ("src", "href", "action", "srcset")]
        assert not [v for v in addresses if "//" in v], kind
        islands = [s for a, s in elements.scripts if a.get("type") == "application/json"]
        assert islands, kind
        assert not set("<>&") & set("".join(islands)), kind
        brought = set() if page in TEXT_CONTENT else set(re.findall(r"\\u003c/?([a-z]+)", "".join(islands)))
        assert brought <= OWN_TAGS, kind
        scripts = [s for a, s in elements.scripts if "type" not in a]
        policy = next(a["content"] for t, a in elements.found if t == "meta" and "http-equiv" in a)
        assert policy.startswith("default-src 'none'; script-src 'sha256-"), kind
        assert "unsafe-eval" not in policy
        assert "unsafe-inline" not in policy.replace("style-src 'unsafe-inline'", "")
        for script in scripts:
            whole = plotly_js() if script == "plotly" else script
            assert base64.b64encode(hashlib.sha256(whole.encode()).digest()).decode() in policy, kind
        assert len(text) < len(plain) + MOST, kind


@pytest.mark.browser  # the other pages have names of this kind in browser tests of their own
@pytest.mark.parametrize(
    "page", ["eventful drive", *(pytest.param(p, marks=pytest.mark.nightly) for p in ("figures", "evaluation"))]
)
def test_a_browser_shows_names_and_does_nothing(browser, page, tmp_path):
    name = "".join(NAMES[k] for k in ("script", "image", "attribute", "link", "terminal", "comment", "long"))
    path = tmp_path / "page.html"
    path.write_bytes(PAGES[page](name, tmp_path / "made").encode("utf-8", "replace"))
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get(path.as_uri())
    wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
    assert (
        browser.execute_script("return document.querySelectorAll('img, svg[onload], [onerror], [onmouseover]').length")
        == 0
    )
    assert browser.execute_script("return document.querySelectorAll('#plots a[href], .panel a[href]').length") == 0
    assert requests(browser) == []
    assert severe(browser) == []
    # no name makes the page wider than the window or a heading higher than it
    wide = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert browser.execute_script(wide) <= 0
    high = "return Math.max(...Array.from(document.querySelectorAll('h1, h2, h3'), h => h.offsetHeight)) / innerHeight"
    assert browser.execute_script(high) < 0.5
