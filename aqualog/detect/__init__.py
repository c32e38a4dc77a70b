"""Detectors: one recursion each, for a whole drive and for a stream."""
