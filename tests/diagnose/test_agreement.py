"""Several drives: each is asked by itself, and predicted from the others."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose.agreement import contradicted, widened
from aqualog.diagnose.alone import with_each
from aqualog.diagnose.records import Agreement, ByDrive, Cause, Diagnosis, Estimate
from aqualog.diagnose.run import Options, diagnose
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, term
from tests.diagnose.test_run import few, noisy  # noqa: F401 - `few` is a fixture

OPTIONS = Options(surrogates=0, views=False, consequences=False)


def drives(*loads):
    return [
        (f"drive {i}", noisy(*((term("payload_mass", delta_mass=x),) if x else ()), seed=3 + i))
        for i, x in enumerate(loads)
    ]


def width(d):
    e = next(iter(d.causes[0].parameters.values()))
    return e.high - e.low


@pytest.mark.nightly
def test_drives_with_the_same_load_agree_and_those_with_different_ones_have_a_wide_interval():
    alike = diagnose(drives(250.0, 250.0), CAR, options=OPTIONS)
    (found,) = alike.agreement
    assert found.key == "payload_mass"
    assert found.holds
    assert found.p_value > 0.01
    for d in found.drives:
        assert d.alone.low < 250.0 < d.alone.high
        assert d.gain > 10.0
    a, b = found.drives
    assert (a.others, b.others) == pytest.approx((b.alone.value, a.alone.value), rel=0.02)

    unlike = diagnose(drives(260.0, 140.0), CAR, options=OPTIONS)
    found = next(a for a in unlike.agreement if a.key.startswith("payload_mass"))
    assert found.p_value < 1e-6
    assert not found.holds
    assert width(unlike) > 3.0 * width(alike)
    assert f"{next(iter(unlike.causes[0].parameters.values())).high:.3g} kg" in unlike.sentence


def test_intervals_stay_where_drives_agree_and_grow_by_birges_ratio_where_not():
    cause = Cause("payload_mass", None, {"delta_mass": Estimate(100.0, 90.0, 110.0, "kg")}, (), "")

    def of(*values):
        return tuple(ByDrive(str(v), Estimate(v, v - 9.0, v + 9.0, "kg"), 100.0, 5.0) for v in values)

    assert widened(cause, [Agreement("payload_mass", "delta_mass", of(95.0, 105.0), 0.4)]) == cause
    wide = widened(cause, [Agreement("payload_mass", "delta_mass", of(70.0, 130.0), 1e-5)]).parameters["delta_mass"]
    ratio = 2.0**0.5 * 30.0 / (9.0 / 1.959964)
    assert (wide.low, wide.high) == pytest.approx((100.0 - 10.0 * ratio, 100.0 + 10.0 * ratio), rel=1e-6)


def of_drives(*values):
    return tuple(
        ByDrive(f"drive {n}", Estimate(v, v - 9.0, v + 9.0, "kg"), 100.0, 5.0)
        for n, v in zip("ABC", values, strict=True)
    )


def test_a_load_of_one_drive_has_the_value_of_that_drive_and_names_it():
    cause = Cause("payload_mass", None, {"delta_mass": Estimate(60.0, 50.0, 70.0, "kg")}, (), "")
    one = widened(cause, [Agreement("payload_mass", "delta_mass", of_drives(2.0, 180.0, -3.0), 1e-9)])
    e = one.parameters["delta_mass"]
    assert (e.value, e.low, e.high) == pytest.approx((180.0, 171.0, 189.0))
    assert one.sentence.endswith("In drive B only.")
    two = widened(cause, [Agreement("payload_mass", "delta_mass", of_drives(2.0, 180.0, 100.0), 1e-9)])
    assert two.parameters["delta_mass"].value == pytest.approx(140.0)
    assert two.sentence.endswith("In drive B and drive C only.")
    every = widened(cause, [Agreement("payload_mass", "delta_mass", of_drives(60.0, 180.0, 100.0), 1e-9)])
    assert "only" not in every.sentence


def test_what_belongs_to_the_car_is_in_all_drives():
    cause = Cause("aero_drag", None, {"delta_drag_area": Estimate(60.0, 50.0, 70.0, "m^2")}, (), "")
    found = widened(cause, [Agreement("aero_drag", "delta_drag_area", of_drives(2.0, 180.0, -3.0), 1e-9)])
    assert "only" not in found.sentence


def test_a_load_of_one_drive_is_named_with_the_drive():
    """A third of it in all three is what no drive confirms."""
    d = diagnose(drives(0.0, 200.0, 0.0), CAR, options=replace(OPTIONS, surrogates=9, views=True))
    assert (d.verdict, [c.key for c in d.causes]) == ("named", ["payload_mass"])
    assert d.sentence.endswith("In drive 1 only.")
    assert d.causes[0].parameters["delta_mass"].value == pytest.approx(200.0, abs=40.0)
    assert any(n.startswith("drive 1 by itself: The car weighed") for n in d.notes)
    first = next(v for v in d.views if v.channel == "force_balance")
    assert first.drive == "drive 1"  # its pictures come first, with what the load explains
    assert np.nanstd(first.after) < 0.9 * np.nanstd(first.before)
    assert {v.drive for v in d.views} == {"drive 0", "drive 1", "drive 2"}


def test_drives_that_share_an_effect_have_one_cause_with_their_mean():
    def own(value, name):
        estimate = Estimate(value, value - 2.0, value + 2.0, "m/s")
        unsure = Estimate(3.0, np.nan, np.nan, "s")
        cause = Cause("head_wind", None, {"speed": estimate, "begin": unsure}, (), "A head wind blew.", 0.96)
        return replace(nothing, verdict="named", causes=(cause,), drives=(name,), sentence=cause.sentence)

    nothing = Diagnosis("no_effect", "No effect.", ("a", "b", "c"), 300.0, 300.0, Model(), ())
    found = with_each(nothing, {"a": own(8.0, "a"), "b": nothing, "c": own(10.0, "c")}, 0.01)
    (cause,) = found.causes
    speed = cause.parameters["speed"]
    assert (speed.value, speed.high - speed.low, cause.parameters["begin"].value) == pytest.approx((9.0, 8.0**0.5, 3.0))
    assert cause.sentence.endswith("In a and c only.")
    radius = Cause("tyre_radius", "fl", {"delta": Estimate(0.01, 0.009, 0.011, "-")}, (), "The tyre is larger.", 0.97)
    larger = replace(nothing, verdict="named", causes=(radius,), sentence="It is larger.")
    assert with_each(nothing, {"a": larger}, 0.01) == replace(nothing, notes=("a by itself: It is larger.",))


def test_what_only_some_drives_have_contradicts_a_name_of_the_car():
    cause = Cause("tyre_radius", None, {"delta": Estimate(-0.006, -0.014, 0.002, "-")}, (), "")
    differ = Agreement("tyre_radius", "delta", of_drives(0.0, -12.0, 1.0), 1e-9)
    assert contradicted([cause], [differ])
    assert not contradicted([cause], [replace(differ, p_value=0.4)])
    assert not contradicted([replace(cause, parameters={"delta": Estimate(-6e-3, -9e-3, -3e-3, "-")})], [differ])
