"""Claims of section 2.5 about the joint detectors.

C64-C69 are rules, C71 is an identity: they hold by construction, and `tests/detect/test_joint.py` says so by truth table
and by hand. C72-C77 are judged by `aqualog figures 2.25`. Here is C70: the velocity signal only tells spin-up from
spin-down, so that a coarse one is enough.

`python tests/thesis/test_joint_claims.py` prints the table of C70 over 20 aquaplaning and 20 other drives. Its criterion
was fixed before any figure was seen.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from aqualog.evaluate.drives import Drive, labels_in
from aqualog.evaluate.judge import judge
from aqualog.evaluate.score import score
from aqualog.model.signals import as_signals
from aqualog.model.simulate import simulate
from aqualog.model.situations import SITUATIONS, TUNING_POOL, draw
from aqualog.notation import WHEELS

DETECTORS = ("spin_down", "minor_spin_down", "spin_up", "joint_criteria", "joint_cusum")
FIRST_SEED = 150
LATE_S = 0.2
RECALL = 0.10  # by which a recall may change
MORE_ALARMS = 2  # false alarms on top, over all drives


def scaled(factor):
    return lambda frame, vehicle: frame.with_columns(pl.col("v_x") * factor)


def late(frame, vehicle):
    """The whole signal 0.2 s late; at the start it is what it was first."""
    rows = round(LATE_S / (frame["t"][1] - frame["t"][0]))
    return frame.with_columns(pl.col("v_x").shift(rows).fill_null(strategy="backward"))


def without(frame, vehicle):
    return frame.drop("v_x")


def mean_of_wheels(frame, vehicle):
    speeds = [pl.col(f"omega_{w}") * vehicle.r_e(w) for w in WHEELS]
    return frame.with_columns(pl.mean_horizontal(speeds).alias("v_x"))


VARIANTS = {
    "as measured": scaled(1.0),
    "2 % too fast": scaled(1.02),
    "2 % too slow": scaled(0.98),
    "0.2 s late": late,
    "none (estimated from wheels and accelerometer)": without,
    "mean of the four wheels": mean_of_wheels,
}
MEASURED = ("2 % too fast", "2 % too slow", "0.2 s late")  # coarse, but a measurement


@cache
def drive(name, seed):
    drawn = draw(name, seed, TUNING_POOL)
    signals = as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed)
    return Drive(f"{name} {seed}", signals, drawn.believed, labels_in(signals), {"kind": drawn.kind})


def drives(count):
    """As many drives of both kinds, taking turns through the situations, a seed for each."""
    found = []
    for kind in ("aquaplaning", "nuisance"):
        names = [n for n, s in SITUATIONS.items() if s.kind == kind]
        found += [drive(names[i % len(names)], FIRST_SEED + i) for i in range(count)]
    return found


def with_velocity(d, change):
    s = d.signals
    return replace(d, signals=replace(s, frame=change(s.frame, d.vehicle)))


@dataclass(frozen=True)
class Row:
    detector: str
    variant: str
    full: tuple[int, int]  # found, episodes
    partial: tuple[int, int]
    false_alarms: int

    def is_like(self, base):
        def rate(found):
            return found[0] / found[1] if found[1] else 0.0

        same = all(abs(rate(a) - rate(b)) <= RECALL for a, b in ((self.full, base.full), (self.partial, base.partial)))
        return same and self.false_alarms - base.false_alarms <= MORE_ALARMS


@cache
def judged(count, variant):
    return [judge(with_velocity(d, VARIANTS[variant])) for d in drives(count)]


def c70(count, variants=tuple(VARIANTS)):
    """Rows of detectors and velocities; whether each is like that with the velocity as measured."""
    rows = {}
    for variant in variants:
        records = judged(count, variant)
        for detector in DETECTORS:
            s = score(records, detector)
            rows[detector, variant] = Row(
                detector, variant, (s.full.found, s.full.episodes), (s.partial.found, s.partial.episodes),
                s.false_alarms.count,
            )  # fmt: skip
    return {key: (row, row.is_like(rows[key[0], "as measured"])) for key, row in rows.items()}


def verdict(rows):
    like = {key: holds for key, (_, holds) in rows.items()}
    whole = all(like.values())
    by_detector = [all(like[d, v] for v in VARIANTS) for d in DETECTORS]
    part = all(like[d, v] for d in DETECTORS for v in MEASURED) or sum(by_detector) >= len(DETECTORS) - 1
    return "borne out" if whole else "in part" if part else "not borne out"


# --- tests ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def table():
    return c70(20)


def test_c70_in_part(table):
    """A coarse measurement changes nothing. Without one, wheels in antilock braking are the only reference there is."""
    assert {d for (d, v), (_, holds) in table.items() if not holds} == {"spin_down", "spin_up"}
    assert all(holds for (_, v), (_, holds) in table.items() if v in MEASURED)
    assert verdict(table) == "in part"


def test_c70_the_joint_detector_needs_no_velocity(table):
    rows = [row for (d, _), (row, _) in table.items() if d == "joint_criteria"]
    assert len(rows) == len(VARIANTS)
    for row in rows:
        assert row.full[0] == row.full[1] >= 15
        assert row.partial[0] == row.partial[1] >= 15
        assert row.false_alarms == 0


def test_c70_the_alarms_on_top_are_those_of_antilock_braking():
    for variant in ("none (estimated from wheels and accelerometer)", "mean of the four wheels"):
        for detector in ("spin_down", "spin_up"):
            before, after = (
                score([r for r in judged(20, v) if not r.name.startswith("abs_")], detector).false_alarms.count
                for v in ("as measured", variant)
            )
            assert after - before <= MORE_ALARMS, (variant, detector)


def test_velocities_are_what_they_say():
    d = drives(1)[0]
    v = d.signals.array("v_x")
    fast = with_velocity(d, VARIANTS["2 % too fast"]).signals.array("v_x")
    np.testing.assert_allclose(fast, 1.02 * v)
    after = with_velocity(d, late).signals.array("v_x")
    n = round(LATE_S / d.signals.dt)
    np.testing.assert_array_equal(after[n:], v[:-n])
    assert "v_x" not in with_velocity(d, without).signals.frame.columns
    wheels = with_velocity(d, mean_of_wheels).signals.array("v_x")
    assert np.nanmedian(wheels) == pytest.approx(np.nanmedian(v), rel=0.02)


def test_a_detector_that_goes_blind_or_cries_wolf_is_not_like_before():
    base = Row("x", "as measured", (10, 20), (10, 20), 1)
    assert replace(base, full=(11, 20), false_alarms=3).is_like(base)
    assert replace(base, false_alarms=0).is_like(base)
    assert not replace(base, full=(7, 20)).is_like(base)
    assert not replace(base, partial=(7, 20)).is_like(base)
    assert not replace(base, false_alarms=4).is_like(base)


def main():
    rows = c70(20)
    print("| detector | velocity | full | partial | false alarms | alike |\n|---|---|---|---|---|---|")
    for row, holds in rows.values():
        full, partial = (f"{a} of {b}" for a, b in (row.full, row.partial))
        print(f"| {row.detector} | {row.variant} | {full} | {partial} | {row.false_alarms} | {holds} |")
    print(f"C70: {verdict(rows)}")


if __name__ == "__main__":
    main()
