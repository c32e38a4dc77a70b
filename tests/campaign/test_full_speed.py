"""Chord, contact and speed of full aquaplaning: the brush turned round, honest intervals, events in words."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aqualog.campaign import full_speed
from aqualog.campaign.bins import KMH, Pool
from aqualog.campaign.delay import Delay
from aqualog.campaign.expected import LINEAR, contact_of, tangent_of
from aqualog.campaign.full_speed import EVENTS, FullSpeed, _drawn, _foretold, _from_passes, _from_slopes
from aqualog.campaign.slip_slope import SlopeRow, _with_dry, contact, fit_slope
from aqualog.campaign.spin_downs import Pass
from aqualog.core.intervals import NOWHERE
from aqualog.physics.tyre_brush import brush_force
from aqualog.report.campaign.bins import slope_document

TANGENT, DRY, WET = 27.0, 1.02, 0.816
S = np.linspace(-0.1, 0.3, 8001)


def chord(L, mu_max, low, high):
    carried = brush_force(S, np.ones_like(S), mu=mu_max, C_s=TANGENT, L=L)
    at_low, at_high = np.interp([low, high], carried, S)
    return (high - low) / (at_high - at_low)


def row(L, v=90.0, half=0.03, mu_range=(0.01, 0.16), road="wet", dof=6.0):
    """A row whose interval is +-half of its slope's inverse."""
    slope = chord(L, WET if road == "wet" else DRY, *mu_range)
    ends = (slope / (1.0 + half), slope / (1.0 - half))
    bare = SlopeRow((), "rr", road, v - 5.0, v + 5.0, 6, 300, mu_range, v * KMH, slope=slope, slope_ci=ends, dof=dof)
    return replace(bare, friction=(DRY, WET), reliable=True)


DRY_ROW = row(1.0, half=0.01, mu_range=(0.0, 0.22), road="dry", dof=20.0)


@pytest.mark.parametrize("L", [1.0, 0.9, 0.75, 0.6, 0.5])
@pytest.mark.parametrize("mu_range", [(0.01, 0.1), (0.03, 0.25), (-0.02, 0.16)])
def test_contact_is_the_one_whose_chord_was_measured(L, mu_range):
    measured = _with_dry(row(L, mu_range=mu_range), DRY_ROW)
    assert measured.contact_ratio == pytest.approx(L, abs=2e-3)
    assert measured.contact_ratio_ci[0] < L < measured.contact_ratio_ci[1]
    if mu_range[1] > 0.2 and L < 1.0:  # driven as far as the dry road: (2.2) of two chords is too low
        assert (measured.slope / measured.slope_dry) ** 0.5 < L - 0.02


def test_the_thesis_equation_is_the_limit_at_small_traction_and_without_sliding():
    share = np.array([0.3, 0.6, 0.9])
    assert contact_of(share, WET, (0.0, 1e-3)) == pytest.approx(np.sqrt(share), abs=2e-3)
    assert contact_of(share, LINEAR[1], (0.0, 0.2)) == pytest.approx(np.sqrt(share), abs=1e-4)
    assert tangent_of(np.array([chord(1.0, DRY, 0.02, 0.25)]), DRY, (0.02, 0.25))[0] == pytest.approx(TANGENT, rel=1e-3)


def test_limits_of_the_contact():
    mu_range = (0.0, 0.25)
    least = contact_of(np.array([1e-3]), WET, mu_range)[0]
    assert WET * least**2 * (3.0 - 2.0 * least) >= 0.25  # it carries the traction driven
    assert contact_of(np.array([1.5]), WET, mu_range)[0] > 1.0
    assert np.isnan(contact_of(np.array([0.5]), 0.2, mu_range)[0])
    assert np.isnan(contact_of(np.array([np.nan]), WET, mu_range)[0])


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_friction_that_is_wrong_by_a_fifth_hardly_matters(factor):
    wrong = replace(DRY_ROW, friction=(factor * DRY, factor * WET))
    for L, most in ((0.9, 0.01), (0.8, 0.01), (0.6, 0.025)):
        r = replace(row(L), friction=wrong.friction)
        assert float(contact(r, wrong, np.array(r.slope), np.array(wrong.slope))) == pytest.approx(L, abs=most)


