"""Which part of a drive was not judged, and for want of what."""

import numpy as np
import pytest

from aqualog.detect.verdict import Unjudged


def noted(cuts=(), *, n=2400):
    """Front wheels without values from 8.5 to 11.5 s, a lost moment, and a second in which the car stands."""
    x = {s: np.ones(n) for s in ("omega_fl", "omega_fr", "omega_rl", "a_x", "v_x")}
    x["omega_fl"][850:1150] = x["omega_fr"][850:1150] = x["v_x"][850:1150] = np.nan
    x["a_x"][1500:1505] = np.nan
    judged = np.ones(n, dtype=bool)
    judged[850:1152] = judged[1500:1505] = judged[2000:2100] = False
    found = Unjudged(0.01)
    for piece in np.split(np.arange(n), cuts):
        found.push({s: v[piece] for s, v in x.items()}, judged[piece])
    return found.note()


@pytest.mark.parametrize("cuts", [(), (900,), (850, 851, 1151, 1152), range(1, 2400)])
def test_the_gap_and_what_it_lacks(cuts):
    assert noted(cuts) == "not judged for 3.0 s: 8.5–11.5 s (no value of omega_fl, omega_fr)"


def test_many_gaps_are_counted():
    found, n = Unjudged(0.1), 1000
    a_x = np.ones(n)
    a_x[np.arange(n) % 100 < 3] = np.nan
    found.push({"a_x": a_x}, np.isfinite(a_x))
    said = found.note()
    assert said.startswith("not judged for 3.0 s: 0.0–0.3 s (no value of a_x), 10.0–10.3 s")
    assert said.endswith("and 7 times more")
