"""The pages of the reference, each a pure function of tables in the code."""

from __future__ import annotations

from importlib import import_module

__all__ = ["PAGES", "page"]

PAGES = (
    "commands", "signals", "map", "vehicle", "campaign", "scenario", "thresholds", "effects", "documents", "exit_codes",
    "environment", "python",
)  # fmt: skip


def page(name: str) -> str:
    """The Markdown of one page of the reference."""
    text: str = import_module(f"aqualog.book.reference.{name}_page").text()
    return text
