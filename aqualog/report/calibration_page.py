"""The page of `calibrate`: one file that needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from markupsafe import Markup

from aqualog import __version__
from aqualog.calibrate.records import Calibration
from aqualog.report.calibration_document import DRIVE_HEADER, PARAMETER_HEADER, drive_cells, parameter_cells
from aqualog.report.figures.balance_residual import balance_residuals
from aqualog.report.offline import TEMPLATES, content_policy, environment, json_island, plotly_js

__all__ = ["render_calibration_page", "write_calibration_page"]


def write_calibration_page(c: Calibration, path: Path, *, title: str, notes: tuple[str, ...] = ()) -> None:
    """Write the page to exactly this path; arguments as `render_calibration_page`."""
    path.write_bytes(render_calibration_page(c, title=title, notes=notes).encode("utf-8", "replace"))


def render_calibration_page(c: Calibration, *, title: str, notes: tuple[str, ...] = ()) -> str:
    """The page as HTML; the same text for the same result.

    Parameters
    ----------
    c : Calibration
    title : str
        Names the car or the drives; may hold anything, it is escaped.
    notes : tuple of str
        On the files, beside those of the result; escaped too.
    """
    plots: dict[str, Any] = {f"residual-{i}": figure for i, figure in enumerate(balance_residuals(c))}
    scripts = {"plotly": plotly_js(), "page": _text("figures.js")}
    return environment(TEMPLATES).get_template("calibration.html.j2").render(
        title=title,
        version=__version__,
        policy=content_policy(scripts.values()),
        # Markup only for the package's own files, plotly.js and what json_island has escaped
        css=Markup(_text("page.css") + _text("slope.css")),
        scripts={name: Markup(text) for name, text in scripts.items()},
        data=json_island(plots),
        plots=list(plots),
        parameter_header=PARAMETER_HEADER,
        parameters=[parameter_cells(p) for p in c.parameters if p.identified],
        drive_header=DRIVE_HEADER,
        drives=[drive_cells(d) for d in c.drives],
        cannot_tell=c.cannot_tell,
        notes=[*notes, *c.notes],
    )  # fmt: skip


def _text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")
