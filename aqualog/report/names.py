"""Names from logs and configurations in one line that can be read."""

from __future__ import annotations

import hashlib

__all__ = ["LONGEST", "cut", "name_digest"]

LONGEST = 90  # characters of a name that are shown


def cut(text: str, most: int = LONGEST) -> str:
    """One line of at most so many characters; what is cut gets a hash, so that two long names stay two."""
    line = "".join(c if c.isprintable() else "\ufffd" for c in text[:most])
    return line if len(text) <= most else f"{line[: most - 12]}… #{name_digest(text)[:8]}"


def name_digest(text: str) -> str:
    """A digest that distinguishes two names whose shown parts are equal."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
