"""The page of `slip-slope`: what it holds, and that a browser draws it without a network."""

import json
import re
from dataclasses import replace

import pytest

from aqualog.detect.slip_slope.direct import slip_slopes
from aqualog.report.page import report_fragment, report_page, write_page
from aqualog.report.slope import slope_report
from tests.headless import requests, severe, wait_for
from tests.straight_drive import AWD, RWD, drive

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def found():
    return slip_slopes(drive(RWD), RWD)


def render_slope_page(result, title, notes=()):
    return report_page(slope_report(result, notes), title=title)


def data_of(html):
    return json.loads(re.search(r'<script type="application/json" id="figure-data">(.*?)</script>', html, re.S)[1])


def test_page_has_its_plots(found):
    plots = data_of(render_slope_page(found, title="run"))
    assert list(plots) == ["scatter-0", "scatter-1", "scatter-2", "session", "recursive", "share"]
    scatter = {t["name"]: t for t in plots["scatter-0"]["data"]}
    assert f"slope {found.places[0].line.slope:.1f}" in scatter
    assert len(scatter["samples"]["x"]) <= 4000
    parts = plots["session"]["data"][0]
    assert len(parts["x"]) == len(found.places[0].segments)
    assert all(a > 0.0 for a in parts["error_y"]["array"])
    share = plots["share"]["data"]
    assert sum(t["x"][0] for t in share) == pytest.approx(found.duration_s, abs=0.1)


def test_band_holds_the_line(found):
    plots = data_of(render_slope_page(found, title="run"))
    traces = {t["name"]: t for t in plots["scatter-0"]["data"]}
    band, line = traces["95 % of the slope"], traces[f"slope {found.places[0].line.slope:.1f}"]
    n = len(line["y"])
    upper, lower = band["y"][:n], band["y"][n:][::-1]
    assert all(a <= m + 1e-9 and m - 1e-9 <= b for a, m, b in zip(lower, line["y"], upper, strict=True))
    assert upper[-1] - lower[-1] > 0.0


def test_recursive_estimate_alone_makes_a_page():
    signals = drive(AWD)
    result = slip_slopes(replace(signals, frame=signals.frame.drop("v_x")), AWD)
    html = render_slope_page(result, title="run")
    assert list(data_of(html)) == ["recursive"]
    assert "<td>left</td>" in html


def test_delay_and_reasons_are_on_the_page():
    result = slip_slopes(drive(AWD, speeds=(12.0, 38.0), late_v=0.1), AWD)
    first = result.places[0]
    none = replace(first, line=replace(first.line, reason="no reason at all"))
    html = render_slope_page(replace(result, places=(none, *result.places[1:])), title="run")
    assert html.count("v_x is late by +0.1") == 3
    assert "not estimated: no reason at all" in html


@pytest.mark.browser
def test_browser_draws_it_without_requests(browser, found, tmp_path):
    path = tmp_path / "page.html"
    write_page(path, render_slope_page(found, title=HOSTILE))
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get(path.as_uri())
    wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
    assert browser.execute_script("return document.querySelectorAll('.panel .main-svg').length") >= 6
    assert browser.execute_script("return document.querySelectorAll('#scatter-0 .scatterlayer .point').length") > 1000
    assert requests(browser) == []
    assert severe(browser) == []


FITS = """
return [...document.querySelectorAll('.js-plotly-plot')].every(p => {
  const box = e => e.getBoundingClientRect(), legend = p.querySelector('.legend'), title = p.querySelector('.xtitle');
  const isApart = !legend || !title || (box(legend).top >= box(title).bottom && box(legend).bottom <= box(p).bottom + 1);
  return Math.abs(box(p.querySelector('.svg-container')).width - p.clientWidth) <= 1 && isApart;
}) && document.documentElement.scrollWidth <= window.innerWidth
"""


@pytest.mark.browser
def test_figures_follow_the_width_of_the_window(browser, found, tmp_path):
    path = tmp_path / "page.html"
    write_page(path, render_slope_page(found, title="run"))
    try:
        browser.get(path.as_uri())
        wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
        for width in (390, 1400):
            size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            wait_for(lambda: browser.execute_script(FITS), 15.0)
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_notebook_shows_the_sections_without_figures(found):
    html = report_fragment(slope_report(replace(found, vehicle_name=HOSTILE), (HOSTILE,)))
    assert "<h2>Over the session</h2>" in html
    assert f"{found.places[0].line.slope:.1f}" in html
    assert html.count("<table") == 2
    assert not re.search('<(script|style|img|html)|class="panel', html)
