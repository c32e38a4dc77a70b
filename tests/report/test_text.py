"""Tables for a terminal."""

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
