"""The examples of the book and the README, run as a reader would run them: `python -m tests.book.examples [PAGE ...]` rewrites them.

What counts in a page, from top to bottom, in one folder that holds `sample_logs` and, where they exist, `real_logs`:

- A fence ``console``: each line that begins with `$ ` is run by bash, and what it prints stands below it. Where the
  printed output ends with a line `...`, only the lines before it are compared; more output follows.
- A fence ``python``: run in one session per page. A fence ``text`` right below it holds what it prints.
- Comments directly above a fence: `<!-- not run -->` leaves it out, `<!-- needs: real_logs -->` leaves it out where the
  measured drives are missing, `<!-- long -->` where nobody asks for what takes its time, `<!-- exit: 3 -->` is the code with which its last command ends,
  `<!-- file: map.toml -->` writes the fence's content to that file of the page's folder.

Two outputs are the same if their words are and their numbers agree within 0.2 % or one unit of the last digit shown:
other processors and libraries round otherwise. The version of aqualog, times that depend on the machine and the folder
are taken out before they are compared.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.forked import CALL

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "aqualog" / "docs"
REAL_LOGS = ROOT.parent / "shared" / "real_logs"
UNREAD = {"reference", "decisions"}  # generated, and history
FENCE = re.compile(r"^(```+)(\w*)\s*$")
COMMENT = re.compile(r"^<!--\s*(not run|long|[a-z]+:\s*.+?)\s*-->\s*$")
NUMBER = re.compile(r"[-+−]?\d[\d,]*\.?\d*(?:e[-+]?\d+)?%?")
MORE = "..."


def pages() -> list[Path]:
    """The README and every page of the book that has something to run."""
    found = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
    return [p for p in found if UNREAD.isdisjoint(p.relative_to(ROOT).parts) and any(runnable(p))]


@dataclass
class Block:
    """A fence of a page: `lines` without the fences, the first of them at `start` (from 0)."""

    language: str
    start: int
    lines: list[str]
    marks: dict[str, str] = field(default_factory=dict)
    answer: Block | None = None  # what a fence `python` prints

    @property
    def end(self) -> int:
        """Index of the closing fence."""
        return self.start + len(self.lines)


def blocks(text: str) -> list[Block]:
    """All fences of a page, with the comments directly above them."""
    lines = text.splitlines()
    found: list[Block] = []
    marks: dict[str, str] = {}
    i = 0
    while i < len(lines):
        opened = FENCE.match(lines[i])
        if opened:
            end = next((j for j in range(i + 1, len(lines)) if lines[j].rstrip() == opened[1]), len(lines))
            block = Block(opened[2], i + 1, lines[i + 1 : end], marks)
            before = found[-1] if found else None
            near = before and before.language == "python" and not "".join(lines[before.end + 1 : i]).strip()
            if near and before and block.language == "text" and not marks:
                before.answer = block
            found.append(block)
            marks, i = {}, end
        elif comment := COMMENT.match(lines[i]):
            key, _, value = comment[1].partition(":")
            marks = {**marks, key.strip(): value.strip()}
        else:
            marks = {}
        i += 1
    return found


def runnable(page: Path) -> Iterator[Block]:
    """The blocks of a page that are run."""
    for b in blocks(page.read_text(encoding="utf-8")):
        if b.language in ("console", "python") and "not run" not in b.marks:
            yield b


@dataclass
class Fault:
    """What is not as the page says."""

    line: int
    command: str
    why: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.command}\n{self.why}"


def check(page: Path, work: Path, *, long: bool = False, forked: str = "") -> tuple[str, list[Fault]]:
    """Run a page in the empty folder `work`: its text with the true output, and where it differed.

    `forked`: the socket of `tests.forked` for commands without their imports; default: commands as a reader starts them.
    """
    text = page.read_text(encoding="utf-8")
    lines = text.splitlines()
    edits: list[tuple[int, int, list[str]]] = []
    faults: list[Fault] = []
    with Session(work, forked) as session:
        for b in blocks(text):
            if (
                "not run" in b.marks
                or ("long" in b.marks and not long)
                or (b.marks.get("needs") == "real_logs" and not REAL_LOGS.is_dir())
            ):
                continue
            if "file" in b.marks:
                path = work / b.marks["file"]
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text("\n".join(b.lines) + "\n", encoding="utf-8")
            elif b.language == "console":
                new = _console(b, session, faults)
                if new != b.lines:
                    edits.append((b.start, b.end, new))
            elif b.language == "python":
                _python(b, session, faults, edits)
    for start, end, new in sorted(edits, reverse=True):
        lines[start:end] = new
    return "\n".join(lines) + "\n", faults


def _console(block: Block, session: Session, faults: list[Fault]) -> list[str]:
    new: list[str] = []
    entries = list(_commands(block))
    for number, (at, command, shown) in enumerate(entries):
        last = number == len(entries) - 1
        code, printed = session.shell("\n".join([command[0][2:], *command[1:]]))
        wanted = int(block.marks.get("exit", "0")) if last else 0
        if code != wanted:
            faults.append(
                Fault(at + 1, command[0], f"ended with exit code {code}, not {wanted}:\n" + "\n".join(printed))
            )
        now = _answer(shown, printed)
        if now != shown:
            faults.append(Fault(at + 1, command[0], _both(shown, now)))
        new += [*command, *now]
    return new


def _commands(block: Block) -> Iterator[tuple[int, list[str], list[str]]]:
    """Line, command (with the lines that continue it) and printed output of each command of a block."""
    i = 0
    while i < len(block.lines):
        begin = i
        while block.lines[i].endswith("\\") and i + 1 < len(block.lines):
            i += 1
        i += 1
        command = block.lines[begin:i]
        shown = []
        while i < len(block.lines) and not block.lines[i].startswith("$ "):
            shown.append(block.lines[i])
            i += 1
        if not command[0].startswith("$ "):
            raise ValueError(f"line {block.start + begin + 1}: a console example begins with '$ '")
        yield block.start + begin, command, shown


def _python(block: Block, session: Session, faults: list[Fault], edits: list[tuple[int, int, list[str]]]) -> None:
    fine, printed = session.python("\n".join(block.lines))
    if not fine:
        faults.append(Fault(block.start + 1, block.lines[0], "\n".join(printed)))
    elif block.answer:
        now = _answer(block.answer.lines, printed)
        if now != block.answer.lines:
            faults.append(Fault(block.answer.start + 1, "output", _both(block.answer.lines, now)))
            edits.append((block.answer.start, block.answer.end, now))


def _answer(shown: list[str], printed: list[str]) -> list[str]:
    """What the page should show: `shown` where it is still true, else what was printed, as long as `shown`."""
    cut = bool(shown) and shown[-1].strip() == MORE
    if cut:
        kept = printed[: max(len(shown) - 1, 1)]
        new = [*kept, MORE] if len(printed) > len(kept) else kept
    else:
        new = printed
    return shown if same(shown, new) else new


def same(a: Sequence[str], b: Sequence[str]) -> bool:
    """Whether two outputs have the same words and, within rounding, the same numbers."""
    one, two = (" ".join(normal("\n".join(x)).split()) for x in (a, b))
    if NUMBER.sub("#", one) != NUMBER.sub("#", two):
        return False
    return all(map(_near, NUMBER.findall(one), NUMBER.findall(two)))


def _near(a: str, b: str) -> bool:
    x, y = (s.replace(",", "").replace("−", "-").rstrip("%") for s in (a, b))
    digits = min(len(s.partition("e")[0].partition(".")[2]) for s in (x, y))
    return abs(float(x) - float(y)) <= max(0.002 * abs(float(x)), 1.0001 * 10**-digits if digits else 0.0)


def normal(text: str) -> str:
    """Without what changes from machine to machine and from version to version."""
    from aqualog import __version__

    text = text.replace(__version__, "VERSION")
    text = re.sub(r"\b\d+\.\d+\.\d+\b", "VERSION", text)
    text = re.sub(r"^(note: .*?),? \d+(\.\d+)? (ms|s|min)$", r"\1 TIME", text, flags=re.M)
    text = re.sub(r"\b\d+(\.\d+)? times as fast\b", "FACTOR times as fast", text)
    text = re.sub(r"\b\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(\+00:00|Z)?", "WHEN", text)
    text = re.sub(r"\b(in|took|took about|after) \d+(\.\d+)? (ms|s|min)\b", r"\1 TIME", text)
    text = re.sub(r"\b[0-9a-f]{16,64}\b", "HASH", text)
    return re.sub(r"[─━│┌┐└┘├┤┬┴┼╞╡═╪╭╮╯╰┆╌]+", " ", text)


def _both(shown: Sequence[str], now: Sequence[str]) -> str:
    return "\n".join(["the page has", *shown, "now printed", *now])


def environment() -> dict[str, str]:
    """What the examples have in common, wherever they run."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("AQUALOG_", "PYTEST_"))}
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **kept, "PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1", "PYTHONWARNINGS": "ignore", "NO_COLOR": "1",
        "COLUMNS": "100", "LC_ALL": "C.UTF-8", "TERM": "dumb", "PAGER": "cat", "POLARS_TABLE_WIDTH": "100",
        "PYDEVD_DISABLE_FILE_VALIDATION": "1",
    }  # fmt: skip


