"""The batch: what is new and nothing else, bad logs told, kills survived, a store that opens by itself."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from aqualog.align.load import load_signals
from aqualog.campaign import batch
from aqualog.campaign.batch import CRASHED, run_batch
from aqualog.campaign.definition import Run, with_load
from aqualog.campaign.measure import measure
from aqualog.campaign.results import load_results
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.core.errors import ConfigError, LogError
from aqualog.guard.worker import Crashed
from aqualog.model.programme import SEDAN
from tests.campaign.made import make_campaign
from tests.commands import run
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    campaign = make_campaign(folder)
    configured = configure(campaign)
    run_batch(configured, Store(folder / "store"))
    return folder


@pytest.fixture
def own(tmp_path):
    """A campaign of one's own to spoil, three logs."""
    return make_campaign(tmp_path, speeds=(80, 90, 100), repeats=1)


def test_samples_agree_with_the_log_they_come_from(made):
    path = made / "logs" / "v100_0.parquet"
    signals = load_signals([path], vehicle=SEDAN)
    kept = measure(signals, SEDAN).samples
    t = kept["t"].to_numpy()
    assert np.allclose(np.diff(t), 0.1)
    v = np.interp(t, signals.array("t"), signals.array("v_x"))
    assert np.nanmax(np.abs(kept["v_x"].fill_null(np.nan).to_numpy() - v)) < 0.3
    middle = (t > 0.5) & (t < 1.0)  # dry, steady: slip of the driven wheel is traction over slope
    slip = kept["slip_rr"].fill_null(np.nan).to_numpy()[middle].mean()
    mu = kept["mu_rr"].fill_null(np.nan).to_numpy()[middle].mean()
    assert mu / slip == pytest.approx(31.0, rel=0.15)
    assert abs(kept["slip_fr"].fill_null(np.nan).to_numpy()[middle].mean()) < 5e-4


def test_dips_are_kept_although_samples_are_thinned(made):
    path = made / "logs" / "v100_0.parquet"
    signals = load_signals([path], vehicle=SEDAN)
    kept = measure(signals, SEDAN).samples
    truth = pl.read_parquet(path)["true_slip_fr"].to_numpy()
    assert kept["slip_min_fr"].min() == pytest.approx(truth.min(), rel=0.2)


def test_the_load_of_a_run_is_on_its_car():
    run_ = Run((), None, None, None, {"load_front_kg": 100.0, "load_rear_kg": 200.0})
    car = with_load(SEDAN, run_)
    moments = SEDAN.mass * SEDAN.l_f + 100.0 * 0.0 + 200.0 * SEDAN.wheelbase
    assert car.mass == SEDAN.mass + 300.0
    assert car.l_f == pytest.approx(moments / car.mass)
    assert car.wheelbase == pytest.approx(SEDAN.wheelbase)
    with pytest.raises(ConfigError, match="load"):
        with_load(SEDAN, Run((), None, None, None, {"load_front_kg": -1600.0}))


def test_water_is_known_without_the_ends_of_the_lane(made):
    data = load_results(configure(made / "campaign.toml"), Store(made / "store"))
    s = data.samples(data.done[0])
    assert data.done[0].water_from == "lane times"
    wet, unknown = s.t[s.on_water == 1.0], s.t[np.isnan(s.on_water)]
    assert 1.5 <= wet.min() < 1.7
    assert 2.7 < wet.max() <= 2.9
    assert unknown.size == 12
    dry = replace(data.done[0].run, values={"water_depth_mm": 0.0})
    assert np.nansum(data.samples(replace(data.done[0], run=dry)).on_water) == 0.0
    one_side = replace(dry, values={"water_depth_mm": 0.0, "water_depth_left_mm": 1.3})
    assert np.nansum(data.samples(replace(data.done[0], run=one_side)).on_water) > 5.0


