"""The page in headless Chromium without a network: it draws, zooms, resets, and nothing in a name runs."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.judgement import Episode, Judgement
from aqualog.report.drive.report import drive_page
from aqualog.report.page import write_page
from aqualog.report.theme import EVENT_SHADE, FULL_SHADE, OTHER_SHADE
from tests.headless import PATIENCE, click, requests, severe, wait_for
from tests.report import fake_result as fake

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def show(browser, tmp_path_factory):
    """Write a result's page, open it, wait until it is drawn; a page that is open already is only put back."""
    path, last = tmp_path_factory.mktemp("page") / "page.html", []

    def opened(result):
        if last and last[0] is result:
            put_back = "document.querySelectorAll('.toggle[aria-pressed=false], #show-all').forEach(b => b.click())"
            browser.execute_script(f"{put_back}; window.scrollTo(0, 0)")
            wait_for(lambda: x_range(browser) == last[1])
            return browser
        write_page(path, drive_page(result, title="run"))
        for kind in ("browser", "performance"):
            browser.get_log(kind)
        browser.get(path.as_uri())
        browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        wait_for(lambda: browser.execute_script("return document.getElementById('plots').dataset.ready === 'true'"))
        browser.execute_script("document.documentElement.style.scrollBehavior = 'auto'")  # else clicks come too early
        last[:] = [result, x_range(browser)]
        return browser

    return opened


def x_range(browser):
    return browser.execute_script("return document.getElementById('plots')._fullLayout.xaxis.range.slice()")


def points(browser, row, name):
    """Samples that a trace draws."""
    script = """
      const all = document.getElementById('plots')._fullData;
      const t = all.find(t => t.yaxis === arguments[0] && t.name === arguments[1]);
      return [Array.from(t.x), Array.from(t.y)];"""
    return browser.execute_script(script, row, name)


def lanes(browser):
    return browser.execute_script(
        "return document.getElementById('plots')._fullData.filter(t => t.meta === 'bars').map(t => t.name)"
    )


def bars(browser, name):
    """Begin and end of the bars that a lane draws."""
    script = """
      const t = document.getElementById('plots')._fullData.find(t => t.meta === 'bars' && t.name === arguments[0]);
      return Array.from(t.x);"""
    x = browser.execute_script(script, name)
    return [[x[i], x[i + 2]] for i in range(0, len(x), 6)]


def shade(browser, colour):
    """Begin and end of what a colour shades."""
    script = (
        "return (document.getElementById('plots').layout.shapes.find(s => s.fillcolor === arguments[0]) || {}).path"
    )
    path = browser.execute_script(script, colour) or ""
    return [[float(a), float(b)] for a, b in re.findall(r"M([\d.-]+),0V1H([\d.-]+)V0Z", path)]


def visible_groups(browser):
    script = """return document.getElementById('plots')._fullData
      .filter(t => t.visible === true && t.legendgroup).map(t => t.legendgroup)"""
    return set(browser.execute_script(script))


@pytest.fixture(scope="module")
def short():
    return fake.make_result()


def test_each_line_of_the_verdict_stands_on_its_own(show, short):
    wet = Episode(
        "aquaplaning", 8.0, 9.0, ("fr",), "f", None, "partial", 28.0, ("joint_criteria",), 0.5, -0.1, 0.0, 28.0, ()
    )
    judged = Judgement("aquaplaning", (), ("margin",), (wet, replace(wet, start_s=12.0, end_s=13.0)), 24.0)
    browser = show(replace(short, judgement=judged))
    tops = browser.execute_script("return [...document.querySelectorAll('#verdict li')].map(x => x.offsetTop)")
    assert len(set(tops)) == len(tops) >= 3


def test_plots_are_drawn_without_errors_or_requests(show, short):
    browser = show(short)
    drawn = "return document.querySelectorAll('#plots .scatterlayer .trace path.js-line').length"
    assert browser.execute_script(drawn) >= 20
    assert bars(browser, "Spin-down RL") == [[28.0, 28.01]]
    assert sum(len(bars(browser, t)) for t in lanes(browser)) >= 15
    t, y = points(browser, "y3", "RL")  # a gap breaks the line
    assert any(v is None for a, v in zip(t, y, strict=True) if 20.0 <= a < 21.2)
    assert all(v is None for a, v in zip(t, y, strict=True) if 20.0 <= a < 21.19)
    assert x_range(browser) == [0, 30]
    assert requests(browser) == []
    assert severe(browser) == []


