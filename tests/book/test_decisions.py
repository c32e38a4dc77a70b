"""Decisions: each has its date, its reason and what it rules out, and stands in the index."""

import ast
import re

import pytest

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
