"""`aqualog diagnose` as a user runs it; the diagnosis itself is made by hand."""

import json
import os
import sys
from dataclasses import replace
from types import ModuleType

import pytest

from aqualog.config.model import load_model
from aqualog.core.errors import SignalError
from aqualog.diagnose import run as engine
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from tests import commands
from tests.diagnose.stand_in import Engine, write_drives
from tests.report.diagnosis_case import cases


@pytest.fixture
def folder(tmp_path):
    return write_drives(tmp_path)


@pytest.fixture
def run(folder, monkeypatch):
    made = Engine()
    monkeypatch.setattr(engine, "diagnose", made)

    def call(*args, vehicle=True):
        given = ["--vehicle", folder / "car.toml"] if vehicle else []
        return commands.run("diagnose", *args, *given)

    call.engine = made
    return call


def test_verdict_first(run, folder):
    code, text, err = run(folder / "a.parquet")
    assert code == 0, err
    assert text.startswith("The car weighed 262 kg more than the vehicle file says.\n")
    assert "240 ... 285" in text
    assert "note: The noise model is of order 18." in err
    assert run(folder / "a.parquet", "-q")[2] == ""


def test_json_page_and_model(run, folder):
    out, page = folder / "model.toml", folder / "page.html"
    code, text, err = run(folder / "a.parquet", folder / "b.parquet", "-o", out, "--page", page, "--json")
    assert code == 0, err
    d = json.loads(text)
    assert d["verdict"] == "named"
    assert d["drives"] == ["a.parquet", "b.parquet"]
    assert d["logs"] == [str(folder / "a.parquet"), str(folder / "b.parquet")]
    assert d["extended_model"] == str(out)
    assert load_model(out) == cases()["named"].model
    head = out.read_text(encoding="utf-8").splitlines()
    assert head[1] == "# Verdict named: The car weighed 262 kg more than the vehicle file says."
    assert head[2:4] == ["# Drive: a.parquet", "# Drive: b.parquet"]
    html = page.read_text(encoding="utf-8")
    assert 'http-equiv="Content-Security-Policy"' in html
    assert "car, a.parquet, b.parquet" in html
    assert 'id="views"' in html


def test_the_same_twice(run, folder):
    texts = []
    for _ in range(2):
        run(folder / "a.parquet", "-o", folder / "m.toml", "--page", folder / "p.html", "--force")
        texts.append([(folder / n).read_bytes() for n in ("m.toml", "p.html")])
    assert texts[0] == texts[1]


@pytest.mark.parametrize("verdict", list(cases()))
def test_each_verdict_is_a_result(run, folder, verdict):
    run.engine.verdict = verdict
    code, text, err = run(folder / "a.parquet", "--json", "-o", folder / f"{verdict}.toml")
    assert code == 0, err
    assert json.loads(text)["verdict"] == verdict
    assert load_model(folder / f"{verdict}.toml") == cases()[verdict].model
    base = "base model" in (folder / f"{verdict}.toml").read_text(encoding="utf-8")
    assert base == (verdict in ("no_effect", "not_testable"))


def test_what_the_engine_is_asked(run, folder):
    model = Model((Term(EFFECTS["head_wind"], {"speed": 2.0}),))
    (folder / "known.toml").write_text('[[term]]\neffect = "head_wind"\nspeed = 2.0\n', encoding="utf-8")
    run(
        folder / "a.parquet", "--holdout", folder / "b.parquet", "--holdout", folder / "c.parquet", "--seed", 7,
        "--level", 0.05, "--surrogates", 39, "--model", folder / "known.toml", "--page", folder / "p.html",
    )  # fmt: skip
    drives, holdout, vehicle, known, options = run.engine.asked[0]
    assert (drives, holdout) == (["a.parquet"], ["b.parquet", "c.parquet"])
    assert vehicle.name == "car"
    assert known == model
    assert (options.seed, options.level, options.surrogates, options.views) == (7, 0.05, 39, True)
    run(folder / "a.parquet", "--no-bootstrap")
    assert run.engine.asked[1][4].surrogates == 0
    assert not run.engine.asked[1][4].views
    run(folder / "a.parquet")
    assert run.engine.asked[2][4] == engine.Options(views=False)


def test_a_folder_is_one_drive_and_names_are_unique(run, folder):
    (folder / "one").mkdir()
    (folder / "two").mkdir()
    for name, where in (("a", "one"), ("b", "one"), ("c", "two")):
        (folder / f"{name}.parquet").rename(folder / where / f"{name}.parquet")
    (folder / "two" / "c.parquet").rename(folder / "two" / "a.parquet")
    one = folder / "one"
    run(one / "a.parquet", "--holdout", folder / "two" / "a.parquet")
    assert run.engine.asked[0][:2] == ([str(one / "a.parquet")], [str(folder / "two" / "a.parquet")])


def test_a_broken_log_is_told_and_the_others_go_on(run, folder):
    (folder / "broken.mf4").write_bytes(b"MDF     4.10" + b"\0" * 90)
    (folder / "one.csv").write_text("t [s],v_x [m/s]\n0,20\n", encoding="utf-8")
    code, text, err = run(
        folder / "a.parquet", folder / "broken.mf4", "--holdout", folder / "one.csv", "--json", "--holdout",
        folder / "b.parquet",
    )  # fmt: skip
    assert code == 3, err
    assert json.loads(text)["drives"] == ["a.parquet"]
    assert run.engine.asked[0][1] == ["b.parquet"]
    assert [line.count("error:") for line in err.splitlines() if "error:" in line] == [1, 1]
    code, text, err = run(folder / "broken.mf4", "-o", folder / "m.toml")
    assert code == 4
    assert text == ""
    assert not (folder / "m.toml").exists()


