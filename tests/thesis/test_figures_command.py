"""`aqualog figures`: what it writes and says."""

import json
from importlib import import_module

import pytest
from typer.testing import CliRunner

from aqualog.cli.main import app
from aqualog.thesis.claims import VERDICTS
from aqualog.thesis.evidence.selection import NotInCampaign


def run(*words):
    return CliRunner().invoke(app, ["figures", *map(str, words)])


def test_one_figure(tmp_path):
    result = run("3.1", "-o", tmp_path / "out")
    assert result.exit_code == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["figure_3_01.csv", "figure_3_01.html"]
    head, *rows = result.stdout.splitlines()
    assert head.split() == ["claim", "figure", "verdict", "found"]
    assert [r.split()[:2] for r in rows] == [["C81", "3.1"], ["C82", "3.1"]]
    assert "2 files are in" in result.stderr
    assert (tmp_path / "out/figure_3_01.csv").read_text().splitlines()[0].startswith("slip [%],dry asphalt: ")


def test_no_figure_leaves_no_folder(tmp_path, monkeypatch):
    def make(number, _):
        raise NotInCampaign(f"figure {number}: no such run")

    monkeypatch.setattr(import_module("aqualog.thesis.run"), "make", make)
    result = run("3.1", "-o", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (4, "")
    assert result.stderr.count("no such run") == 1
    assert "files are in" not in result.stderr
    assert not (tmp_path / "out").exists()


def test_several_figures_and_json(tmp_path):
    result = run("3.3", "3.1", "-o", tmp_path, "--json", "--progress", "plain", "-v")
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert [f["figure"] for f in document["figures"]] == ["3.1", "3.3"]
    assert document["figures"][0]["findings"][0]["claim"] == "C81"
    assert document["figures"][0]["findings"][0]["verdict"] in VERDICTS
    names = ["figure_3_01.html", "figure_3_01.csv", "figure_3_03.html", "figure_3_03.csv", "figures.html"]
    assert document["files"] == [str(tmp_path / n) for n in names]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names)
    assert "figure 3.1 (1 of 2)" in result.stderr
    assert "findings in" in result.stderr
    page = (tmp_path / "figures.html").read_text(encoding="utf-8")
    assert page.count("plotly.js v") == 1


def test_results_are_not_overwritten(tmp_path):
    (tmp_path / "figure_3_01.csv").write_text("mine")
    result = run("3.1", "-o", tmp_path)
    assert result.exit_code == 2
    assert "exists already" in result.stderr
    assert (tmp_path / "figure_3_01.csv").read_text() == "mine"
    assert run("3.1", "-o", tmp_path, "--force", "-q").exit_code == 0
    assert (tmp_path / "figure_3_01.csv").read_text() != "mine"


def test_quiet_says_nothing(tmp_path):
    assert run("3.1", "-o", tmp_path, "-q").stderr == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["3.12"], "3.11"),
        (["2.26"], "2.1 to 2.25"),
        (["2.3"], "made from the runs of a campaign"),
        (["3.1", "--format", "html,gif"], "html,csv,png,svg"),
        (["3.1", "--store", "s"], "--store without --campaign"),
        (["2.3", "--campaign", "runs.csv"], "is no campaign file"),
        (["x"], "all, 2, 3 or one of 2.1 to 2.25"),
        (["3.1", "9"], "'9'"),
    ],
)
def test_unknown_number_is_one_line_and_exit_2(tmp_path, words, said):
    result = run(*words, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_help_has_examples():
    text = run("--help").stdout
    assert "aqualog figures 3.6 -o figures" in text
    assert "figure_3_06.html" in text


def test_sentences_are_whole_where_nobody_looks_at_a_terminal(tmp_path):
    done = run("2.24", "-o", tmp_path / "f")
    assert done.exit_code == 0, done.output
    assert "criterion 4 alone gives no warning, which is" in done.output
    assert "… #" not in done.output
