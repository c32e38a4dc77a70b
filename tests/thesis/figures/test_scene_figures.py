"""Figures of chapter 2: what is known before the wet drive, what is read off it, and verdicts that follow the runs."""

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.detect.stream import detect_drive
from aqualog.model.log import as_signals
from aqualog.model.programme import scene
from aqualog.model.simulate import simulate
from aqualog.thesis.claims import DIFFERENCE, NOT_REPRODUCED, REPRODUCED
from aqualog.thesis.evidence import scenes
from aqualog.thesis.evidence.scenes import SEEDS, in_runs, known, run, spread, stretches
from aqualog.thesis.figures import joint, panels, tie_rods, wheel_spins
from tests.thesis.made import check, made

NAN = float("nan")


@pytest.fixture(scope="module")
def one():
    return run("2.25", SEEDS[0])


def test_what_is_known_of_the_car_comes_from_dry_roads_only(monkeypatch):
    driven = []
    monkeypatch.setattr(scenes, "simulate", lambda s: driven.append(s) or simulate(s))
    car = known.__wrapped__("2.23")
    assert len(driven) == 2
    assert all(s.lanes == () and s.seed not in SEEDS for s in driven)
    assert {s.vehicle.name for s in driven} == {scene("2.23").vehicle.name}
    assert car.explained > 0.9
    assert set(car.vehicle.tie_rod) == {"c0", "c_y", "c_x", "sigma"}
    assert car.memory.history.of(car.vehicle.name, "right")


def test_the_dry_slalom_tells_the_longitudinal_coefficient():
    # a driven front wheel pulls at its rod by hub offset over arm, 0.4
    assert known("2.22").vehicle.tie_rod["c_x"][0] == pytest.approx(-0.4, abs=0.15)


def test_words_and_stretches(one):
    assert in_runs(0.85) == "17 of 20"
    assert spread([1.0, 3.0, NAN, 2.0]) == "2.00 (1.00 to 3.00), 1 without"
    assert spread([NAN]) == "never"
    bits = np.zeros(one.t.size, dtype=bool)
    assert stretches(one, bits) == []
    bits[[10, 11, 14, 30]] = True
    assert stretches(one, bits) == [slice(10, 15), slice(30, 31)]
    assert stretches(one, bits, gap_s=0.01) == [slice(10, 12), slice(14, 15), slice(30, 31)]


def test_times_after_the_entry_begin_on_the_lane(one):
    t = one.t
    assert one.after_entry(t > 24.995) == pytest.approx(1.0)
    assert one.after_entry(t < 30.0) == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(one.after_entry(t < 24.0 - 1e-6))
    assert np.isnan(one.after_entry(t > 30.0 - 1e-6))


def test_latencies_of_figure_2_25_by_hand():
    car = known("2.25")
    signals = as_signals(simulate(replace(scene("2.25"), seed=SEEDS[0])), vehicle=car.vehicle, truth=False)
    features = detect_drive(signals, car.vehicle, memory=car.memory).features
    t = signals.array("t")
    row = made("2.25").tables[0].rows[0]
    for k, cell in ((2, row[1]), (4, row[2]), (1, row[3]), (5, row[4])):
        met = t[(features[f"criterion_{k}"].to_numpy() > 0.5) & (t > 24.0 - 1e-9)]
        assert cell == f"{met[0] - 24.0:.2f}", k


def test_what_is_drawn_is_the_first_run(one):
    table = made("2.25").panels[0]
    fr = next(line for line in table.lines if line.name == "front right")
    assert (fr.x[0], fr.x[-1]) == pytest.approx((22.0, 31.99))
    at = np.searchsorted(one.t, fr.x)
    np.testing.assert_array_equal(fr.y, one.feature("v_w_fr")[at])


def times_of(monkeypatch, some):
    """Verdicts of 2.25 with made-up times; `some`: run number -> Times."""
    all_runs = scenes.runs("2.25")
    number = {r.seed: i for i, r in enumerate(all_runs)}
    monkeypatch.setattr(joint, "_times", lambda r: some(number[r.seed]))
    return {c.name: c.verdict for c in joint.figure_2_25().checks}


