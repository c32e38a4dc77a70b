"""Drives of the simulator held against its own simulation: valid where nothing differs, and where it is not."""

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import SignalError
from aqualog.model.log import as_signals
from aqualog.model.programme import SEDAN
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import simulate
from aqualog.model.term import Model
from aqualog.validate import spread
from aqualog.validate.boundary import Tolerance
from aqualog.validate.records import PLOTS, SIGNALS, Plan, Plot, Trace
from aqualog.validate.run import _limit, _pieces, validate

SPEED = ((0.0, 18.0), (10.0, 18.0), (25.0, 32.0), (35.0, 32.0), (50.0, 20.0), (60.0, 20.0))
CAR = replace(SEDAN, given=frozenset({"drivetrain", "mass"}))


def drive(seed=1, *, car=CAR, **given):
    scenario = Scenario(car, duration_s=60.0, seed=seed, speed=SPEED, **given)
    return as_signals(simulate(scenario))


def judged(*drives, plan=Plan(), model=Model()):  # noqa: B008 - frozen
    return validate([(f"d{i}", d) for i, d in enumerate(drives)], CAR, model=model, plan=plan)


@pytest.fixture(scope="module")
def sound():
    return judged(drive())


def test_a_car_that_is_that_of_the_file_is_valid(sound):
    assert sound.share > 0.99
    assert [x.is_valid for x in sound.limits] == [True]
    assert (
        sound.notes[-1] == "a_y and yaw_rate are judged with an assumed cornering stiffness: no key of the file sets it"
    )
    assert {j.plot.y for j in sound.judged} > {"a_x", "slip_fl", "slip_rr"}
    assert all(j.share == 1.0 for j in sound.judged if j.plot.x != "t")
    (a_x,) = (r for r in sound.rated if r.signal == "a_x")
    assert 0.85 < a_x.total <= 1.0
    assert a_x.delay_s == pytest.approx(0.0, abs=0.1)


def test_a_heavier_car_is_beyond_the_boundary_of_a_x_where_it_accelerates():
    heavy = judged(drive(load_rear=600.0))
    assert heavy.share < 0.8
    assert heavy.worst.signal == "a_x"
    assert heavy.worst.by < -0.05  # less acceleration than simulated
    assert 10.0 < heavy.worst.start_s < heavy.worst.end_s < 26.5
    by_name = {j.plot.name: j for j in heavy.judged}
    assert by_name["a_x over torque"].share < 1.0
    assert by_name["slip_fl over t"].share == 1.0


def test_what_the_model_knows_is_no_fault():
    from aqualog.model.effects import EFFECTS
    from aqualog.model.term import Term

    loaded = drive(load_rear=600.0)
    known = Model((Term(EFFECTS["payload_mass"], {"delta_mass": 600.0}),))
    assert judged(loaded, model=known).share > judged(loaded).share + 0.1


def test_on_water_above_a_speed(sound):
    # the log's depth is a third of what the wheels ran through
    deep = drive(lanes=(Lane(14.0, 34.0, depth_left=2.0e-3, depth_right=2.0e-3),))
    columns = {n: deep.frame[n] * 0.33 for n in ("water_depth_left", "water_depth_right")}
    wrong = replace(deep, frame=deep.frame.with_columns(**columns))
    by_name = {x.condition: x for x in judged(wrong).limits}
    assert by_name["dry"].is_valid
    assert not by_name["on water"].is_valid
    assert by_name["on water"].seconds > 10.0


def test_the_speed_of_the_limit():
    v = np.arange(100.0) / 2.0
    bad = v >= 40.0
    found = _limit("on water", v, bad, 0.95, 0.5)
    assert found.above == 40.0
    assert found.share == 0.0
    assert (found.low, found.high, found.seconds) == (0.0, 49.5, 50.0)
    assert _limit("dry", v, v == 49.0, 0.95, 0.5).is_valid  # one block is less than two seconds
    early = _limit("dry", v, v >= 5.0, 0.95, 0.5)  # below is no range of its own: the share is that of all
    assert (early.above, early.share) == (0.0, pytest.approx(0.1))
    # but a drive of which less than the agreed share is within is not called valid, however short
    short = _limit("dry", v[:20], v[:20] >= 9.0, 0.95, 0.1)
    assert (short.above, short.share) == (9.0, 0.0)


