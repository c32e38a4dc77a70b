"""The store when the world misbehaves: logs that change, disks that fill, files that break, batches side by side."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest

from aqualog.campaign import batch, place
from aqualog.campaign.batch import run_batch
from aqualog.campaign.jobs import _BEHIND, code_stamp
from aqualog.campaign.results import load_results
from aqualog.campaign.store import MARK, Store
from aqualog.config.configured import configure, configure_logs
from aqualog.core.errors import AqualogError, LogError
from aqualog.guard.worker import most_processes
from aqualog.io.fingerprint import Contents
from tests.campaign.made import make_campaign
from tests.commands import run


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A campaign of three logs with its store, never spoilt."""
    folder = tmp_path_factory.mktemp("faults")
    run_batch(configure(make_campaign(folder, speeds=(80, 90, 100), repeats=1)), Store(folder / "campaign.store"))
    return folder


@pytest.fixture
def own(made, tmp_path):
    """A copy to spoil; its store is whole."""
    shutil.copytree(made, tmp_path / "c")
    return tmp_path / "c"


@pytest.fixture
def bare(own):
    """A copy without a store."""
    shutil.rmtree(own / "campaign.store")
    return own


def store_in(folder):
    return Store(folder / "campaign.store")


def batched(folder, **options):
    return run_batch(configure(folder / "campaign.toml"), store_in(folder), **options)


def first_file(folder):
    return sorted((folder / "campaign.store" / "samples").iterdir())[0]


def failures(folder):
    return [p.read_text() for p in (folder / "campaign.store" / "failed").iterdir()]


def spoil(monkeypatch, name, act):
    """Let `act(path)` happen before a log of that name is read."""
    real = batch.load_drive

    def reads(logs, **options):
        if logs[0].name == name:
            act(logs[0])
        return real(logs, **options)

    monkeypatch.setattr(batch, "load_drive", reads)


def test_a_log_that_changes_meanwhile_is_kept_under_no_key(bare, monkeypatch):
    log = bare / "logs" / "v090_0.parquet"
    good, other = log.read_bytes(), (bare / "logs" / "v100_0.parquet").read_bytes()
    spoil(monkeypatch, log.name, lambda path: path.write_bytes(other))
    outcome = batched(bare)
    assert outcome.made == 2
    assert "changed while it was read" in next(iter(outcome.failed.values()))
    assert not failures(bare)
    monkeypatch.undo()
    log.write_bytes(good)
    assert batched(bare).made == 1
    clean = Store(bare / "clean")
    run_batch(configure(bare / "campaign.toml"), clean)
    for key in clean.keys()[0]:
        assert store_in(bare).about(key) == clean.about(key)
        assert store_in(bare).samples(key).equals(clean.samples(key))


def test_a_log_that_becomes_bad_meanwhile_has_not_failed_for_its_key(bare, monkeypatch):
    spoil(monkeypatch, "v090_0.parquet", lambda path: path.write_bytes(b"x" * 50))
    assert "changed while it was read" in next(iter(batched(bare).failed.values()))
    assert not failures(bare)


def fails_with(error):
    def act(_path):
        raise error

    return act


def wrapped():
    error = LogError("cannot be read")
    error.__cause__ = OSError(5, "Input/output error")
    return error


@pytest.mark.parametrize(
    "error",
    [
        OSError(24, "Too many open files"), MemoryError(), ZeroDivisionError("x"), wrapped(), AqualogError("x"),
    ],
    ids=["system", "memory", "unforeseen", "system behind a LogError", "of no kind"],
)  # fmt: skip
def test_what_may_pass_is_tried_again(bare, monkeypatch, error):
    spoil(monkeypatch, "v090_0.parquet", fails_with(error))
    assert len(batched(bare).failed) == 1
    assert not failures(bare)
    monkeypatch.undo()
    assert batched(bare).made == 1


def test_a_log_that_is_away_for_a_while(bare, monkeypatch):
    spoil(monkeypatch, "v090_0.parquet", lambda path: path.rename(bare / "away"))
    assert "No such file" in next(iter(batched(bare).failed.values()))
    assert not failures(bare)
    monkeypatch.undo()
    (bare / "away").rename(bare / "logs" / "v090_0.parquet")
    assert batched(bare).made == 1


def test_what_the_content_proves_is_not_tried_again(bare, monkeypatch):
    (bare / "logs" / "v090_0.parquet").write_bytes(b"PAR1" + b"x" * 50)
    assert len(batched(bare).failed) == 1
    assert len(failures(bare)) == 1
    spoil(monkeypatch, "v090_0.parquet", lambda _: pytest.fail("read again"))
    assert len(batched(bare).failed) == 1


