"""Panels as PNG or SVG files, drawn by the browser that draws the page, in its light colours."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

from aqualog.core.errors import AqualogError
from aqualog.report.theme import LIGHT, in_light
from aqualog.thesis.draw import panel_figure
from aqualog.thesis.record import Figure

__all__ = ["FORMATS", "Pictures", "image_names"]

FORMATS = ("png", "svg")
_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
_PLACES = (
    "/usr/bin/chromium", "/usr/lib/chromium/chromium", "/snap/bin/chromium", "/opt/google/chrome/chrome",
    "/Applications/Google Chrome.app/Contents/MacOS/Google "
    "Chrome", "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
)  # fmt: skip
_WIDTH_PX, _TITLE_PX = 760, 40
_SCALE = 2  # dots per pixel of a PNG
_HINT = "pip install 'aqualog[images]', and Chromium or Chrome (or BROWSER_PATH)"


def browser() -> str | None:
    """Chromium or Chrome of this machine, BROWSER_PATH first; None without one."""
    told = os.environ.get("BROWSER_PATH")
    if told:
        return told if Path(told).is_file() else None
    found = next((p for n in _NAMES if (p := shutil.which(n))), None)
    return found or next((p for p in _PLACES if Path(p).is_file()), None)


def image_names(figure: Figure, suffix: str) -> list[str]:
    """Names of a figure's pictures: one per panel, figure_2_17_a.svg; without a letter if there is one only."""
    if len(figure.panels) == 1:
        return [f"{figure.stem}.{suffix}"]
    return [f"{figure.stem}_{chr(ord('a') + i)}.{suffix}" for i in range(len(figure.panels))]


def picture_of(figure: Figure, index: int) -> dict[str, Any]:
    """One panel as `data` and `layout` of plotly, with its title and plain colours."""
    panel = figure.panels[index]
    found: dict[str, Any] = in_light(panel_figure(panel))
    layout = found["layout"]
    letter = f" ({chr(ord('a') + index)})" if len(figure.panels) > 1 else ""
    layout |= {
        "width": _WIDTH_PX,
        "height": layout["height"] + _TITLE_PX,
        "paper_bgcolor": LIGHT["@paper"],
        "plot_bgcolor": LIGHT["@paper"],
        "title": {"text": f"Figure {figure.number}{letter}: {panel.title}", "font": {"size": 14}, "x": 0.02,
                  "xanchor": "left", "y": 0.98, "yanchor": "top"},
    }  # fmt: skip
    layout["margin"] = {**layout["margin"], "t": layout["margin"]["t"] + _TITLE_PX}
    return found


class Pictures:
    """One browser for all pictures of a command; use it with `with`.

    Raises
    ------
    AqualogError
        Without kaleido, without a browser, or if that does not start.
    """

    def __enter__(self) -> Pictures:
        try:
            import kaleido  # type: ignore[import-not-found,import-untyped,unused-ignore]
        except ImportError:
            raise AqualogError("PNG and SVG need the extra images", hint=_HINT) from None
        path = browser()
        if path is None:
            raise AqualogError("PNG and SVG need Chromium or Chrome, and none is found", hint=_HINT)
        self._kaleido = kaleido
        with _environment("BROWSER_PATH", path), _told("the browser does not start", path):
            # nothing from the network: plotly.js is the package's own
            kaleido.start_sync_server(path=path, plotlyjs=_plotly_js(), mathjax=False, silence_warnings=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._kaleido.stop_sync_server(silence_warnings=True)

    def draw(self, figure: Figure, suffix: str) -> Sequence[bytes]:
        """Pictures of a figure, one per panel."""
        drawn = []
        for i in range(len(figure.panels)):
            found = picture_of(figure, i)
            opts = {"format": suffix, "width": found["layout"]["width"], "height": found["layout"]["height"]}
            with _told(f"figure {figure.number} cannot be drawn", suffix):
                picture = self._kaleido.calc_fig_sync(found, opts=opts | ({"scale": _SCALE} if suffix == "png" else {}))
            drawn.append(picture if isinstance(picture, bytes) else str(picture).encode())
        return drawn


def _plotly_js() -> Path:
    import plotly

    return Path(plotly.__file__).parent / "package_data" / "plotly.min.js"


@contextmanager
def _environment(name: str, value: str) -> Iterator[None]:
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


@contextmanager
def _told(what: str, where: str) -> Iterator[None]:
    try:
        yield
    except AqualogError:
        raise
    except Exception as error:  # whatever the browser or its driver throws
        raise AqualogError(f"{what} ({type(error).__name__}: {str(error)[:200]})", where=where, hint=_HINT) from error
