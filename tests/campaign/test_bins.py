"""Cells, slopes per bin, delay, resistance, speeds of full aquaplaning: from made samples whose truth is known."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from aqualog.campaign.bins import KMH, check_plan, plan
from aqualog.campaign.definition import Campaign, Run
from aqualog.campaign.delay import delays
from aqualog.campaign.expected import expected
from aqualog.campaign.full_speed import fit_contact, fit_half, full_speeds
from aqualog.campaign.means import resistances, spin_ups
from aqualog.campaign.measure import REASONS
from aqualog.campaign.results import RunInfo, RunSamples
from aqualog.campaign.slip_slope import Limits, at_zero_slip, slip_slopes
from aqualog.campaign.spin_downs import _Part, _row, minor_spin_downs
from aqualog.core.errors import ConfigError
from aqualog.core.intervals import poisson
from aqualog.core.notation import WHEELS
from aqualog.model.programme import SEDAN, SUV
from aqualog.physics.tyre_brush import brush_force

DRY_SLOPE, V_FULL, EXPONENT = 28.0, 120.0 * KMH, 4.0


class Made:
    """A campaign in memory: `runs` as (values, speed [km/h], acceleration, how it is made)."""

    def __init__(self, runs, vehicle=SEDAN, tau=0.0, against="v_x", reason=0, events=()):
        self._samples = {}
        infos, records = [], []
        for index, (values, kmh, a) in enumerate(runs):
            rng = np.random.default_rng(index + 1)
            run = Run((Path(f"{index}.mf4"),), Path("car.toml"), None, (4.0, 9.0), values)
            about = {"slip_against": against, "events": list(events(index, kmh)) if events else []}
            infos.append(RunInfo(index, f"{index}", run, f"{index}", "done", "", vehicle, about, "lane times"))
            records.append(run)
            self._samples[index] = made(rng, kmh, a, tau, values, vehicle, reason)
        self.runs = self.done = tuple(infos)
        self.name = "made"
        self.configured = SimpleNamespace(campaign=Campaign("made", Path("c.toml"), None, tuple(records)))

    @property
    def keys(self):
        return self.configured.campaign.keys

    def samples(self, info):
        return self._samples[info.index]


def slip_of(mu, L, mu_max):
    """Slip at which the brush of a contact has a traction."""
    L, mu = np.broadcast_arrays(np.asarray(L, dtype=float), np.asarray(mu, dtype=float))
    s = np.linspace(-0.05, 0.3, 7001)
    found = np.empty(mu.shape)
    for one in np.unique(L):
        here = one == L
        found[here] = np.interp(mu[here], brush_force(s, np.ones_like(s), mu=mu_max, C_s=DRY_SLOPE, L=float(one)), s)
    return found


def chord(mu_range, L, mu_max):
    low, high = slip_of(np.array(mu_range), L, mu_max)
    return (mu_range[1] - mu_range[0]) / (high - low)


def made(rng, kmh, a, tau, values, vehicle, reason):
    t = np.arange(0.0, 12.0, 0.1)
    v = kmh * KMH + a * (t - 6.5)
    wet = (t > 4.0) & (t < 9.0)
    wet &= values.get("water_depth_mm", 1.3) > 0.0
    bin_middle = (np.floor(v / (10 * KMH)) + 0.5) * 10 * KMH  # one slope per bin, so that the truth is known
    L = np.where(wet, 1.0 - (bin_middle / V_FULL) ** EXPONENT, 1.0)
    mu = 0.03 + 0.2 * a + 0.01 * np.sin(t) + 0.001 * rng.normal(size=t.size)
    columns = {"t": t, "v_x": v, "a_x": np.full(t.size, a), "a_over_v": a / v, "reason": np.full(t.size, reason)}
    columns["delta_a_x"] = 0.1 + 0.02 * rng.normal() + np.where(wet, 0.4 + 0.02 * rng.normal(), 0.0) + 0.0 * t
    columns["delta_a_x"] = columns["delta_a_x"] + 0.03 * rng.normal(size=t.size)
    offset = 0.001 * rng.normal()
    of_traction = np.select([wet, ~wet], [slip_of(mu, L, 0.8 * vehicle.mu_max), slip_of(mu, L, vehicle.mu_max)])
    for w in WHEELS:
        driven = w in vehicle.driven
        slip = (of_traction if driven else 0.0) + offset + tau * a / v + 0.0003 * rng.normal(size=t.size)
        slip += values.get("spin", 0.0) * np.exp(-(((t - 6.5) / 0.2) ** 2))
        columns |= {f"slip_{w}": slip, f"mu_{w}": mu if driven else np.full(t.size, np.nan)}
        columns |= {f"slip_min_{w}": -0.01 + 0.0 * t, f"slip_max_{w}": 0.01 + 0.0 * t}
        columns |= {f"spin_{w}": np.zeros(t.size, bool), f"minor_{w}": np.zeros(t.size, bool)}
    on_water = np.where(wet, 1.0, 0.0)
    on_water[(np.abs(t - 4.0) < 0.3) | (np.abs(t - 9.0) < 0.3)] = np.nan
    return RunSamples(pl.DataFrame(columns), t, on_water)


def grid(values, speeds=(65, 75, 85, 95, 105), accelerations=(0.0, 0.25, 0.5, 0.75, 1.0)):
    return [(values, v, a) for v in speeds for a in accelerations]


WORN = {
    "tyre": "worn_summer", "water_depth_mm": 1.3, "water_depth_left_mm": 0.78, "pressure_front_bar": 1.9,
    "pressure_rear_bar": 1.9,
}  # fmt: skip


@pytest.fixture(scope="module")
def worn():
    return Made(grid(WORN))


def test_slopes_per_bin_are_the_ones_put_in(worn):
    table = slip_slopes(worn, plan(worn, ["tyre"]))
    rows = [r for r in table.rows if r.wheel == "rr" and np.isfinite(r.slope_ci[0]) and r.runs >= 5]
    assert len(rows) >= 5
    assert sum(r.reliable for r in rows) == 4  # near full aquaplaning the interval spans more than a factor of 3
    for row in rows:
        L = 1.0 - ((row.low_kmh + 5) * KMH / V_FULL) ** EXPONENT
        truth = chord(row.mu_range, L, 0.8 * SEDAN.mu_max)
        assert row.slope_ci[0] <= truth <= row.slope_ci[1], row
        assert truth < 0.96 * DRY_SLOPE * L**2  # a chord is no tangent
        # the dry slope's own error is one for all rows
        assert row.contact_ratio_ci[0] * 0.97 <= L <= row.contact_ratio_ci[1] * 1.03
        assert row.contact_ratio == pytest.approx(L, abs=0.04)
        low, high = at_zero_slip(row).slope_ci
        assert row.slope < low <= DRY_SLOPE * L**2 <= high
    assert [r.slope for r in rows] == sorted((r.slope for r in rows), reverse=True)
    dry = next(r for r in table.dry if r.wheel == "rr")
    half = 0.5 * (1.0 / dry.slope_ci[0] - 1.0 / dry.slope_ci[1])
    truth = chord(dry.mu_range, 1.0, SEDAN.mu_max)
    assert abs(1.0 / dry.slope - 1.0 / truth) < 1.5 * half  # one experiment: 19 of 20 are within one half
    assert half * DRY_SLOPE < 0.1


def test_a_wheel_slides_on_its_way_to_a_spin_and_back(worn):
    spun = Made(grid(WORN | {"spin": 0.3}))
    slopes = [[r.slope for r in slip_slopes(c, plan(c, ["tyre"])).rows if r.reliable] for c in (spun, worn)]
    assert slopes[0] == pytest.approx(slopes[1], rel=0.05)


def test_a_late_velocity_is_found_and_taken_off(worn):
    late = Made(grid(WORN), tau=0.1)
    (found,) = delays(late).values()
    assert found.value == pytest.approx(0.1, abs=0.004)
    assert found.ci[0] < 0.1 < found.ci[1]
    dry = next(r for r in slip_slopes(late, plan(late, ["tyre"])).dry if r.wheel == "rl")
    in_time = next(r for r in slip_slopes(worn, plan(worn, ["tyre"])).dry if r.wheel == "rl")
    assert dry.slope == pytest.approx(in_time.slope, rel=0.01)
    against_wheels = Made(grid(WORN), tau=0.1, against="free wheel")
    biased = next(r for r in slip_slopes(against_wheels, plan(against_wheels, ["tyre"])).dry if r.wheel == "rl")
    assert biased.slope < 0.75 * in_time.slope


@pytest.mark.parametrize("tau", [0.25, -0.25])
def test_a_late_velocity_is_found_where_the_acceleration_changes_its_sign(tau):
    turning = Made(grid(WORN))
    for k, samples in turning._samples.items():
        t, f = samples.t, samples.frame
        fine = np.arange(-2.0, 14.0, 1e-3)
        v = 20.0 + np.cumsum(0.9e-3 * np.sign(np.sin(2.0 * np.pi * (fine + 0.1 * k) / 6.0)))
        v = np.convolve(v, np.ones(300) / 300.0, "same")  # slips are means over 0.3 s
        now, a = np.interp(t, fine, v), np.interp(t, fine, np.gradient(v, fine))
        gained = (now - np.interp(t - tau, fine, v)) / now
        slips = [pl.Series(f"slip_{w}", f[f"slip_{w}"].to_numpy() + gained) for w in WHEELS]
        f = f.with_columns(pl.Series("v_x", now), pl.Series("a_over_v", a / now), *slips)
        turning._samples[k] = RunSamples(f, t, samples.on_water)
    (found,) = delays(turning).values()
    assert found.value == pytest.approx(tau, abs=0.003)  # a tau for the speed gained in tau would say 0.23


def test_a_wheel_that_comes_back_behind_the_lane_is_no_delay():
    behind = Made(grid(WORN), tau=0.1)
    for k, samples in behind._samples.items():
        t, f = samples.t, samples.frame
        # who speeds up floats longer, and comes back on the dry road
        back = np.where(t > 8.0, -0.2 * (k % 5) / 4 * np.exp(-np.maximum(t - 9.2, 0.0) / 0.2), 0.0)
        spun = [pl.Series(f"spin_{w}", back < -0.005) for w in ("fl", "fr")]
        slips = [pl.Series(f"slip_{w}", f[f"slip_{w}"].to_numpy() + back) for w in ("fl", "fr")]
        behind._samples[k] = RunSamples(f.with_columns(*spun, *slips), t, samples.on_water)
    (found,) = delays(behind).values()
    assert found.value == pytest.approx(0.1, abs=0.002)
    assert found.half < 0.006


def test_a_delay_that_the_driving_cannot_tell_stays_open():
    constant = Made(grid(WORN, accelerations=(0.0,)), tau=0.1)
    (found,) = delays(constant).values()
    assert not found.told
    assert "accelerations" in found.reason
    few = Made(grid(WORN, speeds=(85,), accelerations=(0.5, 1.0)))
    (found,) = delays(few).values()
    assert "2 runs" in found.reason


def test_on_all_wheel_drive_the_delay_comes_with_the_slope():
    awd = Made(grid(WORN), vehicle=SUV, tau=0.1)
    (found,) = delays(awd).values()
    assert found.told, found.reason
    assert found.ci[0] < 0.1 < found.ci[1]


def test_too_little_is_said_in_words():
    def row(made_campaign):
        found = [r for r in slip_slopes(made_campaign, plan(made_campaign, ["tyre"])).rows if r.wheel == "rr"]
        return max(found, key=lambda r: r.samples)

    two = row(Made([(WORN, 85, 0.5), (WORN, 85, 0.0)]))
    assert np.isfinite(two.slope)
    assert not two.reliable
    assert not np.isfinite(two.slope_ci).any()
    assert "2 runs" in two.reason
    data = Made([(WORN, 85, 0.0)] * 6)
    (even,) = (r for r in slip_slopes(data, plan(data, ["tyre"]), limits=Limits(mu_range=0.05)).rows if r.wheel == "rr")
    assert not even.told
    assert "traction varies" in even.reason


def test_cells_count_what_is_left_out():
    braking = Made(grid(WORN)[:3], reason=1)
    table = slip_slopes(braking, plan(braking, ["tyre"]))
    assert not table.rows
    assert table.left_out[REASONS[1]] > 0


def test_sides_and_unknown_values_have_groups_of_their_own():
    bare = {k: v for k, v in WORN.items() if k != "tyre"}
    mixed = Made([*grid(WORN), *grid(bare)])
    table = slip_slopes(mixed, plan(mixed, ["tyre", "side"]))
    assert {r.wheel for r in table.rows} == {"left", "right"}
    assert {r.group for r in table.rows} == {(("tyre", "worn_summer"),), (("tyre", None),)}
    assert next(r for r in table.rows if r.group == (("tyre", None),)).expected.reason


def test_plan_refuses_what_makes_no_sense(worn):
    campaign = worn.configured.campaign
    with pytest.raises(ConfigError, match="no run has this key"):
        check_plan(campaign, ["tire"])
    with pytest.raises(ConfigError, match="road"):
        check_plan(campaign, [], road="damp")
    with pytest.raises(ConfigError, match="bin width"):
        check_plan(campaign, [], width_kmh=0.0)
    assert check_plan(campaign, ["water-depth", "side"]).keys == ("water_depth_mm",)
    assert check_plan(campaign, []).keys == ()


def test_without_keys_runs_that_differ_are_not_pooled():
    def keys(*more):
        values = [{"wear": w, **dict.fromkeys(more, w), "water_depth_mm": d} for w in "ab" for d in (0.0, 1.3)]
        runs = tuple(Run((Path("a.mf4"),), Path("car.toml"), None, None, v) for v in values)
        return check_plan(Campaign("c", Path("c.toml"), None, runs), []).keys

    assert keys() == ("wear", "water_depth_mm")
    assert keys("tyre") == ("tyre", "water_depth_mm")  # the wear follows the tyre


def test_resistance_is_less_each_runs_own_dry_level(worn):
    rows = [r for r in resistances(worn, plan(worn, ["tyre"])).rows if r.runs >= 5]
    assert rows
    for row in rows:
        assert row.ci[0] < row.value < row.ci[1]
        assert row.value == pytest.approx(0.4, abs=0.04)
    assert sum(r.ci[0] <= 0.4 <= r.ci[1] for r in rows) >= len(rows) - 1
    as_measured = [r for r in resistances(worn, plan(worn, ["tyre"]), relative=False).rows if r.runs >= 5]
    assert np.mean([r.value for r in as_measured]) == pytest.approx(0.5, abs=0.03)


def test_full_speed_from_slopes(worn):
    cells = plan(worn, ["tyre", "water-depth"])  # dry driving has no depth, and is the reference all the same
    found = [f for f in full_speeds(worn, cells, slip_slopes(worn, cells)) if f.way == "slip_slope"]
    for f in found:
        assert f.v == pytest.approx(V_FULL, rel=0.05)
        assert f.ci[0] <= V_FULL <= f.ci[1]
    assert len(found) == 2


def test_contact_fit_and_half_are_exact_without_noise():
    v = np.array([60, 70, 80, 90, 100]) * KMH
    L = 1.0 - (v / (115 * KMH)) ** 5.0
    v_full, n = fit_contact(v, L[None], np.full(5, 0.02))
    assert v_full[0] / KMH == pytest.approx(115.0, abs=0.5)
    assert n[0] == 5.0
    speeds = np.array([80, 85, 90, 95, 105, 110, 115, 120]) * KMH
    assert fit_half(speeds, speeds > 100 * KMH, np.ones((1, 8)))[0] / KMH == pytest.approx(100.0, abs=1.0)
    assert np.isnan(fit_half(speeds, speeds > 200 * KMH, np.ones((1, 8)))[0])


def spins(detector, wheel, from_kmh):
    def events(index, kmh):
        return [{"detector": detector, "wheel": wheel, "start_s": 4.03, "end_s": 6.0}] if kmh >= from_kmh else []

    return events


def test_minor_spin_downs_over_speed_and_the_speed_they_tell():
    data = Made(grid(WORN), events=spins("minor_spin_down", "fr", 90))
    rows = minor_spin_downs(data, plan(data, ["tyre"]))
    of = {r.low_kmh: r for r in rows if r.wheel == "fr"}
    assert (of[70.0].events, of[90.0].events) == (0, 5)
    # some are slower than 100 km/h by the end of the lane
    assert (of[90.0].passes, of[90.0].share) == (9, pytest.approx(5 / 9))
    assert of[90.0].share_ci[0] < 5 / 9 < of[90.0].share_ci[1]
    assert of[90.0].per_s == pytest.approx(5 / of[90.0].seconds)
    assert of[90.0].per_100_m == pytest.approx(5 / (of[90.0].seconds * 95 * KMH) * 100, rel=0.05)
    cells = plan(data, ["tyre"])
    found = {f.way: f for f in full_speeds(data, cells, slip_slopes(data, cells))}
    assert found["minor_spin_down"].v / KMH == pytest.approx(110.0, abs=2.0)
    assert "no pass" in found["spin_down"].reason
    assert found["spin_down"].ci[1] == np.inf
    deep_first = Made([*grid(WORN | {"water_depth_mm": 11.0}), *grid(WORN)])
    cells = plan(deep_first, ["water-depth"])
    found = [f.group[0][1] for f in full_speeds(deep_first, cells, slip_slopes(deep_first, cells))]
    assert found == [1.3] * 5 + [11.0] * 5


def test_events_that_come_together_in_a_pass_are_worth_fewer():
    def row(counts):
        return _row(((), "fl", 9), [_Part(2.0, 60.0, n, False, -0.05) for n in counts], 10.0)

    even, clumped, alone = row([3] * 6), row([0, 0, 18, 0, 0, 0]), row([18])
    assert even.per_s_ci == pytest.approx(np.array(poisson(18)) / 12.0)
    assert alone.per_s_ci == pytest.approx(np.array(poisson(18)) / 2.0)
    assert clumped.per_s_ci[0] < 0.1
    assert clumped.per_s_ci[1] > 2.0 * even.per_s_ci[1]


def test_a_pass_that_sweeps_the_speed_counts_where_its_wheel_stops():
    data = Made(grid(WORN), events=spins("spin_down", "fr", 0))
    for kmh, info in zip(np.resize([70.0, 80.0, 85.0, 110.0, 111.0], len(data.done)), data.done, strict=True):
        s = data._samples[info.index]
        inside = np.clip((s.t - s.t[s.on_water == 1.0][0]) / np.ptp(s.t[s.on_water == 1.0]), 0.0, 1.0)
        v = (50.0 + (kmh - 50.0) * inside) * KMH
        slip = np.where((v > 107.9 * KMH) & (s.on_water == 1.0), -0.9, 0.0)
        data._samples[info.index] = RunSamples(s.frame.with_columns(v_x=v, slip_min_fr=slip), s.t, s.on_water)
    cells = plan(data, ["tyre"])
    (found,) = (f for f in full_speeds(data, cells, slip_slopes(data, cells)) if f.way == "spin_down")
    assert 107.0 < found.v / KMH < 109.0
    rows = [r for r in minor_spin_downs(data, cells) if r.wheel == "fr"]
    assert {r.low_kmh: r.full for r in rows if r.full} == {100.0: sum(r.full for r in rows)}
    assert {r.low_kmh for r in rows} >= {50.0, 60.0, 70.0, 80.0}


def test_a_short_dip_is_no_full_spin_down():
    data = Made(grid(WORN), events=spins("spin_down", "fr", 90))
    assert sum(r.full for r in minor_spin_downs(data, plan(data, ["tyre"]))) == 0
    for info in data.done:
        samples = data._samples[info.index]
        deep = samples.frame.with_columns(pl.when(pl.col("t") > 5).then(-0.9).otherwise(0.0).alias("slip_min_fr"))
        data._samples[info.index] = RunSamples(deep, samples.t, samples.on_water)
    cells = plan(data, ["tyre"])
    assert sum(r.full for r in minor_spin_downs(data, cells)) == 10
    found = {f.way: f for f in full_speeds(data, cells, slip_slopes(data, cells))}
    assert found["spin_down"].v / KMH == pytest.approx(90.0, abs=2.0)


def test_traction_during_spin_ups():
    """Told by slip: the detector, which takes those below a traction of 0.07 only, may have found none."""
    data = Made(grid(WORN), events=spins("spin_up", "rr", 60))
    for info in data.done:
        samples = data._samples[info.index]
        spun = pl.when((pl.col("t") > 5) & (pl.col("t") < 6) & (pl.col("v_x") > 90 * KMH))
        frame = samples.frame.with_columns(spun.then(0.15).otherwise(pl.col("slip_min_rl")).alias("slip_min_rl"))
        data._samples[info.index] = RunSamples(frame, samples.t, samples.on_water)
    rows = spin_ups(data, plan(data, ["tyre"]))
    assert {r.place for r in rows} == {"rl"}
    assert min(r.low_kmh for r in rows) >= 80.0
    told = [r for r in rows if r.reliable]
    assert told
    for r in told:
        assert r.ci[0] < r.value < r.ci[1]
        assert 0.0 < r.value < 0.3


def test_expectation_is_that_of_the_simulator():
    """Against the truth of a simulated pass on even water: contact and speed of full aquaplaning of each wheel."""
    from aqualog.model.programme import thesis
    from aqualog.model.simulate import simulate

    run = next(r for r in thesis() if r.name == "rwd_worn_summer_low_1.3mm_080kmh_const_1")
    truth = simulate(run.scenario).truth.columns
    info = Made([(WORN, 80, 0.0)]).done[0]
    on = np.flatnonzero(truth["on_water"] > 0.5)
    on = on[on.size // 4 : -on.size // 4]
    for wheel in ("fl", "fr", "rl", "rr"):
        v_full = np.nanmedian(truth[f"true_full_speed_{wheel}"][on])
        if wheel[0] == "f":  # a rear wheel's is at a higher speed another one: its front wheel leaves more water
            assert expected(info, wheel, 0.94 * v_full).contact > 0.0 == expected(info, wheel, 1.06 * v_full).contact
        L = np.median(truth[f"true_contact_{wheel}"][on])
        assert expected(info, wheel, float(np.mean(truth["true_v_x"][on]))).contact == pytest.approx(L, abs=0.05)
    dry = expected(info, "rr", 25.0, wet=False)
    assert dry.slope == pytest.approx(SEDAN.slip_slope_r)
    curved = expected(info, "rr", 25.0, wet=False, mu_range=(0.03, 0.26))
    assert 0.85 * dry.slope < curved.slope < 0.95 * dry.slope