def test_click_zooms_all_plots_and_show_all_resets(show, short):
    browser = show(short)
    click(browser, "#events tbody tr")
    event = short.events[0]
    wait_for(lambda: x_range(browser) != [0, 30])
    begin, end = x_range(browser)
    assert begin <= event.start_s < event.end_s <= end
    assert end - begin < 60.0
    assert browser.execute_script("return document.getElementById('plots')._fullLayout.xaxis2.range[0]") == begin
    chosen = "return Array.from(document.querySelectorAll('#events tr[aria-selected=true]')).map(r => r.dataset.row)"
    assert browser.execute_script(chosen) == ["0"]
    click(browser, "#show-all")
    wait_for(lambda: x_range(browser) == [0, 30])
    assert browser.execute_script(chosen) == []
    assert severe(browser) == []


def test_enter_on_a_row_and_arrows_step(show, short):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    browser = show(short)
    rows = browser.find_elements(By.CSS_SELECTOR, "#events tbody tr")
    rows[2].send_keys(Keys.ENTER)
    wait_for(lambda: x_range(browser) != [0, 30])
    begin, end = x_range(browser)
    assert begin <= short.events[2].start_s < short.events[2].end_s <= end
    click(browser, "#next")
    wait_for(lambda: rows[3].get_attribute("aria-selected") == "true")
    assert x_range(browser)[0] <= short.events[3].start_s


def test_dragging_zooms_and_double_click_resets(show, short):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    browser = show(short)
    area = browser.find_element(By.CSS_SELECTOR, "#plots .nsewdrag")
    ActionChains(browser).move_to_element(area).click_and_hold().move_by_offset(200, 0).release().perform()
    wait_for(lambda: x_range(browser) != [0, 30])
    begin, end = x_range(browser)
    assert 10.0 < begin < 16.0
    assert end - begin < 10.0
    ActionChains(browser).double_click(area).perform()
    wait_for(lambda: x_range(browser) == [0, 30])


def lanes_at(browser, t):
    """What the hover text of the lanes says at a time."""
    script = """
      const t = document.getElementById('plots')._fullData.find(t => t.meta === 'lanes');
      return [Array.from(t.x), Array.from(t.customdata)];"""
    x, text = browser.execute_script(script)
    return text[min(range(len(x)), key=lambda i: abs(x[i] - t))]


def test_hover_over_the_lanes_tells_what_is_on(show, short):
    browser = show(short)
    assert lanes_at(browser, 2.0) == "all clear"
    text = lanes_at(browser, 9.8)
    spin = next(e for e in short.events if e.detector == "spin_down" and e.wheel == "fl")
    assert f"Spin-down FL: {spin.start_s:.2f} – {spin.end_s:.2f} s" in text
    assert "Resistance: " in text
    assert "Spin-up" not in text
    assert lanes_at(browser, 28.005) == "Spin-down RL: 28.00 – 28.01 s (0.01 s)"
    click(browser, ".toggle[data-group=rl]")
    wait_for(lambda: lanes_at(browser, 28.005) == "all clear")


def test_a_wheel_is_hidden_in_all_rows(show, short):
    browser = show(short)
    assert visible_groups(browser) == {"fl", "fr", "rl", "rr", "vehicle"}
    click(browser, ".toggle[data-group=fl]")
    wait_for(lambda: visible_groups(browser) == {"fr", "rl", "rr", "vehicle"})
    click(browser, "#events tbody tr")
    wait_for(lambda: x_range(browser) != [0, 30])
    assert "fl" not in visible_groups(browser)
    click(browser, ".toggle[data-group=fl]")
    wait_for(lambda: "fl" in visible_groups(browser))


