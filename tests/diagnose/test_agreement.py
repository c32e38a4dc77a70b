"""Several drives: each is asked by itself, and predicted from the others."""

import pytest

from aqualog.diagnose.agreement import widened
from aqualog.diagnose.records import Agreement, ByDrive, Cause, Estimate
from aqualog.diagnose.run import Options, diagnose
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
