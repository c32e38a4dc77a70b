"""Tables for a terminal."""

import pytest

from aqualog.report.drive.judged import EPISODE_HEADS
from aqualog.report.page import report_page
from aqualog.report.sections import Report, Section, Table
from aqualog.report.text import report_text, table

LONG = " ".join(["remark"] * 40)


def test_a_column_of_sentences_goes_on_below():
    lines = table(("name", "n", "remark"), [("a", "3", LONG), ("b", "10", "")], wrapped={2: 60}).splitlines()
    assert lines[0] == "name  n   remark"
    assert lines[1].startswith("a      3  remark remark")
    assert all(line.startswith(" " * 10 + "remark") and len(line) <= 70 for line in lines[2:-1])
    assert lines[-1] == "b     10"
    assert " ".join(line[10:] for line in lines[1:-1]) == LONG


def test_sentences_are_whole_and_brief_ones_are_their_first_phrases():
    def text(**how):
        rows = [("a", LONG.replace(" ", "; ") + "; more"), ("b", "x m/s^2")]
        return report_text(Report("", "", [Section("", [Table(("Name", "Remark"), rows, wide=(1,), **how)])], []))

    assert text().replace("\n", " ").count("remark") == 41
    assert "more" in text()
    assert text(brief=(1,)).splitlines()[1].endswith("; ...")
    assert "x m/s²" in text()


@pytest.mark.browser
def test_wide_tables_fit_a_window_of_1300(browser, tmp_path):
    sets = ["Set", "Valid", "Speed of 15 % slip [km/h]", "95 %", "CV [%]", "v_05 [km/h]", "First minor spin-down [km/h]",
            "Drop of the slip slope [km/h]", "Index", "95 % "]  # fmt: skip
    one = ["single detector", "1009.00", "1014.00", "front left, rear right", "partial", "71.0 … 88.0", "0.25",
           "-10.0 … 20.0", "98.0", "12", "minor spin-down"]  # fmt: skip
    tables = [
        Table(sets, [["worn_summer · hatch_fwd · 2.3 control", *["64.4 … 65.9"] * 9]], "set-table"),
        Table(EPISODE_HEADS, [one], "more-episodes", (0, 3, 4, 10), wide=(10,), is_sortable=True),
    ]
    page = tmp_path / "page.html"
    page.write_text(report_page(Report("a", "b", [Section("", tables)]), title="t"), encoding="utf-8")
    size = {"width": 1300, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(page.as_uri())
    wide = "return [...document.querySelectorAll('.scroll')].filter(s => s.scrollWidth > s.clientWidth).length"
    found = browser.execute_script(wide)
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert found == 0
