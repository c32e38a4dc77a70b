"""The same work by the face and by the command gives the same document, to the character."""

import os
import shutil
from pathlib import Path

import polars as pl
import pytest

import aqualog as aq
from tests.both_ways import check_saved, check_shown, command
from tests.campaign.made import make_campaign
from tests.conftest import ROOT

LOG, CAR = ROOT / "sample_logs" / "lane_drive.mf4", ROOT / "sample_logs" / "vehicle.toml"
DETECTED = ("events.json", "signals.parquet", "report.html")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return make_campaign(tmp_path_factory.mktemp("face"), speeds=(70, 100), repeats=3)


@pytest.fixture(scope="module")
def runs(campaign):
    return aq.Campaign(campaign).run(jobs=1)


def agree(result, *args, code=0):
    """The document and the text are those of the command."""
    assert result.to_json() + "\n" == command(*args, "--json", code=code)[0]
    assert result.text() == command(*args, code=code)[0]
    check_shown(result)


def test_detect(tmp_path):
    result = aq.detect(aq.read(LOG), aq.Vehicle.read(CAR))
    agree(result, "detect", LOG, "--vehicle", CAR)
    check_saved(result, tmp_path / "face", DETECTED)
    command("detect", LOG, "--vehicle", CAR, "-o", tmp_path / "command", "--write", tmp_path / "by_command.mf4")
    for name in DETECTED:
        assert (tmp_path / "face" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert result.events.height == len(result.document["events"]) == 12
    assert result.verdict == result.document["verdict"] == "aquaplaning"
    (episode,) = result.episodes.filter(pl.col("kind") == "aquaplaning").rows(named=True)
    assert (episode["start_s"], episode["wheels"]) == (pytest.approx(8.0, abs=0.1), "fr, fl")
    assert result.features.columns[0] == result.tracks.columns[0] == "t"
    assert result.features.height == result.signals.height == result.tracks.height
    written = result.write(tmp_path / "by_face.mf4")
    there = aq.inspect(written).tables["channels"]
    assert there["path"].to_list() == aq.inspect(tmp_path / "by_command.mf4").tables["channels"]["path"].to_list()


def test_detect_says_what_it_found_in_a_few_lines():
    shown = repr(aq.detect(LOG, CAR)).splitlines()
    assert "lane_drive.mf4" in shown[0]
    assert shown[1].startswith("Aquaplaning: 8.0–16.")
    assert ", 101 km/h, front right, front left, partial" in shown[1]
    assert any("Not judged: Tie-rod force" in line for line in shown)


def test_detect_takes_signals_in_memory_and_paths():
    of_path = aq.detect(str(LOG), CAR)
    in_memory = aq.detect(aq.read(LOG).signals, str(CAR))
    assert in_memory.document["events"] == of_path.document["events"]


def test_a_drive_is_read_once_and_anew_for_another_car(monkeypatch):
    from aqualog.align import load

    calls = []
    whole = load.load_signals
    monkeypatch.setattr(load, "load_signals", lambda *a, **k: calls.append(k["vehicle"]) or whole(*a, **k))
    drive = aq.read(LOG, vehicle=CAR)
    assert drive.frame.height == drive.signals.rows == 2400
    assert len(calls) == 1
    drive.load(aq.Vehicle(r_e_f=0.3))
    assert len(calls) == 2


def test_detect_remembers_in_a_history(tmp_path):
    options = ("--history", tmp_path / "slopes.json", "--configuration", "worn")
    document = command("detect", LOG, "--vehicle", CAR, *options, "--json")[0]
    history = (tmp_path / "slopes.json").read_text()
    (tmp_path / "slopes.json").unlink()
    result = aq.detect(LOG, CAR, history=tmp_path / "slopes.json", configuration="worn")
    assert not (tmp_path / "slopes.json").exists()
    result.remember(tmp_path / "slopes.json")
    assert result.to_json() + "\n" == document
    assert (tmp_path / "slopes.json").read_text() == history


def test_convert(tmp_path):
    by_face = aq.convert(aq.read(LOG), tmp_path / "face.parquet", CAR)
    command("convert", LOG, "--vehicle", CAR, "-o", tmp_path / "command.parquet")
    assert by_face.read_bytes() == (tmp_path / "command.parquet").read_bytes()
    with pytest.raises(aq.AqualogError, match="exists already"):
        aq.convert(LOG, by_face)
    with pytest.raises(aq.AqualogError, match="source"):
        aq.convert(LOG, LOG, force=True)


def test_inspect(tmp_path):
    result = aq.inspect(LOG)
    agree(result, "inspect", LOG)
    check_saved(result, tmp_path / "face", ("inspect.json", "map.toml"))
    command("inspect", LOG, "--write-map", tmp_path / "map.toml")
    assert (tmp_path / "face" / "map.toml").read_text() == (tmp_path / "map.toml").read_text()
    assert set(aq.read(LOG, map=result.map).signals.symbols) <= set(aq.read(LOG).signals.symbols)


def test_doctor(tmp_path):
    result = aq.doctor(aq.read(LOG), CAR)
    agree(result, "doctor", LOG, "--vehicle", CAR)
    check_saved(result, tmp_path / "face", ("doctor.json", "doctor.txt", "doctor.html"))
    command("doctor", LOG, "--vehicle", CAR, "-o", tmp_path / "page.html")
    assert (tmp_path / "face" / "doctor.html").read_bytes() == (tmp_path / "page.html").read_bytes()


def test_doctor_of_a_cut_log(tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((ROOT / "sample_logs" / "lane_drive.mcap").read_bytes()[:200_000])
    result = aq.doctor(cut, CAR)
    assert result.has_loss
    assert result.exit_code == 3
    agree(result, "doctor", cut, "--vehicle", CAR, code=3)


def test_evaluate(tmp_path):
    result = aq.evaluate(LOG, CAR, roc=True)
    agree(result, "evaluate", LOG, "--vehicle", CAR, "--roc")
    check_saved(result, tmp_path / "face", ("evaluation.json", "evaluation.html"))
    command("evaluate", LOG, "--vehicle", CAR, "--roc", "-o", tmp_path / "page.html")
    assert (tmp_path / "face" / "evaluation.html").read_bytes() == (tmp_path / "page.html").read_bytes()


def test_tyre_test(tmp_path):
    aq.Campaign.simulate("braking-test", tmp_path / "braking", jobs=1)
    campaign, results = tmp_path / "braking" / "campaign.toml", {}
    for kind, code in (("braking", 0), ("straight", 4)):
        results[kind] = result = aq.tyre_test(campaign, kind, control="worn_summer", jobs=1)
        given = ("test", kind, campaign, "--control", "worn_summer", "--jobs", 1)
        agree(result, *given, code=code)
        names = [f"{kind}{n}" for n in (".json", "_sets.csv", "_runs.csv", ".html")]
        check_saved(result, tmp_path / f"{kind}_face", names)
        command(*given, "-o", tmp_path / f"{kind}_command", code=code)
        for name in names:
            assert (tmp_path / f"{kind}_face" / name).read_bytes() == (tmp_path / f"{kind}_command" / name).read_bytes()
    good = results["braking"]
    assert good.tables["sets"]["tyre"].to_list() == ["worn_summer", "new_summer", "new_winter"]
    assert good.tables["sets"]["valid"].to_list() == [12, 6, 6]
    assert good.tables["sets"]["index"].to_list()[1] > 100.0
    assert "above worn_summer" in repr(good)
    log = next((tmp_path / "braking").rglob("*.mf4"))
    copy = shutil.copy(log, tmp_path / "copy.mf4")
    alone, twice = (
        aq.tyre_test(x, "braking", vehicle=next((tmp_path / "braking").rglob("vehicle*.toml"))) for x in ([log], [log, copy])
    )  # fmt: skip
    assert twice.tables["runs"].height == alone.tables["runs"].height == 1
    assert any("is the same log as" in n for n in twice.test.notes)
    with pytest.raises(aq.AqualogError, match="does not apply to braking"):
        aq.tyre_test(campaign, "braking", radius=100.0)
    with pytest.raises(aq.AqualogError, match="straight, curve, braking"):
        aq.tyre_test(campaign, "round")


def test_batch(campaign, runs, tmp_path):
    assert runs.outcome.made == 6
    again = aq.Campaign(campaign).run(jobs=1)
    agree(again, "batch", campaign, "--jobs", 1)
    check_saved(again, tmp_path, ("campaign.json", "runs.parquet", "events.parquet", "episodes.parquet"))
    assert again.runs["state"].to_list() == ["done"] * 6
    assert again.events.height == sum(again.document["events"].values())
    assert (again.episodes["kind"] == "aquaplaning").sum() == again.document["episodes"] == again.runs["episodes"].sum()
    assert sum(again.document["verdicts"].values()) == 6


def test_batch_of_a_log_that_fails(tmp_path):
    (tmp_path / "bad.csv").write_text("t,omega_fl\n")
    (tmp_path / "good.parquet").write_bytes((ROOT / "sample_logs" / "lane_drive.parquet").read_bytes())
    logs = [tmp_path / "bad.csv", tmp_path / "good.parquet"]
    heard = []
    result = aq.Campaign(logs, vehicle=CAR, store=tmp_path / "store").run(jobs=1, progress=heard.append)
    assert result.has_loss
    assert list(result.outcome.failed) == [next(n for n in result.outcome.failed if n.endswith("bad.csv"))]
    assert any(h.startswith("error: ") and "bad.csv" in h for h in heard)
    store = ("--vehicle", CAR, "-o", tmp_path / "store", "--jobs", 1)
    again = aq.Campaign(logs, vehicle=CAR, store=tmp_path / "store").run(jobs=1)
    assert again.to_json() + "\n" == command("batch", *logs, *store, "--json", code=3)[0]


def test_bin_slipslope(campaign, runs, tmp_path):
    result = runs.slip_slope(by="tyre", bin_width=20.0, road="both")
    agree(result, "bin-slipslope", campaign, "--by", "tyre", "--bin-width", 20, "--road", "both", "--jobs", 1)
    check_saved(result, tmp_path / "face", ("slip_slope.json", "slip_slope.csv", "slip_slope.parquet"))
    command("bin-slipslope", campaign, "--by", "tyre", "--bin-width", 20, "--road", "both", "-o", tmp_path / "t.csv")
    assert (tmp_path / "face" / "slip_slope.csv").read_bytes() == (tmp_path / "t.csv").read_bytes()
    assert result.rows.height == len(result.document["rows"])


def test_bin_resistance(campaign, runs, tmp_path):
    result = runs.resistance(["tyre"], robust=True, as_measured=True)
    options = ("--by", "tyre", "--robust", "--as-measured", "--jobs", 1)
    agree(result, "bin-resistance", campaign, *options)
    check_saved(result, tmp_path, ("resistance.json", "resistance.csv", "resistance.parquet"))


def test_report(campaign, runs, tmp_path):
    page = runs.report(tmp_path / "face", by="tyre")
    command("report", campaign, "--by", "tyre", "-o", tmp_path / "command", "--jobs", 1)
    names = sorted(p.relative_to(page.parent) for p in page.parent.rglob("*") if p.is_file())
    assert Path("index.html") in names
    for name in names:
        assert (tmp_path / "face" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()


def test_matrix(campaign, runs, tmp_path):
    result = aq.Campaign(campaign).matrix()
    agree(result, "inspect", campaign)
    check_saved(result, tmp_path, ("matrix.json", "matrix.txt"))


def test_plan(campaign, tmp_path):
    result = aq.Campaign(campaign, store=tmp_path / "empty").plan(jobs=1, sample=2, within="1h")
    by_command = command(
        "plan", campaign, "--store", tmp_path / "empty", "--jobs", 1, "--sample", 2, "--within", "1h", "--json"
    )
    import json

    other = json.loads(by_command[0])
    assert set(result.document) == set(other)
    assert result.document["logs"] == other["logs"]
    assert [s["log"] for s in result.document["sample"]] == [s["log"] for s in other["sample"]]
    check_shown(result)
    check_saved(result, tmp_path / "saved", ("plan.json", "plan.txt"))


def test_campaign_init(campaign, tmp_path):
    folder = campaign.parent / "logs"
    result = aq.Campaign.propose(folder, tmp_path / "face" / "campaign.toml", vehicle=CAR)
    made = result.write()
    assert len(made.configured.campaign.runs) == 6
    document = command(
        "campaign", "init", folder, "-o", tmp_path / "command" / "campaign.toml", "--vehicle", CAR, "--json"
    )[0]
    assert result.to_json() + "\n" == document.replace(str(tmp_path / "command"), str(tmp_path / "face"))
    for name in ("campaign.toml", "runs.csv"):
        assert (tmp_path / "face" / name).read_text() == (tmp_path / "command" / name).read_text()
    check_shown(result)


def test_figures(tmp_path):
    result = aq.thesis.figures(["3.6", "2.1"], out=tmp_path / "out")
    document = command("figures", "3.6", "2.1", "-o", tmp_path / "out", "--json", "--force")[0]
    assert result.to_json() + "\n" == document
    check_shown(aq.thesis.figure("2.1"))
    names = ("figure_2_01.html", "figure_2_01.csv", "figure_3_06.html", "figure_3_06.csv", "figures.html")
    check_saved(aq.thesis.figures(["2.1", "3.6"]), tmp_path / "face", names)
    for name in names:
        assert (tmp_path / "face" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()


def test_a_figure_that_needs_a_campaign_says_so(runs):
    with pytest.raises(aq.AqualogError, match="made from the runs of a campaign"):
        aq.thesis.figure("2.17")
    with pytest.raises(aq.AqualogError, match="is not made"):
        aq.thesis.figure("2.20", runs)


def test_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("AQUALOG_CACHE", str(tmp_path))
    assert aq.cache().to_json() + "\n" == command("cache", "--json")[0]
    aq.detect(aq.read(LOG, cache=True), CAR)
    kept = aq.cache()
    assert kept.tables["drives"].height == 1
    assert kept.text() == command("cache")[0]
    assert aq.cache(clean=True).removed[0] == 1
    assert not aq.cache().entries


@pytest.mark.nightly
def test_reproduce(tmp_path):
    result = aq.thesis.reproduce(tmp_path, jobs=os.cpu_count())
    result.save(tmp_path)
    document = command("reproduce", "-o", tmp_path, "--force", "--json")[0]
    assert result.to_json() + "\n" == document
    assert result.tables["claims"].height >= 118
    check_shown(result)


def test_names_from_logs_are_harmless(tmp_path):
    name = "t,v_x,<script>alert(1)</script>\n0,1,2\n0.1,1,2\n0.2,1,2\n"
    (tmp_path / "a.csv").write_text(name)
    contents = aq.inspect(tmp_path / "a.csv")
    assert "<script>" not in contents._repr_html_()
    assert isinstance(contents.tables["channels"], pl.DataFrame)


def test_errors_say_what_to_give(tmp_path):
    with pytest.raises(aq.AqualogError, match="no such file"):
        aq.read(tmp_path / "none.mf4")
    with pytest.raises(aq.AqualogError, match=r"0\.1 to 100000"):
        aq.read(LOG, rate_hz=0.0)
    with pytest.raises(aq.AqualogError, match="no vehicle"):
        aq.Campaign(LOG)
