"""`python -m aqualog`."""

from aqualog.cli.start import run

run()