def test_sorting_keeps_rows_and_their_events_together(show, short):
    from selenium.webdriver.common.by import By

    browser = show(short)
    click(browser, "#events th:nth-child(3)")
    order = [int(r.get_attribute("data-row")) for r in browser.find_elements(By.CSS_SELECTOR, "#events tbody tr")]
    starts = [short.events[i].start_s for i in order]
    assert starts == sorted(starts)
    click(browser, "#events tbody tr")
    wait_for(lambda: x_range(browser) != [0, 30])
    assert x_range(browser)[0] <= starts[0] <= x_range(browser)[1]


def test_events_are_filtered_with_their_shades(show, short):
    from selenium.webdriver.support.ui import Select

    event = next(e for e in short.events if e.detector == "spin_down" and e.wheel == "rl")
    brakes = replace(event, evidence={**event.evidence, "braking_at_start": True})
    browser = show(replace(short, events=tuple(brakes if e is event else e for e in short.events)))
    browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    labels = browser.find_elements("css selector", "#events-filters label")
    assert [label.text.split()[0] for label in labels] == ["Detector", "Where", "Braking"]
    seen = "return [...document.querySelectorAll('#events tbody tr')].filter(r => !r.hidden).map(r => Number(r.dataset.row))"
    Select(labels[2].find_element("css selector", "select")).select_by_value("while braking")
    index = [i for i, e in enumerate(short.events) if e is event]
    assert browser.execute_script(seen) == index
    wait_for(lambda: len(shade(browser, OTHER_SHADE)) == 1)
    assert shade(browser, FULL_SHADE) == shade(browser, EVENT_SHADE) == []  # of aquaplaning alone
    Select(labels[2].find_element("css selector", "select")).select_by_value("")
    Select(labels[1].find_element("css selector", "select")).select_by_value("RR")
    assert [short.events[i].wheel for i in browser.execute_script(seen)] == ["rr"] * 1
    assert (
        browser.execute_script("return document.querySelector('#events-filters [role=status]').textContent")
        == "1 of 15"
    )
    assert severe(browser) == []


def outline(browser):
    """Width and height of the plots [px], and heights of their panels."""
    script = """
      const plot = document.getElementById('plots'), box = plot.querySelector('.main-svg').getBoundingClientRect();
      return [box.width, box.height, Array.from(plot.querySelectorAll('.nsewdrag'), r => Number(r.getAttribute('height')))]"""
    return browser.execute_script(script)


def test_printing_puts_each_panel_on_paper_and_leaves_the_screen_as_it_was(show, short):
    browser = show(short)
    click(browser, "#events tbody tr")
    wait_for(lambda: x_range(browser) != [0, 30])
    screen, zoomed = outline(browser), x_range(browser)
    assert min(screen[2]) > 50
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    assert outline(browser)[0] == 700
    assert outline(browser)[1:] == screen[1:]
    sheets = browser.execute_script(
        "return [...document.querySelectorAll('.sheet')].map(s => s.querySelectorAll('svg').length)"
    )
    assert sheets == [2] * len(screen[2])
    browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
    wait_for(lambda: outline(browser) == screen)
    assert x_range(browser) == zoomed
    browser.execute_cdp_cmd("Page.printToPDF", {})
    wait_for(lambda: outline(browser) == screen)
    assert browser.execute_script("return document.querySelectorAll('.sheet').length") == 0
    assert severe(browser) == []


def click_on(browser, element):
    browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", element)
    element.click()


def y_range(browser, axis):
    return browser.execute_script("return document.getElementById('plots').layout[arguments[0]].range", axis)


def with_peak(short):
    track = next(t for t in short.tracks if t.detector == "minor_spin_down" and t.wheel == "fl")
    peak = replace(track, statistic=np.where(np.arange(3000) == 1500, 5000.0, track.statistic))
    return replace(short, tracks=(*(t for t in short.tracks if t is not track), peak))