def test_every_source_behind_a_result_is_in_its_key(made):
    log = made / "logs" / "v100_0.parquet"
    code = (
        "import sys; from pathlib import Path; from aqualog.core.vehicle import Vehicle\n"
        "from aqualog.align.load import load_signals; from aqualog.campaign.measure import measure\n"
        f"measure(load_signals([Path({str(log)!r})], vehicle=Vehicle()), Vehicle())\n"
        "print(*(m for m in sys.modules if m.startswith('aqualog')))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    loaded = {m.removeprefix("aqualog").removeprefix(".").replace(".", "/") for m in out.split()}
    names_only = {"", "campaign", "evaluate"}  # packages that say what they are for, and the version
    uncovered = {m for m in loaded - names_only if m.split("/")[0] not in _BEHIND and f"{m}.py" not in _BEHIND}
    assert len(loaded) > 50
    assert not uncovered
    package = Path(batch.__file__).parents[1]
    assert all((package / name).exists() for name in _BEHIND)
    assert code_stamp()


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_full_disk_is_the_stores_fault_and_ends_the_batch(bare, jobs):
    """A limit on the size of files stands for it: the results do not fit, the marks do."""
    row = (bare / "runs.csv").read_text().splitlines()[1]
    for k in range(4):
        shutil.copy(bare / "logs" / "v080_0.parquet", bare / "logs" / f"x{k}.parquet")
        with (bare / "runs.csv").open("a") as table:
            table.write(row.replace("v080_0", f"x{k}") + "\n")
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))\n"
        "from aqualog.cli.main import run; run()"
    )
    command = [sys.executable, "-c", code, "batch", str(bare / "campaign.toml"), "--jobs", str(jobs)]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 1
    lines = [line for line in result.stderr.splitlines() if line.startswith("error")]
    assert len(lines) == 1
    assert "campaign.store: file too large; expected room for the results" in lines[0]
    assert not failures(bare)
    assert batched(bare).done == 7


def test_no_space_left(bare, monkeypatch):
    def full(path, write, **options):
        if path.suffix == ".parquet":
            raise OSError(28, "No space left on device")
        real(path, write, **options)

    real = place.write_whole
    monkeypatch.setattr(place, "write_whole", full)
    with pytest.raises(AqualogError, match=r"campaign\.store: no space left on device; expected room") as caught:
        batched(bare)
    assert caught.value.exit_code == 1
    assert not failures(bare)


@contextlib.contextmanager
def read_only(folder, monkeypatch):
    """As on a file system that is read-only; permissions do not bind every user."""
    real = os.open

    def refuses(path, flags, *rest, **options):
        if flags & (os.O_WRONLY | os.O_RDWR) and Path(os.fsdecode(path)).is_relative_to(folder):
            raise OSError(30, "Read-only file system", str(path))
        return real(path, flags, *rest, **options)

    monkeypatch.setattr(os, "open", refuses)
    try:
        yield
    finally:
        monkeypatch.setattr(os, "open", real)


def test_a_read_only_store_serves_while_nothing_is_new(own, monkeypatch):
    before = {p: p.stat().st_mtime_ns for p in (own / "campaign.store").rglob("*")}
    with read_only(own / "campaign.store", monkeypatch):
        assert run("bin-slipslope", own / "campaign.toml").exit_code == 0
        result = run("batch", own / "campaign.toml", "--json")
        assert json.loads(result.stdout)["kept"] == 3
        with pytest.raises(AqualogError, match=r"cannot be written \(Read-only"):
            batched(own, force=True)
    assert {p: p.stat().st_mtime_ns for p in (own / "campaign.store").rglob("*")} == before


def metadata(path, about):
    pl.read_parquet(path).write_parquet(path, metadata={"aqualog": about})


def without_columns(path):
    about = pl.read_parquet_metadata(path)["aqualog"]
    pl.DataFrame({"a": [1]}).write_parquet(path, metadata={"aqualog": about})


@pytest.mark.parametrize(
    "damage",
    [
        lambda p: p.write_bytes(b""),
        lambda p: p.write_bytes(p.read_bytes()[:2000]),
        lambda p: metadata(p, "[]"),
        lambda p: metadata(p, "{}"),
        lambda p: metadata(p, "nonsense"),
        without_columns,
    ],
    ids=["empty", "cut", "a list", "without parts", "no JSON", "without columns"],
)
def test_a_damaged_result_is_made_again(own, damage):
    path = first_file(own)
    good = store_in(own).samples(path.stem)
    damage(path)
    result = run("bin-slipslope", own / "campaign.toml")
    assert result.exit_code == 0
    assert store_in(own).samples(path.stem).equals(good)
    assert batched(own).kept == 3


