"""Channels onto one table: names, units, clocks, grid."""
