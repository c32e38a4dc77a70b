"""What a model changes for the detectors on a wet drive of the world: false alarms off the water, finds on it."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import detect_drive
from aqualog.diagnose.consequence import DETECTORS
from aqualog.diagnose.extended import extended_inputs
from aqualog.evaluate.drives import labels_in
from aqualog.evaluate.judge import beginning_in
from aqualog.evaluate.labels import joined, without
from aqualog.model.term import Model

__all__ = ["consequence"]


def consequence(signals: Signals, vehicle: Vehicle, models: dict[str, Model]) -> dict[str, float]:
    """`alarms_NAME` and `found_NAME` under each model, `km` off the water, `passes` over water."""
    labels = labels_in(signals)
    t = signals.array("t")
    whole = [(float(t[0]), float(t[-1]) + signals.dt)]
    water = list(labels.water) if labels is not None else []
    dry = without(whole, labels.water_widened if labels is not None else [])
    out: dict[str, float] = {"passes": float(len(water))}
    for name, model in models.items():
        extended = extended_inputs(signals, vehicle, model)
        result = detect_drive(extended.signals, extended.vehicle)
        alarms, found = 0, np.zeros(len(water), dtype=bool)
        for detector in DETECTORS:
            events = joined(((e.start_s, e.end_s) for e in result.events if e.detector == detector), 0.0)
            alarms += len(beginning_in(events, dry))
            found |= np.array([any(a <= e[0] < b for e in events) for a, b in water], dtype=bool)
        out[f"alarms_{name}"], out[f"found_{name}"] = float(alarms), float(found.sum())
        if "km" not in out:
            v = np.nan_to_num(signals.array("v_x"))
            out["km"] = float(np.sum(v[np.any([(t >= a) & (t < b) for a, b in dry], axis=0)])) * signals.dt / 1e3
    return out
