"""Keys and values of a campaign's configurations as a reader sees them, and names of files made from them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from aqualog.campaign.bins import Group
from aqualog.report.values import cut, name_digest, number

__all__ = ["file_name", "group_text", "key_title", "value_text"]

_STEM = 60  # characters of a name that stay in a file name
_TITLES = {
    "pressure_front_bar": "gauge pressure, front", "pressure_rear_bar": "gauge pressure, rear",
    "water_depth_mm": "water depth", "water_depth_left_mm": "water depth, left track", "load_front_kg": "load, front",
    "load_rear_kg": "load, rear", "tread_depth_mm": "tread depth", "lane_start_s": "lane begins",
    "lane_end_s": "lane ends",
}  # fmt: skip
_UNITS = {"bar": "bar", "mm": "mm", "kg": "kg", "s": "s"}
_NOT_GIVEN = "not given"


def key_title(key: str) -> str:
    """`pressure_rear_bar` -> `gauge pressure, rear`; own columns without their x_."""
    return cut(_TITLES.get(key, key.removeprefix("x_").replace("_", " ")))


def value_text(key: str, value: float | str | None, *, is_alone: bool = True) -> str:
    """A value with its unit; `is_alone`: without its key beside it, so that it says front or rear itself."""
    if value is None or value == "":
        return f"{key_title(key)} {_NOT_GIVEN}"
    if isinstance(value, str):
        return cut(value.removeprefix("vehicle_") if key == "vehicle" else value)
    if key == "water_depth_mm" and value == 0.0:
        return "dry"
    unit = _UNITS.get(key.rpartition("_")[2], "")
    text = f"{number(value, 1) if unit == 'bar' and value == round(value, 1) else f'{value:g}'} {unit}".rstrip()
    text = f"+{text}" if key.startswith("load_") and value > 0.0 else text
    where = {"load_front_kg": " front", "load_rear_kg": " rear", "pressure_front_bar": " front"}.get(key, "")
    return f"{text}{where if is_alone else ''}"


def group_text(group: Group, *, without: Sequence[str] = ()) -> str:
    """A configuration in one line, without loads of 0 kg."""
    ordered = sorted(group, key=lambda item: item[0] == "vehicle")  # readers look for tyre and pressure first
    shown = {k: v for k, v in ordered if k not in without and not (k.startswith("load_") and v in (0.0, None))}
    front, rear = (shown.get(f"pressure_{axle}_bar") for axle in ("front", "rear"))
    if front is not None and front == rear:
        shown.pop("pressure_front_bar")
    by_axle = {"pressure_rear_bar": " rear"} if front is not None and rear is not None and front != rear else {}
    return " · ".join(value_text(k, v) + by_axle.get(k, "") for k, v in shown.items()) or "all runs"


def file_name(index: int, name: str) -> str:
    """Name of a run's page without suffix: number, harmless characters of the run's name, short hash of the name."""
    stem = name.replace("\\", "/").rpartition("/")[2].rpartition(".")[0] or name[:200]
    plain = unicodedata.normalize("NFKD", stem[:200]).encode("ascii", "ignore").decode("ascii").lower()
    slug = re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:_STEM].strip("-")
    return "-".join(p for p in (f"{index + 1:04d}", slug, name_digest(f"{index}:{name}")[:8]) if p)
