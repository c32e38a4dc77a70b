"""What a car's side slip makes of its lateral acceleration is no finding."""

import aqualog as aq
from tests.blind.plain import CAR, drive


def test_a_car_that_is_simulated_without_side_slip_has_no_misplaced_accelerometer(tmp_path):
    """Its a_y is that of a point near the rear axle, as in any simulator with speed times yaw rate."""
    log = tmp_path / "drive.parquet"
    drive(11, "stop_and_go", "pink", 150.0).write_parquet(log)
    found = aq.diagnose([log], CAR, views=False, surrogates=9).document
    assert found["verdict"] == "no_effect", found["sentence"]
