"""Compute from signals the quantities that detectors read."""