def test_tables_open_by_themselves(made):
    runs = pl.read_parquet(made / "store" / "runs.parquet")
    events = pl.read_parquet(made / "store" / "events.parquet")
    assert runs["state"].to_list() == ["done"] * 4
    assert runs["tyre"].unique().to_list() == ["worn_summer"]
    assert (runs["events_resistance"].sum()) == (events["detector"] == "resistance").sum() > 0
    joined = pl.read_parquet(made / "store" / "samples" / "*.parquet", include_file_paths="file")
    assert joined["file"].n_unique() == 4
    manifest = json.loads((made / "store" / "manifest.json").read_text())
    assert manifest["states"] == {"done": 4}


def test_duckdb_reads_the_store(made):
    duckdb = pytest.importorskip("duckdb")
    query = f"select sum(events_joint_cusum) from '{made / 'store' / 'runs.parquet'}'"
    n = duckdb.sql(query).fetchall()[0][0]
    assert n == pl.read_parquet(made / "store" / "runs.parquet")["events_joint_cusum"].sum()


def test_a_second_run_does_nothing(own):
    configured = configure(own)
    store = Store(own.parent / "s")
    first = run_batch(configured, store)
    before = {p: p.stat().st_mtime_ns for p in (own.parent / "s" / "samples").iterdir()}
    again = run_batch(configured, store)
    assert (first.made, first.kept, again.made, again.kept) == (3, 0, 0, 3)
    assert before == {p: p.stat().st_mtime_ns for p in (own.parent / "s" / "samples").iterdir()}
    assert run_batch(configured, store, force=True).made == 3


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda d: (d / "car.toml").write_text((d / "car.toml").read_text().replace("mass = 1680.0", "mass = 1700.0")), 3),
        (lambda d: (d / "logs" / "v080_0.parquet").write_bytes((d / "logs" / "v090_0.parquet").read_bytes()), 1),
        (lambda d: (d / "runs.csv").write_text((d / "runs.csv").read_text().replace("worn_summer", "other").replace("1.2,3.2", "1.0,3.0")), 0),
        (lambda d: (d / "campaign.toml").write_text('name = "x"\nsignals = "m.toml"\nvehicle = "car.toml"\nruns = "runs.csv"\n'), 3),
    ],
    ids=["car", "content of one log", "tyre and lane", "signal map"],
)  # fmt: skip
def test_what_changed_is_measured_again(own, change, expected):
    folder = own.parent
    (folder / "m.toml").write_text('[signals]\na_x = { channel = "a_x", offset = 0.1 }\n')
    store = Store(folder / "s")
    run_batch(configure(own), store)
    change(folder)
    assert run_batch(configure(own), store).made == expected


def test_a_threshold_is_part_of_the_key(own):
    store = Store(own.parent / "s")
    run_batch(configure(own), store)
    file = own.parent / "t.toml"
    file.write_text("[thresholds]\nresistance = 0.3\n")
    assert run_batch(configure(own, thresholds=file), store).made == 3


def test_runs_on_one_log_are_one_job(own):
    text = (own.parent / "runs.csv").read_text()
    row = text.splitlines()[1]
    first, second = (row.replace("1.2,3.2", lane) for lane in ("1.2,2.0", "2.2,3.2"))
    (own.parent / "runs.csv").write_text(text.replace(row, first) + second + "\n")
    store = Store(own.parent / "s")
    configured = configure(own)
    assert run_batch(configured, store).made == 3
    data = load_results(configured, store)
    (early,) = (r for r in data.done if r.run.lane == (1.2, 2.0))
    late = next(r for r in data.done if r.run.lane == (2.2, 3.2))
    assert len(data.done) == 4
    # the water of the other run is not dry road
    s = data.samples(early)
    assert not (s.on_water[(s.t > 2.2) & (s.t < 3.2)] == 0.0).any()
    assert (s.on_water[s.t > 3.6] == 0.0).all()
    # what was found belongs to the lane that it touches, else to the nearest
    for start, end, owners in ((1.4, 1.9, "early"), (1.9, 2.4, "both"), (0.2, 0.4, "early"), (3.5, 3.6, "late")):
        about = {"events": [{"start_s": start, "end_s": end}]}
        found = [len(replace(r, about=about).events) for r in (early, late)]
        assert found == {"early": [1, 0], "late": [0, 1], "both": [1, 1]}[owners]


