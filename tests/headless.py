"""A headless Chromium without a network, for the tests of pages."""

import json
import os
import shutil
import time

import pytest

# figures in space are drawn by software where there is no graphics card
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1400,2000",
)  # fmt: skip
PATIENCE = 90.0  # [s] a loaded machine draws slowly


def absent():
    """What stands in the way of opening a browser, or nothing."""
    names = {"chromium": ("chromium", "chromium-browser", "google-chrome"), "chromedriver": ("chromedriver",)}
    return [what for what, found in names.items() if not any(shutil.which(n) for n in found)]


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    missing = absent()
    if missing:
        reason = f"{' and '.join(missing)} not found"
        if os.environ.get("CI"):
            pytest.fail(f"{reason}, and the browser tests must run in CI")
        pytest.skip(reason)
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = next(
        p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))
    )
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    options.unhandled_prompt_behavior = "ignore"
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.execute_cdp_cmd("Network.enable", {})
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    driver.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    yield driver
    driver.quit()


def wait_for(condition, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.05)
    pytest.fail("the page did not get there in time")


def click(browser, selector):
    from selenium.webdriver.common.by import By

    browser.find_element(By.CSS_SELECTOR, selector).click()


def requests(browser):
    """Addresses that were asked for beside the page itself."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    # the browser's own start page may still be loading its icons
    return [u for u in urls if not u.startswith(("file:", "data:", "blob:", "chrome:"))]


def severe(browser):
    return [e for e in browser.get_log("browser") if e["level"] == "SEVERE" or "Content Security" in e["message"]]
