"""Slip slope of measured dry drives: told where a drive tells it, refused with the reason where it does not."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aqualog.align.load import load_signals
from aqualog.cli.main import app
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.detect.slip_slope.direct import slip_slopes

HERE = Path(__file__).parent
pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def porsche(real_logs):
    car = load_vehicle(HERE / "porsche.toml")
    paths = sorted((real_logs / "porsche_981").glob("*.csv"))
    return car, load_signals(paths, vehicle=car, signal_map=load_signal_map(HERE / "porsche_slope_map.toml"))


@pytest.fixture(scope="module", params=[0.3, 0.5])
def slopes(porsche, request):
    car, signals = porsche
    return slip_slopes(signals, car, mu_max=request.param)


def test_porsche_slopes_are_a_tyres(slopes):
    """Published slopes of dry roads are 15 to 50; these are 30 to 34, 40, and 36 for the axle."""
    assert (slopes.method, slopes.traction) == ("axle", "accelerometer")
    found = {p.place: p.line for p in slopes.places}
    assert set(found) == {"rl", "rr", "rear axle"}
    for line in found.values():
        low, high = line.slope_ci
        assert 27.0 < low < line.slope < high < 46.0
        assert (high - low) / line.slope < 0.25
        assert line.attenuation < 0.02
    # the axle's force is measured, its halves are not: the wheels lie on both sides of it
    assert found["rl"].slope < found["rear axle"].slope < found["rr"].slope


def test_porsche_wheels_and_accelerometer_share_a_clock(slopes):
    assert all(abs(p.lag_s) < 0.03 for p in slopes.places)


def test_porsche_tyres_get_softer_as_they_warm_up(porsche):
    car, signals = porsche
    found = slip_slopes(signals, car, mu_max=0.5)
    for p in found.places:
        assert p.stability.verdict == "drifts"
        assert -0.40 < p.stability.change < -0.20
        assert p.stability.change_ci[1] < -0.15
        assert len(p.segments) >= 4
    first, *rest = next(p for p in found.places if p.place == "rear axle").segments
    assert first.line.slope > 1.15 * max(s.line.slope for s in rest)


def test_porsche_at_small_traction_alone_does_not_tell_the_drift(porsche):
    """With |mu| below 0.3 there are 68 s in all: the same change, but 0 is in its interval."""
    car, signals = porsche
    for p in slip_slopes(signals, car, mu_max=0.3).places:
        assert p.stability.verdict == "cannot tell"
        assert p.stability.change < 0.0 < p.stability.change_ci[1]


def test_porsche_recursion_ends_where_the_regression_is(slopes):
    for p in slopes.places:
        assert p.recursion.slope == pytest.approx(p.line.slope, rel=0.1)
        assert p.recursion.alarms == 0


def command(*args):
    result = CliRunner().invoke(app, ["slip-slope", *map(str, args)])
    errors = [line for line in result.stderr.splitlines() if line.startswith("error:")]
    return result.exit_code, result.stdout, errors


def test_toyota_on_a_highway_cannot_tell(real_logs):
    """One minute holds six blocks of ten seconds, and little of it is more than cruising."""
    folder = real_logs / "toyota_rav4"
    code, out, errors = command(
        folder / "can_bus.mf4", "--dbc", folder / "toyota_2017.dbc", "--vehicle", HERE / "toyota.toml", "--signals",
        HERE / "toyota_map.toml",
    )  # fmt: skip
    assert code == 4
    assert out == ""
    assert len(errors) == 1
    assert "cannot estimate the slip slope" in errors[0]
    assert "holds 0" in errors[0]


def test_bmw_has_no_wheel_speeds(real_logs):
    code, _, errors = command(
        real_logs / "bmw_i3" / "TripA05.csv", "--vehicle", HERE / "bmw_i3.toml", "--signals", HERE / "bmw_i3_map.toml"
    )
    assert code == 4
    assert len(errors) == 1
    assert "missing omega_fl, omega_fr, omega_rl, omega_rr" in errors[0]


def test_canedge_has_no_wheel_speeds(real_logs):
    folder = real_logs / "canedge"
    code, _, errors = command(
        folder / "00000001-60FE3F04.MF4", "--dbc", folder / "canmod-gps.dbc", "--vehicle", HERE / "toyota.toml"
    )
    assert code == 4
    assert len(errors) == 1
    assert "omega_fl" in errors[0]


def test_porsche_command_writes_its_page(real_logs, tmp_path):
    code, out, _ = command(
        *sorted((real_logs / "porsche_981").glob("*.csv")), "--vehicle", HERE / "porsche.toml", "--signals",
        HERE / "porsche_slope_map.toml", "--mu-max", 0.5, "-o", tmp_path / "out",
    )  # fmt: skip
    assert code == 0
    assert "rear axle: drifts" in out
    document = json.loads((tmp_path / "out" / "slip_slope.json").read_text())
    assert [p["place"] for p in document["slip_slope"]] == ["rl", "rr", "rear axle"]
