"""Decisions: each has its date, its reason and what it rules out, and stands in the index."""

import ast
import re
import sys

import pytest

import aqualog as aq
from tests.book import decisions
from tests.conftest import ROOT


@pytest.mark.parametrize("package", decisions.pages())
def test_each_says_why_and_what_it_rules_out(package):
    for entry in re.split(r"^## ", decisions.pages()[package], flags=re.M)[1:]:
        assert re.match(r"\d{4}-\d\d-\d\d \S", entry)
        assert re.search(r"^Why: \S", entry, re.M), entry.splitlines()[0]
        assert re.search(r"^Rules out: \S", entry, re.M), entry.splitlines()[0]


def test_the_index_is_that_of_the_pages():
    found = (decisions.FOLDER / "index.md").read_text(encoding="utf-8")
    assert found == decisions.index(), "run `python -m tests.book.decisions`"


def test_the_table_of_layers_is_that_of_the_tests():
    tree = ast.parse((ROOT / "tests" / "test_layers.py").read_text(encoding="utf-8"))
    order = next(n.value for n in tree.body if isinstance(n, ast.Assign) and n.targets[0].id == "ORDER")
    text = (ROOT / "aqualog" / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", text, re.M)
    assert re.findall(r"`(\w+)`", " ".join(rows)) == [e.value for e in order.elts]


def test_the_way_of_a_channel_is_the_one_that_it_takes():
    text = (ROOT / "aqualog" / "docs" / "architecture.md").read_text(encoding="utf-8")
    way = text.split("## An MDF channel")[1].split("\n## ")[0]
    package = ROOT / "aqualog"
    assert all((package / name).exists() for name in re.findall(r"`([\w/]+\.py)`", way))
    steps = re.findall(r"^\d+\. `([\w/]+\.py)`: `(\w+)`", way, re.M)
    assert 10 <= len(steps) <= 15
    called: dict[tuple[str, str], int] = {}

    def note(frame, event, _):
        if event == "call" and frame.f_code.co_filename.startswith(str(package)):
            name = frame.f_code.co_filename.removeprefix(f"{package}/")
            called.setdefault((name, frame.f_code.co_name), len(called))

    samples = ROOT / "sample_logs"
    sys.setprofile(note)
    try:
        aq.detect(samples / "lane_drive.mf4", samples / "vehicle.toml")
    finally:
        sys.setprofile(None)
    order = [called[step] for step in steps]
    assert order == sorted(order)
