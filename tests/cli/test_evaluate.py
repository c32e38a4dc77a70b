"""`aqualog evaluate` as a user calls it."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import polars as pl
import pytest

from tests import commands
from tests.commands import error_lines
from tests.evaluate.made import write_campaign

SAMPLES = Path(__file__).parents[2] / "sample_logs"


def run(*args):
    return commands.run("evaluate", *args)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("evaluate")
    write_campaign(path)
    (path / "dry.csv.labels").write_text("start_s,end_s,effect,wheel\n")
    return path


@pytest.fixture(scope="module")
def whole(folder):
    page = folder / "page.html"
    return run(folder / "campaign.toml", "--by", "tyre", "--rivals", "--roc", "--json", "-o", page), page


def test_a_broken_log_is_told_and_the_others_are_evaluated(whole):
    result, _ = whole
    assert result.exit_code == 3, result.stderr
    lines = error_lines(result)
    assert len(lines) == 1
    assert "broken.mf4" in lines[0]


def test_json_is_one_document(whole):
    document = json.loads(whole[0].stdout, parse_constant=lambda c: pytest.fail(c))
    assert document["drives"]["evaluated"] == 4
    assert list(document["drives"]["failed"]) == ["broken.mf4"]
    joint = document["detectors"]["joint_criteria"]
    assert joint["full"]["episodes"] == 2  # both deep lanes stop a wheel
    assert joint["full"]["found"] == 2
    assert joint["full"]["latency_median_s"] < 0.5
    assert joint["false_alarms"]["count"] == 0
    assert joint["false_alarms"]["hours"] * 3600 == pytest.approx(4 * 12.0 - 3 * (3.5 + 1.0), abs=0.5)
    assert [b["groups"]["tyre"] for b in document["by"]] == ["new_winter", "worn_summer"]
    assert sum(b["detectors"]["joint_criteria"]["drives"] for b in document["by"]) == 4
    assert {"full", "partial", "water only", "none"} <= set(document["confusion"])
    assert set(document["situations"]) == {"lane", "dry road"}
    assert {p["detector"] for p in document["roc"]} >= {"spin_down", "joint_cusum", "wheel_thresholds"}
    assert document["rivals"] == {}
    assert document["tuning"] is None
    assert [r["name"] for r in document["runs"]] == ["deep.mf4", "dry.csv", "deep2.parquet", "slow.mcap"]


def test_page_needs_no_network(whole):
    text = whole[1].read_text(encoding="utf-8")
    assert text.count("<script") == 3
    assert "http-equiv" in text
    assert "src=" not in text.split("<script>")[0]
    head = text[: text.index('<script type="application/json"')]
    assert "short drives" in head
    assert (
        head.index('class="headline"')
        < head.index('id="recall-matrix"')
        < head.index('id="scores"')
        < head.index('id="confusion"')
    )
    assert "of full aquaplaning within 0.5 s" in head
    assert "broken.mf4" in head
    assert "rival" in head
    figures = json.loads(text.split('id="figure-data">')[1].split("</script>")[0])
    assert set(figures) == {
        "recall-matrix",
        "alarm-matrix",
        "roc-full",
        "roc-partial",
        "latency-full",
        "latency-partial",
    }
    assert figures["alarm-matrix"]["data"][0]["y"] == ["lane", "dry road"]


def test_tuning_writes_thresholds_that_can_be_used(folder):
    target = folder / "tuned.toml"
    result = run(folder / "campaign.toml", "--tune", target, "--json")
    assert result.exit_code == 3, result.stderr
    tuning = json.loads(result.stdout)["tuning"]
    assert not set(tuning["tuned_on"]) & set(tuning["reported_on"])
    assert {r["name"] for r in json.loads(result.stdout)["runs"]} == set(tuning["reported_on"])
    assert "no vehicle and no tyre is in both parts" in tuning["rule"]
    assert "[thresholds]" in target.read_text()
    again = run(folder / "campaign.toml", "--tune", target)
    assert again.exit_code == 2
    assert "--force" in error_lines(again)[0]
    used = run(folder / "campaign.toml", "--thresholds", target, "--json")
    assert used.exit_code == 3
    assert json.loads(used.stdout)["thresholds"] == json.loads(result.stdout)["thresholds"]


def test_logs_with_a_labels_file(folder):
    labels = folder / "labels.csv"
    labels.write_text("start_s,end_s,effect,wheel\n5.0,9.0,water,\n5.2,8.5,full,fl\n10,11,puddle of mud,\n")
    result = run(folder / "deep.mf4", "--vehicle", folder / "rwd.toml", "--labels", labels, "-v")
    assert result.exit_code == 0, result.stderr
    assert "puddle of mud enter the confusion table only" in result.stderr
    row = next(line for line in result.stdout.splitlines() if line.startswith("spin down"))
    assert "1/1 (100 %)" in row
    shifted = folder / "shifted.csv"
    shifted.write_text("start_s,end_s,effect,wheel\n10.5,11.5,full,fl\n")
    missed = run(folder / "deep.mf4", "--vehicle", folder / "rwd.toml", "--labels", shifted, "--json")
    joint = json.loads(missed.stdout)["detectors"]["joint_criteria"]
    assert joint["full"]["found"] == 0
    assert joint["false_alarms"]["count"] >= 1


def test_a_label_after_the_end_of_the_log_is_told_and_left_out(folder):
    labels = folder / "late.csv"
    labels.write_text("start_s,end_s,effect,wheel\n5.2,8.5,full,fl\n40,50,full,fl\n60,61,water,\n11,20,snow,\n")
    args = (folder / "deep.mf4", "--vehicle", folder / "rwd.toml", "--labels", labels)
    result = run(*args, "--json")
    assert result.exit_code == 3, result.stderr
    assert "2 labels begin after the log's end at 12 s, at 40 s; left out" in error_lines(result)[0]
    joint = json.loads(result.stdout)["detectors"]["joint_criteria"]
    assert joint["full"]["episodes"] == joint["partial"]["episodes"] == 1
    assert "labels are cut where the log ends, at 12 s" in run(*args, "-v").stderr


def test_logs_without_water_share_an_empty_labels_file(folder):
    result = run(
        folder / "dry.csv",
        folder / "slow.mcap",
        "--vehicle",
        folder / "rwd.toml",
        "--labels",
        folder / "dry.csv.labels",
        "--json",
    )
    assert result.exit_code == 0, result.stderr
    rate = json.loads(result.stdout)["detectors"]["joint_criteria"]["false_alarms"]
    assert rate["hours"] * 3600 == pytest.approx(24.0, abs=0.1)


@pytest.mark.parametrize(
    ("args", "code", "text"),
    [
        (("dry.csv",), 2, "no vehicle"),
        (("campaign.toml", "dry.csv"), 2, "stands among other inputs"),
        (("campaign.toml", "--vehicle", "rwd.toml"), 2, "beside a campaign"),
        (("campaign.toml", "--by", "tire"), 2, 'did you mean "tyre"'),
        (("gone.toml",), 2, "not found"),
        (("dry.csv", "deep.mf4", "--vehicle", "rwd.toml", "--labels", "one.csv"), 2, "one labels file for 2 logs"),
        (("broken.mf4", "--vehicle", "rwd.toml"), 4, "broken.mf4"),
        (("campaign.toml", "-o", "runs.csv"), 2, "source of this very run"),
        (("campaign.toml", "-o", "one.csv"), 2, "exists already"),
    ],
)
def test_what_cannot_be_done_is_one_line(folder, args, code, text):
    (folder / "one.csv").write_text("start_s,end_s,effect,wheel\n1,2,water,\n")
    result = run(*(folder / a if "." in a else a for a in args))
    assert result.exit_code == code, result.stderr
    lines = error_lines(result)
    assert len(lines) == 1
    assert text in lines[0]
    assert result.stdout == ""


def test_gates_decide_the_exit_code_and_go_to_the_build_server(folder, tmp_path):
    xml, given = tmp_path / "gates.xml", (folder / "campaign.toml", "--json", "--csv", tmp_path / "scores.csv")
    done = run(*given, "--gate", "joint_criteria.full.recall>=1", "--gate", "joint_criteria.drives>=5", "--junit", xml)
    assert done.exit_code == 5, done.stderr
    document = json.loads(done.stdout)
    assert [(g["value"], g["kept"]) for g in document["gates"]] == [(1.0, True), (4.0, False)]
    gates, drives = ET.parse(xml).getroot()
    assert [len(case.findall("failure")) for case in gates] == [0, 1]
    assert [c.get("name") for c in drives if c.find("error") is not None] == ["broken.mf4"]
    scores = pl.read_csv(tmp_path / "scores.csv")
    assert dict(scores.select("detector", "full_recall").rows())["joint_criteria"] == 1.0
    kept = run(folder / "campaign.toml", "--gate", "joint_criteria.drives>=4")
    assert kept.exit_code == 3
    assert "joint_criteria.drives>=4" in kept.stdout


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--gate", "joint_criterion.recall>=1"), 'did you mean "joint_criteria"'),
        (("--junit", "j.xml"), "without --gate"),
    ],
)
def test_a_wrong_gate_is_refused_before_any_work(folder, options, text):
    done = run(folder / "gone.toml", *options)
    assert done.exit_code == 2
    assert text in error_lines(done)[0]


def test_inputs_that_do_not_fit_are_named_with_alarms_and_runs(tmp_path):
    map_ = (SAMPLES / "map_csv.toml").read_text(encoding="utf-8")
    (tmp_path / "map.toml").write_text(map_.replace('"v_Referenz"', '{ channel = "v_Referenz", scale = -1.0 }'))
    (tmp_path / "dry.csv").write_text("start_s,end_s,effect,wheel\n")
    given = (SAMPLES / "lane_drive.csv", "--signals", tmp_path / "map.toml", "--vehicle", SAMPLES / "vehicle.toml")
    for found in (
        run(*given, "--labels", tmp_path / "dry.csv"),
        commands.run("batch", *given, "-o", tmp_path / "store"),
    ):
        assert "Check the inputs of 1 of 1 log first: " in found.stdout
        assert "lane_drive.csv (v_x). Alarms and verdicts may change" in found.stdout
    assert "tie_rod          -       no run can be judged" in found.stdout