class Session:
    """A folder with the sample logs, a shell whose `aqualog` is this checkout's, and one Python."""

    def __init__(self, work: Path, forked: str = "") -> None:
        self.work = work.resolve()
        shutil.copytree(ROOT / "sample_logs", work / "sample_logs", ignore=shutil.ignore_patterns("__pycache__"))
        if REAL_LOGS.is_dir():
            (work / "real_logs").symlink_to(REAL_LOGS)
        programs = Path(tempfile.mkdtemp(prefix="examples-"))
        self.programs = programs
        (programs / "call").write_text(CALL, encoding="utf-8")
        for name, line in {
            "aqualog": f'exec "{sys.executable}" '
            + (f'-IS "{programs}/call" "{forked}"' if forked else "-m aqualog")
            + ' "$@"',
            "python": f'exec "{sys.executable}" "$@"',
        }.items():
            (programs / name).write_text(f"#!/bin/sh\n{line}\n", encoding="utf-8")
            (programs / name).chmod(0o755)
        self.environment = {**environment(), "PATH": f"{programs}:{os.environ['PATH']}"}
        self._python: subprocess.Popen[str] | None = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        if self._python:
            self._python.communicate()
        for path in self.programs.iterdir():
            path.unlink()
        self.programs.rmdir()

    def shell(self, command: str) -> tuple[int, list[str]]:
        """Exit code and lines of a command; what goes to stderr among them."""
        done = subprocess.run(
            ["bash", "-c", f"set -o pipefail\n{command}"], cwd=self.work, env=self.environment, text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300, check=False,
        )  # fmt: skip
        return done.returncode, self._lines(done.stdout)

    def python(self, code: str) -> tuple[bool, list[str]]:
        """Whether a piece of Python ran, and what it printed or why it did not."""
        if self._python is None:
            self._python = subprocess.Popen(
                [sys.executable, "-c", WORKER], cwd=self.work, env=self.environment, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        assert self._python.stdin is not None
        assert self._python.stdout is not None
        self._python.stdin.write(json.dumps(code) + "\n")
        self._python.stdin.flush()
        answer = self._python.stdout.readline()
        if not answer:
            return False, ["Python ended"]
        fine, printed = json.loads(answer)
        return fine, self._lines(printed)

    def _lines(self, text: str) -> list[str]:
        text = text.replace(str(self.work) + "/", "").replace(str(self.work), ".").replace(str(ROOT) + "/", "")
        text = re.sub(r"\x1b\[[0-9;]*m", "", text).replace("\r", "\n")
        lines = [line.rstrip() for line in text.splitlines()]
        lines = [line for line in lines if not re.match("note: (compiling|the detectors were compiled)", line)]
        while lines and not lines[-1]:
            lines.pop()
        return lines


WORKER = """
import ast, contextlib, io, json, sys, traceback
names, out = {"__name__": "__main__"}, sys.stdout
for line in sys.stdin:
    printed = io.StringIO()
    try:
        tree = ast.parse(json.loads(line))
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        with contextlib.redirect_stdout(printed):
            exec(compile(tree, "<example>", "exec"), names)
            if last is not None:
                value = eval(compile(ast.Expression(last.value), "<example>", "eval"), names)
                if value is not None:
                    print(repr(value))
        answer = True, printed.getvalue()
    except BaseException:
        answer = False, traceback.format_exc()
    out.write(json.dumps(answer) + "\\n")
    out.flush()
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Rewrite the pages; 1 where a command does not end as its page says."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.book.examples", description="Rewrite the examples of the book."
    )
    parser.add_argument("pages", nargs="*", type=Path, metavar="PAGE", help="all that have examples, if left out")
    parser.add_argument("--check", action="store_true", help="change nothing, print what differs")
    given = parser.parse_args(arguments)
    bad = 0
    for page in given.pages or pages():
        before = _seconds()
        with tempfile.TemporaryDirectory() as folder:
            text, faults = check(page.resolve(), Path(folder), long=True)
        ends = [f for f in faults if f.why.startswith(("ended", "Trace", "Python"))]
        bad += len(faults if given.check else ends)
        for fault in faults if given.check else ends:
            print(f"{page}, {fault}\n")
        old = page.read_text(encoding="utf-8")
        if not given.check and text != old:
            page.write_text(text, encoding="utf-8")
        print(
            f"{_seconds() - before:5.1f} s  {page.name}{'' if text == old else ' differs' if given.check else ' rewritten'}",
            flush=True,
        )
    return 1 if bad else 0


def _seconds() -> float:
    """Processor time of all commands so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    raise SystemExit(main())
