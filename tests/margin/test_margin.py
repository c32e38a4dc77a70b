"""The distance to full aquaplaning: it falls with speed, warns before it, and stays silent on dry roads."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.detect.detector import Scene
from aqualog.detect.margin import recursion
from aqualog.detect.margin.emissions import emissions_of
from aqualog.detect.margin.inputs import Reader
from aqualog.detect.margin.recursion import scan
from aqualog.detect.margin.state import NODES, TAIL, Filter, FilterParams, Inputs
from aqualog.detect.margin.watch import params
from aqualog.detect.stream import detect_drive
from aqualog.features.stream import FeatureStream
from aqualog.model.drawing import SCORING_POOL
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import draw
from aqualog.model.tyre import TYRES
from aqualog.physics.tyre_brush import brush_force
from aqualog.report.drive.document import document
from aqualog.report.drive.panels import drive_rows
from aqualog.report.drive.report import drive_report
from tests.drives import CAR, FWD, drive, lane
from tests.margin.learn import DRIVETRAINS, inputs_of, other_drive, windows
from tests.margin.passes import LAWS, any_tyre, own_full, own_pass
from tests.margin.study import outcome

KMH = 3.6
CHI2_95 = 11.07  # of five features


@pytest.fixture(scope="module")
def wet():
    columns = drive(CAR, duration_s=14.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),))[0]
    return detect_drive(columns, CAR)


@pytest.mark.parametrize("drivetrain", DRIVETRAINS)
def test_emissions_are_a_law(drivetrain):
    """Towards full aquaplaning contact falls, resistance grows and wheels shake; scatters are covariances."""
    t = emissions_of(drivetrain)
    assert (np.diff(t.contact) >= 0.0).all()
    assert (t.contact[:, -1] > t.contact[:, 0] + 0.3).all()
    usual, early, late, one_side = t.contact[::2, np.argmin(np.abs(NODES - 0.3))]
    assert one_side > usual  # the mean of the axle
    assert early < usual < late
    assert np.logaddexp(t.ways[::2], t.ways[1::2]) == pytest.approx(0.0, abs=1e-3)
    at = t.mean @ np.array([1.0, 0.0, np.arcsinh(1.5)])  # 108 km/h, a steady car
    near, far = (int(np.argmin(np.abs(NODES - x))) for x in (0.0, 0.6))
    size = (np.exp(t.ways)[:, :, None] * np.abs(at)).reshape(4, 2, NODES.size, 5).sum(axis=1)
    assert (size[:3, near] > size[:3, far]).all()
    assert (size[3, near] > size[3, far])[[0, 1, 3]].all()  # on the other side the road is dry
    assert (2.0 * t.law[::2] @ (size[:, near] - size[:, far]) > 0.3).all()
    assert (np.linalg.eigvalsh(np.concatenate([*t.scatter, t.kind_scatter])) > 0.0).all()
    assert (t.prior.sum(), t.law.sum()) == pytest.approx((1.0, 1.0), abs=1e-3)
    p = params(CAR, 0.1)
    standing = Inputs(*np.zeros((len(Inputs._fields), 300_000)))
    assert scan(p, t, Filter.new(p, t), standing)[1].kinds.sum() == pytest.approx(1.0, abs=1e-6)


def test_wheels_stop_at_like_speeds_whatever_the_law():
    """Contact that is lost early ends far beyond that speed: without more, no fast car would have such a tyre."""
    tyres = [[any_tyre(TYRES["worn_summer"], np.random.default_rng(k), law) for k in range(100)] for law in LAWS]
    usual, early, late = (np.median([own_full(tyre, CAR, 3e-3, 2.2e5) for tyre in of_law]) for of_law in tyres)
    assert early == pytest.approx(usual, rel=0.1)
    assert late == pytest.approx(usual, rel=0.1)


@pytest.mark.parametrize("drivetrain", DRIVETRAINS)
def test_emissions_are_those_of_these_features(drivetrain):
    """Features of passes that were not learnt from lie where the file has them; another scale or order would not."""
    t, squares = emissions_of(drivetrain), []
    for seed in range(12):
        p = own_pass(300 + seed, drivetrain)
        x = windows(p.columns, p.vehicle, p.dt, p.wet)[round((p.wet[0] + 2.0) / 0.1)]
        node = int(np.argmin(np.abs(np.log(p.v_full / 30.0) - x[6] - NODES)))
        way = int(x[1] < 0.0)  # of the usual law
        left = x[:5] - t.mean[way, node] @ x[5:8]
        squares.append(left @ np.linalg.solve(t.scatter[way, node], left))
    assert np.nanmedian(squares) < CHI2_95


def test_a_mixture_of_laws_is_between_them():
    q, t = own_pass(12, "rwd"), emissions_of("rwd")
    p, x, k = params(q.vehicle, q.dt), inputs_of(q.columns, q.vehicle, q.dt), round((q.wet[0] + 2.0) / q.dt)
    each = [t._replace(law=law) for law in (t.law, *0.5 * np.repeat(np.eye(4), 2, axis=1))]
    each.insert(1, t._replace(ways=t.ways[::-1].copy()))  # as rows of another order, the recursion is compiled again
    mixed, rare, *alone = (scan(p, own, Filter.new(p, own), x)[0][-1, k] for own in each)
    assert min(alone) + 0.5 < mixed < max(alone) - 0.5
    assert abs(rare - mixed) > 0.2  # how rare each way is counts
    assert np.isnan(scan(p, t, Filter.new(p, t), x)[0][4, 400:600]).all()  # of a dry road no distance is compared


@pytest.mark.parametrize("drivetrain", DRIVETRAINS)
def test_likelihoods_are_student_s(drivetrain):
    t, rng = emissions_of(drivetrain), np.random.default_rng(1)
    z, x, P, found = np.array([1.0, 0.2, 1.4]), rng.normal(0.0, 3.0, 5), rng.uniform(0.0, 0.5, 5), np.empty(t.road.size)
    left, S = x - t.kind_mean @ z, t.kind_scatter + np.diag(P)
    square = np.einsum("ki,kij,kj->k", left, np.linalg.inv(S), left)
    due = -0.5 * np.linalg.slogdet(S)[1] - 0.5 * (TAIL + 5) * np.log1p(square / TAIL)
    flat = t.in_columns()
    recursion._scores(flat.kind_mean, flat.kind_scatter, z, x, P, np.zeros(t.road.size), found)
    assert found == pytest.approx(due, abs=1e-9)


def test_a_wet_drive_has_a_distance_and_a_warning(wet):
    margin = wet.features["aquaplaning_margin"].fill_null(np.nan).to_numpy()
    t = np.arange(margin.size) * wet.signals.dt
    label = np.nan_to_num(wet.signals.array("on_water")) > 0.5
    entry = float(t[label][0])
    assert not np.isfinite(margin[t < entry - 0.2]).any()
    assert np.isfinite(margin[(t > entry + 1.0) & label]).mean() > 0.9
    assert wet.margin is not None
    low, high = wet.margin.ci90
    assert low <= wet.margin.least <= high
    assert entry < wet.margin.warned_s < entry + 2.0
    assert any(e.detector == "margin" for e in wet.events)


@pytest.mark.parametrize(("car", "kmh"), [(CAR, 104.0), (CAR, 110.0), (FWD, 110.0), (FWD, 115.0)])
def test_a_wheel_that_has_stopped_teaches_nothing_of_the_dry_road_behind(car, kmh):
    speed = ((0.0, kmh), (12.0, kmh), (13.0, kmh - 4.0), (26.0, kmh - 50.0))
    columns = drive(car, duration_s=26.0, lanes=(lane(8.0, 12.0, 2.5e-3),), speed_kmh=speed, seed=1)[0]
    found = detect_drive(columns, car)
    # the torque falls as the water ends: until it stands still slips alone say that the road is dry
    assert not [e for e in found.events if e.detector == "margin" and e.end_s > 14.0]
    assert found.margin is None or 8.0 < found.margin.at_s < 13.0


@pytest.mark.parametrize(
    ("car", "speed"),
    [
        (CAR, ((0.0, 98.0),)),
        (FWD, ((0.0, 104.0),)),
        (CAR, ((0.0, 84.0), (8.0, 84.0), (18.0, 113.0))),
        (FWD, ((0.0, 84.0), (8.0, 84.0), (18.0, 113.0))),
    ],
    ids=["rear, steady", "front, steady", "rear, faster", "front, faster"],
)
def test_who_stays_in_the_water_stays_warned(car, speed):
    """Its wheels transmit a third of their load against the water, and more where it speeds up."""
    columns = drive(car, duration_s=18.0, lanes=(lane(8.0, 18.0, 2.5e-3),), speed_kmh=speed, seed=1)[0]
    found = detect_drive(columns, car)
    in_water = slice(900, 1750)
    warned = next(t.active for t in found.tracks if t.detector == "margin")
    assert np.isfinite(found.features["aquaplaning_margin"].to_numpy()[in_water]).mean() > 0.95
    assert warned[in_water].mean() > 0.8


@pytest.mark.parametrize("car", [CAR, FWD], ids=["rwd", "fwd"])
def test_who_enters_the_water_while_speeding_up_is_warned(car):
    """There the resistance does not count, since an unknown trailer shows more than water. The slips do, with doubt."""
    speed = ((0.0, 80.0), (7.0, 80.0), (15.0, 114.6))
    columns = drive(car, duration_s=15.0, lanes=(lane(9.0, 15.0, 2e-3),), speed_kmh=speed, seed=1)[0]
    found = detect_drive(columns, car)
    warned = next(t.active for t in found.tracks if t.detector == "margin")
    assert not warned[:880].any()
    assert warned[1050:].mean() > 0.8


@pytest.mark.parametrize(
    ("situation", "seed"), [("wind_shelter", 990010), ("wind_shelter", 990058), ("pressure_loss", 1002002)]
)
def test_wind_while_speeding_up_and_a_tyre_that_loses_its_air_are_no_water(situation, seed):
    d = draw(situation, seed, SCORING_POOL)
    found = detect_drive(as_signals(simulate(d.scenario, d.model), vehicle=d.believed), d.believed, samples=False)
    assert not [e for e in found.events if e.detector == "margin"]


def test_jumps_that_go_on_are_no_gear_shift():
    """A traction control takes torque away and gives it back for as long as the wheels spin. Slips count meanwhile."""
    t = np.arange(600) * 0.01
    v, one = 25.0 + 0.01 * np.sin(t), np.ones(600)  # a signal that never changes has stopped coming
    torque = 200.0 + 150.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * t)) * (t > 2.0)
    columns = {"v_x": v, "a_x": 0.0 * one, "a_y": 0.0 * one, "yaw_rate": 0.0 * one}
    columns |= {f"omega_{w}": v / CAR.r_e(w) for w in WHEELS} | dict.fromkeys(
        (f"torque_{w}" for w in CAR.driven), torque
    )
    f = FeatureStream(CAR, 0.01, columns).push(columns)
    seen = Reader(CAR, 0.01).push(Scene(f, dict.fromkeys(WHEELS, one < 0.0), columns))
    shift = (t > 2.1) & (t < 2.9)
    assert np.isnan(seen.R[shift]).all()
    assert seen.rough[shift].all()
    assert np.isfinite(seen.D_l[t > 0.5]).all()
    assert np.isfinite(seen.R[t > 3.1]).all()
    assert not seen.rough[t > 3.1].any()


def test_slips_of_full_aquaplaning_count_where_nothing_shakes():
    t = emissions_of("awd").in_columns()
    near, far = (int(np.argmin(np.abs(NODES - x))) for x in (0.0, 0.55))
    R, M = (FilterParams._field_defaults[name] ** 2 for name in ("law_R", "law_M"))
    z, P, n = np.array([1.0, np.log(80 / 108), np.arcsinh(8.0)]), np.array([R, 0.1, 0.1, M, M]), t.mean.shape[2]
    x, score = np.array([1.7, 6.0, 6.0, 0.0, 0.0]), np.empty((2, n))
    for k, calm in enumerate((0.0, 0.3)):
        recursion._scores(t.mean, t.scatter, z, x, P, np.full(n, calm), score[k])
    never, sometimes = score[:, near] - score[:, far]
    assert sometimes > max(never + 1.5, 3.0)


@pytest.mark.parametrize(("drivetrain", "ahead"), [("awd", 0.3), ("fwd", 0.9), ("rwd", 0.0)])
def test_front_wheels_that_are_driven_may_spin_or_stop(drivetrain, ahead):
    """Near full aquaplaning both slip far; one law of both would hold whatever lies between."""
    t, node = emissions_of(drivetrain), int(np.argmin(np.abs(NODES)))
    slip = t.mean[:, node, 1] @ np.array([1.0, 0.0, np.arcsinh(1.5)])
    assert (slip[1::2] < -2.5).all()
    if ahead:
        assert (slip[::2] > 2.0).all()
    assert np.exp(t.ways[::2, node]).mean() == pytest.approx(ahead, abs=0.15)
    assert (t.scatter[:, node, 1, 1] < 16.0).all()


def test_document_and_page(wet):
    found = document(wet, log="x")["margin"]
    assert set(found) == {"least_kmh", "ci90", "at_s", "warned_s"}
    assert found["least_kmh"] == pytest.approx(KMH * wet.margin.least, rel=1e-6)
    row = next(r for r in drive_rows(wet) if r.title == "Distance to full aquaplaning")
    assert [line.label for line in row.lines] == ["95 %", "75 %", "median", "25 %", "5 %"]
    shaded = drive_report(wet, is_drawn=True).islands["drive-data"]["shaded"]
    assert all(x == shaded[0] for x, e in zip(shaded, wet.events, strict=True) if e.detector == "margin")


def test_rain_from_the_first_metre():
    """The dry road is learnt below 40 km/h, where water does nothing: rain all the way is found where it counts."""
    speed = ((0.0, 30.0), (8.0, 30.0), (48.0, 104.0))
    columns = drive(CAR, duration_s=54.0, lanes=(lane(0.0, 60.0),), speed_kmh=speed)[0]
    found = detect_drive(columns, CAR)
    p = found.features["water_probability"].fill_null(np.nan).to_numpy()
    assert p[-1] > 0.9
    assert found.margin is not None
    assert np.isfinite(found.margin.warned_s)


def test_a_wheel_signal_that_stands_still_is_none():
    p = own_pass(7, "fwd")
    held = {**p.columns, "omega_fr": p.columns["omega_fr"].copy()}
    held["omega_fr"][500:700] = held["omega_fr"][500]
    whole, part = (windows(x, p.vehicle, p.dt, p.wet)[:, 1] for x in (p.columns, held))
    gone = slice(round(6.1 / 0.1), round(6.9 / 0.1))
    assert np.isfinite(whole[gone]).all()
    assert np.isnan(part[gone]).all()
    assert np.isfinite(part[round(7.6 / 0.1) : 80]).all()


def test_the_distance_is_from_the_car_s_own_speed():
    """Below 40 km/h nothing is read, but a car that brakes in the water goes further away from floating."""
    deep = drive(
        CAR, duration_s=14.0, lanes=(lane(6.0, 14.0, 6e-3),), speed_kmh=((0.0, 66.0), (9.0, 66.0), (12.0, 10.0))
    )
    f = detect_drive(deep[0], CAR).features
    v, margin, full = (f[n].to_numpy()[-50:] for n in ("v_x_hat", "aquaplaning_margin", "full_speed_expected"))
    assert np.isfinite(margin).all()
    assert v.max() < 16.0 / KMH
    assert margin == pytest.approx(full - v, abs=1.0 / KMH)


def test_traction_is_that_of_the_torque_behind_the_driveline():
    car = replace(CAR, driveline_inertia=6.0, torque_arm="loaded", r_l_r=0.28)
    t = np.arange(400) * 0.01
    v, one = 20.0 + 0.4 * t, np.ones(400)
    columns = {"v_x": v, "a_x": 0.4 * one, "a_y": 0.0 * one, "yaw_rate": 0.0 * one}
    columns |= {f"omega_{w}": v / car.r_e(w) for w in WHEELS} | {f"torque_{w}": 150.0 * one for w in car.driven}
    f = FeatureStream(car, 0.01, columns).push(columns)
    seen = Reader(car, 0.01).push(Scene(f, dict.fromkeys(WHEELS, one < 0.0), columns))
    assert seen.u_rl[-1] == pytest.approx(f["mu_rl"][-1] + car.rolling_resistance, rel=1e-3)


@pytest.mark.parametrize("u", [-0.24, 0.05, 0.24])
def test_what_a_dry_wheel_shows_is_the_brush(u):
    s = recursion._slip(u, 31.0, 0.0105, 1.02)
    assert brush_force(np.array([s]), np.ones(1), mu=1.02, C_s=31.0)[0] == pytest.approx(u - 0.0105, rel=1e-9)


@pytest.mark.parametrize("seed", [1, 4, 7, 10, 13])
def test_water_under_one_side_of_a_car_with_front_wheel_drive(seed):
    """Its wheels on the other side are those of a dry road, and its drag is half."""
    p = own_pass(seed, "fwd", distance=(5.0 / KMH, 20.0 / KMH), one_side=True)
    true, median, low, high, *_, warned, early = outcome(p)
    assert low <= true <= high
    assert abs(median - true) < 15.0
    assert warned
    assert not early


@pytest.mark.parametrize("seed", [1611000, 1611021, 1611039])
def test_snow_under_one_side_is_no_water(seed):
    """Wheels of the rear axle spin and shake on it as the front ones do."""
    signals, car, _ = other_drive(seed, DRIVETRAINS[seed % 1000 % 3], one_side=True)
    assert not [e for e in detect_drive(signals, car).events if e.detector == "margin"]


@pytest.mark.parametrize("drivetrain", DRIVETRAINS)
def test_the_rear_axle_shows_what_lies_under_one_side(drivetrain):
    """It slips and shakes less in water than on snow, where the front axle shows the same."""
    t = emissions_of(drivetrain)
    x = np.concatenate([(1.0, 0.0, np.arcsinh(5.0)), (0.7, -3.0 if drivetrain != "fwd" else 3.0, 0.0, 4.0, 0.0)])
    of = len(t.rear)
    water, snow = (np.average(t.rear @ x, axis=0, weights=t.kind_prior[-of:] * (t.road[-of:] == k)) for k in (1, 3))
    assert snow[1] > water[1] + 1.0
    assert abs(snow[0]) > abs(water[0]) + 0.3 or drivetrain == "rwd"  # its torque slips there


def rough(seed=3):
    """A dry drive that speeds up, and whose accelerometer shakes by 0.8 m/s² from 15 s on."""
    columns = drive(CAR, duration_s=30.0, lanes=(), speed_kmh=((0.0, 80.0), (30.0, 114.0)))[1]
    noise = 0.8 * np.random.default_rng(seed).standard_normal(3000) * (np.arange(3000) >= 1500)
    return {**columns, "a_x": columns["a_x"] + noise[: columns["a_x"].size]}


def test_what_is_let_through_is_not_chosen_by_the_noise_of_the_accelerometer():
    """Samples of low acceleration are samples of high resistance: of those alone it was 0.2 m/s²."""
    R = inputs_of(rough(), CAR, 0.01).R
    assert np.isfinite(R[2000:]).mean() > 0.9
    assert np.nanmean(R[2000:]) == pytest.approx(np.nanmean(R[500:1500]), abs=0.05)


def test_resistance_is_as_unsure_as_the_accelerometer_shakes():
    x, p, t = inputs_of(rough(), CAR, 0.01), params(CAR, 0.01), emissions_of("rwd")
    calm, shaken = (scan(p, t, Filter.new(p, t), Inputs(*(y[:n] for y in x)))[1] for n in (1480, 2500))
    assert shaken.x[1, 0] > 10.0 * calm.x[1, 0]
    assert shaken.body[2] > 2.0 > 0.5 > calm.body[2]
    assert shaken.x[1, 3] > shaken.body[2] ** 2  # shake of wheels says nothing there
    assert shaken.kinds[t.road == 1].sum() < 0.1


@pytest.mark.parametrize("car", [CAR, FWD])
def test_the_air_of_a_trailer_is_no_water(car):
    """A car of more drag area than known speeds up: what it has learnt at 60 km/h does not hold at 125 km/h."""
    wide = replace(car, drag_area=car.drag_area + 1.2)
    speed = ((0.0, 60.0), (20.0, 60.0), (50.0, 125.0), (60.0, 125.0))
    found = detect_drive(drive(wide, duration_s=60.0, lanes=(), speed_kmh=speed)[0], car)
    assert found.features["water_probability"].max() < 0.5


DRY = (
    ("rough_asphalt", 30, 0.5), ("torque_vectoring", 20, 0.5), ("gear_shifts", 23, 0.5), ("snow", 300, 0.5),
    ("split_friction", 303, 0.5), ("pressure_loss", 71004, 1.0), ("pressure_loss", 990018, 1.0), ("dropouts", 71496, 1.0),
)  # fmt: skip


@pytest.mark.parametrize(("name", "seed", "most"), DRY)
def test_a_dry_road_warns_not(name, seed, most):
    """Noise, a curve, torques that are late or stand still, snow that slips by traction, a tyre that loses its air."""
    drawn = draw(name, seed, SCORING_POOL)
    signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed, truth=False)
    found = detect_drive(signals, drawn.believed)
    assert found.features["water_probability"].max() < most
    least = document(found, log="x")["margin"]
    assert least is None or (least["warned_s"] is None and most > 0.5)