def test_a_peak_hides_no_limit_until_it_is_asked_for(show, short):
    from selenium.webdriver.common.by import By

    browser = show(with_peak(short))
    rows = browser.execute_script("return JSON.parse(document.getElementById('drive-data').textContent).rows")
    axis = next(r["axis"] for r in rows if r["title"] == "Minor spin-down")
    assert y_range(browser, axis)[1] < 60.0  # ten times the limit of 5
    tools = browser.find_element(By.CSS_SELECTOR, ".tools[aria-label='range of Minor spin-down']")
    fit, closer, _ = tools.find_elements(By.TAG_NAME, "button")
    assert fit.text == "not shown: to 5000"
    assert "full range of Minor spin-down" in fit.get_attribute("aria-label")
    click_on(browser, fit)
    wait_for(lambda: y_range(browser, axis)[1] > 5000.0)
    assert fit.text == "fit"
    click_on(browser, fit)
    wait_for(lambda: y_range(browser, axis)[1] < 60.0)
    before = y_range(browser, axis)[1]
    click_on(browser, closer)
    wait_for(lambda: y_range(browser, axis)[1] == pytest.approx(0.5 * before))
    assert fit.text == "fit"


def test_on_a_narrow_screen_what_is_not_shown_covers_no_title(show, short):
    browser = show(with_peak(short))
    covered = """
        const box = e => e.getBoundingClientRect(), titles = [...document.querySelectorAll("#plots .annotation-text")];
        const chips = [...document.querySelectorAll(".panel-bar button")].filter(b => b.textContent.startsWith("not shown"));
        const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
        return [chips.length, titles.length, titles.filter(t => chips.some(c => meet(box(c), box(t)))).length];
    """
    try:
        metrics(browser, 390)
        main = "return document.querySelector('#plots .main-svg').getBoundingClientRect().right"
        wait_for(lambda: browser.execute_script(main) <= 390)
        wait_for(lambda: browser.execute_script("return document.querySelector('.panel-bar.narrow') !== null"))
        chips, titles, meeting = browser.execute_script(covered)
        assert chips > 0
        assert titles > 3
        assert meeting == 0
    finally:
        metrics(browser, 0)


def test_the_pointer_tells_the_values_of_all_panels(show, short):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    browser = show(short)
    area = browser.find_element(By.CSS_SELECTOR, "#plots .nsewdrag")
    ActionChains(browser).move_to_element(area).perform()
    told = "return [...document.querySelectorAll('.panel-bar .values')].map(v => v.textContent)"
    wait_for(lambda: all(browser.execute_script(told)))
    assert browser.execute_script(told)[0].startswith("v_x reference")


def metrics(browser, width):
    """Set the width of the window [px]; 0: as it was."""
    if not width:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        return
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


@pytest.mark.parametrize("width", [390, 800, 1600])
def test_nothing_is_wider_than_the_window_and_evidence_can_be_read(show, short, width):
    browser = show(short)
    try:
        metrics(browser, width)
        browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        main = "return document.querySelector('#plots .main-svg').getBoundingClientRect().right"
        wait_for(lambda: browser.execute_script(main) <= width)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
        evidence = "return document.querySelector('#events td.wide').getBoundingClientRect().width"
        assert browser.execute_script(evidence) >= 190
    finally:
        metrics(browser, 0)
        wait_for(lambda: outline(browser)[0] > 1000)


def test_the_page_by_keyboard_alone(show, short):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    browser = show(short)

    def press(*keys):
        for key in keys:
            ActionChains(browser).send_keys(key).perform()

    browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = false; })")
    summary = browser.find_element("css selector", "#event-section summary")
    browser.execute_script("arguments[0].focus()", summary)
    outlined = "return getComputedStyle(document.activeElement).outlineStyle"
    press(Keys.ENTER)
    assert browser.execute_script("return document.querySelector('#event-section details').open")
    seen = []
    for _ in range(60):
        press(Keys.TAB)
        script = "const e = document.activeElement; return [e.tagName, e.id, e.closest('.tools') ? 'tools' : '']"
        seen.append(tuple(browser.execute_script(script)))
        assert browser.execute_script(outlined) != "none", seen[-1]
        if seen[-1][2]:
            break
    tags = [s[0] for s in seen]
    assert tags.index("SELECT") < tags.index("TR") < [s[1] for s in seen].index("show-all")
    before = y_range(browser, "yaxis")
    press(Keys.ARROW_RIGHT, Keys.SPACE)  # from closer to farther
    wait_for(lambda: y_range(browser, "yaxis")[1] > before[1])
    press(Keys.TAB)
    assert browser.execute_script("return document.activeElement.closest('.tools') !== null")


