"""Pages on a terminal: Markdown as text with headings, tables and code; links and pictures in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import StringIO
from typing import TYPE_CHECKING, ClassVar

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.markdown import CodeBlock, Heading, Markdown, TableElement
from rich.style import Style
from rich.table import Table
from rich.text import Text
from rich.theme import Theme

if TYPE_CHECKING:
    from rich.markdown import MarkdownElement

__all__ = ["shown"]

MOST_WIDTH = 110  # longer lines are hard to read
_PICTURE = re.compile(r"!\[([^\]]*)\]\([^)]*\)")
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)")
_FENCE = re.compile(r"^(```.*?^```)", re.DOTALL | re.MULTILINE)
_COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)
_THEME = Theme(
    {
        "markdown.code": "bold",
        "markdown.code_block": "dim",
        "markdown.item.bullet": "none",
        "markdown.item.number": "none",
        "markdown.block_quote": "italic",
        "markdown.table.border": "dim",
        "markdown.table.header": "bold",
    }
)


def shown(markdown: str, *, width: int, is_styled: bool) -> str:
    """The page as text of at most `width` columns; without `is_styled` not a single control character is in it."""
    stream = StringIO()
    console = Console(
        file=stream,
        width=min(width, MOST_WIDTH),
        force_terminal=is_styled,
        color_system="standard" if is_styled else None,
        no_color=True,  # bold, dim and underlined alone: they are seen on any background
        theme=_THEME,
        highlight=False,
        legacy_windows=False,
    )
    console.print(_Page(_in_words(markdown), hyperlinks=False), crop=False)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).strip("\n") + "\n"


def _in_words(markdown: str) -> str:
    """Links and pictures as words, outside of code."""
    parts = _FENCE.split(_COMMENT.sub("", markdown))
    return "".join(p if p.startswith("```") else _LINK.sub(_link, _PICTURE.sub(r"*[picture: \1]*", p)) for p in parts)


def _link(match: re.Match[str]) -> str:
    """A page is named by its topic, where the words do not say it; an address of the web stands in brackets."""
    words, target = match.groups()
    if target.startswith("#"):
        return words
    if "://" in target:
        return match.group()
    path = target.split("#")[0]
    name = path.rsplit("/", 1)[-1].removesuffix(".md")
    if not path.endswith(".md") or name == "index":
        return words
    said = re.sub(r"[^a-z0-9]", "", words.lower())
    return words if name.replace("_", "") == said else f"{words} (→ `{name}`)"


class _Heading(Heading):
    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        text = self.text.copy()
        text.justify = "left"
        if self.tag == "h1":
            text.stylize(Style(bold=True, underline=True))
        else:
            text.stylize(Style(bold=True))
        yield text


class _Code(CodeBlock):
    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        lines = "\n".join(f"    {line}".rstrip() for line in str(self.text).rstrip().splitlines())
        yield Text(lines, style="markdown.code_block", no_wrap=True, overflow="ignore")


class _Table(TableElement):
    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for made in super().__rich_console__(console, options):
            if isinstance(made, Table):
                made.show_edge = False
                made.pad_edge = False
                made.box = box.SIMPLE
                made.show_header = any(str(c.header).strip() for c in made.columns)
                made.expand = False
            yield made


class _Page(Markdown):
    elements: ClassVar[Mapping[str, type[MarkdownElement]]] = {  # type: ignore[assignment]
        **Markdown.elements, "heading_open": _Heading, "fence": _Code, "code_block": _Code, "table_open": _Table,
    }  # fmt: skip
