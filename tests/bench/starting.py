"""What a command costs before it does anything."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.bench.compare import Row

EAGER = """
import sys, pkgutil, importlib, aqualog
for m in pkgutil.walk_packages(aqualog.__path__, "aqualog."):
    if not m.name.endswith("__main__"):
        importlib.import_module(m.name)
import asammdf, mcap, rosbags.highlevel
sys.argv = ["aqualog", "--help"]
from aqualog.cli.main import run
run()
"""
ARGPARSE = """
import argparse
p = argparse.ArgumentParser(prog="aqualog")
s = p.add_subparsers()
for n in "detect diagnose batch report figures simulate calibrate evaluate".split():
    s.add_parser(n, help=n)
try:
    p.parse_args(["--help"])
except SystemExit:
    pass
"""


def called(*command: str) -> str:
    """Stdout of a process."""
    done = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "100"}
    )
    return done.stdout


def rows() -> list[Row]:
    """`aqualog --help` beside itself with all imports, and beside argparse."""

    def ours() -> str:
        return called("-m", "aqualog", "--help")

    def unlike(a: str, b: str) -> str:
        return "" if "diagnose" in a and "diagnose" in b else "no help was printed"

    return [
        Row("`aqualog --help`, cold process", "the same with eager imports", 15.0, ours, lambda: called("-c", EAGER), unlike, clock="wall", rounds=5),
        Row("same", "argparse alone (limit)", 1.0 / 3.0, ours, lambda: called("-c", ARGPARSE), unlike, clock="wall"),
    ]  # fmt: skip
