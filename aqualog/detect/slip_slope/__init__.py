"""Slip slope of the tyres: estimate, watch for changes, compare with the slope on dry road (thesis chapter 3)."""
