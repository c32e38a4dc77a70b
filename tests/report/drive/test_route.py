"""The drive from above: metres on the ground, speed as colour, events where they were."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.report.drive.report import by_importance
from aqualog.report.drive.route import POINTS, route_figure, route_metres
from tests.report import fake_result as fake


def driven(result, east):
    """The drive along a line to the east at 48 degrees."""
    degrees = np.degrees(east / (6_371_000.0 * np.cos(np.radians(48.0))))
    n = result.signals.frame.height
    frame = result.signals.frame.with_columns(latitude=pl.Series(np.full(n, 48.0)), longitude=pl.Series(16.0 + degrees))
    return replace(result, signals=replace(result.signals, frame=frame))


@pytest.fixture(scope="module")
def result():
    return driven(fake.make_result(), np.linspace(0.0, 800.0, 3000))


def test_metres_across_the_date_line_and_without_a_fix():
    latitude = np.array([np.nan, 0.0, 0.0, 0.001, 0.0])
    longitude = np.array([179.9, 0.0, 179.999, -179.999, 180.0])
    east, north = route_metres(latitude, longitude)
    assert np.isnan(east[:2]).all()
    assert east[2:] == pytest.approx([0.0, 222.4, 111.2], abs=0.1)
    assert north[2:] == pytest.approx([0.0, 111.2, 0.0], abs=0.1)


def test_speed_is_the_colour_and_events_lie_on_the_way(result):
    figure = route_figure(result, by_importance(result.events))
    drive = next(t for t in figure["data"] if t["name"] == "drive")
    assert len(drive["x"]) <= POINTS + 1
    assert drive["x"][-1] == pytest.approx(800.0, abs=1.0)
    assert drive["marker"]["color"][0] == pytest.approx(3.6 * result.features["v_x_hat"][0], abs=0.1)
    marks = [t for t in figure["data"] if t["name"].startswith("event")]
    assert {i for t in marks for c in t["customdata"] if c for i in c[:1]} == set(range(len(result.events)))
    event = result.events[0]
    mark = next(t for t in marks if any(c and c[0] == 0 for c in t["customdata"]))
    at = [x for x, c in zip(mark["x"], mark["customdata"], strict=True) if c and c[0] == 0]
    assert at[0] == pytest.approx(800.0 * event.start_s / 30.0, abs=1.0)
    assert figure["layout"]["yaxis"]["scaleanchor"] == "x"


@pytest.mark.parametrize("east", [np.zeros(3000), np.full(3000, np.nan)])
def test_a_car_that_stood_or_has_no_fix_has_no_figure(result, east):
    assert route_figure(driven(result, east), ()) is None
    assert route_figure(fake.make_result(), ()) is None
