"""Pages that need no network: sections or a template filled, scripts inside, a policy that names them, data as JSON."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from aqualog import __version__
from aqualog.core.units import displayed_text
from aqualog.report.sections import Beside, Figures, Part, Report, Residuals, Section, Stack, Table, shown
from aqualog.report.values import readable

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["content_policy", "plotly_js", "render", "report_fragment", "report_page", "write_page"]

TEMPLATES = Path(__file__).parent / "templates"
# Stands for plotly.js while a template is filled, so that megabytes need not go through it; nothing that is escaped can
# hold it.
_PLOTLY_HERE = "/*<plotly.js>*/"
_DRAWN = (Figures, Residuals, Stack)
_MOST_ROWS = 20  # of a table in a notebook


def report_page(
    report: Report, *, title: str, template: str = "report.html.j2", plotly: str = "inside", **values: Any
) -> str:
    """The page of a report as HTML; the same text for the same report.

    Parameters
    ----------
    report : Report
    title : str
        Names the drives; may hold anything, it is escaped.
    template : str
        Extends `report.html.j2`; `values` are what it needs beyond that.
    plotly : str
        Where plotly.js is, see `render`; a page that draws nothing has none.
    """
    sections = shown(report.sections, "page")
    is_drawn = _is_drawn(sections)
    return render(
        template,
        css=("report.css",),
        scripts=report.scripts,
        islands={**({"figure-data": dict(report.figures)} if "figures.js" in report.scripts else {}), **report.islands},
        plotly=plotly if is_drawn else "",
        title=title,
        kind=report.kind,
        about=report.about,
        facts=report.facts,
        sections=sections,
        footer=report.footer,
        kind_of=_kind_of,
        is_drawn=is_drawn,
        **values,
    )


def _is_drawn(sections: Sequence[Section]) -> bool:
    parts = [p for s in sections for p in s.parts]
    return any(isinstance(p, _DRAWN) or (isinstance(p, Beside) and _is_drawn(p.sections)) for p in parts)


def report_fragment(report: Report) -> str:
    """The sections without their figures as HTML for a notebook, which has its own style; of long tables 20 rows."""
    sections = []
    for s in shown(report.sections, "page"):
        parts = [_few_rows(p) if isinstance(p, Table) else p for p in s.parts if not isinstance(p, _DRAWN)]
        sections += [replace(s, parts=parts, hint="")] if parts else []
    return _environment(TEMPLATES).get_template("fragment.html.j2").render(sections=sections, kind_of=_kind_of)


def _few_rows(table: Table) -> Table:
    beyond = len(table.rows) + len(table.more) - _MOST_ROWS
    if beyond <= 0:
        return table
    below = {i: text for i, text in table.below.items() if i < _MOST_ROWS - 1}
    below[_MOST_ROWS - 1] = f"and {beyond} more rows"
    return replace(table, rows=table.rows[:_MOST_ROWS], below=below, more=(), is_choice=False)


def _kind_of(part: Part) -> str:
    return type(part).__name__


def render(
    template: str,
    *,
    islands: Mapping[str, Any],
    folders: Sequence[Path] = (),
    css: Sequence[str] = (),
    scripts: Sequence[str] = ("figures.js",),
    plotly: str = "inside",
    **values: Any,
) -> str:
    """A page as HTML; the same text for the same values.

    Parameters
    ----------
    template : str
        Extends `base.html.j2`, which asks for `title`, `kind` and `about`.
    islands : mapping
        Documents that the scripts read, by the id of their element.
    folders : sequence of Path
        Where templates, styles and scripts are looked for before the folder of this package.
    css, scripts : sequence of str
        File names. `page.css` and `common.js` are on every page. All scripts are one, without global names.
    plotly : str
        `inside`; empty for a page without figures; else the address of a `plotly.min.js` that the pages of a folder
        share.
    values
        Of the template; texts may hold anything, they are escaped.
    """
    places = (*folders, TEMPLATES)
    script = _script(places, ("common.js", *scripts))
    inside = [_PLOTLY_HERE] if plotly == "inside" else []
    page = _environment(*places).get_template(template).render(
        version=__version__,
        policy=content_policy([*inside, script], loads=plotly not in ("", "inside")),
        plotly_at="" if inside else plotly,
        # Markup only for the package's own files, plotly.js and what _json has escaped
        css=Markup("".join(_text(places, name) for name in ("page.css", *css))),
        scripts=[Markup(x) for x in (*inside, script)],
        islands={name: _json(document) for name, document in islands.items()},
        **values,
    )  # fmt: skip
    before, found, after = page.partition(_PLOTLY_HERE)
    return f"{before}{plotly_js()}{after}" if found else page


def write_page(path: Path, page: str) -> None:
    """Write a page; what UTF-8 cannot hold, as the lone surrogate of a file name, becomes a question mark."""
    path.write_bytes(page.encode("utf-8", "replace"))


@cache
def _script(places: tuple[Path, ...], names: tuple[str, ...]) -> str:
    return '"use strict";\n(function () {\n' + "\n".join(_text(places, n) for n in names) + "})();\n"


def _text(places: Sequence[Path], name: str) -> str:
    return next(p / name for p in places if (p / name).is_file()).read_text(encoding="utf-8")


@cache
def _environment(*folders: Path) -> Environment:
    """Templates of folders, compiled once; what is put into one is escaped and made readable unless it is Markup.

    The filter `units` shows units in a text one way.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    found = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        finalize=lambda value: readable(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters["units"] = displayed_text
    return found


@cache
def plotly_js() -> str:
    """The whole of plotly.js, as a browser reads it."""
    # found without an import of plotly, which takes longer than all else of a page
    found = find_spec("plotly")
    if found is None or found.origin is None:
        raise ModuleNotFoundError("No module named 'plotly'", name="plotly")
    # CR LF becomes LF, as a browser reads it: the hash in the policy is of that
    return (Path(found.origin).parent / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


@cache
def _plotly_digest() -> str:
    """Hash of plotly.js for a policy."""
    return _digest(plotly_js())


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def content_policy(scripts: Iterable[str], *, loads: bool = False) -> str:
    """Content security policy: nothing is fetched, and only these very scripts run.

    Parameters
    ----------
    scripts : iterable of str
        Texts of the scripts in the page; `_PLOTLY_HERE` for plotly.js.
    loads : bool
        Whether these scripts may load further ones themselves, as pages that share one plotly.js do. A page on a disk
        has no origin: `'self'` names nothing there in some browsers and the whole disk in others. So trust goes by who
        asks: a script element that stands in the document stays forbidden.
    """
    digests = [_plotly_digest() if s == _PLOTLY_HERE else _digest(s) for s in scripts]
    allowed = " ".join([*(f"'sha256-{d}'" for d in digests), *(["'strict-dynamic'"] if loads else [])])
    # plotly sets style attributes and style elements; data: and blob: are for its "save as picture"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def _json(document: Any) -> Markup:
    """A document as JSON that no HTML parser can leave."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    for character, escaped in (("<", "\\u003c"), (">", "\\u003e"), ("&", "\\u0026")):
        text = text.replace(character, escaped)
    return Markup(text)