def test_lane_times_that_the_log_contradicts(own):
    head, *rows = (own.parent / "runs.csv").read_text().splitlines()
    # water is from 1.2 to 3.2 s: before it, a part of it, and dry by its depth
    rows = [
        r.replace(*x) for r, x in zip(rows, (("1.2,3.2", "0.1,1.3"), ("1.2,3", "2.0,3"), (",1.3,", ",0,")), strict=True)
    ]
    (own.parent / "runs.csv").write_text("\n".join([head, *rows]) + "\n")
    done = run("batch", own)
    assert done.exit_code == 3
    said = " ".join(done.stderr.split())
    assert "v080_0.parquet: the campaign has water from 0.10 to 1.30 s, the log has water from 1.20 to 3." in said
    assert "v100_0.parquet: the campaign has dry road from 1.20 to 3.20 s, the log has water from 1.20 to 3." in said
    assert "Try: the lane times of this log, or none: then its on_water counts" in said
    assert "note: lane times beside the on_water of 1 of 3 runs, which count: logs/v090_0.parquet: the campaign" in said
    assert "1 log done (1 now, 0 before), 2 failed" in done.stdout
    data = load_results(configure(own), Store(own.with_suffix(".store")))
    (short,) = data.done
    s = data.samples(short)
    assert not (s.on_water[(s.t > 1.3) & (s.t < 3.2)] == 0.0).any()  # water beside the lane is no dry road
    assert (s.on_water[s.t < 0.9] == 0.0).all()


def test_a_damaged_result_is_told(own):
    store = Store(own.parent / "s")
    run_batch(configure(own), store)
    key = sorted(store.keys()[0])[0]
    Path(store.at(f"samples/{key}.parquet")).write_bytes(b"PAR1 nonsense")
    with pytest.raises(LogError, match="damaged"):
        store.about(key)


