"""The distance without wheel torque: it is given near full aquaplaning alone, with a wider interval; a hill is no water."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.detect.detector import Scene
from aqualog.detect.margin import watch
from aqualog.detect.margin.inputs import Reader
from aqualog.detect.margin.watch import FEATURES, MARGIN
from aqualog.detect.stream import DriveStream, detect_drive
from aqualog.features.stream import FeatureStream
from aqualog.model.drawing import SCORING_POOL
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import draw
from aqualog.physics.load import G
from aqualog.report.drive.judged import headline
from tests.drives import AWD, CAR, FWD, drive, lane
from tests.margin.learn import DRIVETRAINS
from tests.margin.passes import own_pass
from tests.margin.study import outcome

KMH = 3.6
TORQUES = tuple(f"torque_{w}" for w in WHEELS)


def without_torque(p):
    return replace(p, columns={s: x for s, x in p.columns.items() if s not in TORQUES})


@pytest.fixture(scope="module")
def wet():
    """The car of `CAR` in the water of a lane, 104 km/h."""
    columns = drive(CAR, duration_s=14.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),), drop=TORQUES)[0]
    return detect_drive(columns, CAR)


def test_it_warns_near_full_aquaplaning_with_a_wider_interval():
    wider = []
    for drivetrain in DRIVETRAINS:
        passes = [own_pass(1_745_000 + k, drivetrain, distance=(-2.0 / KMH, 8.0 / KMH)) for k in range(6)]
        known, alone = (np.array([outcome(p) for p in some]) for some in (passes, map(without_torque, passes)))
        true, median, low, high, *_, warned, early = alone.T
        given = np.isfinite(median)
        assert warned.sum() >= 5
        assert not early.any()
        assert given.sum() >= 4
        assert ((low <= true) & (true <= high))[given].sum() >= given.sum() - 1
        wider.extend((high - low)[given] / (known[:, 3] - known[:, 2])[given])
    assert np.median(wider) > 1.05


def test_a_distance_is_given_in_a_warning_alone(wet):
    assert {u.detector: u.missing for u in wet.limited}["margin"] == ("torque_rl", "torque_rr")
    blind = DriveStream(
        CAR, 10_000_000, [*(f"omega_{w}" for w in WHEELS), "v_x", "a_x", "torque_rl"], detectors=[MARGIN]
    )
    assert blind.limited[0].missing == ("torque_rr", "brake_pressure")
    assert DriveStream(CAR, 10_000_000, [f"omega_{w}" for w in WHEELS], detectors=[MARGIN]).unavailable[0].missing == (
        "a_x",
    )
    track = next(t for t in wet.tracks if t.detector == "margin")
    assert track.threshold == pytest.approx(0.5)  # of a quarter with torque
    assert track.active.mean() > 0.2
    for name in (*FEATURES, "water_probability"):
        given = np.isfinite(wet.features[name].fill_null(np.nan).to_numpy())
        assert (given == track.active).all(), name


def test_the_headline_of_a_drive_that_cannot_be_judged_has_the_warning(wet):
    words = headline(wet.judgement, margin=wet.margin)
    assert words.startswith("Aquaplaning cannot be judged: no wheel torque, but a warning from ")
    assert f"{wet.margin.warned_s:.1f} s on: at the least " in words
    unfit = replace(wet.judgement, missing=("wheel torque that fits mass and acceleration",))
    assert headline(unfit, margin=wet.margin) == f"Aquaplaning cannot be judged: no {unfit.missing[0]}"


def on_a_hill(car, seconds=70.0, dt=0.02):
    """A dry road, 7 % uphill from 40 to 60 s, of which no signal has the grade: driven wheels slip by their force."""
    t = np.arange(0.0, seconds, dt)
    v, rng = 25.0 + 0.3 * np.sin(0.3 * t), np.random.default_rng(4)
    force = 0.09 * np.cos(0.3 * t) / G + 0.02 + 0.07 * ((t > 40.0) & (t < 60.0))  # over the weight
    slip = 2.0 * force / car.slip_slope_f  # half of the load is on the driven axle
    columns = {"v_x": v, "yaw_rate": 0.0 * v, "a_y": 0.0 * v}
    for w in WHEELS:
        noise = 0.01 * rng.standard_normal(t.size)
        columns[f"omega_{w}"] = (v * (1.0 + slip * (w in car.driven)) + noise) / car.r_e(w)
    return columns, dt


def warned(columns, dt, car):
    piece = DriveStream(car, round(dt * 1e9), columns, detectors=[MARGIN]).push(columns)
    return bool(piece.tracks[0].active.any())


@pytest.mark.parametrize("car", [CAR, FWD], ids=["rwd", "fwd"])
def test_a_hill_that_no_signal_knows_is_no_water(car, monkeypatch):
    columns, dt = on_a_hill(car)
    columns["a_x"] = np.gradient(columns["v_x"], dt)  # as some buses have it: without the grade
    assert not warned(columns, dt, car)
    monkeypatch.setattr(watch, "GRADE", 0.0)
    assert warned(columns, dt, car)


def test_an_accelerometer_knows_the_hill():
    columns, dt = on_a_hill(CAR)
    t, traction = np.arange(columns["v_x"].size) * dt, []
    flat = {"a_x": np.gradient(columns["v_x"], dt)}
    for known in (flat, {"a_x": 0.09 * np.cos(0.3 * t) + 0.07 * G * ((t > 40.0) & (t < 60.0))}):
        own = columns | known
        f = FeatureStream(CAR, dt, own).push(own)
        u = Reader(CAR, dt).push(Scene(f, dict.fromkeys(WHEELS, np.zeros(t.size, bool)), own)).u_rl
        traction.append(u[(t > 45.0) & (t < 55.0)].mean() - u[(t > 25.0) & (t < 35.0)].mean())
    assert traction == pytest.approx([0.0, 2.0 * 0.07], abs=0.01)


@pytest.mark.parametrize("seed", [1_100_001, 1_100_003])
def test_torques_that_change_in_turn_shake_the_wheels_on_a_dry_road(seed):
    d = draw("torque_vectoring", seed, SCORING_POOL)
    signals = as_signals(simulate(d.scenario, d.model), vehicle=d.believed)
    columns = {s: signals.array(s) for s in signals.symbols if not s.startswith("true_") and s not in TORQUES}
    columns = {s: x for s, x in columns.items() if np.isfinite(x).any()}
    assert not warned(columns, signals.dt_ns * 1e-9, d.believed)


def test_what_an_unknown_grade_makes_of_the_slip():
    """All wheels of a car with a driven wheel each carry it alike, by their loads: little is left."""
    rear, front, both = (watch.params(car, 0.1, balanced=False).grade for car in (CAR, FWD, AWD))
    assert rear == pytest.approx(watch.GRADE * CAR.wheelbase / CAR.l_f / CAR.slip_slope_r)
    assert front == pytest.approx(watch.GRADE * FWD.wheelbase / FWD.l_r / FWD.slip_slope_f)
    assert both < 0.3 * min(rear, front)
    assert watch.params(CAR, 0.1).grade == 0.0


@pytest.mark.parametrize(("brakes", "counts"), [((), False), (("brake_pressure",), True)])
def test_a_car_that_slows_down_may_brake_where_no_signal_knows_it(brakes, counts):
    t = np.arange(800) * 0.01
    v, one = 30.0 - 0.6 * np.maximum(t - 4.0, 0.0), np.ones(t.size)
    columns = {"v_x": v, "a_x": -0.6 * (t > 4.0), "a_y": 0.0 * one, "yaw_rate": 0.0 * one}
    columns |= {f"omega_{w}": v / CAR.r_e(w) + 1e-6 * t for w in WHEELS} | dict.fromkeys(brakes, 0.0 * one)
    f = FeatureStream(CAR, 0.01, columns).push(columns)
    seen = Reader(CAR, 0.01).push(Scene(f, dict.fromkeys(WHEELS, one < 0.0), columns))
    assert np.isnan(seen.R).all()
    assert np.isfinite(seen.D_l[(t > 1.0) & (t < 3.9)]).all()
    assert np.isfinite(seen.D_l[t > 5.0]).any() == counts


def test_a_wheel_that_loses_half_of_its_speed_is_no_light_braking():
    t = np.arange(800) * 0.01
    v, one = 30.0 - 0.6 * np.maximum(t - 4.0, 0.0), np.ones(t.size)
    columns = {"v_x": v, "a_x": -0.6 * (t > 4.0), "a_y": 0.0 * one, "yaw_rate": 0.0 * one}
    turns = {w: 1.0 - 0.6 * (t > 4.5) * (w == "fr") for w in WHEELS}
    columns |= {f"omega_{w}": v * turns[w] / CAR.r_e(w) + 1e-6 * t for w in WHEELS}
    f = FeatureStream(CAR, 0.01, columns).push(columns)
    seen = Reader(CAR, 0.01).push(Scene(f, dict.fromkeys(WHEELS, one < 0.0), columns))
    assert np.isnan(seen.D_r[(t > 4.2) & (t < 4.4)]).all()
    assert np.isfinite(seen.D_r[t > 5.0]).all()


@pytest.mark.parametrize("car", [CAR, FWD, AWD], ids=DRIVETRAINS)
def test_traction_by_acceleration_is_that_by_torque_on_a_dry_road(car):
    speed = ((0.0, 70.0), (4.0, 70.0), (12.0, 90.0), (16.0, 90.0))
    columns = drive(car, duration_s=16.0, lanes=(), speed_kmh=speed)[0]
    columns = {s: columns.array(s) for s in columns.symbols}
    seen = []
    for drop in ((), TORQUES):
        own = {s: x for s, x in columns.items() if s not in drop}
        f = FeatureStream(car, 0.01, own).push(own)
        seen.append(Reader(car, 0.01).push(Scene(f, dict.fromkeys(WHEELS, np.zeros(1600, bool)), own)))
    for name in ("u_fl", "u_rr"):
        by_torque, by_car = (getattr(x, name)[200:].mean() for x in seen)
        assert by_car == pytest.approx(by_torque, abs=0.005)
    assert max(seen[1].u_fl[600:1100].mean(), seen[1].u_rl[600:1100].mean()) > 0.05


def test_torque_of_one_wheel_alone_is_as_none(wet):
    columns = {s: wet.signals.array(s) for s in wet.signals.symbols}
    one = columns | {"torque_rl": np.full(wet.signals.frame.height, 200.0)}
    found = [
        DriveStream(CAR, wet.signals.dt_ns, x, detectors=[MARGIN]).push(x).tracks[0].active for x in (columns, one)
    ]
    assert found[0].any()
    assert np.array_equal(*found)


@pytest.mark.parametrize(("slows", "counts"), [(True, True), (False, False)])
def test_a_wheel_that_reads_zero_has_stopped_if_it_slowed_down_before(slows, counts):
    """A sensor that dies reads 0 at once."""
    t = np.arange(900) * 0.01
    v, one = 30.0 + 1e-4 * np.sin(t), np.ones(t.size)
    front = np.clip(1.0 - (t - 5.0) / 0.3, 0.0, 1.0) if slows else 1.0 * (t < 5.0)
    front = np.where(front < 0.03, 0.0, front)
    columns = {"v_x": v, "a_x": 0.0 * one, "a_y": 0.0 * one, "yaw_rate": 0.0 * one, "brake_pressure": 0.0 * one}
    columns |= {f"omega_{w}": v * (front if w in ("fl", "fr") else one) / CAR.r_e(w) for w in WHEELS}
    reader, stream, seen = Reader(CAR, 0.01), FeatureStream(CAR, 0.01, columns), []
    for at in (slice(0, 520), slice(520, 700), slice(700, 900)):
        piece = {s: x[at] for s, x in columns.items()}
        f = stream.push(piece)
        seen.append(reader.push(Scene(f, dict.fromkeys(WHEELS, one[at] < 0.0), piece)).D_l)
    slip = np.concatenate(seen)
    assert np.isfinite(slip[t > 6.0]).all() == counts
    if counts:
        assert slip[t > 6.0] == pytest.approx(-1.0, abs=0.01)
    else:
        assert np.isnan(slip[t > 6.0]).all()


def test_pieces_are_the_whole(wet):
    columns = {s: wet.signals.array(s) for s in wet.signals.symbols}
    whole = DriveStream(CAR, wet.signals.dt_ns, columns, detectors=[MARGIN]).push(columns)
    stream, parts = DriveStream(CAR, wet.signals.dt_ns, columns, detectors=[MARGIN]), []
    for at in range(0, 1400, 173):
        parts.append(stream.push({s: x[at : at + 173] for s, x in columns.items()}))
    for name in FEATURES:
        assert np.array_equal(whole.features[name], np.concatenate([p.features[name] for p in parts]), equal_nan=True)
