"""An IMU that is mounted turned: its axes by gravity and by the speed."""

import numpy as np
import pytest

from aqualog.align.propose import look_at
from tests.align.test_evidence import YAW, A, V, channel, positions, wheels

G = 9.80665
OF_CAR = {"forward": A, "left": V * YAW, "up": np.full(V.size, G)}
TURNS = {"forward": 0.0 * YAW, "left": 0.0 * YAW, "up": YAW}
# the sensor's x, y, z: right-handed
MOUNTED = [
    ("up", "-forward", "-left"), ("up", "left", "-forward"), ("-up", "forward", "-left"), ("forward", "up", "-left"),
    ("left", "-up", "-forward"),
]  # fmt: skip


def axis(of, name):
    return (-1.0 if name.startswith("-") else 1.0) * of[name.removeprefix("-")]


def imu(mounted, moves=1.0):
    # what is level has a little noise of its own, as a road has
    noise = np.random.default_rng(5).standard_normal((6, V.size))
    scaled = {**OF_CAR, "forward": moves * A}
    acceleration = [
        channel(f"imu.Acc{a}", axis(scaled, n) + 0.05 * e, "m/s^2")
        for a, n, e in zip("XYZ", mounted, noise, strict=False)
    ]
    rates = [
        channel(f"imu.Rate{a}", axis(TURNS, n) + 0.002 * e, "rad/s")
        for a, n, e in zip("XYZ", mounted, noise[3:], strict=True)
    ]
    return [*acceleration, *rates]


@pytest.mark.parametrize("mounted", MOUNTED)
def test_axes_are_found_with_their_signs(mounted):
    found = look_at([*wheels(1 / 3.6), *positions(), *imu(mounted)]).proposals
    for symbol, kind, name in (("a_x", "Acc", "forward"), ("a_y", "Acc", "left"), ("yaw_rate", "Rate", "up")):
        (place,) = (a for a, n in zip("XYZ", mounted, strict=True) if n.removeprefix("-") == name)
        sign = -1.0 if f"-{name}" in mounted else 1.0
        assert found[symbol].entry.channel == (f"imu.{kind}{place}",), symbol
        assert found[symbol].entry.scale == sign, symbol
        assert "up" in found[symbol].reason


def test_where_the_speed_does_not_show_what_is_ahead_nothing_is_proposed():
    others = [*wheels(1 / 3.6), *positions()]
    assert not {"a_x", "a_y", "yaw_rate"} & set(look_at([*others, *imu(MOUNTED[0], moves=0.0)]).proposals)
    assert not {"a_x", "a_y", "yaw_rate"} & set(look_at(imu(MOUNTED[0])).proposals)
