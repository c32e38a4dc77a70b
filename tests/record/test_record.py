"""Records are compared without tolerance, prose apart from results; tables and documents give their values."""

import json

import pytest

from aqualog.cli.commands import COMMANDS
from tests.record.__main__ import main
from tests.record.cases import CASES
from tests.record.compare import changes
from tests.record.values import masked, values_of


@pytest.mark.parametrize(
    ("old", "new", "results", "wording"),
    [
        ({"x": 0.1}, {"x": 0.1 + 1e-15}, 1, 0),
        ({"x": float("nan")}, {"x": float("nan")}, 0, 0),
        ({"x": 1}, {"x": 1.0}, 0, 0),
        ({"x": 1}, {"x": True}, 1, 0),
        ({"x": None}, {}, 1, 0),
        ({"verdict": "named"}, {"verdict": "unexplained"}, 1, 0),
        ({"note": "told"}, {"note": "reported"}, 0, 1),
        ({"notes": [{"of": "a"}]}, {"notes": [{"of": "b"}]}, 0, 1),
        ({"notes": ["a"]}, {"notes": ["a", "b"]}, 1, 0),
        ({"x": "what is told of it"}, {"x": "what it reports"}, 0, 1),
        ({"it is not told where": 3}, {"where it was is not known": 3}, 0, 1),
        ({"it is not told where": 3}, {"where it was is not known": 4}, 1, 1),
        ({"tool_version": "0.10.0"}, {"tool_version": "0.11.0"}, 0, 0),
    ],
)
def test_changes(old, new, results, wording):
    found = list(changes(old, new))
    assert sum(not c.is_wording for c in found) == results
    assert sum(c.is_wording for c in found) == wording


def test_other_numbers_in_words_are_seen():
    (change,) = changes({"note": "12.5 s of 24 s were lost"}, {"note": "24 s of the drive, 12.6 s lost"})
    assert change.has_other_numbers
    (change,) = changes({"note": "12.5 s of 24 s were lost"}, {"note": "lost: 24 s less 12.5 s"})
    assert not change.has_other_numbers


def test_keys_are_masked_and_decimals_are_not():
    assert masked('"c924ac1d7234b26758ef3bc76997829b", 0.00012345678901234567890') == '"KEY", 0.00012345678901234567890'


def test_table_written_by_a_german_spreadsheet(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("t;v\n0,1;2\n", encoding="utf-8")
    assert values_of(path) == {"rows": 1, "cells": {"0 t": ["0,1"], "1 v": ["2"]}}


def test_every_command_has_a_case():
    named = {c.line.split()[0] for c in CASES}
    assert set(COMMANDS) - {"help"} <= named
    assert len({c.name for c in CASES}) == len(CASES)


def test_compare_prints_a_table_and_a_code(tmp_path, capsys):
    for name, value in (("a", 1.0), ("b", 2.0)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "case.json").write_text(json.dumps({"document": {"x": value}}))
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "a")]) == 0
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "b")]) == 1
    assert "1 cases: 0 equal, 0 wording only, 1 changed results" in capsys.readouterr().out
