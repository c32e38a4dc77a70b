"""Detectors: each one recursion, for a whole drive and for a stream."""
