"""What goes wrong on a cluster: each is told in a line, and what is done stays."""

import collections
import itertools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

import aqualog
from aqualog.campaign import cluster as asking
from aqualog.campaign.cluster import Asked, asked_of, bounds_here, on_cluster, own_stamp, unlike
from aqualog.cli.main import app
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.guard.reading import ReadLimits
from aqualog.guard.worker import NO_LIMITS, Bounds, Crashed, Limits
from tests.campaign.dask_here import cluster, with_children
from tests.campaign.made import make_campaign
from tests.commands import run


@contextmanager
def here(workers=1):
    """A scheduler and workers in this process; a fresh worker has not been asked yet."""
    from distributed import LocalCluster

    asking._fit.clear()
    with LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp://",
        host="127.0.0.1",
    ) as made:  # fmt: skip
        yield made


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return make_campaign(tmp_path_factory.mktemp("cluster"), speeds=(80, 100), repeats=1)


def batch(campaign, store, address):
    return CliRunner().invoke(
        app, ["batch", str(campaign), "-o", str(store), "--cluster", address, "--progress", "off"]
    )


def double(x):
    return 2 * x


def slowly(x):
    time.sleep(0.3)
    return x


def badly(kind, folder):
    if kind == "leaves":
        (Path(folder) / "tries").open("a").write("x")
        tempfile.mkstemp()
        os._exit(3)
    if kind == "hangs":  # in C, with the interpreter's lock held
        collections.deque(itertools.repeat(0), maxlen=0)
    if kind == "takes":
        try:
            bytearray(2_000_000_000)
        except MemoryError:
            return "no memory"
    return os.getpid()


@pytest.mark.parametrize("kind", ["leaves", *(pytest.param(k, marks=pytest.mark.nightly) for k in ("hangs", "takes"))])
def test_an_item_that_ends_its_process_costs_itself_only(tmp_path, monkeypatch, kind):
    """Not the worker, which here is the process of the tests; and it is tried no more than twice."""
    monkeypatch.setenv("AQUALOG_LIMIT_MB", "1500")
    found = {}
    limits = Limits(seconds=2.0) if kind == "hangs" else NO_LIMITS
    with here() as made, on_cluster(made.scheduler_address, limits=limits) as work_on:
        scratch = Path(next(iter(made.workers.values())).local_directory)
        work_on({k: (k, str(tmp_path)) for k in ("a", kind, "b")}, badly, found.__setitem__)
        assert len(list(scratch.glob("aqualog-*/*"))) == 0
    if kind == "takes":
        assert found[kind] == "no memory"
    else:
        assert isinstance(found[kind], Crashed)
        assert (found[kind].seconds >= 2.0) or kind == "leaves"
    if kind == "leaves":
        assert len((tmp_path / "tries").read_text()) <= 2
    assert os.getpid() not in {found["a"], found["b"]}
    assert {type(found[k]) for k in "ab"} == {int}


def test_what_a_worker_may_take(monkeypatch):
    """The command's word first, then the worker's own, and no more memory than dask gives."""
    monkeypatch.setenv("AQUALOG_LIMIT_S", "7")
    monkeypatch.setenv("AQUALOG_LIMIT_CPU_S", "8")
    monkeypatch.setenv("AQUALOG_LIMIT_MB", "900")
    asked = Bounds(Limits(3.0), ReadLimits(wall_s=5.0))
    assert bounds_here(asked, 10**9) == Bounds(Limits(3.0), ReadLimits(5.0, 8.0, 900_000_000))
    assert bounds_here(asked, 5 * 10**8).reading.memory == 5 * 10**8
    assert bounds_here(asked, None).reading.memory == 900_000_000
    monkeypatch.setenv("AQUALOG_LIMIT_CPU_S", "soon")
    with pytest.raises(ConfigError, match=r"AQUALOG_LIMIT_CPU_S: is 'soon'; expected"):
        bounds_here(asked, None)


