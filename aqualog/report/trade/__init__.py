"""Tyre tests for a reader: JSON, text, page."""
