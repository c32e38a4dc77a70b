"""What is wrong in a call: a wrong type is a TypeError that names the argument, all else an AqualogError of one line."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

import aqualog as aq

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
LOG, CAR = SAMPLES / "lane_drive.parquet", SAMPLES / "vehicle.toml"
ON_LOGS = {
    "read": aq.read,
    "detect": lambda x: aq.detect(x, CAR),
    "inspect": aq.inspect,
    "init": lambda x: aq.init(x, "never"),
    "doctor": aq.doctor,
    "convert": lambda x: aq.convert(x, "never.csv"),
    "slip_slope": lambda x: aq.slip_slope(x, CAR),
    "calibrate": lambda x: aq.calibrate(x, CAR),
    "evaluate": lambda x: aq.evaluate(x, CAR),
    "diagnose": lambda x: aq.diagnose(x, CAR),
    "validate": lambda x: aq.validate(x, CAR),
    "align": lambda x: aq.align(x, LOG),
    "source": lambda x: aq.align(LOG, x),
    "Campaign": lambda x: aq.Campaign(x, vehicle=CAR),
}
ON_FILES = {
    "vehicle": lambda x: aq.detect(LOG, x),
    "thresholds": lambda x: aq.detect(LOG, CAR, thresholds=x),
    "model": lambda x: aq.detect(LOG, CAR, model=x),
    "history": lambda x: aq.detect(LOG, CAR, history=x),
    "map": lambda x: aq.read(LOG, x),
    "boundaries": lambda x: aq.validate(LOG, CAR, boundaries=x),
    "scenario": aq.simulate,
    "labels": lambda x: aq.evaluate(LOG, CAR, labels=x),
    "path": lambda x: aq.convert(LOG, x),
    "folder": lambda x: aq.inspect(LOG).save(x),
}


@pytest.mark.parametrize(
    "wrong", [5, 1.5, True, b"drive.mf4", {"a": 1}, object(), [3], [None]], ids=lambda x: type(x).__name__
)
@pytest.mark.parametrize("name", ON_LOGS)
def test_logs_of_a_wrong_type(name, wrong):
    with pytest.raises(TypeError, match=r"(logs|drives): expected str or Path, one or several"):
        ON_LOGS[name](wrong)


@pytest.mark.parametrize("name", ON_LOGS)
def test_names_that_no_file_can_have(name):
    with pytest.raises(aq.AqualogError, match="is no name of a file"):
        ON_LOGS[name]("a\0b")
    with pytest.raises(aq.AqualogError, match="is too long for the name of a file") as caught:
        ON_LOGS[name]("x" * 5000)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("name", [n for n in ON_LOGS if n not in ("align", "source")])
def test_no_logs(name):
    with pytest.raises(aq.AqualogError, match="is named"):
        ON_LOGS[name]([])


@pytest.mark.parametrize("wrong", [5, b"x.toml", {"mass": 1.0}, ["x.toml"], object()], ids=lambda x: type(x).__name__)
@pytest.mark.parametrize("name", ON_FILES)
def test_files_of_a_wrong_type(name, wrong):
    with pytest.raises(TypeError, match=f"^{name}: expected str or Path"):
        ON_FILES[name](wrong)


@pytest.mark.parametrize("name", ON_FILES)
def test_files_that_cannot_be_named(name):
    with pytest.raises(aq.AqualogError, match=r"is no name of a file|no writer"):
        ON_FILES[name]("a\0b")


def test_a_file_of_the_readers_that_cannot_be_named():
    for read in (aq.Vehicle.read, aq.Model.read):
        with pytest.raises(aq.AqualogError, match="not found: no file has the name 'a"):
            read("a\0b")


@pytest.mark.parametrize(
    ("call", "match"),
    [(lambda: aq.read(LOG, rate_hz="100"), "rate_hz: expected a number, not str"),
     (lambda: aq.align(LOG, LOG, max_offset_s=None), "max_offset_s: expected a number"),
     (lambda: aq.align(LOG, LOG, channels=5), "channels: expected a mapping"),
     (lambda: aq.align(LOG, LOG, quantity=5), "quantity: expected a text"),
     (lambda: aq.detect(LOG, CAR, reference=None), "reference: expected a text"),
     (lambda: aq.detect(LOG, CAR, configuration=b"a"), "configuration: expected a text"),
     (lambda: aq.diagnose(LOG, CAR, level="a"), "level: expected a number"),
     (lambda: aq.diagnose(LOG, CAR, seed=1.5), "seed: expected a whole number, not float"),
     (lambda: aq.diagnose(LOG, CAR, surrogates="9"), "surrogates: expected a whole number, not str"),
     (lambda: aq.calibrate(LOG, CAR, fix="mass=3"), "fix: expected a mapping"),
     (lambda: aq.calibrate(LOG, CAR, fix={"mass": "3"}), "fix mass: expected a number, not str"),
     (lambda: aq.slip_slope(LOG, CAR, mu_max="a"), "mu_max: expected a number"),
     (lambda: aq.slip_slope(LOG, CAR, method=None), "method: expected a text"),
     (lambda: aq.simulate(SAMPLES / "scenario.toml", seed="a"), "seed: expected a whole number")],
)  # fmt: skip
def test_values_of_a_wrong_type(call, match):
    with pytest.raises(TypeError, match=match):
        call()


@pytest.mark.parametrize("rate", [float("nan"), float("inf"), -1.0, 0, 1e9])
def test_a_rate_out_of_range(rate):
    with pytest.raises(aq.AqualogError, match=r"rate_hz = .*; expected 0\.1 to 100000 Hz"):
        aq.read(LOG, rate_hz=rate)


def test_messages_name_arguments_and_no_options():
    for call in (
        lambda: aq.detect(LOG, CAR, reference="x"),
        lambda: aq.detect(LOG, CAR, configuration="a\nb"),
        lambda: aq.align(LOG, LOG, quantity="x"),
        lambda: aq.Campaign(LOG),
        lambda: aq.evaluate(LOG),
        lambda: aq.convert(LOG, "x.mf4", decimal_comma=True),
        lambda: aq.slip_slope(LOG, CAR, method="x"),
        lambda: aq.calibrate(LOG, CAR, fix={"x": 1.0}),
        lambda: aq.diagnose(LOG, CAR, surrogates=1),
    ):
        with pytest.raises(aq.AqualogError) as caught:
            call()
        assert "--" not in str(caught.value)


def test_modules_of_a_folder_beside_a_function():
    code = (
        "import aqualog.detect.stream as s; import aqualog as aq; assert s.ROWS and callable(aq.detect)\n"
        "import aqualog.align.clock; assert callable(aqualog.align) and aqualog.align.clock.estimate_clock\n"
        "from aqualog.diagnose import run; assert callable(aq.diagnose) and aq.diagnose.run is run\n"
        "import importlib; importlib.reload(aq); import aqualog.doctor.findings as r; assert r.Finding\n"
        "from aqualog import *; assert detect is aq.detect and callable(doctor)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_detection_without_samples(tmp_path):
    found = aq.detect(LOG, CAR, samples=False)
    assert not found.has_samples
    assert set(found.tables) == {"events", "episodes", "signals"}
    assert found._repr_html_().startswith("<pre>")
    assert [p.name for p in found.save(tmp_path)] == ["events.json"]
    for ask in (found.plot, lambda: found.tracks, lambda: found.features, lambda: found.write(tmp_path / "a.csv")):
        with pytest.raises(aq.AqualogError, match=r"samples=True"):
            ask()
    assert not (tmp_path / "a.csv").exists()


def test_a_drive_that_cannot_be_read_has_a_repr(tmp_path):
    log = tmp_path / "a\x1b[31m.csv"
    log.write_text("t,v_x\n")
    drive = aq.read(log)
    assert "cannot be read" in repr(drive)
    assert "\x1b" not in repr(drive) + drive._repr_html_()
    shutil.copy(LOG, tmp_path / "b\x1b.parquet")
    assert "\x1b" not in repr(aq.read(tmp_path / "b\x1b.parquet"))


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder in which nothing can be made")
def test_a_folder_in_which_nothing_can_be_written():
    for write in (lambda: aq.inspect(LOG).save("/proc/x"), lambda: aq.convert(LOG, "/proc/x.csv")):
        with pytest.raises(aq.AqualogError, match="cannot be written") as caught:
            write()
        assert "\n" not in str(caught.value)


def test_files_of_a_result_are_all_there_or_none(tmp_path, monkeypatch):
    found = aq.detect(LOG, CAR)

    def full(_path):
        raise OSError(28, "No space left on device")

    files = {**found.files(), "report.html": full}
    monkeypatch.setattr(type(found), "files", lambda _self: files)
    with pytest.raises(aq.AqualogError, match="No space left"):
        found.save(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_tables_without_rows_have_their_columns():
    assert {"level", "file"} <= set(aq.doctor(LOG, CAR).tables["findings"].columns)


def test_no_source_is_written(tmp_path):
    log = tmp_path / "signals.parquet"
    shutil.copy(LOG, log)
    (tmp_path / "link").symlink_to(tmp_path)
    content, found = log.read_bytes(), aq.detect(log, CAR)
    for write in (
        lambda: found.save(tmp_path, force=True),
        lambda: found.save(tmp_path / "link", force=True),
        lambda: found.write(tmp_path / "link" / ".." / tmp_path.name / "signals.parquet", force=True),
        lambda: found.drive.write(log, force=True),
    ):
        with pytest.raises(aq.AqualogError, match="is a source"):
            write()
    assert log.read_bytes() == content


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_short_signals(rows, tmp_path):
    signals = aq.read(LOG).signals
    found = aq.detect(replace(signals, frame=signals.frame.head(rows)), CAR)
    assert isinstance(found.events, pl.DataFrame)
    assert found.plot().data is not None
    assert repr(found) in found._repr_html_()
    assert len(found.save(tmp_path)) == 3


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    shutil.copy(LOG, folder / "a.parquet")
    shutil.copy(CAR, folder / "car.toml")
    (folder / "c.toml").write_text('name = "c"\n[[run]]\nlog = "a.parquet"\nvehicle = "car.toml"\ntyre = "x"\n')
    return aq.Campaign(folder / "c.toml")


@pytest.mark.parametrize(
    ("options", "kind", "match"),
    [({"jobs": 0}, aq.AqualogError, "jobs = 0; expected 1 to 1024"),
     ({"jobs": "a"}, TypeError, "jobs: expected a whole number, not str"),
     ({"jobs": 1.5}, TypeError, "jobs: expected a whole number, not float"),
     ({"limit_s": -1}, aq.AqualogError, "limit_s = -1"), ({"limit_s": "a"}, TypeError, "limit_s: expected a number"),
     ({"limit_mb": 1}, aq.AqualogError, "limit_mb = 1"), ({"shard": 3}, TypeError, "shard: expected a text"),
     ({"shard": "9/3"}, aq.AqualogError, "^shard 9/3"), ({"cluster": ""}, aq.AqualogError, "^cluster is empty")],
)  # fmt: skip
def test_runs_of_a_campaign(campaign, options, kind, match):
    with pytest.raises(kind, match=match):
        campaign.run(**options)


@pytest.mark.parametrize(
    ("options", "kind", "match"),
    [({"by": 5}, TypeError, "by: expected"),
     ({"by": "colour"}, aq.AqualogError, "^by .*no run has this key; expected vehicle, tyre"),
     ({"bin_width": "a"}, TypeError, "bin_width: expected a number"),
     ({"bin_width": float("nan")}, aq.AqualogError, "bin_width = nan; expected 1 to 100 km/h"),
     ({"road": "x"}, aq.AqualogError, "^road ")],
)  # fmt: skip
def test_bins_of_a_campaign(campaign, options, kind, match):
    with pytest.raises(kind, match=match):
        campaign.check_bins(**options)


def test_logs_without_a_campaign_file_have_no_matrix():
    with pytest.raises(aq.AqualogError, match="no test matrix"):
        aq.Campaign(LOG, vehicle=CAR).matrix()


def test_a_long_topic_and_a_pager_that_does_not_exist(monkeypatch):
    from aqualog.cli import help as pages

    with pytest.raises(aq.AqualogError) as caught:
        pages._text(["x" * 10_000])
    assert len(str(caught.value)) < 300
    shown = []
    monkeypatch.setattr("pydoc.pager", lambda text: shown.append((text, os.environ.get("PAGER"))))
    for stream in ("stdin", "stdout"):
        monkeypatch.setattr(f"sys.{stream}.isatty", lambda: True, raising=False)
    monkeypatch.setenv("PAGER", "/no/such/pager -x")
    pages._show("a\n" * 1000)
    assert shown == [("a\n" * 1000, None)]


def test_an_interrupt_within_compiled_code_is_no_fault_of_a_log():
    from aqualog.campaign.batch import _fault

    error = SystemError("returned a result with an exception set")
    error.__cause__ = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        _fault(error, [LOG])