def test_no_workers_is_said_after_a_while(campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(asking, "_WORKERS_S", 0.3)
    with here(workers=0) as made:
        result = batch(campaign, tmp_path / "s", made.scheduler_address)
        assert result.exit_code == 2
        assert f"{made.scheduler_address}: has no workers after 0 s. Try: `dask worker" in result.stderr


@pytest.mark.nightly
def test_the_last_worker_leaves(monkeypatch):
    monkeypatch.setattr(asking, "_ALONE_S", 0.5)
    monkeypatch.setattr(asking, "_WATCH_S", 0.1)
    found = {}

    def record(name, result):
        found[name] = result
        if len(found) == 1:
            made.scale(0)

    with here() as made, on_cluster(made.scheduler_address) as work_on, pytest.raises(AqualogError) as caught:
        work_on({i: (i,) for i in range(20)}, slowly, record)
    assert "has had no workers for" in caught.value.line()
    assert caught.value.exit_code == 1
    assert 1 <= len(found) < 20


def test_workers_that_have_what_is_asked(tmp_path):
    (tmp_path / "log").write_text("x")
    found = {}
    with here(workers=2) as made, on_cluster(made.scheduler_address) as work_on:
        work_on({i: (i,) for i in range(9)}, double, found.__setitem__)
    assert found == {i: 2 * i for i in range(9)}


@pytest.mark.parametrize("late", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_logs_that_a_worker_does_not_see(campaign, tmp_path, monkeypatch, late):
    """A worker behind another mount, there from the start or joined later: the file that it looks for is not there."""
    log = campaign.parent / "logs" / "v080_0.parquet"
    real = asking._missing
    monkeypatch.setattr(
        asking, "_missing", lambda files: real([(p.with_name("x") if p == log else p, s) for p, s in files])
    )
    if late:
        monkeypatch.setattr(asking._Scheduler, "everywhere", lambda self, ask, *args: {})
    with here() as made:
        result = batch(campaign, tmp_path / "s", made.scheduler_address)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert f"does not see {log.with_name('x')}; expected logs and store under the same paths" in result.stderr
    assert not list((tmp_path / "s" / "samples").iterdir())


def test_what_is_asked_of_a_worker(tmp_path):
    store, log = tmp_path / "s", tmp_path / "log"
    store.mkdir()
    log.write_text("content")
    with asked_of({"a": (store, "a", (log, tmp_path / "away")), "b": ("s3://bucket/store", "b", (log,))}) as asked:
        mark = next(store.iterdir())
        assert set(asked.files) == {(log, 7), (mark, mark.stat().st_size)}
        assert unlike(asked._replace(stamp=("0.1", "other"))).what.startswith("runs another aqualog (")
        mark.rename(store / "elsewhere")  # a folder of the same name on another machine
        assert unlike(asked).what == f"does not see {store}"
        (store / "elsewhere").rename(mark)
        log.write_text("other")
        assert unlike(asked).what == f"does not see {log} as it is here (5 byte, not 7)"
        log.write_text("content")
        assert unlike(asked) is None
    assert not list(store.iterdir())
    assert unlike(Asked(own_stamp(), ())) is None


def test_results_that_went_elsewhere_are_missed(campaign, tmp_path):
    """Workers that reach another store under the same address."""
    from aqualog.campaign.batch import run_batch
    from aqualog.campaign.store import Store
    from aqualog.config.configured import configure

    with Store(tmp_path / "other").held(must=True):
        pass  # begun by another batch, on another machine

    def elsewhere(tasks, work, record):
        for key, task in tasks.items():
            record(key, work(tmp_path / "other", *task[1:]))

    with pytest.raises(AqualogError, match="2 results that workers have written are missing here"):
        run_batch(configure(campaign), Store(tmp_path / "s"), elsewhere=elsewhere)


def command(campaign, store, address):
    return [
        sys.executable, "-m", "aqualog", "batch", str(campaign), "-o", str(store), "--cluster", address, "--progress",
        "off", "--json",
    ]  # fmt: skip


@pytest.mark.nightly
def test_a_scheduler_that_is_lost_half_way(tmp_path):
    campaign = make_campaign(tmp_path, speeds=(70, 80, 90, 100), repeats=24)
    plain, store = tmp_path / "plain", tmp_path / "s"
    with (
        cluster(tmp_path) as (address, (scheduler, *_)),
        subprocess.Popen(
            command(campaign, store, address), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process,
    ):
        for _ in range(6000):
            if (store / "samples").is_dir() and len(list((store / "samples").glob("*.parquet"))) >= 8:
                break
            time.sleep(0.01)
        with_children(scheduler, signal.SIGKILL)
        began = time.monotonic()
        out, error = process.communicate()
    assert process.returncode == 1
    assert time.monotonic() - began < 60.0
    lines = [line for line in error.splitlines() if line.startswith("error")]
    assert len(lines) == 1
    assert "the scheduler or its work is lost" in lines[0]
    assert "Traceback" not in error
    assert not out
    done = {p.name for p in (store / "samples").glob("*.parquet")}
    assert 8 <= len(done) < 96
    states = json.loads((store / "manifest.json").read_text())["states"]
    assert states["done"] >= 8
    assert not list(store.rglob(".seen-*"))
    again = run("batch", campaign, "-o", store, "--json")
    assert again.exit_code == 0
    assert json.loads(again.stdout)["kept"] == len(done)
    assert run("batch", campaign, "-o", plain).exit_code == 0
    for path in (*(plain / "samples").iterdir(), plain / "runs.parquet", plain / "events.parquet"):
        assert (store / path.relative_to(plain)).read_bytes() == path.read_bytes()


@pytest.mark.nightly
def test_workers_with_another_aqualog(campaign, tmp_path):
    shutil.copytree(Path(aqualog.__file__).parent, tmp_path / "other" / "aqualog")
    with (tmp_path / "other" / "aqualog" / "core" / "units.py").open("a") as source:
        source.write("# another\n")
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "other")}
    with cluster(tmp_path, workers=1, env=env, cwd=tmp_path) as (address, _):
        found = subprocess.run(command(campaign, tmp_path / "s", address), capture_output=True, text=True)
    assert found.returncode == 2
    assert "runs another aqualog" in found.stderr
    assert "expected the same code everywhere" in found.stderr
    assert not (tmp_path / "s" / "samples").exists() or not list((tmp_path / "s" / "samples").iterdir())


@pytest.mark.nightly
def test_what_answers_but_is_no_scheduler(campaign, tmp_path):
    with subprocess.Popen(
        [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=tmp_path,
    ) as server:
        port = server.stdout.readline().split("port ")[1].split()[0]
        began = time.monotonic()
        result = batch(campaign, tmp_path / "s", f"tcp://127.0.0.1:{port}")
        server.kill()
    assert result.exit_code == 2
    assert "no dask scheduler answers" in result.stderr
    assert time.monotonic() - began < 30.0


@pytest.mark.parametrize("kind", ["tcp", pytest.param("ws", marks=pytest.mark.nightly)])
def test_what_talks_before_it_is_asked_is_no_scheduler(kind):
    # as a length, what this says is more memory than there is
    with socket.create_server(("127.0.0.1", 0)) as server:
        said = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi"
        held = []

        def talk():
            while True:
                try:
                    held.append(server.accept()[0])
                    held[-1].sendall(said)
                except OSError:
                    return

        threading.Thread(target=talk, daemon=True).start()
        address = f"{kind}://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(ConfigError, match="no dask scheduler answers"), on_cluster(address):
            pass
        for one in held:
            one.close()
