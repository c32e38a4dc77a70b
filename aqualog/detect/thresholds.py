"""The threshold of each detector: the one number by which it is made more or less sensitive."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from aqualog.core.errors import ConfigError

__all__ = ["DEFAULT", "MEANINGS", "UNITS", "Thresholds"]


@dataclass(frozen=True, slots=True)
class Thresholds:
    """One value per detector, in the unit of its statistic (`UNITS`); a larger one means fewer alarms.

    All other values of a detector follow from physics and stay (drifts, hysteresis, memories).

    Raises
    ------
    ConfigError
        If a value is not positive, or `slip_slope_drop` leaves 0 ... 1.
    """

    spin_down: float = 0.6
    minor_spin_down: float = 1.0
    spin_up: float = 0.6
    resistance: float = 0.2
    slip_slope_drop: float = 0.5
    tie_rod: float = 0.4
    joint_criteria: float = 0.03
    joint_cusum: float = 1.15

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            most = 1.0 if f.name == "slip_slope_drop" else float("inf")
            if not 0.0 < value < most:
                bounds = "between 0 and 1" if most == 1.0 else "above 0"
                raise ConfigError(
                    f"threshold {f.name} = {value:g} {UNITS[f.name]}", expected=f"a value {bounds} ({MEANINGS[f.name]})"
                )

    def scaled(self, detector: str, factor: float) -> Thresholds:
        """Return the same with the threshold of one detector times a factor; a loss of slope stays below 1.

        The loss of slope is scaled by the share that may be left: 1 - (1 - loss) / factor.
        """
        old = getattr(self, detector)
        new = 1.0 - (1.0 - old) / factor if detector == "slip_slope_drop" else old * factor
        return replace(self, **{detector: min(max(new, 1e-3), 0.999) if detector == "slip_slope_drop" else new})


UNITS = {
    "spin_down": "m/s",
    "minor_spin_down": "(m/s^2)^2",
    "spin_up": "m/s",
    "resistance": "m/s",
    "slip_slope_drop": "-",
    "tie_rod": "s",
    "joint_criteria": "m/s",
    "joint_cusum": "-",
}

MEANINGS = {
    "spin_down": "speed that a wheel loses faster than a healthy one can",
    "minor_spin_down": "variance of a wheel's acceleration difference beyond that of the other axle",
    "spin_up": "speed that a wheel gains faster than a healthy one can",
    "resistance": "sum of the resistance measure beyond 0.1 m/s²",
    "slip_slope_drop": "lost share of the dry slip slope",
    "tie_rod": "sum of the tie-rod residual over its scatter, beyond four of it",
    "joint_criteria": "sum of the resistance measure beyond 0.1 m/s² that opens the gate",
    "joint_cusum": "scaled sum of all effects",
}

DEFAULT = Thresholds()
