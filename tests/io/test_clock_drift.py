"""Two clocks of one log that run apart are counted and told, whatever the log; those that only wait are not."""

import json

import numpy as np
import polars as pl
import pytest
from mcap.writer import Writer

from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap
from aqualog.core.vehicle import Vehicle
from aqualog.doctor.examine import examine
from aqualog.io.clock_drift import DriftWatch
from aqualog.io.open_log import open_log
from aqualog.io.reader import ReadOptions
from aqualog.io.tables import csv, parquet
from aqualog.io.tables import csv_text as text_file

S = 1_000_000_000
T0 = 1_750_000_000 * S
RNG = np.random.default_rng(5)
T = np.arange(0, 600 * S, S // 10)


def drift_of(t, other, pieces=1):
    watch = DriftWatch()
    for part in np.array_split(np.arange(t.size), pieces):
        watch.push(t[part], other[part], np.ones(part.size, dtype=bool))
    return watch.finish("a", "b")


def late(t, ppm, noise_s=0.02):
    """What another clock shows, later by what a bus takes."""
    return t + np.rint(t * ppm * 1e-6 + RNG.exponential(noise_s, t.size) * S).astype(np.int64)


@pytest.mark.parametrize("ppm", [-500.0, -50.0, 50.0, 120.0, 2000.0])
@pytest.mark.parametrize("pieces", [1, 7])
def test_a_drift_is_found_behind_jitter(ppm, pieces):
    found = drift_of(T + T0, late(T, ppm) + T0 + 3 * S, pieces)
    assert found.ppm == pytest.approx(ppm, abs=5.0)
    assert found.shift_s == pytest.approx(ppm * 600e-6, rel=0.03)


def test_pieces_are_as_the_whole():
    other = late(T, 80.0)
    assert drift_of(T, other, 1) == drift_of(T, other, 13)


@pytest.mark.parametrize(("coarse_s", "ppm"), [(0.01, 200.0), (0.1, 2000.0)])
def test_a_clock_that_shows_whole_ticks_only(coarse_s, ppm):
    """Of a drift of one tick over the log nothing can be said."""
    held = (T * (1 + ppm * 1e-6) / S // coarse_s * coarse_s * S).astype(np.int64)
    assert drift_of(T, held).ppm == pytest.approx(ppm, abs=coarse_s * 500)
    assert drift_of(T[:600], held[:600]) is None


@pytest.mark.parametrize(
    "other",
    [
        late(T, 0.0), late(T, 0.0, 0.5), late(T, 5.0), np.where(T > 300 * S, T + S, T), np.where(T > 100 * S, T - S, T),
        T + np.where((T > 200 * S) & (T < 260 * S), 2 * S, 0), T * 0, T * 2, T + RNG.integers(0, S, T.size),
    ],
    ids=["jitter", "much", "little", "set", "set back", "a full buffer", "stands", "no clock", "noise"],
)  # fmt: skip
def test_what_is_no_drift(other):
    assert drift_of(T, other) is None


def test_a_short_log_tells_nothing():
    assert drift_of(T[:400], late(T[:400], 5000.0)) is None
    assert DriftWatch().finish("a", "b") is None


def write_csv(path, other="utc time [s]", values=None):
    t = T * 1e-9
    values = (T0 + T * (1 + 300e-6)) * 1e-9 if values is None else values
    lines = [
        f"{a:.3f},{b if isinstance(b, str) else format(b, '.6f')},{60 + a % 7:.4f}"
        for a, b in zip(t, values, strict=True)
    ]
    path.write_text(f"t [s],{other},omega_fl [rad/s]\n" + "\n".join(lines) + "\n")
    return path


def write_csv_stamps(path):
    stamps = np.array(T0 + T * (1 + 300e-6), dtype="datetime64[ns]").astype("datetime64[ms]").astype(str)
    return write_csv(path, "datetime", [s.replace("T", " ") for s in stamps])


def write_parquet(path):
    other = pl.Series(T0 + (T * (1 + 300e-6)).astype(np.int64)).cast(pl.Datetime("ns"))
    frame = {"t [s]": T * 1e-9, "utc": other, "omega_fl [rad/s]": 60 + T * 1e-9 % 7}
    pl.DataFrame(frame).write_parquet(path)
    return path


def write_mcap(path):
    with path.open("wb") as handle:
        out = Writer(handle)
        out.start()
        channel = out.register_channel("/car", "json", out.register_schema("Car", "jsonschema", b"{}"))
        for k, t in enumerate(T.tolist()):
            sec, nanosec = divmod(T0 + t, S)
            message = {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}, "omega_fl": 60.0 + k % 7}
            out.add_message(channel, T0 + round(t * (1 + 300e-6)), json.dumps(message).encode(), 0)
        out.finish()
    return path


WRITERS = {"a.csv": write_csv, "b.csv": write_csv_stamps, "a.parquet": write_parquet, "a.mcap": write_mcap}


@pytest.mark.parametrize("name", WRITERS)
def test_every_log_with_two_clocks(tmp_path, monkeypatch, name):
    path = WRITERS[name](tmp_path / name)
    with open_log(path) as reader:
        reader.read(reader.channels())
        (drift,) = reader.faults.drifts
    assert drift.ppm == pytest.approx(300.0, abs=3.0)
    signals = load_signals([path], vehicle=Vehicle(), signal_map=SignalMap())
    assert signals.quality.faults.drifts == 1
    assert signals.quality.time_jumps == 0
    assert any("drifts by +300 ppm" in n or "drifts by +299 ppm" in n for n in signals.quality.notes)
    found = [
        f for f in examine([path], vehicle=Vehicle(), signal_map=SignalMap()).findings if "drifts" in f.kind + f.what
    ]
    assert [(f.level, f.kind, f.count) for f in found] == [("doubt", "drifts", 1)]
    if name != "b.csv":  # text is read as a whole
        monkeypatch.setattr(parquet, "_PIECE", 4000)
        monkeypatch.setattr(csv, "PIECE", 40_000)
        monkeypatch.setattr(text_file, "LARGE", 1000)
        with open_log(path, ReadOptions()) as reader:
            for part in reader.parts(reader.channels()):
                for _ in part.pieces:
                    pass
            assert reader.faults.drifts == (drift,)


def test_two_clocks_in_step_are_no_fault(tmp_path):
    path = write_csv(tmp_path / "a.csv", values=(T0 + T) * 1e-9)
    with open_log(path) as reader:
        reader.read(reader.channels())
        assert reader.faults.drifts == ()
