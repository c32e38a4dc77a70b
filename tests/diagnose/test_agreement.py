"""Several drives: each is asked by itself, and predicted from the others."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose.outcome import contradicted, widened
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
def test_drives_with_the_same_load_agree_and_those_with_different_ones_have_their_own():
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
    assert unlike.verdict == "compound"
    assert not unlike.agreement
    own = {c.drives: c.parameters["delta_mass"] for c in unlike.causes if c.key == "payload_mass"}
    assert set(own) == {("drive 0",), ("drive 1",)}
    assert own["drive 0",].low < 260.0 < own["drive 0",].high
    assert own["drive 1",].low < 140.0 < own["drive 1",].high


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


def test_a_load_of_one_drive_is_named_with_the_drive():
    """A third of it in all three is what no drive confirms."""
    d = diagnose(drives(0.0, 200.0, 0.0), CAR, options=replace(OPTIONS, surrogates=9, views=True))
    assert (d.verdict, [c.key for c in d.causes]) == ("named", ["payload_mass"])
    assert d.sentence.endswith("In drive 1 only.")
    assert d.causes[0].parameters["delta_mass"].value == pytest.approx(200.0, abs=40.0)
    speed = next(c for c in d.gain.channels if c.channel == "speed")
    assert speed.free_after < 1.01 * speed.free_before  # the others drive without it
    assert {"pressure_loss@fl", "payload_mass"} <= {f"{x.effect}@{x.where}".removesuffix("@None") for x in d.limits}
    first = next(v for v in d.views if v.channel == "force_balance")
    assert first.drive == "drive 1"  # its pictures come first, with what the load explains
    assert np.nanstd(first.after) < 0.9 * np.nanstd(first.before)
    assert {v.drive for v in d.views} == {"drive 0", "drive 1", "drive 2"}


def test_what_only_some_drives_have_contradicts_a_name_of_the_car():
    cause = Cause("tyre_radius", None, {"delta": Estimate(-0.006, -0.014, 0.002, "-")}, (), "")
    differ = Agreement("tyre_radius", "delta", of_drives(0.0, -12.0, 1.0), 1e-9)
    assert contradicted([cause], [differ])
    assert not contradicted([cause], [replace(differ, p_value=0.4)])
    assert not contradicted([replace(cause, parameters={"delta": Estimate(-6e-3, -9e-3, -3e-3, "-")})], [differ])