def test_verdicts_of_figure_2_25_follow_the_times(monkeypatch):
    good = joint.Times(one=2.0, two=0.4, four=1.5, five=2.5, rise=0.5, cross=1.0)
    found = times_of(monkeypatch, lambda i: good)
    assert (found["C73"], found["C75"], found["C76"]) == (REPRODUCED, REPRODUCED, REPRODUCED)
    swapped = times_of(monkeypatch, lambda i: good._replace(five=1.4))
    assert swapped["C76"] == DIFFERENCE
    late = times_of(monkeypatch, lambda i: good._replace(two=1.6, five=3.5, rise=2.0))
    assert late["C75"] == REPRODUCED
    assert {late[c] for c in ("C73", "C76", "C77")} == {NOT_REPRODUCED}
    mixed = times_of(monkeypatch, lambda i: good._replace(two=0.4 if i < 15 else 0.9))
    assert mixed["C73"] == DIFFERENCE


def test_criteria_that_are_never_met_are_told_and_not_a_crash(monkeypatch):
    never = joint.Times(*[NAN] * 6)
    found = times_of(monkeypatch, lambda i: never)
    assert {found[c] for c in ("C73", "C74", "C75", "C76", "C77")} == {NOT_REPRODUCED}
    assert all(c.value is None or np.isfinite(c.value) for c in joint.figure_2_25().checks)


@pytest.mark.parametrize(
    ("down", "up", "early", "verdict"),
    [
        (20, 16, 0, REPRODUCED),
        (20, 16, 1, DIFFERENCE),
        (20, 3, 0, DIFFERENCE),
        (12, 12, 0, DIFFERENCE),
        (12, 3, 0, NOT_REPRODUCED),
    ],
)
def test_verdict_of_figure_2_8(monkeypatch, down, up, early, verdict):
    first = {("spin_down", "fr"): down, ("spin_up", "rr"): up}
    monkeypatch.setattr(wheel_spins, "_first", lambda r, d, w: 0.3 if r.seed - SEEDS[0] < first[d, w] else NAN)
    monkeypatch.setattr(wheel_spins, "_is_early", lambda r: r.seed - SEEDS[0] < early)
    assert wheel_spins._c28([SimpleNamespace(seed=s) for s in SEEDS])[0].verdict == verdict


@pytest.mark.parametrize(
    ("number", "part", "claim"),
    [("2.21", "_rises", "C61"), ("2.22", "_is_course", "C62 (course)"), ("2.23", "_explained", "C59")],
)
def test_verdicts_of_tie_rods_follow_the_runs(monkeypatch, number, part, claim):
    few = lru_cache(scenes.runs.__wrapped__)
    for module, name, value in ((scenes, "SEEDS", SEEDS[:6]), (scenes, "runs", few), (panels, "runs", few)):
        monkeypatch.setattr(module, name, value)
    assert found(number, claim).value > 0.0
    monkeypatch.setattr(tie_rods, part, lambda r: 0.0)
    assert found(number, claim).value == 0.0
    assert found(number, claim).verdict != REPRODUCED


def found(number, claim):
    return next(c for c in tie_rods.FIGURES[number]().checks if c.name == claim)


def test_shares_of_dips_by_hand():
    """The variance finds what the CUSUM of large spin-downs misses."""
    c29 = check("2.9", "C29")
    all_runs = scenes.runs("2.9")
    hit = total = 0
    for r in all_runs:
        slip, bits = r.signal("true_slip_fr"), r.active("minor_spin_down", "fr")
        for s in wheel_spins.dips(r):
            assert -0.10 < slip[s].min() < -0.015
            total += 1
            hit += bits[s.start : s.stop + 30].any()
    assert c29.value == pytest.approx(hit / total)
    assert c29.verdict == REPRODUCED
