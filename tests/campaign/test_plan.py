"""What a campaign will cost: the sample, the sum over all logs, shards; and a real batch against its plan."""

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aqualog.campaign import plan as forecast
from aqualog.campaign.batch import run_batch
from aqualog.campaign.definition import Campaign, Run, Shard, part_of
from aqualog.campaign.jobs import Job
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.core.compiled import kept_code
from aqualog.core.vehicle import Vehicle
from aqualog.io.fingerprint import Contents
from tests.campaign.made import make_campaign
from tests.commands import run


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return make_campaign(tmp_path_factory.mktemp("plan"), speeds=(60, 70, 80, 90), repeats=3)


def jobs(count, form="csv", *, step=1_000_000, name="log"):
    return [
        (Job(f"{form}{i}", (Path(f"/d/{name}{i}.{form}"),), Vehicle(), (i,)), form, step * (i + 1))
        for i in range(count)
    ]


def sampled(chosen, cost, *, store=1000):
    return tuple(forecast.LogCost(j.logs, f, s, 2.0 * cost(f, s), cost(f, s), store, "") for j, f, s in chosen)


def trial(found, **more):
    given = {"hashing_s": 0.0, "tables_s": 0.0, "start_s": 3.0, "start_cpu_s": 1.0, "ending_s": 0.5, "peak_bytes": 1}
    return forecast.BatchCost(found, 2, **(given | more))


def told(work, found, **more):
    return forecast.foretell(work, found, **({"processes": 2, "cores": 2, "lead_s": 1.0, "lead_cpu_s": 0.5} | more))


def test_a_sample_has_every_format_and_both_ends_of_the_sizes():
    new = [*jobs(50), *jobs(5, "mdf", step=1000), *jobs(1, "mcap"), *jobs(3, "unknown")]
    chosen = forecast.choose(new, 8)
    sizes = {f: sorted(s for _, g, s in chosen if g == f) for f in ("csv", "mdf", "mcap", "unknown")}
    assert sizes["csv"][0] == 1_000_000
    assert sizes["csv"][-1] == 50_000_000
    assert len(sizes["csv"]) == 6  # nearly all of the bytes
    assert sizes["mdf"] == [5000]
    assert len(sizes["mcap"]) == 1
    assert sizes["unknown"] == []
    assert sorted(s for _, _, s in forecast.choose(jobs(3), 8)) == [1_000_000, 2_000_000, 3_000_000]
    assert forecast.choose(jobs(3, "unknown"), 8) == []


def test_costs_on_a_line_are_foretold_exactly():
    costs = {"csv": lambda s: 0.5 + 1e-6 * s, "mdf": lambda s: 0.1 + 3e-8 * s}
    new = [*jobs(40), *jobs(30, "mdf")]
    of = lambda f, s: costs[f](s)  # noqa: E731
    work = forecast.Work(tuple(new), 0, 0, ())
    plan = told(work, trial(sampled(forecast.choose(new, 12), of), hashing_s=0.0))
    truth = sum(of(f, s) for _, f, s in new)
    assert plan.stretch == pytest.approx(2.0)
    assert plan.logs_s.value == pytest.approx(2.0 * truth)
    assert plan.logs_s.high == pytest.approx(plan.logs_s.low, rel=1e-6)
    assert plan.wall_s.value == pytest.approx(forecast.makespan(plan.seconds, 2) + 1.0 + 3.0 + 0.5)
    assert plan.cpu_s.value == pytest.approx(truth + 0.5 + 2 * 1.0)
    assert plan.store_bytes.value == pytest.approx(1000 * 70)
    # more processes than cores get ready one after another, and work no faster
    many = told(work, trial(sampled(forecast.choose(new, 12), of)), processes=8)
    assert many.wall_s.value == pytest.approx(plan.wall_s.value + 3.0 * 3.0)


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(3)
    new = jobs(100)
    held, inside = 0, 300
    for _ in range(inside):
        noise = dict(zip((s for _, _, s in new), np.exp(0.3 * rng.standard_normal(100)), strict=True))
        cost = lambda f, s, noise=noise: (0.2 + 1e-7 * s) * noise[s]  # noqa: E731
        plan = told(forecast.Work(tuple(new), 0, 0, ()), trial(sampled(forecast.choose(new, 10), cost)), lead_cpu_s=0.0)
        truth = sum(cost(f, s) for _, f, s in new) + 2.0
        held += plan.cpu_s.low <= truth <= plan.cpu_s.high
    assert 0.84 <= held / inside <= 0.98


def test_a_log_that_took_its_process_down_and_formats_unseen_are_told():
    new = [*jobs(10), *jobs(2, "mdf"), *jobs(2, "unknown")]
    found = list(sampled(forecast.choose(jobs(10), 4), lambda f, s: 1.0))
    found[0] = replace(found[0], reason="is damaged")
    plan = told(forecast.Work(tuple(new), 0, 0, ()), trial(tuple(found)))
    text = " ".join(plan.notes)
    assert "1 of 4 logs of the sample" in text
    assert "no log of format mdf" in text
    assert "2 files are not logs" in text
    assert plan.logs_s.value == pytest.approx(2.0 * 12.0)  # what is no log takes no time


def test_makespan():
    assert forecast.makespan(np.array([3.0, 1.0, 1.0, 1.0]), 2) == 3.0
    assert forecast.makespan(np.array([1.0, 1.0, 4.0]), 2) == 5.0


