"""The thresholds file, and the tuning of the slip-slope filter."""

from __future__ import annotations

from dataclasses import fields

from aqualog.book.markdown import code, fence, page, table
from aqualog.config.settings import JOINT_KEYS
from aqualog.detect.slip_slope.tuning import MEANINGS as TUNING_MEANINGS
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.detect.thresholds import DEFAULT, MEANINGS, UNITS
from aqualog.rivals.catalogue import RIVALS

__all__ = ["EXAMPLE", "text"]

_SUMMARY = "A thresholds file makes detectors more or less sensitive: one number per detector."
_HOW = """
Give it with `--thresholds thresholds.toml`. `aqualog evaluate --tune thresholds.toml` writes one. A larger value means
fewer alarms. A value that is left out keeps its default. The defaults are physical units and belong to no particular
car.
"""
EXAMPLE = """
[thresholds]
spin_down = 0.5
resistance = 0.25

[rivals]
wheel_thresholds = 0.1

[joint_cusum]
third = "resistance"
with_slope = false
gated = true
weights = { resistance = 1.0 }
"""
_RIVALS = """
`[rivals]` holds the thresholds of the methods of the prior art, which `aqualog evaluate --rivals` runs beside the
thesis' own. See [rivals](../validation/rivals.md).
"""
_JOINT = """
`[joint_cusum]` changes what enters the sum of the joint detector. See [joint_cusum](../method/joint_cusum.md).
"""
_TUNING = """
The filter of the slip slope has one tuning for all cars, in `aqualog/detect/slip_slope/tuning.py`. No file changes it;
the numbers stand here because results depend on them. See [slip_slope_filter](../method/slip_slope_filter.md).
k is 1/C, beta the slope ratio of the axles, delta the slip offset.
"""


def text() -> str:
    """The page."""
    own = [(code(f.name), UNITS[f.name], f"{getattr(DEFAULT, f.name):g}", MEANINGS[f.name]) for f in fields(DEFAULT)]
    rivals = [(code(r.name), r.unit, f"{r.threshold:g}", f"{r.title} {r.reference}") for r in RIVALS.values()]
    joint = [(code(k.name), k.kind, k.default, k.meaning) for k in JOINT_KEYS]
    tuning = [(code(n), unit, _shown(getattr(TUNING, n)), meaning) for n, (unit, meaning) in TUNING_MEANINGS.items()]
    return page(
        "Thresholds file",
        _SUMMARY,
        _HOW,
        fence(EXAMPLE, "toml"),
        "## `[thresholds]`",
        table(("key", "unit", "default", "meaning"), own),
        "`slip_slope_drop` lies between 0 and 1; all others are above 0.",
        "## `[rivals]`",
        _RIVALS,
        table(("key", "unit", "default", "method"), rivals),
        "## `[joint_cusum]`",
        _JOINT,
        table(("key", "type", "default", "meaning"), joint),
        "## Tuning of the slip-slope filter",
        _TUNING,
        table(("name", "unit", "value", "meaning"), tuning),
    )


def _shown(value: float) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"
