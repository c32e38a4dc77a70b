"""Words of detections: detectors, and the evidence for an event."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from aqualog.core.records import Event
from aqualog.report.sections import Lines, Section
from aqualog.report.values import KMH, LONGEST_WORD, number, readable

if TYPE_CHECKING:
    from aqualog.detect.detector import Detector

__all__ = ["caption", "detector_name", "evidence_parts", "not_judged", "speed_kmh"]

# stem of the key of evidence (lowest and highest value where it ends in _min and _max) -> label, factor, unit, decimals
_EVIDENCE = {
    "v_x": ("speed", KMH, "km/h", 0),
    "slip": ("slip", 100.0, "%", 1),
    "a_w_delta": ("acceleration difference", 1.0, "m/s²", 1),
    "variance": ("variance", 1.0, "(m/s²)²", 2),
    "slope": ("slip slope", 1.0, "", 1),
    "slope_ref": ("dry slip slope", 1.0, "", 1),
    "mu": ("traction coefficient", 1.0, "", 3),
    "delta_a_x": ("resistance measure", 1.0, "m/s²", 2),
    "margin": ("distance to full aquaplaning", KMH, "km/h", 0),
    "contact": ("contact share", 100.0, "%", 0),
    "force_residual": ("off the tie-rod model", 1.0, "N", 0),
    "torque_residual": ("off the steering model", 1.0, "N·m", 1),
}
_ELSEWHERE = ("v_x", "braking", "braking_at_start", "full", "decided_by", "from_steering_torque")
_CRITERIA = {1: "spin-down", 2: "minor spin-down", 3: "spin-up", 4: "slip slope", 5: "resistance"}


@cache
def _detectors() -> Mapping[str, Detector]:
    # the registry compiles the detectors, which takes longer than any page that names none
    from aqualog.detect.registry import OWN, all_of

    return {d.name: d for d in all_of(*OWN)}


def detector_name(detector: str) -> str:
    """`minor_spin_down` -> `Minor spin-down`."""
    known = _detectors().get(detector)
    return known.title if known else readable(detector, LONGEST_WORD).replace("_", " ")


def caption(detector: str) -> str:
    """Meaning of a detector's statistic in one phrase."""
    known = _detectors().get(detector)
    return known.statistic if known else "statistic"


def speed_kmh(event: Event) -> float:
    """Speed at the beginning of an event [km/h], NaN if the evidence has none."""
    v_x = event.evidence.get("v_x")
    return KMH * v_x if isinstance(v_x, float | int) else math.nan


def evidence_parts(evidence: Mapping[str, Any]) -> list[str]:
    """Evidence for an event as phrases, without the speed, which has its own column."""
    parts = ["while braking"] if evidence.get("braking_at_start") is True else []
    met = [name for n, name in _CRITERIA.items() if evidence.get(f"criterion_{n}") is True]
    parts += [f"criteria: {' + '.join(met)}"] if met else []
    decided = evidence.get("decided_by")
    parts += [f"decided by {' + '.join(detector_name(d).lower() for d in decided)}"] if decided else []
    parts += ["from the steering torque"] if evidence.get("from_steering_torque") is True else []
    stems: dict[str, dict[str, Any]] = {}
    for key, value in evidence.items():
        if key in _ELSEWHERE or key.startswith(("criterion_", "term_")):
            continue
        stem, _, which = key.rpartition("_")
        stem, which = (stem, which) if which in ("min", "max") else (key, "")
        stems.setdefault(stem, {})[which] = value
    return parts + [p for stem, values in stems.items() if (p := _part(stem, values))]


def _part(stem: str, values: Mapping[str, Any]) -> str:
    label, factor, unit, decimals = _EVIDENCE.get(stem, (readable(stem, LONGEST_WORD).replace("_", " "), 1.0, "", None))
    single = values.get("", 0.0)
    if isinstance(single, bool):
        return label if single else ""
    if not isinstance(single, float | int):
        return f"{label} {readable(str(single), LONGEST_WORD)}"
    numbers = {
        k: number(factor * v, decimals) for k, v in values.items() if isinstance(v, float | int) and math.isfinite(v)
    }
    if "min" in numbers and "max" in numbers:
        return f"{label} {numbers['min']} … {numbers['max']} {unit}".rstrip()
    words = {"min": "down to ", "max": "up to ", "": ""}
    # the lowest value matters more than the one at the beginning
    found = [k for k in ("min", "max", "") if k in numbers][:1]
    return f"{label} {words[found[0]]}{numbers[found[0]]} {unit}".rstrip() if found else ""


def not_judged(
    unavailable: Iterable[tuple[str, Sequence[str]]], limited: Iterable[tuple[str, Sequence[str]]]
) -> list[Section]:
    """Detectors that lack signals, and those that judge without some, as lists for a terminal."""
    return [
        Section(title, [Lines([(name, f"{word} {_lacking(missing)}") for name, missing in found if missing])],
                where="text")
        for title, word, found in (("Not judged:", "missing", unavailable), ("Judged in part:", "without", limited))
    ]  # fmt: skip


def _lacking(missing: Sequence[str]) -> str:
    """Missing signals of a detector, with possible replacements."""
    text = ", ".join(missing)
    for axle in "fr":  # an axle's torque will do
        text = text.replace(f"torque_{axle}l, torque_{axle}r", f"torque_{axle}l, torque_{axle}r (or torque_{axle})")
    return text
