"""The distance to full aquaplaning: it falls with speed, warns before it, and stays silent on dry roads."""

import numpy as np
import pytest

from aqualog.detect.detector import Settings
from aqualog.detect.margin import laws
from aqualog.detect.margin.laws import COLUMNS, DEPTHS, FULL_SPEEDS, SPEEDS, tables_of
from aqualog.detect.margin.watch import Least
from aqualog.detect.stream import detect_drive
from aqualog.model.tyre import TYRES
from aqualog.report.drive.document import document
from aqualog.report.drive.panels import drive_rows
from tests.drives import CAR, drive, lane

KMH = 3.6
WARNS = Settings(warns=True)


@pytest.fixture(scope="module")
def wet():
    columns = drive(CAR, duration_s=14.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),))[0]
    return detect_drive(columns, CAR, settings=WARNS)


def column(name):
    return tables_of(CAR).x[..., COLUMNS.index(name)]


def test_tables_follow_the_laws():
    """Far below full aquaplaning nothing is lost; on the way there contact and friction fall, resistance grows."""
    L, f, R = column("L"), column("f_f"), column("R")
    fast = SPEEDS[:, None] < FULL_SPEEDS[None]
    assert (L[1] > 0.95).all()
    falls = np.diff(L, axis=0) <= 1e-12
    assert falls.all()
    assert (np.diff(f, axis=0) <= 1e-12).all()
    assert (np.diff(R, axis=0)[fast[1:]] > 0.0).all()
    # a free wheel stops where friction no longer turns it: there little friction is left
    i = int(np.argmin(np.abs(FULL_SPEEDS - 100.0 / KMH)))
    at = np.array([np.interp(FULL_SPEEDS[i], SPEEDS, f[:, i, j]) for j in range(DEPTHS.size)])
    assert (at < 0.3).all()
    assert tables_of(CAR).prior.sum() == pytest.approx(1.0)


def test_a_wet_drive_has_a_distance_and_a_warning(wet):
    margin = wet.features["aquaplaning_margin"].fill_null(np.nan).to_numpy()
    t = np.arange(margin.size) * wet.signals.dt
    label = np.nan_to_num(wet.signals.array("on_water")) > 0.5
    entry = float(t[label][0])
    assert not np.isfinite(margin[t < entry - 0.2]).any()
    assert np.isfinite(margin[(t > entry + 1.0) & label]).mean() > 0.9
    assert wet.margin is not None
    low, high = wet.margin.ci90
    assert low <= wet.margin.least <= high
    assert entry < wet.margin.warned_s < entry + 2.0
    assert any(e.detector == "margin" for e in wet.events)


def test_a_warning_is_no_episode(wet):
    numbers = {i for e in wet.judgement.episodes for i in e.events}
    assert not [wet.events[i] for i in numbers if wet.events[i].detector == "margin"]
    assert numbers == {i for i, e in enumerate(wet.events) if e.detector != "margin"}


def test_document_and_page(wet):
    found = document(wet, log="x")["margin"]
    assert set(found) == {"least_kmh", "ci90", "at_s", "warned_s"}
    assert found["least_kmh"] == pytest.approx(KMH * wet.margin.least, rel=1e-6)
    row = next(r for r in drive_rows(wet) if r.title == "Distance to full aquaplaning")
    assert [line.label for line in row.lines] == ["95 %", "75 %", "median", "25 %", "5 %"]


def test_a_dry_drive_has_none():
    signals, _ = drive(CAR, duration_s=20.0, lanes=(), speed_kmh=((0.0, 80.0), (20.0, 110.0)))
    result = detect_drive(signals, CAR, settings=WARNS)
    assert result.margin is None
    assert document(result, log="x")["margin"] is None
    assert not [e for e in result.events if e.detector == "margin"]


def test_without_torque_it_does_not_run():
    """Wheels alone warned on a measured dry road."""
    signals, _ = drive(CAR, duration_s=8.0, lanes=(), drop=("torque_rl", "torque_rr"))
    found = {u.detector: u.missing for u in detect_drive(signals, CAR, settings=WARNS).unavailable}
    assert found["margin"] == ("torque_rl", "torque_rr")


def test_the_least_of_pieces_is_that_of_the_whole():
    rng = np.random.default_rng(3)
    x = np.where(rng.random(500) < 0.5, np.nan, rng.normal(5.0, 2.0, 500))
    f = {"aquaplaning_margin": x, "aquaplaning_margin_low": x - 1.0, "aquaplaning_margin_high": x + 1.0}
    bits = rng.random(500) < 0.01
    whole, parts = Least(0.01), Least(0.01)
    whole.push(f, bits)
    for a, b in ((0, 1), (1, 120), (120, 500)):
        parts.push({n: v[a:b] for n, v in f.items()}, bits[a:b])
    assert whole.result() == parts.result()


def test_its_numbers_are_those_of_the_simulated_tyre():
    tyre = TYRES["worn_summer"]
    np.testing.assert_allclose(laws.LAW, tyre.water_law, rtol=1e-9)
    assert (tyre.groove_relief, tyre.h_film, tyre.h_wave) == (laws.RELIEF, laws.H_FILM, laws.H_WAVE)


def test_nobody_gets_it_who_has_not_asked_for_it():
    """It is on trial: rough asphalt warns too, and it costs more than all other detectors together."""
    columns = drive(CAR, duration_s=14.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),))[0]
    quiet = detect_drive(columns, CAR)
    assert quiet.margin is None
    assert all(e.detector != "margin" for e in quiet.events)
    assert "aquaplaning_margin" not in quiet.features.columns