def test_damaged_data_are_told_once(own):
    path = first_file(own)
    path.write_bytes(b"\0" * 3000 + path.read_bytes()[3000:])
    data = load_results(configure(own / "campaign.toml"), store_in(own))
    with pytest.raises(LogError, match=f"{path.name}: is damaged"):
        [data.samples(r) for r in data.done]
    assert batched(own).made == 1


def test_damage_that_cannot_be_made_good_leaves_the_others(own, monkeypatch):
    first_file(own).write_bytes(b"")
    for name in ("v080_0.parquet", "v090_0.parquet", "v100_0.parquet"):
        spoil(monkeypatch, name, fails_with(OSError(5, "Input/output error")))
    result = run("batch", own / "campaign.toml")
    assert result.exit_code == 3
    assert "2 logs done" in result.stdout


@pytest.mark.parametrize("document", ["[1, 2]", "5", '"x"', "[[1, 2]]", '{"a": 5}', "{", "", None])
def test_contents_of_a_wrong_shape_are_none(own, document):
    path = own / "campaign.store" / "contents.json"
    path.unlink()
    batched(own)
    good = json.loads(path.read_text())
    path.write_text(json.dumps(dict.fromkeys(good, 5)) if document is None else document)
    assert batched(own).kept == 3
    assert json.loads(path.read_text()) == good


@pytest.mark.parametrize("entry", [[1], [1, 2], [1, 2, None], [1.0, 2, "x"], {"0": 1}, [1, 2, "x", 4]])
def test_entries_of_a_wrong_shape_are_none(entry):
    assert not Contents({"/a": entry}).known


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda s: (s / MARK).write_text('{"schema_version": 99}'), "schema_version 99"),
        (lambda s: (s / MARK).write_text("{"), "schema_version None"),
        (lambda s: (shutil.rmtree(s / "samples"), (s / "samples").write_text("")), "samples: is not a folder"),
        (lambda s: ((s / "contents.json").unlink(), (s / "contents.json").mkdir()), "contents.json: is a folder"),
        (lambda s: (shutil.rmtree(s), s.write_text("")), "campaign.store: is a file"),
        (lambda s: (shutil.rmtree(s), s.symlink_to("nowhere")), "campaign.store: is a broken link"),
        (lambda s: (shutil.rmtree(s), s.symlink_to(s)), "campaign.store: is a broken link"),
    ],
    ids=["other version", "damaged mark", "samples a file", "contents a folder", "a file", "dangling", "loop"],
)  # fmt: skip
def test_what_is_no_store_is_said(own, change, text):
    change(own / "campaign.store")
    for command in ("batch", "bin-slipslope"):
        result = run(command, own / "campaign.toml")
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert text in result.stderr


def test_a_samples_file_that_is_a_folder_is_said(own):
    path = first_file(own)
    path.unlink()
    path.mkdir()
    with pytest.raises(AqualogError, match=f"{path.name}: cannot be written"):
        batched(own)


def test_a_store_whose_making_was_cut_short(bare):
    (bare / "campaign.store").mkdir()
    for name in ("lock", f".{MARK[:-5]}-abcd1234.json.tmp"):
        (bare / "campaign.store" / name).write_text("")
    assert batched(bare).made == 3
    assert not list((bare / "campaign.store").glob(".*.tmp"))


def test_files_of_others_are_not_swept(own):
    mine = own / "campaign.store" / ".mine.tmp"
    mine.write_text("precious")
    batched(own)
    assert mine.exists()


def test_devices_pipes_and_loops_are_a_fault_of_that_log_only(bare):
    logs = bare / "logs"
    os.mkfifo(logs / "pipe.mf4")
    (logs / "loop.mf4").symlink_to("loop.mf4")
    odd = (logs / "pipe.mf4", logs / "loop.mf4", Path("/dev/zero"))
    outcome = run_batch(configure_logs([logs / "v080_0.parquet", *odd], bare / "car.toml"), Store(bare / "s"))
    assert outcome.made == 1
    pipe, loop, zero = outcome.failed.values()
    assert pipe.endswith("pipe.mf4: is a device or a pipe; expected a log")
    assert zero == "/dev/zero: is a device or a pipe; expected a log"
    assert "loop.mf4: Too many levels of symbolic links" in loop


def test_a_loop_does_not_end_the_command(bare):
    (bare / "logs" / "v080_0.parquet").unlink()
    (bare / "logs" / "v080_0.parquet").symlink_to("v080_0.parquet")
    result = run("batch", bare / "campaign.toml")
    assert result.exit_code == 3
    assert "2 logs done" in result.stdout


