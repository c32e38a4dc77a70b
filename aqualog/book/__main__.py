"""`python -m aqualog.book` writes the generated pages and schemas; with `site DIR` it builds the site."""

from __future__ import annotations

import json
import sys
from importlib.util import find_spec
from pathlib import Path

from aqualog.book.topics import DOCS

__all__ = ["generated", "main"]


def generated() -> dict[Path, str]:
    """Every generated file with its text."""
    from aqualog.book import reference
    from aqualog.book.documents import DOCUMENTS
    from aqualog.book.documents.fields import schema
    from aqualog.book.reference.commands import commands_page
    from aqualog.cli.commands import loaded

    found = {DOCS / "reference" / "commands.md": commands_page(loaded())}
    found |= {DOCS / "reference" / f"{n}.md": reference.page(n) for n in reference.PAGES if n != "commands"}
    for name, document in DOCUMENTS.items():
        text = json.dumps(schema(document), indent=1, ensure_ascii=False) + "\n"
        found[DOCS / "schemas" / f"{name}.schema.json"] = text
    if find_spec("aqualog.book.sources"):
        from importlib import import_module

        found[DOCS / "sources.md"] = import_module("aqualog.book.sources").sources_page()
    return found


def main(arguments: list[str]) -> int:
    """Write what has changed and say which files that are; with `site DIR` build the site."""
    if arguments[:1] == ["site"] and len(arguments) == 2:
        return _site(Path(arguments[1]))
    if arguments:
        sys.stderr.write("usage: python -m aqualog.book [site DIR]\n")
        return 2
    for path, text in generated().items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            sys.stdout.write(f"{path.relative_to(DOCS)}\n")
    return 0


def _site(folder: Path) -> int:
    from aqualog.book.site import build
    from aqualog.core.errors import AqualogError

    try:
        build(folder)
    except AqualogError as error:
        sys.stderr.write(f"error: {error.what}\n")
        return int(error.exit_code)
    sys.stdout.write(f"{folder / 'index.html'}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
