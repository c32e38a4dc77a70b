"""The campaign file, its table of runs, and labels."""

from __future__ import annotations

from aqualog.book.markdown import code, fence, number, page, table
from aqualog.campaign.records import GROUP_NAMES
from aqualog.config.campaign import CAMPAIGN_KEYS, RUN_KEYS, RunKey
from aqualog.config.labels import LABEL_KEYS

__all__ = ["text"]

_SUMMARY = "A campaign file names the car, the signal map and the runs: which log was driven in which configuration."
_HOW = """
`aqualog campaign init FOLDER` proposes all of it from a folder of logs. The [guide](../guide/campaign.md) shows how.
Paths are relative to the file that names them. Unknown keys are errors, and the message names the nearest known one.
"""
_EXAMPLE = """
name = "wet lane, May"
vehicle = "vehicle.toml"
signals = "map.toml"          # where channels have names of their own
runs = "runs.csv"
"""
_TABLES = """
name = "two runs"
vehicle = "vehicle.toml"

[[run]]
log = "monday_07.mf4"
tyre = "worn summer"
water_depth_mm = 1.3
pressure_front_bar = 2.2
pressure_rear_bar = 2.2
lane_start_s = 8.0
lane_end_s = 16.0
x_driver = "second"           # a grouping key of your own

[[run]]
log = ["monday_08_can.mf4", "monday_08_gps.csv"]
tyre = "worn summer"
water_depth_mm = 0.0          # a dry run
"""
_RUNS = """
A run is a line of `runs.csv` or a `[[run]]` table. The table may have semicolons and decimal commas. A column whose
name begins with `x_` is yours: it passes through, and results can be grouped by it.

Loads are added to the car before anything is measured. aqualog takes the place of the water from the lane's times,
else from the labels, else from the signal `on_water`. A depth of 0 marks a dry run. One log may stand in several runs
with separate lanes.
"""
_BY = """
`--by` takes any key that a run gives, and these short names:
"""
_LABELS = """
A labels file is a CSV file with commas and decimal points. It says what was there. A file with a heading alone says
that the road was dry. `full`, `partial` (also `aquaplaning`) and `water` are scored, and full aquaplaning counts as
partial too. A detector's name marks what that detector is to see. All other words, such as `snow`, `braking` or
`kerb`, serve the table of confusion.
"""


def text() -> str:
    """The page."""
    top = [(code(k.name), k.kind, k.default, k.meaning) for k in CAMPAIGN_KEYS]
    runs = [(code(k.name), k.kind, k.unit, _bounds(k), k.meaning) for k in RUN_KEYS.values()]
    runs.append(("`x_...`", "text or number", "", "", "a key of your own"))
    groups = [(code(n), ", ".join(map(code, keys))) for n, keys in GROUP_NAMES.items()]
    labels = [(code(k.name), k.kind, k.unit, k.meaning) for k in LABEL_KEYS]
    return page(
        "Campaign file",
        _SUMMARY,
        _HOW,
        "## Keys of the file",
        table(("key", "type", "default", "meaning"), top),
        fence(_EXAMPLE, "toml"),
        "## Keys of a run",
        _RUNS,
        table(("key", "type", "unit", "bounds", "meaning"), runs),
        fence(_TABLES, "toml"),
        "## Groups",
        _BY,
        table(("name", "keys"), groups),
        "## Labels",
        _LABELS,
        table(("column", "type", "unit", "meaning"), labels),
    )


def _bounds(key: RunKey) -> str:
    return f"{number(key.low)} ... {number(key.high)}" if key.kind == "number" else ""
