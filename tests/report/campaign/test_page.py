"""The report of a campaign: what it holds, that names stay text, that the folder is whole and the same each time."""

import csv
import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from aqualog.campaign.bins import plan
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.cli.main import app
from aqualog.core.errors import ConfigError
from aqualog.core.judgement import Judgement
from aqualog.io.atomic_write import move_together
from aqualog.report.campaign import folder as folder_module
from aqualog.report.campaign.answers import NOTHING, Answer, answers_of, summaries, verdicts
from aqualog.report.campaign.findings import Curve, Point, crossing, find
from aqualog.report.campaign.folder import MARK, check_folder, page_names, write_report
from aqualog.report.campaign.labels import file_name, group_text, value_text
from aqualog.report.campaign.page import _quality_line, campaign_page
from aqualog.report.campaign.quality import MOST_KINDS, problems_of
from aqualog.report.campaign.run_page import command_of, facts_of, run_page
from aqualog.report.values import cut
from tests.campaign.interrupted import files_in
from tests.report.campaign_case import FORMULA, IMAGE, LONG, SCRIPT

SECTIONS = ("verdict", "quality", "filters", "answers-section", "matrix-section", "slopes-section",
            "resistance-section", "full-section", "detections-section", "runs-section", "made-section")  # fmt: skip
EVIL = 14  # index of the run with names that mean harm


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "index.html").read_text(encoding="utf-8")


