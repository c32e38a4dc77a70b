"""Damaged logs of every format: what becomes of each, as a table. `python -m tests.damaged`."""
