"""The report of a campaign in headless Chromium, from a disk and without a network: filters act on all, links work."""

import json
import re

import pytest

from tests.headless import click, requests, severe, wait_for
from tests.report.test_contrast import ENOUGH, contrast

pytestmark = pytest.mark.browser

PILL = "//button[contains(@class, 'pill') and text()='{}']"


def opened(browser, path, fragment=""):
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get("about:blank")
    browser.get(path.as_uri() + fragment)
    wait_for(lambda: browser.execute_script("return !!document.body.dataset.ready"))
    return browser


@pytest.fixture
def page(browser, folder):
    return opened(browser, folder / "index.html")


def pick(page, text):
    from selenium.webdriver.common.by import By

    page.execute_script("arguments[0].click()", page.find_element(By.XPATH, PILL.format(text)))


def texts(page, selector):
    return page.execute_script(
        "return Array.from(document.querySelectorAll(arguments[0])).map(e => e.textContent)", selector
    )


def shown(page, selector):
    """Scroll something into view and wait until its figure is drawn."""
    page.execute_script("document.querySelector(arguments[0]).scrollIntoView()", selector)
    wait_for(lambda: page.execute_script("return !!document.querySelector(arguments[0] + ' .main-svg')", selector))


def traces(page, kind):
    """Names of what all panels of a kind draw."""
    script = """
      return Array.from(document.querySelectorAll('#' + arguments[0] + ' .js-plotly-plot'))
        .flatMap(p => p.data.filter(t => t.meta === 'values').map(t => t.name))"""
    return page.execute_script(script, kind)


def test_all_is_drawn_without_errors_or_requests(page):
    for selector in ("#slopes", "#resistance", "#full", "#detections"):
        shown(page, selector)
    assert page.execute_script("return document.querySelectorAll('.main-svg').length") >= 4
    assert len(texts(page, "#runs tbody tr")) == 15
    assert requests(page) == []
    assert severe(page) == []


def test_filter_acts_on_figures_matrix_tables_and_count(page):
    shown(page, "#resistance")
    assert {"0.8 mm", "1.3 mm"} <= set(traces(page, "resistance"))
    cells = texts(page, "#matrix td.cell button")
    pick(page, "0.8 mm")
    shown(page, "#resistance")
    assert set(traces(page, "resistance")) == {"0.8 mm"}
    assert len(texts(page, "#runs tbody tr")) == 6
    assert texts(page, "#filter-state") == ["6 of 15 runs, 1 of 4 configurations"]
    assert len(texts(page, "#answers tbody tr")) == 1
    assert texts(page, "#matrix td.cell button") != cells
    assert texts(page, "#detections-table tbody tr:first-child td")[0].endswith("/ 6")
    click(page, "#reset")
    assert len(texts(page, "#runs tbody tr")) == 15


def changed(browser, folder, tmp_path, change):
    """The page opened with other data."""
    head, rest = (folder / "index.html").read_text(encoding="utf-8").split('id="campaign-data">', 1)
    text, tail = rest.split("</script>", 1)
    change(data := json.loads(text))
    other = json.dumps(data).replace("<", "\\u003c")
    (tmp_path / "index.html").write_text(f'{head}id="campaign-data">{other}</script>{tail}', encoding="utf-8")
    (tmp_path / "plotly.min.js").write_bytes((folder / "plotly.min.js").read_bytes())
    return opened(browser, tmp_path / "index.html")


def test_tables_fit_a_small_screen(browser, folder, tmp_path):
    def answer_all(data):
        data["answers"] = [[a[0], *[[118, 109, 127, "free", "why"]] * 6] for a in data["answers"]]

    before = browser.get_window_size()
    try:
        browser.set_window_size(1300, 2000)
        page = changed(browser, folder, tmp_path, answer_all)
        assert (
            page.execute_script("""return [...document.querySelectorAll('.scroll')]
            .filter(s => s.scrollWidth > s.clientWidth).map(s => s.firstChild.id)""")
            == []
        )
    finally:
        browser.set_window_size(before["width"], before["height"])


def test_what_a_panel_leaves_out_is_written_on_it(browser, folder, tmp_path):
    """A value without an interval, far above all with one: the scale is theirs, and the panel says what is beyond."""

    def add(data):
        points = next(c[2] for c in data["resistance"] if any(p[4] is not None for p in c[2]))
        points.append([*points[-1][:3], 99.5, None, None, 1, 9, None, "one run"])

    page = changed(browser, folder, tmp_path, add)
    shown(page, "#resistance")
    assert any("1 value to 99.5" in t for t in texts(page, "#resistance .annotation-text"))


