"""`python -m aqualog`."""

from aqualog.cli.main import run

run()
