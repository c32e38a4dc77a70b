"""Layouts of viewers for a written log: panels that name its channels, for PlotJuggler and Foxglove."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.core.errors import ConfigError
from aqualog.io.write_log import LogGroup
from aqualog.report.figures import PALETTE

__all__ = ["LAYOUT_SUFFIXES", "Panel", "foxglove_layout", "layout_texts", "panels_of", "plotjuggler_layout"]

LAYOUT_SUFFIXES = {".mcap": (".plotjuggler.xml", ".foxglove.json"), ".csv": (".plotjuggler.xml",),
                   ".parquet": (".plotjuggler.xml",)}  # fmt: skip
"""Suffix of a written log -> those of its layouts. PlotJuggler and Foxglove open no MF4."""

# title and unit of a panel, and the names or beginnings of names (`_` at the end) that it shows
_PANELS = (
    ("Speed", "m/s", ("v_x", "v_x_hat", "v_w_fl", "v_w_fr", "v_w_rl", "v_w_rr")),
    ("Slip speed: wheel less car", "m/s", ("v_w_delta_fl", "v_w_delta_fr", "v_w_delta_rl", "v_w_delta_rr")),
    ("Resistance measure", "m/s^2", ("delta_a_x", "delta_a_x_offset")),
    ("Slip slope", "-", ("slip_slope_left", "slip_slope_right", "slip_slope_axle", "slip_slope_ref_")),
    ("Criteria and joint detectors", "-", ("criterion_", "joint_criteria", "joint_cusum")),
    ("Detections", "bool", ("_bit",)),
)  # fmt: skip


class Panel(NamedTuple):
    """One panel: its title with the unit, and its channels as (group, name, unit)."""

    title: str
    channels: tuple[tuple[str, str, str], ...]


def panels_of(groups: Sequence[LogGroup]) -> list[Panel]:
    """Return the panels that these channels fill: speeds, slip, resistance, slip slope, criteria, detections."""
    there = [(g.name, n, unit) for g in groups for n, (unit, _, _) in g.columns.items()]
    found = []
    for title, unit, names in _PANELS:
        own = tuple(c for c in there if any(_is_named(c[1], name) for name in names))
        if own:
            found.append(Panel(f"{title} [{unit}]" if unit not in ("-", "bool") else title, own))
    return found


def _is_named(channel: str, name: str) -> bool:
    if name == "_bit":
        return channel.endswith("_bit")
    return channel == name or (name.endswith("_") and channel.startswith(name) and not channel.endswith("_bit"))


def layout_texts(path: Path, groups: Sequence[LogGroup]) -> dict[Path, Callable[[], str]]:
    """Return the layouts for a written log: the name of each file beside it, and what makes its text.

    Raises
    ------
    ConfigError
        If no viewer that has layouts opens a log of this suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in LAYOUT_SUFFIXES:
        raise ConfigError(
            f"no viewer that has layouts opens {suffix}", where=str(path), expected=" ".join(LAYOUT_SUFFIXES),
            hint="asammdf shows the events of an MF4 without a layout",
        )  # fmt: skip
    makers: Mapping[str, Callable[[], str]] = {
        ".plotjuggler.xml": lambda: plotjuggler_layout(panels_of(groups), suffix),
        ".foxglove.json": lambda: foxglove_layout(panels_of(groups)),
    }
    return {path.with_name(path.stem + s): makers[s] for s in LAYOUT_SUFFIXES[suffix]}


def plotjuggler_layout(panels: Sequence[Panel], suffix: str) -> str:
    """Return the layout as PlotJuggler saves it: one tab, its panels above each other."""
    root = ET.Element("root")
    window = ET.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    tab = ET.SubElement(window, "Tab", tab_name="aqualog", containers="1")
    sizes = ";".join([f"{1.0 / len(panels):.6f}"] * len(panels)) if panels else "1"
    split = ET.SubElement(
        ET.SubElement(tab, "Container"), "DockSplitter", orientation="-", count=str(len(panels)), sizes=sizes
    )
    for panel in panels:
        area = ET.SubElement(split, "DockArea", name=panel.title)
        plot = ET.SubElement(area, "plot", style="Lines", mode="TimeSeries", flip_x="false", flip_y="false")
        ET.SubElement(plot, "limitY")
        for i, (group, name, unit) in enumerate(panel.channels):
            ET.SubElement(plot, "curve", name=_curve(group, name, unit, suffix), color=PALETTE[i % len(PALETTE)])
    ET.SubElement(window, "currentTabIndex", index="0")
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    plugins = ET.SubElement(root, "Plugins")
    if suffix == ".csv":  # else PlotJuggler asks which column is the time
        ET.SubElement(ET.SubElement(plugins, "plugin", ID="DataLoad CSV"), "default", delimiter="0", time_axis="t [s]")
    for name in ("customMathEquations", "snippets"):
        ET.SubElement(root, name)
    ET.indent(root, " ")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ET.tostring(root, encoding='unicode')}\n"


def _curve(group: str, name: str, unit: str, suffix: str) -> str:
    """The name of a channel in PlotJuggler: topic and field, or the heading of the column."""
    if suffix == ".mcap":
        return f"/{group}/{name}"
    return f"{name} [{unit}]" if suffix == ".csv" and unit else name


def foxglove_layout(panels: Sequence[Panel]) -> str:
    """Return the layout as Foxglove exports it: plots above each other, by topic and field."""
    plots = {f"Plot!aqualog{i}": _plot(panel) for i, panel in enumerate(panels)}
    document = {
        "configById": plots, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1},
        "layout": _stacked(list(plots)),
    }  # fmt: skip
    return json.dumps(document, indent=1) + "\n"


def _plot(panel: Panel) -> dict[str, Any]:
    paths = [
        {"value": f"/{group}.{name}", "enabled": True, "timestampMethod": "receiveTime", "label": name}
        for group, name, _ in panel.channels
    ]
    return {
        "foxglovePanelTitle": panel.title, "paths": paths, "showXAxisLabels": True, "showYAxisLabels": True,
        "showLegend": True, "legendDisplay": "left", "showPlotValuesInLegend": True, "isSynced": True,
        "xAxisVal": "timestamp", "sidebarDimension": 240,
    }  # fmt: skip


def _stacked(names: Sequence[str]) -> Any:
    """A tree of splits in which all panels are of one height; the name itself of one panel."""
    if len(names) < 2:
        return names[0] if names else None
    share = round(100.0 / len(names), 3)
    return {"first": names[0], "second": _stacked(names[1:]), "direction": "column", "splitPercentage": share}