def test_wheels_and_pooled_groups_are_told(page):
    before = texts(page, "#runs tbody tr td:nth-child(6)")
    pick(page, "RR")
    after = texts(page, "#runs tbody tr td:nth-child(6)")
    assert sum(map(int, after)) < sum(map(int, before))
    shown(page, "#slopes")
    assert texts(page, "#slopes-key")[0].startswith("RR")
    assert page.execute_script("return document.getElementById('pooled').hidden")
    pick(page, "n0")  # an own column, by which nothing is split
    assert not page.execute_script("return document.getElementById('pooled').hidden")
    assert "also use runs that the filters leave out" in texts(page, "#pooled")[0]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_speeds_in_a_cell_of_the_matrix_can_be_read(browser, folder, scheme):
    """The ground of a cell is a colour of its own, which muted text is too near to [WCAG 2.2, 1.4.3]."""
    try:
        media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        page = opened(browser, folder / "index.html")
        found = page.execute_script("""
          const numbers = c => c.match(/[\\d.]+/g).map(Number), style = e => getComputedStyle(e);
          const paper = numbers(style(document.querySelector('#matrix-section')).backgroundColor);
          return [...document.querySelectorAll('#matrix td.cell small')].map(e => {
            const [r, g, b, share] = numbers(style(e.parentElement).backgroundColor);
            const ground = [r, g, b].map((x, i) => (share ?? 1) * x + (1 - (share ?? 1)) * paper[i]);
            return [numbers(style(e).color).slice(0, 3), ground];
          });""")
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert found
    code = ["#" + "".join(f"{round(x):02x}" for x in colour) for pair in found for colour in pair]
    assert min(map(contrast, code[::2], code[1::2])) >= ENOUGH


def test_matrix_cell_filters_and_lets_go(page):
    button = "document.querySelector('#matrix td.cell button')"
    full = len(texts(page, "#runs tbody tr"))
    page.execute_script(f"{button}.click()")
    assert 0 < len(texts(page, "#runs tbody tr")) < full
    page.execute_script("document.querySelector('#matrix td.cell button[aria-pressed=true]').click()")
    assert len(texts(page, "#runs tbody tr")) == full


def test_filters_open_over_the_page_and_jumps_land(page):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    page.set_window_size(1366, 768)
    page.execute_script("document.documentElement.style.scrollBehavior = 'auto'")
    top = "return document.querySelector('#runs-section').getBoundingClientRect().top"
    before = page.execute_script("return document.querySelector('#filter-place').offsetHeight")
    page.find_element(By.LINK_TEXT, "runs").click()
    wait_for(
        lambda: (
            0.0 <= page.execute_script(top) < 80.0
            or page.execute_script("return innerHeight + scrollY >= document.documentElement.scrollHeight - 2")
        )
    )
    click(page, "#open-filters")
    box = page.execute_script("return document.querySelector('#filter-body').getBoundingClientRect().toJSON()")
    assert 0.0 <= box["top"] < box["bottom"] <= 768.0
    assert page.execute_script("return document.querySelector('#filter-place').offsetHeight") == before
    page.find_element(By.TAG_NAME, "body").send_keys(Keys.ESCAPE)
    assert not page.execute_script("return document.querySelector('#filter-body').classList.contains('floating')")
    page.set_window_size(1400, 2000)
    assert severe(page) == []


def test_search_sort_and_problems(page):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    search = page.find_element(By.ID, "search")
    search.send_keys("0.8 V110")
    assert len(texts(page, "#runs tbody tr")) == 3
    search.clear()
    search.send_keys(" ")
    head = page.find_element(By.XPATH, "//table[@id='runs']//th[text()='Lane [km/h]']")
    head.send_keys(Keys.ENTER)
    head.send_keys(Keys.ENTER)
    assert head.get_attribute("aria-sort") == "descending"
    speeds = [float(t) if t != "–" else -1.0 for t in texts(page, "#runs tbody tr td:nth-child(5)")]
    assert speeds == sorted(speeds, reverse=True)
    page.execute_script("document.querySelector('#problem-list details').open = true")
    wait_for(lambda: texts(page, "#problem-list li"))
    assert "bad.mf4" in texts(page, "#problem-list li")[0]
    page.execute_script("document.querySelector('#problem-list details button').click()")
    assert len(texts(page, "#runs tbody tr")) == 1


