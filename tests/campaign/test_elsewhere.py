"""A batch in parts, on a cluster, and with limits: the store is that of one undisturbed batch."""

import json
import signal
import subprocess
import sys
import time

import polars as pl
import pytest

from aqualog.campaign.definition import Shard, part_of, shard_of
from aqualog.config.configured import configure
from aqualog.core.errors import ConfigError
from aqualog.guard.worker import Crashed
from tests.campaign.dask_here import cluster, free_port, with_children
from tests.campaign.made import make_campaign
from tests.commands import run


def samples_of(store):
    return {p.name: p.read_bytes() for p in (store / "samples").glob("*.parquet")}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A campaign of twelve runs and the store of a plain batch."""
    folder = tmp_path_factory.mktemp("whole")
    campaign = make_campaign(folder, speeds=(70, 80, 90, 100), repeats=3)
    assert run("batch", campaign, "-o", folder / "plain", "--jobs", 1).exit_code == 0
    return campaign, folder / "plain"


def test_parts_are_disjoint_and_complete_and_stay_as_logs_are_added(whole):
    campaign = configure(whole[0]).campaign
    parts = [part_of(campaign, Shard(i, 5)).runs for i in range(1, 6)]
    assert sorted(r.logs for p in parts for r in p) == sorted(r.logs for r in campaign.runs)
    fewer = type(campaign)(campaign.name, campaign.path, None, campaign.runs[:-1])
    for i, p in enumerate(parts, 1):
        assert [r for r in p if r is not campaign.runs[-1]] == list(part_of(fewer, Shard(i, 5)).runs)


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "1/0", "-1/3", "1/9999999", ""])
def test_what_is_no_shard(text):
    with pytest.raises(ConfigError):
        shard_of(text)


def test_shards_side_by_side_and_then_the_tables(whole, tmp_path):
    campaign, plain = whole
    store = tmp_path / "s"
    command = [sys.executable, "-m", "aqualog", "batch", str(campaign), "-o", str(store), "--jobs", "1", "-q"]
    running = [subprocess.Popen([*command, "--shard", f"{i}/3"], stdout=subprocess.DEVNULL) for i in (1, 2, 3)]
    assert [p.wait() for p in running] == [0, 0, 0]
    assert samples_of(store) == samples_of(plain)
    assert not (store / "runs.parquet").exists()
    done = json.loads(run("batch", campaign, "-o", store, "--json").stdout)
    assert (done["made"], done["kept"]) == (0, 12)
    assert pl.read_parquet(store / "runs.parquet").equals(pl.read_parquet(plain / "runs.parquet"))


def test_a_part_without_logs_is_no_fault(whole, tmp_path):
    codes = [
        run("batch", whole[0], "-o", tmp_path / "s", "--shard", f"{i}/40").exit_code for i in (1, 2, 3, 38, 39, 40)
    ]
    assert set(codes) == {0}


def test_the_same_shard_twice_and_a_batch_beside_a_shard_are_refused(whole, tmp_path):
    from aqualog.campaign.store import Store

    with Store(tmp_path / "s", "1-of-3").held(must=True):
        again = run("batch", whole[0], "-o", tmp_path / "s", "--shard", "1/3")
        plain = run("batch", whole[0], "-o", tmp_path / "s")
        assert run("batch", whole[0], "-o", tmp_path / "s", "--shard", "2/3").exit_code == 0
    assert again.exit_code != 0
    assert "in use by another batch" in again.stderr
    assert plain.exit_code != 0


@pytest.mark.nightly
def test_a_worker_that_is_killed_half_way_leaves_no_trace(tmp_path):
    campaign = make_campaign(tmp_path, speeds=(70, 80, 90, 100), repeats=12)
    assert run("batch", campaign, "-o", tmp_path / "plain").exit_code == 0
    store = tmp_path / "s"
    command = [sys.executable, "-m", "aqualog", "batch", str(campaign), "-o", str(store), "--json", "--progress", "off"]
    with (
        cluster(tmp_path) as (address, (_, first, _)),
        subprocess.Popen([*command, "--cluster", address], stdout=subprocess.PIPE, text=True) as process,
    ):
        for _ in range(6000):
            if (store / "samples").is_dir() and sum(1 for _ in (store / "samples").glob("*.parquet")) >= 8:
                break
            time.sleep(0.01)
        with_children(first, signal.SIGKILL)
        text = process.stdout.read()
        assert process.wait() == 0
    document = json.loads(text)
    assert document["made"] == 48
    assert document["failed"] == []
    assert samples_of(store) == samples_of(tmp_path / "plain")
    assert pl.read_parquet(store / "runs.parquet").equals(pl.read_parquet(tmp_path / "plain" / "runs.parquet"))


def test_no_scheduler_is_a_clear_error(whole, tmp_path, monkeypatch):
    monkeypatch.setattr("aqualog.campaign.cluster._ANSWER_S", 1.0)
    for address in (f"tcp://127.0.0.1:{free_port()}", "nonsense", "http://x"):
        result = run("batch", whole[0], "-o", tmp_path / "s", "--cluster", address)
        assert result.exit_code == 2
        assert "no dask scheduler answers" in result.stderr


@pytest.mark.parametrize("more", [["--cluster", "tcp://h:1", "--jobs", "2"], ["--cluster", " "]])
def test_options_that_do_not_go_together(whole, tmp_path, more):
    assert run("batch", whole[0], "-o", tmp_path / "s", *more).exit_code == 2


def test_a_log_that_takes_too_long_is_told_and_tried_again(whole, tmp_path, monkeypatch):
    import aqualog.campaign.batch as batch

    def late(tasks, work, *, jobs, record, limits):
        first = next(iter(tasks))
        for key, task in tasks.items():
            record(key, Crashed(6.0) if key == first else work(*task))

    monkeypatch.setattr(batch, "work_on", late)
    result = run("batch", whole[0], "-o", tmp_path / "s", "--limit-s", "5")
    assert result.exit_code == 3
    assert "took longer than 5 s (--limit-s)" in result.stderr
    monkeypatch.undo()
    assert json.loads(run("batch", whole[0], "-o", tmp_path / "s", "--json").stdout)["made"] == 1