def test_the_worst_is_a_stretch_not_a_spike():
    n = 400
    t = 0.1 * np.arange(n)
    measured = np.zeros(n)
    measured[20] = 0.9
    measured[100:140] = 0.5
    measured[142:150] = -0.4
    found = judged_trace(Trace("d", 0.1, 40.0, {"a_x": measured}, {"a_x": np.zeros(n)}, {"t": t, "v_x": t},
                               np.ones(n, bool), np.zeros(n, bool)))  # fmt: skip
    assert found.start_s == pytest.approx(10.0)
    assert found.end_s == pytest.approx(15.0)  # 0.2 s within parts no stretch
    assert found.by == pytest.approx(0.5 - 0.1)


def judged_trace(trace):
    from aqualog.validate.run import _off, _over_time

    plot = Plot("a_x", "t", Tolerance(0.0, 0.0, 0.1, 0.0))
    return _over_time(plot, [trace], [_off(trace, plot)]).worst


def spread_of(traces, signal):
    found = spread.spread_of(traces, signal)
    return found.y_offset if found else math.nan


def repeated(offsets, noise):
    n = 500
    rng = np.random.default_rng(2)
    v = np.full(n, 20.0)
    return [
        Trace(f"d{i}", 0.1, 50.0, {"a_x": o + noise * rng.standard_normal(n)}, {"a_x": np.zeros(n)},
              {"t": 0.1 * np.arange(n), "v_x": v}, np.ones(n, bool), np.zeros(n, bool))
        for i, o in enumerate(offsets)
    ]  # fmt: skip


WIDE = 1.976 * 2.576 / 1.96  # of the noise of one signal alone


def test_spread_of_repetitions():
    # means 0, 0.1, 0.2: standard deviation 0.1, and t(0.975, 2) = 4.303; an error that all share is not in it
    assert spread_of(repeated((0.0, 0.1, 0.2), 0.0), "a_x") == pytest.approx(4.303 * 0.1, rel=1e-3)
    assert spread_of(repeated((5.0, 5.1, 5.2), 0.0), "a_x") == pytest.approx(4.303 * 0.1, rel=1e-3)
    own = spread.spread_of(repeated((0.0, 0.1, 0.2), 0.0), "a_x")
    assert own[1:] == (3, pytest.approx(4.303, rel=1e-3), pytest.approx(0.1), 0.0)
    assert math.isnan(spread_of(repeated((0.0, 0.1), 0.0), "a_x"))
    assert math.isnan(spread_of(repeated((0.0, 0.1, 0.2), 0.0), "a_y"))
    elsewhere = [
        replace(t, over={**t.over, "v_x": np.full(500, 20.0 + 5.0 * i)}) for i, t in enumerate(repeated((0, 1, 2), 0))
    ]
    assert math.isnan(spread_of(elsewhere, "a_x"))


def test_student_counts_for_what_three_drives_know():
    """The noise is known from thousands of blocks. One of seven signals has a wider one: all must be within at once."""
    # 99 % of the normal distribution are within 2.576
    assert spread_of(repeated((0.0, 0.0, 0.0), 0.05), "a_x") == pytest.approx(WIDE * 0.05, rel=0.05)  # dof 147
    # variances 0.01 and 0.069: dof = 0.079² / (0.01²/2 + 0.069²/147) = 76, t = 1.99
    mixed = repeated((0.0, 0.1, 0.2), 0.2)
    assert spread_of(mixed, "a_x") == pytest.approx(1.99 * math.hypot(0.1, 0.2 * 2.576 / 1.96), rel=0.05)
    many = [replace(t, measured=dict.fromkeys("abcdef", t.measured["a_x"]) | t.measured) for t in mixed]
    # 1 - 0.005/7 of the normal distribution is at 3.19; more dof change nothing
    assert spread_of(many, "a_x") == pytest.approx(1.98 * math.hypot(0.1, 0.2 * 3.19 / 1.96), rel=0.05)


def test_neighbours_of_a_slow_signal_do_not_hide_its_noise():
    slow = [
        replace(t, measured={"a_x": np.repeat(t.measured["a_x"][::10], 10)}) for t in repeated((0.0, 0.0, 0.0), 0.05)
    ]
    assert spread_of(slow, "a_x") == pytest.approx(WIDE * 0.05, rel=0.15)


