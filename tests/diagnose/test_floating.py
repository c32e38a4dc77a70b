"""Where a wheel floats or may float nothing is judged; the rest of the water is."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np

from aqualog.diagnose.channels import centre_line_speeds
from aqualog.diagnose.drive import BEYOND_GRIP, prepare
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.inputs import brakes_unlogged
from aqualog.model.scenario import Lane
from aqualog.model.sensors import IDEAL
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, changed, signals

SPEED = ((0.0, 22.0), (28.0, 22.0), (32.0, 34.0), (44.0, 34.0), (52.0, 20.0))
LANES = tuple(Lane(t, t + 6.0, in_metres=False, depth_left=1.5e-3, depth_right=1.7e-3) for t in (8.0, 18.0, 36.0, 60.0))


def wet(*terms, sensors=IDEAL, lanes=LANES):
    return signals(*terms, speed=SPEED, lanes=lanes, sensors=sensors)


def test_where_a_wheel_floats_nothing_is_judged_and_the_rest_of_the_water_is():
    log = wet()
    d = prepare(log, CAR, "a")
    v = np.maximum(log.array("v_x"), 4.0)
    slip = np.abs(centre_line_speeds({s: log.array(s) for s in log.symbols}, CAR) / v - 1.0).max(axis=0)
    beyond = slip.reshape(-1, 10).max(axis=1) > BEYOND_GRIP
    assert beyond.any()
    assert not d.mask[beyond].any()
    slow = (d.coordinates["water_depth"] > 0.0) & (d.coordinates["t"] < 25.0)
    assert d.mask[slow].all()


def test_a_wheel_that_only_the_simulation_lets_float_is_left_out_too():
    dry = signals(speed=SPEED)
    frame = dry.frame.with_columns(wet().frame.select("water_depth_left", "water_depth_right"))
    d = prepare(changed(dry, frame), CAR, "a")
    assert not d.mask[370:410].any()
    assert d.mask[90:130].all()


def test_water_is_no_brake_that_is_not_logged():
    """It slows a car that rolls as a brake does."""
    log = changed(wet(), wet().frame.drop("brake_pressure", strict=False))
    on_water = log.array("water_depth_left") > 0.0
    v = np.where(on_water, 40.0 - 2.0 * (np.arange(on_water.size) * log.dt % 5.0), 30.0)
    still = np.zeros((4, v.size))
    assert brakes_unlogged(still, v, np.zeros(v.size, dtype=bool), CAR, log.dt)
    with patch("aqualog.diagnose.inputs.brakes_unlogged", side_effect=lambda _t, _v, wet, *_: seen.append(wet)):
        seen: list[np.ndarray] = []
        prepare(log, CAR, "a")
    assert not brakes_unlogged(still, v, seen[0], CAR, log.dt)


def test_water_that_is_hardly_judged_is_said():
    """Without the note, no effect on such water reads as if it had been looked at."""
    deep = tuple(replace(x, depth_left=4e-3, depth_right=4e-3) for x in LANES)
    (note,) = (n for n in prepare(wet(lanes=deep), CAR, "a").notes if "on water" in n)
    assert note.startswith("of 24 s on water 0 s are judged")
    asked, untested = hypotheses([prepare(wet(lanes=deep), CAR, "a")], Model())
    assert untested["contact_loss"] == untested["water_drag"] == "no time on water is judged"
    assert not {"contact_loss", "water_drag"} & {h.effect.name for h in asked}
    shallow = tuple(replace(x, depth_left=3e-4, depth_right=3e-4) for x in LANES)
    assert not any("on water" in n for n in prepare(wet(lanes=shallow), CAR, "a").notes)
    assert "contact_loss" not in hypotheses([prepare(wet(lanes=shallow), CAR, "a")], Model())[1]