def test_hour_shows_the_spike_and_every_sample_of_an_event(show):
    result = fake.make_result(3600.0)
    begun = time.monotonic()
    browser = show(result)
    assert time.monotonic() - begun < PATIENCE
    _, y = points(browser, "y4", "RL")
    assert len(y) < 8000
    assert max(v for v in y if v is not None) == pytest.approx(fake.SPIKE * 1000)
    click(browser, "#events tbody tr")
    wait_for(lambda: x_range(browser) != [0, 3600])
    begin, end = x_range(browser)
    t, _ = points(browser, "y4", "FL")
    inside = [a for a in t if begin <= a <= end]
    assert len(inside) == pytest.approx((end - begin) * 100, abs=2)
    assert severe(browser) == []


EVERY = 0.3  # [s]
MANY = 900


@pytest.fixture(scope="module")
def eventful():
    """More events than a table in the page's text holds, one by one."""
    drive = fake.make_result(300.0)
    starts = (round(EVERY * k, 6) for k in range(MANY))
    events = [
        replace(drive.events[k % len(drive.events)], start_s=t, end_s=round(t + 0.1, 6)) for k, t in enumerate(starts)
    ]
    return fake.with_events(drive, events)


def event_starts(browser):
    texts = "return Array.from(document.querySelectorAll('#events tbody td:nth-child(3)')).map(c => c.textContent)"
    return [float(t.replace("−", "-")) for t in browser.execute_script(texts)]


def check_shades(browser, result):
    """Few shapes for all events, and exact where the view is."""
    assert len(browser.execute_script("return document.getElementById('plots').layout.shapes")) < 30
    begin, end = x_range(browser)
    inside = {(e.start_s, e.end_s) for e in result.events if e.end_s >= begin and e.start_s <= end}
    assert len(inside) >= 2
    assert inside <= {(a, b) for c in (EVENT_SHADE, FULL_SHADE, OTHER_SHADE) for a, b in shade(browser, c)}


def test_thousands_of_events_by_pages_searched_sorted_and_stepped_through(show, eventful):
    browser = show(eventful)
    assert len(shade(browser, EVENT_SHADE)) > 10
    assert len(shade(browser, FULL_SHADE)) > 10
    starts = [round(e.start_s, 2) for e in eventful.events]
    count = "return document.getElementById('events-count').textContent"
    assert browser.execute_script(count) == "1–200 of 900"
    assert event_starts(browser) == starts[:200]
    click(browser, "#events-on")
    assert event_starts(browser) == starts[200:400]
    click(browser, "#events th:nth-child(3)")
    click(browser, "#events th:nth-child(3)")
    assert event_starts(browser) == starts[:-201:-1]
    click(browser, "#previous")  # the last one of the order
    wait_for(lambda: x_range(browser) != [0, 300])
    check_shades(browser, eventful)
    assert browser.execute_script(count) == "801–900 of 900"
    chosen = browser.execute_script("return document.querySelector('#events tr[aria-selected=true]').dataset.row")
    assert chosen == "0"
    search = "const s = document.getElementById('events-search'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))"
    wanted = [e for e in eventful.events if e.detector == "spin_up" and e.wheel == "rr"]
    browser.execute_script(search, "spin-up rr")
    assert browser.execute_script(count) == f"1–{len(wanted)} of {len(wanted)} found among 900"
    assert event_starts(browser) == [round(e.start_s, 2) for e in reversed(wanted)]
    browser.execute_script(search, "no such thing")
    assert browser.execute_script(count) == "no event"
    browser.execute_script(search, "")
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    assert len(event_starts(browser)) == MANY
    browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert len(event_starts(browser)) == 200
    assert severe(browser) == []
