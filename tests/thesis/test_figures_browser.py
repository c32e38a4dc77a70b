"""The page of all figures in headless Chromium without a network: each plot is drawn, nothing is asked for."""

import json
import os
import shutil
import time

import pytest

from aqualog.thesis.page import panel_ids, render_figures
from tests.thesis.made import all_made

pytestmark = pytest.mark.browser

# figures in space are drawn by software where there is no graphics card
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1400,1200",
)  # fmt: skip
PATIENCE = 90.0  # [s] a loaded machine draws slowly
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    binary = next((p for n in BROWSERS if (p := shutil.which(n))), None)
    if not (binary and shutil.which("chromedriver")):
        if os.environ.get("CI"):
            pytest.fail("chromium or chromedriver not found, and the browser tests must run in CI")
        pytest.skip("chromium or chromedriver not found")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.execute_cdp_cmd("Network.enable", {})
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    driver.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def opened(browser, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "figures.html"
    path.write_text(render_figures(all_made(), title="all figures"), encoding="utf-8")
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get(path.as_uri())
    end = time.monotonic() + PATIENCE
    while not browser.execute_script("return document.body.dataset.ready === 'true'"):
        assert time.monotonic() < end, "the page did not get there in time"
        time.sleep(0.1)
    return browser


def test_every_plot_is_drawn(opened):
    script = """
      const plot = document.getElementById(arguments[0]);
      const box = plot.getBoundingClientRect();
      return [plot.querySelectorAll('.scatterlayer .trace').length, plot.querySelectorAll('canvas').length,
              plot._fullData.length, box.width, box.height, plot.textContent.includes('WebGL')];"""
    for figure in all_made():
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
    end = time.monotonic() + PATIENCE
    while opened.execute_script(colour) == light:
        assert time.monotonic() < end, "the plots stay light"
        time.sleep(0.1)


def test_no_error_and_no_request(opened):
    log = [e for e in opened.get_log("browser") if e["level"] == "SEVERE" or "Content Security" in e["message"]]
    assert log == []
    messages = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    assert [u for u in urls if not u.startswith(("file:", "data:", "blob:"))] == []
