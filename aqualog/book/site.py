"""The book as a site of files that open without a network: MkDocs with the theme Material."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from aqualog.book.sources import linked
from aqualog.book.topics import DOCS, SECTIONS, Topic, topics
from aqualog.core.errors import AqualogError, ConfigError

__all__ = ["build", "configuration", "navigation"]

_TOP = ("glossary", "sources")
"""Pages at the top that stand in the navigation by themselves; the others are together, the changelog last."""

_SHIM = "https://unpkg.com/iframe-worker/shim"
_SOURCES = Path("sources.md")
_WORKER = Path(__file__).parent / "worker.js"


def navigation(pages: list[Topic]) -> list[Any]:
    """Titles and pages in the order of the site's tabs."""
    by_section = {s: [p for p in pages if p.section == s] for s in SECTIONS}
    top = {p.name: p for p in by_section.pop("")}
    home, changelog = top.pop("index", None), top.pop("changelog", None)
    tabs: list[Any] = [{"Home": home.file}] if home else []
    decisions = by_section.pop("decisions")
    tabs += [{SECTIONS[s]: _entries(listed)} for s, listed in by_section.items() if listed]
    tabs += [{top.pop(n).title: f"{n}.md"} for n in _TOP if n in top]
    tabs += [{SECTIONS["decisions"]: _entries(decisions)}] if decisions else []
    tabs += [{"More": _entries(list(top.values()))}] if top else []
    return [*tabs, {changelog.title: changelog.file}] if changelog else tabs


def _entries(pages: list[Topic]) -> list[dict[str, str]]:
    return [{p.title: p.file} for p in pages]


def configuration(pages: list[Topic], *, docs: Path, out: Path) -> dict[str, Any]:
    """The settings of MkDocs: a warning ends the build, and no page loads anything from elsewhere."""
    return {
        "site_name": "aqualog",
        "site_description": "Find aquaplaning in drive logs",
        "docs_dir": str(docs),
        "site_dir": str(out),
        "strict": True,
        "use_directory_urls": False,
        "theme": {
            "name": "material",
            "font": False,
            "icon": {"logo": "material/car-traction-control"},
            "features": ["navigation.tabs", "navigation.indexes", "navigation.top", "search.highlight", "toc.follow"],
            "palette": [
                {"media": f"(prefers-color-scheme: {scheme})", "scheme": name, "primary": "blue grey", "toggle": toggle}
                for scheme, name, toggle in (
                    ("light", "default", {"icon": "material/weather-night", "name": "dark"}),
                    ("dark", "slate", {"icon": "material/weather-sunny", "name": "light"}),
                )
            ],
        },
        "plugins": ["search", "offline"],
        "markdown_extensions": [
            "tables",
            "attr_list",
            "md_in_html",
            "sane_lists",
            {"toc": {"permalink": True, "toc_depth": 3}},
            {"pymdownx.highlight": {"use_pygments": True}},
            "pymdownx.superfences",
        ],
        "validation": {
            "nav": {"omitted_files": "warn", "not_found": "warn", "absolute_links": "warn"},
            "links": {"not_found": "warn", "anchors": "warn", "absolute_links": "warn", "unrecognized_links": "warn"},
        },
        "nav": navigation(pages),
    }


def build(out: Path, *, docs: Path = DOCS) -> None:
    """Write the site into a folder, which is emptied before.

    Raises
    ------
    ConfigError
        If MkDocs or its theme is not installed.
    AqualogError
        If a page has a dead link or another fault; the message has the warnings.
    """
    if find_spec("mkdocs") is None or find_spec("material") is None:
        raise ConfigError("MkDocs with the theme Material is not installed", hint="pip install 'aqualog[dev]'")
    if out.exists() and any(out.iterdir()) and not (out / "sitemap.xml").exists():
        raise ConfigError("is a folder with other files", where=str(out), expected="an empty folder, or a site")
    with tempfile.TemporaryDirectory() as folder:
        # JSON is YAML, too
        settings, pages = Path(folder) / "mkdocs.yml", _cited(docs, Path(folder) / "docs")
        settings.write_text(json.dumps(configuration(topics(docs), docs=pages, out=out.absolute())), encoding="utf-8")
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", str(settings)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        warnings = [line for line in done.stderr.splitlines() if line.startswith(("WARNING", "ERROR"))]
        raise AqualogError(
            "\n".join(["the site cannot be built", *(warnings or [done.stderr[-2000:]])]), where=str(docs)
        )
    _make_local(out)


def _cited(docs: Path, folder: Path) -> Path:
    """Copy the pages; each citation becomes a link to its entry among the sources."""
    shutil.copytree(docs, folder)
    for path in folder.rglob("*.md"):
        page = path.relative_to(folder)
        if page != _SOURCES:
            to = "../" * len(page.parent.parts) + str(_SOURCES)
            path.write_text(linked(path.read_text(encoding="utf-8"), to), encoding="utf-8")
    return folder


def _make_local(out: Path) -> None:
    """Put a script of ours where the theme loads one from the network: search in pages opened as files needs it."""
    script = "assets/javascripts/worker.js"
    (out / script).write_text(_WORKER.read_text(encoding="utf-8"), encoding="utf-8")
    for path in out.rglob("*.html"):
        up = "../" * len(path.relative_to(out).parent.parts)
        text = path.read_text(encoding="utf-8")
        if _SHIM in text:
            path.write_text(text.replace(_SHIM, f"{up}{script}"), encoding="utf-8")
