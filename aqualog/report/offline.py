"""What makes a page one file that needs no network: scripts inside, a policy that names them, data that stay data."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

__all__ = ["TEMPLATES", "content_policy", "environment", "json_island", "plotly_js"]

TEMPLATES = Path(__file__).parent / "templates"


@cache
def environment(*folders: Path) -> Environment:
    """Templates of folders, compiled once; everything that is put into one is escaped unless it is Markup."""
    return Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def plotly_js() -> str:
    """The whole of plotly.js, as a browser reads it."""
    from plotly.offline import get_plotlyjs

    # a browser reads CR LF as LF, and the hash in the policy is of what the browser reads
    return str(get_plotlyjs()).replace("\r\n", "\n").replace("\r", "\n")


def content_policy(scripts: Iterable[str], *, loads: bool = False) -> str:
    """Content security policy: nothing is fetched, and only these very scripts run.

    Parameters
    ----------
    scripts : iterable of str
        Texts of the scripts in the page.
    loads : bool
        Whether these scripts may load further ones themselves, as pages that share one plotly.js do. A page on a disk
        has no origin: `'self'` names nothing there in some browsers and the whole disk in others. So trust goes by who
        asks: a script element that stands in the document stays forbidden.
    """
    digests = [base64.b64encode(hashlib.sha256(s.encode("utf-8")).digest()).decode("ascii") for s in scripts]
    allowed = " ".join([*(f"'sha256-{d}'" for d in digests), *(["'strict-dynamic'"] if loads else [])])
    # plotly sets style attributes and style elements; data: and blob: are for its "save as picture"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def json_island(document: Any) -> Markup:
    """A document as JSON that no HTML parser can leave."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    for character, escaped in (("<", "\\u003c"), (">", "\\u003e"), ("&", "\\u0026")):
        text = text.replace(character, escaped)
    return Markup(text)