def curve(v_full, n, speeds=(65, 75, 85, 95, 105, 115), off=(), half=0.03):
    off = off or np.zeros(len(speeds))
    return [_with_dry(row(1.0 - (v / v_full) ** n + d, v, half), DRY_ROW) for v, d in zip(speeds, off, strict=True)]


def told(rows, seed=1):
    return _from_slopes((), "rr", rows, DRY_ROW, np.random.default_rng(seed))


def test_speed_is_where_the_contact_ends():
    found = told(curve(140.0, 4.0))
    assert found.v / KMH == pytest.approx(140.0, abs=1.0)
    assert found.exponent == pytest.approx(4.0, abs=0.5)
    assert found.ci[0] < 140.0 * KMH < found.ci[1]


def test_bins_off_the_curve_widen_the_interval(monkeypatch):
    rows = curve(130.0, 4.0, half=0.01, off=(0.0, -0.03, 0.03, -0.04, 0.04, -0.02))
    off = told(rows)
    monkeypatch.setattr(full_speed, "_lack", lambda *_: 1.0)
    trusted = told(rows)
    assert trusted.v == off.v
    assert off.ci[1] - off.ci[0] > 1.3 * (trusted.ci[1] - trusted.ci[0])


@pytest.mark.parametrize("dof", [2.0, 4.0, 30.0])
def test_slopes_are_drawn_as_wide_as_their_interval(dof):
    r = row(0.9, half=0.2, dof=dof)
    rng = np.random.default_rng(3)
    low, high = np.quantile(np.concatenate([_drawn(r, rng) for _ in range(50)]), (0.025, 0.975))
    assert (1.0 / high, 1.0 / low) == pytest.approx(r.slope_ci, rel=0.03)


def test_coverage_with_few_degrees_of_freedom():
    """100 experiments, of slopes that scatter as their intervals say: a share of 0.95 has a standard error of 0.02."""
    rng, held = np.random.default_rng(7), 0
    half_of_k = 0.03
    for i in range(100):
        rows = []
        for r in curve(135.0, 4.0):
            k = 1.0 / r.slope * (1.0 + half_of_k / 2.776 * rng.normal())
            half = half_of_k / 2.776 * np.sqrt(rng.chisquare(4.0) / 4.0) * 2.776 / r.slope
            rows.append(_with_dry(replace(r, slope=1 / k, slope_ci=(1 / (k + half), 1 / (k - half)), dof=4.0), DRY_ROW))
        found = told(rows, i)
        held += found.ci[0] <= 135.0 * KMH <= found.ci[1]
    assert held >= 88


def test_what_cannot_be_told():
    assert "falls too little to extrapolate" in told(curve(230.0, 4.0)).reason
    assert told(curve(400.0, 4.0, off=[0.02] * 6)).rests_on == "6 bins, 65 to 115 km/h, contact down to 100 %"
    assert "2 bins" in told(curve(140.0, 4.0)[:2]).reason
    assert "beyond" in told(curve(200.0, 2.0, speeds=(60, 70, 80))).reason
    assert "no dry slope" in _from_slopes((), "rr", curve(140.0, 4.0), None, np.random.default_rng(1)).reason


def passes(full, minor):
    speeds = np.repeat([70, 80, 90, 100, 110, 120], 5) * KMH
    return [
        Pass(None, 0.1, np.full(40, v), {}, {"fl": (v,) * int(v > minor * KMH)}, {"fl": (v,) * int(v > full * KMH)})
        for v in speeds
    ]


