"""Signals into the quantities that detectors read."""
