"""Align channels: signal names, units, clocks and one common grid."""
