"""A log that crashes its reader, hangs, or takes without end costs that log, and nobody else."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not hasattr(signal, "sigtimedwait"), reason="commands work in one process here")

HOSTILE = '''
import collections, ctypes, importlib, itertools, os, sys, tempfile, time
from pathlib import Path
import aqualog.io.open_log as opening
from aqualog.guard.reading import unfinished
module, name, _ = opening._READERS["csv"]

def write(path):
    with tempfile.NamedTemporaryFile() as file:
        while True:
            file.write(bytes(1_000_000))

def crash(path):
    tempfile.mkstemp()
    path.with_suffix(".tmp").touch()
    with unfinished(path.with_suffix(".tmp")):
        ctypes.string_at(0)

def consume(path):
    collections.deque(itertools.repeat(0), maxlen=0)  # in C, with the interpreter's lock held, deaf to signals

ACTS = {
    "crash": crash, "leave": lambda p: os._exit(0), "hang": consume, "sleep": lambda p: time.sleep(60), "spin": consume,
    "memory": lambda p: [bytearray(50_000_000) for _ in range(10**6)], "write": write,
    "panic": lambda p: os.write(2, PANIC.encode()),
}
PANIC = r"""a library's warning

thread '<unnamed>' (28) panicked at crates/polars/column.rs:301:37:
assertion `left == right` failed
  left: 5
 right: 6
note: run with `RUST_BACKTRACE=1` environment variable to display a backtrace

thread 'polars-1' panicked at crates/polars/column.rs:1:1:
called `Option::unwrap()` on a `None` value

its last word"""

def bad(path, options):
    act = ACTS.get(path.stem)
    if act:
        sys.stderr.write(f"READY {os.getpid()}\\n")
        sys.stderr.flush()
        act(path)
    return getattr(importlib.import_module(module), name)(path, options)

opening._READERS["csv"] = ("__main__", "bad", "rows")
'''
LOOK = """
import json
from typing import Annotated
import typer
from aqualog.cli import main
from aqualog.core.errors import AqualogError
from aqualog.io.open_log import open_log

app = typer.Typer()

@app.command()
def look(logs: list[str]):
    from aqualog.cli.console import guarded
    done, failed = [], []
    with guarded(debug=False):
        for name in logs:
            try:
                with open_log(Path(name)) as log:
                    done.append(log.format)
            except AqualogError as error:
                failed.append(error.line())
        sys.stderr.writelines(f"error: {line}\\n" for line in failed)
        sys.stdout.write(json.dumps(done))
    raise typer.Exit(3 if len(done) < len(logs) else 0)