def test_the_twenty_of_the_thesis_has_a_tolerance():
    rng = np.random.default_rng(2)
    minor = _from_passes((), passes(115, 85), "minor_spin_down", rng)
    full = _from_passes((), passes(115, 85), "spin_down", rng)
    assert minor.v / KMH == pytest.approx(105.0, abs=1.0)
    assert full.v / KMH == pytest.approx(115.0, abs=1.0)
    assert minor.ci[0] <= minor.v - 5.0 * KMH
    assert minor.ci[1] >= minor.v + 5.0 * KMH
    assert full.ci[1] - full.ci[0] < 9.0 * KMH


def test_passes_that_sweep_the_speed_have_their_limit_at_their_event():
    """Limits of 100 +- 3 km/h, passes from 60 to 88 ... 125 km/h: the median of 40 campaigns, and what they cover."""
    rng = np.random.default_rng(5)
    found = []
    for _ in range(40):
        limits, ends = rng.normal(100.0, 3.0, 16), rng.uniform(88.0, 125.0, 16)
        of = [Pass(None, 0.1, np.linspace(60.0, end, 140) * KMH, {"fl": np.zeros(140)}, {},
                   {"fl": (limit * KMH,) if limit < end else ()}) for limit, end in zip(limits, ends, strict=True)]  # fmt: skip
        found.append(_from_passes((), of, "spin_down", rng))
    v, low, high = np.array([(f.v, *f.ci) for f in found if math.isfinite(f.v)]).T / KMH
    assert np.median(v) == pytest.approx(100.0, abs=1.0)
    assert np.mean((low < 100.0) & (high > 100.0)) > 0.8


def test_what_passes_that_are_slower_foretell():
    """The fastest passes count most; what passes share of tyre, water and laws, more of them do not lower."""

    def of(*found):
        return _foretold(
            (), [Pass(None, 0.1, np.full(40, v), {}, {}, {}, (np.log(full * KMH), s)) for v, full, s in found]
        )

    one, both = of((28.0, 120.0, 0.1)), of((28.0, 120.0, 0.1), (20.0, 150.0, 0.1))
    assert one.v / KMH == pytest.approx(120.0)
    assert 120.0 < both.v / KMH < 120.1
    widths = [np.log(x.ci[1] / x.ci[0]) for x in (one, both, of(*[(28.0, 120.0, 0.1)] * 4))]
    assert widths == pytest.approx(0.392 * np.sqrt([1.0, 0.999, 0.5 + 0.5 / 4]), abs=1e-3)
    assert "too far" in of((28.0, 120.0, 0.25)).reason
    assert "no pass" in _foretold((), passes(115, 85)).reason


def test_ways_are_different_events_in_words():
    assert len({short for short, _ in EVENTS.values()}) == len(EVENTS) == 4
    speed = FullSpeed((), "free", "minor_spin_down")
    assert "20 ± 5" in speed.defines
    empty = type("T", (), {"rows": (), "dry": (), "delays": (), "left_out": {}, "robust": False})()
    empty.plan = type("P", (), {"keys": (), "width_kmh": 10.0})()
    empty.rows = (replace(row(1.0), contact_ratio=1.02, contact_ratio_ci=(0.95, 1.1)),)
    document = slope_document("x", empty, [speed], [], [])
    assert (document["rows"][0]["contact_ratio"], document["rows"][0]["contact_ratio_ci95"]) == (1.0, [0.95, 1.0])
    (written,) = document["full_aquaplaning"]
    assert (written["event"], written["defines"]) == EVENTS["minor_spin_down"]


def fitted(seed, *, k_scatter, runs=3):
    rng = np.random.default_rng(seed)
    run = np.repeat(np.arange(runs), 40)
    mu = 0.05 + 0.03 * np.sin(np.arange(run.size) / 5.0)
    k = (1.0 / 25.0) * (1.0 + k_scatter * np.linspace(-1.0, 1.0, runs))
    slip = k[run] * mu + 1e-5 * rng.normal(size=run.size)
    bare = SlopeRow((), "rr", "wet", 80.0, 90.0, runs, run.size, (0.02, 0.08), 85 * KMH)
    pool = Pool(run, np.arange(run.size), {"mu": mu, "slip": slip, "u": 0.0 * mu, "v_x": 24.0 + 0.0 * mu})
    return fit_slope(bare, pool, [None] * runs)


