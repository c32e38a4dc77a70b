"""Jumps of one signal's clock: found with time, size and signal; not in gear shifts, drifting clocks, noise."""

import time

import numpy as np
import polars as pl
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.records import Quality, Signals
from aqualog.diagnose.seams import Seam, seams
from tests.blind.world.cases import CARS, Spec, make_case

CAR = CARS["sedan_rwd"]
DT = FINE = 0.01


def clocks(t, *, late=0.0, jump=(0.0, 0.0), skew=0.0):
    """When the value was true that a log has at t: `jump` is (time, by how much it comes later from there on)."""
    return t * (1.0 - skew) - late - np.where(t >= jump[0], jump[1], 0.0)


def drive(seed=1, *, duration=240.0, lively=1.0, shifts=False, leave=(), **of):
    """A log of accelerations; `of`: clock of a source. `shifts`: the torque is gone for 0.4 s every 9 s."""
    rng = np.random.default_rng(seed)
    grid = np.arange(round((duration + 4.0) / FINE)) * FINE
    a = np.zeros(grid.size)
    for _ in range(round(duration / 3.0)):
        at, width = rng.uniform(0.0, duration), rng.uniform(0.4, 1.5)
        a += lively * rng.uniform(-2.0, 2.0) * np.exp(-(((grid - at) / width) ** 2))
    v = 25.0 + np.cumsum(a - a.mean()) * FINE
    pull = CAR.mass * (a - a.mean()) * (0.8 + 0.4 * (grid > duration / 2.0))  # another gear, another gain
    if shifts:
        gone = (grid % 9.0) < 0.4
        pull = np.where(gone, 0.0, pull)
        a = np.where(gone, 0.3 * a, a)
        v = 25.0 + np.cumsum(a - a.mean()) * FINE
    t = np.arange(round(duration / DT)) * DT

    def seen(x, source, sigma):
        clock = clocks(t, **of.get(source, {}))
        return np.interp(clock, grid, x) + sigma * rng.standard_normal(t.size)

    columns = {"a_x": seen(a, "a_x", 0.08), "v_x": seen(v, "v_x", 0.03)}
    for w in WHEELS:
        columns[f"omega_{w}"] = seen(v, "omega", 0.01) / CAR.r_e(w)
    for w in CAR.driven:
        columns[f"torque_{w}"] = seen(0.5 * pull * CAR.arm(w), "torque", 5.0)
    kept = {n: x for n, x in columns.items() if n.split("_")[0] not in leave and n not in leave}
    frame = pl.DataFrame({"t": t, **kept}).with_columns(pl.all().fill_nan(None))
    return Signals(frame, round(DT * 1e9), None, {}, Quality(), ("log",))


@pytest.mark.parametrize(
    ("source", "at", "size"),
    [("a_x", 100.0, 0.1), ("omega", 160.0, -0.2), ("v_x", 60.0, 0.4), ("torque", 120.0, -0.08)],
)
def test_a_jump_is_found_with_time_size_and_signal(source, at, size):
    found = seams(drive(**{source: {"jump": (at, size)}}), CAR)
    assert [f.signals for f in found] == [(source,)]
    assert found[0].t == pytest.approx(at, abs=6.0)
    assert found[0].size == pytest.approx(size, abs=0.02)
    assert found[0].p_value < 0.01


def test_two_jumps():
    found = seams(drive(duration=400.0, a_x={"jump": (110.0, 0.2)}, v_x={"jump": (280.0, -0.3)}), CAR)
    assert [f.signals for f in found] == [("a_x",), ("v_x",)]
    assert [f.size for f in found] == pytest.approx([0.2, -0.3], abs=0.03)


def test_two_sources_do_not_say_which():
    found = seams(drive(leave=("v_x", "torque"), a_x={"jump": (100.0, 0.2)}), CAR)
    assert [f.signals for f in found] == [("a_x", "omega")]
    assert found[0].size == pytest.approx(0.2, abs=0.02)
    assert "a_x comes 0.20 s later against omega" in found[0].sentence


@pytest.mark.parametrize(
    "of", [{}, {"v_x": {"late": 0.3}}, {"a_x": {"skew": 8e-4}}, {"torque": {"late": -0.1, "skew": -1e-3}}]
)
def test_delays_and_drifting_clocks_are_no_seams(of):
    assert not any(seams(drive(seed, **of), CAR) for seed in range(5))


def test_gear_shifts_are_no_seams():
    assert not any(seams(drive(seed, shifts=True), CAR) for seed in range(5))
    found = seams(drive(2, shifts=True, torque={"jump": (130.0, 0.2)}), CAR)
    assert [f.signals for f in found] == [("torque",)]


def test_a_drive_without_motion_shows_nothing():
    assert seams(drive(lively=0.01, a_x={"jump": (100.0, 0.3)}), CAR) == ()
    assert seams(drive(duration=40.0, a_x={"jump": (20.0, 0.3)}), CAR) == ()
    assert seams(drive(leave=("a_x", "v_x", "torque")), CAR) == ()


def test_gaps_do_not_matter():
    signals = drive(omega={"jump": (120.0, 0.15)})
    lost = (pl.col("t") > 50.0) & (pl.col("t") < 61.0)
    names = [c for c in signals.frame.columns if c != "t"]
    frame = signals.frame.with_columns(pl.when(lost).then(None).otherwise(pl.col(n)).alias(n) for n in names)
    found = seams(Signals(frame, signals.dt_ns, None, {}, Quality(), ("log",)), CAR)
    assert [f.signals for f in found] == [("omega",)]


def test_sentence():
    assert Seam(81.3, -0.25, ("v_x",), 1e-6).sentence == "From 81 s on, v_x comes 0.25 s earlier: a seam of the log."


def test_cost():
    signals = drive(duration=300.0)
    seams(signals, CAR)
    start = time.process_time()
    seams(signals, CAR)
    assert time.process_time() - start < 0.5


def test_another_simulator_has_no_seam():
    """An all-wheel drive: the tyres' own delay changes by 0.04 s with the driving."""
    case = make_case(Spec("mixed", "gusts", (), 100, "suv_awd", holdout=0))
    assert seams(case.drives[0][1], case.vehicle) == ()
