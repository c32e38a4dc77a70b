"""How a command ends before its end: interrupts, an output that takes nothing, and what a killed one leaves behind."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from aqualog.model import campaign
from aqualog.model.programme import PROGRAMMES
from tests.conftest import ROOT

WAITING = """
import sys, time
from aqualog.align import load
from aqualog.evaluate import run as evaluation
def wait(*_, **__):
    sys.stderr.write("READY\\n")
    sys.stderr.flush()
    time.sleep(30)
load.load_signals = load.load_drive = wait
evaluation.evaluate = wait
from aqualog.cli.main import run
sys.argv = ["aqualog", *sys.argv[1:]]
run()
"""
CALLED_BACK = """
import ctypes, sys, time
from pathlib import Path
import typer
from aqualog.cli import main
from aqualog.cli.console import guarded
app = typer.Typer()
def called():
    sys.stderr.write("READY\\n")
    sys.stderr.flush()
    time.sleep(30)
@app.command()
def work():
    with guarded(debug=False):
        ctypes.CFUNCTYPE(None)(called)()
        time.sleep(30)
main.app = app
main.run()
"""
LOADING = """
import sys, time
from aqualog.cli import commands, start
def load(*_):
    sys.stderr.write("READY\\n")
    sys.stderr.flush()
    time.sleep(30)
commands.import_module = load
sys.argv = ["aqualog", "detect", "a.csv"]
start.run()
"""
STARTING = """
import sys, time
class Slow:
    def find_spec(self, name, path=None, target=None):
        if name == "aqualog.cli.main":
            sys.stderr.write("READY\\n")
            sys.stderr.flush()
            time.sleep(30)
from aqualog.cli import start
sys.meta_path.insert(0, Slow())
start.run()
"""
PRINTING = """
import sys
import typer
from aqualog.cli.console import guarded
app = typer.Typer()
@app.command()
def print_much(count: int):
    with guarded(debug=False):
        sys.stdout.write("x" * count)
app()
"""


@pytest.mark.parametrize(
    ("command", "told", "number"),
    [
        (("calibrate", "a.csv", "-o", "x.toml"), "interrupted, nothing was written", signal.SIGINT),
        (("evaluate", "a.csv", "-o", "x.html"), "interrupted, nothing was written", signal.SIGTERM),
        (("detect", "a.csv", "-o", "x"), "interrupted", signal.SIGINT),
    ],
)
def test_interrupted(tmp_path, command, told, number):
    (tmp_path / "car.toml").write_text('name = "car"\n')
    (tmp_path / "a.csv").write_text("t [s],v_x [m/s]\n0,1\n")
    with subprocess.Popen(
        [sys.executable, "-c", WAITING, *command, "--vehicle", "car.toml"], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stderr.readline() == "READY\n"
        process.send_signal(number)
        out, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert err.splitlines() == [told]
    assert out == ""
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "car.toml"]


@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_product_of_matrices_takes_one_thread_or_what_the_user_says(monkeypatch, threads):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if threads != "1":
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", threads)
    code = "import atexit, os, sys\nfrom aqualog.cli.start import run\nsys.argv = ['aqualog', '--version']\n"
    code += "atexit.register(lambda: print(os.environ['OPENBLAS_NUM_THREADS']))\nrun()"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.split()[-1] == threads


@pytest.mark.parametrize("code", [CALLED_BACK, LOADING, STARTING], ids=["called back", "loading", "starting"])
def test_interrupted_where_python_alone_would_lose_it_or_show_where(code):
    with subprocess.Popen([sys.executable, "-c", code], text=True, stderr=subprocess.PIPE) as process:
        assert process.stderr.readline() == "READY\n"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (130, "interrupted\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
@pytest.mark.parametrize("count", [10, 1_000_000])
def test_an_output_that_takes_nothing(count):
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        result = subprocess.run(
            [sys.executable, "-c", PRINTING, str(count)], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert result.returncode == 1
    assert result.stderr == "error: standard output: No space left on device. Try: another place for the output\n"


@pytest.mark.parametrize("count", [10, 1_000_000])
def test_a_reader_that_has_gone_is_no_error(count):
    with subprocess.Popen(
        [sys.executable, "-c", PRINTING, str(count)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.close()
        err = process.stderr.read()
    assert (process.returncode, err) == (0, "")


def killed_while_writing(path):
    code = "import os, sys; from pathlib import Path; from aqualog.io.atomic_write import write_whole\n"
    subprocess.run([sys.executable, "-c", f"{code}write_whole(Path(sys.argv[1]), lambda p: os._exit(9))", path])


def test_a_campaign_that_goes_on_removes_what_a_killed_one_left(tmp_path, monkeypatch):
    name, programme = next((n, make()) for n, make in PROGRAMMES.items())
    logs = tmp_path / "campaign" / "logs"
    killed_while_writing(logs / f"{programme[0].name}.mf4")
    killed_while_writing(logs / "other.mf4")
    (tmp_path / "campaign" / campaign.STATE).touch()
    assert len(list(logs.iterdir())) == 2

    def work(runs, folder, digests, *, jobs, record):
        for run in runs:
            record(run.name, "not tried")

    monkeypatch.setattr(campaign, "_work", work)
    campaign.simulate_campaign(name, tmp_path / "campaign", jobs=1, force=False, report=lambda *_: None)
    assert [p.name[:7] for p in logs.iterdir()] == [".other-"]


TELLING = """
import os, sys
from aqualog.cli import main
import typer
from aqualog.cli.console import Console, guarded
app = typer.Typer()
@app.command()
def work(directory: str, count: int):
    with guarded(debug=False):
        for _ in range(count):
            Console().note("of a log")
        file = os.open(directory + "/result", os.O_WRONLY | os.O_CREAT)
        os.write(2, b"a library's warning\\n")
        os.write(file, b"done")
        sys.stdout.write("told")
    raise typer.Exit(3)
