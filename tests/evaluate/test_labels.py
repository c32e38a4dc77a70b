"""Labels from truth, and what is made of labels; all expectations reckoned by hand."""

import numpy as np
import pytest

from aqualog.evaluate.drives import LogSource, labels_in
from aqualog.evaluate.labels import Label, Labels, after, joined, overlaps, spans_of, truth_labels, until, without
from aqualog.model.log import as_signals, write_simulation
from aqualog.model.simulate import simulate
from tests.evaluate.made import FWD, scenario

T = np.arange(0.0, 20.0, 0.01)


def contact(*stretches):
    """1 but for stretches (start, end, value)."""
    x = np.ones(T.size)
    for start, end, value in stretches:
        x[(start - 1e-9 <= T) & (end - 1e-9 > T)] = value
    return x


def labels(fl, fr=None, **more):
    columns = {"true_contact_fl": fl, "true_contact_fr": contact() if fr is None else fr, **more}
    return truth_labels(T, columns)


def rounded(spans):
    return [(round(a, 6), round(b, 6)) for a, b in spans]


def test_stretches_last_until_the_next_sample():
    bits = np.array([0, 1, 1, 0, 1], dtype=bool)
    assert spans_of(np.array([0.0, 1.0, 2.0, 4.0, 6.0]), bits) == [(1.0, 4.0), (6.0, 8.0)]
    assert spans_of(np.array([]), np.array([], dtype=bool)) == []


def test_full_needs_a_tenth_of_a_second_and_closes_short_gaps():
    got = labels(contact((2.0, 2.09, 0.0), (3.0, 3.1, 0.04), (3.35, 3.6, 0.04), (3.9, 4.2, 0.0)))
    # 0.09 s is too short; 3.1 to 3.35 is a gap below 0.3 s; 3.6 to 3.9 is not below it
    assert rounded(got.of("full", "fl")) == [(3.0, 3.6), (3.9, 4.2)]
    assert rounded(got.of("full")) == [(3.0, 4.2)]  # of the car: gaps below 1 s


def test_full_threshold_is_below_five_per_cent():
    assert labels(contact((3.0, 5.0, 0.05))).of("full") == []
    assert rounded(labels(contact((3.0, 5.0, 0.049))).of("full")) == [(3.0, 5.0)]


def test_partial_needs_a_second_without_a_break():
    got = labels(contact((2.0, 2.98, 0.6), (5.0, 6.0, 0.6), (8.0, 8.5, 0.6), (8.51, 9.3, 0.6)))
    assert rounded(got.of("partial")) == [(5.0, 6.0)]
    assert labels(contact((5.0, 7.0, 0.7))).of("partial") == []


def test_episodes_of_the_car_are_the_union_of_its_wheels():
    got = labels(contact((2.0, 4.0, 0.5)), contact((3.0, 5.0, 0.5), (5.9, 7.0, 0.5), (8.0, 9.0, 0.5)))
    assert rounded(got.of("partial")) == [(2.0, 7.0), (8.0, 9.0)]
    assert rounded(got.of("partial", "fr")) == [(3.0, 5.0), (5.9, 7.0), (8.0, 9.0)]


def test_no_aquaplaning_below_walking_pace_and_none_from_missing_samples():
    slow = np.where((T > 5.0) & (T < 6.5), 4.9, 20.0)
    x = contact((5.0, 6.5, 0.0), (10.0, 12.0, 0.0))
    x[(T > 9.5) & (T < 9.9)] = np.nan
    assert rounded(labels(x, true_v_x=slow).of("full")) == [(10.0, 12.0)]


def test_water_is_film_or_on_water():
    film = np.where((T >= 4.0) & (T < 6.0), 1e-3, 0.0)
    on_water = np.where((T >= 5.0) & (T < 8.0), 1.0, 0.0)
    got = labels(contact(), true_film_rr=film, on_water=on_water)
    assert rounded(got.water) == [(4.0, 8.0)]
    assert rounded(got.water_widened) == [(4.0, 9.0)]


def test_without_contact_there_is_no_truth():
    assert truth_labels(T, {"on_water": np.ones(T.size)}) is None


def test_effects_of_aquaplaning_are_on_water_and_surfaces_are_not():
    items = (Label(1.0, 2.0, "spin_down", "fl"), Label(4.0, 5.0, "partial"), Label(8.0, 9.0, "snow"))
    got = Labels((*items, Label(10.0, 11.0, "whatever")), frozenset(("water",)), "file")
    assert got.water == [(1.0, 2.0), (4.0, 5.0)]
    assert got.others == ("spin_down", "snow", "whatever")
    assert got.unknown == ("whatever",)


def test_arithmetic_of_stretches():
    assert joined([(3, 4), (0, 1), (1, 2), (3.5, 6)], 0.0) == [(0, 2), (3, 6)]
    assert joined([(0, 1), (1.5, 2), (2.5, 3)], 0.5) == [(0, 1), (1.5, 2), (2.5, 3)]
    assert joined([(0, 1), (1.5, 2)], 0.51) == [(0, 2)]
    assert without([(0, 10)], [(2, 3), (5, 6)]) == [(0, 2), (3, 5), (6, 10)]
    assert without([(0, 1), (2, 3), (4, 5)], [(0.5, 2.5), (4, 5)]) == [(0, 0.5), (2.5, 3)]
    assert overlaps((0, 1), [(0.5, 2)])
    assert not overlaps((0, 1), [(1, 2)])


@pytest.mark.parametrize("suffix", [".mf4", ".mcap", ".csv", ".parquet"])
def test_truth_in_a_log_gives_the_labels_of_the_drive(tmp_path, suffix):
    simulation = simulate(scenario(FWD, "worn_summer", 118.0, 1.8))
    known = labels_in(as_signals(simulation))
    path = tmp_path / f"drive{suffix}"
    write_simulation(path, simulation, suffix=suffix, comment="")
    drive = LogSource("drive", (path,), FWD).load()
    assert drive.labels.source == "simulated truth"
    assert not [s for s in drive.signals.symbols if s.startswith("true_")]
    assert known.of("full")
    assert known.of("partial")
    for effect in ("full", "partial", "water"):
        got = drive.labels.of(effect)
        assert len(got) == len(known.of(effect))
        assert np.allclose(got, known.of(effect), atol=0.025), effect


def test_labels_end_with_the_drive(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t [s],v_x [m/s]\n" + "".join(f"{i / 10:g},20\n" for i in range(100)))
    given = (
        Label(1.0, 2.0, "water"),
        Label(9.0, 30.0, "full", "fl"),
        Label(10.0, 11.0, "snow"),
        Label(12.0, 13.0, "water"),
    )
    drive = LogSource("drive", (path,), FWD, labels=given).load()
    assert rounded([(x.start_s, x.end_s) for x in drive.labels.items]) == [(1.0, 2.0), (9.0, 10.0)]
    assert drive.labels.water == [(1.0, 2.0), (9.0, pytest.approx(10.0))]
    told = "; ".join(drive.signals.quality.notes)
    assert "the label from 10 s begins after the log" in told
    assert "the label from 12 s begins after the log" in told
    assert "the label to 30 s is cut where the log ends, at 10 s" in told
    assert after(given, 10.0) == given[2:]
    assert until(given[:1], 10.0) == given[:1]
    inside = LogSource("drive", (path,), FWD, labels=(Label(9.0, 10.0, "water"),)).load()
    assert inside.signals.quality.notes == ()
