"""From features to the estimator: which speeds and tractions go in, what stops it, what is told of a drive."""

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.records import SlopeSummary
from aqualog.core.vehicle import Vehicle
from aqualog.detect.slip_slope import estimator
from aqualog.detect.slip_slope.tuning import TUNING, Params
from aqualog.detect.slip_slope.watch import TAU_SMOOTH, SlipSlopeWatch, pairs, remarks
from aqualog.features.smoothing import UNSET, lowpass

DT = 0.01
N = 6000
T = np.arange(N) * DT
TYRES = {"slip_slope_f": 24.0, "slip_slope_r": 36.0}
AWD = Vehicle(drivetrain="awd", torque_split_rear=0.5, **TYRES)
RWD = Vehicle(drivetrain="rwd", given=frozenset({"drivetrain", "tyre.slip_slope_r"}), **TYRES)
FWD = Vehicle(drivetrain="fwd", given=frozenset({"drivetrain", "tyre.slip_slope_f"}), **TYRES)


def features(vehicle, factor=1.0, **changes):
    """Linear tyres of the vehicle file, times a factor; front and rear traction vary independently."""
    mu = {"f": 0.06 + 0.05 * np.sin(0.8 * T), "r": 0.08 + 0.05 * np.sin(0.5 * T + 1.0)}
    for axle in "fr":
        if axle + "l" not in vehicle.driven:
            mu[axle] = np.zeros(N)
    slopes = {"f": vehicle.slip_slope_f * factor, "r": vehicle.slip_slope_r * factor}
    f = {"v_x_hat": np.full(N, 25.0)}
    f |= {n: np.zeros(N) for n in ("a_kin_slow", "a_y_slow", "yaw_rate_slow")}
    for w in WHEELS:
        f[f"mu_{w}"] = mu[w[0]]
        f[f"v_line_{w}"] = 25.0 / (1.0 - mu[w[0]] / slopes[w[0]])  # (3.13)
        f[f"a_w_delta_{w}"] = np.zeros(N)
    return f | changes


def watch(vehicle, f, pair=0, braking=(), **kw):
    w = SlipSlopeWatch(vehicle, pairs(vehicle, **kw)[pair], DT)
    bits = {x: np.full(N, x in braking) for x in WHEELS}
    return w.push(f, bits, f["yaw_rate_slow"]), w


def smooth(x):
    return lowpass(x, UNSET, tau=TAU_SMOOTH, dt=DT)[0]


@pytest.mark.parametrize("form", ["f", "r"])
@pytest.mark.parametrize("per_axle", [False, True])
def test_all_wheel_drive_gets_differential_slip_and_both_tractions(form, per_axle):
    """(3.18) to (3.20): s_delta = (v_i - v_j) / v_i, mu_i and rho mu_j with rho = v_j / v_i, smoothed alike."""
    f = features(AWD)
    seen, w = watch(AWD, f, form=form, per_axle=per_axle)
    i, j = (form, "fr".replace(form, ""))
    v_i, v_j, mu_i, mu_j = f[f"v_line_{i}l"], f[f"v_line_{j}l"], f[f"mu_{i}l"], f[f"mu_{j}l"]
    slope, beta = (24.0, 24.0 / 36.0) if form == "f" else (36.0, 36.0 / 24.0)
    expected, _ = estimator.scan(
        Params.make(TUNING, DT),
        estimator.initial_state(TUNING, slope=slope, beta=beta),
        smooth((v_i - v_j) / v_i),
        smooth(mu_i),
        smooth(v_j / v_i * mu_j),
        np.ones(N, dtype=bool),
    )
    assert seen.estimate.slope == pytest.approx(expected.slope, rel=1e-12)
    assert seen.estimate.offset == pytest.approx(expected.offset, abs=1e-15)
    assert expected.slope[-1] == pytest.approx(slope, rel=0.01)
    assert w.summary().beta == pytest.approx(beta, rel=0.02)


@pytest.mark.parametrize(("vehicle", "slope"), [(RWD, 36.0), (FWD, 24.0)])
def test_one_driven_axle_gets_its_own_slope(vehicle, slope):
    """C87; prior and reference are those of the driven axle."""
    f = features(vehicle)
    seen, w = watch(vehicle, f)
    assert seen.estimate.slope[0] == pytest.approx(slope, rel=0.02)
    assert seen.estimate.slope[-1] == pytest.approx(slope, rel=0.01)
    assert seen.reference[0] == slope
    assert w.summary().beta is None
    assert w.summary().wheel == ("rl" if vehicle is RWD else "fl")


def test_without_a_slope_in_the_vehicle_file_there_is_no_reference_at_first():
    bare = Vehicle(drivetrain="rwd", **TYRES)
    seen, _ = watch(bare, features(bare))
    assert np.isnan(seen.reference[:400]).all()
    assert seen.reference[-1] == pytest.approx(36.0, rel=0.02)