def data_of(html, name="campaign-data"):
    return json.loads(re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', html, re.S)[1])


def test_sections_come_in_their_order(page):
    places = [page.index(f'id="{s}"') for s in SECTIONS]
    assert places == sorted(places)
    assert "15 runs of 15 logs, 1 without results, 4 configurations" in page


def test_quality_names_the_bad_log_first(page, case):
    weight, title, _, runs = data_of(page)["problems"][0]
    assert (weight, title) == ("loss", "without results")
    assert [i for i, _ in runs] == [13]
    assert "bad.mf4" in runs[0][1]
    few = [p for p in problems_of(case, ("tyre", "water_depth_mm")) if "fewer than 3" in p.title]
    assert [i for p in few for i, _ in p.runs] == [EVIL]
    two = (replace(few[0], weight="limit"), replace(few[0], weight="limit", title="another"))
    assert _quality_line(two).startswith("1 run with limits")


def test_notes_that_differ_in_numbers_are_one_kind(case):
    done = [
        replace(r, about={**r.about, "notes": [f"{3 * r.index} samples dropped at {r.index}.5 s", *more]})
        for r, more in zip(case.done, [[f"note {chr(65 + i)}"] for i in range(26)], strict=False)
    ]
    many = SimpleNamespace(runs=done, done=done)
    notes = [p for p in problems_of(many, ("tyre",)) if p.weight == "note"]
    last = done[-1].index
    assert notes[0].title == f"0 … {3 * last} samples dropped at 0.5 … {last}.5 s"
    assert notes[0].runs[1] == (1, "3 samples dropped at 1.5 s")
    wild = [replace(done[0], index=i, about={**done[0].about, "notes": [f"{chr(256 + i)}"]}) for i in range(500)]
    kinds = problems_of(SimpleNamespace(runs=wild, done=wild), ("tyre",))
    assert len(kinds) < MOST_KINDS + 10
    assert len({i for p in kinds if p.weight == "note" for i, _ in p.runs}) == 500


def test_a_long_sentence_is_shown_whole(case):
    note = "yaw_rate: " + "of a long sentence with an advice at its end " * 12 + "and its last word"
    done = [replace(r, about={**r.about, "notes": [note if k else f"{note} 1"]}) for k, r in enumerate(case.done)]
    own = [p for p in problems_of(SimpleNamespace(runs=done, done=done), ("tyre",)) if "yaw_rate" in p.title]
    assert any(p.title == note for p in own)
    assert not any("#" in p.title for p in own)


def test_a_remark_on_many_logs_keeps_its_numbers(case):
    gains = (0.81, 1.24, 1.1)
    notes = [f"log_{k}.csv: gain {g} (95 % {g - 2} to {g + 0.1:.2f}) at 90 km/h" for k, g in enumerate(gains)]
    done = [replace(r, about={**r.about, "notes": [n]}) for r, n in zip(case.done, notes, strict=False)]
    (found,) = (p for p in problems_of(SimpleNamespace(runs=done, done=done), ("tyre",)) if "gain" in p.title)
    assert found.title == "log_….csv: gain 0.81 … 1.24 (95 % -1.19 … -0.76 to 0.91 … 1.34) at 90 km/h"
    assert [text for _, text in found.runs] == notes


def test_the_log_with_most_missing_comes_before_all_remarks(case):
    def noted(*notes):
        quality = {"time_jumps": 2}  # in more runs, and yet less grave
        return {"notes": notes, "unavailable": {}, "limited": {}, "duration_s": 10.0, "quality": quality}

    about = (
        noted("wheels.csv: v: the name of a column is odd", "a.csv: omega_fl: no value for 25 % of the drive: not"),
        noted("wheels.csv: v: the name of a column is odd", "b.csv: a_x: no value for 60 % of the drive: not"),
        noted(),
    )
    runs = [replace(r, about=a) for r, a in zip(case.runs, about, strict=False)]
    found = problems_of(SimpleNamespace(runs=runs, done=runs), ())
    first = found[0]
    assert (first.weight, first.title) == ("loss", "signals without a value for up to 60 % of the drive")
    assert [i for i, _ in first.runs] == [1, 0]
    assert [p.title for p in found].count("wheels.csv: v: the name of a column is odd") == 1
    assert found[-1].weight == "note"


def test_detectors_that_lack_the_same_are_one_line(case):
    lacks = {"spin_down": ("omega_fl",), "spin_up": ("omega_fl",), "tie_rod": ("tie_rod_fl",)}
    about = {"notes": (), "unavailable": lacks, "limited": {}, "duration_s": 10.0, "quality": {}}
    runs = [replace(case.done[0], about=about)]
    titles = [p.title for p in problems_of(SimpleNamespace(runs=runs, done=runs), ())]
    assert "Spin-down, Spin-up not judged" in titles
    assert "Tie-rod force not judged" in titles


def test_a_dry_campaign_shows_its_resistance_and_names_what_it_cannot_show(case):
    dry = [r for r in case.runs if r.is_done and r.run.values.get("water_depth_mm") == 0.0]
    data = SimpleNamespace(
        **{n: getattr(case, n) for n in ("configured", "keys", "name", "samples")}, runs=dry, done=dry
    )
    found = find(data, plan(data, ()))
    assert found.dry
    html = campaign_page(data, found, [facts_of(r, case.samples(r)) for r in dry], ["runs/1.html"])
    assert data_of(html)["resistance"]
    assert "Resistance over speed, dry road" in html
    assert '<section id="slopes-section" hidden>' in html
    assert "Not shown: speeds, slip slope, full aquaplaning" in html


def test_runs_and_filters_are_in_the_data(page, case):
    data = data_of(page)
    runs = data["runs"]
    assert len(runs["name"]) == len(runs["page"]) == len(runs["v"]) == 15
    facets = {f["key"]: f["values"] for f in data["facets"]}
    assert facets["water_depth_mm"] == ["dry", "0.8 mm", "1.3 mm"]
    assert "pressure_front_bar" not in facets  # the same in all runs
    assert runs["state"] == [0] * 13 + [1, 0]
    assert runs["v"][13] is None
    assert runs["v"][0] == pytest.approx(80.0, abs=1.0)
    assert runs["v"][12] is None  # dry: no pass over water
    assert runs["dry"][12] == pytest.approx(80.0 / 3600.0 * 5.0, rel=0.1)
    depth = [f["key"] for f in data["facets"]].index("water_depth_mm")
    assert [data["facets"][depth]["values"][v] for v in runs["facets"][depth]][:1] == ["0.8 mm"]
    assert data["matrix"]["column"] == depth


def test_curves_are_the_regressions(page, findings):
    data = data_of(page)
    assert len(data["resistance"]) == len(findings.resistance)
    for c, (group, place, points, *_) in zip(findings.resistance, data["resistance"], strict=True):
        assert findings.groups[group] == c.group
        assert place == c.place
        assert [p[6] for p in points] == [p.runs for p in c.points]
        for p, q in zip(points, c.points, strict=True):
            assert (p[3] is None and q.reason) if math.isnan(q.value) else p[3] == pytest.approx(q.value, rel=1e-4)
    fast = [p for c in findings.resistance for p in c.points if p.low_kmh >= 90.0 and p.reliable]
    assert fast
    assert all(p.ci[0] < p.value < p.ci[1] for p in fast)


def test_events_on_water_are_those_of_the_store(page, case):
    runs = data_of(page)["runs"]
    for info, events in zip(case.runs, runs["events"], strict=True):
        assert sum(e[2] + e[3] + e[4] for e in events) == len(info.events)
    assert sum(e[2] for e in runs["events"][9]) > 0  # 1.3 mm, 110 km/h


def test_verdict_of_each_run_and_of_all(page, case):
    runs = data_of(page)["runs"]
    wet = [r for r in case.done if r.judgement.verdict == "aquaplaning"]
    assert len(wet) >= 3
    assert [runs["verdict"][i] for i in (9, 12, 13)] == [0, 1, -1]  # 1.3 mm at 110 km/h; dry; no log
    assert runs["episodes"][9] == 1
    told = verdicts(case)
    assert told[0] == f"Aquaplaning in {len(wet)} runs: {sum(len(r.judgement.of('aquaplaning')) for r in wet)} episodes"
    assert all(f"<li>{line}</li>" in page for line in told)


def test_a_verdict_with_inputs_that_do_not_fit_is_doubtful_everywhere(case, findings):
    check = {"kind": "slip", "signals": ["a_x"], "what": "a_x is late", "advice": "", "lines": [], "value": None}
    runs = list(case.runs)
    runs[9] = replace(runs[9], about={**runs[9].about, "checks": [{**check, "value_ci95": [None, None]}]})
    data = CampaignData(case.configured, case.store, runs)
    whole = campaign_page(data, findings, [None] * len(runs), [""] * len(runs))
    assert [i for i, x in enumerate(data_of(whole)["runs"]["doubtful"]) if x] == [9]
    assert "<li>Doubtful, check the inputs first: 1 run</li>" in whole
    own = run_page(data, runs[9], case.samples(runs[9]), None, back="")
    assert re.search(r'class="headline">Aquaplaning: [^<]*; doubtful, check the inputs first', own)


def test_run_that_cannot_be_judged_is_neither_green_nor_orange(case):
    info = case.runs[9]
    assert 'class="verdict events partial"' in run_page(case, info, case.samples(info), None, back="")
    lost = Judgement("cannot_be_judged", ("torque_rl",), ("spin_down",), info.judgement.episodes[:0])
    blind = replace(info, about={**info.about, **lost.document()})
    page = run_page(case, blind, case.samples(info), None, back="")
    assert 'class="verdict events open"' in page
    assert "Aquaplaning cannot be judged: no wheel torque" in page
    assert '<details class="fold">' in page


def test_tables_are_beside_the_page(folder, findings, case):
    with (folder / "data" / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 15
    assert (rows[9]["verdict"], rows[9]["episodes"], rows[13]["verdict"]) == ("aquaplaning", "1", "")
    assert rows[13]["state"] == "failed"
    assert (folder / rows[0]["page"]).is_file()
    assert rows[12]["x_note"] == f"'{FORMULA}"
    frame = pl.read_csv(folder / "data" / "slip_slope.csv", infer_schema_length=None)
    assert frame.height == sum(len(c.points) for c in findings.slopes)
    assert (folder / "data" / "full_aquaplaning.csv").read_text().count("\n") == 1 + len(findings.full)


def test_names_stay_text(folder, page):
    pages = [page, *((folder / n).read_text() for n in data_of(page)["runs"]["page"])]
    for html in pages:
        assert "<script>alert" not in html
        assert "<img" not in html
        assert html.count("<script") == 2
    assert "case &lt;b&gt;&amp;amp;" in page


def test_policy_lets_nothing_in(folder, page):
    one = (folder / data_of(page)["runs"]["page"][0]).read_text()
    for html in (page, one):
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)[1].replace("&#39;", "'")
        assert "default-src 'none'" in policy
        script = re.search(r"script-src ([^;]*)", policy)[1].split()
        assert len(script) == 2
        assert script[0].startswith("'sha256-")
        assert script[1] == "'strict-dynamic'"
        assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", html)


def test_one_plotly_and_small_pages(folder, page):
    assert list(folder.rglob("*.js")) == [folder / "plotly.min.js"]
    assert len(page) < 200_000
    assert all(p.stat().st_size < 100_000 for p in (folder / "runs").iterdir())


@pytest.mark.parametrize(
    "name",
    ["../../etc/passwd", "..", "", "a/b\\c:d*?.mf4", "\0\n", "CON.mf4", "é" * 400, IMAGE, SCRIPT, "\udcff.mf4", "-rf"],
)
def test_names_of_pages_are_harmless(name):
    assert re.fullmatch(r"0008-[a-z0-9-]{8,80}", file_name(7, name))
    assert file_name(7, name) != file_name(8, name)


def test_long_names_are_cut_and_stay_two():
    a, b = "y" * 10**6, "y" * 10**6 + "z"
    assert len(cut(a)) <= 90
    assert cut(a) != cut(b)
    assert cut("a\nb\x1b[31m") == "a\ufffdb\ufffd[31m"


def test_long_drive_makes_a_small_page(case):
    info = case.runs[9]
    many = info.about["events"] * 400

    short = case.samples(info)
    frame = pl.concat([short.frame] * 900)
    samples = RunSamples(frame, np.arange(frame.height) * 0.1, np.tile(short.on_water, 900))
    about = {**info.about, "events": many, "notes": ["n" * 10**6] * 50}
    values = {"tyre": "t" * 10**6, "x_a": SCRIPT * 1000}
    run = type(info.run)(info.run.logs, info.run.vehicle, None, None, values)
    huge = RunInfo(9, "l" * 10**6, run, info.key, "done", "", info.vehicle, about, "lane times")
    html = run_page(case, huge, samples, facts_of(huge, samples), back="../index.html")
    assert len(html) < 100_000


def test_a_long_run_shows_every_sample_near_its_events_and_says_what_a_point_is_elsewhere(case):
    n, info = 6000, case.runs[0]
    some = next(e for r in case.done for e in r.events)
    frame = pl.DataFrame({"v_x": np.where(np.arange(n) == 2003, 40.0, 30.0), "slip_min_fl": np.full(n, -0.1)})
    samples = RunSamples(frame, np.arange(n) * 0.1, np.zeros(n))
    event = {**some, "start_s": 200.0, "end_s": 201.0}
    page = run_page(case, replace(info, about={**info.about, "events": [event]}), samples, None, back="")
    data = data_of(page, "run-data")
    t, speed = np.array(data["t"]), np.array(data["lines"]["speed"][0][2])
    near = (t >= 195.0) & (t <= 206.0)
    assert np.diff(t[near]) == pytest.approx(0.1)
    assert speed[near].max() == 144.0
    assert np.diff(t[t < 194.0]).max() == pytest.approx(2.5)
    assert "One point every 0.1 s within 5 s of the events; elsewhere one point every 2.5 s (mean" in page
    assert "extremes of every 0.1 s" in page


def test_rim_of_a_wheel_that_stops_stands_still(case):
    """(3.13) runs to minus infinity there: v_x (1 + slip) would drive the rim backwards."""
    n, info = 20, case.runs[0]
    columns = {"v_x": np.full(n, 30.0), "slip_fl": np.full(n, -19.0), "slip_min_fl": np.full(n, -1.0)}
    frame = pl.DataFrame(columns | {"slip_max_fl": np.full(n, -0.9)})
    samples = RunSamples(frame, np.arange(n) * 0.1, np.zeros(n))
    data = data_of(run_page(case, info, samples, None, back=""), "run-data")
    speeds = {name: values for name, _, values in data["lines"]["speed"]}
    assert speeds["v_x"] == [108.0] * n
    assert speeds["FL"] == pytest.approx([0.05 * 108.0] * n)
    assert data["t"] == pytest.approx(samples.t.tolist())


def test_same_results_make_the_same_bytes(case, findings, folder, tmp_path):
    write_report(case, findings, tmp_path / "again")
    assert files_in(tmp_path / "again") == files_in(folder)


def test_earlier_report_is_replaced_and_other_files_stay(case, findings, tmp_path):
    out = tmp_path / "out"
    write_report(case, findings, out)
    stale = "runs/0099-gone-12345678.html"
    (out / stale).write_text("old")
    (out / "notes.txt").write_text("mine")
    (tmp_path / "precious.html").write_text("mine")
    mark = json.loads((out / MARK).read_text())
    mark["files"] += [stale, "../precious.html", "notes.txt", "runs/../../precious.html", 7]
    (out / MARK).write_text(json.dumps(mark))
    check_folder(out, force=False)
    write_report(case, findings, out)
    assert not (out / stale).exists()
    assert (out / "notes.txt").read_text() == (tmp_path / "precious.html").read_text() == "mine"
    assert json.loads((out / MARK).read_text())["files"] == sorted(
        str(p.relative_to(out)) for p in out.rglob("*") if p.is_file() and p.name not in (MARK, "notes.txt")
    )


@pytest.mark.parametrize("has_earlier", [False, True])
def test_a_report_that_is_broken_off_leaves_what_was_there(case, findings, folder, tmp_path, monkeypatch, has_earlier):
    out = tmp_path / "out"
    if has_earlier:
        shutil.copytree(folder, out)
        (out / "index.html").write_text("earlier")
    before = files_in(tmp_path)

    def broken(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_report(case, findings, out, report=broken)
    monkeypatch.setattr(folder_module, "campaign_page", broken)  # after all pages of runs
    with pytest.raises(KeyboardInterrupt):
        write_report(case, findings, out)
    assert files_in(tmp_path) == before
    assert out.exists() == has_earlier


@pytest.mark.parametrize("is_before", [False, True])
def test_an_interrupt_waits_until_all_files_are_in_their_places(tmp_path, monkeypatch, is_before):
    pairs = [(tmp_path / str(i), tmp_path / "out" / str(i)) for i in range(9)]
    count, move = iter(range(99)), Path.replace
    for made, _ in pairs:
        made.write_text("new")

    def interrupted(made, path):
        n = next(count)
        if n == 4 and is_before:
            raise KeyboardInterrupt
        move(made, path)
        if n == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        move_together(pairs, [tmp_path / "old"])
    assert len(files_in(tmp_path / "out")) == 9


def test_folders_of_other_things_are_refused(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "thesis.doc").write_text("x")
    with pytest.raises(ConfigError, match="holds other files"):
        check_folder(tmp_path / "a", force=False)
    check_folder(tmp_path / "a", force=True)
    with pytest.raises(ConfigError, match="is a file"):
        check_folder(tmp_path / "a" / "thesis.doc", force=True)
    with pytest.raises(ConfigError, match="below a file"):
        check_folder(tmp_path / "a" / "thesis.doc" / "x", force=True)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "runs").symlink_to(tmp_path / "a")
    with pytest.raises(ConfigError, match="link"):
        check_folder(tmp_path / "b", force=True)


def test_command_on_the_page_makes_the_full_one(case):
    text = command_of(case, case.runs[0])
    assert text == "aqualog detect logs/d0.8_v80_0.parquet --vehicle car.toml -o run_0001"
    assert "'a<b>/script><img src=x onerror=alert(3)>'\"'\"' .parquet'" in command_of(case, case.runs[EVIL])


def test_command_line(case, tmp_path):
    tmp_path = shutil.copytree(case.configured.campaign.path.parent, tmp_path / "case")
    campaign = tmp_path / "campaign.toml"
    run = lambda *a: CliRunner().invoke(app, ["report", *map(str, a), "--jobs", "1"])  # noqa: E731
    done = run(campaign, "--by", "depth,manoeuvre")
    assert done.exit_code == 3, done.stderr  # a log is none
    page = (tmp_path / "campaign.report" / "index.html").read_text()
    assert "Configurations: water depth, manoeuvre." in page
    assert run(campaign, "-q").exit_code == 3  # its own earlier report is replaced
    assert "no run has this key" in run(campaign, "--by", "colour").stderr
    wrong = run(tmp_path / "logs" / "dry.parquet")
    assert wrong.exit_code == 2
    assert "aqualog detect" in wrong.stderr
    other = run(campaign, "-o", tmp_path)
    assert other.exit_code == 2
    assert "holds other files" in other.stderr


def curve(values, half=0.05):
    points = [
        Point(v - 5.0, v + 5.0, v, y, (y - half, y + half), 4, 100, reliable=True, reason="")
        for v, y in zip((70.0, 80.0, 90.0, 100.0), values, strict=True)
    ]
    return Curve((), "", tuple(points))


def test_crossing_lies_between_the_ends_of_the_band():
    found = crossing(curve((0.0, 0.1, 0.3, 0.5)), 0.2, rising=True)
    assert found.v_kmh == pytest.approx(85.0)
    assert found.ci == pytest.approx((82.5, 87.5))
    falling = crossing(curve((30.0, 25.0, 15.0, 5.0), half=5.0), 15.0, rising=False)
    assert falling.v_kmh == pytest.approx(90.0)
    assert falling.ci == pytest.approx((85.0, 95.0))


def test_crossing_that_is_not_reached_is_open():
    none = crossing(curve((0.0, 0.02, 0.05, 0.1)), 0.2, rising=True)
    assert math.isnan(none.v_kmh)
    assert none.ci[1] == math.inf
    assert none.to_kmh == 100.0
    from_begin = crossing(curve((0.3, 0.4, 0.5, 0.6)), 0.2, rising=True)
    assert from_begin.ci[0] == -math.inf
    few = curve((0.0, 0.1, 0.3, 0.5)).points[:1]
    assert crossing(Curve((), "", few), 0.2, rising=True) is None


def test_a_level_that_the_slowest_bin_has_is_a_bound():
    from aqualog.report.campaign.answers import _crossed, _lowest

    bound = _crossed(curve((0.3, 0.4, 0.5, 0.6)), 0.2, rising=True)
    assert (math.isnan(bound.v), bound.low, bound.high) == (True, -math.inf, 70.0)
    other = _crossed(curve((0.0, 0.1, 0.3, 0.5)), 0.2, rising=True)
    assert other.v == pytest.approx(85.0)
    assert _lowest([other, bound]) == bound


def test_answers_take_the_wheel_with_the_lowest_speed(findings):
    for a in answers_of(findings):
        told = [3.6 * f.v for f in findings.full if f.group == a.group and f.way == "spin_down" and f.v == f.v]
        assert (a.full[2].v == pytest.approx(min(told))) if told else math.isnan(a.full[2].v)


def test_event_belongs_to_the_water_up_to_a_second_behind_it(case):
    t = np.arange(100) * 0.1
    wet = np.where((t > 3.0) & (t < 6.0), 1.0, 0.0)
    samples = RunSamples(pl.DataFrame({"v_x": np.full(100, 20.0)}), t, wet)
    about = {
        "events": [
            {"detector": "resistance", "wheel": None, "side": None, "severity": "partial", "start_s": s}
            for s in (1.0, 3.5, 6.5, 7.5)
        ]
    }
    info = RunInfo(0, "x", case.runs[0].run, "k", "done", "", case.runs[0].vehicle, about, "lane times")
    facts = facts_of(info, samples)
    assert (facts.events[0].on, facts.events[0].off) == (2, 2)
    assert facts.lane_kmh == pytest.approx(72.0)
    assert facts.dry_km == pytest.approx(20.0 * 0.1 * np.count_nonzero(wet == 0.0) / 1e3)
    unknown = facts_of(info, RunSamples(samples.frame, t, np.full(100, np.nan)))
    assert unknown.events[0].unknown == 4
    assert math.isnan(unknown.dry_km)


def test_values_in_words():
    assert value_text("pressure_rear_bar", 1.9) == "1.9 bar"
    assert value_text("load_rear_kg", 270.0) == "+270 kg rear"
    assert value_text("water_depth_mm", 0.0) == "dry"
    assert value_text("tyre", None) == "tyre not given"
    group = (("vehicle", "vehicle_x"), ("tyre", "worn"), ("load_front_kg", 0.0), ("water_depth_mm", 1.3))
    alike = (("pressure_front_bar", 2.2), ("pressure_rear_bar", 2.2))
    assert group_text(alike) == "2.2 bar"
    assert group_text((alike[0], ("pressure_rear_bar", 2.0))) == "2.2 bar front · 2.0 bar rear"
    assert group_text(alike[1:]) == "2.2 bar"
    assert group_text(group) == "worn · 1.3 mm · x"
    assert page_names(["a", "a"])[0] != page_names(["a", "a"])[1]
    assert Path(page_names([LONG])[0]).suffix == ".html"


def test_a_lane_behind_the_end_of_its_log_is_a_problem(case):
    info = case.done[0]
    end = info.about["duration_s"]
    late = replace(info, run=replace(info.run, lane=(end + 5.0, end + 8.0)))
    data = SimpleNamespace(runs=(late,), done=(late,), keys=case.keys, configured=case.configured)
    found = [p for p in problems_of(data, case.keys) if "after the log's end" in p.title]
    assert found[0].runs == ((info.index, f"lane from {end + 5.0:g} to {end + 8.0:g} s, the log ends at {end:.1f} s"),)
    assert not [p for p in problems_of(case, case.keys) if "after the log's end" in p.title]


def test_speeds_of_full_aquaplaning_name_their_event():
    found = summaries([Answer((), (NOTHING,) * 4, NOTHING, NOTHING)])
    assert [s.what for s in found[:4]] == [
        "Full aquaplaning, from the slip slope: even contact ends",
        "Full aquaplaning, from the minor spin-downs: first loss + 20",
        "Full aquaplaning, from the spin-downs: half of passes stop a wheel",
        "Full aquaplaning, foretold: a free wheel stops",
    ]
