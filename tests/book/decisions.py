"""Write the index of decisions again: `python -m tests.book.decisions`.

A decision is a heading of the second level, date first, with what it rules out below; the index lists all by date.
"""

import re
import unicodedata
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "aqualog" / "docs" / "decisions"
HEAD = """# Decisions

Why aqualog is as it is: one line a decision, newest first, by package.

Each entry says what was decided, why, and what it rules out. Write a new one at the end of its package's page, then run
`python -m tests.book.decisions`.

| date | package | decision |
|---|---|---|
"""


def pages():
    """Pages of decisions by package."""
    return {p.stem: p.read_text(encoding="utf-8") for p in sorted(FOLDER.glob("*.md")) if p.stem != "index"}


def decisions():
    """Date, package and title of all, newest first."""
    found = [
        (date, package, title)
        for package, text in pages().items()
        for date, title in re.findall(r"^## (\d{4}-\d\d-\d\d) (.+)$", text, re.M)
    ]
    return sorted(found, key=lambda d: d[0], reverse=True)


def anchor(heading):
    """The anchor that the site gives a heading."""
    plain = unicodedata.normalize("NFKD", heading.replace("`", "")).encode("ascii", "ignore").decode()
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip().lower())


def index():
    """The text of the index."""
    return HEAD + "".join(
        f"| {date} | {package} | [{title}]({package}.md#{anchor(f'{date} {title}')}) |\n"
        for date, package, title in decisions()
    )


if __name__ == "__main__":
    (FOLDER / "index.md").write_text(index(), encoding="utf-8")
