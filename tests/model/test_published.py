"""Published figures of aquaplaning as data, and the simulator's value for each."""

import copy
import tomllib
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from aqualog.book.sources import register
from aqualog.core.errors import ConfigError
from aqualog.model import published
from aqualog.model.programme import SEDAN
from aqualog.model.published import CRITERIA, V_MOST, Condition, compared, full_speed, points, rms, tyre_of
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import simulate
from aqualog.model.tyre import Tyre

RAW = tomllib.loads(files("aqualog.model").joinpath("published.toml").read_text(encoding="utf-8"))


def first(**changed):
    """The file with its first point changed; None takes a key away."""
    raw = copy.deepcopy(RAW)
    for key, value in changed.items():
        if value is None:
            del raw["point"][0][key]
        else:
            raw["point"][0][key] = value
    return raw


def test_every_point_names_a_source_that_is_registered():
    assert len(points()) >= 30
    assert {p.source for p in points()} <= set(register().sources)
    assert {p.mark for p in points()} == {"L", "V", "K"}
    assert {p.quantity for p in points()} == set(published.QUANTITIES)


@pytest.mark.parametrize(
    ("changed", "says"),
    [({"source": None}, "point thesis-1.3: source is missing"), ({"depht": 1.3}, "unknown key depht"),
     ({"depth": "1.3"}, "depth = '1.3' is no number"), ({"pressure": 190.0}, "pressure = 190 is out of bounds"),
     ({"mark": "X"}, 'mark = "X"'), ({"low": 130}, "low 130, high 118"), ({"tolerance": 0}, "tolerance 0"),
     ({"criterion": "floats"}, 'criterion "floats"'), ({"speed": 90}, "speed is given"),
     ({"quantity": "drag", "criterion": ""}, "speed is missing"), ({"over": {"depth": 1.0}}, "over"),
     ({"assumed": ["colour"]}, "assumed colour"), ({"id": "thesis-0.8"}, "points of the same id: thesis-0.8")],
)  # fmt: skip
def test_a_fault_of_the_file_names_point_and_key(changed, says):
    with pytest.raises(ConfigError) as error:
        published.read(first(**changed))
    assert says in f"{error.value.where.replace('published.toml, ', '')}: {error.value}"


def test_a_deviation_is_the_distance_from_the_published_range():
    point = next(p for p in points() if p.low < p.high)
    assert point.deviation(point.low - 3.0) == pytest.approx(-3.0)
    assert point.deviation(0.5 * (point.low + point.high)) == 0.0
    assert point.deviation(point.high + 2.0) == pytest.approx(2.0)
    rows = compared(among=(point,))
    assert rms(rows) == pytest.approx(abs(rows[0].deviation))
    assert rms(rows, scaled=True) == pytest.approx(abs(rows[0].deviation) / point.tolerance)


@pytest.mark.parametrize("depth", [0.6, 1.3, 3.0, 8.0])
def test_a_tyre_floats_by_no_criterion_later_than_its_contact_ends(depth):
    at = Condition(depth, 1.6, 1.9, 4000.0)
    contact, *rest = (full_speed(tyre_of(at), at, c) for c in ("contact", "spin-down", "15 % slip"))
    assert all(0.5 * contact < v <= contact for v in rest)
    harder = replace(at, pressure=2.4)
    assert all(full_speed(tyre_of(harder), harder, c) > full_speed(tyre_of(at), at, c) for c in CRITERIA)


def test_every_point_is_within_its_tolerance_or_has_a_reason():
    lacking = [r.point.id for r in compared() if not r.is_inside and not r.point.reason]
    assert lacking == []
    needless = [r.point.id for r in compared() if r.is_inside and r.point.reason]
    assert needless == []


def test_new_tyres_float_later_in_deep_water():
    """12 to 20 km/h in 5 to 8 mm, as tyre tests have it."""
    for depth in (5.0, 6.5, 8.0):
        worn, new = (Condition(depth, tread, 1.9, 4000.0) for tread in (1.6, 7.8))
        for criterion in CRITERIA:
            gain = full_speed(tyre_of(new), new, criterion) - full_speed(tyre_of(worn), worn, criterion)
            assert 12.0 <= gain <= 20.0


def test_a_tyre_that_never_floats_counts_as_the_highest_speed():
    at = Condition(0.01, 9.0, 3.0, 4000.0)
    assert full_speed(tyre_of(at), at, "spin-down") == V_MOST


def test_every_point_has_a_finite_value_that_follows_the_tyre():
    assert all(np.isfinite(row.value) for row in compared())
    later = replace(Tyre(), v_anchor=Tyre().v_anchor * 1.1)
    for before, after in zip(compared(), compared(later), strict=True):
        if before.point.quantity == "full_speed" and before.value < 150.0:
            assert after.value > before.value


@pytest.mark.parametrize("depth", [1.3, 3.0])
def test_the_balance_is_that_of_the_simulation(depth):
    """A free wheel of a car that gets slowly faster on even water stops at the speed of `spin-down`."""
    at = Condition(depth, 1.6, 1.9, 4000.0)
    v = full_speed(tyre_of(at), at, "spin-down") / 3.6
    h_w = depth * 1e-3
    lane = Lane(2.0, 100.0, depth_left=h_w, depth_right=h_w, irregularity_left=0.0, irregularity_right=0.0)
    speed = ((0.0, v - 4.0), (2.0, v - 4.0), (18.0, v + 4.0))
    drive = Scenario(SEDAN, duration_s=20.0, speed=speed, lanes=(lane,), water_scatter=0.0, sensors=IDEAL)
    truth = simulate(drive).truth
    c = truth.columns
    slow = np.flatnonzero((c["true_slip_fl"] < -0.3) & (truth.t > 2.5))
    load = float(np.mean(c["true_load_fl"]))
    same_load = replace(at, load=load)
    expected = full_speed(tyre_of(same_load), same_load, "spin-down")
    assert c["v_x"][slow[0]] * 3.6 == pytest.approx(expected, abs=2.0)
