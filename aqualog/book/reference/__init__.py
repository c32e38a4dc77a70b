"""The pages of the reference, each a pure function of tables in the code."""

from __future__ import annotations

from importlib import import_module

__all__ = ["PAGES", "page"]

PAGES = {
    "commands": "commands", "signals": "signals", "map": "settings", "vehicle": "model", "campaign": "settings",
    "scenario": "settings", "thresholds": "settings", "boundaries": "settings", "effects": "model",
    "documents": "documents", "exit_codes": "machine", "environment": "machine", "python": "python",
}  # fmt: skip
"""Name of a page -> module that makes it."""


def page(name: str) -> str:
    """The Markdown of one page of the reference."""
    text: str = getattr(import_module(f"aqualog.book.reference.{PAGES[name]}"), f"{name}_page")()
    return text
