"""The signal map: every table and key."""

from __future__ import annotations

from aqualog.book.markdown import code, fence, page, table
from aqualog.config.signal_map import MAP_KEYS

__all__ = ["EXAMPLE", "text"]

_SUMMARY = "A signal map says which channel of a log is which signal, and in which unit."
_HOW = """
`aqualog inspect LOG --write-map map.toml` proposes a map. Every command that reads logs takes one with
`--signals map.toml`. A log whose channels bear the [canonical names](signals.md) needs no map.

The path before a name (group, bus, message, topic, file) may be left out where the rest is unique. With several files,
`"gps.csv:speed"` names the file too. Unknown keys are errors, and the message names the nearest known one.
"""
EXAMPLE = """
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


def text() -> str:
    """The page."""
    rows = [(code(k.table), code(k.name), k.kind, k.unit, k.default, k.meaning) for k in MAP_KEYS]
    return page(
        "Signal map",
        _SUMMARY,
        _HOW,
        "## Keys",
        table(("table", "key", "type", "unit", "default", "meaning"), rows),
        "## Example with every key",
        fence(EXAMPLE, "toml"),
    )
