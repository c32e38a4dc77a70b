"""The page of all figures in headless Chromium without a network: each plot is drawn, nothing is asked for."""

import pytest

from aqualog.thesis.page import panel_ids, render_figures
from tests.headless import requests, severe, wait_for
from tests.thesis.made import all_made, made

pytestmark = pytest.mark.browser


OF_EACH_KIND = ("2.1", "2.24", "3.4", "3.6", "W.1")  # lines over time and speed, a map, a space, points


@pytest.fixture(
    scope="module", params=[OF_EACH_KIND, pytest.param(None, marks=pytest.mark.nightly)], ids=["some", "all"]
)
def figures(request):
    return [made(n) for n in request.param] if request.param else all_made()


@pytest.fixture(scope="module")
def opened(browser, figures, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "figures.html"
    path.write_text(render_figures(figures, title="all figures"), encoding="utf-8")
    severe(browser), requests(browser)  # what pages before it have left
    browser.get(path.as_uri())
    wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
    yield browser
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_every_plot_is_drawn(opened, figures):
    script = """
      const plot = document.getElementById(arguments[0]);
      const box = plot.getBoundingClientRect();
      return [plot.querySelectorAll('.scatterlayer .trace').length, plot.querySelectorAll('canvas').length,
              plot._fullData.length, box.width, box.height, plot.textContent.includes('WebGL')];"""
    for figure in figures:
        for i, panel in zip(panel_ids(figure), figure.panels, strict=True):
            flat, canvases, traces, width, height, is_sorry = opened.execute_script(script, i)
            assert traces == len(panel.lines) + len(panel.sheets)
            assert width > 300
            assert height >= 380
            if panel.z:
                assert canvases == 1, i
                assert not is_sorry
            else:
                assert flat == len(panel.lines), i


def test_colours_follow_the_scheme(opened):
    colour = "return getComputedStyle(document.querySelector('#figure_3_06_a .xtitle')).fill"
    light = opened.execute_script(colour)
    opened.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    )
    wait_for(lambda: opened.execute_script(colour) != light)


def test_no_error_and_no_request(opened):
    assert severe(opened) == []
    assert requests(opened) == []