def test_a_drive_that_lacks_a_signal_leaves(run, folder):
    run.engine.faults = {"b.parquet": SignalError("no wheel torque", where="b.parquet")}
    code, text, err = run(folder / "a.parquet", folder / "b.parquet", "--json")
    assert code == 3
    assert json.loads(text)["drives"] == ["a.parquet"]
    assert err.count("b.parquet: no wheel torque") == 1
    run.engine.faults = {None: SignalError("no drive can be used")}
    code, text, err = run(folder / "a.parquet")
    assert (code, text) == (4, "")
    assert "no drive can be used" in err


def test_a_drive_that_the_engine_leaves_out_is_data_lost(run, folder, monkeypatch):
    told = replace(cases()["named"], drives=("a.parquet",))
    monkeypatch.setattr(engine, "diagnose", lambda *_, **__: told)
    assert run(folder / "a.parquet", folder / "b.parquet", "--json")[0] == 3


def test_nothing_is_fitted_and_held_out(run, folder):
    code, _, err = run(folder / "a.parquet", "--holdout", folder / "a.parquet")
    assert code == 2
    assert "is diagnosed and held out" in err


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--surrogates", "9", "--no-bootstrap"], "--surrogates beside --no-bootstrap"),
        (["--surrogates", "1"], "--surrogates"),
        (["-o", "a.parquet"], "is a source of this very run"),
        (["--page", "b.parquet", "--holdout", "b.parquet", "--force"], "is a source of this very run"),
        (["-o", "car.toml", "--force"], "is a source of this very run"),
        (["-o", "x.html", "--page", "x.html"], "the model is a TOML file"),
        (["--model", "a.parquet"], "a.parquet"),
        (["--model", "absent.toml"], "absent.toml"),
        (["--holdout", "none*.csv"], "nothing matches"),
        (["--holdout", "typo.parquet"], "--holdout typo.parquet: no such file or folder"),
        (["--progress", "loud"], "--progress"),
        (["more.toml"], "stands among other inputs"),
    ],
)
def test_usage(run, folder, monkeypatch, args, said):
    monkeypatch.chdir(folder)
    code, text, err = run("a.parquet", *args)
    assert code == 2, err
    assert said in err
    assert text == ""
    assert run.engine.asked == []


def test_a_log_that_is_given_twice_counts_once_and_is_told(run, folder):
    code, _, err = run(folder / "a.parquet", folder / "b.parquet", folder / "a.parquet")
    assert code == 0
    assert run.engine.asked[-1][0] == ["a.parquet", "b.parquet"]
    assert "1 of 3 logs given more than once: each counts once" in err


def test_no_vehicle_and_results_in_the_way(run, folder):
    code, _, err = run(folder / "a.parquet", vehicle=False)
    assert code == 2
    assert "no --vehicle" in err
    (folder / "page.html").write_text("mine")
    code, _, err = run(folder / "a.parquet", "--page", folder / "page.html")
    assert code == 2
    assert "exists already" in err
    assert run(folder / "a.parquet", "--page", folder / "page.html", "--force")[0] == 0


def test_progress(run, folder):
    err = run(folder / "a.parquet", "--progress", "plain")[2]
    assert 10 <= err.count("searching, ") <= 12
    assert "searching" not in run(folder / "a.parquet", "--progress", "off")[2]


@pytest.mark.skipif(os.name == "nt", reason="such names are none there")
def test_a_name_with_a_line_in_it_is_no_line_of_the_model(run, folder):
    evil = "a\n[[term]]\x07.parquet"
    (folder / "a.parquet").rename(folder / evil)
    code, text, err = run(folder / evil, "-o", folder / "m.toml", "--page", folder / "p.html")
    assert code == 0, err
    assert load_model(folder / "m.toml") == cases()["named"].model
    assert "\x07" not in text + err


def test_a_campaign_goes_to_the_other_level(run, folder, monkeypatch):
    asked = []

    def fake(data, model, *, options, progress):
        asked.append((data.name, len(data.runs), model, options))
        progress("binning")
        return replace(cases()["named"], drives=("c",))

    level = ModuleType("aqualog.diagnose.campaign")
    level.diagnose_campaign = fake
    monkeypatch.setitem(sys.modules, level.__name__, level)
    code, text, err = run(
        folder / "campaign.toml", "--seed", 3, "--json", "--page", folder / "p.html", vehicle=False
    )  # fmt: skip
    assert code in (0, 3), err
    assert asked == [("c", 1, Model(), engine.Options(seed=3))]
    assert json.loads(text)["verdict"] == "named"
    assert (folder / "p.html").exists()
    code, _, err = run(folder / "campaign.toml", "--no-bootstrap", vehicle=False)
    assert code == 2
    assert "--no-bootstrap does not apply to a campaign" in err
    run(folder / "campaign.toml", "--surrogates", 200, vehicle=False)
    assert asked[1][-1].surrogates == 200
    code, _, err = run(folder / "campaign.toml")
    assert code == 2
    assert "vehicle beside a campaign" in err


def test_help_of_the_whole_command():
    text = commands.run("diagnose", "--help").stdout
    assert "default car" not in text
    for part in ("--holdout", "--no-bootstrap", "cannot_tell", "aqualog diagnose drive.mf4 --vehicle car.toml"):
        assert part in text
