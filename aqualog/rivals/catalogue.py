"""The rivals by name, and the function that runs them over a drive.

One rule, fixed beforehand, gives the default thresholds. It takes the smallest of a grid in steps of about a tenth at
which 10 h of simulated dry, damp and rough driving raise at most one alarm; each rival raised no alarm. The 180 drives
of 200 s between 40 and 130 km/h use three cars, four tyres, grades, wind, series sensors and vehicle files with errors;
seeds 1-180. Recall has no part in the rule. The inputs of the methods and the conditions that hold them were developed
on the same drives and on 120 passes over a watered lane. The rule covers no kerbs, gear shifts or brakes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import Event, Signals, Track, Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.detect.events import EventBuilder, Evidence
from aqualog.physics.slip import slip_of_wheel_speed
from aqualog.rivals import (
    front_rear_pattern,
    needs,
    resistance_model,
    slope_friction_ekf,
    slope_kalman,
    slope_rls,
    wheel_oscillation,
    wheel_thresholds,
)
from aqualog.rivals.inputs import present_symbols, rival_inputs
from aqualog.rivals.records import Rival, RivalInputs, RivalResult, always_partial

__all__ = ["RIVALS", "Rival", "RivalInputs", "RivalResult", "run_rivals"]

_ALL = (
    Rival(
        "wheel_thresholds", "thresholds on wheel deceleration and slip",
        "a wheel that decelerates and slips beyond critical levels, higher ones under braking, spins down",
        "[32]", "-", wheel_thresholds.THRESHOLD, needs.all_wheels, wheel_thresholds.run, wheel_thresholds.severity,
    ),
    Rival(
        "front_rear_pattern", "front-rear comparison over the same spot",
        "dips of a front wheel beyond a stored reference that the rear wheel does not repeat over the same spot",
        "[33], [34]", "-", front_rear_pattern.THRESHOLD, needs.pattern_wheels, front_rear_pattern.run, always_partial,
    ),
    Rival(
        "wheel_oscillation", "high-frequency oscillation of the wheel",
        "the wheel's rotational oscillation in a high band changes with the length of its contact",
        "[35]", "dB", wheel_oscillation.THRESHOLD, needs.fast_wheels, wheel_oscillation.run, always_partial,
    ),
    Rival(
        "resistance_model", "resistance from a longitudinal model",
        "what holds the car back beyond nominal rolling, air and grade is water that the tyres displace",
        "[36]", "m/s^2", resistance_model.THRESHOLD, needs.balance, resistance_model.run, always_partial,
    ),
    Rival(
        "slope_rls", "slip slope by recursive least squares",
        "slip on traction by least squares with forgetting; a slope far below the dry one means little friction",
        "[14], [17]", "-", slope_rls.THRESHOLD, needs.slip_slope, slope_rls.run, always_partial,
    ),
    Rival(
        "slope_kalman", "slip slope by Kalman filter with CUSUM",
        "slope and offset of the slip by a linear Kalman filter that a CUSUM of its residual makes quick",
        "[15]", "-", slope_kalman.THRESHOLD, needs.slip_slope, slope_kalman.run, always_partial,
    ),
    Rival(
        "slope_friction_ekf", "slip slope and friction by extended Kalman filter",
        "slope and maximum friction of a bent tyre curve, estimated together",
        "[16]", "-", slope_friction_ekf.THRESHOLD, needs.slip_slope, slope_friction_ekf.run,
        slope_friction_ekf.severity,
    ),
)  # fmt: skip

RIVALS: dict[str, Rival] = {r.name: r for r in _ALL}
"""Prior art that the thesis cites in chapter 1, in its order: wheels, resistance, slope."""


def run_rivals(
    signals: Signals,
    vehicle: Vehicle,
    thresholds: Mapping[str, float] | None = None,
    names: Collection[str] | None = None,
) -> RivalResult:
    """Run rivals over one drive.

    Parameters
    ----------
    signals : Signals
        Truth and labels in it are not read.
    vehicle : Vehicle
    thresholds : mapping name -> float, optional
        In the unit of each rival, positive; those that are not named keep their default.
    names : collection of str, optional
        All by default.

    Returns
    -------
    RivalResult

    Raises
    ------
    ConfigError
        For an unknown name, or a threshold that is not positive and finite.
    """
    own = dict(thresholds or {})
    _check(own, [*own, *(RIVALS if names is None else names)])
    chosen = [r for r in RIVALS.values() if names is None or r.name in names]
    present = present_symbols(signals)
    missing = {r.name: r.needs(vehicle, present, 1e9 / signals.dt_ns) for r in chosen}
    ready = [r for r in chosen if not missing[r.name]]
    unavailable = tuple(Unavailable(n, m) for n, m in missing.items() if m)
    if not ready:
        return RivalResult((), (), unavailable)
    inputs = rival_inputs(signals, vehicle)
    tracks: list[Track] = []
    events: list[Event] = []
    for rival in ready:
        for track in rival.run(inputs, own.get(rival.name, rival.threshold)):
            tracks.append(track)
            events += _events(rival, track, inputs, signals.dt_ns)
    events.sort(key=lambda e: (e.start_s, e.detector, e.wheel or "", e.side or ""))
    return RivalResult(tuple(tracks), tuple(events), unavailable)


def _check(thresholds: Mapping[str, float], names: Collection[str]) -> None:
    for name in names:
        if name not in RIVALS:
            near = get_close_matches(name, RIVALS, n=1)
            raise ConfigError(
                f"no rival {name!r}", expected=", ".join(RIVALS), hint=near[0] if near else "one of these names"
            )
    for name, value in thresholds.items():
        if not 0.0 < value < np.inf:
            raise ConfigError(
                f"threshold {value!r} is not positive", where=name, expected=f"a number above 0 in {RIVALS[name].unit}"
            )


def _events(rival: Rival, track: Track, inputs: RivalInputs, dt_ns: int) -> list[Event]:
    f = inputs.features
    evidence: dict[str, tuple[str, np.ndarray]] = {
        "v_x": ("first", f["v_x_hat"]),
        "statistic_max": ("max", track.statistic),
    }
    if track.wheel is not None:
        slip = slip_of_wheel_speed(f[f"v_w_{track.wheel}"], f["v_x_hat"])
        evidence |= {
            "slip_min": ("min", slip),
            "slip_max": ("max", slip),
            "braking": ("any", inputs.braking[track.wheel]),
        }
    known: Evidence = evidence
    builder = EventBuilder(
        track.detector, wheel=track.wheel, side=track.side, threshold=track.threshold, dt_ns=dt_ns,
        severity=rival.severity,
    )  # fmt: skip
    return [*builder.push(track.active, track.statistic, known), *builder.finish()]
