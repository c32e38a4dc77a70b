"""Names, units and numbers as a reader sees them."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog.core.records import Event
from aqualog.core.units import displayed_unit
from aqualog.detect.registry import all_of

__all__ = [
    "CELL", "NOTE", "caption", "cut", "detector_name", "evidence_parts", "lacking", "name_digest", "number", "place",
    "plot_text", "pretty_unit", "readable", "speed_kmh",
]  # fmt: skip

_KMH = 3.6
LONGEST = 90  # characters of a name that are shown
CELL = 200  # of a cell in a terminal
NOTE = 1000  # of a sentence that names what a log holds
LONGEST_WORD = 200  # characters without a space that a page shows
LONGEST_TEXT = 4000  # characters in one place of a page
# characters that a terminal or a browser acts on instead of showing: controls and marks of writing direction
_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
_LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")
_DETECTORS = {d.name: d for d in all_of("effect", "joint")}
# stem of the key of evidence (lowest and highest value where it ends in _min and _max) -> label, factor, unit, decimals
_EVIDENCE = {
    "v_x": ("speed", _KMH, "km/h", 0),
    "slip": ("slip", 100.0, "%", 1),
    "a_w_delta": ("acceleration difference", 1.0, "m/s²", 1),
    "variance": ("variance", 1.0, "(m/s²)²", 2),
    "slope": ("slip slope", 1.0, "", 1),
    "slope_ref": ("dry slip slope", 1.0, "", 1),
    "mu": ("traction coefficient", 1.0, "", 3),
    "delta_a_x": ("resistance measure", 1.0, "m/s²", 2),
    "force_residual": ("off the tie-rod model", 1.0, "N", 0),
    "torque_residual": ("off the steering model", 1.0, "N·m", 1),
}
_TOLD = ("v_x", "braking", "braking_at_start", "full", "decided_by", "from_steering_torque")  # elsewhere
_CRITERIA = {1: "spin-down", 2: "minor spin-down", 3: "spin-up", 4: "slip slope", 5: "resistance"}


def detector_name(detector: str) -> str:
    """`minor_spin_down` -> `Minor spin-down`."""
    return _DETECTORS[detector].title if detector in _DETECTORS else readable(detector, LONGEST_WORD).replace("_", " ")


def caption(detector: str) -> str:
    """Meaning of a detector's statistic in one phrase."""
    return _DETECTORS[detector].statistic if detector in _DETECTORS else "statistic"


def place(wheel: str | None, side: str | None) -> str:
    """`FR`, or the side, or an empty string."""
    return wheel.upper() if wheel else (side or "")


def pretty_unit(unit: str) -> str:
    """Unit as pages and text show it."""
    return readable(displayed_unit(unit), LONGEST_WORD)


def number(x: float, decimals: int | None = None) -> str:
    """A number for a table: fixed decimals, or three significant digits; a dash for NaN and infinities."""
    if not math.isfinite(x):
        return "–"
    if decimals is None and 999.5 <= abs(x) < 1e6:
        decimals = 0
    text = f"{x:.{decimals}f}" if decimals is not None else f"{x:.3g}"
    return text.replace("-", "−") if "e" not in text else text


def speed_kmh(event: Event) -> float:
    """Speed at the beginning of an event [km/h], NaN if the evidence has none."""
    v_x = event.evidence.get("v_x")
    return _KMH * v_x if isinstance(v_x, float | int) else math.nan


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
        if key in _TOLD or key.startswith(("criterion_", "term_")):
            continue
        stem, _, which = key.rpartition("_")
        stem, which = (stem, which) if which in ("min", "max") else (key, "")
        stems.setdefault(stem, {})[which] = value
    return parts + [p for stem, values in stems.items() if (p := _part(stem, values))]


def _part(stem: str, values: Mapping[str, Any]) -> str:
    label, factor, unit, decimals = _EVIDENCE.get(stem, (readable(stem, LONGEST_WORD).replace("_", " "), 1.0, "", None))
    single = values.get("", 0.0)
    if not isinstance(single, float | int) or isinstance(single, bool):
        return (
            (label if single else "") if isinstance(single, bool) else f"{label} {readable(str(single), LONGEST_WORD)}"
        )
    numbers = {
        k: number(factor * v, decimals) for k, v in values.items() if isinstance(v, float | int) and math.isfinite(v)
    }
    if "min" in numbers and "max" in numbers:
        return f"{label} {numbers['min']} … {numbers['max']} {unit}".rstrip()
    words = {"min": "down to ", "max": "up to ", "": ""}
    # the lowest value matters more than the one at the beginning
    found = [k for k in ("min", "max", "") if k in numbers][:1]
    return f"{label} {words[found[0]]}{numbers[found[0]]} {unit}".rstrip() if found else ""


def readable(text: str, most: int = LONGEST_TEXT) -> str:
    """Text as a page can show it: shortened with a mark that says how long it was, without control characters."""
    if len(text) > most:
        text = f"{text[: most - 40]}… ({len(text)} characters)"
    if len(text) > LONGEST_WORD:
        text = _LONG_WORD.sub(_shortened, text)
    return text if text.isprintable() else _OBEYED.sub("\ufffd", text)


def _shortened(word: re.Match[str]) -> str:
    return f"{word[0][: LONGEST_WORD - 20]}… ({len(word[0])} characters)"


def plot_text(text: str, most: int = 80) -> str:
    """Text for plotly, which reads `<b>`, entities and `%{...}` as markup: those characters become look-alikes.

    Longer text than `most` characters is cut: plotly does not wrap.
    """
    text = readable(text if len(text) <= most else f"{text[: most - 1]}…")
    return text.replace("&", "＆").replace("<", "‹").replace(">", "›").replace("%{", "％{").replace("$", "＄")


def cut(text: str, most: int = LONGEST) -> str:
    """One line of at most so many characters; what is cut gets a hash, so that two long names stay two."""
    line = "".join(c if c.isprintable() else "\ufffd" for c in text[:most])
    return line if len(text) <= most else f"{line[: most - 12]}… #{name_digest(text)[:8]}"


def name_digest(text: str) -> str:
    """A digest that distinguishes two names whose shown parts are equal."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def lacking(missing: Sequence[str]) -> str:
    """Missing signals of a detector, with possible replacements."""
    text = ", ".join(missing)
    for axle in "fr":  # an axle's torque will do
        text = text.replace(f"torque_{axle}l, torque_{axle}r", f"torque_{axle}l, torque_{axle}r (or torque_{axle})")
    return text
