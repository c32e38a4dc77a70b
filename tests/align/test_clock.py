"""Clock offset, drift and scale between two sources: known truth, refusals, coverage, measured drives."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from aqualog.align.clock import estimate_clock
from aqualog.core.errors import FitError

REAL = Path(__file__).resolve().parents[3] / "shared" / "real_logs"
real = [
    pytest.mark.real,
    pytest.mark.skipif(not REAL.is_dir(), reason="measured drives are not beside the checkout (../shared/real_logs)"),
]
FINE = 0.02


def ar1(rng, n, memory, sd):
    """Stationary AR(1) noise with `memory` samples to 1/e, by its spectrum: no loop over samples."""
    a = math.exp(-1.0 / memory)
    pad = int(8 * memory) + 1
    kernel = a ** np.arange(pad)
    size = 1 << (n + 2 * pad).bit_length()
    white = rng.standard_normal(n + pad) * sd * math.sqrt(1.0 - a * a)
    return np.fft.irfft(np.fft.rfft(white, size) * np.fft.rfft(kernel, size), size)[pad : pad + n]


def drive(rng, seconds):
    """True speed on a 20 ms grid: pulls and brakings of 1 to 8 s through a first-order lag."""
    n = int(seconds / FINE)
    target = np.repeat(rng.normal(0.0, 1.2, n // 50 + 1), rng.integers(50, 400, n // 50 + 1))[:n]
    lag = np.exp(-np.arange(500) * FINE / 0.5) * FINE / 0.5
    size = 1 << (n + 500).bit_length()
    a = np.fft.irfft(np.fft.rfft(target, size) * np.fft.rfft(lag, size), size)[:n]
    t = np.arange(n) * FINE
    v = np.cumsum(a) * FINE
    knots = np.arange(0.0, seconds + 20.0, 20.0)
    v = v - np.interp(t, knots, np.interp(knots, t, v)) * 0.9  # stays within road speeds
    return t, 20.0 + v


def sample(rng, t, v, rate, *, sd=0.02, memory_s=1.0, jitter=0.002, q=0.0, offset=0.0, ppm=0.0, scale=1.0, bias=0.0):
    s = np.arange(t[0] + 1.0, t[-1] - 1.0, 1.0 / rate)
    s = s + rng.uniform(-jitter, jitter, s.size)
    noise = ar1(rng, s.size, memory_s * rate, sd) + rng.normal(0.0, 0.3 * sd, s.size)
    x = scale * np.interp(s, t, v) + bias + noise
    if q:
        x = np.round(x / q) * q
    stamps = s + offset + ppm * 1e-6 * (s - t.mean())
    return np.rint(stamps * 1e9).astype(np.int64), x


def pair(seed, seconds=300.0, **other):
    rng = np.random.default_rng(seed)
    t, v = drive(rng, seconds)
    rate = other.pop("rate", 10.0)
    return *sample(rng, t, v, 100.0, q=0.02), *sample(rng, t, v, rate, **{"sd": 0.05, "jitter": 0.005, **other})


def holds(interval, truth):
    return interval[0] <= truth <= interval[1]


def test_late_source_has_positive_offset():
    t = np.arange(0, 60_000_000_000, 20_000_000)
    s = t * 1e-9
    v = 20.0 + np.sin(s * 0.7) + 2.0 * np.sin(s * 0.23) + 0.5 * np.sin(s * 1.9) + 3.0 * np.sin(s * 0.11)
    fit = estimate_clock(t, v, t + 250_000_000, v)
    assert fit.offset_s == pytest.approx(0.25, abs=1e-4)
    assert np.abs(fit.to_reference(t + 250_000_000) - t).max() < 100_000
    assert estimate_clock(t + 250_000_000, v, t, v).offset_s == pytest.approx(-0.25, abs=1e-4)


def test_below_one_sample():
    for seed in range(3):
        fit = estimate_clock(*pair(seed, 1200.0, offset=0.137, sd=0.02, scale=1.009))
        assert fit.offset_s == pytest.approx(0.137, abs=0.003)
        assert fit.scale == pytest.approx(1.009, abs=0.002)


def test_without_noise_the_grid_leaves_no_trace():
    rng = np.random.default_rng(3)
    t, v = drive(rng, 200.0)
    for offset in (0.0, 0.0125, 0.137, -1.2345):
        a = sample(rng, t, v, 100.0, sd=0.0)
        b = sample(rng, t, v, 1000.0, sd=0.0, jitter=0.0, offset=offset)
        assert estimate_clock(*a, *b).offset_s == pytest.approx(offset, abs=2e-4)


def test_scale_bias_and_order_of_the_sources():
    t_ref, v_ref, t, v = pair(2, offset=-0.31, scale=1.02)
    plain, bent, turned = (
        estimate_clock(*x) for x in ((t_ref, v_ref, t, v), (t_ref, v_ref, t, 3.6 * v + 7.0), (t, v, t_ref, v_ref))
    )
    assert bent.offset_s == pytest.approx(plain.offset_s, abs=1e-6)
    assert bent.scale == pytest.approx(3.6 * plain.scale, rel=1e-6)
    assert bent.bias == pytest.approx(3.6 * plain.bias + 7.0, abs=1e-4)
    assert bent.peak == pytest.approx(plain.peak, abs=1e-9)
    assert turned.offset_s == pytest.approx(-plain.offset_s, abs=2e-3)
    assert turned.scale * plain.scale == pytest.approx(1.0, abs=2e-3)


def test_drift_of_100_ppm_over_20_minutes():
    for seed in range(3):
        fit = estimate_clock(*pair(seed, 1200.0, rate=50.0, offset=1.5, ppm=100.0))
        assert fit.drift_significant
        assert fit.drift_ppm == pytest.approx(100.0, abs=25.0)
        assert holds(fit.drift_ppm_ci95, 100.0)
        stamps = np.array([60, 600, 1140]) * 1_000_000_000
        shown = stamps + np.rint((1.5 + 1e-4 * (stamps * 1e-9 - 600.0)) * 1e9).astype(np.int64)
        assert np.abs(fit.to_reference(shown) - stamps).max() < 20_000_000


def test_no_drift_is_not_claimed_nor_applied():
    fit = estimate_clock(*pair(4, 1200.0, offset=1.5))
    assert not fit.drift_significant
    assert holds(fit.drift_ppm_ci95, 0.0)
    moved = fit.to_reference(np.array([0, 10**12]))
    assert moved[1] - moved[0] == 10**12


def test_tyre_slip_is_told_from_time():
    rng = np.random.default_rng(8)
    t, v = drive(rng, 1200.0)
    v = 30.0 + 12.0 * np.sin(t / 40.0) + v - 20.0
    wheel = v * (1.0 + 0.003 * np.gradient(v, FINE))
    fit = estimate_clock(*sample(rng, t, v, 20.0), *sample(rng, t, wheel, 20.0, offset=0.2))
    assert fit.offset_s == pytest.approx(0.2 - 0.003 * 30.0, abs=0.03)
    assert fit.slip_offset_s == pytest.approx(0.2, abs=0.01)
    assert holds(fit.slip_offset_ci95, 0.2)


def test_yaw_rate_has_no_slip():
    rng = np.random.default_rng(5)
    t, v = drive(rng, 300.0)
    yaw = 0.05 * (v - 20.0)
    a, b = sample(rng, t, yaw, 50.0, sd=0.002), sample(rng, t, yaw, 100.0, sd=0.005, offset=-0.08)
    fit = estimate_clock(*a, *b, quantity="yaw_rate")
    assert fit.offset_s == pytest.approx(-0.08, abs=0.01)
    assert math.isnan(fit.slip_offset_s)


def test_nan_gaps_spikes_and_duplicates():
    t_ref, v_ref, t, v = pair(6, 600.0, rate=50.0, offset=0.6)
    rng = np.random.default_rng(0)
    v, v_ref = v.copy(), v_ref.copy()
    v[rng.random(v.size) < 0.1] = np.nan
    v_ref[rng.random(v_ref.size) < 0.05] = np.inf
    keep = ~((t > 200e9) & (t < 230e9))
    keep_ref = ~((t_ref > 400e9) & (t_ref < 415e9))
    for k in rng.integers(0, v.size, 6):
        v[k : k + 30] *= 1.3  # wheel spin
    t = t.copy()
    t[1000] = t[999]
    fit = estimate_clock(t_ref[keep_ref], v_ref[keep_ref], t[keep], v[keep])
    assert fit.offset_s == pytest.approx(0.6, abs=0.02)
    assert holds(fit.offset_ci95, 0.6)
    assert 500.0 < fit.overlap_s < 555.0


def test_different_gaps_do_not_pull_the_offset():
    rng = np.random.default_rng(12)
    t, v = drive(rng, 600.0)
    a, b = sample(rng, t, v, 50.0, sd=0.0), sample(rng, t, v, 50.0, sd=0.0, offset=0.3)
    keep = [np.interp(x[0] * 1e-9 % period, [0, period], [0, 1]) > 0.2 for x, period in ((a, 17.0), (b, 23.0))]
    fit = estimate_clock(a[0][keep[0]], a[1][keep[0]], b[0][keep[1]], b[1][keep[1]])
    assert fit.offset_s == pytest.approx(0.3, abs=1e-3)


def test_same_input_same_numbers_and_inputs_untouched():
    arrays = pair(7, offset=0.2)
    for a in arrays:
        a.flags.writeable = False
    assert estimate_clock(*arrays) == estimate_clock(*arrays)


def test_clocks_hours_apart():
    t_ref, v_ref, t, v = pair(9, offset=0.2)
    epoch = 1_700_000_000_000_000_000
    with pytest.raises(FitError, match="do not overlap") as caught:
        estimate_clock(t_ref + epoch, v_ref, t, v)
    assert "start_offset_s = -1699999999.8" in caught.value.hint
    fit = estimate_clock(t_ref + epoch, v_ref, t, v, start_offset_s=-1.7e9)
    assert fit.offset_s == pytest.approx(-1.7e9 + 0.2, abs=0.02)
    assert holds(fit.slip_offset_ci95, -1.7e9 + 0.2)
    assert abs(fit.mid_ns - int(t.mean())) < 2e9


def refused(*arrays, match, **options):
    with pytest.raises(FitError, match=match) as caught:
        estimate_clock(*arrays, **options)
    assert caught.value.where.startswith("clock fit on")
    assert caught.value.expected
    assert "\n" not in caught.value.line()


def test_too_little_overlap():
    t_ref, v_ref, t, v = pair(1)
    early, late = t_ref < 100e9, t > 80e9
    refused(t_ref[early], v_ref[early], t[late], v[late], match="share at most", max_offset_s=1.0)
    refused(t_ref, v_ref, t[:100], v[:100], match="share at most")
    sparse = v.copy()
    sparse[(t % 20e9) > 2e9] = np.nan
    refused(t_ref, v_ref, t, sparse, match="usable in both|without gaps")


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_constant_speed(noise):
    t_ref, v_ref, t, _ = pair(1)
    still = 20.0 + noise * np.random.default_rng(0).standard_normal(t.size)
    refused(t_ref, v_ref, t, still, match="other source: no variation|weak peak")
    refused(t, still, t_ref, v_ref, match="reference: no variation|weak peak")


def test_periodic_signals_are_ambiguous():
    t = np.arange(0, 300_000_000_000, 20_000_000)
    slalom = 0.3 * np.sin(2.0 * np.pi * t * 1e-9 / 4.0)
    noise = np.random.default_rng(0).normal(0.0, 0.01, t.size)
    refused(t, slalom, t, slalom + noise, match="ambiguous", quantity="yaw_rate")
    near = estimate_clock(t, slalom, t + 300_000_000, slalom + noise, quantity="yaw_rate", max_offset_s=1.5)
    assert near.offset_s == pytest.approx(0.3, abs=0.01)


def test_offset_outside_the_search_range():
    t_ref, v_ref, t, v = pair(1, offset=6.0)
    refused(t_ref, v_ref, t, v, match="edge of the search range|weak peak", max_offset_s=4.0)
    refused(t_ref, v_ref, t, v, match="edge of the search range", max_offset_s=5.8)
    assert estimate_clock(t_ref, v_ref, t, v, max_offset_s=7.0).offset_s == pytest.approx(6.0, abs=0.02)


def test_bad_arguments_and_opposite_signs():
    *ref, t, v = pair(1)
    refused(*ref, t, -v, match="opposite signs")
    refused(*ref, t[::-1], v, match="backwards")
    refused(*ref, t, v[:-1], match="stamps for")
    refused(*ref, t, np.full(t.size, np.nan), match="finite samples")
    refused(*ref, t[:0], v[:0], match="finite samples")
    refused(*ref, t, v, match="search range", max_offset_s=0.0)
    refused(*ref, t, v, match="start offset", start_offset_s=math.nan)
    refused(*ref, t, v, match="least overlap", min_overlap_s=5.0)


@pytest.mark.parametrize(
    ("seconds", "sd", "memory_s"), [(60.0, 0.1, 2.0), pytest.param(150.0, 0.3, 5.0, marks=pytest.mark.nightly)]
)
def test_intervals_cover_the_truth(seconds, sd, memory_s):
    cases, refusals, hits = 220, 0, np.zeros(5)
    for seed in range(cases):
        offset = np.random.default_rng(10_000 + seed).uniform(-3.0, 3.0)
        data = pair(seed, seconds, offset=offset, sd=sd, memory_s=memory_s, scale=1.01, bias=0.3)
        try:
            fit = estimate_clock(*data)
        except FitError:  # a minute with few pulls proves nothing
            refusals += 1
            continue
        hits += [
            holds(fit.offset_ci95, offset),
            holds(fit.slip_offset_ci95, offset),
            holds(fit.drift_ppm_ci95, 0.0),
            holds(fit.scale_ci95, 1.01),
            not fit.drift_significant,
        ]
    assert refusals <= 0.09 * cases  # 200 cases are left
    share = hits / (cases - refusals)
    assert 0.90 <= share[0] <= 0.99
    assert (share[1:4] >= 0.90).all()
    assert share[4] >= 0.98


@pytest.mark.parametrize(
    ("seconds", "max_offset_s", "cases"),
    [(60.0, 10.0, 100),
     *(pytest.param(*x, marks=pytest.mark.nightly) for x in ((60.0, 10.0, 300), (150.0, 60.0, 200)))],
)  # fmt: skip
def test_unrelated_drives_are_refused(seconds, max_offset_s, cases):
    accepted = 0
    for seed in range(cases):
        rng = np.random.default_rng(seed)
        a, b = drive(rng, seconds), drive(rng, seconds)
        try:
            estimate_clock(*sample(rng, *a, 50.0), *sample(rng, *b, 10.0, sd=0.05), max_offset_s=max_offset_s)
            accepted += 1
        except FitError:
            pass
    assert accepted <= 0.01 * cases


def test_speed():
    data = pair(0, 1200.0, rate=50.0, offset=0.1)
    began = time.perf_counter()
    estimate_clock(*data)
    assert time.perf_counter() - began < 3.0


def toyota(name):
    table = pl.read_csv(REAL / "toyota_rav4" / name)
    if name == "gnss.csv":
        values = table["speed [m/s]"].to_numpy()
    else:
        values = table.drop("t [s]").to_numpy().mean(axis=1)
    return np.rint(table["t [s]"].to_numpy() * 1e9).astype(np.int64), values


def porsche(name, *columns):
    table = pl.read_csv(REAL / "porsche_981" / name).select("t_ms", pl.mean_horizontal(*columns).alias("x"))
    return table["t_ms"].to_numpy() * 1_000_000, table["x"].cast(pl.Float64).fill_null(np.nan).to_numpy()


class TestMeasured:
    pytestmark = real

    @pytest.mark.parametrize("name", ["speed.csv", "wheel_speed.csv"])
    def test_toyota_gnss_is_late_and_reads_more(self, name):
        fit = estimate_clock(*toyota(name), *toyota("gnss.csv"))
        assert 0.1 < fit.offset_s < 0.25
        assert fit.offset_ci95[0] > 0.0
        assert holds(fit.offset_ci95, 0.17)
        assert fit.ratio == pytest.approx(1.009, abs=0.002)
        assert holds(fit.scale_ci95, 1.009)
        assert not fit.drift_significant

    def test_toyota_speed_and_wheels_share_a_clock(self):
        fit = estimate_clock(*toyota("speed.csv"), *toyota("wheel_speed.csv"))
        assert abs(fit.offset_s) < 1e-3
        assert fit.ratio == pytest.approx(1.0, abs=1e-3)

    def test_porsche_wheels_are_ahead_of_gps(self):
        gps = porsche("gps_10Hz.csv", "GPS Speed")
        wheels = porsche("wheels_10Hz.csv", "WHEEL_FL", "WHEEL_FR", "WHEEL_RL", "WHEEL_RR")
        fit = estimate_clock(*gps, *wheels)
        assert fit.offset_s == pytest.approx(-0.21, abs=0.02)
        assert fit.ratio == pytest.approx(3.6, rel=0.01)  # km/h against m/s
        assert fit.slip_offset_s > fit.offset_s + 0.02  # part of the lead is tyre slip
        assert not fit.drift_significant
        speed = estimate_clock(*gps, *porsche("wheels_10Hz.csv", "VEH_SPD"))
        assert speed.offset_s == pytest.approx(-0.22, abs=0.02)

    def test_porsche_yaw_rate_of_wheels_and_gyro(self):
        table = pl.read_csv(REAL / "porsche_981" / "wheels_10Hz.csv")
        turn = (table["WHEEL_FL"] - table["WHEEL_FR"]) / 3.6 / 1.5
        gyro = porsche("imu_50Hz.csv", "YawRate")
        wheels = table["t_ms"].to_numpy() * 1_000_000, turn.cast(pl.Float64).fill_null(np.nan).to_numpy()
        refused(*gyro, wheels[0], -wheels[1], match="opposite signs", quantity="yaw_rate")
        fit = estimate_clock(*gyro, *wheels, quantity="yaw_rate")
        assert abs(fit.offset_s) < 0.06
