"""What repeats per turn of a wheel: found at the log's rate, with its size, and nothing where nothing is."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aqualog.align.load import load_signals
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.notation import WHEELS
from aqualog.core.records import Origin
from aqualog.diagnose.faster import odd_wheels, remarks, to_causes, why_untested
from aqualog.diagnose.full_rate import PerTurn, _Fit, _lossless, per_turn, wheel_columns
from tests.blind.world.cases import CARS, Hidden, Spec, make_case

CAR = CARS["sedan_rwd"]
FINE = 0.001


def truth(duration=200.0, low=8.0, high=30.0, seed=1):
    """Speed of the wheels [rad/s] on a fine grid, and their angle [rad]."""
    t = np.arange(round(duration / FINE)) * FINE
    rng = np.random.default_rng(seed)
    wander = sum(np.sin(2 * np.pi * t / p + rng.uniform(0, 6)) for p in (61.0, 37.0, 23.0)) / 3.0
    omega = (0.5 * (low + high) + 0.5 * (high - low) * wander) / CAR.r_e_f
    return omega, np.cumsum(omega) * FINE


def drive(*, seed=1, uneven=None, dt=0.01, window=0.0, sigma=0.03, **how):
    """Four wheel speeds of a log; `uneven`: {wheel: function of (angle, omega)} as relative error."""
    omega, angle = truth(seed=seed, **how)
    rng = np.random.default_rng([seed, 5])
    k = round(dt / FINE)
    out = {}
    for w in WHEELS:
        x = omega * (1.0 + (uneven or {}).get(w, lambda a, o: 0.0)(angle, omega))
        if window:
            m = round(window / FINE)
            x = np.convolve(np.pad(x, (m // 2, m - 1 - m // 2), mode="edge"), np.ones(m) / m, "valid")
        out[f"omega_{w}"] = x[::k] + sigma * rng.standard_normal(x[::k].size)
    return out


def ring(amplitude, order=1):
    return lambda angle, _: amplitude * np.sin(order * angle + 0.7)


def origins(rate=100.0, unit="rad/s"):
    return {f"omega_{w}": Origin(f"omega_{w}", w, "log", unit, rate, 1) for w in WHEELS}


def found(columns, dt=0.01, *, of=None):
    results = per_turn(columns, dt, of or origins(1.0 / dt))
    return {(r.wheel, r.order): r for r in results}


def keys(results):
    return {k for k, r in results.items() if r.found}


@pytest.mark.parametrize(
    ("wheel", "order", "amplitude"), [("fl", 1, 5e-4), ("rr", 1, 2e-3), ("fr", 2, 1e-3), ("rl", 3, 1e-3)]
)
def test_an_uneven_wheel_is_found_with_its_size(wheel, order, amplitude):
    results = found(drive(uneven={wheel: ring(amplitude, order)}))
    assert keys(results) == {(wheel, order)}
    one = results[wheel, order]
    assert one.low <= amplitude <= one.high
    assert one.high - one.low < 0.2 * amplitude + 2e-4


def test_every_wheel_and_order_has_an_answer():
    results = found(drive())
    assert set(results) == {(w, k) for w in WHEELS for k in (1, 2, 3)}
    assert all(r.kind == "nothing" and r.p_value > 0.01 for r in results.values())


@pytest.mark.parametrize("kind", ["white", "walk", "steps", "bursts", "constant speed"])
def test_nothing_in_noise(kind):
    alarms = 0
    for seed in range(12):
        columns = drive(seed=seed, duration=100.0, **({"low": 20.0, "high": 20.2} if kind == "constant speed" else {}))
        rng = np.random.default_rng([seed, 9])
        for name, x in columns.items():
            if kind == "walk":
                x += 0.002 * np.cumsum(rng.standard_normal(x.size))
            if kind == "steps":
                columns[name] = np.rint(x / 0.1) * 0.1
            if kind == "bursts":
                for at in rng.integers(0, x.size - 30, 6):
                    x[at : at + rng.integers(1, 30)] += rng.choice([-1.0, 1.0]) * 0.6
        alarms += bool(keys(found(columns)))
    assert alarms == 0


def test_the_reports_mean_over_their_period():
    """A mean over 20 ms takes 10 % of the third order at 12 m/s; the answer has it back."""
    uneven = {"fl": ring(2e-3, 3)}
    how = {"low": 10.0, "high": 12.0, "sigma": 0.01}
    columns = drive(uneven=uneven, dt=0.02, window=0.02, **how)
    unknown = found(columns, 0.02)["fl", 3]
    assert unknown.low < 1.9e-3
    assert 2e-3 <= unknown.high < 2.2e-3


def test_a_slow_bus_shows_only_slow_wheels():
    slow = found(drive(uneven={"fl": ring(2e-3)}, dt=0.1, low=20.0, high=30.0), 0.1)
    assert {r.kind for r in slow.values()} == {"untested"}
    assert "10 Hz" in slow["fl", 1].reason
    assert why_untested(tuple(slow.values())) == slow["fl", 1].reason
    mixed = found(drive(uneven={"fl": ring(4e-3)}, dt=0.1, low=4.0, high=10.0), 0.1)["fl", 1]
    assert mixed.low <= 4e-3 <= mixed.high


def test_straight_lines_between_samples_of_a_slow_bus():
    columns = drive(uneven={"rl": ring(2e-3)}, dt=0.04, low=8.0, high=18.0)
    t = np.arange(round(200.0 / 0.01)) * 0.01
    fast = {n: np.interp(t, np.arange(x.size) * 0.04, x) for n, x in columns.items()}
    results = found(fast, of=origins(25.0))
    assert keys(results) == {("rl", 1)}
    assert results["rl", 1].low <= 2e-3 <= results["rl", 1].high


def test_held_samples_of_a_slow_bus():
    columns = {n: np.repeat(x, 4) for n, x in drive(uneven={"rl": ring(2e-3)}, dt=0.04, low=8.0, high=18.0).items()}
    results = found(columns)
    assert keys(results) == {("rl", 1)}
    assert results["rl", 1].low <= 2e-3 <= results["rl", 1].high


def test_a_control_units_own_radius():
    """A speed in km/h has the angle of a radius that the vehicle file does not know."""
    columns = {n: 1.013 * x for n, x in drive(uneven={"fl": ring(1e-3)}).items()}
    assert found(columns)["fl", 1].high < 1e-3  # the angle runs away within 16 turns
    results = found(columns, of=origins(unit="km/h"))
    assert keys(results) == {("fl", 1)}
    assert results["fl", 1].low <= 1e-3 <= results["fl", 1].high


def test_an_angle_that_drifts_takes_nothing_of_the_size():
    columns = drive(uneven={w: ring(2e-3) for w in WHEELS})
    rng = np.random.default_rng(4)
    for x in columns.values():
        x += 0.0012 * np.cumsum(rng.standard_normal(x.size))
    results = found(columns)
    assert {k for k in keys(results) if k[1] == 1} == {(w, 1) for w in WHEELS}
    assert all(results[w, 1].high > 1.95e-3 for w in WHEELS)


def test_noise_alone_leaves_a_sum_to_take_the_size_from():
    """Squares are free of bias, so noise makes negative ones."""
    fits = [_Fit(0.0, square, 1e-9, 1, None, 0) for square in (-3e-6, -1e-6, -2e-6)]
    assert _lossless(fits) is fits[1]
    assert _lossless([fits[0], fits[2]]) is fits[2]


def test_gaps():
    columns = drive(uneven={"fr": ring(1e-3)})
    rng = np.random.default_rng(2)
    for x in columns.values():
        x[rng.random(x.size) < 0.01] = np.nan
        for at in rng.integers(0, x.size - 300, 20):
            x[at : at + rng.integers(20, 300)] = np.nan
    results = found(columns)
    assert keys(results) == {("fr", 1)}
    assert results["fr", 1].low <= 1e-3 <= results["fr", 1].high


def test_a_resonance_is_no_ring():
    def tyre(angle, omega):
        f = omega / (2.0 * np.pi)
        return 3e-3 / (1.0 + ((f - 12.0) / 1.0) ** 2) * np.sin(angle)

    results = found(drive(uneven={"rr": tyre}))
    assert results["rr", 1].kind == "speed"
    assert "turns a second" in results["rr", 1].reason
    assert to_causes(tuple(results.values())) == ()
    assert "a resonance or the tyre" in remarks(tuple(results.values()))[0]
    assert "; not at all" in remarks([replace(results["rr", 1], reason="")])[0]


def test_one_speed_cannot_show_a_resonance():
    """Between thirds of nearly one speed an amplitude differs by when it is, not by the speed."""

    def above(angle, omega):
        return np.where(omega > np.median(omega), 2e-3, 4e-4) * np.sin(angle)

    steady = found(drive(uneven={"fl": above}, duration=120.0, low=19.8, high=20.2))["fl", 1]
    assert steady.kind == "ring"
    assert steady.reason == ""


def test_what_is_too_small_is_not_listed():
    """Teeth that are uneven by chance leave some 1e-4 at every order."""
    small = [
        PerTurn("fl", k, kind, 1e-4, 9e-5, 1.1e-4, 1e-9, most=2e-4) for k in (1, 2, 3) for kind in ("ring", "speed")
    ]
    assert remarks(small) == ()
    first = remarks([PerTurn("fl", 1, "ring", 9e-4, 8e-4, 1e-3, 1e-9)])
    assert len(first) == 1
    assert first[0] == ("Wheel speeds vary once per turn, too little to be worth naming: by 0.09% (front left wheel).")
    assert len(remarks([PerTurn(w, 1, "ring", 9e-4, 8e-4, 1e-3, 1e-9) for w in WHEELS])) == 1


def test_a_second_order_is_no_tone_ring():
    results = tuple(found(drive(uneven={"fl": ring(2e-3, 2)})).values())
    assert to_causes(results) == ()
    (form,) = odd_wheels(results)
    assert "wheel FL, varying twice per turn by 0.2" in form.sentence
    assert remarks(results) == ()


def test_causes_by_wheel_axle_and_side():
    def answer(wheel, amplitude):
        return PerTurn(wheel, 1, "ring", amplitude, amplitude - 1e-4, amplitude + 1e-4, 1e-9)

    one = to_causes([answer("fl", 3e-3)])
    assert [(c.effect, c.where, c.explains) for c in one] == [("tone_ring", "fl", ("omega_fl",))]
    assert one[0].parameters["amplitude"].value == pytest.approx(3e-3)
    assert one[0].sentence == ("The tone ring (front left wheel) is uneven by 0.30%; 95 % interval 0.27 to 0.33 %.")
    assert [c.where for c in to_causes([answer("fl", 3e-3), answer("fr", 3.1e-3)])] == ["f"]
    assert [c.where for c in to_causes([answer("fl", 3e-3), answer("rl", 3e-3)])] == ["left"]
    assert {c.where for c in to_causes([answer("fl", 3e-3), answer("fr", 2.5e-3)])} == {"fl", "fr"}
    assert to_causes([answer("fl", 1e-3)]) == ()
    assert "too little to be worth naming" in remarks([answer("fl", 1e-3)])[0]
    assert "runs out of true" in remarks([answer("fl", 3e-3)])[-1]


def test_a_line_between_samples_takes_what_is_put_back():
    columns = drive(uneven={"fl": ring(2e-3)}, low=25.0, high=35.0)
    halfway = {n: 0.5 * (x[1:] + x[:-1]) for n, x in columns.items()}
    assert found(halfway)["fl", 1].high < 2e-3
    known = found(halfway, of={n: replace(o, between=0.25) for n, o in origins().items()})["fl", 1]
    assert known.low <= 2e-3 <= known.high


def test_half_a_second_of_a_drive_of_five_minutes():
    columns = drive(duration=300.0)
    found(columns)
    start = time.process_time()
    found(columns)
    assert time.process_time() - start < 0.5


@pytest.mark.parametrize(("hidden", "noise"), [("f", "pink"), (None, "quantised")])
def test_in_another_simulator(hidden, noise):
    inside = (Hidden("tone_ring", hidden, {"amplitude": 0.003}),) if hidden else ()
    case = make_case(Spec("mixed", noise, inside, 7, holdout=0, duration_s=120.0))
    signals = case.drives[0][1]
    results = per_turn(wheel_columns(signals), signals.dt, signals.origins)
    assert [c.where for c in to_causes(results)] == ([hidden] if hidden else [])
    assert {(r.wheel, r.order) for r in results if r.found} == ({("fl", 1), ("fr", 1)} if hidden else set())
    for r in results:
        assert not r.found or r.low <= 0.003 <= r.high


@pytest.mark.real
def test_four_measured_wheels_agree_on_their_turn(real_logs):
    """All orders of all wheels at one and the same angle per turn: that is no chance."""
    folder, here = real_logs / "toyota_rav4", Path(__file__).parents[1] / "real"
    car = load_vehicle(here / "toyota.toml")
    signals = load_signals(
        [folder / "can_bus.mf4"], vehicle=car, signal_map=load_signal_map(here / "toyota_map.toml"),
        dbc=[folder / "toyota_2017.dbc"],
    )  # fmt: skip
    results = per_turn(wheel_columns(signals), signals.dt, signals.origins)
    seen = [r for r in results if r.found]
    assert {r.wheel for r in seen if r.order == 1} == set(WHEELS)
    assert all(5e-4 < r.amplitude < 1.5e-3 for r in seen if r.order == 1)
