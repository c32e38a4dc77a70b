"""Measurements of speed, each run by hand."""
