"""The page of an evaluation in headless Chromium: the answer and the heat maps first, the rest folded, nothing too wide."""

import pytest

from aqualog.detect.registry import DETECTORS, RIVALS
from aqualog.detect.thresholds import DEFAULT
from aqualog.evaluate.records import Cell, DetectorRun, Hit, RunRecord
from aqualog.evaluate.run import Evaluation
from aqualog.report.evaluation import evaluation_report
from aqualog.report.page import report_page, write_page
from aqualog.report.text import report_text
from tests.headless import wait_for

SCREEN = {"width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": False}
WIDER = "return [...document.querySelectorAll('.scroll')].filter(s => s.scrollWidth > s.clientWidth + 1).length"


def record(i):
    hits = (Hit(found=i % 3 > 0, latency=0.4, before=False),) if i < 12 else ()
    cells = {"partial" if hits else "none": Cell(1, 1, 3, 12.0)}
    run = DetectorRun(partial=hits, wheel_partial=hits, false_alarms=(1.0,) * (i % 4), cells=cells)
    groups = {"manoeuvre": f"situation_{i}", "tyre": f"tyre {i}"}
    return RunRecord(f"{i}.mf4", groups, 600.0, 500.0, 1e4, 5.0, dict.fromkeys((*DETECTORS, *RIVALS), run))


@pytest.fixture(scope="module")
def report():
    return evaluation_report(Evaluation(tuple(map(record, range(40))), DEFAULT, None), by=("tyre",))


@pytest.mark.browser
def test_four_screens_folded_and_no_table_wider_than_the_window(browser, report, tmp_path):
    write_page(tmp_path / "page.html", report_page(report, title="40 situations"))
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", SCREEN)
    try:
        browser.get((tmp_path / "page.html").as_uri())
        wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
        assert browser.execute_script("return document.documentElement.scrollHeight") <= 4 * SCREEN["height"]
        assert browser.execute_script("return document.documentElement.scrollWidth") <= SCREEN["width"]
        browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        width = "return document.querySelector('#latency-partial .main-svg').getBoundingClientRect().width"
        room = browser.execute_script("return document.getElementById('latency-partial').clientWidth")
        assert room > 400
        wait_for(lambda: abs(browser.execute_script(width) - room) < 2)
        assert browser.execute_script(WIDER) == 0
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_heat_maps_stand_before_tables_and_columns_without_a_value_are_left_out(report):
    page = report_page(report, title="x")
    order = [page.index(f'id="{name}"') for name in ("alarm-matrix", "scores", "configurations", "confusion")]
    assert order == sorted(order)
    assert page.count("<table") == 3
    assert "Full within" not in page.split('id="scores"')[1].split("</table>")[0]
    assert report_text(report).count("(1 drive)") == 40


def test_what_was_on_before_an_episode_is_said_beside_what_was_found():
    early, late = (Hit(found=True, latency=0.1 * (not x), before=x) for x in (True, False))
    run = DetectorRun(full=(early, early), partial=(late, early, late), wheel_partial=(late,))
    one = RunRecord("a.mf4", {}, 600.0, 500.0, 1e4, 5.0, {"joint_criteria": run})
    text = report_text(evaluation_report(Evaluation((one,), DEFAULT, None)))
    assert "found 2/2 (100 %) of full aquaplaning within 0.5 s (all already on before), " in text
    assert "found 3/3 (100 %) of partial aquaplaning within 2 s (1 already on before), raised" in text
    assert "100 / 33" in text