main.app = app
main.run()
"""
REAL = "from aqualog.cli.main import run\nrun()\n"


@pytest.fixture
def folder(tmp_path):
    for name in ("good", "good2", "crash", "leave", "hang", "sleep", "spin", "memory", "write"):
        (tmp_path / f"{name}.csv").write_text("t [s],v_x [m/s]\n0,1\n1,2\n")
    (tmp_path / "tmp").mkdir()
    return tmp_path


def started(folder, *arguments, code=LOOK, **limits):
    env = {**os.environ, "TMPDIR": str(folder / "tmp"), **{f"AQUALOG_LIMIT_{k}": str(v) for k, v in limits.items()}}
    return subprocess.Popen(
        [sys.executable, "-c", HOSTILE + code, *arguments], cwd=folder, text=True, env=env, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def ended(process, within=30.0):
    out, err = process.communicate(timeout=within)
    return process.returncode, out, [line for line in err.splitlines() if not line.startswith("READY")]


def test_a_library_is_heard_but_not_its_panics(folder):
    (folder / "panic.csv").write_text("t [s],v_x [m/s]\n0,1\n1,2\n")
    assert ended(started(folder, "panic.csv")) == (0, '["csv"]', ["a library's warning", "", "its last word"])
    code, _, told = ended(started(folder, "inspect", "panic.csv", "--debug", code=REAL))
    assert code == 0
    assert any("panicked" in line for line in told)


@pytest.mark.parametrize("text", [b"x" * 99 + b"\n", b"y" * 100], ids=["lines", "endless"])
def test_a_library_that_says_much_does_not_wait_for_the_one_that_watches(folder, text):
    """Nearly what a pipe holds, again and again: looked at four times a second that takes 20 s."""
    (folder / "much.csv").write_text("t [s],v_x [m/s]\n0,1\n1,2\n")
    much = f"ACTS['much'] = lambda p: [(os.write(2, {text!r} * 600), time.sleep(0.01)) for _ in range(80)]\n"
    code, _, told = ended(started(folder, "much.csv", code=much + LOOK), within=10.0)
    assert code == 0
    assert sum(len(line) for line in told) == len(text.rstrip()) * 600 * 80


LINES = {
    "crash": "reading it ended the process (SIGSEGV: a fault of a library that reads it)",
    "leave": "reading it ended the process (exit code 0: a reading library gave up)",
    "hang": "reading it took longer than 3 s. Try: a higher AQUALOG_LIMIT_S",
    "spin": "reading it took more than 0.1 s of processor time. Try: a higher AQUALOG_LIMIT_CPU_S",
    "memory": "reading it takes more memory than the 500 MB that it may have. "
    "Try: a higher AQUALOG_LIMIT_MB (--limit-mb of a batch)",
    "write": "reading it writes a file of more than 5 MB. Try: a higher AQUALOG_LIMIT_FILE_MB",
}
LIMIT = {"hang": {"S": 3}, "spin": {"CPU_S": 0.1}, "memory": {"MB": 500}, "write": {"FILE_MB": 5}}


@pytest.mark.parametrize(
    "kind", ["crash", "hang", "write", *(pytest.param(k, marks=pytest.mark.nightly) for k in ("memory", "spin"))]
)
def test_one_bad_log_is_one_line_and_the_others_are_read(folder, kind):
    code, out, lines = ended(started(folder, "good.csv", f"{kind}.csv", "good2.csv", **LIMIT.get(kind, {})))
    assert lines == [f"error: {kind}.csv: {LINES[kind]}"]
    assert json.loads(out) == ["csv", "csv"]
    assert code == 3
    assert not list((folder / "tmp").iterdir())
    assert not list(folder.glob("*.tmp"))


def test_several_bad_logs_and_no_core(folder):
    code, out, lines = ended(started(folder, "crash.csv", "good.csv", "leave.csv"))
    assert [line.split(":")[1] for line in lines] == [" crash.csv", " leave.csv"]
    assert (code, json.loads(out)) == (3, ["csv"])
    assert not list(folder.glob("core*"))


def test_a_command_on_one_log_that_crashes_it_fails(folder):
    code, out, lines = ended(started(folder, "inspect", "crash.csv", "--json", code=REAL))
    assert (code, out, lines) == (1, "", [f"error: crash.csv: {LINES['crash']}"])


@pytest.mark.nightly
def test_a_command_on_many_logs_one_of_which_crashes_it_goes_on(folder):
    (folder / "logs").mkdir()
    for name in ("good", "crash"):
        shutil.copy(folder / f"{name}.csv", folder / "logs")
    code, out, lines = ended(started(folder, "campaign", "init", "logs", "--json", code=REAL))
    document = json.loads(out)
    assert document["left_out"] == {"crash.csv": LINES["crash"]}
    assert len(document["drives"]) == 2  # the broken one stays as a run that fails
    assert (code, lines) == (3, [])


def gone(number):
    for _ in range(100):
        try:
            state = Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state == "Z":  # a process whose parent was killed waits for init
            return True
        time.sleep(0.05)
    return False


@pytest.mark.parametrize(
    ("kind", "to_all"),
    [("sleep", False), ("sleep", True), ("hang", False), pytest.param("hang", True, marks=pytest.mark.nightly)],
)
def test_an_interrupt_ends_both_at_once(folder, kind, to_all):
    """Also while a library does not come back; the group gets it as from a terminal, once more than needed."""
    process = started(folder, f"{kind}.csv", "crash.csv")
    worker = int(process.stderr.readline().split()[1])
    began = time.monotonic()
    (os.killpg if to_all else os.kill)(process.pid, signal.SIGINT)
    code, out, lines = ended(process)
    assert time.monotonic() - began < 4.0  # 2 s, and what a busy machine adds
    assert (code, out, lines) == (130, "", ["interrupted"])
    assert gone(worker)
    assert not list((folder / "tmp").iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="only there a process is told of its parent's end")
def test_a_command_that_is_killed_leaves_no_worker(folder):
    """And what it had in the temporary folder goes with the next command, but for what one that lives has there."""
    process = started(folder, "hang.csv")
    worker = int(process.stderr.readline().split()[1])
    assert worker != process.pid
    process.kill()
    process.communicate(timeout=20)
    assert gone(worker)
    (left,) = (folder / "tmp").iterdir()
    (left / "unpacked").mkdir()
    (left / "unpacked" / "piece").write_text("x")
    beside = started(folder, "sleep.csv")
    beside.stderr.readline()
    (living,) = (folder / "tmp").iterdir()
    assert living != left
    assert ended(started(folder, "good.csv"))[0] == 0
    assert list((folder / "tmp").iterdir()) == [living]
    beside.send_signal(signal.SIGTERM)
    assert ended(beside)[0] == 130
    assert not list((folder / "tmp").iterdir())


def test_switched_off_a_command_works_in_the_process_that_was_called(folder, monkeypatch):
    monkeypatch.setenv("AQUALOG_LIMITS", "off")
    process = started(folder, "crash.csv")
    assert int(process.stderr.readline().split()[1]) == process.pid
    assert ended(process)[0] == -signal.SIGSEGV
