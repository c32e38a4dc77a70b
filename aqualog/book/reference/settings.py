"""Pages of the files that a user writes: signal map, campaign file, scenario, thresholds, boundaries."""

from __future__ import annotations

from aqualog.book.markdown import code, fence, number, page, table
from aqualog.campaign.definition import GROUP_NAMES
from aqualog.config.boundary import BOUNDARY_KEYS
from aqualog.config.campaign import CAMPAIGN_KEYS, RUN_KEYS
from aqualog.config.labels import LABEL_KEYS
from aqualog.config.reader import Key
from aqualog.config.scenario import SCENARIO_KEYS
from aqualog.config.signal_map import MAP_KEYS
from aqualog.config.thresholds import JOINT_KEYS
from aqualog.detect.registry import OWN, RIVALS, all_of
from aqualog.detect.slip_slope.tuning import MEANINGS as TUNING_MEANINGS
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.model.tyre import TYRE_KEYS, TYRES
from aqualog.trade.limits import described
from aqualog.validate.records import PLOTS

__all__ = [
    "BOUNDARIES_EXAMPLE", "MAP_EXAMPLE", "THRESHOLDS_EXAMPLE", "boundaries_page", "campaign_page", "map_page",
    "scenario_page", "thresholds_page",
]  # fmt: skip

_MAP = "A signal map says which channel of a log is which signal, and in which unit."
_MAP_HOW = """
`aqualog inspect LOG --write-map map.toml` proposes a map. Every command that reads logs takes one with
`--signals map.toml`. A log whose channels bear the [canonical names](signals.md) needs no map.

The path before a name (group, bus, message, topic, file) may be left out where the rest is unique. With several files,
`"gps.csv:speed"` names the file too. Unknown keys are errors, and the message names the nearest known one.
"""
MAP_EXAMPLE = """
[time]                      # tables only, where the time column does not say it
channel = "t_ms"
unit = "ms"

[csv]                       # CSV only, where the file does not prove it
separator = ";"             # or "tab", "space"
decimal = ","
encoding = "cp1252"

[csv."gps*.csv"]            # files of that name alone
separator = ","
decimal = "."

[signals]                   # SI value = scale * to_SI(raw) + offset
omega_fl = { channel = "ESP_19.ESP_VL_Radgeschw_02", unit = "km/h", invalid = [1022, 1023] }
a_x      = { channel = "/imu/data.linear_acceleration.x", offset = 1.5 }
torque_r = { channel = ["MotTq_filtered", "MotTq"], unit = "N*m", scale = 9.1 }
v_x      = "gps.csv:speed"  # a name alone will do

[sources."gps.csv"]         # `aqualog align` writes this
offset_s = 0.2              # positive: this source is late
drift_ppm = 12.0
at_s = 0.0
"""


def map_page() -> str:
    """The page."""
    rows = [(code(k.table), code(k.name), k.kind, k.unit, str(k.default), k.meaning) for k in MAP_KEYS]
    return page(
        "Signal map",
        _MAP,
        _MAP_HOW,
        "## Keys",
        table(("table", "key", "type", "unit", "default", "meaning"), rows),
        "## Example with every key",
        fence(MAP_EXAMPLE, "toml"),
    )


_CAMPAIGN = "A campaign file names the car, the signal map and the runs: which log was driven in which configuration."
_CAMPAIGN_HOW = """
`aqualog campaign init FOLDER` proposes all of it from a folder of logs. The [guide](../guide/campaign.md) shows how.
Paths are relative to the file that names them. Unknown keys are errors, and the message names the nearest known one.
"""
_CAMPAIGN_EXAMPLE = """
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


def campaign_page() -> str:
    """The page."""
    top = [(code(k.name), k.kind, str(k.default), k.meaning) for k in CAMPAIGN_KEYS]
    bounds = {n: f"{number(k.low)} ... {number(k.high)}" for n, k in RUN_KEYS.items() if k.kind == "number"}
    runs = [(code(k.name), k.kind, k.unit, bounds.get(n, ""), k.meaning) for n, k in RUN_KEYS.items()]
    runs.append(("`x_...`", "text or number", "", "", "a key of your own"))
    groups = [(code(n), ", ".join(map(code, keys))) for n, keys in GROUP_NAMES.items()]
    labels = [(code(k.name), k.kind, k.unit, k.meaning) for k in LABEL_KEYS]
    return page(
        "Campaign file",
        _CAMPAIGN,
        _CAMPAIGN_HOW,
        "## Keys of the file",
        table(("key", "type", "default", "meaning"), top),
        fence(_CAMPAIGN_EXAMPLE, "toml"),
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


_SCENARIO = "A scenario file says what a simulated car drives: speed, lanes of water, steering, sensors."
_SCENARIO_HOW = """
`aqualog simulate scenario.toml -o drive.mf4` drives it. The same scenario, model and seed give the same bytes. Keys
without a default have no effect if they are left out, unless they must be given. `[[lane]]`, `[[kick]]` and
`[[fault]]` may stand any number of times.
"""
_SCENARIO_EXAMPLE = """
vehicle = "vehicle.toml"         # relative to this file
tyre = "worn_summer"
pressure_bar = 1.9
duration_s = 20.0
seed = 1
speed_kmh = 98.0                 # or profile = [[0.0, 60.0], [20.0, 130.0]]  (t [s], v [km/h])

