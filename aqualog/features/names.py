"""The dictionary of features: columns that the stream and the detectors add to a drive, with unit and sign.

A name is a stem, and behind an underscore the place where it has one. Signals keep the names of `core.notation`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from aqualog.core.notation import SIDES, WHEELS

__all__ = ["FEATURES", "Feature", "feature_of"]

At = Literal["", "wheel", "side", "number", "detector"]


class Feature(NamedTuple):
    """One feature; `made_by`: the detector that makes it, empty for the stream of features."""

    stem: str
    at: At
    unit: str
    meaning: str
    made_by: str = ""

    @property
    def shown(self) -> str:
        """Return the name as a reader writes it: `mu_fl` for a wheel's."""
        example = {"": "", "wheel": "_fl", "side": "_left", "number": "_1", "detector": "_spin_up"}
        return self.stem + example[self.at]


FEATURES = (
    Feature("v_x_hat", "", "m/s", "velocity from reference, wheels and accelerometer"),
    Feature("a_kin", "", "m/s^2", "dv_x/dt, free of grade and of the accelerometer's offset (E2)"),
    Feature("a_kin_slow", "", "m/s^2", "the same, low-passed"),
    Feature("a_x_slow", "", "m/s^2", "specific force forward, low-passed"),
    Feature("a_y_slow", "", "m/s^2", "lateral acceleration, left positive, low-passed"),
    Feature("yaw_rate_slow", "", "rad/s", "yaw rate, left positive, low-passed; fades in a gap"),
    Feature("brake_pressure", "", "Pa", "brake pressure as it was read"),
    Feature("v_line", "wheel", "m/s", "wheel speed on the centre line with the file's radius"),
    Feature("v_w", "wheel", "m/s", "the same with the radius corrected"),
    Feature("v_w_delta", "wheel", "m/s", "wheel less car: negative where the wheel is slow (2.4)"),
    Feature("v_w_delta_common", "", "m/s", "slow part of it that all wheels share"),
    Feature("a_w_delta", "wheel", "m/s^2", "acceleration of wheel less car (2.3)"),
    Feature("torque_sum", "", "N*m", "sum of the wheel torques"),
    Feature("mu", "wheel", "-", "traction coefficient by the torque, driving positive"),
    Feature("mu_res", "wheel", "-", "the same less the water's resistance"),
    Feature("delta_a_x", "", "m/s^2", "resistance measure, nominal less measured acceleration (2.9)"),
    Feature("tie_rod_meas", "wheel", "N", "tie-rod force, low-passed, compression positive"),
    Feature("tie_rod_hat", "wheel", "N", "the same by the polynomial of the vehicle file"),
    Feature("steering_meas", "", "N*m", "steering torque, low-passed, left positive"),
    Feature("steering_hat", "", "N*m", "the same by the polynomial of the vehicle file"),
    Feature("variance", "wheel", "(m/s^2)^2", "variance of `a_w_delta`", "minor_spin_down"),
    Feature("slip_slope", "side", "-", "slip slope C_s / F_z", "slip_slope_drop"),
    Feature("slip_slope_ref", "side", "-", "dry slip slope that it is compared with", "slip_slope_drop"),
    Feature("delta_a_x_offset", "", "m/s^2", "offset of `delta_a_x` on dry road", "resistance"),
    Feature("criterion", "number", "0 or 1", "whether the criterion of section 2.5 is met", "joint_criteria"),
    Feature("criterion_full", "", "0 or 1", "whether a wheel has lost the road", "joint_criteria"),
    Feature("joint_gate", "", "0 or 1", "whether the resistance gate is open", "joint_criteria"),
    Feature("aquaplaning_margin", "", "m/s", "distance to full aquaplaning, median; empty without water", "margin"),
    Feature("aquaplaning_margin_low", "", "m/s", "lower end of its 90 % interval", "margin"),
    Feature("aquaplaning_margin_high", "", "m/s", "upper end of its 90 % interval", "margin"),
    Feature("aquaplaning_margin_q25", "", "m/s", "lower end of its 50 % interval", "margin"),
    Feature("aquaplaning_margin_q75", "", "m/s", "upper end of its 50 % interval", "margin"),
    Feature("full_speed_expected", "", "m/s", "speed of full aquaplaning, median; empty without water", "margin"),
    Feature("contact_expected", "", "-", "contact share of the front axle, mean; empty without water", "margin"),
    Feature("water_probability", "", "-", "probability of water under the wheels", "margin"),
    Feature("joint_term", "detector", "-", "weighted term of the sum (2.11), 0 to its weight", "joint_cusum"),
)  # fmt: skip
"""In the order in which they are made."""

_PLACES = {"wheel": WHEELS, "side": (*SIDES, "axle"), "number": tuple("12345")}


def feature_of(column: str) -> Feature | None:
    """Return the feature of a column; None for a name that is not in the dictionary."""
    for f in FEATURES:
        place = column.removeprefix(f"{f.stem}_")
        if column == f.stem if not f.at else place != column and (f.at == "detector" or place in _PLACES[f.at]):
            return f
    return None
