"""The rivals find what is there in clean cases, so that what they are told to have missed is theirs."""

import numpy as np
import pytest

from tests.blind.rivals.columns import Residuals, named_columns, scales, stacked
from tests.blind.rivals.compare import heldout_share, measured
from tests.blind.rivals.select import SELECTORS
from tests.blind.rivals.sindy import polynomials, single
from tests.blind.world.vehicles import CARS

pytest.importorskip("sklearn", reason="needs the extra `blind`")
pytest.importorskip("pysindy", reason="needs the extra `blind`")

CAR = CARS["sedan_rwd"]
CHANNELS = ("force_balance", "kinematic", "slip_fl", "slip_fr", "slip_rl", "slip_rr")


def drive(effect=None, size=0.0, *, tau=0.0, sd=0.02, seed=1, n=2400, dt=0.1):
    """Ten-hertz residuals: a column times a size in noise of correlation time `tau` [s]."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    v = 20.0 + 6.0 * np.sin(2 * np.pi * t / 47.0) + 4.0 * np.sin(2 * np.pi * t / 13.0 + seed)
    a = np.gradient(v, dt)
    torque = CAR.r_e_r * (
        CAR.mass * (a + 9.81 * CAR.rolling_resistance) + 0.5 * CAR.air_density * CAR.drag_area * v * v
    )
    noise = rng.normal(size=(len(CHANNELS), n))
    if tau > 0.0:
        keep = np.exp(-dt / tau)
        for i in range(1, n):
            noise[:, i] = keep * noise[:, i - 1] + np.sqrt(1.0 - keep**2) * noise[:, i]
    coordinates = {"t": t, "v_x": v, "a_x": a, "torque": torque, "position": np.cumsum(v) * dt}
    empty = Residuals(CHANNELS, np.zeros_like(noise), np.ones(n, dtype=bool), coordinates, dt)
    trace = size * named_columns(empty, CAR)[effect] if effect else np.zeros_like(noise)
    return empty._replace(residual=sd * noise + trace), trace


@pytest.mark.parametrize("selector", SELECTORS)
@pytest.mark.parametrize(
    ("effect", "size"),
    [
        ("payload_mass", 160.0),
        ("aero_drag", 0.2),
        ("accelerometer_bias@a_x", 0.1),
        ("tyre_radius@fl", 0.01),
        ("signal_delay@a_x", 0.1),
    ],
)
def test_a_clear_effect_in_white_noise_is_named_first(selector, effect, size):
    log, _ = drive(effect, size)
    columns = named_columns(log, CAR)
    rows, y = stacked(log, columns, scales(log))
    found = SELECTORS[selector](rows, y, list(columns))
    # what is exactly the same together is as good: an offset is a slope and the rolling resistance that hides its pull
    same = {effect, "road_grade", "rolling_resistance"} if effect.startswith("accelerometer_bias") else {effect}
    assert next(iter(found.coefficients)) in same


def test_bic_gives_the_size_too():
    log, _ = drive("payload_mass", 160.0)
    columns = named_columns(log, CAR)
    found = SELECTORS["BIC forward"](*stacked(log, columns, scales(log)), list(columns))
    assert found.coefficients["payload_mass"] == pytest.approx(160.0, rel=0.05)


def test_white_noise_gives_bic_nothing_and_coloured_noise_does():
    def finds(tau):
        log, _ = drive(tau=tau, seed=5)
        columns = named_columns(log, CAR)
        return SELECTORS["BIC forward"](*stacked(log, columns, scales(log)), list(columns)).coefficients

    assert not finds(0.0)
    assert finds(5.0)


def test_pysindy_reads_a_load_as_a_term_in_the_drive_and_drag_as_one_in_the_square_of_speed():
    log, _ = drive("payload_mass", 320.0, sd=0.005)
    assert next(iter(single(log, CAR, 0.02).coefficients)) == "u"
    # v is over 30 m/s: c_w A + 0.3 m^2 is 0.1 in these units
    log, _ = drive("aero_drag", 0.3, sd=0.001)
    found = single(log, CAR, 0.02).coefficients
    assert next(iter(found)) == "v v"
    assert found["v v"] == pytest.approx(-0.5 * CAR.air_density * 0.3 * 900.0 / CAR.mass, rel=0.05)


def test_polynomials_stand_in_the_force_balance_alone():
    log, _ = drive()
    for x in polynomials(log, CAR).values():
        assert not x[1:].any()


def test_share_of_the_oracle():
    log, trace = drive("aero_drag", 0.2)
    assert heldout_share(log, trace, trace) == 1.0
    assert heldout_share(log, 0.0, trace) == 0.0
    assert heldout_share(log, -trace, trace) < -1.0
    assert np.isnan(heldout_share(log, trace, np.zeros_like(trace)))


def test_all_methods_give_a_figure():
    log, _ = drive("payload_mass", 160.0, tau=1.0)
    unseen, trace = drive("payload_mass", 160.0, tau=1.0, seed=2)
    out = measured(log, unseen, trace, CAR, ["payload_mass"])
    assert set(out) >= {"BIC forward", "LASSO, BIC", "E-SINDy, inclusion 0.9"}
    assert out["BIC forward"]["right"] == 1.0
    assert out["BIC forward"]["gain"] > 0.8
    assert measured(log, None, None, CAR, ["aero_drag"])["BIC forward"]["right"] == 0.0
