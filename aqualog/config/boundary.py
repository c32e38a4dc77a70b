"""Boundaries file: TOML with the tolerances of the cross plots by which `aqualog validate` judges a simulation."""

from __future__ import annotations

from pathlib import Path

from aqualog.config.reader import Key, Table, read
from aqualog.validate.boundary import Tolerance
from aqualog.validate.records import ABSCISSAE, AGREED, PLOTS, SIGNALS, Plan, Plot

__all__ = ["BOUNDARY_KEYS", "load_boundaries"]

_Y, _X = "of y: m/s^2, rad/s, m/s or N", "of x: s, m/s, N*m, m/s^2 or rad"
BOUNDARY_KEYS = (
    Key("", "agreed", "number", "-", AGREED, "share of the time within the boundaries that a valid range needs", 0.5,
        1.0),
    Key("", "built_in", "true or false", "", "true", "whether the built-in plots stand beside those of the file"),
    Key("plot", "y", "text", "", "", f"what is compared: {', '.join(SIGNALS)}; must be given"),
    Key("plot", "x", "text", "", "t", f"what it goes over: {', '.join(ABSCISSAE)}"),
    Key("plot", "x_offset", "number", _X, 0.0, "eps_x = x_offset + x_gain |x|", 0.0, 1e6),
    Key("plot", "x_gain", "number", "-", 0.0, "the same", 0.0, 10.0),
    Key("plot", "y_offset", "number", _Y, 0.0, "eps_y = y_offset + y_gain |y|; one of both above 0", 0.0, 1e6),
    Key("plot", "y_gain", "number", "-", 0.0, "the same", 0.0, 10.0),
)  # fmt: skip
"""Keys of a boundaries file."""
_OF_PLOT = {k.name: k for k in BOUNDARY_KEYS if k.table == "plot" and k.kind == "number"}


def load_boundaries(path: Path) -> Plan:
    """Read and check a boundaries file.

    A plot of the file takes the place of the built-in one with the same y and x. The tolerance of its y is then the
    user's, also where drives repeat each other.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    file = read(path, "boundaries file")
    file.check_names("agreed", "built_in", "plot")
    agreed = file.number("agreed", BOUNDARY_KEYS[0])
    built_in = file.get("built_in", True)
    if not isinstance(built_in, bool):
        file.add("built_in", f"built_in = {repr(built_in)[:40]} is not true or false")
    own: dict[tuple[str, str], Plot] = {}
    for table in file.tables("plot"):
        plot = _plot(table)
        if (plot.y, plot.x) in own:
            table.add("y", f"{plot.name} stands twice")
        own[plot.y, plot.x] = plot
    if built_in is False and not own:
        file.add("built_in", "built_in = false leaves no plot; write [[plot]]")
    file.faults.raise_if_any()
    kept = [p for p in PLOTS if built_in and (p.y, p.x) not in own]
    return Plan((*own.values(), *kept), AGREED if agreed is None else agreed, frozenset(y for y, _ in own))


def _plot(table: Table) -> Plot:
    values = table.numbers(_OF_PLOT, "y", "x")
    if "y" not in table:
        table.add("", f"plot: y is missing; one of {', '.join(SIGNALS)}")
    y = table.choice("y", SIGNALS, next(iter(SIGNALS)))
    x = table.choice("x", ABSCISSAE, "t")
    if not values.get("y_offset") and not values.get("y_gain"):
        table.add("y_offset", f"plot {y} over {x}: neither y_offset nor y_gain is above 0")
    return Plot(y, x, Tolerance(**values))