def test_run_opens_and_the_way_back_keeps_the_filter(page, folder):
    pick(page, "1.3 mm")
    page.execute_script("document.querySelector('.jump a:last-child').click()")
    rows = len(texts(page, "#runs tbody tr"))
    page.execute_script("document.querySelector('#runs tbody tr:nth-child(4) a').click()")
    wait_for(lambda: "/runs/" in page.current_url)
    wait_for(lambda: page.execute_script("return document.body.dataset.ready === 'true'"))
    assert "110_0" in texts(page, "h1")[0]
    assert page.execute_script("return document.querySelectorAll('#plots .scatterlayer .trace').length") > 8
    assert len(texts(page, "#events tbody tr")) > 0
    assert texts(page, "#command")[0].startswith("aqualog detect logs/d1.3_v110_0.parquet --vehicle car.toml")
    page.back()
    wait_for(lambda: page.execute_script("return !!document.body.dataset.ready"))
    assert len(texts(page, "#runs tbody tr")) == rows
    assert requests(page) == []
    assert severe(page) == []


def test_names_do_nothing(page, folder):
    for selector in ("#slopes", "#resistance", "#full"):
        shown(page, selector)
    assert page.execute_script("return document.images.length") == 0
    runs = sorted((folder / "runs").iterdir())
    opened(page, next(r for r in runs if r.name.startswith("0015")))
    assert page.execute_script("return document.images.length") == 0
    assert "<img src=x onerror=alert(3)>" in texts(page, "h1")[0]
    assert severe(page) == []


def test_script_that_stands_in_the_page_does_not_run(browser, folder, tmp_path):
    html = (folder / "index.html").read_text()
    (tmp_path / "evil.js").write_text("document.title = 'caught'")
    evil = (
        "<script>document.title = 'caught'</script><script src='evil.js'></script><i onclick='document.title=1'>x</i>"
    )
    (tmp_path / "index.html").write_text(html.replace("<footer>", f"{evil}<footer>"))
    opened(browser, tmp_path / "index.html")
    browser.execute_script("document.querySelector('i').click()")
    assert "case" in browser.title
    assert len([e for e in browser.get_log("browser") if "Content Security" in e["message"]]) >= 3


def test_events_of_an_unknown_lane_are_on_no_water(browser, folder, tmp_path):
    html = (folder / "index.html").read_text()
    island = re.search(r'id="campaign-data">(.*?)</script>', html, re.DOTALL)[1]
    data = json.loads(island)
    with_events = [i for i, own in enumerate(data["runs"]["events"]) if own]
    data["runs"]["events"] = [[[d, at, 0, 0, on + off] for d, at, on, off, _ in own] for own in data["runs"]["events"]]
    (tmp_path / "index.html").write_text(html.replace(island, json.dumps(data).replace("<", "\\u003c")))
    opened(browser, tmp_path / "index.html")
    heads = texts(browser, "#runs thead th")
    some = sorted(f"{sum(own[4] for own in data['runs']['events'][i])} somewhere" for i in with_events)
    for head, shown in (("On water", some), ("Off", ["–"] * len(some))):
        column = next(i for i, text in enumerate(heads) if text.startswith(head)) + 1
        cells = texts(browser, f"#runs tbody td:nth-child({column})")
        assert sorted(c for c in cells if c != "0") == shown != []


def test_without_plotly_the_page_says_so(browser, folder, tmp_path):
    (tmp_path / "index.html").write_text((folder / "index.html").read_text())
    opened(browser, tmp_path / "index.html")
    assert not browser.execute_script("return document.getElementById('no-plotly').hidden")
    assert len(texts(browser, "#runs tbody tr")) == 15
    pick(browser, "0.8 mm")
    assert len(texts(browser, "#runs tbody tr")) == 6


def test_paper_shows_every_panel_and_the_screen_comes_back(page):
    page.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    drawn = "return document.querySelectorAll('.panel .main-svg').length > 0 && !document.querySelector('.panel:empty')"
    assert page.execute_script(drawn)
    page.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert severe(page) == []