def test_shards_are_those_that_the_batch_makes(campaign):
    configured = configure(campaign)
    runs = tuple(Run((Path(f"/d/log{i}.csv"),), Path("car.toml"), None, None, {}) for i in range(200))
    configured = replace(configured, campaign=Campaign("many", Path("/d/c.toml"), None, runs, None))
    new = jobs(200, step=0)
    plan = told(forecast.Work(tuple(new), 0, 0, ()), trial(sampled(forecast.choose(new, 8), lambda f, s: 1.0)))
    count, longest = forecast.shards_within(configured, forecast.Work(tuple(new), 0, 0, ()), plan, 60.0)
    fixed = 1.0 + 3.5
    parts = [len(part_of(configured.campaign, Shard(i + 1, count)).runs) for i in range(count)]
    assert fixed + 2.0 * max(parts) / 2 <= longest <= 60.0
    fewer = [len(part_of(configured.campaign, Shard(i + 1, count - 1)).runs) for i in range(count - 1)]
    assert fixed + 2.0 * max(fewer) / 2 + 1.0 > 60.0
    assert forecast.shards_within(configured, forecast.Work(tuple(new), 0, 0, ()), plan, 6.0) is None


def test_what_is_in_the_store_is_not_counted_and_nothing_is_hashed(tmp_path, monkeypatch):
    path = make_campaign(tmp_path, speeds=(70, 80), repeats=1)
    configured, store = configure(path), Store(tmp_path / "store")
    runs = configured.campaign.runs
    run_batch(replace(configured, campaign=replace(configured.campaign, runs=runs[:1])), store)
    (tmp_path / "runs.csv").open("a").write("logs/none.mf4,a,,,,,\n")
    monkeypatch.setattr(Contents, "_unknown", lambda *_: pytest.fail("a log is hashed"))
    work = forecast.work_of(configure(path), store)
    assert [j.logs for j, _, _ in work.new] == [runs[1].logs]
    assert (work.kept, work.failed, len(work.missing)) == (1, 0, 1)


@pytest.mark.nightly
def test_a_batch_takes_what_was_foretold(campaign, tmp_path):
    """Wide, since other work on the machine may come and go in between; a wrong unit or a factor of cores shows."""
    env = {**os.environ, "PYTHONWARNINGS": "ignore"}
    command = [sys.executable, "-m", "aqualog"]
    text = subprocess.run(
        [*command, "plan", campaign, "--jobs", "2", "--sample", "5", "--within", "1h", "--json"],
        capture_output=True, text=True, check=True, env=env,
    ).stdout  # fmt: skip
    plan = json.loads(text)
    assert not campaign.with_suffix(".store").exists()
    began = time.monotonic()
    subprocess.run(
        [*command, "batch", campaign, "-o", tmp_path / "store", "--jobs", "2"], capture_output=True, check=True, env=env
    )
    seconds = time.monotonic() - began
    stored = sum(p.stat().st_size for p in (tmp_path / "store" / "samples").iterdir())
    assert plan["logs"] == {"to_measure": 12, "kept": 0, "failed_before": 0, "missing": 0}
    assert 1 / 2.5 < plan["wall_s"]["value"] / seconds < 2.5
    assert 0.8 < plan["store"]["bytes"]["value"] / stored < 1.25
    assert plan["wall_s"]["low"] <= plan["wall_s"]["value"] <= plan["wall_s"]["high"]
    assert plan["within"]["shards"] == 1
    assert 5e7 < plan["memory"]["process_bytes"] < 2e9
    assert len(plan["sample"]) == 5


def test_text_and_nothing_left(tmp_path):
    path = make_campaign(tmp_path, speeds=(70, 80), repeats=1)
    result = run("plan", path, "--jobs", "1", "--within", "1h")
    assert result.exit_code == 0, result.stderr
    assert "2 logs to measure (2 parquet" in result.stdout
    assert "within 1h: 1 shard" in result.stdout
    run_batch(configure(path), Store(tmp_path / "campaign.store"))
    assert "nothing to measure: 2 logs" in run("plan", path).stdout
    assert json.loads(run("plan", path, "--json").stdout)["logs"]["kept"] == 2


def test_errors(tmp_path, campaign):
    assert run("plan", campaign, "--within", "soon").exit_code == 2
    path = make_campaign(tmp_path, speeds=(70,), repeats=2)
    for log in (tmp_path / "logs").iterdir():
        log.write_bytes(log.read_bytes()[:5000])
    result = run("plan", path)
    assert result.exit_code == 4
    assert "none of 2 logs of the sample" in result.stderr


@pytest.mark.parametrize(
    ("kept", "times"), [([{"a"}, {"a", "b"}], 2), ([{"a", "b"}, {"a", "b"}], 1), ([{"a"}, set()], 1)]
)
def test_a_sample_in_which_was_compiled_is_measured_again(kept, times, monkeypatch):
    """Only the first plan after an installation compiles; the batch behind it does not."""
    states, measured, heard = iter(kept), [], []
    monkeypatch.setattr("aqualog.campaign.plan.kept_code", lambda: frozenset(next(states)))
    monkeypatch.setattr("aqualog.campaign.plan._measured_once", lambda *given: measured.append(given) or len(measured))
    assert forecast.measure_cost(None, [], processes=2, told=lambda: heard.append(len(measured))) == times
    assert heard == [1] * (times - 1)


def test_kept_code_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path))
    assert kept_code() == frozenset()
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside" / "f.nbi").write_bytes(b"")
    (tmp_path / "beside" / "note.txt").write_bytes(b"")
    assert [Path(p).name for p, _ in kept_code()] == ["f.nbi"]


def test_no_number_of_shards_tells_what_takes_long(tmp_path):
    path = make_campaign(tmp_path, speeds=(70,), repeats=1)
    text = run("plan", path, "--jobs", "1", "--within", "0.001s").stdout
    assert re.search(r"no number of shards is enough: a process starts in \d+ s, the longest log takes \d+ s", text)
