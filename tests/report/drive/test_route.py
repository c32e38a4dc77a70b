"""The drive from above: metres on the ground, speed as colour, events where they were."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.judgement import Episode
from aqualog.report.drive.report import drive_page
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


def episode(kind, start_s, end_s):
    return Episode(kind, start_s, end_s, ("fl",), "f", "left", "partial", 28.0, (), 0.5, -0.1, 0.02, 20.0, (0,))


def test_speed_is_the_colour_and_episodes_lie_on_the_way(result):
    tables = {"episodes": [episode("aquaplaning", 9.0, 12.0)], "more-episodes": [episode("wheel_lock", 3.0, 3.01)]}
    figure = route_figure(result, tables)
    drive = next(t for t in figure["data"] if t["name"] == "drive")
    assert len(drive["x"]) <= POINTS + 1
    assert drive["x"][-1] == pytest.approx(800.0, abs=1.0)
    assert drive["marker"]["color"][0] == pytest.approx(3.6 * result.features["v_x_hat"][0], abs=0.1)
    lock, wet = figure["data"][:2]
    assert [lock["name"], wet["name"]] == ["braking slip", "aquaplaning"]
    assert wet["x"][0] == pytest.approx(800.0 * 9.0 / 30.0, abs=1.0)
    assert wet["x"][-2] == pytest.approx(800.0 * 12.0 / 30.0, abs=1.0)
    assert wet["customdata"][0] == ["episodes", 0, "Aquaplaning: 9.0–12.0 s, 101 km/h, front left, partial"]
    assert lock["customdata"][0][:2] == ["more-episodes", 0]
    assert figure["layout"]["yaxis"]["scaleanchor"] == "x"


@pytest.mark.parametrize("east", [np.zeros(3000), np.full(3000, np.nan)])
def test_a_car_that_stood_or_has_no_fix_has_no_figure(result, east):
    assert route_figure(driven(result, east), {}) is None
    assert route_figure(fake.make_result(), {}) is None


def test_the_page_has_the_route_of_a_log_with_positions(result):
    assert 'id="route"' in drive_page(result, title="t")
    assert 'id="route"' not in drive_page(fake.make_result(), title="t")
