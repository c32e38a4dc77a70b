"""`aqualog help`: the documents in the terminal."""

from __future__ import annotations

import os
import shutil
import sys
from typing import TYPE_CHECKING

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.book.topics import Topic

__all__ = ["help_pages"]

_MOST_PAGES = 12
_MOST_NAME = 80
_NAME_WIDTH = 22


@command("topic", has_steps=False, reads_logs=False)
def help_pages(run: Run, topic: list[str] | None) -> Output:
    """Show the documents: topics, one page, or the pages that hold a word.

    Without TOPIC, the topics are listed with a line each. A TOPIC that is the name of a page shows that page, on a
    terminal with PAGER or less. Any other word is searched for in all pages. Where two pages have one name, put the
    section before it: reference/campaign.

    \b
    Examples:
      aqualog help
      aqualog help campaign
      aqualog help cusum
      aqualog help reference/campaign
    """
    _show(_text([t for t in topic or () if t.strip()]))
    return Output()


def _text(asked: list[str]) -> str:
    """What is to be shown."""
    from aqualog.book.topics import find, nearest, search, topics
    from aqualog.cli.commands import COMMANDS
    from aqualog.core.errors import ConfigError

    pages = topics()
    if not asked:
        return _list(pages)
    name = " ".join(asked)
    if page := find(name, pages):
        return _page(page, page.text()) + _more(name, page, pages)
    if command := _command(name):
        return command
    if hits := search(name.split(), pages):
        lines = [_bold(f"{len(hits)} page{'' if len(hits) == 1 else 's'} with “{name}”")]
        for hit in hits[:_MOST_PAGES]:
            lines += ["", f"{_bold(_called(hit.topic, pages))}  {hit.topic.title}"]
            lines += [_cut(line, name.split()) for line in hit.lines]
            if hit.count > len(hit.lines):
                lines.append(f"    ... {hit.count - len(hit.lines)} more")
        if len(hits) > _MOST_PAGES:
            lines += ["", "also: " + ", ".join(_called(h.topic, pages) for h in hits[_MOST_PAGES:])]
        return "\n".join([*lines, "", "`aqualog help NAME` shows a page.", ""])
    near = nearest(name, [p.name for p in pages] + list(COMMANDS))
    hint = "aqualog help " + ", aqualog help ".join(near) if near else "aqualog help, which lists the topics"
    shown = name if len(name) <= _MOST_NAME else f"{name[:_MOST_NAME]}…"
    raise ConfigError(f'no page is named "{shown}", and no page holds this word', hint=hint)


def _list(pages: list[Topic]) -> str:
    from textwrap import wrap

    from aqualog.book.topics import SECTIONS

    width = max(50, _width())
    lines = ["aqualog help NAME shows a page; aqualog help WORD finds the pages that hold a word."]
    for section, title in SECTIONS.items():
        shown = [p for p in pages if p.section == section]
        if shown:
            lines += ["", _bold(title)]
        for page in shown:
            name = _called(page, pages)
            summary = wrap(page.summary.split(". ")[0].rstrip("."), width - _NAME_WIDTH - 3) or [page.title]
            head = [""] if len(name) > _NAME_WIDTH else []
            if head:
                lines.append(f"  {name}")
                name = ""
            lines.append(f"  {name:{_NAME_WIDTH}} {summary[0]}")
            lines += [f"  {'':{_NAME_WIDTH}} {s}" for s in summary[1:]]
    return "\n".join(lines) + "\n"


def _called(page: Topic, pages: list[Topic]) -> str:
    """The shortest name that finds the page."""
    from aqualog.book.topics import find

    short = page.section if page.name == "index" and page.section else page.name
    return short if find(short, pages) is page else page.address


def _page(page: Topic, text: str) -> str:
    from aqualog.book.terminal import shown

    return shown(text, width=_width(), is_styled=_is_styled())


def _more(name: str, page: Topic, pages: list[Topic]) -> str:
    """Where else to look: pages of the same name, and the options of a command."""
    from aqualog.cli.commands import COMMANDS

    others = [_called(p, pages) for p in pages if p.name == page.name and p is not page and p.name != "index"]
    lines = [f"See also: {', '.join(f'aqualog help {o}' for o in others)}"] if others else []
    command = page.name.replace("_", "-")
    if command in COMMANDS:
        lines.append(f"Options of the command: aqualog {command} --help")
    return "\n" + "\n".join(lines) + "\n" if lines else ""


def _command(name: str) -> str:
    """The entry of a command in the reference, or nothing."""
    from aqualog.book.topics import find, topics
    from aqualog.cli.commands import COMMANDS

    asked = name.lower().replace("_", "-").removeprefix("aqualog ").split()
    page = find("reference/commands", topics())
    if not asked or asked[0] not in COMMANDS or page is None:
        return ""
    entry = _entry(page.text(), asked)
    return _page(page, entry) if entry else ""


def _entry(text: str, asked: list[str]) -> str:
    """The part of the page of commands under the heading of one of them."""
    for words in (asked, asked[:1]):
        lines = iter(text.splitlines())
        wanted = f"## `aqualog {' '.join(words)}`"
        if any(line == wanted for line in lines):
            kept = []
            for line in lines:
                if line.startswith("## "):
                    break
                kept.append(line)
            return "\n".join([wanted.removeprefix("#"), *kept])
    return ""


def _cut(line: str, words: list[str]) -> str:
    """A line as long as the terminal is wide, with one of the words in it."""
    most = max(50, _width()) - 5
    at = max(line.lower().find(w.lower()) for w in words)
    if at > most - 20:
        line = f"…{line[at - most // 2 :]}"
    return f"    {line}" if len(line) <= most else f"    {line[: most - 1]}…"


def _width() -> int:
    return shutil.get_terminal_size((100, 24)).columns


def _is_styled() -> bool:
    is_plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return sys.stdout.isatty() and not is_plain


def _bold(text: str) -> str:
    return f"\x1b[1m{text}\x1b[0m" if _is_styled() else text


def _show(text: str) -> None:
    """Write the text, or page it where it is longer than the terminal."""
    is_long = text.count("\n") >= shutil.get_terminal_size().lines
    if not (sys.stdout.isatty() and sys.stdin.isatty() and is_long):
        sys.stdout.write(text)
        return
    import pydoc

    words = os.environ.get("PAGER", "").split()
    if words and shutil.which(words[0]) is None:  # it would show nothing
        del os.environ["PAGER"]
    os.environ.setdefault("LESS", "FRX")  # styles as they are, and the text stays on the screen
    pydoc.pager(text)
