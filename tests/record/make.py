"""Runs the cases with one aqualog and keeps what comes of them."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from tests.damaged.damage import DAMAGES, bombs
from tests.damaged.logs import FORMATS, folder_of
from tests.record.cases import Case
from tests.record.compare import results_of
from tests.record.values import digest_of, masked, values_below

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
DRIVES = ROOT.parent / "shared" / "real_logs"
_TOOK = re.compile(r"^(note: .*\bin |note: results are .*, |note: .* simulated )[\d.]+ (s|min|h|times)\b", re.MULTILINE)

_ONCE = re.compile(r"^note: compiling .* once after an installation\n", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Tool:
    """How aqualog is called, and where Python looks for it ("" for its own place)."""

    command: tuple[str, ...]
    path: str = ""


def tool_of(place: str | None) -> Tool:
    """This checkout's aqualog, that of another Python, or an `aqualog` command."""
    if place is None:
        return Tool((sys.executable, "-m", "aqualog"), str(ROOT))
    return Tool((place, "-m", "aqualog") if Path(place).name.startswith("python") else (place,))


def make(cases: list[Case], folder: Path, tool: Tool, drives: Path) -> Iterator[tuple[Case, float]]:
    """Run cases in turn; each leaves `NAME.json` in the folder. Yields a case and its seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix="aqualog-record-") as place:
        work = Path(place).resolve()
        _furnish(work, drives)
        if any(case.needs_damaged for case in cases):
            _damage(work / "damaged")
        for case in cases:
            if case.needs_drives and not drives.is_dir():
                continue
            begin = perf_counter()
            text = json.dumps(run(case, work, tool, drives), indent=1)
            (folder / f"{case.name}.json").write_text(text, encoding="utf-8")
            yield case, perf_counter() - begin


def run(case: Case, work: Path, tool: Tool, drives: Path) -> dict[str, Any]:
    """One case: exit code, what was printed, values of what was written."""
    out = f"out/{case.name}"
    (work / out).mkdir(parents=True)
    line = shlex.split(case.line.replace("{o}", out))
    quiet = [] if line[0] == "cache" else ["--progress", "off"]
    done = subprocess.run(
        [*tool.command, *line, *quiet],
        cwd=work,
        env=_environment(work, tool),
        capture_output=True,
        text=True,
        check=False,
    )

    def plain(text: str) -> str:
        return masked(text.replace(f"{work}/", "").replace(f"{drives.resolve()}/", "real_logs/"))

    printed, told = plain(done.stdout), _ONCE.sub("", _TOOK.sub(r"\1TIME", plain(done.stderr)))
    kept = {"line": case.line, "exit": done.returncode, "stderr": told, "files": values_below(work / out, case.keep)}
    try:
        document = json.loads(printed)
    except json.JSONDecodeError:
        return kept | {"stdout": printed}
    if case.is_digest:
        return kept | {"digest": digest_of(results_of(document))}
    return kept | {"document": {k: document[k] for k in case.only if k in document} if case.only else document}


def _furnish(work: Path, drives: Path) -> None:
    """What the command lines name."""
    shutil.copytree(ROOT / "sample_logs", work / "sample_logs")
    shutil.copytree(HERE / "given", work / "given")
    shutil.copytree(ROOT / "tests" / "real", work / "cars", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    if drives.is_dir():
        (work / "real_logs").symlink_to(drives.resolve())


def _damage(folder: Path) -> None:
    """Damaged logs of every format, each in a folder of its number."""
    with TemporaryDirectory() as place:
        for name, make_log in FORMATS.items():
            log = make_log(Path(place))
            for number, damage in enumerate((*DAMAGES, *bombs(name))):
                path = folder / folder_of(name) / str(number) / log.name
                path.parent.mkdir(parents=True)
                path.write_bytes(damage.make(log.read_bytes()))


def _environment(work: Path, tool: Tool) -> dict[str, str]:
    """The caller's, without what would change a result."""
    own = {k: v for k, v in os.environ.items() if not k.startswith(("AQUALOG", "PYTHON"))}
    path = {"PYTHONPATH": tool.path} if tool.path else {}
    return own | path | {"TZ": "UTC", "NO_COLOR": "1", "COLUMNS": "120", "XDG_CACHE_HOME": str(work / "cache")}