def test_a_folder_of_other_things_is_no_store(own, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.doc").write_text("precious")
    result = run("batch", own, "-o", other)
    assert result.exit_code == 2
    assert "holds other files" in result.stderr
    assert run("batch", own, "-o", own.parent / "logs").exit_code == 2


def test_bad_logs_are_named_and_the_others_done(own):
    folder = own.parent
    (folder / "logs" / "v080_0.parquet").write_bytes(b"")
    (folder / "logs" / "v090_0.parquet").unlink()
    result = run("batch", own, "-o", folder / "s")
    assert result.exit_code == 3
    assert "1 log done" in result.stdout
    assert "v080_0.parquet: is empty" in result.stderr
    assert "v090_0.parquet" in result.stderr
    assert "no such file" in result.stderr
    manifest = json.loads((folder / "s" / "manifest.json").read_text())
    assert manifest["states"] == {"failed": 2, "done": 1}
    again = run("batch", own, "-o", folder / "s", "--json")
    assert again.exit_code == 3
    document = json.loads(again.stdout)
    assert (document["made"], document["kept"], len(document["failed"])) == (0, 1, 2)


def test_a_file_name_that_is_no_utf8_costs_no_other_log(tmp_path):
    folder = Path(os.fsdecode(bytes(tmp_path) + b"/bad\xff"))
    folder.mkdir()
    for name in ("a.mf4", os.fsdecode(b"b\xfe.mf4"), os.fsdecode(b"c\xfe.parquet")):
        shutil.copy(ROOT / "sample_logs" / f"lane_drive{Path(name).suffix}", folder / name)
    result = run("batch", folder, "--vehicle", ROOT / "sample_logs" / "vehicle.toml", "-o", tmp_path / "s")
    assert result.exit_code == 3  # the library for Parquet opens no such name
    told = pl.read_parquet(tmp_path / "s" / "runs.parquet")
    assert told.filter(pl.col("state") == "done").height == 2
    assert all("\\xfe" in n for n in told["name"].to_list()[1:])


def test_nothing_usable(own):
    for p in (own.parent / "logs").iterdir():
        p.write_bytes(b"x" * 100)
    assert run("batch", own).exit_code == 4


def test_an_unforeseen_fault_of_one_log_leaves_the_others(own, monkeypatch):
    real = batch.load_drive

    def breaks(logs, **kw):
        if logs[0].name == "v090_0.parquet":
            raise ZeroDivisionError("as asammdf does")
        return real(logs, **kw)

    monkeypatch.setattr(batch, "load_drive", breaks)
    outcome = run_batch(configure(own), Store(own.parent / "s"))
    assert outcome.made == 2
    assert "ZeroDivisionError" in next(iter(outcome.failed.values()))


def test_crash_is_told_and_tried_again(own, monkeypatch):
    monkeypatch.setattr(
        batch, "work_on", lambda tasks, work, *, jobs, record, limits: [record(k, Crashed()) for k in tasks]
    )  # fmt: skip
    monkeypatch.setattr(batch, "_HERE", 0)
    store = Store(own.parent / "s")
    assert set(run_batch(configure(own), store, jobs=2).failed.values()) == {CRASHED}
    monkeypatch.undo()
    assert run_batch(configure(own), store).made == 3


def begun_and_ended(folder, number):
    """A batch over 40 logs that got a signal after five: campaign, samples that were there, exit code, stderr."""
    campaign = make_campaign(folder, speeds=(70, 80, 90, 100), repeats=10)
    command = [sys.executable, "-m", "aqualog", "batch", str(campaign), "--jobs", "2", "--progress", "plain"]
    samples = folder / "campaign.store" / "samples"
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        # a shell that runs the tests in its background has children ignore interrupts
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:  # fmt: skip
        for _ in range(6000):
            if samples.is_dir() and sum(p.suffix == ".parquet" for p in samples.iterdir()) >= 5:
                break
            time.sleep(0.01)
        process.send_signal(number)
        error = process.stderr.read()
        code = process.wait()
    return campaign, samples, code, error


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGKILL, id="killed"),
        pytest.param(signal.SIGINT, id="interrupted", marks=pytest.mark.nightly),
    ],
)
def test_ended_half_way_and_started_again(tmp_path, number):
    for attempt in "abc":  # on a busy machine the batch may be done before the signal is on its way
        (tmp_path / attempt).mkdir()
        campaign, samples, code, error = begun_and_ended(tmp_path / attempt, number)
        there = {p.name: p.read_bytes() for p in samples.glob("*.parquet")}
        if len(there) < 40:
            break
    assert 5 <= len(there) < 40
    if number == signal.SIGINT:
        assert code == 130
        assert "goes on with the rest" in error
        assert not list(samples.glob(".*.tmp"))
    done = run("batch", campaign, "--json")
    document = json.loads(done.stdout)
    assert done.exit_code == 0
    assert document["made"] + document["kept"] == 40
    assert document["kept"] >= len(there)
    assert {n: (samples / n).read_bytes() for n in there} == there


def test_logs_without_a_campaign(own):
    logs = own.parent / "logs"
    assert run("batch", logs, "-o", own.parent / "s").exit_code == 2  # no vehicle
    assert run("batch", logs, "--vehicle", own.parent / "car.toml").exit_code == 2  # no place
    result = run("batch", logs, "--vehicle", own.parent / "car.toml", "-o", own.parent / "s")
    assert result.exit_code == 0
    assert "3 logs done" in result.stdout


def test_faults_of_all_files_in_one_message(own):
    folder = own.parent
    (folder / "car.toml").write_text("mas = 1200\n")
    (folder / "m.toml").write_text('[signals]\nomega_xx = "a"\n')
    result = run("batch", own, "--signals", folder / "m.toml")
    assert result.exit_code == 2
    for text in ("mas", "mass", "omega_xx", "car.toml", "m.toml"):
        assert text in result.stderr
