"""Settings of the detectors that a user may change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

__all__ = ["JointCusumParams", "Settings"]


@dataclass(frozen=True, slots=True)
class JointCusumParams:
    """Scales of the terms of joint detector 2; each term reaches 1 at its scale and no more.

    `third` is the third term of (2.11): `resistance`, as the text has it, or `variance`, a CUSUM of the variance
    difference, as its printed index says (E6). `with_slope` adds the lost share of the slip slope, an option in the
    thesis. `gated`: the sum warns only while the resistance gate is open. A wheel that is braked or spun on ice, or a
    bus that loses messages, fills several terms at once, and the thesis calls resistance necessary.
    """

    g_up: float = 1.5  # [m/s]
    g_down: float = 1.5  # [m/s]
    g_resistance: float = 0.3  # [m/s]
    var_low: float = 0.5  # [(m/s^2)^2] what tooth noise and rough asphalt leave of the difference
    var_high: float = 4.0
    g_variance: float = 1.0  # [(m/s^2)^2 s]
    loss_low: float = 0.25  # [-] what load, grip and noise of the estimate cost on dry road
    loss_high: float = 0.75
    third: Literal["resistance", "variance"] = "resistance"
    with_slope: bool = True
    gated: bool = True
    weights: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the detectors.

    `thresholds` by the name of the detector, in the unit of its statistic; those left out keep their default.
    `correct_yaw` as in `FeatureStream`. `learns_offset`: the offset of the resistance measure on dry road is estimated
    and subtracted. `joint_cusum`: scales of joint detector 2.
    """

    thresholds: Mapping[str, float] = field(default_factory=dict)
    correct_yaw: bool = True
    learns_offset: bool = True
    joint_cusum: JointCusumParams = field(default_factory=JointCusumParams)
