"""The commands as a user calls them: in this process, or in one of their own where the process itself matters."""

import contextlib
import os
import subprocess
import sys
from typing import NamedTuple

from typer.testing import CliRunner

from aqualog.cli.main import app

PLAIN = {"NO_COLOR": "1", "COLUMNS": "200"}


class Done(NamedTuple):
    """How a command ended, and what it printed."""

    exit_code: int
    stdout: str
    stderr: str

    @property
    def output(self):
        """Both streams."""
        return self.stdout + self.stderr


def run(*args, cwd=None, env=None):
    """A command in this process; what it does not turn into an exit code is raised."""
    with contextlib.chdir(cwd) if cwd else contextlib.nullcontext():
        done = CliRunner().invoke(app, [str(a) for a in args], env={**PLAIN, **(env or {})})
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Done(done.exit_code, done.stdout, done.stderr)


def run_process(*args, cwd=None, env=None):
    """The same in a process of its own, as installed: guarded, and with streams and signals of the system."""
    done = subprocess.run(
        [sys.executable, "-m", "aqualog", *map(str, args)], capture_output=True, text=True, cwd=cwd, check=False,
        env={**os.environ, **PLAIN, **(env or {})},
    )  # fmt: skip
    return Done(done.returncode, done.stdout, done.stderr)


def error_lines(result):
    """The lines of what failed."""
    assert "Traceback" not in result.stderr
    return [line for line in result.stderr.splitlines() if line.startswith("error:")]


def one_error_line(result):
    """The one line of what failed."""
    lines = error_lines(result)
    assert len(lines) == 1, result.stderr
    return lines[0]