def test_a_wheel_that_shakes_is_not_judged():
    """C68: "variance of the wheel acceleration below a threshold", on the driven wheel; the free one may dip (C72)."""
    seen, _ = watch(RWD, features(RWD, 0.4))
    assert seen.active[-100:].all()
    shaking = 4.0 * np.sign(np.sin(60.0 * T))
    seen, _ = watch(RWD, features(RWD, 0.4, a_w_delta_rl=shaking))
    assert np.isnan(seen.loss[100:]).all()
    assert not seen.active.any()
    for wheel in ("fl", "rr"):
        seen, _ = watch(RWD, features(RWD, 0.4, **{f"a_w_delta_{wheel}": shaking}))
        assert seen.active[-100:].all()
    for wheel in ("fl", "rl"):  # both are driven
        seen, _ = watch(AWD, features(AWD, 0.4, **{f"a_w_delta_{wheel}": shaking}))
        assert not seen.active.any()


@pytest.mark.parametrize("wheel", ["rl", "fl"])
def test_a_braked_wheel_of_the_pair_stops_it(wheel):
    seen, w = watch(RWD, features(RWD), braking=(wheel,))
    assert (seen.estimate.status == estimator.INACTIVE).all()
    assert w.summary().inactive["braking"] == pytest.approx(60.0)
    seen, _ = watch(RWD, features(RWD), braking=("rr", "fr"))
    assert (seen.estimate.status < estimator.INACTIVE).all()


def test_seconds_by_state_and_reason_add_up():
    slow = np.where(T < 20.0, 5.0, 25.0)
    turning = np.where((T > 30.0) & (T <= 35.0), 3.0, 0.0)
    hole = np.where(np.abs(T - 50.0) < 1.0, np.nan, 0.08)
    _, w = watch(RWD, features(RWD, v_x_hat=slow, a_y_slow=turning, mu_rl=hole))
    s = w.summary()
    assert sum(s.seconds.values()) == pytest.approx(60.0)
    assert s.seconds["inactive"] == pytest.approx(sum(s.inactive.values()))
    assert s.inactive["too slow"] == pytest.approx(20.0)
    assert s.inactive["cornering"] == pytest.approx(5.0)
    assert s.inactive["signals missing"] == pytest.approx(2.0, abs=0.02)


def summary(**changes):
    values = {
        "place": "left", "wheel": "rl", "slope": 30.0, "slope_sd": 1.0, "reference": 30.0, "beta": None, "offset": 0.0,
        "alarms": 0, "seconds": {"estimating": 600.0, "slope_frozen": 0.0, "blind": 0.0}, "inactive": {},
        "judged_s": 600.0, "dropped_s": 0.0,
    }  # fmt: skip
    return SlopeSummary(**(values | changes))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({}, None),
        ({"alarms": 12}, None),
        ({"alarms": 13}, "more than a road has"),
        ({"alarms": 3, "seconds": {"estimating": 20.0, "slope_frozen": 0.0, "blind": 0.0}}, None),
        ({"dropped_s": 530.0}, None),
        ({"dropped_s": 550.0}, "is this the tyre"),
        ({"judged_s": 10.0, "dropped_s": 10.0}, None),
        ({"stiff_s": 59.0}, None),
        ({"stiff_s": 61.0}, "stiffer than any tyre"),
        ({"seconds": {"estimating": 200.0, "slope_frozen": 0.0, "blind": 400.0}}, "hardly any traction"),
        ({"seconds": {"estimating": 200.0, "slope_frozen": 0.0, "blind": 400.0}, "beta": 1.0}, "slip alike"),
        ({"seconds": {"estimating": 200.0, "slope_frozen": 400.0, "blind": 0.0}}, "too even"),
        ({"seconds": {"estimating": 2.0, "slope_frozen": 0.0, "blind": 7.0}}, None),
    ],
)
def test_notes_on_a_drive(changes, word):
    notes = remarks([summary(**changes), summary(place="right", wheel="rr", **changes)])
    assert len(notes) == (0 if word is None else 1)
    if word:
        assert word in notes[0]
        assert "left, right" in notes[0]


def test_seconds_judged_and_dropped():
    _, w = watch(RWD, features(RWD, 0.4))
    s = w.summary()
    assert 50.0 < s.judged_s < 60.0
    assert s.dropped_s == pytest.approx(s.judged_s, abs=2.0)
    _, w = watch(RWD, features(RWD))
    assert w.summary().dropped_s == 0.0


def test_a_slope_that_is_known_is_judged_under_even_traction_too():
    """Frozen, not lost: the traction varied before, and the slope is known from then."""
    mu = np.where(T < 8.0, 0.06 + 0.03 * np.sin(2.0 * T), 0.06)
    f = features(RWD, 0.25)
    for w in ("rl", "rr"):
        f |= {f"mu_{w}": mu, f"v_line_{w}": 25.0 / (1.0 - mu / (0.25 * 36.0))}
    seen, _ = watch(RWD, f)
    assert (seen.estimate.status[-500:] == estimator.FROZEN).all()
    assert np.isfinite(seen.loss[-500:]).all()
    assert seen.active[-500:].all()


def test_a_slip_that_does_not_grow_with_the_traction_is_counted():
    """Braking that is not in the log, or swapped axles: the estimate runs to its bound."""
    f = features(RWD)
    for w in ("rl", "rr"):
        f |= {f"v_line_{w}": np.full(N, 25.0)}
    _, w = watch(RWD, f)
    assert w.summary().stiff_s > 30.0
    _, w = watch(RWD, features(RWD))
    assert w.summary().stiff_s == 0.0