@pytest.mark.parametrize(
    "wrong", [lambda a: 0.2 * a, lambda a: np.interp(np.arange(500) - 5, np.arange(500), a) - a, lambda a: -0.7 * a]
)
def test_an_error_that_all_drives_share_is_no_noise(wrong):
    """A gain, a delay of half a second, a stiffness: what the simulated signal explains must not widen its boundary."""
    moves = 2.0 * np.sin(2.0 * np.pi * np.arange(500) / 37.0) + np.sin(2.0 * np.pi * np.arange(500) / 17.0)
    made = [
        replace(t, measured={"a_x": t.measured["a_x"] + moves + wrong(moves)}, simulated={"a_x": moves})
        for t in repeated((0.0, 0.0, 0.0), 0.05)
    ]
    assert spread_of(made, "a_x") == pytest.approx(WIDE * 0.05, rel=0.06)


def test_a_drive_of_which_nothing_can_be_judged_is_an_error():
    log = drive()
    spun = replace(log, frame=log.frame.with_columns(pl.col("yaw_rate") * 57.3 + 20.0))
    with pytest.raises(SignalError, match=r"none of 60 s can be judged: v_x times yaw_rate is .* units wrong"):
        judged(spun)
    fast = replace(log, frame=log.frame.with_columns(pl.col("v_x") * 3.6))
    with pytest.raises(SignalError, match=r"v_x and the wheel speeds give a radius of 1\.1"):
        judged(fast)


def test_three_drives_on_other_roads_are_no_repetitions():
    """They share cells of speed, and what differs between their roads would widen every boundary."""
    rng = np.random.default_rng(5)
    wander = [20.0 + np.cumsum(rng.standard_normal(500)) * 0.5 for _ in range(3)]
    made = repeated((0.0, 0.3, 0.6), 0.0)
    others = [replace(t, over={**t.over, "v_x": v}) for t, v in zip(made, wander, strict=True)]
    assert math.isnan(spread_of(others, "a_x"))
    late = [replace(t, over={**t.over, "v_x": np.roll(wander[0], 30 * i)}) for i, t in enumerate(made)]
    assert spread_of(late, "a_x") > 0.0
    longer = [*made[:2], replace(made[2], over={k: np.resize(x, 700) for k, x in made[2].over.items()})]
    assert math.isnan(spread_of(longer, "a_x"))


def test_repeated_drives_give_the_tolerance_unless_the_user_does():
    drives = [drive(seed) for seed in (1, 2, 3)]
    found = judged(*drives)
    assert 0.01 < found.spread["a_x"].y_offset < 0.3
    (a_x,) = (j for j in found.judged if j.plot.name == "a_x over t")
    assert a_x.plot.tolerance.y_offset == found.spread["a_x"].y_offset
    assert a_x.share > 0.99
    assert found.spread["slip_fl"].y_offset < 0.08
    assert all(j.share > 0.98 for j in found.judged if j.plot.x == "t")
    # a file without [tie_rod] says nothing of their forces
    assert sum("tie-rod forces are left out" in n for n in found.notes) == 3
    own = Plot("a_x", "t", Tolerance(0.1, 0.0, 0.5, 0.0))
    given = judged(*drives, plan=Plan((own, *PLOTS[1:]), given=frozenset({"a_x"})))
    assert "a_x" not in given.spread
    assert given.plan.plots[0] == own


def test_the_measured_curve_says_what_is_rated():
    """Not the simulation, whose errors widen the boundaries of three drives, nor a file of boundaries."""
    from aqualog.model.effects import EFFECTS
    from aqualog.model.term import Term

    drives = [drive(seed) for seed in (1, 2, 3)]
    wide = Plan(
        tuple(replace(p, tolerance=Tolerance(0.1, 0.0, 9.0)) for p in PLOTS if p.x == "t"), given=frozenset(SIGNALS)
    )
    light = Model((Term(EFFECTS["payload_mass"], {"delta_mass": -400.0}),))
    every = [judged(*drives), judged(*drives, plan=wide), judged(*drives, model=light)]
    assert len({tuple((r.signal, r.seconds) for r in x.rated) for x in every}) == 1
    assert every[0].rated


def test_long_stretches_are_rated_in_parts():
    assert _pieces(np.array([0, 100, 200, 1500]), 600) == [(0, 100), (200, 633), (633, 1067), (1067, 1500)]


def test_nothing_to_compare():
    bare = drive()
    with pytest.raises(SignalError):
        judged(replace(bare, frame=bare.frame.select("t", "v_x", "yaw_rate")))
