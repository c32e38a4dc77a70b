"""A drive gone through in windows gives what it gives as a whole: document, table, and a page."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from aqualog.align import load
from aqualog.align.load import LoadedLong, load_drive, load_signals
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.detect.long import Extremes, detect_long
from aqualog.detect.stream import detect_drive
from aqualog.io.mdf import reader as mdf
from aqualog.io.messages import batches
from aqualog.io.messages import reader as messages
from aqualog.io.tables import csv, parquet
from aqualog.io.tables import csv_text as text_file
from aqualog.report.drive.document import document

LOGS = Path(__file__).parents[2] / "sample_logs"
CAR = load_vehicle(LOGS / "vehicle.toml")
MAPS = {".csv": "map_csv.toml", ".mcap": "map_mcap.toml"}


def inputs(suffix):
    path = LOGS / f"lane_drive{suffix}"
    signal_map = load_signal_map(LOGS / MAPS[suffix]) if suffix in MAPS else None
    return path, signal_map


@pytest.mark.parametrize("rows", [23, 500, 100_000])
@pytest.mark.parametrize("suffix", [".mf4", ".csv", ".mcap", ".parquet"])
def test_the_document_is_that_of_the_whole_drive(suffix, rows, monkeypatch):
    if rows == 23 and suffix != ".mf4":
        pytest.skip("the smallest windows once")
    monkeypatch.setattr(mdf, "_PIECE", 100)
    monkeypatch.setattr(messages, "_PIECE", 100)
    monkeypatch.setattr(parquet, "_PIECE", 2000)
    monkeypatch.setattr(batches, "_ENOUGH", 2000)
    monkeypatch.setattr(text_file, "LARGE", 1)
    monkeypatch.setattr(csv, "PIECE", 20_000)
    path, signal_map = inputs(suffix)
    whole = detect_drive(load_signals([path], vehicle=CAR, signal_map=signal_map), CAR)
    loaded = load_drive([path], vehicle=CAR, signal_map=signal_map, least=1)
    assert isinstance(loaded, LoadedLong)
    reader = loaded.drive._parts()[0]
    assert len(list(reader.pieces)) > 1 or suffix == ".mf4"
    with loaded.opened:
        result = detect_long(loaded.drive, CAR, faults=loaded.faults, rows=rows)
    assert document(result, log="a") == document(whole, log="a")
    assert len(result.events) > 3


def test_a_short_drive_is_read_as_a_whole():
    path, _ = inputs(".mf4")
    loaded = load_drive([path], vehicle=CAR)
    assert loaded.frame.equals(load_signals([path], vehicle=CAR).frame)


def test_what_needs_the_whole_drive_gets_it_and_says_so():
    path, _ = inputs(".mf4")
    told = []
    loaded = load_drive([path], vehicle=CAR, least=1, whole_for="--write", note=told.append)
    assert loaded.frame.height > 1000
    assert told == ["the drive is read as a whole, which needs much memory: --write works on whole drives only"]


def test_stamps_out_of_order_are_read_as_a_whole(tmp_path):
    t = np.arange(400) * 0.01
    t[200], t[201] = t[201], t[200]
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{a:.2f},{60 + 0.01 * i:.2f}" for i, a in enumerate(t))
    path.write_text(f"t [s],omega_fl [rad/s]\n{rows}\n")
    told = []
    loaded = load_drive([path], vehicle=CAR, least=1, note=told.append)
    assert loaded.quality.faults.back_steps == 1
    assert "out of order" in told[0]


def test_table_and_page_of_the_command(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from aqualog.cli.main import app

    def detect(out):
        found = CliRunner().invoke(
            app, ["detect", str(LOGS / "lane_drive.mf4"), "--vehicle", str(LOGS / "vehicle.toml"), "-o", str(out)]
        )
        assert found.exit_code == 0, found.stderr
        assert sorted(p.name for p in out.iterdir()) == ["events.json", "report.html", "signals.parquet"]
        return json.loads((out / "events.json").read_text()), pl.read_parquet(out / "signals.parquet")

    events, table = detect(tmp_path / "whole")
    monkeypatch.setattr(load, "LONG", 1)
    monkeypatch.setattr(load_drive, "__kwdefaults__", {**load_drive.__kwdefaults__, "least": 1})
    monkeypatch.setattr("aqualog.detect.long.detect_long", lambda *a, **k: detect_long(*a, **k, rows=300))
    long_events, long_table = detect(tmp_path / "long")
    assert long_events == events
    assert long_table.equals(table)
    assert (
        pl.read_parquet_metadata(tmp_path / "long" / "signals.parquet")["aqualog"]
        == (pl.read_parquet_metadata(tmp_path / "whole" / "signals.parquet")["aqualog"])
    )
    assert (tmp_path / "long" / "report.html").stat().st_size / (
        tmp_path / "whole" / "report.html"
    ).stat().st_size > 0.5


@pytest.mark.parametrize("step", [1, 17, 999, 250_000])
def test_a_picture_loses_no_peak(step):
    rng = np.random.default_rng(3)
    x = rng.standard_normal(250_000)
    x[123_456], x[77] = 50.0, np.nan
    x[200_000:201_000] = np.nan
    picture = Extremes(x.size, 10_000_000)
    for a in range(0, x.size, step) if step > 1 else [0]:
        picture.push({"x": x[a : a + step] if step > 1 else x})
    seen = picture.columns()["x"]
    length = 2 * picture.dt_ns // 10_000_000
    assert seen.size == 2 * -(-x.size // length)
    assert np.nanmax(seen) == 50.0
    assert np.isnan(seen).sum() >= 2 * (1000 // length - 1)
    rows = np.pad(x, (0, -x.size % length), constant_values=np.nan).reshape(-1, length)
    np.testing.assert_array_equal(np.fmax.reduce(rows, axis=1), np.fmax(seen[::2], seen[1::2]))
    np.testing.assert_array_equal(np.fmin.reduce(rows, axis=1), np.fmin(seen[::2], seen[1::2]))