def test_a_log_that_grows_while_it_is_hashed_has_an_end(tmp_path):
    """The hash is of the bytes that were there when it began."""
    log = tmp_path / "log"
    log.write_bytes(b"x" * 3_000_000)
    whole = Contents().of(log)
    real, state = type(log).stat, log.stat()
    with log.open("ab") as file:
        file.write(b"y" * 1000)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(log), "stat", lambda p, **kw: state if p == log else real(p, **kw))
        assert Contents().of(log) == whole
    assert Contents().of(log) != whole


def test_one_batch_at_a_time(own):
    code = (
        "import sys; from pathlib import Path; from aqualog.campaign.store import Store\n"
        "with Store(Path(sys.argv[1])).held(must=True): print('held', flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", code, str(own / "campaign.store")]
    half = own / "campaign.store" / "samples" / ".x-abcd1234.parquet.tmp"
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        half.write_text("half-written by the other")
        assert run("bin-slipslope", own / "campaign.toml").exit_code == 0  # a reader
        result = run("batch", own / "campaign.toml", "--force")
        assert result.exit_code == 1
        assert f"is in use by another batch (process {other.pid})" in result.stderr
        assert half.exists()
        other.kill()
    assert batched(own, force=True).made == 3
    assert not half.exists()


def children_of(number):
    try:
        return Path(f"/proc/{number}/task/{number}/children").read_text().split()
    except OSError:  # it has ended meanwhile
        return []


@pytest.mark.parametrize("delay_s", [0.15, *(pytest.param(s, marks=pytest.mark.nightly) for s in (0.0, 0.4))])
def test_an_interrupt_while_processes_start_is_one_line(tmp_path, delay_s):
    campaign = make_campaign(tmp_path, speeds=(70, 80), repeats=24)
    command = [sys.executable, "-m", "aqualog", "batch", str(campaign), "--jobs", "2", "--progress", "plain"]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, start_new_session=True
    ) as process:
        if not Path(f"/proc/{process.pid}/task/{process.pid}/children").exists():
            process.kill()
            pytest.skip("no /proc")
        for _ in range(6000):  # the tracker of multiprocessing is one child, the first worker the second
            if len([c for own in children_of(process.pid) for c in children_of(own)]) >= 2:
                break
            time.sleep(0.005)
        time.sleep(delay_s)
        os.killpg(process.pid, signal.SIGINT)
        error = process.stderr.read()
        code = process.wait()
    assert code == 130
    assert "Traceback" not in error
    assert "interrupted" in error
    assert run_batch(configure(campaign), store_in(tmp_path)).done == 48


def test_no_result_goes_into_a_store(own):
    table = own / "campaign.store" / "runs.parquet"
    before = table.read_bytes()
    (own / "alias").symlink_to("campaign.store")
    for target in (table, own / "campaign.store" / "x.csv", own / "alias" / "runs.parquet"):
        result = run("bin-slipslope", own / "campaign.toml", "-o", target, "--force")
        assert result.exit_code == 2
        assert "lies in a store of results" in result.stderr
    assert table.read_bytes() == before
    assert run("bin-slipslope", own / "campaign.toml", "-o", own / "x.csv").exit_code == 0


def test_processes_are_not_without_end(own):
    result = run("batch", own / "campaign.toml", "--jobs", "1000")
    assert f"jobs 1000: {most_processes()} processes are the most" in result.stderr


def test_lists_of_thousands_of_levels_are_no_json(own):
    store = Store(own / "campaign.store")
    for name in ("manifest.json", "contents.json"):
        (own / "campaign.store" / name).write_text("[" * 100_000)
        assert store.read_json(name) is None
    (own / "campaign.store" / "failed").mkdir(exist_ok=True)
    (own / "campaign.store" / "failed" / "k.json").write_text("[" * 100_000)
    assert "cannot be read" in store.failure("k")


def test_a_pipe_in_a_store_is_not_waited_for(own):
    (own / "campaign.store" / "contents.json").unlink()
    os.mkfifo(own / "campaign.store" / "contents.json")
    result = run("batch", own / "campaign.toml", "--progress", "off")
    assert result.exit_code == 2
    assert "contents.json: is a device or a pipe" in result.stderr


@pytest.mark.parametrize("seconds", ["inf", "1e308", "nan"])
def test_limits_that_no_clock_has_are_refused(own, seconds):
    result = run("batch", own / "campaign.toml", "--limit-s", seconds)
    assert result.exit_code == 2
    assert "Invalid value for '--limit-s'" in result.stderr
