"""Slip slope of the tyres: estimated, watched for changes, compared with what it is on dry road (thesis chapter 3)."""
