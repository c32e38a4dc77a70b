"""The rivals find what is there in clean cases, so that what they are told to have missed is theirs."""

import numpy as np
import pytest

from tests.blind.judging.answers import read_answer
from tests.blind.judging.cases import judge
from tests.blind.judging.rivals import table
from tests.blind.rivals.columns import Residuals, form_columns, named_columns, scales, stacked
from tests.blind.rivals.compare import Claim, claims, error_taken
from tests.blind.rivals.select import SELECTORS
from tests.blind.rivals.sindy import polynomials, single
from tests.blind.test_judge import MASS, cause, document, truth
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
        ("payload_mass", 160.0), ("aero_drag", 0.2), ("accelerometer_bias@a_x", 0.1), ("tyre_radius@fl", 0.01),
        ("signal_delay@a_x", 0.1),
    ],
)  # fmt: skip
def test_a_clear_effect_in_white_noise_is_named_first(selector, effect, size):
    log, _ = drive(effect, size)
    columns = named_columns(log, CAR)
    rows, y = stacked(log, columns, scales(log))
    found = SELECTORS[selector](rows, y, list(columns))
    # what is exactly the same together is as good: an offset is a slope and the rolling resistance that hides its pull
    same = {effect, "road_grade", "rolling_resistance"} if effect.startswith("accelerometer_bias") else {effect}
    assert next(iter(found.coefficients)) in same


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
    assert not any(x[1:].any() for x in polynomials(log, CAR).values())  # in the force balance alone


def test_the_share_of_the_error_that_a_prediction_takes_away():
    log, trace = drive("aero_drag", 0.2, sd=0.0)
    some = log._replace(channels=CHANNELS[:1], residual=log.residual[:1])
    assert error_taken(some, trace[:1]) == pytest.approx(1.0)
    assert error_taken(some, 0.5 * trace[:1]) == pytest.approx(0.75)
    assert error_taken(some, 0.0) == 0.0
    assert error_taken(some, -trace[:1]) == pytest.approx(-3.0)


def test_a_load_is_claimed_by_its_name_and_a_hump_over_the_speed_as_a_form():
    log, _ = drive("payload_mass", 160.0)
    unseen, _ = drive("payload_mass", 160.0, seed=2)
    said = claims(log, unseen, CAR)
    assert set(said) >= {"BIC forward", "BIC forward, with forms", "LASSO, BIC", "E-SINDy, inclusion 0.9"}
    for method in ("BIC forward", "BIC forward, with forms"):
        assert "payload_mass" in said[method].effects
        assert said[method].gain > 0.1  # of one channel of six
    # a force of one hat: no named column has its shape
    hats = {n: x for n, x in form_columns(log).items() if n.startswith("force|v_x")}
    log = log._replace(residual=drive(sd=0.002)[0].residual + 0.2 * hats["force|v_x|2"])
    said = claims(log, None, CAR)
    first = said["BIC forward, with forms"]
    assert (first.mechanisms, first.depends_on, first.effects) == (("force",), ("v_x",), ())
    assert said["BIC forward"].effects


def test_all_methods_are_judged_by_one_truth():
    form = {"kind": "hump", "mechanism": "force", "depends_on": ["v_x"], "held_back": False}
    shape = {"mechanism": "force", "depends_on": ["v_x"], "channel": "force_balance"}
    said = [document("no_effect"), document("named", cause("payload_mass")), document("unexplained")]
    said[2]["unexplained"] = [shape]
    truths = [truth("null"), truth("known", MASS), {**truth("unknown"), "unknown": form}]
    cases = [judge(k, read_answer(d), t) for k, d, t in zip("abc", said, truths, strict=True)]
    own = Claim(False, gain=0.5)
    bic = [Claim(True), Claim(True, ("torque_gain",), gain=0.2), Claim(True, (), ("force",), ("torque",))]
    sindy = [Claim(False), Claim(True, ("trailer", "payload_mass"), gain=-0.1), Claim(True, (), ("force",), ("v_x",))]
    claimed = {k: {"aqualog": own, "BIC": b, "SINDy": s} for k, b, s in zip("abc", bic, sindy, strict=True)}
    lines = table(cases, claimed).splitlines()
    cells = [[c.split(" ")[1] for c in line.split("|")[2:-1]] for line in lines[2:]]
    assert cells == [
        ["0.00", "1.00", "0.50", "1.00"],
        ["1.00", "0.00", "0.20", "0.00"],
        ["0.00", "1.00", "-0.10", "1.00"],
    ]
