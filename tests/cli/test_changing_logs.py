"""A log that is written to, replaced or removed while a command reads it is told, whatever comes of it."""

import json
import os
import shutil

import pytest

from aqualog.align import load
from aqualog.align.load import load_drive
from aqualog.io import open_log
from aqualog.io.fingerprint import changed_files, state_of
from tests.commands import run
from tests.conftest import ROOT

SAMPLES = ROOT / "sample_logs"
CAR = str(SAMPLES / "vehicle.toml")
TOLD = "drive.mf4: changed while it was read"


def grow(path):
    with path.open("ab") as file:
        file.write(b"\0" * 24)


def touch(path):
    os.utime(path, ns=(1, 1))


def swap(path):
    other = path.with_suffix(".other")
    shutil.copy(path, other)
    touch(other)
    other.replace(path)


@pytest.fixture
def log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(SAMPLES / "lane_drive.mf4", tmp_path / "drive.mf4")
    return tmp_path / "drive.mf4"


def changing(monkeypatch, log, act, method="read"):
    """Let something happen to the log when its reader has read it."""
    real = getattr(open_log.DriveLog, method)

    def reads(self, *wanted):
        found = real(self, *wanted)
        act(log)
        return found

    monkeypatch.setattr(open_log.DriveLog, method, reads)


@pytest.mark.parametrize(
    ("args", "act"),
    [
        (("detect", "drive.mf4", "--vehicle", CAR, "-o", "out"), grow),
        (("convert", "drive.mf4", "-o", "out.parquet"), swap),
        (("inspect", "drive.mf4"), touch),
    ],
    ids=lambda x: x[0] if isinstance(x, tuple) else "",
)
def test_it_is_a_note_and_a_loss(log, monkeypatch, args, act):
    assert run(*args).exit_code == 0
    changing(monkeypatch, log, act, "read_readable" if args[0] == "inspect" else "read")
    result = run(*args, "--force")
    assert result.exit_code == 3, result.stderr
    assert (result.stderr + result.stdout).count(TOLD) >= 1
    if args[0] == "detect":
        notes = json.loads((log.parent / "out" / "events.json").read_text())["quality"]["notes"]
        assert [n for n in notes if n.startswith(TOLD)]


def test_it_is_told_of_a_drive_in_windows_between_its_passes(log, monkeypatch):
    monkeypatch.setattr(load, "LONG", 1)
    monkeypatch.setattr(load_drive, "__kwdefaults__", {**load_drive.__kwdefaults__, "least": 1})
    assert run("detect", log, "--vehicle", CAR).exit_code == 0
    calls = []
    changing(monkeypatch, log, lambda path: calls.append(path) or (touch(path) if len(calls) == 2 else None), "parts")
    result = run("detect", log, "--vehicle", CAR)
    assert len(calls) >= 2
    assert (result.exit_code, result.stderr.count(TOLD)) == (3, 1)


def test_an_error_says_that_it_may_be_of_the_change(log, monkeypatch):
    def cut(path):
        os.truncate(path, 100)
        raise ValueError("odd block")

    changing(monkeypatch, log, cut, "read_readable")
    result = run("inspect", log)
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert "drive.mf4: changed while it was read (odd block). Try: again, when it stays as it is" in result.stderr


def test_files_of_a_folder_that_change_or_go(tmp_path):
    for name in ("a", "b", "c"):
        (tmp_path / name).write_text(name)
    before = state_of([tmp_path])
    assert changed_files([tmp_path], before) == ()
    (tmp_path / "a").write_text("aa")
    (tmp_path / "b").unlink()
    (tmp_path / "d").write_text("d")
    assert [n.rsplit("/", 1)[-1] for n in changed_files([tmp_path], before)] == ["a", "b"]
    assert state_of([tmp_path / "none"]) == ()