def test_a_wide_interval_is_not_reliable_and_says_so():
    sure = fitted(1, k_scatter=0.1)
    assert sure.reliable
    assert not sure.reason
    wide = fitted(1, k_scatter=0.3)
    assert wide.told
    assert np.isfinite(wide.slope_ci).all()
    assert wide.slope_ci[1] / wide.slope_ci[0] > 3.0
    assert not wide.reliable
    assert "factor of" in wide.reason


@pytest.mark.parametrize("road", ["dry", "wet"])
def test_with_an_unknown_delay_no_slope_on_water_is_reliable(road):
    """There mu / C(v) and the delay's a / v are alike."""
    rng = np.random.default_rng(5)
    run, late = np.repeat(np.arange(5), 80), Delay("car", math.nan, NOWHERE, 5, 400, "too even")
    v = 25.0 + 6.0 * np.sin(np.arange(run.size) / 17.0)
    mu = 0.05 + 0.03 * np.sin(np.arange(run.size) / 5.0)
    slip = mu / (30.0 if road == "dry" else 30.0 * (25.0 / v) ** 3) + 0.1 * mu / v + 1e-5 * rng.normal(size=run.size)
    bare = SlopeRow((), "rr", road, 80.0, 100.0, 5, run.size, (0.02, 0.08), 25.0)
    pool = Pool(run, np.arange(run.size), {"mu": mu, "slip": slip, "u": mu / v, "v_x": v})
    found = fit_slope(bare, pool, [late] * 5)
    assert found.reliable == (road == "dry")
    if found.reliable:
        assert found.slope == pytest.approx(30.0, rel=0.03)
    else:
        assert np.isnan(found.slope_ci).all()
        assert "the delay of v_x is not known" in found.reason


def test_a_line_worse_than_a_constant_is_not_reliable():
    """Offsets of the runs against the line's direction: within each run the slip follows the traction."""
    run = np.repeat(np.arange(5), 40)
    x = 0.02 * np.sin(np.arange(run.size) / 5.0)
    mu = 0.05 + 0.01 * run + x
    slip = mu / 25.0 - 0.004 * run + 1e-5 * np.random.default_rng(1).normal(size=run.size)
    bare = SlopeRow((), "rr", "wet", 80.0, 90.0, 5, run.size, (0.02, 0.1), 85 * KMH)
    pool = Pool(run, np.arange(run.size), {"mu": mu, "slip": slip, "u": 0.0 * mu, "v_x": 24.0 + 0.0 * mu})
    found = fit_slope(bare, pool, [None] * 5)
    assert found.r2 < 0.0
    assert not found.reliable
    assert "r2" in found.reason


@pytest.mark.parametrize("follows", [0.0, 0.01])
def test_where_the_traction_follows_the_speed_its_slope_is_that_of_the_middle(follows):
    """Runs that sweep the speed with rising traction: the slope falls meanwhile, which is no part of a slope."""
    rng = np.random.default_rng(5)
    run = np.repeat(np.arange(8), 40)
    v = np.tile(np.linspace(23.6, 26.4, 40), 8)
    mu = 0.12 + 0.004 * rng.normal(size=8)[run] + follows * (v - 25.0) + 0.01 * np.sin(np.arange(run.size) / 3.0)
    slip = mu * (1.0 + 0.12 * (v - 25.0)) / 22.0 + 1e-4 * rng.normal(size=run.size)
    bare = SlopeRow((), "rr", "wet", 85.0, 95.0, 8, run.size, (0.1, 0.14), 25.0)
    pool = Pool(run, np.arange(run.size), {"mu": mu, "slip": slip, "u": 0.0 * mu, "v_x": v})
    found = fit_slope(bare, pool, [None] * 8)
    assert found.slope == pytest.approx(22.0, rel=0.1)
    assert found.slope_ci[0] < 22.0 < found.slope_ci[1]