main.app = app
main.run()
"""


@pytest.mark.parametrize("streams", ["2>&-", ">&-", ">&- 2>&-", "<&- >&- 2>&-", "2>/dev/full", "2> >(exec 0<&-)"])
def test_streams_that_are_closed_or_full_cost_no_work(tmp_path, streams):
    command = [sys.executable, "-c", TELLING, str(tmp_path), "3000"]
    done = subprocess.run(["bash", "-c", f'"$@" {streams}', "bash", *command], capture_output=True, timeout=60)
    assert done.returncode == 3
    assert (tmp_path / "result").read_bytes() == b"done"
    assert done.stdout == (b"" if " >&-" in f" {streams}" else b"told")
    assert b"Traceback" not in done.stderr


@pytest.mark.parametrize("streams", [">&-", ">&- 2>&-", "2>/dev/full"])
def test_what_is_told_before_a_command_begins_may_have_nowhere_to_go(streams):
    command = [sys.executable, "-c", "from aqualog.cli.start import run; run()"]
    for argument, code in (("--version", 0), ("--nothing", 2)):
        done = subprocess.run(["bash", "-c", f'"$@" {streams}', "bash", *command, argument], capture_output=True)
        assert done.returncode == code
        assert b"Traceback" not in done.stderr


@pytest.mark.parametrize("arguments", [("--version",), ("--help",), ("detect", "--help")])
def test_one_line_says_that_stdout_is_full(arguments):
    command = ["bash", "-c", '"$@" >/dev/full', "bash", sys.executable, "-m", "aqualog", *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == "error: standard output: No space left on device. Try: another place for the output\n"


def test_a_result_needs_stdout_or_a_file(tmp_path):
    log = ROOT / "sample_logs" / "lane_drive.mf4"
    command = ["bash", "-c", '"$@" >&-', "bash", sys.executable, "-m", "aqualog", "inspect", str(log)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("error: standard output is closed. Try: ")
    assert subprocess.run([*command, "--csv", str(tmp_path / "c.csv")], capture_output=True).returncode == 0
