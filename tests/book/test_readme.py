"""The README is two screens, names every command, shows the commands that are checked, and leads into the book."""

import re

import pytest

from aqualog.model.programme import PROGRAMMES
from tests.conftest import ROOT

DOCS = ROOT / "aqualog" / "docs"
README = (ROOT / "README.md").read_text(encoding="utf-8")


def commands():
    from typer.main import get_command

    from aqualog.cli.main import app

    return sorted(get_command(app).commands)


def test_it_is_two_screens():
    assert len(README.encode()) <= 12_000


@pytest.mark.parametrize("command", commands())
def test_commands(command):
    assert f"`{command} " in README


def test_the_first_command_is_the_one_that_is_checked():
    command = "detect sample_logs/lane_drive.mf4 --vehicle sample_logs/vehicle.toml"
    assert f".venv/bin/aqualog {command} -o out" in README
    run = "".join(p.read_text(encoding="utf-8") for p in (ROOT / ".ci").iterdir())
    assert command in run


def test_every_page_of_the_guide_is_linked():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    for page in (DOCS / "guide").glob("*.md"):
        assert f"](aqualog/docs/guide/{page.name})" in README, page.name
        assert f"](guide/{page.name})" in index, page.name


@pytest.mark.parametrize(("programme", "what"), [("thesis", "drives"), ("situations", "situations")])
def test_the_size_of_a_programme_is_what_it_makes(programme, what):
    told = [
        int(n)
        for page in (ROOT / "README.md", *(DOCS / "guide").glob("*.md"), *(DOCS / "method").glob("*.md"))
        for line in page.read_text(encoding="utf-8").splitlines()
        if f"campaign {programme} " in line or "thesis' test programme" in line or "thesis' programme" in line
        for n in re.findall(rf"(\d+) {what}", line)
    ]
    assert told
    assert set(told) == {len(PROGRAMMES[programme]())}
