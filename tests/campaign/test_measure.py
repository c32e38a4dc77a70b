"""What a campaign keeps of a drive that is gone through in windows is what it keeps of the whole, to the bit."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.align.load import LoadedLong, load_drive, load_signals
from aqualog.campaign import measure as measuring
from aqualog.campaign.batch import run_batch
from aqualog.campaign.full_rate import MOST_S, FullRate
from aqualog.campaign.measure import measure, measure_long
from aqualog.campaign.results import load_results
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.core.judgement import Episode, Judgement
from aqualog.core.notation import WHEELS
from aqualog.core.records import Track
from aqualog.detect.slip_slope.direct_inputs import smoothed
from aqualog.detect.stream import detect_drive
from aqualog.io.write_table import TableColumn, write_parquet
from aqualog.model.programme import SEDAN
from aqualog.report.campaign.run_page import run_page
from tests.campaign.made import make_campaign


def drive(path, *, without=(), dt=0.01, seconds=40.0):
    """A car that accelerates, brakes in short taps, turns, and whose wheels spin down and up now and then."""
    rng = np.random.default_rng(5)
    n = round(seconds / dt)
    t = np.arange(n) * dt
    v = 18.0 + 6.0 * np.sin(0.3 * t)
    a = np.gradient(v, dt)
    pressure = np.where(np.sin(0.9 * t) > 0.9, 2e6, 0.0)
    signals = {
        "v_x": ("m/s", v),
        "a_x": ("m/s^2", a + 0.2 * rng.standard_normal(n)),
        "yaw_rate": ("rad/s", 0.06 * np.sin(0.5 * t)),
        "brake_pressure": ("Pa", pressure),
        "on_water": ("bool", (np.sin(0.2 * t) > 0.5).astype(float)),
        "water_depth_left": ("m", 1e-3 * (np.sin(0.2 * t) > 0.5)),
    }
    for k, w in enumerate(WHEELS):
        slip = 0.01 * np.sin(0.7 * t + k) - 0.08 * (np.sin(0.45 * t + k) > 0.97) + 0.3 * (np.sin(0.37 * t + k) > 0.99)
        signals[f"omega_{w}"] = ("rad/s", v / SEDAN.r_e(w) * (1.0 + slip) + 0.02 * rng.standard_normal(n))
        signals[f"torque_{w}"] = ("N*m", 200.0 * np.sin(0.6 * t) + rng.standard_normal(n))
    for k, name in enumerate(signals):
        signals[name][1][300 + 100 * k : 300 + 107 * k] = np.nan
    columns = [TableColumn("t", "s", t), *(TableColumn(n, u, x) for n, (u, x) in signals.items() if n not in without)]
    write_parquet(path, columns)
    return path


def both(path, vehicle, rows):
    loaded = load_drive([path], vehicle=vehicle, least=1)
    assert isinstance(loaded, LoadedLong)
    with loaded.opened:
        long = measure_long(loaded.drive, vehicle, faults=loaded.faults, rows=rows)
    return measure(load_signals([path], vehicle=vehicle), vehicle), long


RWD, AWD = replace(SEDAN, drivetrain="rwd"), replace(SEDAN, drivetrain="awd")
TORQUES = tuple(f"torque_{w}" for w in WHEELS)
CASES = {
    "all": (RWD, ()),
    "all wheels driven": (AWD, ()),
    "against free wheels": (RWD, ("v_x",)),
    "accelerometer": (RWD, ("v_x", *TORQUES)),
    "no brake pressure, no water": (RWD, ("brake_pressure", "on_water", "water_depth_left")),
    "awd without reference": (AWD, ("v_x", *TORQUES)),
    "no wheels": (RWD, tuple(f"omega_{w}" for w in WHEELS)),
}


@pytest.mark.parametrize("case", CASES)
def test_samples_of_windows_are_those_of_the_whole(tmp_path, case):
    vehicle, without = CASES[case]
    path = drive(tmp_path / "a.parquet", without=without)
    for rows in (137, 100_000) if case == "all" else (611,):
        whole, long = both(path, vehicle, rows)
        assert long.samples.equals(whole.samples)
        assert long.samples.schema == whole.samples.schema
        assert long.about == whole.about
        assert (long.full is None) == (whole.full is None)
        assert long.full is None or long.full.equals(whole.full)
    assert whole.samples.height == 400
    assert set(whole.samples["reason"].unique()) > {0}


@pytest.mark.parametrize(("dt", "seconds"), [(0.01, 0.05), (0.01, 0.35), (0.04, 3.0), (0.5, 60.0)])
def test_short_and_slow_drives(tmp_path, dt, seconds):
    path = drive(tmp_path / "a.parquet", dt=dt, seconds=seconds)
    for rows in (1, 7) if seconds < 1.0 else (7,):
        whole, long = both(path, RWD, rows)
        assert long.samples.equals(whole.samples)
        assert long.about == whole.about
        assert (long.full is None) == (whole.full is None)
        assert long.full is None or long.full.equals(whole.full)
    assert whole.samples.height == round(seconds / dt) // max(1, round(measuring.STEP_S / dt))


def test_bits_are_those_of_their_detectors(tmp_path):
    path = drive(tmp_path / "a.parquet")
    signals = load_signals([path], vehicle=RWD)
    tracks = {(t.detector, t.wheel): t.active for t in detect_drive(signals, RWD).tracks}
    kept = measure(signals, RWD).samples
    none, seen = np.zeros(signals.frame.height, dtype=bool), 0
    for w in WHEELS:
        down, up, minor = (tracks.get((d, w), none) for d in ("spin_down", "spin_up", "minor_spin_down"))
        for name, bits in (("spin", down | up), ("minor", minor)):
            assert kept[f"{name}_{w}"].to_list() == bits.reshape(-1, 10).any(axis=1).tolist()
            seen += bits.any()
    assert seen > 4


@pytest.mark.parametrize("width", [1, 3, 29, 31])
def test_a_mean_is_that_of_its_own_samples(width):
    rng = np.random.default_rng(width)
    x = 20.0 + rng.standard_normal(400)
    x[[50, 51, 130]] = np.nan
    mean = smoothed(x, width)
    half = width // 2
    expected = [x[max(i - half, 0) : i + half + 1].mean() if half <= i < 400 - half else np.nan for i in range(400)]
    np.testing.assert_allclose(mean, expected, rtol=1e-13)
    np.testing.assert_array_equal(smoothed(x[100:300], width)[half : 200 - half], mean[100 + half : 300 - half])
    assert np.isnan(smoothed(x[: width - 1], width)).all()


def test_a_batch_of_long_drives_keeps_the_same(tmp_path, monkeypatch):
    campaign = configure(make_campaign(tmp_path, speeds=(90,), repeats=1))
    run_batch(campaign, Store(tmp_path / "whole"))
    monkeypatch.setattr(load_drive, "__kwdefaults__", {**load_drive.__kwdefaults__, "least": 1})
    run_batch(campaign, Store(tmp_path / "long"))
    whole, long = Store(tmp_path / "whole"), Store(tmp_path / "long")
    (key,), failed = long.keys()
    assert not failed
    assert whole.keys()[0] == {key}
    assert long.samples(key).equals(whole.samples(key))
    assert long.about(key) == whole.about(key)


def test_the_log_s_own_rate_is_kept_around_episodes_alone(tmp_path):
    """A whole file beside the samples; without it, as in an older store, all else is as before."""
    made = make_campaign(tmp_path, speeds=(100,), repeats=1)
    configured = configure(made)
    store = Store(tmp_path / "store")
    assert run_batch(configured, store).made == 1
    (info,) = (data := load_results(configured, store)).done
    episodes = info.judgement.episodes
    assert episodes
    full = data.full(info)
    t = full["t"].to_numpy()
    assert np.diff(t).min() == pytest.approx(0.01)
    assert all(any(e.start_s - 2.0 - 1e-6 <= x <= e.end_s + 2.0 + 1e-6 for e in episodes) for x in t)
    whole = detect_drive(load_signals(info.run.logs, vehicle=info.vehicle), info.vehicle)
    rows = np.round(t / 0.01).astype(int)
    assert full["v_x"].to_numpy() == pytest.approx(whole.features["v_x_hat"].to_numpy()[rows], rel=1e-6)
    text = run_page(data, info, data.samples(info), None, back="", full=full)
    assert "The log&#39;s own rate, one point every 0.01 s, from 2 s before to 2 s after the episodes" in text
    (path,) = (tmp_path / "store" / "full").iterdir()
    pl.read_parquet(path).with_columns(pl.col("v_x").cast(pl.String)).write_parquet(path)
    assert data.full(info) is None  # columns of another kind are damage
    path.unlink()
    older = load_results(configured, Store(tmp_path / "store"))
    assert older.full(info) is None
    assert "own rate, one point" not in run_page(older, info, older.samples(info), None, back="")
    assert run_batch(configured, store).kept == 1


def test_what_is_kept_at_full_rate_is_bounded():
    n, dt = 90_000, 0.01
    active = np.ones(n, dtype=bool)
    track = Track("minor_spin_down", "fl", "left", "m/s", np.ones(n), 1.0, active)
    episode = Episode("aquaplaning", 10.0, 890.0, ("fl",), "f", "left", "partial", 20.0, (), 0.1, -0.1, 0.0, 1e4, ())
    full = FullRate(dt)
    for a in range(0, n, 7000):
        part = slice(a, a + 7000)
        full.push({"v_x_hat": np.full(active[part].size, 20.0)}, [replace(track, active=active[part])])
    found = full.finish(Judgement("aquaplaning", episodes=(episode,)))
    assert found.height == round(MOST_S / dt)
    assert found["t"][0] == 8.0
    assert FullRate(dt).finish(Judgement()) is None
