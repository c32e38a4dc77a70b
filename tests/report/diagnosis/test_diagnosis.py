"""The page of a diagnosis in headless Chromium without a network: it draws, changes what it is drawn over, and no name
runs."""

import pytest

from aqualog.report.diagnosis.sections import diagnosis_report
from aqualog.report.page import report_page, write_page
from tests.headless import click, requests, severe, wait_for
from tests.report.diagnosis.test_document import document_of
from tests.report.diagnosis_case import HOSTILE, cases, views_of

pytestmark = pytest.mark.browser
DRAWN = "return document.querySelectorAll('#views .js-plotly-plot').length"
FIRST = "document.querySelector('#views .js-plotly-plot')"


@pytest.fixture
def show(browser, tmp_path):
    def opened(verdict):
        path = tmp_path / "page.html"
        report = diagnosis_report(document_of(verdict), views_of(verdict))
        write_page(path, report_page(report, title=f"car {HOSTILE}"))
        for kind in ("browser", "performance"):
            browser.get_log(kind)
        browser.get(path.as_uri())
        ready = "return document.body.dataset.ready === 'true' && document.body.dataset.views === 'ready'"
        wait_for(lambda: browser.execute_script(ready))
        return browser

    return opened


def axis_title(browser):
    return browser.execute_script(f"return {FIRST}._fullLayout.xaxis.title.text")


def metas(browser):
    return browser.execute_script(f"return {FIRST}._fullData.map(t => t.meta || '')")


def test_panels_change_with_coordinate_drive_and_samples(show):
    browser = show("named")
    wait_for(lambda: browser.execute_script(DRAWN) >= 4)
    assert axis_title(browser) == "torque [N·m]"  # what tells most about the explained channel
    click(browser, '#coordinate-choice button[value="v_x"]')
    wait_for(lambda: axis_title(browser) == "speed [km/h]")
    assert metas(browser).count("median") == 2
    assert metas(browser).count("raw") == 2
    click(browser, "#raw-choice")
    wait_for(lambda: metas(browser).count("raw") == 0)
    pressed = "return [...document.querySelectorAll('#coordinate-choice [aria-pressed=true]')].map(b => b.value)"
    assert browser.execute_script(pressed) == ["v_x"]
    options = browser.execute_script("return [...document.getElementById('drive-choice').options].map(o => o.text)")
    assert len(options) == 2
    before = browser.execute_script(f"return {FIRST}._fullData[0].y.slice(0, 5)")
    browser.execute_script(
        "const d = document.getElementById('drive-choice'); d.value = '1'; d.dispatchEvent(new Event('change'))"
    )
    wait_for(lambda: browser.execute_script(DRAWN) >= 4)
    assert browser.execute_script(f"return {FIRST}._fullData[0].y.slice(0, 5)") != before
    assert severe(browser) == []
    assert requests(browser) == []


def test_what_is_folded_has_the_width_of_the_page_once_it_is_open(show):
    browser = show("named")
    width = "return document.querySelector('#isolability .main-svg')?.getBoundingClientRect().width ?? 0"
    browser.execute_script("document.querySelector('#pairs-section details').open = true")
    wait_for(lambda: browser.execute_script(width) > 1000)
    assert severe(browser) == []


# `named` is drawn above; these two have what it lacks, the others are parts of them
_SUITE = ("unexplained", "not_testable")


@pytest.mark.parametrize(
    "verdict", [pytest.param(v, marks=() if v in _SUITE else pytest.mark.nightly) for v in cases()]
)
def test_every_verdict_draws_without_a_fault(show, verdict):
    browser = show(verdict)
    title = browser.execute_script("return document.querySelector('.headline').textContent")
    assert title == document_of(verdict)["sentence"]
    top = browser.execute_script("return document.querySelector('.headline').getBoundingClientRect().top")
    assert top < 220
    wide = browser.execute_script("return document.documentElement.scrollWidth - window.innerWidth")
    assert wide <= 0
    assert severe(browser) == []
    assert requests(browser) == []