[[lane]]
start_s = 6.0
end_s = 14.0
water_depth_mm = 1.3
"""
_TYRES = """
`tyre` names one of the tyres below, or is a table: a `base` and the parameters that differ from it. The vehicle file's
slip slope and friction hold for a worn summer tyre at 1.9 bar and the static load.

The last column says where a value comes from. V: read in the source named. D: derived. K: general knowledge, not
verified. A: the one anchor, a worn summer tyre at low pressure in 1.3 mm of water that aquaplanes fully near 118 km/h.
"""
_TYRE_EXAMPLE = """
[tyre]
base = "worn_summer"
tread_depth = 0.003
"""


def scenario_page() -> str:
    """The page."""
    return page(
        "Scenario file",
        _SCENARIO,
        _SCENARIO_HOW,
        fence(_SCENARIO_EXAMPLE, "toml"),
        "## Keys",
        table(("key", "unit", "default", "bounds", "meaning"), map(_scenario_row, SCENARIO_KEYS.values())),
        "## Tyres",
        _TYRES,
        fence(_TYRE_EXAMPLE, "toml"),
        table(("key", "unit", *(code(t) for t in TYRES), "bounds", "meaning", "where it comes from"), _tyres()),
    )


def _scenario_row(key: Key) -> tuple[str, ...]:
    default = "" if key.default is None else code(key.default) if isinstance(key.default, str) else f"{key.default:g}"
    bounds = f"{number(key.low)} ... {number(key.high)}" if number(key.low) else ""
    return code(key.path), key.unit, default, bounds, key.meaning


def _tyres() -> list[tuple[str, ...]]:
    return [
        (
            code(k.name),
            k.unit,
            *(f"{getattr(t, k.name):g}" for t in TYRES.values()),
            f"{k.low:g} ... {k.high:g}",
            k.meaning,
            k.source,
        )
        for k in TYRE_KEYS.values()
    ]


_THRESHOLDS = "A thresholds file makes detectors more or less sensitive: one number per detector."
_THRESHOLDS_HOW = """
Give it with `--thresholds thresholds.toml`. `aqualog evaluate --tune thresholds.toml` writes one. A larger value means
fewer alarms. A value that is left out keeps its default. The defaults are physical units and belong to no particular
car.
"""
THRESHOLDS_EXAMPLE = """
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


_TESTS = (
    "`aqualog test` has a file of its own, which names only what differs: `[straight]`, below it `yaw_rate = 0.08`. "
    "K: general knowledge."
)


def thresholds_page() -> str:
    """The page."""
    own = [(code(d.name), d.unit, f"{d.threshold:g}", d.meaning) for d in all_of(*OWN)]
    rivals = [(code(r.name), r.unit, f"{r.threshold:g}", f"{r.title} {r.reference}") for r in RIVALS.values()]
    joint = [(code(k.name), k.kind, str(k.default), k.meaning) for k in JOINT_KEYS]
    tuning = [(code(n), unit, _shown(getattr(TUNING, n)), meaning) for n, (unit, meaning) in TUNING_MEANINGS.items()]
    tests = [(code(d.path), d.unit, f"{d.value:g}", d.meaning, d.source) for d in described()]
    return page(
        "Thresholds file",
        _THRESHOLDS,
        _THRESHOLDS_HOW,
        fence(THRESHOLDS_EXAMPLE, "toml"),
        "## `[thresholds]`",
        table(("key", "unit", "default", "meaning"), own),
        "`slip_slope_drop` and `margin` lie between 0 and 1; all others are above 0.",
        "## `[rivals]`",
        _RIVALS,
        table(("key", "unit", "default", "method"), rivals),
        "## `[joint_cusum]`",
        _JOINT,
        table(("key", "type", "default", "meaning"), joint),
        "## Tuning of the slip-slope filter",
        _TUNING,
        table(("name", "unit", "value", "meaning"), tuning),
        "## Tyre tests: `--limits`",
        _TESTS,
        table(("key", "unit", "default", "meaning", "source"), tests),
    )


def _shown(value: float) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"


_BOUNDARIES = "A boundaries file says how far a measured car may be from its simulation."
_BOUNDARIES_HOW = """
Give it to `aqualog validate` with `--boundaries boundaries.toml`. A plot of the file takes the place of the built-in
one with the same y and x. Numbers of a standard come from your own copy of it: none is built in.
"""
BOUNDARIES_EXAMPLE = """
agreed = 0.95
built_in = false

[[plot]]
y = "a_x"
x = "t"
x_offset = 0.1
y_offset = 0.15
y_gain = 0.05

[[plot]]
y = "a_y"
x = "steer_angle"
x_offset = 0.002
y_offset = 0.2
"""


def boundaries_page() -> str:
    """The page."""
    keys = [
        (code(k.name), k.kind, k.unit, "" if k.default is None else str(k.default), k.meaning) for k in BOUNDARY_KEYS
    ]
    own = [
        (p.y, p.x, number(p.tolerance.x_offset), number(p.tolerance.y_offset), number(p.tolerance.y_gain))
        for p in PLOTS
    ]
    return page(
        "Boundaries file",
        _BOUNDARIES,
        _BOUNDARIES_HOW,
        fence(BOUNDARIES_EXAMPLE, "toml"),
        "## Keys",
        table(("key", "type", "unit", "default", "meaning"), keys),
        "## Built-in plots",
        table(("y", "x", "x_offset", "y_offset", "y_gain"), own),
    )
