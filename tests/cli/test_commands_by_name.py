"""Commands are listed without being imported; what is listed is what they say of themselves."""

import inspect
import os
import re
import subprocess
import sys

import pytest
import typer

from aqualog.cli.commands import COMMANDS
from tests.commands import run
from tests.conftest import ROOT


@pytest.mark.parametrize("name", COMMANDS)
def test_the_line_of_a_command_is_its_own(name):
    target = COMMANDS[name].load(name)
    help_text = target.info.help if isinstance(target, typer.Typer) else inspect.getdoc(target)
    assert " ".join(help_text.split("\n\n")[0].split()) == COMMANDS[name].line
    shown = run(name, "--help")
    assert shown.exit_code == 0
    assert f" {name} [OPTIONS]" in shown.stdout


def test_all_are_listed_in_their_order():
    text = run("--help").stdout
    assert re.findall(r"^  ([a-z-]+)  ", text.split("Commands:")[1], re.MULTILINE) == list(COMMANDS)


def test_an_unknown_name_is_told_with_the_nearest():
    wrong = run("detekt")
    assert wrong.exit_code == 2
    assert "Did you mean 'detect'" in wrong.stderr


HELP_OF_ALL = """
import sys
from aqualog.cli.main import app
def show(*args):
    try:
        app([*args, "--help"])
    except SystemExit:
        print("LOADED", *sys.modules)
show()
for name in sys.argv[1:]:
    show(name)
"""


def test_help_has_examples_and_loads_nothing_heavy():
    done = subprocess.run([sys.executable, "-c", HELP_OF_ALL, *COMMANDS], capture_output=True, text=True, check=True)
    first, *others = re.split(r"^LOADED (.*)\n", done.stdout, flags=re.MULTILINE)[:-1]
    loaded = others.pop(0).split()
    assert "Commands:" in first
    assert {m for m in loaded if m.startswith("aqualog.cli.")} == {f"aqualog.cli.{m}" for m in ("main", "commands")}
    for name, text in zip(COMMANDS, others[::2], strict=True):
        assert name in ("campaign", "test") or f"aqualog {name}" in text.split("Examples:")[1], name
    heavy = {"numpy", "polars", "numba", "plotly", "jinja2", "scipy", "asammdf", "mcap"}
    assert not heavy & set(others[-1].split())


def test_modules_are_not_looked_through_for_garbage_at_the_end():
    code = (
        "import atexit, gc, sys; sys.argv = ['aqualog', '--version']\nfrom aqualog.cli.main import run\n"
        "atexit.register(lambda: print(gc.get_freeze_count() > 1000))\nrun()"  # what is registered first runs last
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True"


DETECT = """
import sys
from aqualog.cli.main import run
sys.argv = ["aqualog", "detect", *sys.argv[1:], "--quiet"]
try:
    run()
except SystemExit:
    print("LOADED", *sys.modules)
"""


def test_detect_loads_no_simulator_no_templates_and_no_writers():
    """A third of what it costs on a short log: what only other commands and a page need."""
    given = [ROOT / "sample_logs" / name for name in ("lane_drive.mf4", "vehicle.toml")]
    done = subprocess.run(
        [sys.executable, "-c", DETECT, given[0], "--vehicle", given[1]], capture_output=True, text=True, check=True,
        env={**os.environ, "AQUALOG_LIMITS": "off"},
    )  # fmt: skip
    loaded = done.stdout.split("LOADED")[1].split()
    assert "aqualog.detect.stream" in loaded
    unneeded = ("jinja2", "plotly", "scipy.signal", "pydantic", "aqualog.model", "aqualog.io.write_log")
    assert [m for m in loaded if m.startswith(unneeded)] == []
