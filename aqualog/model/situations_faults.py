"""Situations in which something fails or hits, on a dry road: sensors, tyres, kerbs."""

from __future__ import annotations

from dataclasses import replace

from aqualog.core.notation import WHEELS
from aqualog.model.faults import SensorFault
from aqualog.model.scenario import Kick
from aqualog.model.sensors import ESC
from aqualog.model.sketch import KMH, Sketch, Taken, terms
from aqualog.model.term import Model

__all__ = ["MAKERS"]

BUSES = ("wheels", "esc", "drive", "brake", "steering", "gnss")


def _kerbs(k: Sketch) -> Taken:
    """Holes and kerbs of 10 to 50 cm: blows of 1 to 5 kN, most of it through the axle and little about it (K)."""
    v, duration = k.between(40.0, 100.0) * KMH, k.between(50.0, 80.0)
    kicks = tuple(
        Kick(
            v * t, k.between(0.2, 0.6), k.one_of("left", "right", "right", "both"), k.between(60.0, 500.0),
            k.between(1000.0, 5000.0),
        )
        for t in sorted(k.between(6.0, duration - 5.0) for _ in range(int(k.rng.integers(4, 11))))
    )  # fmt: skip
    scenario = k.drive(duration, k.cruise(duration, v, spread=0.04), kicks=kicks)
    return Taken(scenario, Model(), f"{len(kicks)} blows at {v / KMH:.0f} km/h")


def _pressure_loss(k: Sketch) -> Taken:
    v, wheel = k.between(80.0, 130.0) * KMH, k.one_of(*WHEELS)
    loss = {
        "radius": k.between(0.005, 0.015), "slope": k.between(0.05, 0.25), "start": k.between(15.0, 25.0),
        "duration": k.between(20.0, 60.0),
    }  # fmt: skip
    scenario = k.drive(110.0, k.cruise(110.0, v))
    note = f"{wheel} loses {loss['radius']:.1%} of its radius over {loss['duration']:.0f} s"
    return Taken(scenario, terms(("pressure_loss", loss, wheel)), note)


def _dropouts(k: Sketch) -> Taken:
    """Blocks without values in single signals, whole messages missing for 0.2 to 3 s, values that stand still."""
    duration, v = k.between(60.0, 90.0), k.between(60.0, 120.0) * KMH
    signals = tuple(s for g in ESC.groups if g.name in BUSES for s in g.signals)

    def fault(names: tuple[str, ...], low: float, high: float, kind: str) -> SensorFault:
        t = k.between(5.0, duration - 5.0)
        return SensorFault(k.one_of(*names), t, t + k.between(low, high), "frozen" if kind == "frozen" else "missing")

    faults = (
        *(fault(signals, 0.1, 2.0, "missing") for _ in range(int(k.rng.integers(4, 11)))),
        *(fault(BUSES, 0.2, 3.0, "missing") for _ in range(int(k.rng.integers(1, 4)))),
        *(fault(signals, 0.5, 3.0, "frozen") for _ in range(int(k.rng.integers(1, 4)))),
    )
    scenario = k.drive(duration, k.cruise(duration, v, spread=0.12), sensors=replace(ESC, faults=faults))
    return Taken(scenario, Model(), f"{len(faults)} faults at {v / KMH:.0f} km/h")


def _accelerometer(k: Sketch) -> Taken:
    """An accelerometer that is off by up to 0.2 m/s² from the start, or drifts there."""
    duration, v = k.between(60.0, 120.0), k.between(70.0, 120.0) * KMH
    error = k.between(0.08, 0.2) * k.one_of(-1.0, 1.0)
    if k.between(0.0, 1.0) < 0.5:
        model, note = terms(("accelerometer_bias", {"bias": error}, "a_x")), "off"
    else:
        model, note = terms(("accelerometer_drift", {"drift": error / duration}, "a_x")), "drifts"
    return Taken(k.drive(duration, k.cruise(duration, v)), model, f"{note} by {error:+.2f} m/s^2")


MAKERS = {
    "kerbs_and_holes": ("kerbs and holes", _kerbs),
    "pressure_loss": ("a tyre loses its air", _pressure_loss),
    "dropouts": ("sensors and buses that fail for a while", _dropouts),
    "accelerometer": ("an accelerometer that is off or drifts", _accelerometer),
}
