"""Commands are listed without being imported; what is listed is what they say of themselves."""

import inspect
import re
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from aqualog.cli.commands import COMMANDS
from aqualog.cli.main import app


@pytest.mark.parametrize("name", COMMANDS)
def test_the_line_of_a_command_is_its_own(name):
    target = COMMANDS[name].load(name)
    help_text = target.info.help if isinstance(target, typer.Typer) else inspect.getdoc(target)
    assert " ".join(help_text.split("\n\n")[0].split()) == COMMANDS[name].line
    shown = CliRunner().invoke(app, [name, "--help"])
    assert shown.exit_code == 0
    assert f" {name} [OPTIONS]" in shown.stdout


def test_all_are_listed_in_their_order():
    text = CliRunner().invoke(app, ["--help"]).stdout
    assert re.findall(r"^  ([a-z-]+)  ", text.split("Commands:")[1], re.MULTILINE) == list(COMMANDS)


def test_an_unknown_name_is_told_with_the_nearest():
    wrong = CliRunner().invoke(app, ["detekt"])
    assert wrong.exit_code == 2
    assert "Did you mean 'detect'?" in wrong.stderr


def test_listing_imports_no_command():
    code = (
        "import sys; sys.argv = ['aqualog', '--help']\nfrom aqualog.cli.main import run\ntry:\n    run()\n"
        "except SystemExit:\n    print('LOADED', *(m for m in sys.modules if m.startswith('aqualog.cli.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split("LOADED")[1].split()) == {f"aqualog.cli.{m}" for m in ("main", "commands", "start")}


def test_modules_are_not_looked_through_for_garbage_at_the_end():
    code = (
        "import atexit, gc, sys; sys.argv = ['aqualog', '--version']\nfrom aqualog.cli.main import run\n"
        "atexit.register(lambda: print(gc.get_freeze_count() > 1000))\nrun()"  # what is registered first runs last
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True"
